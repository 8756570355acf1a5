"""Landings at random instants of the paper's two deck motions, with where they touched the deck.

[Lee2022, §Ship Motions and Vertical Landing Safety] and [Lee2022, §Tracking Capability and Landing Accuracy] show fifty
on each.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.tally import Tally
from shipland.report.campaign import deck_trace
from shipland.report.landing_plots import plot_instants, plot_touchdowns, touchdowns_of
from shipland.report.outputs import OutputParameters
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table

PUBLISHED_RUNS = 50
MOTIONS = {"rig-sea6": "frigate, sea state 6", "rig-natops": "NATOPS limits"}
PILOT, VISION = "horizon", "geometric"


def touchdowns(path: Path, _: Scenario, *, runs: int) -> str:
    """Fly `runs` landings on each motion and draw them; the figures as a table.

    Leaves NAME-SCENARIO.png, the deck's coordinates at each touchdown, and landing-points-SCENARIO.png beside it.
    """
    rows = ["| motion | flights | in the square | 95 % interval | touched the deck |", "|---|---:|---:|---:|---:|"]
    for name, words in MOTIONS.items():
        scenario = load_scenario(scenario_table(name, None, ("ship.same_motion=true",)))
        landings = []
        for seed in range(1, runs + 1):
            print(f"{words}: flight {seed} of {runs}", file=sys.stderr, flush=True)
            landings.append(land_quietly(FlightJob(scenario, PILOT, VISION, seed)))
        instants_s = np.array([landing.instant_s if landing.touched else np.nan for landing in landings])
        met = replace(touchdowns_of(landings), t_s=instants_s)
        trace = deck_trace(scenario, max(landing.instant_s for landing in landings) + 5.0)
        title, parameters = f"{words}, pilot {PILOT}", OutputParameters().plots
        plot_instants(path.with_name(f"{path.stem}-{name}.png"), trace, met, title, parameters)
        plot_touchdowns(path.with_name(f"landing-points-{name}.png"), met, scenario.rig, title, parameters)
        tally = Tally.of(landings)
        touched = sum(landing.touched for landing in landings)
        rows.append(f"| {words} | {runs} | {tally.landed} | {tally.interval_text(0)} | {touched} |")
    return "\n".join(rows)
