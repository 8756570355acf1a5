"""Near control in its published form: errors in, sticks out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, NamedTuple, Protocol

import numpy as np

from shipland.config import key, parameters
from shipland.estimation.kalman import ScalarKalman
from shipland.frames import wrap_angle
from shipland.guidance.estimate import MeasuredError, NearEstimate
from shipland.guidance.laws import PUBLISHED_STEP_S, DerivativeVariant, NearGains, NearMemory, near_law


class SticksPercent(NamedTuple):
    """Percent, -100 … 100: forward, right, up, clockwise positive."""

    pitch: float
    roll: float
    heave: float
    yaw: float


HOLD = SticksPercent(0.0, 0.0, 0.0, 0.0)


class NearControl(Protocol):
    """Flies on the bar's pose, to the reference that the errors are measured to; a pilot has one."""

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """Take in one picture's errors."""

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The sticks for the newest estimate, the heading wanted relative to the bar; zero before the first picture."""

    def reset(self) -> None:
        """The bar was lost or the reference changed: forget what does not outlast it."""


FilterKind = Literal["kalman", "none"]


@parameters
class NearParameters:
    """`[guidance.near]`: Table 2 and the filter before it.

    Source of the gains: [Lee2022, Table 2]; percent, m, degrees, s.
    """

    pitch: NearGains = key(
        NearGains(k_p=7.5, k_i=0.05, b=4.5, mu=0.02, sigma=0.04, integral_band=1.0, error_limit=1.5),
        "in m and percent",
        "bands and limits are chosen",
    )
    roll: NearGains = key(
        NearGains(k_p=7.5, k_i=0.01, b=8.5, mu=0.0, sigma=0.04, integral_band=1.0, error_limit=1.5),
        "in m and percent",
        "bands and limits are chosen",
    )
    heave: NearGains = key(
        NearGains(k_p=15.0, k_i=0.01, b=7.0, mu=0.0, sigma=0.02, integral_band=1.0, error_limit=10.0),
        "in m and percent",
        "bands and limits are chosen",
    )
    yaw: NearGains = key(
        NearGains(k_p=5.5, k_i=0.05, b=1.75, mu=0.0, sigma=5.0, integral_band=10.0, error_limit=180.0),
        "in degrees and percent",
        "bands and limits are chosen",
    )
    derivative: DerivativeVariant = key(
        "probabilistic", "variant of K_D", "probabilistic: Eq. 5, erratum 8 | printed | linear: a baseline of [Lee2022]"
    )
    filter: FilterKind = key("kalman", "one-state filters of the errors", "kalman | none: a baseline of [Lee2022]")
    process_noise: float = key(
        0.005, "of the one-state Kalman filters, per 0.03 s", "[Lee2022, §Pose Estimation], erratum 1"
    )
    measurement_noise: float = key(0.05, "likewise", "[Lee2022, §Pose Estimation], erratum 1")


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
