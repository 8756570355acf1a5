"""The two published control laws, each with its equation and its printed and corrected variants.

Every law is a pure function: error in, percent of stick out. Positive error means "more of this stick is wanted";
which measured quantity that is, is the pilot's business. Which variant is read how: the errata page.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.guidance.parameters import DerivativeVariant, FarGains, FarVariant, NearGains, PidGains
from shipland.guidance.response import clamp

PUBLISHED_STEP_S = 0.03
"""Cycle time at which the widths of Table 2 are stated [Lee2022, §Close-range Tracking Controller]."""


def exponential_law(error: float, gains: FarGains, variant: FarVariant) -> float:
    """Stick [percent] of the far law [Lee2022, Eq. 3], clamped to ±100.

    Variants (erratum 3), for d = 1:
        printed: `sign(e)·m·(exp(a·e) − d)·e`, asymmetric as the paper prints it.
        growing: the printed positive side both ways, `m·(exp(a|e|) − d)·e`.
        saturating: the printed negative side both ways, `m·(d − exp(−a|e|))·e`.
    With a = d = 0 the law is linear; `printed` then gives a forward stick on both sides (erratum 2), the others
    `m·e`. An error that is not finite gives 0.
    """
    if not math.isfinite(error):
        return 0.0
    if variant == "printed":
        side = 1.0 if error >= 0.0 else -1.0
        gain = side * gains.m * (math.exp(min(gains.a * error, 50.0)) - gains.d)
    elif gains.d == 0.0:
        gain = gains.m
    elif variant == "growing":
        gain = gains.m * (math.exp(min(gains.a * abs(error), 50.0)) - gains.d)
    else:
        gain = gains.m * (gains.d - math.exp(-gains.a * abs(error)))
    return clamp(gain * error, 100.0)


@dataclass(frozen=True)
class NearMemory:
    """State of the near law for one axis: the last error, its time, and the error's time integral."""

    error: float | None = None
    t_s: float = 0.0
    integral: float = 0.0


@dataclass(frozen=True)
class NearTerms:
    """The three terms of Eq. 4 [percent]."""

    proportional: float
    integral: float
    derivative: float

    @property
    def stick_percent(self) -> float:
        """Their sum, clamped to ±100."""
        return clamp(self.proportional + self.integral + self.derivative, 100.0)


def derivative_gain(step: float, dt_s: float, gains: NearGains, variant: DerivativeVariant) -> float:
    """K_D of Eq. 5 for an error step in `dt_s` [percent per unit/s].

    Variants:
        probabilistic: the density of the step scaled to 0.03 s, so that the law does not change with the frame rate
            (erratum 8).
        printed: the density of the step itself.
        linear: constant b, the baseline that the paper compares with.
    """
    if variant == "linear":
        return gains.b
    if variant == "probabilistic":
        step *= PUBLISHED_STEP_S / dt_s
    return gains.b * math.exp(-0.5 * ((step - gains.mu) / gains.sigma) ** 2)


def near_law(
    error: float, t_s: float, memory: NearMemory, gains: NearGains, variant: DerivativeVariant
) -> tuple[NearTerms, NearMemory]:
    """The near law [Lee2022, Eq. 4] for one axis.

    Args:
        error: filtered error (m or degrees).
        t_s: its time [s]; the first error, or one no newer than the last, gives no derivative.
        memory: of the last call.
        gains: of the axis.
        variant: of the derivative gain.

    Returns:
        The three terms and the memory for the next call; for an error or a time that is not finite no stick and the
        memory as it was.
    """
    if not (math.isfinite(error) and math.isfinite(t_s)):
        return NearTerms(0.0, 0.0, 0.0), memory
    derivative, integral = 0.0, memory.integral
    dt_s = t_s - memory.t_s
    if memory.error is not None and dt_s > 0.0:
        step = error - memory.error
        derivative = derivative_gain(step, dt_s, gains, variant) * step / dt_s
        if abs(error) < gains.integral_band:
            integral += error * dt_s
    proportional = gains.k_p * clamp(error, gains.error_limit)
    return NearTerms(proportional, gains.k_i * integral, derivative), NearMemory(error, t_s, integral)


@dataclass(frozen=True)
class PidMemory:
    """State of the linear PID for one axis: the last error, its time, and the integral term [percent]."""

    error: float | None = None
    t_s: float = 0.0
    integral_percent: float = 0.0


def pid_law(
    error: float, t_s: float, memory: PidMemory, gains: PidGains, rate: float | None = None
) -> tuple[float, PidMemory]:
    """A linear PID for one axis, clamped to ±100 percent.

    Anti-windup: the integral does not grow while the stick is at its stop on the error's side, and never exceeds it.

    Args:
        error: of the axis.
        t_s: its time [s]; the first error, or one no newer than the last, gives no derivative and adds no integral.
        memory: of the last call.
        gains: of the axis.
        rate: the error's, where a filter gives it; None takes the difference to the last error.

    Returns:
        The stick [percent] and the memory for the next call; for an error or a time that is not finite no stick and
        the memory as it was.
    """
    if not (math.isfinite(error) and math.isfinite(t_s)):
        return 0.0, memory
    derivative, integral = 0.0 if rate is None else gains.k_p * gains.t_d_s * rate, memory.integral_percent
    dt_s = t_s - memory.t_s
    if memory.error is not None and dt_s > 0.0:
        if rate is None:
            derivative = gains.k_p * gains.t_d_s * (error - memory.error) / dt_s
        grown = clamp(integral + gains.k_p * error * dt_s / gains.t_i_s, 100.0)
        stick = gains.k_p * error + grown + derivative
        if abs(stick) <= 100.0 or stick * error <= 0.0:
            integral = grown
    stick = clamp(gains.k_p * error + integral + derivative, 100.0)
    return stick, PidMemory(error, t_s, integral)
