"""The ship: a course over the sea, the deck's motion on it, and the poses that follow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from shipland.config import require
from shipland.frames import Array, Pose
from shipland.rig import Rig
from shipland.sim.course import Course, CourseState, StillCourse, StraightCourse
from shipland.sim.deck_motion import DeckMotion, Harmonics, Sinusoids, SixDof, Still

__all__ = [
    "Course",
    "CourseState",
    "DeckMotion",
    "Harmonics",
    "Ship",
    "ShipParameters",
    "ShipState",
    "Sinusoids",
    "SixDof",
    "Still",
    "StillCourse",
    "StraightCourse",
    "build_ship",
]


@dataclass(frozen=True)
class ShipState:
    """The ship at one instant. The poses are computed when first asked for.

    In rig mode the platform and the bar move with the course alone and only the deck has the six motions, as on the
    motion base of [Lee2022]. In full-ship mode the deck is part of the hull: the superstructure has the deck's six
    motions, and the bar's centre is a point of the hull while gyros keep it level, on the course plus the ship's yaw.

    Attributes:
        course: the `ship` origin.
        deck: the deck in `ship`.
        rig: dimensions.
        full_ship: the superstructure and the bar have the ship's motions too.
    """

    course: CourseState
    deck: SixDof
    rig: Rig
    full_ship: bool

    @cached_property
    def ned_from_ship(self) -> Pose:
        """Course and position only; origin at the deck centre's neutral point, `deck_height_m` above the sea plane."""
        north_m, east_m = self.course.position_in_ned_m
        return Pose.from_euler((north_m, east_m, -self.rig.deck_height_m), 0.0, 0.0, self.course.course_rad)

    @cached_property
    def ned_from_deck(self) -> Pose:
        """The deck with all its motions."""
        x, y, z, roll, pitch, yaw = self.deck.displacement
        return self.ned_from_ship @ Pose.from_euler((x, y, z), roll, pitch, yaw)

    @cached_property
    def ned_from_hull(self) -> Pose:
        """Platform and superstructure: `ship` in rig mode, `deck` in full-ship mode."""
        return self.ned_from_deck if self.full_ship else self.ned_from_ship

    @cached_property
    def ned_from_bar(self) -> Pose:
        """The bar: level always."""
        if not self.full_ship:
            return self.ned_from_ship @ self.rig.ship_from_bar
        centre_in_ned_m = self.ned_from_deck.apply(self.rig.bar_in_ship_m)
        yaw_rad = self.course.course_rad + float(self.deck.displacement[5])
        return Pose.from_euler(centre_in_ned_m, 0.0, 0.0, yaw_rad)


class Ship:
    """A ship: where it goes and how its deck moves.

    Args:
        rig: dimensions.
        course: motion of the `ship` origin.
        deck_motion: motion of `deck` in `ship`.
        full_ship: see `ShipState`.
    """

    def __init__(self, rig: Rig, course: Course, deck_motion: DeckMotion, full_ship: bool = False) -> None:
        self.rig = rig
        self.course = course
        self.deck_motion = deck_motion
        self.full_ship = full_ship

    def at(self, t_s: float) -> ShipState:
        """The ship at time `t_s` [s]."""
        return ShipState(self.course.at(t_s), self.deck_motion.at(t_s), self.rig, self.full_ship)


@dataclass(frozen=True)
class CourseParameters:
    """Section `[ship.course]`.

    Attributes:
        kind: shape of the course.
        course_deg: the first heading, clockwise from north.
        speed_mps: speed through the water.
    """

    kind: Literal["still", "straight"]
    course_deg: float
    speed_mps: float

    def __post_init__(self) -> None:
        require(0.0 <= self.speed_mps <= 4.5, f"speed_mps must be in 0…4.5 m/s, got {self.speed_mps}")


@dataclass(frozen=True)
class SinusoidParameters:
    """One amplitude and period a degree of freedom: surge, sway, heave, roll, pitch, yaw.

    Attributes:
        amplitude_m_deg: three lengths [m], three angles [deg].
        period_s: six periods; that of a still degree of freedom is not used.
    """

    amplitude_m_deg: tuple[float, float, float, float, float, float]
    period_s: tuple[float, float, float, float, float, float]

    def __post_init__(self) -> None:
        require(min(self.amplitude_m_deg) >= 0.0, "amplitude_m_deg must not be negative")
        require(min(self.period_s) > 0.0, "period_s must be positive")

    @property
    def amplitude(self) -> Array:
        """(6,) [m, m, m, rad, rad, rad]."""
        values = np.array(self.amplitude_m_deg)
        values[3:] = np.radians(values[3:])
        return values


@dataclass(frozen=True)
class ShipParameters:
    """What the configuration says of the ship in section `[ship]`.

    Attributes:
        motion: what moves the deck.
        full_ship: superstructure and bar have the ship's motions too (see `ShipState`).
        course: where the ship goes.
        natops: the deck-motion limits of the US Navy's NATOPS manual, as [Lee2022] flies them.
        sinusoids: any other sinusoids.
    """

    motion: Literal["still", "natops", "sinusoids"]
    full_ship: bool
    course: CourseParameters
    natops: SinusoidParameters
    sinusoids: SinusoidParameters


def build_ship(parameters: ShipParameters, rig: Rig, rng: np.random.Generator) -> Ship:
    """The ship that `parameters` describe; `rng` draws the phases of its motion."""
    return Ship(rig, _course(parameters.course), _motion(parameters, rng), parameters.full_ship)


def _course(parameters: CourseParameters) -> Course:
    course_rad = float(np.radians(parameters.course_deg))
    if parameters.kind == "straight":
        return StraightCourse(course_rad, parameters.speed_mps)
    return StillCourse(course_rad)


def _motion(parameters: ShipParameters, rng: np.random.Generator) -> DeckMotion:
    if parameters.motion == "still":
        return Still()
    waves = parameters.natops if parameters.motion == "natops" else parameters.sinusoids
    return Sinusoids(waves.amplitude, waves.period_s, rng.uniform(0.0, 2.0 * np.pi, 6))
