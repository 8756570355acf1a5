"""Corners to errors: what one picture says of the aircraft's place, and what near control believes after filtering."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from shipland.frames import Array, rotation_from_euler
from shipland.messages import BarPose, GimbalAttitude


@dataclass(frozen=True)
class MeasuredError:
    """Where one picture puts the aircraft against the reference, in the axes that the sticks move it in.

    Attributes:
        t_s: exposure time [s].
        age_s: from there to the decision.
        error_in_level_m: (3,) forward, right, up to the reference point.
        yaw_rad: heading against the bar.
        bar_elevation_rad: the bar's centre above the horizon, from the camera.
        velocity_in_level_mps: (3,) the vehicle's own as told last; None where it does not say.
        wanted_in_bar_m: (3,) the reference point.
        corners_px: (4n,2) of the cue in the picture, as of `BarPose`; none where it is not known.
        gimbal: the camera's attitude at the exposure.
        heading_rad: by the compass, at the exposure; None without one.
        velocity_t_s: when the velocity was true; None: at the decision.
    """

    t_s: float
    age_s: float
    error_in_level_m: Array
    yaw_rad: float
    bar_elevation_rad: float
    velocity_in_level_mps: Array | None = None
    wanted_in_bar_m: Array = field(default_factory=lambda: np.zeros(3))
    corners_px: Array = field(default_factory=lambda: np.zeros((0, 2)))
    gimbal: GimbalAttitude = field(default_factory=lambda: GimbalAttitude(0.0, 0.0))
    heading_rad: float | None = None
    velocity_t_s: float | None = None


def measure(
    t_s: float,
    age_s: float,
    pose: BarPose,
    wanted_in_bar_m: Array,
    camera_in_body_m: Array,
    velocity_in_level_mps: Array | None = None,
) -> MeasuredError:
    """Turn a pose into errors.

    The error is turned into `level` by the yaw of the same picture. Errors of yaw and of position are correlated so
    that they cancel there: the camera measures the bar's direction far better than its own heading.

    Args:
        t_s: exposure time [s].
        age_s: from there to the decision.
        pose: the camera's.
        wanted_in_bar_m: (3,) the reference point.
        camera_in_body_m: (3,) the camera's optical centre.
        velocity_in_level_mps: as of `MeasuredError`.
    """
    level_from_bar = rotation_from_euler(0.0, 0.0, pose.yaw_rad).T
    bar_in_level_m = level_from_bar @ -pose.position_in_bar_m
    wanted_in_level_m = camera_in_body_m + bar_in_level_m + level_from_bar @ wanted_in_bar_m
    elevation_rad = math.atan2(-bar_in_level_m[2], float(np.hypot(bar_in_level_m[0], bar_in_level_m[1])))
    error = wanted_in_level_m * np.array([1.0, 1.0, -1.0])
    return MeasuredError(
        t_s, age_s, error, pose.yaw_rad, elevation_rad, velocity_in_level_mps, wanted_in_bar_m, pose.corners_px
    )


@dataclass(frozen=True)
class NearEstimate:
    """Estimate of near control: the errors to its reference point.

    Attributes:
        t_s: exposure time of the newest picture in it [s].
        error_in_level_m: (3,) forward, right, up to the reference point.
        rate_in_level_mps: (3,) its time derivative.
        yaw_rad: heading against the bar.
        bar_elevation_rad: the bar's centre above the horizon, from the camera.
    """

    t_s: float
    error_in_level_m: Array
    rate_in_level_mps: Array
    yaw_rad: float
    bar_elevation_rad: float

    def aircraft_in_bar_m(self, wanted_in_bar_m: Array) -> Array:
        """(3,) the aircraft's centre of mass in `bar`."""
        error_in_level_m: Array = self.error_in_level_m * np.array([1.0, 1.0, -1.0])
        bar_from_level: Array = rotation_from_euler(0.0, 0.0, self.yaw_rad)
        return np.asarray(wanted_in_bar_m - bar_from_level @ error_in_level_m, dtype=float)
