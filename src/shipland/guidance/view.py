"""Directions in the picture and by the compass: of what the aircraft flies on, and where it was seen last."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.camera import Camera
from shipland.frames import wrap_angle
from shipland.messages import Observation

_KEPT_S = 3.0
"""Headings are kept for longer than a picture takes from exposure to its command."""


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


@dataclass(frozen=True)
class HeadingHistory:
    """Compass headings of the last seconds, so that a bearing is added to the heading of its own picture.

    Attributes:
        samples: (time [s], heading [rad]), times increasing.
    """

    samples: tuple[tuple[float, float], ...] = ()

    def with_sample(self, t_s: float, heading_rad: float | None) -> HeadingHistory:
        """With a new sample; without a compass the history is empty."""
        if heading_rad is None:
            return HeadingHistory()
        kept = tuple(sample for sample in self.samples if t_s - _KEPT_S < sample[0] < t_s)
        return HeadingHistory((*kept, (t_s, heading_rad)))

    def at(self, t_s: float) -> float | None:
        """Heading [rad] by line between samples, the nearest one outside them; None without a compass."""
        if not self.samples:
            return None
        before = after = self.samples[-1]
        for sample in reversed(self.samples):
            after, before = before, sample
            if sample[0] <= t_s:
                break
        if t_s <= before[0] or t_s >= after[0] or after[0] <= before[0]:
            return before[1] if t_s <= before[0] else after[1]
        share = (t_s - before[0]) / (after[0] - before[0])
        return before[1] + share * wrap_angle(after[1] - before[1])
