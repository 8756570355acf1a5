"""Scenarios: the packaged defaults, a scenario laid over them, the user's file over both; and the crew to fly one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shipland.camera import Camera, CameraParameters
from shipland.config import build, merge, packaged_names, packaged_toml, read_toml, require
from shipland.errors import ConfigError
from shipland.flight import Crew
from shipland.guidance.offset_free import Response
from shipland.guidance.parameters import GuidanceParameters
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.pilots import offset_free, paper
from shipland.guidance.safety import Safety, SafetyParameters
from shipland.missions.follower import DeckFollower, FollowParameters
from shipland.missions.geometric import GeometricParameters, GeometricVision
from shipland.missions.geometric_far import GeometricFar
from shipland.rig import Rig
from shipland.sim.air.wind import WindParameters, build_wind
from shipland.sim.aircraft.parameters import GRAVITY_MPS2, AircraftParameters
from shipland.sim.contact.touchdown import VerdictParameters
from shipland.sim.scene.scene import Scene, SceneParameters
from shipland.sim.ship.ship import ShipParameters, build_ship
from shipland.sim.world import StartParameters, World
from shipland.vehicles.delays import DelayParameters
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vision.eyes import Eyes, EyesParameters
from shipland.vision.far.detector import DetectorParameters
from shipland.vision.far.far import FarVision
from shipland.vision.near.pipeline import NearVision, VisionParameters
from shipland.vision.vision import Vision

CameraKind = Literal["rendered", "geometric"]
PilotKind = Literal["paper", "offset_free"]


@dataclass(frozen=True)
class Scenario:
    """Everything that a simulated flight is made of, but for the seed; one attribute a TOML section."""

    description: str
    time_limit_s: float
    rig: Rig
    camera: CameraParameters
    delays: DelayParameters
    aircraft: AircraftParameters
    start: StartParameters
    ship: ShipParameters
    wind: WindParameters
    scene: SceneParameters
    verdict: VerdictParameters
    vision: VisionParameters
    detector: DetectorParameters
    eyes: EyesParameters
    guidance: GuidanceParameters
    safety: SafetyParameters
    geometric: GeometricParameters
    follow: FollowParameters

    def __post_init__(self) -> None:
        require(self.time_limit_s > 0.0, f"time_limit_s must be positive, got {self.time_limit_s}")


def scenario_table(name: str, config: Path | None = None) -> dict[str, Any]:
    """The merged table of a packaged scenario's name, or of a TOML file laid over the defaults.

    Raises:
        ConfigError: no such scenario, or a file is missing or broken.
    """
    if name.endswith(".toml"):
        overlay = read_toml(Path(name))
    elif name in packaged_names("scenarios"):
        overlay = packaged_toml(f"scenarios/{name}")
    else:
        known = ", ".join(packaged_names("scenarios"))
        raise ConfigError(f"no scenario {name!r}; there are: {known}, or give a path that ends in .toml")
    # One thread: a flight is repeated bit by bit, and campaigns fly one flight a core.
    detector = packaged_toml("learning")["detector"] | {"threads": 1}
    table = merge(merge(packaged_toml("default"), {"detector": detector}), overlay)
    return merge(table, read_toml(config)) if config is not None else table


def load_scenario(table: dict[str, Any]) -> Scenario:
    """The scenario of a merged table; ConfigError names what is wrong in it."""
    return build(Scenario, table, "configuration")


def build_vehicle(scenario: Scenario, seed: int, scene: Scene | None) -> SimulatedVehicle:
    """The simulated vehicle of one flight, its camera rendered or (`scene` None) geometric; seeds repeat flights."""
    ship_rng, wind_rng, world_rng, picture_rng, *_ = _generators(seed)
    world = World(
        scenario.rig,
        scenario.camera,
        scenario.aircraft,
        scenario.verdict,
        build_ship(scenario.ship, scenario.rig, ship_rng),
        build_wind(scenario.wind, scenario.rig, wind_rng),
        scenario.start,
        world_rng,
    )
    return SimulatedVehicle(world, Camera.from_parameters(scenario.camera), scenario.delays, scene, picture_rng)


def build_crew(scenario: Scenario, vehicle: SimulatedVehicle, pilot: PilotKind, camera: CameraKind, seed: int) -> Crew:
    """Eyes, pilot and safety for one flight."""
    setup = PilotSetup(
        guidance=scenario.guidance,
        rig=scenario.rig,
        camera=vehicle.camera,
        camera_in_body_m=np.array(scenario.camera.position_in_body_m),
        response=response_of(scenario),
        rng=_generators(seed)[6],
    )
    flier = paper(setup) if pilot == "paper" else offset_free(setup)
    if scenario.follow.enabled:
        flier = DeckFollower(flier, vehicle, math.radians(scenario.aircraft.settings.max_tilt_deg), scenario.follow)
    near_eyes: Vision
    far_eyes: Vision
    if camera == "rendered":
        near_eyes = NearVision(scenario.rig.target, vehicle.camera, scenario.vision)
        far_eyes = FarVision.load(vehicle.camera, scenario.detector)
    else:
        generators, model = _generators(seed), scenario.geometric
        near_eyes = GeometricVision(
            vehicle, scenario.rig.target, vehicle.camera, model, scenario.vision.gimbal_noise_rad, generators[4]
        )
        far_eyes = GeometricFar(
            vehicle, vehicle.camera, scenario.rig, model.ship, model.bar, model.boxes, generators[5]
        )
    eyes = Eyes(near_eyes, far_eyes, scenario.eyes)
    return Crew(eyes, flier, Safety(scenario.safety, scenario.rig), scenario.delays)


def motion_start_s(scenario: Scenario, seed: int) -> float:
    """How far into the one motion that every flight meets this flight starts [s]; 0 where each has its own."""
    return build_ship(scenario.ship, scenario.rig, _generators(seed)[0]).start_s


def response_of(scenario: Scenario) -> Response:
    """What full sticks mean, from the settings of the simulated aircraft."""
    settings, airframe = scenario.aircraft.settings, scenario.aircraft.airframe
    max_tilt_rad = math.radians(settings.max_tilt_deg)
    return Response(
        max_tilt_rad=max_tilt_rad,
        speed_time_s=airframe.level_speed_mps(max_tilt_rad) / (GRAVITY_MPS2 * math.tan(max_tilt_rad)),
        max_climb_mps=settings.max_vertical_speed_mps,
        max_turn_rad_s=math.radians(settings.max_yaw_rate_deg_s),
        uplink_s=scenario.delays.uplink_s,
    )


def _generators(seed: int) -> list[np.random.Generator]:
    """Independent generators of ship, wind, aircraft, picture, geometric corners and boxes, and of the pilot."""
    return [np.random.default_rng(sequence) for sequence in np.random.SeedSequence(seed).spawn(7)]
