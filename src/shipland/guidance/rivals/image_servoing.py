"""Near control by image-based visual servoing on the corners of the cue: no pose in the law.

Corners are taken to a virtual image plane, level and turned as the nose is, by what the gimbal says of itself
[Hamel2002, Jabbari2014]. Their error to the corners that the hover point would show gives the camera's velocity by the
interaction matrix of image points, the mean of the one now and the one at the goal [Chaumette2006]; an integral takes
up what the target moves [Chaumette2007]. Where a stick is a tilt, PX4's velocity loop with its integral stands before
it. The depth is the goal's, scaled by the image's size.

[Chaumette2006] Chaumette, Hutchinson: Visual servo control I, IEEE RAM 13(4); [Chaumette2007] part II, 14(1);
[Hamel2002] Hamel, Mahony, IEEE T-RA 18(2); [Jabbari2014] Jabbari, Oriolo, Bolandi, Int. J. Robust Nonlin. 24. Of their
figures none is reproduced.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.cue import Cue
from shipland.frames import Array, rotation_from_euler
from shipland.guidance.near import MeasuredError, NearEstimate
from shipland.guidance.parameters import ImageServoingParameters
from shipland.guidance.response import HOLD, Response, SticksPercent, clamp

_LONGEST_GAP_S = 1.0
_LEAST_AHEAD = 0.1
"""Least slope and depth [m] of a corner ahead; others are not in a virtual image."""


class ImageServoing:
    """A `NearControl` on image corners; the modes around it judge by the pose, as they do for every pilot.

    Args:
        parameters: gains.
        response: what the sticks do on this vehicle.
        cue: whose corners are seen.
        camera: intrinsics of the pictures.
        camera_in_body_m: (3,) its optical centre.
    """

    def __init__(
        self, parameters: ImageServoingParameters, response: Response, cue: Cue, camera: Camera, camera_in_body_m: Array
    ) -> None:
        self._parameters, self._response, self._camera = parameters, response, camera
        self._points_m, self._camera_in_body_m = cue.points_in_bar_m, camera_in_body_m
        self._estimate: NearEstimate | None = None
        self._seen: Array = np.zeros((0, 2))
        """Slopes (n,2), right and down, of the corners in the virtual image; empty before the first picture."""
        self._wanted_in_bar_m: Array = np.zeros(3)
        self._own_mps: Array = np.zeros(2)
        self._integral_mps: Array = np.zeros(2)
        self._wind_mps2: Array = np.zeros(2)
        self._gap_s = 0.0

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """The corners to the law; the pose's errors, with filtered rates, to the modes."""
        before, error_m = self._estimate, measured.error_in_level_m
        gap_s = 0.0 if before is None else measured.t_s - before.t_s
        rate_mps = np.zeros(3)
        if before is not None and 0.0 < gap_s <= _LONGEST_GAP_S:
            rate_mps = before.rate_in_level_mps
            rate_mps = rate_mps + 0.2 * ((error_m - before.error_in_level_m) / gap_s - rate_mps)
            self._gap_s = gap_s
        told_mps = measured.velocity_in_level_mps
        if told_mps is not None and np.isfinite(told_mps).all():
            self._own_mps = told_mps[:2]
        elif told_mps is None:
            self._own_mps = -rate_mps[:2]
        self._wanted_in_bar_m = measured.wanted_in_bar_m
        self._seen = self._virtual_image(measured)
        self._estimate = NearEstimate(measured.t_s, error_m, rate_mps, measured.yaw_rad, measured.bar_elevation_rad)
        return self._estimate

    def _virtual_image(self, measured: MeasuredError) -> Array:
        """(n,2) slopes of the observed corners; empty where they are not the cue's or not ahead."""
        if len(measured.corners_px) != len(self._points_m):
            return np.zeros((0, 2))
        rays = self._camera.back_project(measured.corners_px) @ level_from_camera(measured.gimbal).T
        if not (np.isfinite(rays).all() and float(rays[:, 0].min()) > _LEAST_AHEAD):
            return np.zeros((0, 2))
        return np.asarray(rays[:, 1:] / rays[:, :1])

    def _goal(self, wanted_yaw_rad: float) -> Array:
        """(n,3) corners as forward, right, down of the virtual camera at the goal."""
        level_from_bar = rotation_from_euler(0.0, 0.0, wanted_yaw_rad).T
        return np.asarray((self._points_m - self._wanted_in_bar_m) @ level_from_bar.T - self._camera_in_body_m)

    def _twist(self, wanted_yaw_rad: float) -> Array:
        """(4,) L⁺ (s* - s): the camera's error in its own axes, forward, right, down [m] and yaw [rad]."""
        goal_m = self._goal(wanted_yaw_rad)
        if not len(self._seen) or float(goal_m[:, 0].min()) <= _LEAST_AHEAD:
            return np.zeros(4)
        wanted = goal_m[:, 1:] / goal_m[:, :1]
        size, wanted_size = (float(np.linalg.norm(points - points.mean(axis=0))) for points in (self._seen, wanted))
        depth_m = goal_m[:, 0] * wanted_size / max(size, 1e-6)
        interaction = 0.5 * (_interaction(self._seen, depth_m) + _interaction(wanted, goal_m[:, 0]))
        return np.asarray(np.linalg.lstsq(interaction, (wanted - self._seen).ravel(), rcond=None)[0])

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The sticks of the newest image; zero before the first, and where the corners cannot be flown on."""
        if self._estimate is None or not len(self._seen):
            return HOLD
        response, parameters = self._response, self._parameters
        twist = parameters.gain_per_s * self._twist(wanted_yaw_rad)
        speed_mps = math.hypot(float(twist[0]), float(twist[1]))
        gap_s, self._gap_s = self._gap_s, 0.0
        if speed_mps < parameters.integrate_mps:
            self._integral_mps = self._integral_mps + gap_s * parameters.integral_per_s * twist[:2]
        wanted = twist[:2] * min(1.0, parameters.most_mps / max(speed_mps, 1e-9)) + self._integral_mps
        if response.kind == "attitude":
            off_mps = wanted - self._own_mps
            self._wind_mps2 = self._wind_mps2 + gap_s * parameters.wind_per_s2 * off_mps
            wanted = parameters.velocity_per_s * off_mps + self._wind_mps2
        pitch, roll = (response.stick_of(float(value)) for value in wanted)
        return SticksPercent(
            clamp(pitch, 100.0),
            clamp(roll, 100.0),
            clamp(-100.0 * float(twist[2]) / response.max_climb_mps, 100.0),
            clamp(100.0 * float(twist[3]) / response.max_turn_rad_s, 100.0),
        )

    def reset(self) -> None:
        """Forget the image; the integrals stay, which balance target and wind."""
        self._estimate, self._seen, self._gap_s = None, np.zeros((0, 2)), 0.0


def _interaction(slopes: Array, depth_m: Array) -> Array:
    """(2n,4) of image points in a level camera: forward, right and down velocity, yaw rate [Chaumette2006]."""
    x, y = slopes.T
    nothing, near = np.zeros_like(x), 1.0 / depth_m
    across = np.column_stack([x * near, -near, nothing, -(1.0 + x * x)])
    along = np.column_stack([y * near, nothing, -near, -x * y])
    return np.asarray(np.stack([across, along], axis=1).reshape(-1, 4))
