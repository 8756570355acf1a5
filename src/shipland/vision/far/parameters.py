"""What `[detector]` in TOML says of the far detectors."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from shipland.config import Table, build, key, parameters, require, sections

Precision = Literal["auto", "bf16", "fp32"]
Runtime = Literal["auto", "openvino", "onnxruntime"]


@parameters
class Confirmation:
    """When a candidate is believed (`[detector.ship]`, `[detector.bar]`)."""

    start_confidence: float = key(0.3, "least confidence that starts a candidate, on the whole frame", gt=0, le=1)
    track_confidence: float = key(0.25, "least confidence that continues one, or the target", gt=0, le=1)
    confirm_hits: int = key(2, "a track is believed after so many hits, and enough evidence", ge=1)
    confirm_frames: int = key(4, "in so many frames")
    neutral_confidence: float = key(
        0.25, "a box of this confidence, where the track expects it, speaks neither for nor against", gt=0, le=1
    )
    believe_evidence: float = key(12.0, "log-odds above neutral that a track must gather, its size's included", ge=0)
    doubt_evidence: float = key(3.0, "a target whose boxes have gathered less than minus this is given up", ge=0)
    most_evidence: float = key(20.0, "log-odds that it can gather at most")
    miss_evidence: float = key(1.0, "log-odds that a frame without a box takes away", ge=0)
    size_weight: float = key(
        3.0, "of the log-odds of the box's size against those of single frames, which repeat", ge=0
    )

    def __post_init__(self) -> None:
        require(self.confirm_hits <= self.confirm_frames, "confirm_hits must lie in 1 … confirm_frames")
        require(self.believe_evidence <= self.most_evidence, "believe_evidence must lie in 0 … most_evidence")


@parameters
class DetectorParameters:
    """How the far detectors run (`[detector]`)."""

    ship_weights: str = key("ship", "name of packaged weights or path of an ONNX file")
    bar_weights: str = key("bar", "name of packaged weights or path of an ONNX file")
    ship_class: str = key("ship", "name or number of the class that is the ship, in weights of several classes")
    bar_class: str = key("bar", "name or number of the class that is the bar, in weights of several classes")
    runtime: Runtime = key("auto", "auto, openvino or onnxruntime")
    precision: Precision = key("auto", "auto, bf16 or fp32")
    threads: int = key(0, "CPU threads; 0 leaves it to the runtime", "0: the runtime's choice", ge=0, le=256)
    acquire_confidence: float = key(
        0.4, "least confidence of a box in a single picture, where nothing else is known", gt=0, le=1
    )
    ship: Confirmation = key(
        Confirmation(), "when a ship is believed", "studies/confirmation.py: docs/results/far-vision.md"
    )
    bar: Confirmation = key(
        Confirmation(
            start_confidence=0.4,
            confirm_hits=3,
            neutral_confidence=0.55,
            believe_evidence=3.0,
            most_evidence=12.0,
            size_weight=1.0,
        ),
        "when a bar is believed",
        "chosen; replayed on its own scenes and kept",
    )
    max_iou: float = key(
        0.45, "overlap above which the less confident of two boxes goes", "Darknet's detector demo", gt=0, le=1
    )
    tile_min_px: int = key(
        224, "least side of the square tile around a track", "chosen: seven network cells about a small target", gt=0
    )
    tile_max_px: int = key(
        416,
        "largest side of that tile; a network of one picture size searches whole frames in tiles of this side as well",
        "chosen: YOLOv3's usual input; [Lee2022] gives none",
    )
    tile_per_target: float = key(2.5, "the tile's side over the target's longer side, at least", gt=1)
    gate_px: float = key(24.0, "a track takes a box whose centre is within this, and the two below")
    gate_px_s: float = key(160.0, "times the time since the track's last box", "10 deg/s of yaw rate at 931 px")
    gate_sizes: float = key(0.5, "times the longer side of the track's last box")
    gate_growth: float = key(
        1.8, "largest ratio of a track's boxes, one frame apart", "chosen: small boxes jump by a pixel or two", gt=1
    )
    most_candidates: int = key(6, "candidates at a time", ge=1, le=100)
    horizon_margin_deg: float = key(
        1.5, "how far above the horizon the foot of a ship may seem to lie: the gimbal's error"
    )
    ship_rise: float = key(
        -1.0, "largest rise of its middle above the horizon, in its longer sides", "its foot lies below the horizon"
    )
    bar_rise: float = key(
        4.0, "largest rise of its middle above the horizon, in its longer sides", "it hangs 1.65 m over the sea"
    )
    height_sd_m: float = key(
        0.7, "of the camera's height over the water", "chosen: a barometer's drift, a take-off a metre up", gt=0
    )
    horizon_sd_deg: float = key(0.2, "error of the horizon", gt=0)
    span_sd: float = key(
        0.3, "of the apparent width by aspect and box, as a share", "measured: docs/results/far-vision.md", gt=0
    )
    other_sd: float = key(1.8, "that of the width of other objects", "chosen: docs/decisions/020", gt=0)
    lost_frames: int = key(6, "a track ends after so many frames without a hit", ge=1, le=1000)
    stale_s: float = key(
        2.0, "a track ends without a frame for so long", "chosen: four cycles of the paper's detector", ge=0.1, le=10
    )
    sure_confidence: float = key(
        0.85, "a target of at least this mean confidence, without a rival, is sure", gt=0, le=1
    )
    recheck_frames: int = key(
        30, "a whole frame is searched again every so many frames while the target is sure,", ge=1
    )
    doubt_frames: int = key(5, "or every so many while it is not", ge=1)
    recheck_margin: float = key(0.5, "log-odds by which a rival's mean must be better to take over")
    score_gain: float = key(0.3, "weight of a new box in the running mean of a track's confidence, 0 … 1", gt=0, le=1)
    bar_search_ship_px: float = key(
        10.0, "the bar is looked for in ships' boxes this wide", "chosen: 170 m; the bar has 7.7 px"
    )
    velocity_gain: float = key(0.5, "weight of a new box's displacement in a track's velocity, 0 … 1", gt=0, le=1)

    def __post_init__(self) -> None:
        require(
            0 < self.tile_min_px <= self.tile_max_px and not (self.tile_min_px % 32 or self.tile_max_px % 32),
            "tile_min_px ≤ tile_max_px must be multiples of 32",
        )


def learning_table(section: str, config: Path | None) -> Table:
    """What a user's file says of the detectors or their training; ConfigError for an unknown section."""
    table: Table = sections(config, ("detector", "train", "synth", "evaluate")).get(section, {})
    return table


def detector_parameters(config: Path | None = None) -> DetectorParameters:
    """How the far detectors run, `[detector]` of the file `config` laid over the defaults."""
    return build(DetectorParameters, learning_table("detector", config), "detector")
