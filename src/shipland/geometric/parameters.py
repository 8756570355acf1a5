"""What `[geometric]` in TOML says: the errors of the geometric camera."""

from __future__ import annotations

import numpy as np

from shipland.config import key, parameters, require


@parameters
class BoxErrors:
    """`[geometric.ship]` and `[geometric.bar]`: a detector's errors at some ranges, linear between them."""

    range_m: tuple[float, ...] = key(..., "ascending; beyond the last nothing is found")
    miss_rate: tuple[float, ...] = key(..., "share of frames without a box")
    centre_px: tuple[float, ...] = key(..., "standard deviation of a box's centre, column and row each")
    area: tuple[float, ...] = key(..., "standard deviation of a box's area, as a share of it")

    def __post_init__(self) -> None:
        require(len(self.range_m) > 1 and bool(np.all(np.diff(self.range_m) > 0.0)), "range_m must ascend")
        for name in ("miss_rate", "centre_px", "area"):
            values = getattr(self, name)
            require(len(values) == len(self.range_m), f"{name} must have as many values as range_m")
            require(min(values) >= 0.0, f"{name} must not be negative")
        require(max(self.miss_rate) <= 1.0, "miss_rate must not exceed 1")


@parameters
class BoxParameters:
    """`[geometric.boxes]`: what counts as visible, and when a box is believed."""

    least_visible: float = key(0.5, "share of the box that must lie in the picture", "as in [synth]")
    least_facing: float = key(0.17, "sine of the flattest angle at which the bar is seen", "as in [synth]")
    confirm_hits: int = key(3, "a target is believed after so many hits", "as in [detector]", ge=1)
    confirm_frames: int = key(4, "in so many frames", "as in [detector]")

    def __post_init__(self) -> None:
        require(self.confirm_hits <= self.confirm_frames, "confirm_hits must lie in 1 … confirm_frames")


@parameters
class DeckErrors:
    """`[geometric.deck]`."""

    least_m: float = key(0.5, "from the camera; nearer, too little of the markings is in view", gt=0)
    most_m: float = key(2.5, "from the camera; farther, they are too small")
    noise_m: float = key(0.004, "standard deviation of a place along each axis", gt=0)
    miss_rate: float = key(0.02, "share of frames without a sight", ge=0, lt=1)

    def __post_init__(self) -> None:
        require(self.least_m < self.most_m, "least_m < most_m must hold")


@parameters
class GeometricParameters:
    """`[geometric]`: the error model of the vision, fitted to rendered pictures.

    Poses err as on rendered pictures, whose corners err by more, but together: tools/fit_geometric.py.
    """

    corner_noise_px: float = key(0.018, "standard deviation of a corner's column and row, each, at range zero", gt=0)
    corner_noise_px_per_m: float = key(0.0008, "its growth with range", ge=0)
    max_range_m: float = key(22.0, "beyond it nothing is found", gt=0)
    miss_rate: float = key(0.0, "share of frames without a pose within that range", ge=0, lt=1)
    border_px: float = key(3.0, "a corner nearer than this to the picture's edge is cut off", ge=0)
    ship: BoxErrors = key(
        BoxErrors(
            range_m=(12.5, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 340.0),
            miss_rate=(0.0, 0.05, 0.0, 0.0, 0.02, 0.05, 0.05, 0.26),
            centre_px=(2.6, 1.7, 1.0, 0.8, 0.8, 0.9, 0.9, 0.8),
            area=(0.12, 0.17, 0.13, 0.2, 0.14, 0.24, 0.2, 0.27),
        ),
        "boxes of the ship",
        "tools/fit_boxes.py on 240 rendered scenes of three frames: docs/results/far-vision.md",
    )
    bar: BoxErrors = key(
        BoxErrors(
            range_m=(5.0, 15.0, 30.0, 60.0, 100.0, 130.0, 150.0),
            miss_rate=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.03),
            centre_px=(1.3, 0.8, 0.4, 0.3, 0.3, 0.3, 0.3),
            area=(0.06, 0.11, 0.11, 0.14, 0.21, 0.14, 0.12),
        ),
        "boxes of the bar",
        "tools/fit_boxes.py on 240 rendered scenes of three frames: docs/results/far-vision.md",
    )
    boxes: BoxParameters = BoxParameters()
    deck: DeckErrors = key(DeckErrors(), "of the look down")
