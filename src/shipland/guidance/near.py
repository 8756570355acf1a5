"""Near control in its published form: a picture's errors to the reference point, filtered; errors in, sticks out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from shipland.frames import Array, rotation_from_euler, wrap_angle
from shipland.guidance.laws import PUBLISHED_STEP_S, NearMemory, near_law
from shipland.guidance.parameters import NearParameters
from shipland.guidance.response import HOLD, SticksPercent
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


class ScalarKalman:
    """Random walk observed with noise: P⁻ = P + Q, K = P⁻/(P⁻ + R), x = x⁻ + K (z − x⁻), P = (1 − K) P⁻.

    The paper's Q = 0.005 and R = 0.05 give a steady gain of 0.27. Units are the caller's: Q and R are the
    square of the value's, Q per published step of 0.03 s.
    """

    def __init__(self, process_noise: float, measurement_noise: float) -> None:
        if not (process_noise >= 0.0 and measurement_noise > 0.0):
            raise ValueError(
                f"ScalarKalman wants process noise >= 0 and measurement noise > 0, "
                f"got {process_noise} and {measurement_noise}"
            )
        self._process_noise = process_noise
        self._measurement_noise = measurement_noise
        self._variance = math.inf
        self._value: float | None = None

    @property
    def value(self) -> float | None:
        """The estimate; None before the first measurement."""
        return self._value

    @property
    def variance(self) -> float:
        """Variance of the estimate; infinite before the first measurement."""
        return self._variance

    def update(self, measurement: float, steps: float = 1.0) -> float:
        """Take one measurement; the new estimate.

        The first measurement is taken as it is. A measurement that is not finite changes nothing but lets the
        variance grow; before the first finite one it is handed back.

        Args:
            measurement: z.
            steps: time since the last one in published steps (0.03 s); the walk's variance grows in proportion.
        """
        predicted = self._variance + self._process_noise * max(steps, 0.0)
        if not math.isfinite(measurement):
            self._variance = predicted
            return measurement if self._value is None else self._value
        if self._value is None:
            self._value, self._variance = measurement, self._measurement_noise
            return measurement
        gain = predicted / (predicted + self._measurement_noise)
        self._value += gain * (measurement - self._value)
        self._variance = (1.0 - gain) * predicted
        return self._value

    def reset(self) -> None:
        """Forget everything."""
        self._value, self._variance = None, math.inf


class NearControl(Protocol):
    """Flies on the bar's pose, to the reference that the errors are measured to; a pilot has one."""

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """Take in one picture's errors."""

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The sticks for the newest estimate, the heading wanted relative to the bar; zero before the first picture."""

    def reset(self) -> None:
        """The bar was lost or the reference changed: forget what does not outlast it."""


class PublishedNear:
    """One-state Kalman filters and Eq. 4–5 on each axis [Lee2022, §Close-range Tracking Controller]."""

    def __init__(self, parameters: NearParameters) -> None:
        self._parameters = parameters
        self._filters = [ScalarKalman(parameters.process_noise, parameters.measurement_noise) for _ in range(4)]
        self._laws = [NearMemory() for _ in range(4)]
        self._estimate: NearEstimate | None = None

    def observe(self, measured: MeasuredError) -> NearEstimate:
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
        self._estimate = NearEstimate(measured.t_s, error, rate, yaw_rad, measured.bar_elevation_rad)
        return self._estimate

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The near law on each axis, the heading wanted relative to the bar; zero before the first picture."""
        estimate, near = self._estimate, self._parameters
        if estimate is None:
            return HOLD
        forward_m, right_m, up_m = (float(value) for value in estimate.error_in_level_m)
        errors = (forward_m, right_m, up_m, math.degrees(wrap_angle(wanted_yaw_rad - estimate.yaw_rad)))
        sticks = []
        for index, (error, gains) in enumerate(zip(errors, (near.pitch, near.roll, near.heave, near.yaw), strict=True)):
            terms, self._laws[index] = near_law(error, estimate.t_s, self._laws[index], gains, near.derivative)
            sticks.append(terms.stick_percent)
        return SticksPercent(*sticks)

    def reset(self) -> None:
        """Forget filters and last errors; the integrals stay."""
        for kalman in self._filters:
            kalman.reset()
        self._laws = [replace(memory, error=None) for memory in self._laws]
        self._estimate = None
