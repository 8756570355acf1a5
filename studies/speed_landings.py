"""Processor time of landings with the geometric camera: a landing, a simulated second, and the parts of a cycle.

Flights of each scenario and pilot after one that compiles; one process.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import closing
from itertools import product
from typing import Any

from shipland.flight import Autonomy, cycles
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.scenario import Scenario, load_scenario
from studies.harness import Case, Column, Row, Study

SCENARIOS, PILOTS = ("rig-natops", "ship-sea6"), ("horizon", "paper")
COMPILES = 99
"""Seed of the flight that is not counted."""


class Timed:
    """Stands before an object and sums the processor time of one of its methods [s]."""

    def __init__(self, inner: object, name: str) -> None:
        self._inner, self._method, self.spent_s = inner, getattr(inner, name), 0.0
        setattr(self, name, self._call)

    def _call(self, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401 - passes on whatever comes
        started_s = time.process_time()
        result = self._method(*arguments, **named)
        self.spent_s += time.process_time() - started_s
        return result

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._inner, name)


def flown(scenario: Scenario, pilot: str, seed: int) -> tuple[float, ...]:
    """One flight: processor time, simulated time, cycles; processor time of vision, pilot and safety."""
    started_s = time.process_time()
    vehicle = build_vehicle(scenario, seed, None)
    autonomy = build_autonomy(scenario, vehicle, pilot, "geometric", seed)
    parts = Timed(autonomy.vision, "see"), Timed(autonomy.pilot, "decide"), Timed(autonomy.safety, "check")
    count, now_s = 0, 0.0
    timed = Autonomy(*parts, autonomy.delays)  # type: ignore[arg-type]
    with closing(cycles(vehicle, timed, time.perf_counter)) as flight:
        for cycle in flight:
            count, now_s = count + 1, cycle.telemetry.t_s
            if now_s >= scenario.time_limit_s:
                break
    return time.process_time() - started_s, now_s, count, *(part.spent_s for part in parts)


def cases() -> Sequence[Case]:
    """Scenarios and pilots."""
    return [{"scenario": scenario, "pilot": pilot} for scenario, pilot in product(SCENARIOS, PILOTS)]


def measure(case: Case, runs: int) -> Row:
    """`runs` flights."""
    scenario, pilot = load_scenario(str(case["scenario"])), str(case["pilot"])
    flown(scenario, pilot, COMPILES)
    flights = [flown(scenario, pilot, seed) for seed in range(1, runs + 1)]
    total_s, simulated_s, count, *parts_s = (sum(values) for values in zip(*flights, strict=True))
    names = ("vision_s", "pilot_s", "safety_s", "rest_s")
    return {
        "cpu_s": total_s / runs,
        "simulated_s": simulated_s / runs,
        "real_time": simulated_s / total_s,
        "cycles": count / runs,
        **{name: spent / count for name, spent in zip(names, [*parts_s, total_s - sum(parts_s)], strict=True)},
    }


STUDY = Study(
    question="What does a landing cost?",
    columns={
        "scenario": Column("scenario"),
        "pilot": Column("pilot"),
        "cpu_s": Column("CPU [s]", ".2f"),
        "simulated_s": Column("simulated [s]", ".1f"),
        "real_time": Column("× real time", ".0f"),
        "cycles": Column("cycles", ".0f"),
        "vision_s": Column("vision", ".2f", 1e3),
        "pilot_s": Column("pilot", ".2f", 1e3),
        "safety_s": Column("safety", ".2f", 1e3),
        "rest_s": Column("rest [ms]", ".2f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=10,
    minutes=1,
    alone=True,
)
