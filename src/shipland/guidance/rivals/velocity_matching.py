"""Near control by matching velocities, as autopilots land on moving targets: follow the target's speed, close the rest.

A Kalman filter takes the landing point for a target of constant velocity; the position error, times a gain, is added
to that velocity, and the vehicle's own velocity loop flies the sum. Gains are PX4's as delivered (MPC_XY_P, MPC_Z_P,
MPC_XY_VEL_P_ACC, MPC_XY_VEL_I_ACC). Neither the age of a picture nor the wind is known to it.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.frames import Array, rotated, rotation_from_euler, wrap_angle
from shipland.guidance.near import MeasuredError, NearEstimate
from shipland.guidance.parameters import VelocityMatchingParameters
from shipland.guidance.response import HOLD, Response, SticksPercent, clamp

_LONGEST_GAP_S = 1.0


class VelocityMatching:
    """A `NearControl` along the bar's axes, which do not turn with the nose.

    Args:
        parameters: gains and sizes.
        response: what the sticks do on this vehicle.
    """

    def __init__(self, parameters: VelocityMatchingParameters, response: Response) -> None:
        self._parameters, self._response = parameters, response
        self._estimate: NearEstimate | None = None
        self._own_mps: Array = np.zeros(2)
        self._state: Array = np.zeros((2, 2))
        """Error and the target's velocity, by axes."""
        self._covariance: Array = np.zeros((2, 2))
        """Of both, alike on every axis."""
        self._integral_mps2: Array = np.zeros(2)

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """The error as filtered; without a velocity of its own the vehicle is taken to fly as its last one says."""
        bar_from_level = rotation_from_euler(0.0, 0.0, measured.yaw_rad)
        seen_m = (bar_from_level @ measured.error_in_level_m)[:2]
        told_mps, before = measured.velocity_in_level_mps, self._estimate
        if told_mps is not None and np.isfinite(told_mps).all():
            self._own_mps = rotated(told_mps[:2], measured.yaw_rad)
        gap_s = math.inf if before is None else measured.t_s - before.t_s
        if not 0.0 < gap_s <= _LONGEST_GAP_S:
            self._state = np.array([seen_m, self._own_mps])
            self._covariance = np.diag([self._parameters.picture_m**2, 1.0])
        else:
            self._filter(gap_s, seen_m)
        error_in_level_m = measured.error_in_level_m.copy()
        error_in_level_m[:2] = rotated(self._state[0], -measured.yaw_rad)
        rate_mps = np.array([*rotated(self._state[1] - self._own_mps, -measured.yaw_rad).tolist(), 0.0])
        self._estimate = NearEstimate(
            measured.t_s, error_in_level_m, rate_mps, measured.yaw_rad, measured.bar_elevation_rad
        )
        return self._estimate

    def _filter(self, gap_s: float, seen_m: Array) -> None:
        """A step of the Kalman filter: the error changes by the target's velocity less the vehicle's own."""
        transition = np.array([[1.0, gap_s], [0.0, 1.0]])
        push = np.array([0.5 * gap_s**2, gap_s])
        noise = self._parameters.target_mps2**2 * np.outer(push, push)
        predicted = transition @ self._state - np.outer([gap_s, 0.0], self._own_mps)
        covariance = transition @ self._covariance @ transition.T + noise
        gain = covariance[:, 0] / (covariance[0, 0] + self._parameters.picture_m**2)
        self._state = predicted + np.outer(gain, seen_m - predicted[0])
        self._covariance = covariance - np.outer(gain, covariance[0])
        self._integral_mps2 = self._integral_mps2 + gap_s * self._parameters.integral_per_s2 * self._off_mps()

    def _wanted_mps(self) -> Array:
        """(2,) along the bar's axes."""
        closing = self._parameters.position_per_s * self._state[0]
        size = math.hypot(*closing.tolist())
        return np.asarray(self._state[1] + closing * min(1.0, self._parameters.most_mps / max(size, 1e-9)))

    def _off_mps(self) -> Array:
        return np.asarray(self._wanted_mps() - self._own_mps)

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The sticks; a vehicle whose sticks mean a tilt gets the velocity loop of PX4 before them."""
        estimate, response, parameters = self._estimate, self._response, self._parameters
        if estimate is None:
            return HOLD
        wanted = self._wanted_mps()
        if response.kind == "attitude":
            wanted = parameters.velocity_per_s * self._off_mps() + self._integral_mps2
        pitch, roll = (response.stick_of(float(value)) for value in rotated(wanted, -estimate.yaw_rad))
        climb_mps = parameters.climb_per_s * float(estimate.error_in_level_m[2])
        turn_rad_s = parameters.turn_per_s * wrap_angle(wanted_yaw_rad - estimate.yaw_rad)
        return SticksPercent(
            clamp(pitch, 100.0),
            clamp(roll, 100.0),
            clamp(100.0 * climb_mps / response.max_climb_mps, 100.0),
            clamp(100.0 * turn_rad_s / response.max_turn_rad_s, 100.0),
        )

    def reset(self) -> None:
        """Forget the target; the integral stays, which balances the wind."""
        self._estimate = None
