"""Parameters of the near chain and of the look down, `[vision]` in TOML, and of the far detectors, `[detector]`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from shipland.config import Table, build, key, parameters, require, sections

Precision = Literal["auto", "bf16", "fp32"]
Runtime = Literal["auto", "openvino", "onnxruntime"]
Band = tuple[int, int]


@parameters
class DeckVisionParameters:
    """`[vision.deck]`.

    Measured on drawn pictures.
    """

    least_m: float = key(0.5, "lowest height of the camera over the deck at which it is looked for", gt=0)
    most_m: float = key(2.5, "highest height of the camera over the deck at which it is looked for")
    least_correlation: float = key(
        0.85, "of plan and view, for a deck", "wrong places have 0.64 at most, right ones 0.88", gt=0, lt=1
    )
    largest_tilt_deg: float = key(20.0, "of a deck against the level")
    largest_turn_deg: float = key(20.0, "of a deck against the nose")
    deviation_m: float = key(0.004, "standard deviation of a place along each axis per metre of height", gt=0)

    def __post_init__(self) -> None:
        require(self.least_m < self.most_m, "least_m < most_m must hold")


@parameters
class VisionParameters:
    """The near chain [Lee2022, §Classical Computer Vision Based Approach]."""

    hue: Band = key(
        (35, 85), "colour gate in OpenCV's range 0 … 179, both ends included", "[Lee2022, §Image Filtering]"
    )
    saturation: Band = key((70, 255), "colour gate, both ends included", "[Lee2022, §Image Filtering]")
    value: Band = key((90, 255), "colour gate, both ends included", "[Lee2022, §Image Filtering]")
    kernel_px: int = key(
        3, "side of the square kernel of opening and closing", "chosen: keeps a rectangle 5 px high", ge=1
    )
    watershed_margin: float = key(
        0.01, "erosion and dilation, as a share of the region's longer side", "[Lee2022, §Image Filtering]", gt=0
    )
    min_side_px: float = key(4.0, "shortest side of a quadrilateral", gt=0)
    max_candidates: int = key(
        60, "most regions of one picture, the largest", "chosen: bounds the time that foliage takes", ge=1, le=1000
    )
    quads: Literal["hull", "bounding"] = key(
        "hull",
        "published chain: where the search for corners starts, at four corners of a region's hull, or at those of its "
        "upright bounding rectangle",
        "hull: chosen | bounding: [Lee2022, §Contour and Corner Detection]",
    )
    screen: Literal["tolerant", "printed"] = key(
        "tolerant",
        "published chain: opposite sides are compared after the pose, and the corners' errors are allowed for; or "
        "before it, to 10 % in length and 5 % in slope however short they are",
        "tolerant: chosen | printed: [Lee2022, §Detected Points Screening]",
    )
    forstner_fraction: float = key(
        0.2, "published chain: window as a share of the shorter side", "[Lee2022, Eq. 1], erratum 4", gt=0
    )
    forstner_min_px: float = key(5.0, "published chain: least side of that window", "erratum 4", gt=0)
    edge_reach_px: float = key(
        3.0, "how far across a side pixels are taken; more where the picture is blurred", ge=1, le=20
    )
    edge_floor_px: float = key(
        0.012, "least error of one column of pixels across a side", "measured: docs/results/near-vision.md", ge=0
    )
    edge_clipped_px: float = key(
        0.15, "further error of a whole side where the cue saturates", "measured on rendered pictures that clip", ge=0
    )
    edge_coded_px: float = key(
        1.8,
        "standard deviation of a further error of a whole side of up to 20 px in pictures coded with colour at "
        "half resolution, as JPEG and H.264 are, per unit of misfit of the fitted edges (they have 0.02 to 0.1): "
        "coding moves blocks, and a side with them. A longer side lies in more blocks of independent errors",
        "measured on rendered H.264 films at 1–8 Mbit/s, errors of sides against misfits",
        ge=0,
    )
    edge_bias_px: float = key(
        0.3,
        "standard deviation of the common outward error of all sides, as a lamp's blooming and a camera's tone "
        "curve have it. The pose solves for it: rectangles that grow and a gap between them that shrinks "
        "distinguish it from distance",
        "chosen: what clipping and steep tone curves leave",
        ge=0,
    )
    row_motion_px_s: float = key(
        250.0,
        "of the cue over a rolling shutter's picture without an earlier one",
        "chosen: half a radian a second",
        ge=0,
    )
    row_shake_px_s: float = key(
        30.0, "likewise of its change since the last picture", "chosen: half a pixel at 10 Hz", ge=0
    )
    max_blur: float = key(
        0.1,
        "largest standard deviation of the picture's blur, as a fraction of the cue's shortest side: beyond, the "
        "smears of opposite sides meet, and corners are off by more than their covariance",
        "measured on pictures smeared by 2–25 px: studies/spoiled_cue.py",
        gt=0,
        le=1,
    )
    max_noise: float = key(
        0.06,
        "largest error of a side's end, of the shortest side",
        "chosen: twice H.264's at 1 Mbit/s and 15 m",
        gt=0,
        le=1,
    )
    corner_noise_px: float = key(0.17, "of a Förstner corner, per axis", "measured: docs/results/near-vision.md", gt=0)
    reprojection_px: float = key(
        0.1,
        "largest root-mean-square reprojection error, in addition to the cue's `Cue.manufacturing_tolerance` "
        "and four standard deviations of the corners",
        gt=0,
        le=10,
    )
    max_distance_m: float = key(30.0, "farthest pose that is accepted", gt=0, le=1000)
    max_obliquity_deg: float = key(
        50.0, "of the line of sight against the cue's normal", "chosen: 40° off and 25° below at once", gt=0, lt=90
    )
    max_roll_deg: float = key(
        40.0, "of the camera against the cue", "chosen: tells the upper side from the others", gt=0, le=90
    )
    several_cues: Literal["nearest", "refuse"] = key(
        "nearest", "where the whole cue is there more than once, the nearest is taken, or all are refused"
    )
    track_s: float = key(
        1.0, "the last pose predicts the next for so long", "chosen: two cycles of the learned detector", ge=0, le=10
    )
    track_climb_mps: float = key(
        3.0,
        "vertical speed that a pose may have against the last one within `track_s`, half a metre allowed; a "
        "faster one is of the cue's reflection and is refused. 0 leaves the test out",
        ge=0,
        le=50,
    )
    track_margin: float = key(
        0.06, "growth of the tracked region on each side, as a fraction of the cue's width or height", ge=0
    )
    track_margin_px: float = key(24.0, "its least", gt=0)
    gimbal_noise_rad: float = key(
        0.001, "prior of the cue's vertical from the gimbal; 0: none", "above camera.gimbal_noise_rad", ge=0, le=0.2
    )
    deck: DeckVisionParameters = key(DeckVisionParameters(), "of the look down")

    def __post_init__(self) -> None:
        for name, top in (("hue", 179), ("saturation", 255), ("value", 255)):
            low, high = getattr(self, name)
            require(0 <= low <= high <= top, f"{name} must be two rising numbers in 0 … {top}, got {[low, high]}")
        require(self.kernel_px >= 1 and self.kernel_px % 2 == 1, f"kernel_px must be odd, got {self.kernel_px}")


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
