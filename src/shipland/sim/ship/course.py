"""The ship's course over the sea: position, velocity and acceleration of the `ship` origin, and its course.

A course is a start and a list of manoeuvres; a manoeuvre changes course and speed along a quintic blend, so that
course, rate and acceleration, and position, velocity and acceleration, are continuous.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from shipland.config import key, parameters, require
from shipland.frames import Array

PEAK_BLEND_RATE = 1.875
"""Largest slope of `quintic_blend`."""

_NODES = ((0.5 - math.sqrt(0.15), 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + math.sqrt(0.15), 5.0 / 18.0))
"""Places and weights of three-point Gauss quadrature on 0…1."""

_STEP_S = 0.1
"""Step over which the position is integrated; the quadrature's error is then below a micrometre."""


@dataclass(frozen=True)
class CourseState:
    """The `ship` origin's motion in the horizontal plane of `ned` at one instant.

    Attributes:
        position_in_ned_m: (2,) north, east.
        velocity_in_ned_mps: (2,).
        acceleration_in_ned_mps2: (2,).
        course_rad: heading of the ship, clockwise from north; the ship moves along it. Not wrapped.
        course_rate_rad_s: its first derivative.
        course_acceleration_rad_s2: its second derivative.
    """

    position_in_ned_m: Array
    velocity_in_ned_mps: Array
    acceleration_in_ned_mps2: Array
    course_rad: float
    course_rate_rad_s: float
    course_acceleration_rad_s2: float

    @cached_property
    def values(self) -> Array:
        """(9,) all of it in this order."""
        moving = (self.position_in_ned_m, self.velocity_in_ned_mps, self.acceleration_in_ned_mps2)
        turning = (self.course_rad, self.course_rate_rad_s, self.course_acceleration_rad_s2)
        return np.concatenate([*moving, turning])


class Course(Protocol):
    """A course, defined at any time."""

    def at(self, t_s: float) -> CourseState:
        """The motion of the `ship` origin at time `t_s`."""


class StillCourse:
    """A ship that lies still at the origin, headed `course_rad` clockwise from north."""

    def __init__(self, course_rad: float = 0.0) -> None:
        self._state = CourseState(np.zeros(2), np.zeros(2), np.zeros(2), course_rad, 0.0, 0.0)

    def at(self, t_s: float) -> CourseState:  # noqa: ARG002 - the protocol's argument
        """Always the same."""
        return self._state


class StraightCourse:
    """Steady speed along one course, clockwise from north, through the origin at t = 0."""

    def __init__(self, course_rad: float, speed_mps: float) -> None:
        self._course_rad = course_rad
        self._velocity = speed_mps * np.array([math.cos(course_rad), math.sin(course_rad)])
        self._zero = np.zeros(2)

    def at(self, t_s: float) -> CourseState:
        """Uniform motion."""
        return CourseState(self._velocity * t_s, self._velocity, self._zero, self._course_rad, 0.0, 0.0)


@dataclass(frozen=True)
class Manoeuvre:
    """A smooth change of course, clockwise positive, and of speed, over a positive time."""

    start_s: float
    duration_s: float
    turn_rad: float
    speed_change_mps: float = 0.0


def quintic_blend(share: float) -> tuple[float, float, float]:
    """10s³ − 15s⁴ + 6s⁵ and its first two derivatives by s, s in 0…1; both derivatives vanish at both ends."""
    s = share
    return s**3 * (10.0 + s * (6.0 * s - 15.0)), 30.0 * (s * (1.0 - s)) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)


