"""Cost of a cycle of the near flight, split into physics, picture, vision and control; and the real-time factor.

Medians over the cycles of a flight; the process has what cores are free, so read the shares rather than the times.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from shipland.scenario.autonomy import build_autonomy, build_scene, build_vehicle
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table

SECONDS = 12.0


class Timed:
    """Stands before an object and keeps the duration of each call of one method [s]."""

    def __init__(self, inner: object, name: str) -> None:
        self._inner, self._method = inner, getattr(inner, name)
        self.durations_s: list[float] = []
        setattr(self, name, self._call)

    def _call(self, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401 - passes on whatever comes
        started_s = time.perf_counter()
        result = self._method(*arguments, **named)
        self.durations_s.append(time.perf_counter() - started_s)
        return result

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._inner, name)


def measure(camera: str, pilot: str, seed: int) -> str:
    """A row of the table."""
    scenario = load_scenario(scenario_table("near"))
    scene = build_scene(scenario, seed) if camera == "rendered" else None
    picture = Timed(scene, "render") if scene is not None else None
    vehicle = build_vehicle(scenario, seed, picture)  # type: ignore[arg-type]
    autonomy = build_autonomy(scenario, vehicle, pilot, camera, seed)  # type: ignore[arg-type]
    reading, eyes, control = Timed(vehicle, "read"), Timed(autonomy.vision, "see"), Timed(autonomy.pilot, "decide")
    vehicle.open()
    started_s = time.perf_counter()
    now_s, sent = 0.0, None
    while now_s < SECONDS and (pair := reading.read()) is not None:
        frame, telemetry = pair
        observation = eyes.see(frame)
        now_s = telemetry.t_s
        telemetry = vehicle.telemetry_at(now_s + autonomy.delays.near_s)
        decision = autonomy.safety.check(control.decide(observation, telemetry, sent), observation, telemetry)
        sent = decision.command
        vehicle.send(sent)
    wall_s = time.perf_counter() - started_s
    vehicle.close()
    if scene is not None:
        scene.close()
    ms: Callable[[list[float]], float] = lambda durations_s: 1e3 * float(np.median(durations_s))  # noqa: E731
    picture_ms = ms(picture.durations_s) if picture is not None else 0.0
    physics_ms = ms(reading.durations_s) - picture_ms
    cells = (physics_ms, picture_ms, ms(eyes.durations_s), ms(control.durations_s))
    numbers = " | ".join(f"{value:.2f}" for value in cells)
    return f"| {camera} | {pilot} | {numbers} | {now_s / wall_s:.2f} |"


def main() -> None:
    """Print the table."""
    print("| camera | pilot | physics [ms] | picture [ms] | vision [ms] | control [ms] | × real time |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for camera in ("rendered", "geometric"):
        for pilot in ("paper", "horizon"):
            print(measure(camera, pilot, 1), flush=True)
    scenario = load_scenario(scenario_table("near"))
    started_s = time.perf_counter()
    flights = [fly_quietly(scenario, "horizon", "geometric", seed) for seed in range(1, 6)]
    wall_s = time.perf_counter() - started_s
    flown_s = sum(flown.result.t_s for flown in flights)
    print(
        f"\n{len(flights)} geometric landings: {wall_s / len(flights):.2f} s each, {flown_s / wall_s:.0f} × real time"
    )


if __name__ == "__main__":
    main()
