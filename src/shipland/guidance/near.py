"""What near control is: corners in, sticks out; the estimate that modes and safety judge by; and the published form."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, Protocol

import numpy as np

from shipland.estimation.kalman import ScalarKalman
from shipland.frames import Array, rotation_from_euler, wrap_angle
from shipland.guidance.laws import PUBLISHED_STEP_S, DerivativeVariant, NearGains, NearMemory, near_law
from shipland.messages import BarPose


class Sticks(NamedTuple):
    """Percent, -100 … 100: forward, right, up, clockwise positive."""

    pitch: float
    roll: float
    heave: float
    yaw: float


@dataclass(frozen=True)
class Measured:
    """One picture's word on where the aircraft is, in the axes that the sticks move it in.

    Attributes:
        t_s: exposure time [s].
        error_in_level_m: (3,) forward, right, up to the point wanted.
        variance_in_level_m2: (3,) of it.
        yaw_rad: heading against the bar.
        yaw_variance_rad2: of it.
        bar_elevation_rad: the bar's centre above the horizon, from the camera.
    """

    t_s: float
    error_in_level_m: Array
    variance_in_level_m2: Array
    yaw_rad: float
    yaw_variance_rad2: float
    bar_elevation_rad: float


def measure(t_s: float, pose: BarPose, wanted_in_bar_m: Array, camera_in_body_m: Array) -> Measured:
    """Turn a pose into errors.

    The yaw of this very picture turns the error into `level`: its noise and the position's are one and the same and
    cancel, since the camera knows the bar's direction far better than its own heading.
    """
    level_from_bar = rotation_from_euler(0.0, 0.0, pose.yaw_rad).T
    bar_in_level_m = level_from_bar @ -pose.position_in_bar_m
    wanted_in_level_m = camera_in_body_m + bar_in_level_m + level_from_bar @ wanted_in_bar_m
    # Of the error in `level`, the derivative by yaw is that of the bar's direction and of the point wanted from it.
    by_yaw = level_from_bar @ np.array(
        [
            wanted_in_bar_m[1] - pose.position_in_bar_m[1],
            pose.position_in_bar_m[0] - wanted_in_bar_m[0],
            0.0,
        ]
    )
    jacobian = np.column_stack([-level_from_bar, by_yaw])
    variance = np.diag(jacobian @ pose.covariance @ jacobian.T)
    elevation_rad = math.atan2(-bar_in_level_m[2], float(np.hypot(bar_in_level_m[0], bar_in_level_m[1])))
    error = wanted_in_level_m * np.array([1.0, 1.0, -1.0])
    return Measured(t_s, error, variance, pose.yaw_rad, float(pose.covariance[3, 3]), elevation_rad)


@dataclass(frozen=True)
class NearEstimate:
    """What near control believes.

    Attributes:
        t_s: exposure time of the newest picture in it [s].
        error_in_level_m: (3,) forward, right, up to the point wanted.
        rate_in_level_mps: (3,) its time derivative.
        yaw_rad: heading against the bar.
        bar_elevation_rad: the bar's centre above the horizon, from the camera.
        valid_s: the time that error, rate and heading are valid for: later than `t_s` where they are predicted [s].
    """

    t_s: float
    error_in_level_m: Array
    rate_in_level_mps: Array
    yaw_rad: float
    bar_elevation_rad: float
    valid_s: float

    def aircraft_in_bar_m(self, wanted_in_bar_m: Array) -> Array:
        """(3,) the aircraft's centre of mass in `bar`."""
        error_in_level_m: Array = self.error_in_level_m * np.array([1.0, 1.0, -1.0])
        bar_from_level: Array = rotation_from_euler(0.0, 0.0, self.yaw_rad)
        return np.asarray(wanted_in_bar_m - bar_from_level @ error_in_level_m, dtype=float)


class NearControl(Protocol):
    """Flies mode 2: one of them a pilot."""

    def observe(self, measured: Measured, now_s: float) -> NearEstimate:
        """Take one picture's errors; `now_s` is when the command of this cycle will be ready."""

    def sticks(self, wanted_yaw_rad: float = 0.0) -> Sticks:
        """The sticks for the newest estimate; the heading wanted is against the bar."""

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """What the pilot gave at last, in any mode."""

    def reset(self) -> None:
        """The pictures have a gap: forget what does not outlast it."""


FilterKind = Literal["kalman", "none"]


@dataclass(frozen=True)
class NearParameters:
    """`[guidance.near]`: Table 2 and the filter before it.

    Attributes:
        pitch, roll, heave, yaw: gains; errors in m and degrees.
        derivative: variant of K_D.
        filter: the one-state Kalman filters, or none (a baseline of the paper's).
        process_noise, measurement_noise: of the one-state Kalman filters, per 0.03 s (erratum 1).
    """

    pitch: NearGains
    roll: NearGains
    heave: NearGains
    yaw: NearGains
    derivative: DerivativeVariant
    filter: FilterKind
    process_noise: float
    measurement_noise: float


class PublishedNear:
    """One-state Kalman filters and Eq. 2–3 on each axis [Lee2022, §Close-range Tracking Controller]."""

    def __init__(self, parameters: NearParameters) -> None:
        self._parameters = parameters
        self._filters = [ScalarKalman(parameters.process_noise, parameters.measurement_noise) for _ in range(4)]
        self._laws = [NearMemory() for _ in range(4)]
        self._estimate: NearEstimate | None = None

    def observe(self, measured: Measured, now_s: float) -> NearEstimate:  # noqa: ARG002 - it knows of no delay
        """Filter the errors."""
        before = self._estimate
        gap_s = 0.0 if before is None else measured.t_s - before.t_s
        steps = 1.0 if before is None else gap_s / PUBLISHED_STEP_S
        error, yaw_rad = measured.error_in_level_m, measured.yaw_rad
        if self._parameters.filter == "kalman":
            error = np.array([self._filters[i].update(float(error[i]), steps) for i in range(3)])
            yaw_rad = math.radians(self._filters[3].update(math.degrees(yaw_rad), steps))
        rate = np.zeros(3)
        if before is not None and gap_s > 0.0:
            rate = before.rate_in_level_mps
            rate = rate + 0.2 * ((error - before.error_in_level_m) / gap_s - rate)
        self._estimate = NearEstimate(measured.t_s, error, rate, yaw_rad, measured.bar_elevation_rad, measured.t_s)
        return self._estimate

    def sticks(self, wanted_yaw_rad: float = 0.0) -> Sticks:
        """The near law on each axis; zero before the first picture."""
        estimate, near = self._estimate, self._parameters
        if estimate is None:
            return Sticks(0.0, 0.0, 0.0, 0.0)
        forward_m, right_m, up_m = (float(value) for value in estimate.error_in_level_m)
        errors = (forward_m, right_m, up_m, math.degrees(wrap_angle(wanted_yaw_rad - estimate.yaw_rad)))
        sticks = []
        for index, (error, gains) in enumerate(zip(errors, (near.pitch, near.roll, near.heave, near.yaw), strict=True)):
            terms, self._laws[index] = near_law(error, estimate.t_s, self._laws[index], gains, near.derivative)
            sticks.append(terms.stick_percent)
        return Sticks(*sticks)

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """The law remembers no sticks."""

    def reset(self) -> None:
        """Forget filters and last errors; the integrals stay."""
        for kalman in self._filters:
            kalman.reset()
        self._laws = [replace(memory, error=None) for memory in self._laws]
        self._estimate = None
