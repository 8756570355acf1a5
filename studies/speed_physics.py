"""Cost of the physics in processor time, one core: far, near, on the deck, and through the vehicle."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from shipland.config import merge
from shipland.messages import Intent, PilotCommand
from shipland.scenario.autonomy import build_vehicle
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.world import STEP_S
from shipland.vehicles.simulated import SimulatedVehicle
from studies.harness import Case, Column, Row, Study

SECONDS = 10.0


def at(distance_m: float, height_m: float) -> SimulatedVehicle:
    """The packaged near scenario under NATOPS motion, from an exact start."""
    exact = {"distance_half_range_m": 0.0, "bearing_half_range_deg": 0.0, "height_half_range_m": 0.0}
    start = exact | {"distance_m": distance_m, "height_m": height_m}
    scenario = load_scenario(merge(scenario_table("near"), {"start": start, "ship": {"motion": "natops"}}))
    return build_vehicle(scenario, 1, None)


def hover_s(distance_m: float, height_m: float) -> float:
    """Processor time of the world alone."""
    world = at(distance_m, height_m).world
    world.advance(0.1)
    started_s = time.process_time()
    world.advance(0.1 + SECONDS)
    return time.process_time() - started_s


def standing_s() -> float:
    """Land, then time what stands there."""
    world = at(0.0, 0.4).world
    while not world.over():
        world.command(PilotCommand(world.t_s, 0.0, 0.0, -50.0, 0.0, 0.0, Intent.LAND))
        world.advance(world.t_s + 0.1)
    started_s, begun_s = time.process_time(), world.t_s
    world.advance(begun_s + SECONDS)
    return time.process_time() - started_s


def vehicle_s() -> float:
    """Read and send at the frame rate, without pictures."""
    vehicle = at(12.0, 1.5)
    vehicle.open()
    started_s = time.process_time()
    while (pair := vehicle.read()) is not None and pair[1].t_s <= SECONDS:
        vehicle.send(PilotCommand(pair[1].t_s + 0.03, 0.0, 0.0, 0.0, 0.0, 0.0))
        vehicle.truth_at(pair[0].t_s)
    return time.process_time() - started_s


WHERE: dict[str, Callable[[], float]] = {
    "hover 200 m astern": lambda: hover_s(200.0, 20.0),
    "hover 4 m astern": lambda: hover_s(4.0, 1.5),
    "hover over the moving deck": lambda: hover_s(0.0, 1.2),
    "standing on the moving deck": standing_s,
    "read and send at 30 Hz, no picture": vehicle_s,
}


def cases() -> Sequence[Case]:
    """Where."""
    return [{"what": name} for name in WHERE]


def measure(case: Case, runs: int) -> Row:
    """Ten simulated seconds, the quickest of `runs` after one that compiles: other work only slows."""
    once = WHERE[str(case["what"])]
    once()
    cpu_s = min(once() for _ in range(runs))
    return {"steps_hz": SECONDS / STEP_S / cpu_s, "real_time": SECONDS / cpu_s}


STUDY = Study(
    question="What does the physics cost?",
    columns={
        "what": Column("what"),
        "steps_hz": Column("physics steps a second", ",.0f"),
        "real_time": Column("times real time", ",.0f"),
    },
    cases=cases,
    measure=measure,
    runs=5,
    minutes=1,
    alone=True,
)
