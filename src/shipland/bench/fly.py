"""One simulated flight, with or without what it leaves behind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from shipland.bench.scenarios import CameraKind, PilotKind, Scenario, build_crew, build_vehicle
from shipland.flight import FlightResult, fly
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.sim.scene import Scene


@dataclass(frozen=True)
class Flown:
    """A flight's end: the loop's result, the verdict where there was a touchdown, and both in words."""

    result: FlightResult
    verdict: TouchdownVerdict | None

    @property
    def reason(self) -> str:
        """What became of the flight."""
        return self.verdict.reason if self.verdict is not None else f"no touchdown: {self.result.reason}"

    @property
    def succeeded(self) -> bool:
        """Landed on its feet, in the square."""
        return self.verdict is not None and self.verdict.landed and self.verdict.in_square


def fly_quietly(
    scenario: Scenario,
    pilot: PilotKind,  # noqa: ARG001 - one pilot so far
    camera: CameraKind,  # noqa: ARG001 - one camera so far
    seed: int,
    clock: Callable[[], float],
    on_cycle: Callable[[FlightRecord], None] = lambda _: None,
) -> Flown:
    """Fly one seed and keep nothing but the verdict; `clock` counts the cost of the stages [s]."""
    scene = Scene(scenario.rig, scenario.scene, seed)
    try:
        vehicle = build_vehicle(scenario, seed, scene)
        crew = build_crew(scenario, vehicle.camera)
        result = fly(vehicle, crew, scenario.time_limit_s, clock, on_cycle)
        return Flown(result, vehicle.verdict())
    finally:
        scene.close()
