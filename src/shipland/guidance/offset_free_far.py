"""Far control without steady error: boxes become places, and the filter of near control flies on them.

Ours, not the paper's. Range comes from the box's area, bearing and elevation from its centre; their errors grow with
range, and the filter weighs them so. A ship under way shows in it as the disturbance that near control cancels too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shipland.config import require
from shipland.guidance.estimate import Measured
from shipland.guidance.far import FarSight, FarTables, FarTarget
from shipland.guidance.laws import clamp
from shipland.guidance.near import Sticks
from shipland.guidance.offset_free import OffsetFreeNear, OffsetFreeParameters
from shipland.guidance.response import Response

_HEADINGS = 16
"""Cycles that the compass is remembered for: more than lie between a picture and its command."""


@dataclass(frozen=True)
class OffsetFreeFarParameters:
    """`[guidance.offset_free_far]`.

    Attributes:
        area_share: standard deviation that a box's area is given, as a share of it.
        centre_px: likewise of its centre.
        heading_rad: likewise of the compass.
        floor_m: least standard deviation of a place.
        above_m: height to fly at over the target's centre.
        glide_path_deg: steepest way down to that height.
        motion: of the filters and the speed profile.
    """

    area_share: float
    centre_px: float
    heading_rad: float
    floor_m: float
    above_m: float
    glide_path_deg: float
    motion: OffsetFreeParameters

    def __post_init__(self) -> None:
        for name in ("area_share", "centre_px", "heading_rad", "floor_m"):
            require(getattr(self, name) > 0.0, f"{name} must be positive")
        require(0.0 < self.glide_path_deg < 90.0, "glide_path_deg must be between 0 and 90")


class OffsetFreeFar:
    """Flies to the range at which the target's box has Table 1's setpoint.

    Args:
        parameters: weights and limits.
        response: what the vehicle makes of its sticks.
        focal_px: of the camera.
        middle_px: (2,) its principal point.
        tables: Table 1; only the areas' setpoints are used.
        areas_m2: of platform and board, seen from astern.
    """

    def __init__(
        self,
        parameters: OffsetFreeFarParameters,
        response: Response,
        focal_px: float,
        middle_px: tuple[float, float],
        tables: FarTables,
        areas_m2: Mapping[FarTarget, float],
    ) -> None:
        self._parameters, self._response = parameters, response
        self._focal_px, self._middle_px, self._tables, self._areas_m2 = focal_px, middle_px, tables, areas_m2
        self._motion = OffsetFreeNear(parameters.motion, response)
        self._t_s = -math.inf
        self._headings: deque[tuple[float, float]] = deque(maxlen=_HEADINGS)

    def sticks(self, sight: FarSight) -> Sticks:
        """Sticks towards the reference point."""
        if sight.heading_error_deg is None:
            self._headings.clear()
        else:
            self._headings.append((sight.ready_s, -math.radians(sight.heading_error_deg)))
        measured, bearing_rad = self._measured(sight)
        if sight.t_s > self._t_s:
            self._motion.observe(measured, sight.ready_s)
            self._t_s = sight.t_s
        sticks = self._motion.sticks()
        turn_rad = bearing_rad if sight.heading_error_deg is None else math.radians(sight.heading_error_deg)
        turn_rad_s = self._parameters.motion.turn_per_s * turn_rad
        return sticks._replace(yaw=clamp(100.0 * turn_rad_s / self._response.max_turn_rad_s, 100.0))

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """Remember the sticks sent and when they act."""
        self._motion.sent(ready_s, sticks)

    def reset(self) -> None:
        """Place and speed start anew with the next box; the disturbance stays."""
        self._motion.reset()

    def _measured(self, sight: FarSight) -> tuple[Measured, float]:
        """The box as a position relative to the reference point, and its bearing [rad]."""
        parameters, box = self._parameters, sight.box
        area_m2, gains = self._areas_m2[sight.target], self._tables.of(sight.target)
        range_m = self._focal_px * math.sqrt(area_m2 / max(box.area_px2, 1.0))
        wanted_m = self._focal_px * math.sqrt(area_m2 / gains.pitch.setpoint)
        right = (box.centre_px[0] - self._middle_px[0]) / self._focal_px
        elevation_rad = sight.gimbal_pitch_rad - math.atan2(box.centre_px[1] - self._middle_px[1], self._focal_px)
        up_m = range_m * math.tan(elevation_rad) + parameters.above_m
        # Too high for the glide path: no nearer until lower, else the ship is flown over.
        wanted_m = max(wanted_m, -up_m / math.tan(math.radians(parameters.glide_path_deg)))
        error = np.array([range_m - wanted_m, range_m * right, up_m])
        across_m = range_m * parameters.centre_px / self._focal_px
        deviation = np.array([0.5 * parameters.area_share * range_m, across_m, across_m])
        variance = deviation**2 + parameters.floor_m**2
        heading_rad, heading_variance = self._heading_at(sight.t_s)
        return Measured(sight.t_s, error, variance, heading_rad, heading_variance, elevation_rad), math.atan(right)

    def _heading_at(self, t_s: float) -> tuple[float, float]:
        """Compass heading relative to the desired one [rad] and its variance; 0 and 1 rad² without a compass."""
        if not self._headings:
            return 0.0, 1.0
        times_s, headings_rad = zip(*self._headings, strict=True)
        return float(np.interp(t_s, times_s, np.unwrap(headings_rad))), self._parameters.heading_rad**2
