"""What `[geometric]` in TOML says: the errors of the geometric camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.config import require


@dataclass(frozen=True)
class BoxErrors:
    """`[geometric.ship]` and `[geometric.bar]`: a detector's errors at some ranges, linear between them.

    Attributes:
        range_m: ascending; beyond the last nothing is found.
        miss_rate: share of frames without a box.
        centre_px: standard deviation of a box's centre, column and row each.
        area: standard deviation of a box's area, as a share of it.
    """

    range_m: tuple[float, ...]
    miss_rate: tuple[float, ...]
    centre_px: tuple[float, ...]
    area: tuple[float, ...]

    def __post_init__(self) -> None:
        require(len(self.range_m) > 1 and bool(np.all(np.diff(self.range_m) > 0.0)), "range_m must ascend")
        for name in ("miss_rate", "centre_px", "area"):
            values = getattr(self, name)
            require(len(values) == len(self.range_m), f"{name} must have as many values as range_m")
            require(min(values) >= 0.0, f"{name} must not be negative")
        require(max(self.miss_rate) <= 1.0, "miss_rate must not exceed 1")


@dataclass(frozen=True)
class BoxParameters:
    """`[geometric.boxes]`: what counts as visible, and when a box is believed.

    Attributes:
        least_visible: share of the box that must lie in the picture.
        least_facing: sine of the flattest angle at which the bar is seen.
        confirm_hits, confirm_frames: a target is believed after so many hits in so many frames.
    """

    least_visible: float
    least_facing: float
    confirm_hits: int
    confirm_frames: int

    def __post_init__(self) -> None:
        require(1 <= self.confirm_hits <= self.confirm_frames, "confirm_hits must lie in 1 … confirm_frames")


@dataclass(frozen=True)
class DeckErrors:
    """`[geometric.deck]`.

    Attributes:
        least_m, most_m: from the camera; nearer too little of the markings is in view, farther they are too small.
        noise_m: standard deviation of a place along each axis.
        miss_rate: share of frames without a sight.
    """

    least_m: float
    most_m: float
    noise_m: float
    miss_rate: float

    def __post_init__(self) -> None:
        require(0.0 < self.least_m < self.most_m, "0 < least_m < most_m must hold")
        require(self.noise_m > 0.0, "noise_m must be positive")
        require(0.0 <= self.miss_rate < 1.0, "miss_rate must be in [0, 1)")


@dataclass(frozen=True)
class GeometricParameters:
    """`[geometric]`: the error model of the vision, fitted to rendered pictures.

    Attributes:
        corner_noise_px, corner_noise_px_per_m: standard deviation of a corner's column and row, each, at range zero,
            and its growth with range.
        max_range_m: beyond it nothing is found.
        miss_rate: share of frames without a pose within that range.
        border_px: a corner nearer than this to the picture's edge is cut off.
        ship, bar, boxes: of the far vision.
        deck: of the look down.
    """

    corner_noise_px: float
    corner_noise_px_per_m: float
    max_range_m: float
    miss_rate: float
    border_px: float
    ship: BoxErrors
    bar: BoxErrors
    boxes: BoxParameters
    deck: DeckErrors

    def __post_init__(self) -> None:
        require(self.corner_noise_px > 0.0, "corner_noise_px must be positive")
        require(self.corner_noise_px_per_m >= 0.0, "corner_noise_px_per_m must not be negative")
        require(self.max_range_m > 0.0, "max_range_m must be positive")
        require(0.0 <= self.miss_rate < 1.0, "miss_rate must be in [0, 1)")
        require(self.border_px >= 0.0, "border_px must not be negative")