@dataclass(frozen=True)
class _Leg:
    """One stretch of constant course and speed (`duration_s` zero), or one manoeuvre."""

    start_s: float
    duration_s: float
    course_rad: float
    speed_mps: float
    turn_rad: float = 0.0
    speed_change_mps: float = 0.0

    def motion(self, after_s: float) -> tuple[float, float, float, float, float]:
        """Course, rate, acceleration, speed and its rate, `after_s` into the leg."""
        if self.duration_s == 0.0:
            return self.course_rad, 0.0, 0.0, self.speed_mps, 0.0
        w, dw, ddw = quintic_blend(after_s / self.duration_s)
        dw, ddw = dw / self.duration_s, ddw / self.duration_s**2
        return (
            self.course_rad + self.turn_rad * w,
            self.turn_rad * dw,
            self.turn_rad * ddw,
            self.speed_mps + self.speed_change_mps * w,
            self.speed_change_mps * dw,
        )

    def displacement_m(self, from_s: float, to_s: float) -> tuple[float, float]:
        """Displacement north and east between two times into the leg."""
        if self.duration_s == 0.0:
            run = self.speed_mps * (to_s - from_s)
            return run * math.cos(self.course_rad), run * math.sin(self.course_rad)
        north = east = 0.0
        for place, weight in _NODES:
            course, _, _, speed, _ = self.motion(from_s + place * (to_s - from_s))
            north += weight * speed * math.cos(course)
            east += weight * speed * math.sin(course)
        return north * (to_s - from_s), east * (to_s - from_s)


class ManoeuvringCourse:
    """Straight stretches joined by manoeuvres; through the origin at t = 0.

    The first heading is clockwise from north; manoeuvres follow one another from t ≥ 0 on without overlap.
    """

    def __init__(self, course_rad: float, speed_mps: float, manoeuvres: Sequence[Manoeuvre]) -> None:
        legs = [_Leg(0.0, 0.0, course_rad, speed_mps)]
        end_s = 0.0
        for manoeuvre in manoeuvres:
            if manoeuvre.start_s < end_s - 1e-9 or manoeuvre.duration_s <= 0.0:
                raise ValueError(f"manoeuvres must follow one another and last, got {manoeuvre}")
            turn_rad, change_mps = manoeuvre.turn_rad, manoeuvre.speed_change_mps
            legs.append(_Leg(manoeuvre.start_s, manoeuvre.duration_s, course_rad, speed_mps, turn_rad, change_mps))
            course_rad, speed_mps = course_rad + turn_rad, speed_mps + change_mps
            end_s = manoeuvre.start_s + manoeuvre.duration_s
            legs.append(_Leg(end_s, 0.0, course_rad, speed_mps))
        self._knots: list[tuple[float, float, float, _Leg]] = []
        north = east = 0.0
        for leg, after in zip(legs, [*legs[1:], None], strict=True):
            if leg.duration_s > 0.0:
                count = math.ceil(leg.duration_s / _STEP_S)
                times = [leg.start_s + leg.duration_s * i / count for i in range(count)]
            else:
                times = [leg.start_s]
            ends = [*times[1:], after.start_s if after is not None else times[-1]]
            for begin_s, stop_s in zip(times, ends, strict=True):
                self._knots.append((begin_s, north, east, leg))
                moved = leg.displacement_m(begin_s - leg.start_s, stop_s - leg.start_s)
                north, east = north + moved[0], east + moved[1]
        self._times = [knot[0] for knot in self._knots]

    def at(self, t_s: float) -> CourseState:
        """See `Course`; before t = 0 straight ahead."""
        begin_s, north, east, leg = self._knots[max(bisect.bisect_right(self._times, t_s) - 1, 0)]
        after_s = t_s - leg.start_s
        course, rate, acceleration, speed, speed_rate = leg.motion(after_s)
        moved = leg.displacement_m(begin_s - leg.start_s, after_s)
        c, s = math.cos(course), math.sin(course)
        return CourseState(
            np.array([north + moved[0], east + moved[1]]),
            np.array([speed * c, speed * s]),
            np.array([speed_rate * c - speed * rate * s, speed_rate * s + speed * rate * c]),
            course,
            rate,
            acceleration,
        )


