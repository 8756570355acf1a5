"""One simulated flight, with or without what it leaves behind."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shipland import __version__, factories
from shipland.camera import Camera
from shipland.config import build, packaged_toml
from shipland.factories import Factory
from shipland.flight import FlightResult, fly
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.missions.crew import build_crew, build_vehicle
from shipland.missions.scenarios import Scenario
from shipland.missions.visions import needs_pictures
from shipland.record.info import FlightInfo, config_digest
from shipland.record.writer import LogParameters, LogWriter
from shipland.sim.scene.scene import Scene


@dataclass(frozen=True)
class Flown:
    """A flight's end: the loop's result and the verdict where there was a touchdown."""

    result: FlightResult
    verdict: TouchdownVerdict | None

    @property
    def reason(self) -> str:
        """What became of the flight, in words."""
        return self.verdict.reason if self.verdict is not None else f"no touchdown: {self.result.reason}"

    @property
    def succeeded(self) -> bool:
        """Landed on its feet, in the square."""
        return self.verdict is not None and self.verdict.landed and self.verdict.in_square


def fly_quietly(
    scenario: Scenario,
    pilot: str | Factory,
    vision: str | Factory,
    seed: int,
    on_cycle: Callable[[FlightRecord], None] = lambda _: None,
) -> Flown:
    """Fly one seed and keep nothing but the verdict; pilot and vision as `factories.resolve` takes them."""
    with ExitStack() as stack:
        scene = None
        if needs_pictures(factories.resolve("visions", vision)):
            scene = Scene(scenario.rig, scenario.scene, seed)
            stack.callback(scene.close)
        vehicle = build_vehicle(scenario, seed, scene)
        crew = build_crew(scenario, vehicle, pilot, vision, seed)
        result = fly(vehicle, crew, scenario.time_limit_s, time.perf_counter, on_cycle)
        return Flown(result, vehicle.verdict())


def flight_info(scenario: Scenario, pilot: str | Factory, seed: int) -> FlightInfo:
    """What the log says of a flight."""
    airframe = scenario.aircraft.airframe
    diagonal_m = 2.0 * float(np.hypot(airframe.motor_forward_m, airframe.motor_right_m))
    digest = config_digest(scenario.table())
    return FlightInfo(scenario.name, seed, factories.name_of(pilot), __version__, digest, diagonal_m)


def flight_log(path: Path, scenario: Scenario, pilot: str | Factory, seed: int) -> LogWriter:
    """A log of one flight without pictures."""
    info = flight_info(scenario, pilot, seed)
    camera = Camera.from_parameters(scenario.camera)
    return LogWriter(
        path,
        info,
        scenario.rig,
        camera,
        replace(build(LogParameters, packaged_toml("outputs")["log"], "outputs.log"), image_rate_hz=0.0),
    )
