"""Directions and ranges of what the picture shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.camera import Camera
from shipland.messages import Observation


@dataclass(frozen=True)
class View:
    """The properties of the camera that guidance needs.

    Attributes:
        focal_px: mean focal length.
        middle_px: principal point, (column, row).
        half_view_rad: from the picture's middle to its left and right edges.
    """

    focal_px: float
    middle_px: tuple[float, float]
    half_view_rad: float

    @staticmethod
    def of(camera: Camera) -> View:
        """Of a camera's intrinsics."""
        middle_px = (float(camera.matrix[0, 2]), float(camera.matrix[1, 2]))
        return View(camera.focal_px, middle_px, math.atan2(0.5 * camera.width_px, camera.focal_px))

    def bearing_rad(self, column_px: float) -> float:
        """Of a column of the picture, clockwise from its middle."""
        return math.atan2(column_px - self.middle_px[0], self.focal_px)

    def range_m(self, area_px2: float, side_m: float) -> float:
        """Of a box by its area, whose object has the area of a square with side `side_m`, seen frontally."""
        return self.focal_px * side_m / math.sqrt(area_px2)

    def depression_rad(self, row_px: float) -> float:
        """Of a row of the picture, below its middle."""
        return math.atan2(row_px - self.middle_px[1], self.focal_px)


def target_column_px(observation: Observation) -> float | None:
    """Column of the picture in which the target is seen: the cue's, else its box's; None where nothing is seen."""
    box = observation.bar_box or observation.ship_box
    if observation.bar_pose is not None:
        columns_px = observation.bar_pose.corners_px[:, 0]
        return float(columns_px.sum()) / max(len(columns_px), 1)
    return None if box is None else box.centre_px[0]
