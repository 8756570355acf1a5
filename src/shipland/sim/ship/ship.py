"""The ship: a course over the sea, the deck's motion on it, and the poses that follow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters, require
from shipland.frames import Array, Pose, rows_from_euler
from shipland.rig import Rig
from shipland.sim.ship.course import Course, CourseParameters, CourseState, StillCourse, build_course
from shipland.sim.ship.deck_motion import (
    DeckMotion,
    Later,
    LimitBite,
    LimitedMotion,
    LimitParameters,
    SinusoidParameters,
    SixDof,
    Still,
    rig_limits,
)
from shipland.sim.ship.sea import SeaParameters, deck_motion
from shipland.sim.wind import ShipPlace

rows_of_euler = compiled(rows_from_euler)

__all__ = ["Ship", "ShipParameters", "ShipState", "Still", "StillCourse", "build_ship"]


class ShipState(NamedTuple):
    """The ship at one instant.

    In rig mode the platform and the bar move with the course alone and only the deck has the six motions, as on the
    motion base of [Lee2022]. In full-ship mode the deck is part of the hull: the superstructure has the deck's six
    motions, and the bar's centre is a point of the hull while gyros keep it level, on the course plus the ship's yaw.

    Attributes:
        course: the `ship` origin.
        deck: the deck in `ship`.
        rig: dimensions.
        full_ship: the superstructure and the bar have the ship's motions too.
        waves_off: the status light shines red.
        ned_from_ship: course and position only; origin at the deck centre's neutral point, `deck_height_m` above the
            sea plane.
        ned_from_deck: the deck with all its motions.
        ned_from_bar: the bar: level always.
    """

    course: CourseState
    deck: SixDof
    rig: Rig
    full_ship: bool
    waves_off: bool
    ned_from_ship: Pose
    ned_from_deck: Pose
    ned_from_bar: Pose

    @property
    def place(self) -> ShipPlace:
        """Where `ship` is."""
        return place_of(self.course.values, self.rig.deck_height_m)

    @property
    def ned_from_hull(self) -> Pose:
        """Platform and superstructure: `ship` in rig mode, `deck` in full-ship mode."""
        return self.ned_from_deck if self.full_ship else self.ned_from_ship


def place_of(course: Array, deck_height_m: float) -> ShipPlace:
    """Where `ship` is by `CourseState.values`."""
    north_m, east_m, _, _, _, _, course_rad, _, _ = course.tolist()
    return ShipPlace(north_m, east_m, -deck_height_m, course_rad)


@compiled
def _place_ship(
    course: Array,
    deck: Array,
    deck_height_m: float,
    bar_in_ship_m: Array,
    full_ship: bool,
    rotations: Array,
    places_m: Array,
) -> None:
    """Write poses in `ned` of ship, deck and bar, rotations (3,3,3) and translations (3,3); see `ShipState`."""
    c, s = math.cos(course[6]), math.sin(course[6])
    _turn(rotations[0], 0.0, 0.0, course[6])
    places_m[0, 0], places_m[0, 1], places_m[0, 2] = course[0], course[1], -deck_height_m
    _turn(rotations[1], deck[3], deck[4], course[6] + deck[5])
    for index in range(3):
        places_m[1, index] = places_m[0, index]
    places_m[1, 0] += c * deck[0] - s * deck[1]
    places_m[1, 1] += s * deck[0] + c * deck[1]
    places_m[1, 2] += deck[2]
    carrier = 1 if full_ship else 0
    _turn(rotations[2], 0.0, 0.0, course[6] + (deck[5] if full_ship else 0.0))
    for index in range(3):
        places_m[2, index] = places_m[carrier, index]
        for along in range(3):
            places_m[2, index] += rotations[carrier, index, along] * bar_in_ship_m[along]


@compiled
def _turn(rotation: Array, roll_rad: float, pitch_rad: float, yaw_rad: float) -> None:
    """Write a rotation (3,3)."""
    rows = rows_of_euler(roll_rad, pitch_rad, yaw_rad)
    for index in range(9):
        rotation[index // 3, index % 3] = rows[index]


class Ship:
    """A ship: where it goes and how its deck moves.

    Args:
        rig: dimensions.
        course: motion of the `ship` origin.
        deck_motion: motion of `deck` in `ship`.
        full_ship: see `ShipState`.
        start_s: how far into its motion the deck is at time zero; for the record.
        waves_off_s: from and to, when the status light flashes.
    """

    def __init__(
        self,
        rig: Rig,
        course: Course,
        deck_motion: DeckMotion,
        full_ship: bool = False,
        start_s: float = 0.0,
        waves_off_s: Sequence[tuple[float, float]] = (),
    ) -> None:
        self.rig = rig
        self.course = course
        self.deck_motion = deck_motion
        self.full_ship = full_ship
        self.start_s = start_s
        self._waves_off_s = waves_off_s

    @property
    def limit_bites(self) -> tuple[LimitBite, ...]:
        """Where the motion base's limits have held the deck back so far."""
        return self.deck_motion.bites if isinstance(self.deck_motion, LimitedMotion) else ()

    def at(self, t_s: float) -> ShipState:
        """The ship at time `t_s` [s]."""
        flashes = bool(self._waves_off_s) and t_s % _FLASH_S < 0.5 * _FLASH_S
        waves_off = flashes and any(begin_s <= t_s < end_s for begin_s, end_s in self._waves_off_s)
        course, deck, rig = self.course.at(t_s), self.deck_motion.at(t_s), self.rig
        rotations, places_m = np.empty((3, 3, 3)), np.empty((3, 3))
        motion = course.values, deck.values, rig.deck_height_m, rig.bar_in_ship_m
        _place_ship(*motion, self.full_ship, rotations, places_m)
        return ShipState(course, deck, rig, self.full_ship, waves_off, *map(Pose, rotations, places_m))


