"""Consistency of a box with the horizon: whether its object can stand on the sea, and whether its size fits its place.

The gimbal gives the horizon. An object on the sea is nearer the farther below the horizon it lies. Where the camera's
height is known, the place of a box gives the range of its object; so does its size, if it holds the target. A buoy near
by has the size of a ship far off, and lies lower.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.frames import Array
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.vision.parameters import DetectorParameters

_MOST_EVIDENCE, _LEAST_EVIDENCE = 3.0, -6.0
_LEAST_HEIGHT_M = 0.3
_EDGE_PX = 2.0
_MOST_BOXES = 50
"""What is compared with one another, at most: bounds its time, whatever the picture."""


@dataclass(frozen=True)
class Subject:
    """Dimensions of one kind of target.

    Attributes:
        spans_m: how wide it may look, least and most, as most often seen.
        foot: where the point of known height lies in the box, from its middle (0) to its lower edge (0.5).
        foot_m: its height over the water.
        rise: how far above the horizon the box's middle may lie, in its own longer sides; negative for a box whose foot
            must lie below.
    """

    spans_m: tuple[float, float]
    foot: float
    foot_m: float
    rise: float


class HorizonConsistency:
    """Consistency of boxes of one kind of target, seen with one camera."""

    def __init__(self, subject: Subject, camera: Camera, parameters: DetectorParameters) -> None:
        self._subject, self._camera, self._parameters = subject, camera, parameters
        self._margin_rad = math.radians(parameters.horizon_margin_deg)
        self._level_rad = math.radians(parameters.horizon_sd_deg)

    def on_the_sea(self, boxes: list[Box], gimbal: GimbalAttitude) -> list[Box]:
        """The boxes that can belong to an object on the sea."""
        if not boxes:
            return boxes
        rise = self._subject.rise
        below_rad = self._below_rad(boxes, 0.5 if rise < 0.0 else 0.0, gimbal)
        sides_rad = np.array([max(box.size_px) for box in boxes]) / self._camera.focal_px
        most_rad = self._margin_rad + max(rise, 0.0) * sides_rad
        return [box for box, keep in zip(boxes, -below_rad <= most_rad, strict=True) if keep]

    def evidence(self, box: Box, frame: Frame) -> float:
        """Log-odds that a box of this size at this place holds the target.

        0 where the height is not known, or the picture's edge may have cut the target.

        The angle below the horizon at which the target would lie, at the range of its size, is compared with the angle
        measured. For the target they differ by its aspect and the errors of height and horizon; for other objects on
        the sea by their own size as well. Of the ranges that the spans allow, the most likely counts.
        """
        subject, parameters, height_m = self._subject, self._parameters, frame.height_m
        if height_m is None or not math.isfinite(height_m) or self._cut(box):
            return 0.0
        above_m = max(height_m, _LEAST_HEIGHT_M) - subject.foot_m
        found_rad = float(self._below_rad([box], subject.foot, frame.gimbal)[0])
        nearest_m, farthest_m = (
            self._camera.focal_px * span_m / max(box.size_px[0], 1.0) for span_m in subject.spans_m
        )
        measured_m = above_m / math.sin(found_rad) if found_rad * above_m > 0.0 else math.inf
        range_m = min(max(measured_m, nearest_m), farthest_m)
        wanted_rad = math.asin(min(max(above_m / range_m, -1.0), 1.0))
        scale_rad = 0.5 * (abs(wanted_rad) + abs(found_rad))
        known = self._level_rad**2 + (parameters.height_sd_m / range_m) ** 2 + (parameters.span_sd * scale_rad) ** 2
        other = known + (parameters.other_sd * scale_rad) ** 2
        off2 = (found_rad - wanted_rad) ** 2
        odds = 0.5 * (off2 / other - off2 / known + math.log(other / known))
        return min(max(odds, _LEAST_EVIDENCE), _MOST_EVIDENCE)

    def _cut(self, box: Box) -> bool:
        size_px = (self._camera.width_px, self._camera.height_px)
        return any(
            not 0.5 * wide + _EDGE_PX <= at <= whole - 1 - 0.5 * wide - _EDGE_PX
            for at, wide, whole in zip(box.centre_px, box.size_px, size_px, strict=True)
        )

    def _below_rad(self, boxes: list[Box], down: float, gimbal: GimbalAttitude) -> Array:
        """(n,) angles below the horizon of a point of each box, `down` of its height below its middle."""
        places = np.array([(box.centre_px[0], box.centre_px[1] + down * box.size_px[1]) for box in boxes])
        rays = self._camera.back_project(places) @ level_from_camera(gimbal).T
        return np.asarray(np.arcsin(np.clip(rays[:, 2], -1.0, 1.0)))


def apart(boxes: list[Box]) -> list[Box]:
    """The most confident of boxes that overlap: two boxes of one object would divide its evidence over two tracks."""
    kept: list[Box] = []
    for box in sorted(boxes, key=lambda item: -item.confidence)[:_MOST_BOXES]:
        if not any(_overlap(box, other) for other in kept):
            kept.append(box)
    return kept


def _overlap(box: Box, other: Box) -> bool:
    return all(
        abs(at - there) < 0.5 * (size + wide)
        for at, there, size, wide in zip(box.centre_px, other.centre_px, box.size_px, other.size_px, strict=True)
    )
