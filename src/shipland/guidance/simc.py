"""Linear gains by a published rule, from the vehicle's stated response: Skogestad's SIMC.

Source: S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, Journal of Process Control
13 (2003) 291–309: the half rule for lags, and the settings of an integrating process with a lag and of a double
integrating one. Its one free constant is the closed loop's time constant τc; τc = θ, the dead time, is recommended.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.guidance.parameters import PidGains
from shipland.guidance.response import Response


@dataclass(frozen=True)
class Plant:
    """One axis as an integrator behind lags and a dead time: place(s) / stick(s) = k' e^(−θs) / (s Π(τ s + 1)).

    Attributes:
        speed_per_percent: k', the steady speed for a percent of stick [m/s, deg/s].
        lags_s: every τ.
        dead_time_s: θ, from the exposure of the picture to the first reaction.
    """

    speed_per_percent: float
    lags_s: tuple[float, ...]
    dead_time_s: float


@dataclass(frozen=True)
class LinearGains:
    """Of one axis.

    Attributes:
        law: P or PID.
        approach_s: time constant in which the set point moves from where the aircraft is to where it shall be: the
            PID's integral time in series form, whose zero it cancels, so that a step is answered without overshoot.
    """

    law: PidGains
    approach_s: float


def simc_pid(plant: Plant, closed_loop: float) -> LinearGains:
    """PID for an integrating process with a lag [Skogestad 2003, Table 1], in parallel form.

    With T = τc + θ, series form: Kc = 1/(k' T), τI = 4 T, τD = τ2; from τ2 = 4 T on the process counts as double
    integrating: Kc = τ2/(4 k' T²), τI = τD = 4 T. Of further lags half the largest is added to τ2, the rest to θ (the
    half rule).

    >>> gains = simc_pid(Plant(0.1, (0.5,), 0.5), closed_loop=1.0)  # T = 1 s
    >>> gains.approach_s, round(gains.law.k_p, 9), gains.law.t_i_s, round(gains.law.t_d_s, 3)
    (4.0, 11.25, 4.5, 0.444)
    """
    lag_s, dead_time_s = _second_order(plant)
    time_s = (1.0 + closed_loop) * dead_time_s
    integral_s = 4.0 * time_s
    derivative_s = min(lag_s, integral_s)
    k_c = lag_s / derivative_s / (plant.speed_per_percent * time_s)
    return LinearGains(_parallel(k_c, integral_s, derivative_s), integral_s)


def simc_p(plant: Plant, closed_loop: float) -> LinearGains:
    """P for an integrating process [Skogestad 2003, Table 1]: Kc = 1/(k' (τc + θ)); the set point moves as for PID.

    Without a derivative nothing answers the largest lag, of which the half rule counts half to θ.

    >>> gains = simc_p(Plant(0.1, (0.5,), 0.25), closed_loop=1.0)  # θ = 0.5 s
    >>> round(gains.law.k_p, 9), gains.approach_s
    (10.0, 2.0)
    """
    lag_s, dead_time_s = _second_order(plant)
    k_c = 1.0 / (plant.speed_per_percent * (1.0 + closed_loop) * (dead_time_s + 0.5 * lag_s))
    return LinearGains(PidGains(k_c, math.inf, 0.0), 4.0 * (1.0 + closed_loop) * dead_time_s)


def _second_order(plant: Plant) -> tuple[float, float]:
    """τ2 and θ by the half rule: half of the second largest lag to each, the smaller ones to θ."""
    first_s, *others_s = (*sorted(plant.lags_s, reverse=True), 0.0)
    return first_s + 0.5 * others_s[0], plant.dead_time_s + 0.5 * others_s[0] + sum(others_s[1:])


def horizontal_plant(response: Response, picture_age_s: float) -> Plant:
    """Pitch and roll.

    A stick that asks for a tilt is an acceleration against the drag, whose steady speed is acceleration / drag. One
    that asks for a speed is followed within the lags of the speed reference and of the tilt.
    """
    dead_time_s = _dead_time_s(response, picture_age_s, response.dead_time_s)
    if response.kind == "attitude":
        drag_per_s = max(response.drag_per_s, _LEAST_DRAG_PER_S)
        speed = response.input_of(1.0) / drag_per_s
        return Plant(speed, (1.0 / drag_per_s, response.lag_s), dead_time_s)
    speed = 0.01 * response.max_speed_mps
    if response.integral_per_s2 > 0.0:
        asked = (response.smoothing_s / response.approach_per_s, 1.0 / response.approach_per_s)
        return Plant(speed, (*_lags_s(*asked), response.lag_s), dead_time_s)
    return Plant(speed, _lags_s(response.lag_s / response.servo_per_s, 1.0 / response.servo_per_s), dead_time_s)


def vertical_plant(response: Response, picture_age_s: float) -> Plant:
    """Heave: a climb rate behind a lag."""
    dead_time_s = _dead_time_s(response, picture_age_s, response.climb_dead_s)
    return Plant(0.01 * response.max_climb_mps, (response.climb_lag_s,), dead_time_s)


def yaw_plant(response: Response, picture_age_s: float) -> Plant:
    """Yaw: a turn rate [deg/s] behind a lag."""
    turn = 0.01 * math.degrees(response.max_turn_rad_s)
    return Plant(turn, (response.turn_lag_s,), _dead_time_s(response, picture_age_s, response.dead_time_s))


def _dead_time_s(response: Response, picture_age_s: float, reacts_s: float) -> float:
    """θ: the picture's age when its command is ready, the way up, and until the vehicle reacts."""
    age_s = min(max(picture_age_s, 0.0), _OLDEST_S)
    return max(age_s + response.uplink_s + reacts_s, _LEAST_DEAD_TIME_S)


def _lags_s(squared_s2: float, linear_s: float) -> tuple[float, float]:
    """The lags of 1/(a s² + b s + 1); a complex pair counts as two equal ones of the same sum."""
    root_s = math.sqrt(max(linear_s**2 - 4.0 * squared_s2, 0.0))
    return 0.5 * (linear_s + root_s), 0.5 * (linear_s - root_s)


def _parallel(k_c: float, integral_s: float, derivative_s: float) -> PidGains:
    """Series form k_c (1 + 1/(τI s)) (1 + τD s) as a sum of three terms."""
    both_s = integral_s + derivative_s
    return PidGains(k_c * both_s / integral_s, both_s, integral_s * derivative_s / both_s)


_LEAST_DRAG_PER_S = 1e-3
"""A vehicle of which no drag is stated is as good as a double integrator."""
_LEAST_DEAD_TIME_S, _OLDEST_S = 0.02, 1.0
"""Half a cycle at 25 Hz, which a sampled loop waits in any case; and no tuning for a picture older than this."""
