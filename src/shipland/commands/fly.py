"""`shipland fly`: one simulated flight with everything it leaves behind."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from shipland import factories
from shipland.flight import fly
from shipland.messages import FlightRecord, Mode
from shipland.missions.crew import build_crew, build_vehicle
from shipland.missions.fly import Flown, flight_info
from shipland.missions.scenarios import load_scenario, scenario_table
from shipland.missions.visions import needs_pictures
from shipland.report.chase import chase_view
from shipland.report.outputs import Recorder, load_outputs
from shipland.sim.scene.scene import Scene


@dataclass(frozen=True)
class FlyRequest:
    """What `shipland fly` was asked for."""

    scenario: str
    pilot: str
    vision: str
    seed: int
    out: Path
    config: Path | None
    video: bool
    changes: tuple[str, ...]


def fly_one(request: FlyRequest) -> int:
    """Fly, record and report on the terminal; 0 when landed in the square, 1 when not.

    Raises:
        ShiplandError: a wrong scenario, configuration, output folder or machine.
    """
    scenario = load_scenario(scenario_table(request.scenario, request.config, request.changes))
    info = flight_info(scenario, request.pilot, request.seed)
    pictures = needs_pictures(factories.resolve("visions", request.vision))
    console = Console(stderr=True, highlight=False)
    with ExitStack() as stack:
        scene = None
        if pictures or request.video:
            scene = Scene(scenario.rig, scenario.scene, request.seed)
            stack.callback(scene.close)
        vehicle = build_vehicle(scenario, request.seed, scene if pictures else None)
        crew = build_crew(scenario, vehicle, request.pilot, request.vision, request.seed)
        chase = chase_view(scene, vehicle.camera) if scene is not None and request.video else None
        recorder = stack.enter_context(
            Recorder(request.out, info, scenario.rig, vehicle.camera, load_outputs(), chase, request.video)
        )
        progress = stack.enter_context(ProgressLine(console))

        def on_cycle(record: FlightRecord) -> None:
            recorder.append(record)
            progress.show(record)

        result = fly(vehicle, crew, scenario.time_limit_s, time.perf_counter, on_cycle)
        flown = Flown(result, vehicle.verdict())
        recorder.finish(flown.verdict, result.reason, {stage.value: cost for stage, cost in result.cost_s.items()})
    for problem in recorder.problems:
        console.print(f"warning: {problem}")
    _report(console, request, flown)
    return 0 if flown.succeeded else 1


def _report(console: Console, request: FlyRequest, flown: Flown) -> None:
    console.print(f"{flown.reason} (seed {request.seed}, {flown.result.t_s:.1f} s of flight)")
    verdict = flown.verdict
    if verdict is not None and verdict.touched:
        forward_m, starboard_m = verdict.touchdown_in_deck_m
        sink_mps = verdict.relative_velocity_in_deck_mps[2]
        console.print(
            f"touchdown {forward_m:+.3f} m forward, {starboard_m:+.3f} m starboard of the deck's centre at "
            f"{verdict.t_s:.1f} s, {sink_mps:.2f} m/s down against the deck, slip {verdict.slip_m:.3f} m"
        )
    names = ", ".join(sorted(path.name for path in request.out.iterdir() if path.is_file()))
    console.print(f"{request.out}: {names}")


class ProgressLine:
    """The live line: time, mode, distance, sticks; where there is no terminal, a line a change of mode."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._mode: Mode | None = None
        self._shown_s = -1.0
        self._status = console.status("starting") if console.is_terminal else None

    def __enter__(self) -> ProgressLine:
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()

    def show(self, record: FlightRecord) -> None:
        """Show one cycle."""
        decision, t_s = record.decision, record.telemetry.t_s
        mode = "-" if decision.mode is None else decision.mode.name
        if decision.mode is not self._mode:
            self._mode = decision.mode
            self._console.print(f"{t_s:6.1f} s  {mode:<10} {decision.reason}")
        if self._status is None or t_s - self._shown_s < 0.1:
            return
        self._shown_s = t_s
        estimate = decision.estimate
        distance = "      – m" if estimate is None else f"{np.linalg.norm(estimate.aircraft_in_bar_m):7.2f} m"
        command = decision.command
        self._status.update(
            f"{t_s:6.1f} s  {mode:<10} {distance} to the bar  pitch {command.pitch_percent:+4.0f} "
            f"roll {command.roll_percent:+4.0f} heave {command.heave_percent:+4.0f} yaw {command.yaw_percent:+4.0f} %"
        )
