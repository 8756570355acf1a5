"""How a detector is trained: the `[train]` tables of configs/learning.toml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.config import build, layered, merge, require
from shipland.vision.far.decode import Decoding


@dataclass(frozen=True)
class AugmentParameters:
    """How windows are drawn (`[train.augment]` in TOML).

    Attributes:
        scale_min, scale_max: log-uniform zoom; 1 keeps the picture's own pixels.
        fit: first scale the picture so that it just fits the window (for targets that fill the picture).
        on_target: chance that a window is laid over a target, where the picture has one.
        mosaic: chance of a window made from four.
        mirror: chance of a left-right mirror image.
        contrast, brightness, gamma, saturation: half-widths of uniform changes; brightness in grey levels.
        hue_deg: half-width of a uniform turn of the hue.
        blur: chance of a Gaussian blur.
        blur_max_px: its largest standard deviation.
        sharpen: chance of sharpening, where it was not blurred.
        sharpen_max: its largest strength, as a share of what a blur takes away.
        tone: half-width of a bend of the tone curve, S-shaped or the inverse.
        noise: chance of Gaussian noise.
        noise_max: its largest standard deviation, in grey levels.
        min_side_px: a target whose longer side is shorter is ignored by the loss.
        min_visible: a target of which a smaller part lies in the window is ignored by the loss.
    """

    scale_min: float
    scale_max: float
    fit: bool
    on_target: float
    mosaic: float
    mirror: float
    contrast: float
    brightness: float
    gamma: float
    saturation: float
    hue_deg: float
    blur: float
    blur_max_px: float
    sharpen: float
    sharpen_max: float
    tone: float
    noise: float
    noise_max: float
    min_side_px: float
    min_visible: float

    def __post_init__(self) -> None:
        require(0.0 < self.scale_min <= self.scale_max, "scale_min must be positive and at most scale_max")
        for name in ("on_target", "mosaic", "mirror", "blur", "sharpen", "noise", "min_visible"):
            require(0.0 <= getattr(self, name) <= 1.0, f"{name} must lie in 0 … 1, got {getattr(self, name)}")
        require(0.0 <= self.tone < 0.5, "tone must lie in 0 … 0.5, or grey levels change places")
        require(0.0 <= self.contrast < 1.0 and 0.0 <= self.gamma < 1.0, "contrast and gamma must lie in 0 … 1")


@dataclass(frozen=True)
class LossParameters:
    """Weights of the loss (`[train.loss]`).

    Attributes:
        box, objectness, kind: weights of the three parts.
        focal_power: exponent of the focal factor; 0 is plain cross-entropy.
        ignore_iou: an unassigned cell whose box overlaps a target more is not punished.
        anchor_ratio: largest ratio of a target's sides to a wide anchor's; below 4, the decoding's reach.
    """

    box: float
    objectness: float
    kind: float
    focal_power: float
    ignore_iou: float
    anchor_ratio: float

    def __post_init__(self) -> None:
        require(min(self.box, self.objectness, self.kind, self.focal_power) >= 0.0, "weights must not be negative")
        require(0.0 < self.ignore_iou <= 1.0, "ignore_iou must lie in 0 … 1")
        require(1.0 < self.anchor_ratio < 4.0, "anchor_ratio must lie in 1 … 4, the wide decoding's reach")


@dataclass(frozen=True)
class TrainParameters:
    """One profile of training (`[train.far]`, `[train.photos]`).

    Attributes:
        decoding: darknet or wide.
        anchors: fit to the set, or published.
        steps, batch, window_px: length and size.
        learning_rate, weight_decay, warmup_steps: AdamW, linear warm-up, cosine to 2 %.
        clip_norm: largest norm of a step's gradient.
        average_decay: decay of the exponential moving average of the weights.
        evaluate_every: steps between evaluations, each with a checkpoint.
        validation_pictures: pictures an evaluation looks at, at most.
        held_out: fraction of the pictures kept for validation.
        match_iou: overlap that counts as found.
        patience: evaluations without a better score before the run stops.
        hard_rounds: rounds of looking for what fools the detector, spread over the run; 0 for none.
        mine_pictures: training pictures looked at in a round.
        mine_keep: worst places kept: false boxes and missed targets.
        hard_fraction: part of a batch laid over those places.
        freeze_norm: keep the batch normalisation's statistics as they are; for fine-tuning, a third faster.
        bf16: compute in bf16 where it helps.
        calibration_pictures: windows that 8-bit ranges are taken from; 0 for no 8-bit file.
        augment: see `AugmentParameters`.
        loss: see `LossParameters`.
    """

    decoding: Decoding
    anchors: str
    steps: int
    batch: int
    window_px: int
    learning_rate: float
    weight_decay: float
    warmup_steps: int
    clip_norm: float
    average_decay: float
    evaluate_every: int
    validation_pictures: int
    held_out: float
    match_iou: float
    patience: int
    hard_rounds: int
    mine_pictures: int
    mine_keep: int
    hard_fraction: float
    freeze_norm: bool
    bf16: bool
    calibration_pictures: int
    augment: AugmentParameters
    loss: LossParameters

    def __post_init__(self) -> None:
        require(self.anchors in ("fit", "published"), f"anchors must be 'fit' or 'published', got {self.anchors!r}")
        require(self.window_px >= 64 and self.window_px % 32 == 0, "window_px must be a multiple of 32, at least 64")
        require(min(self.steps, self.batch, self.evaluate_every, self.patience) >= 1, "counts must be positive")
        require(0.0 < self.held_out < 1.0, "held_out must lie between 0 and 1")
        require(0.0 <= self.hard_fraction < 1.0, "hard_fraction must lie in 0 … 1")
        require(self.learning_rate > 0.0, "learning_rate must be positive")


def learning_table(section: str, config: Path | None) -> dict[str, object]:
    """A section of configs/learning.toml with the user's file laid over it; ConfigError for an unknown section."""
    return dict(layered("learning", config)[section])


def train_parameters(profile: str, config: Path | None) -> TrainParameters:
    """The packaged profile `far` or `photos`, the user's file laid over it."""
    tables = learning_table("train", config)
    common = {key: value for key, value in tables.items() if key not in ("far", "photos")}
    chosen = tables[profile]
    assert isinstance(chosen, dict)
    return build(TrainParameters, merge(common, chosen), f"train.{profile}")
