"""Simulated worlds for tests: the packaged configuration with a few things changed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from shipland.camera import CameraParameters
from shipland.config import build
from shipland.frames import Array
from shipland.messages import Intent, PilotCommand, TouchdownVerdict
from shipland.rig import Rig
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.ship.course import CourseState, StillCourse
from shipland.sim.ship.deck_motion import DeckMotion, Sinusoids, Still
from shipland.sim.ship.ship import Ship
from shipland.sim.state import Snapshot
from shipland.sim.touchdown import VerdictParameters
from shipland.sim.wind import SteadyWind, Wind
from shipland.sim.world import StartParameters, World

QUIET = {
    "sensors": {
        "velocity_noise_mps": 0.0,
        "flow_bias_mps": 0.0,
        "flow_wave_mps": 0.0,
        "flow_lost_share": 0.0,
        "attitude_bias_rad": 0.0,
        "range_noise_m": 0.0,
        "attitude_noise_rad": 0.0,
        "heading_noise_rad": 0.0,
        "heading_bias_rad": 0.0,
        "height_noise_m": 0.0,
        "height_drift_m_per_sqrt_s": 0.0,
    }
}
"""Laid over `[aircraft]`: every sensor exact."""


def aircraft_parameters(overlay: dict[str, Any] | None = None) -> AircraftParameters:
    """The packaged aircraft with `overlay` laid over it."""
    return build(AircraftParameters, overlay or {}, "aircraft")


def world(
    *,
    distance_m: float = 300.0,
    bearing_deg: float = 0.0,
    height_m: float = 20.0,
    wind_mps: tuple[float, float, float] | Wind = (0.0, 0.0, 0.0),
    ship: Ship | None = None,
    aircraft: dict[str, Any] | None = None,
    camera: dict[str, Any] | None = None,
    start: dict[str, Any] | None = None,
    seed: int = 5,
    water: bool = False,
) -> World:
    """A world with an exact start: far astern of a ship that lies still heading north, unless told otherwise."""
    rig = Rig()
    exact = {
        "distance_m": distance_m,
        "distance_half_range_m": 0.0,
        "bearing_deg": bearing_deg,
        "bearing_half_range_deg": 0.0,
        "height_m": height_m,
        "height_half_range_m": 0.0,
        "heading_error_half_range_deg": 0.0,
    }
    return World(
        rig,
        build(CameraParameters, camera or {}, "camera"),
        aircraft_parameters(aircraft),
        VerdictParameters(),
        ship or Ship(rig, StillCourse(), Still()),
        SteadyWind(wind_mps) if isinstance(wind_mps, tuple) else wind_mps,
        build(StartParameters, exact | (start or {}), "start"),
        np.random.default_rng(seed),
        water,
    )


def come_down(flown: World, *, percent: float = -50.0, intent: Intent = Intent.LAND, most_s: float = 15.0) -> None:
    """Descend with the other sticks centred until there is a verdict."""
    while not flown.over() and flown.t_s < most_s:
        flown.command(PilotCommand(flown.t_s, 0.0, 0.0, percent, 0.0, 0.0, intent))
        flown.advance(flown.t_s + 0.1)


class Deck(NamedTuple):
    """`deck_values` by name."""

    origin_m: Array
    velocity_mps: Array
    acceleration_mps2: Array
    angles_rad: Array
    rates_rad_s: Array
    accelerations_rad_s2: Array
    ned_from_deck: Array
    turn_rad_s: Array

    @staticmethod
    def of(values: Array) -> Deck:
        return Deck(*values[:18].reshape(6, 3), values[18:27].reshape(3, 3), values[27:])


class NoCamera:
    """In place of a `FrameServer`, whose process takes a second to start: nobody asks for a picture."""

    def show(self, t_s: float, snapshot: Snapshot) -> None:
        """Nothing."""

    def end(self, verdict: TouchdownVerdict) -> None:
        """Nothing."""


class CircleCourse:
    """Way at a steady speed along a circle, heading along it."""

    def __init__(self, speed_mps: float, rate_rad_s: float) -> None:
        self._speed, self._rate = speed_mps, rate_rad_s

    def at(self, t_s: float) -> CourseState:
        speed, rate = self._speed, self._rate
        course = rate * t_s
        c, s = math.cos(course), math.sin(course)
        return CourseState(
            speed / rate * np.array([s, 1.0 - c]),
            speed * np.array([c, s]),
            speed * rate * np.array([-s, c]),
            course,
            rate,
            0.0,
        )


class WanderingCourse:
    """A course with everything in it: position and heading wander, each on its own."""

    def at(self, t_s: float) -> CourseState:
        a, b, c = 0.3 * t_s, 0.2 * t_s, 0.4 * t_s
        return CourseState(
            np.array([3.0 * math.sin(a), 2.0 * math.cos(b)]),
            np.array([0.9 * math.cos(a), -0.4 * math.sin(b)]),
            np.array([-0.27 * math.sin(a), -0.08 * math.cos(b)]),
            0.6 * math.sin(c) + 0.3,
            0.24 * math.cos(c),
            -0.096 * math.sin(c),
        )


def natops() -> DeckMotion:
    """[Lee2022]'s NATOPS limits: roll ±8° at 10.1 s, pitch ±3° at 6.5 s."""
    amplitude = [0.0, 0.0, 0.0, math.radians(8.0), math.radians(3.0), 0.0]
    return Sinusoids(amplitude, [10.0, 10.0, 10.0, 10.1, 6.5, 10.0], [0.0, 0.0, 0.0, 0.4, 1.1, 0.0])


def six_sinusoids() -> DeckMotion:
    """All six motions, a tenth of the rig's limits to a half."""
    amplitude = [0.3, 0.2, 0.15, math.radians(8.0), math.radians(5.0), math.radians(6.0)]
    return Sinusoids(amplitude, [7.0, 5.0, 4.0, 6.0, 5.5, 8.0], [0.1, 0.9, 1.7, 0.4, 1.1, 2.0])
