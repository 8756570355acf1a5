"""Landings flown as the paper shows its own: on a ship under way, and at random instants of two deck motions.

Courses: [Lee2022, §Tracking Capability and Landing Accuracy], straight on, in an S and through a right angle.
Touchdowns: there and in [Lee2022, §Ship Motions and Vertical Landing Safety], fifty on each motion.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import Landing
from shipland.evaluation.tables import markdown
from shipland.evaluation.tally import Tally
from shipland.figures import drawn
from shipland.record.reader import FlightLog, read_log
from shipland.report.landing_plots import deck_trace, draw_touchdowns, plot_instants, plot_touchdowns, touchdowns_of
from shipland.reproduce.flight_figures import Tracks, draw_above, draw_key
from shipland.rig import Rig
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table

PILOT, VISION = "horizon", "geometric"
COURSES = {"straight": "straight", "s": "S, turns of 130°", "turn90": "90° turn"}
SPEEDS_MPS = (0.5, 1.5, 2.5, 3.5, 4.5)
SHOWN_MPS = 2.5
"""Of the ship in the flights whose way is shown."""
FROM = ("start.distance_m=100", "start.height_m=12", "ship.course.start_s=10")
"""Far enough that the ship turns during the approach; from 10 s on."""
PUBLISHED_RUNS = 50
MOTIONS = {"rig-sea6": "frigate, sea state 6", "rig-natops": "NATOPS limits"}


def courses(path: Path, _: Scenario) -> str:
    """Fly a landing on each course at each speed and draw them; the figures as a table."""
    logs: list[FlightLog] = []
    landings: list[Landing] = []
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for course, words in COURSES.items():
            of_course = []
            for seed, speed_mps in enumerate(SPEEDS_MPS, start=1):
                settings = (*FROM, f"ship.course.kind={course}", f"ship.course.speed_mps={speed_mps:g}")
                scenario = load_scenario(scenario_table("under-way", None, settings))
                log = Path(folder) / f"{course}.mcap" if speed_mps == SHOWN_MPS else None
                of_course.append(_landed(f"{words}, {speed_mps:g} m/s", scenario, seed, log))
                if log is not None:
                    logs.append(read_log(log))
            tally, longest_s = Tally.of(of_course), max(landing.time_s for landing in of_course)
            rows.append((words, len(of_course), tally.landed, tally.interval_text(0), f"{longest_s:.0f}"))
            landings += of_course
    plot_courses(path, logs, landings, scenario.rig)
    table = markdown(("course", "flights", "in the square", "95 % interval", "longest [s]"), rows)
    return f"Ship at {SPEEDS_MPS[0]:g} to {SPEEDS_MPS[-1]:g} m/s:\n\n{table}"


def plot_courses(path: Path, logs: Sequence[FlightLog], landings: Sequence[Landing], rig: Rig) -> None:
    """A flight on each course from above, and where all flights first touched the deck."""
    with drawn(path, (12.0, 8.0)) as figure:
        *panels, pad = figure.subplots(2, 2).ravel()
        for axes, log, words in zip(panels, logs, COURSES.values(), strict=False):
            draw_above(axes, log, Tracks(log))
            axes.set_aspect("equal", adjustable="datalim")
            axes.invert_yaxis()
            axes.set_title(f"{words}, ship at {SHOWN_MPS:g} m/s")
            axes.set(xlabel="ahead of the ship at the start [m]", ylabel="to starboard [m]")
        draw_key(panels[0], logs)
        draw_touchdowns(pad, touchdowns_of(landings), rig, f"all courses, {SPEEDS_MPS[0]:g} to {SPEEDS_MPS[-1]:g} m/s")


def touchdowns(path: Path, _: Scenario, *, runs: int) -> str:
    """Fly `runs` landings on each motion and draw them; the figures as a table.

    Leaves NAME-SCENARIO.png, the deck's coordinates at each touchdown, and landing-points-SCENARIO.png beside it.
    """
    rows = []
    for name, words in MOTIONS.items():
        scenario = load_scenario(scenario_table(name, None, ("ship.same_motion=true",)))
        landings = [_landed(f"{words}: flight {seed} of {runs}", scenario, seed) for seed in range(1, runs + 1)]
        met, title = touchdowns_of(landings), f"{words}, pilot {PILOT}"
        trace = deck_trace(scenario, landings)
        plot_instants(path.with_name(f"{path.stem}-{name}.png"), trace, met, title)
        plot_touchdowns(path.with_name(f"landing-points-{name}.png"), met, scenario.rig, title)
        tally = Tally.of(landings)
        touched = sum(landing.touched for landing in landings)
        rows.append((words, runs, tally.landed, tally.interval_text(0), touched))
    return markdown(("motion", "flights", "in the square", "95 % interval", "touched the deck"), rows)


def _landed(words: str, scenario: Scenario, seed: int, log: Path | None = None) -> Landing:
    print(words, file=sys.stderr, flush=True)
    return land_quietly(FlightJob(scenario, PILOT, VISION, seed, log))
