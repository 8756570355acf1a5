"""How a detector is trained: `[train]` in TOML."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from shipland.config import build, key, merge, parameters, plain, require
from shipland.vision.far.decode import Decoding
from shipland.vision.parameters import learning_table


@parameters
class AugmentParameters:
    """How windows are drawn (`[train.augment]` in TOML)."""

    scale_min: float = key(0.75, "least of a log-uniform zoom; 1 keeps the picture's own pixels", gt=0)
    scale_max: float = key(1.3, "largest zoom")
    fit: bool = key(False, "first scale the picture so that it just fits the window (for targets that fill it)")
    on_target: float = key(0.7, "chance that a window is laid over a target, where the picture has one", ge=0, le=1)
    mosaic: float = key(0.25, "chance of a window made from four", ge=0, le=1)
    mirror: float = key(0.5, "chance of a left-right mirror image", ge=0, le=1)
    contrast: float = key(0.25, "half-width of a uniform change", ge=0, lt=1)
    brightness: float = key(20.0, "half-width of a uniform change, in grey levels")
    gamma: float = key(0.25, "half-width of a uniform change", ge=0, lt=1)
    saturation: float = key(0.3, "half-width of a uniform change")
    hue_deg: float = key(6.0, "half-width of a uniform turn of the hue")
    blur: float = key(0.2, "chance of a Gaussian blur", ge=0, le=1)
    blur_max_px: float = key(0.8, "its largest standard deviation")
    sharpen: float = key(0.25, "chance of sharpening, where it was not blurred", ge=0, le=1)
    sharpen_max: float = key(1.5, "its largest strength, as a share of what a blur takes away")
    tone: float = key(0.4, "half-width of a bend of the tone curve, S-shaped or the inverse", ge=0, lt=0.5)
    noise: float = key(0.3, "chance of Gaussian noise", ge=0, le=1)
    noise_max: float = key(6.0, "its largest standard deviation, in grey levels")
    min_side_px: float = key(4.0, "a target whose longer side is shorter is ignored by the loss")
    min_visible: float = key(0.4, "a target of which less lies in the window is ignored by the loss", ge=0, le=1)

    def __post_init__(self) -> None:
        require(self.scale_min <= self.scale_max, "scale_min must be at most scale_max")


@parameters
class LossParameters:
    """Weights of the loss (`[train.loss]`)."""

    box_error: Literal["complete_iou", "squared"] = key(
        "complete_iou", "error of a box; squared as published, with darknet decoding", "Zheng et al., AAAI 2020"
    )
    box: float = key(2.0, "weight of the boxes", ge=0)
    objectness: float = key(1.0, "weight of the objectness", ge=0)
    kind: float = key(0.5, "weight of the kind", ge=0)
    focal_power: float = key(1.5, "exponent of the focal factor; 0 is plain cross-entropy, as published", ge=0)
    ignore_iou: float = key(
        0.5, "an unassigned cell whose box overlaps a target more is not punished", "[YOLOv3, §2.1]", gt=0, le=1
    )
    anchor_ratio: float = key(
        3.0, "largest ratio of a target's sides to a wide anchor's", "chosen; the wide decoding reaches 4", gt=1, lt=4
    )


@parameters
class TrainParameters:
    """One profile of training (`[train.far]`, `[train.photos]`)."""

    decoding: Decoding = key(Decoding.WIDE, "darknet or wide")
    anchors: Literal["fit", "published"] = key("fit", "fit to the set, or published")
    steps: int = key(6000, "of the run", ge=1)
    batch: int = key(16, "pictures a step", ge=1)
    window_px: int = key(288, "side of a window", ge=64)
    learning_rate: float = key(0.002, "AdamW, largest", gt=0)
    weight_decay: float = key(0.0005, "AdamW", "Darknet's yolov3.cfg", ge=0)
    warmup_steps: int = key(150, "linear; then cosine to 2 %")
    clip_norm: float = key(10.0, "largest norm of a step's gradient", gt=0)
    average_decay: float = key(0.998, "of the weights' moving average", "chosen for some thousand steps", ge=0, lt=1)
    evaluate_every: int = key(500, "steps between evaluations, each with a checkpoint", ge=1)
    validation_pictures: int = key(400, "pictures an evaluation looks at, at most", ge=1)
    held_out: float = key(0.05, "fraction of the pictures kept for validation", gt=0, lt=1)
    match_iou: float = key(0.3, "overlap that counts as found", "one pixel costs a 7-px box a quarter", gt=0, lt=1)
    patience: int = key(12, "evaluations without a better score before the run stops", ge=1)
    hard_rounds: int = key(5, "rounds of looking for what fools the detector, spread over the run; 0 for none")
    mine_pictures: int = key(1500, "training pictures looked at in a round", ge=0)
    mine_keep: int = key(400, "worst places kept: false boxes and missed targets", ge=0)
    hard_fraction: float = key(0.25, "part of a batch laid over those places", ge=0, lt=1)
    freeze_norm: bool = key(False, "keep the batch normalisation's statistics; for fine-tuning, a third faster")
    bf16: bool = key(True, "compute in bf16 where it helps")
    calibration_pictures: int = key(200, "windows that 8-bit ranges are taken from; 0 for no 8-bit file", ge=0)
    augment: AugmentParameters = key(AugmentParameters(), "see `AugmentParameters`")
    loss: LossParameters = key(LossParameters(), "see `LossParameters`")

    @property
    def fit_px(self) -> int:
        """Whole pictures are first scaled to this longer side; 0 keeps native pixels."""
        return self.window_px if self.augment.fit else 0

    def __post_init__(self) -> None:
        require(self.window_px % 32 == 0, "window_px must be a multiple of 32, at least 64")
        require(
            self.loss.box_error != "squared" or self.decoding is Decoding.DARKNET,
            'loss.box_error = "squared" is of Darknet\'s decoding: set decoding = "darknet"',
        )


PROFILES = {
    "far": TrainParameters(),
    "photos": TrainParameters(
        steps=1500,
        batch=8,
        window_px=416,
        learning_rate=0.001,
        evaluate_every=150,
        validation_pictures=200,
        held_out=0.2,
        match_iou=0.5,
        hard_rounds=3,
        mine_pictures=400,
        mine_keep=150,
        augment=AugmentParameters(
            scale_min=0.6, scale_max=1.5, fit=True, on_target=0.5, mosaic=0.5, mirror=0.5, min_side_px=8.0
        ),
    ),
}
"""`far`: native windows, small targets; `photos`: targets that fill the picture."""


def train_parameters(profile: str, config: Path | None) -> TrainParameters:
    """The profile `far` or `photos`, `[train]` of the user's file and the table of that profile in it laid over it."""
    table = learning_table("train", config)
    common = {name: value for name, value in table.items() if name not in PROFILES}
    mine = merge(merge(plain(PROFILES[profile]), common), table.get(profile, {}))
    return build(TrainParameters, mine, f"train.{profile}")