_FLASH_S = 0.5
"""The status light flashes 120 times a minute, half of the time [IMO MODU Code 2009, 13.5.26]."""


@parameters
class ScaleParameters:
    """Section `[ship.scale]`: from a full-scale ship to the rig."""

    length: float = key(
        8.33, "full-scale lengths are divided by it", "chosen: a frigate's beam to 1.8 m", ge=1, le=1000
    )
    time: Literal["froude", "length_only"] = key(
        "froude",
        "times are divided by √length, or stay",
        "froude: the honest one | length_only: [Lee2022]'s slower one",
    )

    @property
    def time_scale(self) -> float:
        """Full-scale times are divided by it."""
        return math.sqrt(self.length) if self.time == "froude" else 1.0


@parameters
class RecordedParameters:
    """Section `[ship.recorded]`."""

    path: str = key("", "CSV file in the working directory", "t_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg")
    full_scale: bool = key(False, "the record is a full-scale ship's and is scaled by `[ship.scale]`")


@parameters
class ShipParameters:
    """What the configuration says of the ship in section `[ship]`."""

    motion: Literal["still", "natops", "sinusoids", "sea", "recorded"] = key(
        "still", "what moves the deck", "still | natops | sinusoids | sea | recorded"
    )
    same_motion: bool = key(
        False, "every flight meets one motion, at an instant of its own", "chosen; for pictures of many landings"
    )
    instant_range_s: float = key(120.0, "the instants are drawn from this much of the motion", ge=0)
    full_ship: bool = key(
        False, "superstructure and bar have the ship's motions too", "chosen: [Lee2022] moves the deck alone"
    )
    waves_off_s: tuple[tuple[float, float], ...] = key(
        (), "from and to, when the status light of `[rig]` flashes red: no landing"
    )
    course: CourseParameters = key(CourseParameters(), "where the ship goes")
    natops: SinusoidParameters = key(
        SinusoidParameters(
            amplitude_m_deg=(0.0, 0.0, 0.0, 8.0, 3.0, 0.0), period_s=(10.0, 10.0, 10.0, 10.1, 6.5, 10.0)
        ),
        "deck-motion limits of the US Navy's NATOPS manual",
        "[Lee2022, §Ship Motions and Vertical Landing Safety]; a still axis' period is unused",
    )
    sinusoids: SinusoidParameters = key(
        SinusoidParameters(amplitude_m_deg=(0.0, 0.0, 0.1, 4.0, 2.0, 0.0), period_s=(10.0, 10.0, 8.0, 10.0, 7.0, 10.0)),
        "any other sinusoids",
        "chosen: a harmless example",
    )
    sea: SeaParameters = key(SeaParameters(), "the frigate in waves")
    recorded: RecordedParameters = key(RecordedParameters(), "a recorded motion")
    scale: ScaleParameters = key(ScaleParameters(), "from the frigate to the rig")
    limits: LimitParameters = key(LimitParameters(), "the motion base's limits")

    def __post_init__(self) -> None:
        missing = self.motion == "recorded" and not self.recorded.path
        require(not missing, 'motion = "recorded" needs recorded.path, a CSV file')
        ordered = all(begin_s < end_s for begin_s, end_s in self.waves_off_s)
        require(ordered, "waves_off_s must be pairs of times, from and to")


SAME_MOTION_SEED = 1
"""Seed of the motion that every flight meets with `same_motion`."""


def build_ship(parameters: ShipParameters, rig: Rig, rng: np.random.Generator) -> Ship:
    """The ship that `parameters` describe; `rng` draws its course, then the phases of its motion.

    Raises:
        DataError: the recorded motion cannot be used.
    """
    course = build_course(parameters.course, rng)
    start_s = 0.0
    if parameters.same_motion:
        start_s = float(rng.uniform(0.0, parameters.instant_range_s))
        motion: DeckMotion = Later(build_deck_motion(parameters, np.random.default_rng(SAME_MOTION_SEED)), start_s)
    else:
        motion = build_deck_motion(parameters, rng)
    if parameters.limits.enabled and not parameters.full_ship and parameters.motion != "still":
        motion = LimitedMotion(motion, rig_limits(rig), parameters.limits.knee)
    return Ship(rig, course, motion, parameters.full_ship, start_s, parameters.waves_off_s)


def build_deck_motion(parameters: ShipParameters, rng: np.random.Generator) -> DeckMotion:
    """The deck's motion before the motion base's limits; DataError when a recorded motion cannot be used."""
    scale = parameters.scale
    match parameters.motion:
        case "still":
            return Still()
        case "natops":
            return parameters.natops.motion(rng)
        case "sinusoids":
            return parameters.sinusoids.motion(rng)
        case "sea":
            return deck_motion(parameters.sea, rng, scale.length, scale.time_scale)
        case "recorded":
            from shipland.sim.ship.recorded import read_motion  # SciPy's splines, for these two motions alone

            scales = (scale.length, scale.time_scale) if parameters.recorded.full_scale else (1.0, 1.0)
            return read_motion(Path(parameters.recorded.path), *scales)
