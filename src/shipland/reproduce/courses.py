"""Landings on a ship that sails straight on, in an S and through a right angle, as the paper shows its own.

[Lee2022, §Tracking Capability and Landing Accuracy]
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import Landing
from shipland.evaluation.tally import Tally
from shipland.figures import drawn
from shipland.record.reader import FlightLog, read_log
from shipland.report.landing_plots import draw_touchdowns, touchdowns_of
from shipland.reproduce.flight_figures import draw_above, draw_key, tracks_of
from shipland.rig import Rig
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table

COURSES = {"straight": "straight", "s": "S, turns of 130°", "turn90": "90° turn"}
SPEEDS_MPS = (0.5, 1.5, 2.5, 3.5, 4.5)
SHOWN_MPS = 2.5
"""Of the ship in the flights whose way is shown."""
SCENARIO, PILOT, VISION = "under-way", "horizon", "geometric"
FROM = ("start.distance_m=100", "start.height_m=12", "ship.course.start_s=10")
"""Far enough that the ship turns during the approach; from 10 s on."""
_DPI = 80


def courses(path: Path, _: Scenario) -> str:
    """Fly a landing on each course at each speed and draw them; the figures as a table."""
    logs: list[FlightLog] = []
    landings: list[Landing] = []
    rows = [
        f"Ship at {SPEEDS_MPS[0]:g} to {SPEEDS_MPS[-1]:g} m/s:\n",
        "| course | flights | in the square | 95 % interval | longest [s] |",
        "|---|---:|---:|---:|---:|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for course, words in COURSES.items():
            of_course = []
            for seed, speed_mps in enumerate(SPEEDS_MPS, start=1):
                print(f"{words}, {speed_mps:g} m/s", file=sys.stderr, flush=True)
                settings = (*FROM, f"ship.course.kind={course}", f"ship.course.speed_mps={speed_mps:g}")
                scenario = load_scenario(scenario_table(SCENARIO, None, settings))
                log = Path(folder) / f"{course}.mcap" if speed_mps == SHOWN_MPS else None
                of_course.append(land_quietly(FlightJob(scenario, PILOT, VISION, seed, log)))
                if log is not None:
                    logs.append(read_log(log))
            tally, longest_s = Tally.of(of_course), max(landing.time_s for landing in of_course)
            rows.append(f"| {words} | {len(of_course)} | {tally.landed} | {tally.interval_text(0)} | {longest_s:.0f} |")
            landings += of_course
    plot_courses(path, logs, landings, scenario.rig)
    return "\n".join(rows)


def plot_courses(path: Path, logs: Sequence[FlightLog], landings: Sequence[Landing], rig: Rig) -> None:
    """A flight on each course from above, and where all flights first touched the deck."""
    with drawn(path, (12.0, 8.0), _DPI) as figure:
        *panels, pad = figure.subplots(2, 2).ravel()
        for axes, log, words in zip(panels, logs, COURSES.values(), strict=False):
            draw_above(axes, log, tracks_of(log))
            axes.set_aspect("equal", adjustable="datalim")
            axes.invert_yaxis()
            axes.set_title(f"{words}, ship at {SHOWN_MPS:g} m/s")
            axes.set(xlabel="ahead of the ship at the start [m]", ylabel="to starboard [m]")
        draw_key(panels[0], logs)
        draw_touchdowns(pad, touchdowns_of(landings), rig, f"all courses, {SPEEDS_MPS[0]:g} to {SPEEDS_MPS[-1]:g} m/s")
