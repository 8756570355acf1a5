"""References as trajectories: a point that leads the aircraft, with a speed from which it can stop in time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.frames import Array


@dataclass(frozen=True)
class Reference:
    """Where the aircraft shall be, against the bar, in the axes of the estimate.

    Attributes:
        place_m: (2,).
        speed_mps: (2,) its rate.
        rate_mps2: (2,) and that of the speed.
    """

    place_m: Array
    speed_mps: Array
    rate_mps2: Array


@dataclass(frozen=True)
class Pace:
    """How fast a reference may move.

    Attributes:
        speed_mps: greatest speed against its goal.
        brake_mps2: deceleration that it plans to stop with.
        acceleration_mps2: greatest change of its speed.
        closing_per_s: near the goal the speed falls in proportion to the distance.
        tracking_error_max_m, tracking_error_max_mps: a larger difference between aircraft and reference resets the
            reference.
    """

    speed_mps: float
    brake_mps2: float
    acceleration_mps2: float
    closing_per_s: float
    tracking_error_max_m: float
    tracking_error_max_mps: float


def moved(before: Reference, step_s: float, goal_m: Array, goal_mps: Array, pace: Pace) -> Reference:
    """The reference a cycle later, on its way to a goal (2,) that itself moves with `goal_mps` (2,)."""
    if step_s <= 0.0:
        return before
    to_goal_m = goal_m - before.place_m
    distance_m = math.hypot(*to_goal_m.tolist())
    speed_mps = min(pace.speed_mps, math.sqrt(2.0 * pace.brake_mps2 * distance_m), pace.closing_per_s * distance_m)
    wanted_mps = goal_mps + to_goal_m * (speed_mps / max(distance_m, 1e-9))
    change = wanted_mps - before.speed_mps
    most = pace.acceleration_mps2 * step_s
    size = math.hypot(*change.tolist())
    if size > most:
        change = change * (most / size)
    speed = before.speed_mps + change
    place = before.place_m + step_s * (before.speed_mps + 0.5 * change)
    return Reference(place, speed, change / step_s)


def reference_reset(reference: Reference, place_m: Array, speed_mps: Array, pace: Pace) -> Reference:
    """The reference as it is, or, too far from an aircraft at a place (2,) with a speed (2,), at that place.

    It keeps the speed that it had reached, within `tracking_error_max_mps`: a leap of the estimate is no reason to
    change it.
    """
    ahead_mps = reference.speed_mps - speed_mps
    apart_mps = math.hypot(*ahead_mps.tolist())
    if (
        math.hypot(*(reference.place_m - place_m).tolist()) <= pace.tracking_error_max_m
        and apart_mps <= pace.tracking_error_max_mps
    ):
        return reference
    return at_rest(place_m, speed_mps + ahead_mps * min(pace.tracking_error_max_mps / max(apart_mps, 1e-9), 1.0))


def at_rest(place_m: Array, speed_mps: Array) -> Reference:
    """A reference that begins where the aircraft is, with its speed, and brakes or goes on from there."""
    return Reference(place_m, speed_mps, np.zeros(2))