@parameters
class CourseParameters:
    """Section `[ship.course]`."""

    kind: Literal["still", "straight", "s", "turn", "turn90", "random", "varying", "reverse"] = key(
        "still",
        "a turn is by `change_deg`, `turn90` by 90°; `random` turns within it, at half the speed to all of it; "
        "`varying` likewise, at any speed from none to that; `reverse` stops and goes astern",
    )
    course_deg: float = key(0.0, "the first heading, clockwise from north")
    speed_mps: float = key(2.0, "speed", ge=0)
    speed_max_mps: float = key(4.5, "the platform's fastest", "[Lee2022]: 0–4.5 m/s")
    start_s: float = key(10.0, "straight ahead before the first manoeuvre", ge=0)
    change_deg: float = key(
        130.0, "change of course, clockwise positive", "[Lee2022]: course changes up to 130° in the S", ge=-180, le=180
    )
    leg_s: float = key(5.0, "between manoeuvres; the mean on a random course; from ahead to astern on a reverse", ge=0)
    turn_radius_m: float = key(
        9.0, "tightest radius of a turn", "chosen: three platform lengths, about a frigate's tightest turn", gt=0
    )
    manoeuvres: int = key(8, "number of them in an S, a random or a varying course", ge=0, le=1000)

    def __post_init__(self) -> None:
        fastest = self.speed_max_mps
        require(0.0 <= self.speed_mps <= fastest, f"speed_mps must be in 0…{fastest:g} m/s, got {self.speed_mps}")
        turning = self.kind not in ("still", "straight")
        require(not turning or self.speed_mps > 0.0, f"a course of kind {self.kind!r} needs a speed_mps above 0")
        require(self.kind != "reverse" or self.leg_s > 0.0, "a course of kind 'reverse' needs a leg_s above 0")


def build_course(parameters: CourseParameters, rng: np.random.Generator) -> Course:
    """The course that `parameters` describe; `rng` draws a random one."""
    p = parameters
    course_rad = math.radians(p.course_deg)
    if p.kind == "still":
        return StillCourse(course_rad)
    if p.kind == "straight":
        return StraightCourse(course_rad, p.speed_mps)
    if p.kind == "reverse":
        return ManoeuvringCourse(course_rad, p.speed_mps, [Manoeuvre(p.start_s, p.leg_s, 0.0, -2.0 * p.speed_mps)])
    change_rad = math.radians(90.0 if p.kind == "turn90" else p.change_deg)
    slowest, shortest_s = (0.0, 5.0) if p.kind == "varying" else (0.5, 1.0)
    if p.kind in ("random", "varying"):
        turns = rng.uniform(-abs(change_rad), abs(change_rad), p.manoeuvres)
        speeds = p.speed_mps * rng.uniform(slowest, 1.0, p.manoeuvres)
        legs = p.leg_s * rng.uniform(0.5, 1.5, p.manoeuvres)
    else:
        count = p.manoeuvres if p.kind == "s" else 1
        turns = np.full(count, change_rad)
        turns[1::2] *= -1.0
        if p.kind == "s" and count:
            turns[0] *= 0.5
        speeds = np.full(count, p.speed_mps)
        legs = np.full(count, p.leg_s)
    manoeuvres: list[Manoeuvre] = []
    start_s, speed_mps = p.start_s, p.speed_mps
    for turn, speed, leg_s in zip(turns.tolist(), speeds.tolist(), legs.tolist(), strict=True):
        slowest_mps = max(min(speed, speed_mps), 0.1)
        duration_s = max(PEAK_BLEND_RATE * abs(turn) * p.turn_radius_m / slowest_mps, shortest_s)
        manoeuvres.append(Manoeuvre(start_s, duration_s, turn, speed - speed_mps))
        start_s, speed_mps = start_s + duration_s + leg_s, speed
    return ManoeuvringCourse(course_rad, p.speed_mps, manoeuvres)
