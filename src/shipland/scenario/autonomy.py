"""Builds the simulated vehicle of a scenario, and its vision, pilot and safety."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shipland import factories
from shipland.camera import Camera
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.flight import Autonomy
from shipland.frames import GRAVITY_MPS2
from shipland.guidance.pilot import Pilot, PilotSetup
from shipland.guidance.response import Response
from shipland.safety.assurance import Safety
from shipland.scenario.scenario import Scenario
from shipland.scenario.seeds import generators_of
from shipland.scenario.visions import VisionSetup
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.aircraft.record import Record
from shipland.sim.aircraft.step import drag_slope_per_s
from shipland.sim.ship.ship import Ship, build_ship
from shipland.sim.wind import WindParameters, build_wind, drawn_wind
from shipland.sim.world import GRID, Grid, World
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vehicles.vehicle import GroundTruthSource, Real, Vehicle

if TYPE_CHECKING:
    from shipland.sim.scene.scene import Scene


def build_scene(scenario: Scenario, seed: int) -> Scene:
    """The drawn scene of the flight of `seed`; the caller closes it."""
    from shipland.sim.scene.scene import Scene  # a flight without pictures imports no drawing

    return Scene(scenario.rig, scenario.scene, generators_of(seed).scene, aircraft_scale(scenario))


def aircraft_scale(scenario: Scenario) -> float:
    """Scale of the drawn aircraft, by its motors' diagonal."""
    from shipland.sim.scene.mesh import MOTOR_DIAGONAL_M

    return round(scenario.aircraft.airframe.motor_diagonal_m / MOTOR_DIAGONAL_M, 1)


def build_vehicle(scenario: Scenario, seed: int, scene: Scene | None) -> SimulatedVehicle:
    """The simulated vehicle of one flight; without a `scene` it gives no pictures. The same seed, the same flight."""
    world, rng = build_world(scenario, seed), generators_of(seed)
    return SimulatedVehicle(world, Camera.from_parameters(scenario.camera), scenario.delays, scene, rng.picture)


def build_world(scenario: Scenario, seed: int, grid: Grid = GRID) -> World:
    """The world of one flight at its start."""
    rng = generators_of(seed)
    return World(
        scenario.rig,
        scenario.camera,
        scenario.aircraft,
        scenario.verdict,
        build_ship(scenario.ship, scenario.rig, rng.ship),
        build_wind(scenario.wind, scenario.rig, rng.wind),
        scenario.start,
        rng.aircraft,
        scenario.wind.at_sea,
        grid,
    )


def build_autonomy(
    scenario: Scenario,
    vehicle: Vehicle,
    pilot: str | Factory,
    vision: str | Factory,
    seed: int,
    response: Response | None = None,
) -> Autonomy:
    """Vision, pilot and safety for one flight.

    Args:
        scenario: the flight's configuration.
        vehicle: the vehicle that flies it.
        pilot: name or factory, as `factories.resolve` takes it.
        vision: likewise.
        seed: of the flight.
        response: what full sticks mean, where it was measured; None asks the vehicle or the scenario.

    Raises:
        ConfigError: no such pilot or vision, or one that this vehicle cannot fly with.
    """
    rng = generators_of(seed)
    setup = PilotSetup(
        guidance=scenario.guidance,
        rig=scenario.rig,
        camera=vehicle.camera,
        camera_in_body_m=np.array(scenario.camera.position_in_body_m),
        response=response or (vehicle.response() if isinstance(vehicle, Real) else response_of(scenario)),
        rng=rng.pilot,
    )
    flier: Pilot = factories.resolve("pilots", pilot)(setup)
    if scenario.follow.enabled:
        if not isinstance(vehicle, GroundTruthSource):
            raise ConfigError("follow.enabled needs the truth, which only a simulated world knows")
        from shipland.scenario.follower import DeckFollower  # an ablation: other flights do without

        flier = DeckFollower(flier, vehicle, math.radians(scenario.aircraft.settings.max_tilt_deg), scenario.follow)
    sees = factories.resolve("visions", vision)(VisionSetup(scenario, vehicle.camera, vehicle, rng.near, rng.far))
    safety = Safety(scenario.safety, scenario.rig, vehicle.camera, setup.camera_in_body_m, setup.response)
    delays = replace(scenario.delays, processing="measured") if isinstance(vehicle, Real) else scenario.delays
    return Autonomy(sees, flier, safety, delays)


def drawn_ship(scenario: Scenario, seed: int) -> Ship:
    """The ship that the flight of `seed` meets."""
    return build_ship(scenario.ship, scenario.rig, generators_of(seed).ship)


def drawn_wind_of(scenario: Scenario, seed: int) -> WindParameters:
    """The mean wind that the flight of `seed` meets."""
    return drawn_wind(scenario.wind, generators_of(seed).wind)


def response_of(scenario: Scenario) -> Response:
    """The response of the simulated quadrotor, from its parameters.

    A tilt follows its stick by 1 / `attitude_per_s` on average, whatever loops lie inside: what is not the rotors' lag
    counts as dead time. Drag is linear about the hover in a wind. An aircraft or a loop of one's own, which these say
    little of, is identified from a flight instead (`shipland identify`).
    """
    settings, loop, airframe = scenario.aircraft.settings, scenario.aircraft.loop, scenario.aircraft.airframe
    velocity = loop.kind == "velocity"
    tilt_s = 1.0 / loop.attitude_per_s
    rotors_s = min(airframe.motor_time_s, tilt_s)
    climb_rotors_s = min(airframe.motor_time_s, 0.5 * loop.climb_time_s)
    tilt_rate_mps3 = GRAVITY_MPS2 * math.radians(settings.max_tilt_rate_deg_s)
    # A velocity's step from picture to picture, up to this one, stays below the autopilot's limit of acceleration.
    step_mps = loop.acceleration_mps2 * loop.velocity_time_s
    return Response(
        kind="velocity" if velocity else "attitude",
        max_tilt_rad=math.radians(loop.tilt_limit_deg if velocity else settings.max_tilt_deg),
        max_speed_mps=settings.max_speed_mps if velocity else 0.0,
        lag_s=tilt_s if velocity else rotors_s,
        servo_per_s=loop.velocity_per_s if velocity else 0.0,
        integral_per_s2=loop.velocity_integral_per_s2 if velocity else 0.0,
        approach_per_s=1.0 / loop.velocity_time_s if velocity else 0.0,
        smoothing_s=loop.tilt_time_s if velocity else 0.0,
        drag_per_s=0.0 if velocity else _drag_per_s(scenario.aircraft),
        max_input_rate=step_mps * scenario.camera.frame_rate_hz if velocity else tilt_rate_mps3,
        max_climb_mps=settings.max_vertical_speed_mps,
        climb_lag_s=loop.climb_time_s - climb_rotors_s,
        max_turn_rad_s=math.radians(settings.max_yaw_rate_deg_s),
        turn_lag_s=0.2,
        uplink_s=scenario.delays.uplink_s,
        dead_time_s=0.0 if velocity else tilt_s - rotors_s,
        climb_dead_time_s=climb_rotors_s,
        hold_below_percent=loop.hold_below_percent,
        stick_step_percent=settings.stick_step_percent,
        velocity_reference=loop.velocity_reference,
    )


_DRAG_WIND_MPS = 5.0
"""Wind about which the stated drag is linear."""


def _drag_per_s(aircraft: AircraftParameters) -> float:
    """Stated to two decimals: in other winds than this it is not better known."""
    return round(drag_slope_per_s(Record(aircraft, GRID.tick_s).constants, _DRAG_WIND_MPS), 2)
