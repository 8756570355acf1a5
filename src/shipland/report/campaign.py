"""Tables and pictures of a campaign, beside its rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipland.evaluation.landing import Landing
from shipland.evaluation.leaderboard import rules_table
from shipland.evaluation.suite import Cell
from shipland.evaluation.tables import causes_table, landings_table, modes_table
from shipland.extras import installed
from shipland.factories import name_of
from shipland.files import writing
from shipland.report.landing_plots import DeckTrace, plot_instants, plot_touchdowns, touchdowns_of
from shipland.report.outputs import OutputParameters
from shipland.scenario.scenario import Scenario
from shipland.sim.ship.ship import build_ship


def write_campaign(folder: Path, cell: Cell, landings: Sequence[Landing]) -> None:
    """Write `table.md` and, with the extra `plots`, `landings.png` and, of one motion for all, `instants.png`.

    Raises:
        DataError: one of them cannot be written.
    """
    scenario = cell.scenario
    tables = [
        landings_table(landings, scenario.rig.landing_area),
        causes_table(landings),
        modes_table(landings),
        rules_table(landings, scenario.rig),
    ]
    with writing(folder / "table.md"):
        (folder / "table.md").write_text("\n\n".join(filter(None, tables)) + "\n", encoding="utf-8")
    if not installed("plots"):
        return
    touchdowns = touchdowns_of(landings)
    title = f"{scenario.name}, pilot {name_of(cell.pilot)}, vision {name_of(cell.vision)}"
    parameters = OutputParameters().plots
    plot_touchdowns(folder / "landings.png", touchdowns, scenario.rig, title, parameters)
    if scenario.ship.same_motion:
        plot_instants(folder / "instants.png", deck_trace(scenario, landings), touchdowns, title, parameters)


def deck_trace(scenario: Scenario, landings: Sequence[Landing]) -> DeckTrace:
    """The one motion that every flight meets with `ship.same_motion`, to five seconds after the last landing."""
    parameters = replace(scenario.ship, instant_range_s=0.0)
    ship = build_ship(parameters, scenario.rig, np.random.default_rng(0))
    t_s = np.arange(0.0, max(landing.instant_s for landing in landings) + 5.0, 0.05)
    motion = np.array([ship.at(float(t)).deck.displacement for t in t_s])
    return DeckTrace(t_s, motion)
