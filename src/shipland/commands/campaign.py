"""`shipland campaign`: many landings with a progress bar, tables and pictures."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from shipland import factories
from shipland.errors import DataError
from shipland.missions.campaign import CampaignRequest, run_campaign
from shipland.missions.landing import Landing
from shipland.missions.rules import rules_table
from shipland.missions.scenarios import Scenario, load_scenario, scenario_table
from shipland.missions.tables import causes_table, landings_table, modes_table
from shipland.report.landing_plots import DeckTrace, Touchdowns, plot_instants, plot_touchdowns
from shipland.report.outputs import load_outputs
from shipland.sim.ship.ship import build_ship


def campaign(request: CampaignRequest) -> int:
    """Fly, show progress, write `table.md` and `landings.png`; 0 when all landed in the square, 1 when not."""
    scenario = load_scenario(scenario_table(request.scenario, request.config, request.changes))
    factories.resolve("pilots", request.pilot)
    factories.resolve("visions", request.vision)
    console = Console(stderr=True, highlight=False)
    landings: list[Landing] = []
    columns = ("[progress.description]{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("landings", total=request.count)
        with closing(run_campaign(request)) as flown:
            for landing in flown:
                landings.append(landing)
                good = sum(each.good for each in landings)
                progress.update(task, advance=1, description=f"{good} of {len(landings)} in the square")
    _write_pictures(request, scenario, landings)
    print(f"{landings_table(landings)}\n\n{rules_table(landings, scenario.rig)}")
    console.print(f"{request.out}: landings.csv, campaign.json, table.md, landings.png")
    return 0 if all(landing.good for landing in landings) else 1


def _write_pictures(request: CampaignRequest, scenario: Scenario, landings: list[Landing]) -> None:
    tables = [
        landings_table(landings),
        causes_table(landings),
        modes_table(landings),
        rules_table(landings, scenario.rig),
    ]
    try:
        (request.out / "table.md").write_text("\n\n".join(filter(None, tables)) + "\n", encoding="utf-8")
    except OSError as error:
        raise DataError(f"{request.out / 'table.md'} cannot be written: {error.strerror}") from None
    touchdowns = Touchdowns(
        t_s=np.array([landing.time_s if landing.touched else np.nan for landing in landings]),
        place_in_deck_m=np.array([[landing.forward_m, landing.starboard_m] for landing in landings]),
        landed=np.array([landing.good for landing in landings]),
    )
    title = f"{request.scenario}, pilot {request.pilot}, vision {request.vision}"
    parameters = load_outputs().plots
    plot_touchdowns(request.out / "landings.png", touchdowns, scenario.rig, title, parameters)
    if scenario.ship.same_motion:
        instants = replace(
            touchdowns, t_s=np.array([landing.instant_s if landing.touched else np.nan for landing in landings])
        )
        trace = _trace(scenario, max(landing.instant_s for landing in landings) + 5.0)
        plot_instants(request.out / "instants.png", trace, instants, title, parameters)


def _trace(scenario: Scenario, length_s: float) -> DeckTrace:
    """The one motion that every flight met."""
    parameters = replace(scenario.ship, instant_spread_s=0.0)
    ship = build_ship(parameters, scenario.rig, np.random.default_rng(0))
    t_s = np.arange(0.0, length_s, 0.05)
    motion = np.array([ship.at(float(t)).deck.displacement for t in t_s])
    return DeckTrace(t_s, motion[:, 3], motion[:, 4], -motion[:, 2])
