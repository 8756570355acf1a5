"""Near control by plain linear laws, P or PID: the textbook baseline."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from shipland.frames import Array, rotated, rotation_from_euler, wrap_angle
from shipland.guidance.laws import PidMemory, pid_law
from shipland.guidance.near import MeasuredError, NearEstimate
from shipland.guidance.parameters import NearBaselines
from shipland.guidance.response import HOLD, Response, SticksPercent, clamp
from shipland.guidance.simc import LinearGains, Plant, horizontal_plant, vertical_plant, yaw_plant

Rule = Callable[[Plant, float], LinearGains]


@dataclass(frozen=True)
class AxisMemory:
    """State of one axis.

    Attributes:
        pid: of the law.
        short: how far the set point still is short of where the aircraft shall be [m, deg]; None before the first
            stick.
    """

    pid: PidMemory = field(default_factory=PidMemory)
    short: float | None = None


class LinearNear:
    """P or PID on each axis of the measured pose, along the bar's axes; gains by a rule from the vehicle's response.

    No Kalman filter: a one-state one adds a lag that no tuning rule knows of, for a pose that is true to centimetres.
    The rates are low-pass filtered, by a share of the dead time. Along the bar's axes, not the nose's, a turn of the
    nose is no speed, and the integral keeps the wind's direction.

    Args:
        rule: `simc_p` or `simc_pid`.
        baselines: the rule's constants.
        response: what the sticks do on this vehicle.
    """

    def __init__(self, rule: Rule, baselines: NearBaselines, response: Response) -> None:
        self._rule, self._baselines, self._response = rule, baselines, response
        self._gains: tuple[LinearGains, ...] = ()
        self._filter_s = 0.0
        self._estimate: NearEstimate | None = None
        self._rate_in_bar, self._yaw_rate_deg_s = np.zeros(3), 0.0
        self._axes = [AxisMemory() for _ in range(4)]

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """The errors as measured, and their filtered rates; the first picture's age completes the dead time."""
        if not self._gains:
            self._tune(measured.age_s)
        before = self._estimate
        gap_s = 0.0 if before is None else measured.t_s - before.t_s
        bar_from_level = rotation_from_euler(0.0, 0.0, measured.yaw_rad)
        if before is not None and gap_s > 0.0:
            share = -math.expm1(-gap_s / self._filter_s)
            stepped = bar_from_level @ measured.error_in_level_m - _error_in_bar_m(before)
            turned_deg = math.degrees(wrap_angle(measured.yaw_rad - before.yaw_rad))
            self._rate_in_bar = self._rate_in_bar + share * (stepped / gap_s - self._rate_in_bar)
            self._yaw_rate_deg_s += share * (turned_deg / gap_s - self._yaw_rate_deg_s)
        self._estimate = NearEstimate(
            measured.t_s,
            measured.error_in_level_m,
            bar_from_level.T @ self._rate_in_bar,
            measured.yaw_rad,
            measured.bar_elevation_rad,
        )
        return self._estimate

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The law on each axis, the heading wanted relative to the bar; zero before the first picture."""
        estimate = self._estimate
        if estimate is None:
            return HOLD
        yaw_error_deg = math.degrees(wrap_angle(wanted_yaw_rad - estimate.yaw_rad))
        errors = (*_error_in_bar_m(estimate), yaw_error_deg)
        rates = (*self._rate_in_bar, -self._yaw_rate_deg_s)
        *level, heave, yaw = (
            self._axis(index, float(error), float(rate), estimate.t_s)
            for index, (error, rate) in enumerate(zip(errors, rates, strict=True))
        )
        pitch, roll = rotated(np.array(level), -estimate.yaw_rad).tolist()
        return SticksPercent(clamp(pitch, 100.0), clamp(roll, 100.0), heave, yaw)

    def reset(self) -> None:
        """Forget errors, rates and set points; the integrals stay, which balance the wind."""
        self._axes = [AxisMemory(replace(memory.pid, error=None)) for memory in self._axes]
        self._rate_in_bar, self._yaw_rate_deg_s = np.zeros(3), 0.0
        self._estimate = None

    def _tune(self, picture_age_s: float) -> None:
        horizontal, vertical, yaw = (
            plant(self._response, picture_age_s) for plant in (horizontal_plant, vertical_plant, yaw_plant)
        )
        plants = (horizontal, horizontal, vertical, yaw)
        self._gains = tuple(self._rule(plant, self._baselines.closed_loop) for plant in plants)
        self._filter_s = self._baselines.rate_filter * horizontal.dead_time_s

    def _axis(self, index: int, error: float, rate: float, t_s: float) -> float:
        """The stick of one axis: its law on the error to the set point, which moves to where the aircraft shall be."""
        gains, memory = self._gains[index], self._axes[index]
        passed_s = max(t_s - memory.pid.t_s, 0.0)
        short = error if memory.short is None else memory.short * math.exp(-passed_s / gains.approach_s)
        stick, pid = pid_law(error - short, t_s, memory.pid, gains.law, rate + short / gains.approach_s)
        self._axes[index] = AxisMemory(pid, short)
        return stick


def _error_in_bar_m(estimate: NearEstimate) -> Array:
    """(3,) forward, right and up along the bar's axes."""
    return np.asarray(rotation_from_euler(0.0, 0.0, estimate.yaw_rad) @ estimate.error_in_level_m, dtype=float)
