"""Parameters of the near chain and of the look down: `[vision]` in TOML."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shipland.config import require, require_within

Band = tuple[int, int]


@dataclass(frozen=True)
class DeckVisionParameters:
    """`[vision.deck]`.

    Attributes:
        least_m, most_m: height of the camera over the deck at which it is looked for.
        least_correlation: of plan and view, for a deck.
        largest_tilt_deg, largest_turn_deg: of a deck against the level, and against the nose.
        deviation_m: standard deviation of a place along each axis per metre of height.
    """

    least_m: float
    most_m: float
    least_correlation: float
    largest_tilt_deg: float
    largest_turn_deg: float
    deviation_m: float

    def __post_init__(self) -> None:
        require(0.0 < self.least_m < self.most_m, "0 < least_m < most_m must hold")
        require(0.0 < self.least_correlation < 1.0, "least_correlation must be in (0, 1)")
        require(self.deviation_m > 0.0, "deviation_m must be positive")


@dataclass(frozen=True)
class VisionParameters:
    """The near chain [Lee2022, §Classical Computer Vision Based Approach].

    Attributes:
        hue, saturation, value: the colour gate in OpenCV's ranges (hue 0 … 179), both ends included.
        kernel_px: side of the square kernel of opening and closing.
        watershed_margin: erosion and dilation around the boundary, as a fraction of the region's longer side.
        min_side_px: shortest side of a quadrilateral.
        max_candidates: most regions of one picture, the largest.
        forstner_fraction, forstner_min_px: window side of Förstner's operator as a fraction of the quadrilateral's
            shorter side, and its least (erratum 4); of the published chain.
        edge_reach_px: how far across a side pixels are taken; more where the picture is blurred.
        edge_floor_px: standard deviation of the error of one column of pixels across a side without any noise.
        edge_clipped_px: standard deviation of a further error of a whole side where the cue saturates: the edge then
            seems to lie where its pixels meet it.
        edge_coded_px: standard deviation of a further error of a whole side of up to 20 px in pictures coded with
            colour at half resolution, as JPEG and H.264 are, per unit of misfit of the fitted edges (they have 0.02 to
            0.1): coding moves blocks, and a side with them. A longer side lies in more blocks of independent errors.
        edge_bias_px: standard deviation of the common outward error of all sides, as a lamp's blooming and a camera's
            tone curve have it. The pose solves for it: rectangles that grow and a gap between them that shrinks
            distinguish it from distance.
        row_motion_px_s: standard deviation, along columns and along rows, of how fast the cue moves over the picture of
            a rolling shutter (`Camera.row_time_s`) without an earlier picture.
        row_shake_px_s: the same of the change of that motion since the last picture.
        max_blur: largest standard deviation of the picture's blur, as a fraction of the cue's shortest side: beyond,
            the smears of opposite sides meet, and corners are off by more than their covariance.
        max_noise: largest standard deviation of a side's end, as a fraction of the cue's shortest side: sides that are
            not straight, as an ellipse's, state a large one.
        corner_noise_px: standard deviation of a Förstner corner, per axis.
        reprojection_px: largest root-mean-square reprojection error, in addition to the cue's
            `Target.manufacturing_tolerance` and four standard deviations of the corners.
        max_distance_m: farthest pose that is accepted.
        max_obliquity_deg: largest angle between the line of sight and the cue's normal.
        max_roll_deg: largest roll of the camera against the cue.
        several_cues: where the whole cue is there more than once, the nearest is taken, or all are refused.
        track_s: longest time over which the last pose predicts the next.
        track_climb_mps: vertical speed that a pose may have against the last one within `track_s`, half a metre
            allowed; a faster one is of the cue's reflection and is refused. 0 leaves the test out.
        track_margin: growth of the tracked region on each side, as a fraction of the cue's width or height.
        track_margin_px: its least.
        gimbal_noise_rad: standard deviation of the frame's gimbal roll and pitch, as a prior of the cue's vertical; 0
            leaves the gimbal out.
        deck: of the look down.
    """

    hue: Band
    saturation: Band
    value: Band
    kernel_px: int
    watershed_margin: float
    min_side_px: float
    max_candidates: int
    forstner_fraction: float
    forstner_min_px: float
    edge_reach_px: float
    edge_floor_px: float
    edge_clipped_px: float
    edge_coded_px: float
    edge_bias_px: float
    row_motion_px_s: float
    row_shake_px_s: float
    max_blur: float
    max_noise: float
    corner_noise_px: float
    reprojection_px: float
    max_distance_m: float
    max_obliquity_deg: float
    max_roll_deg: float
    several_cues: Literal["nearest", "refuse"]
    track_s: float
    track_climb_mps: float
    track_margin: float
    track_margin_px: float
    gimbal_noise_rad: float
    deck: DeckVisionParameters

    def __post_init__(self) -> None:
        for name, top in (("hue", 179), ("saturation", 255), ("value", 255)):
            low, high = getattr(self, name)
            require(0 <= low <= high <= top, f"{name} must be two rising numbers in 0 … {top}, got {[low, high]}")
        require(self.kernel_px >= 1 and self.kernel_px % 2 == 1, f"kernel_px must be odd, got {self.kernel_px}")
        for name in (
            "edge_floor_px", "edge_clipped_px", "edge_coded_px", "edge_bias_px", "row_motion_px_s", "row_shake_px_s",
            "track_s", "track_climb_mps", "track_margin", "gimbal_noise_rad",
        ):  # fmt: skip
            require(getattr(self, name) >= 0.0, f"{name} must not be negative")
        for name in (
            "watershed_margin", "min_side_px", "forstner_fraction", "forstner_min_px", "max_blur", "max_noise",
            "corner_noise_px", "reprojection_px", "max_distance_m",
            "track_margin_px",
        ):  # fmt: skip
            require(getattr(self, name) > 0.0, f"{name} must be positive, got {getattr(self, name)}")
        require_within(
            self,
            edge_reach_px=(1.0, 20.0),
            max_candidates=(1, 1000),
            max_blur=(0.0, 1.0),
            max_noise=(0.0, 1.0),
            reprojection_px=(0.0, 10.0),
            max_distance_m=(0.0, 1000.0),
            track_s=(0.0, 10.0),
            track_climb_mps=(0.0, 50.0),
            gimbal_noise_rad=(0.0, 0.2),
        )
        require(0.0 < self.max_obliquity_deg < 90.0, "max_obliquity_deg must be between 0 and 90")
        require(0.0 < self.max_roll_deg <= 90.0, "max_roll_deg must be between 0 and 90")
