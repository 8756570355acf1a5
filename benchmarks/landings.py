"""Processor time of landings with the geometric camera: a landing, a simulated second, and the parts of a cycle.

Ten flights of each scenario and pilot after one that compiles; one process. Run it with one thread for every library
(`OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from typing import Any

from shipland.flight import Autonomy, cycles
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.scenario import Scenario, load_scenario

SCENARIOS, PILOTS, FLIGHTS = ("rig-natops", "ship-sea6"), ("horizon", "paper"), 10


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


def row(name: str, pilot: str) -> str:
    """A row of the table."""
    scenario = load_scenario(name)
    flown(scenario, pilot, 99)
    flights = [flown(scenario, pilot, seed) for seed in range(1, FLIGHTS + 1)]
    total_s, simulated_s, count, *parts_s = (sum(values) for values in zip(*flights, strict=True))
    ms: Callable[[float], str] = lambda seconds: f"{1e3 * seconds / count:.2f}"  # noqa: E731
    rest_s = total_s - sum(parts_s)
    shares = " | ".join(ms(seconds) for seconds in (*parts_s, rest_s))
    a_landing = f"{total_s / FLIGHTS:.2f} | {simulated_s / FLIGHTS:.1f} | {simulated_s / total_s:.0f}"
    return f"| {name} | {pilot} | {a_landing} | {count / FLIGHTS:.0f} | {shares} |"


def main() -> None:
    """Print the table."""
    print("| scenario | pilot | CPU [s] | simulated [s] | × real time | cycles | vision | pilot | safety | rest [ms] |")
    print("|---|---|---:|---:|---:|---:|---:|---:|---:|---:|")
    for name in SCENARIOS:
        for pilot in PILOTS:
            print(row(name, pilot), flush=True)


if __name__ == "__main__":
    main()
