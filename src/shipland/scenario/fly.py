"""One simulated flight, with or without what it leaves behind."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shipland import factories
from shipland.camera import Camera
from shipland.factories import Factory
from shipland.flight import FlightResult, fly
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.scenario.autonomy import build_autonomy, build_scene, build_vehicle
from shipland.scenario.faults import with_faults
from shipland.scenario.scenario import Scenario
from shipland.scenario.visions import needs_pictures

if TYPE_CHECKING:
    from shipland.record.info import FlightInfo
    from shipland.record.writer import LogWriter


@dataclass(frozen=True)
class Flown:
    """A flight's end: the loop's result and the verdict where there was a touchdown."""

    result: FlightResult
    verdict: TouchdownVerdict | None

    @property
    def reason(self) -> str:
        """The flight's result in words."""
        words = self.result.reason
        if self.verdict is not None:
            return self.verdict.reason
        return f"{words}; where, nothing here knows" if words.startswith("landed") else f"no touchdown: {words}"

    @property
    def success(self) -> bool:
        """Landed, and in the square."""
        return self.verdict is not None and self.verdict.success


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
            scene = build_scene(scenario, seed)
            stack.callback(scene.close)
        vehicle = build_vehicle(scenario, seed, scene)
        autonomy = build_autonomy(scenario, vehicle, pilot, vision, seed)
        flown, autonomy = with_faults(scenario, vehicle, autonomy, seed)
        result = fly(flown, autonomy, scenario.time_limit_s, time.perf_counter, on_cycle)
        return Flown(result, vehicle.verdict())


def flight_info(
    scenario: Scenario, pilot: str | Factory, vision: str | Factory, seed: int, command: str = ""
) -> FlightInfo:
    """The log's header: everything that is needed to fly the flight again."""
    from shipland.record.info import FlightInfo, config_digest, file_digest  # a flight without a log writes nothing
    from shipland.version import code_version

    detector, table = scenario.detector, scenario.table()
    weights = ""
    if needs_pictures(factories.resolve("visions", vision)):
        from shipland.vision.far.detector import weights_path

        weights = file_digest(
            weights_path(detector.ship_weights, detector.precision),
            weights_path(detector.bar_weights, detector.precision),
        )
    return FlightInfo(
        scenario=scenario.name,
        seed=seed,
        pilot=factories.name_of(pilot),
        software_version=code_version().partition("+")[0],
        config_digest=config_digest(table),
        aircraft_diagonal_m=scenario.aircraft.airframe.motor_diagonal_m,
        vision=factories.name_of(vision),
        code_version=code_version(),
        weights_digest=weights,
        command=command,
        configuration=json.dumps(table, sort_keys=True),
    )


def flight_log(
    path: Path, scenario: Scenario, pilot: str | Factory, vision: str | Factory, seed: int, command: str = ""
) -> LogWriter:
    """A log of one flight without pictures."""
    from shipland.record.channels import LogParameters
    from shipland.record.writer import LogWriter

    return LogWriter(
        path,
        flight_info(scenario, pilot, vision, seed, command),
        scenario.rig,
        Camera.from_parameters(scenario.camera),
        LogParameters(image_rate_hz=0.0),
    )
