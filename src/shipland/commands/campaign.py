"""`shipland campaign`: many landings with a progress bar, tables and pictures; sweeps of them side by side."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.options import ScenarioOptions, checked_seed, command_line
from shipland.errors import ConfigError

if TYPE_CHECKING:
    from shipland.evaluation.campaign import CampaignPlan
    from shipland.evaluation.landing import Landing
    from shipland.evaluation.sweep import Cell


@dataclass(frozen=True)
class Campaign(ScenarioOptions):
    """Fly many seeds of one scenario and sum them up; what was flown before is kept and not flown again.

    Leaves landings.csv, campaign.json, table.md and landings.png in the output folder. Several values
    (`--set wind.mean_mps=0,3,6`) or several pilots (`--pilot paper,horizon`) make one campaign each, in a folder
    of its own, and sweep.md and sweep.png with all side by side. Exit code: 0 all landed in the square, 1 not, 2 bad
    input, 130 stopped by Ctrl-C; the same command goes on.

    Example: shipland campaign --scenario near --count 20 --out out/near20

    Example: shipland campaign --scenario near --set wind.mean_mps=0,3,6 --pilot paper,horizon --out out/wind
    """

    pilot: str = "horizon"
    """Who flies, as in `shipland fly`; several with commas between."""
    vision: str = "geometric"
    """As in `shipland fly`."""
    first_seed: int = 1
    """First seed."""
    count: int = 20
    """Number of landings."""
    out: Path = Path("out/campaign")
    """Output folder; made when missing."""
    workers: int = 2
    """Processes."""
    logs: bool = False
    """Keep each flight's log, without pictures, as flights/SEED.mcap: `shipland paper --flights` draws from them."""

    def run(self) -> int:
        """Fly; 0 when all landed in the square, 1 when not."""
        from shipland.evaluation.sweep import cells
        from shipland.rig import area_of

        for name, value in (("count", self.count), ("workers", self.workers)):
            if value < 1:
                raise ConfigError(f"--{name} must be at least 1, got {value}")
        combined = cells(self.changes, self.pilot.split(","))
        plans = [self._plan(cell, self.out if len(combined) == 1 else self.out / cell.name) for cell in combined]
        done = [(cell, _fly(plan)) for cell, plan in zip(combined, plans, strict=True)]
        if len(done) > 1:
            _write_sweep(self, done, area_of(plan.scenario.rig for plan in plans))
        return 0 if all(it.good for _, landings in done for it in landings) else 1

    def _plan(self, cell: Cell, out: Path) -> CampaignPlan:
        """Checked before anything flies."""
        from shipland import factories
        from shipland.evaluation.campaign import CampaignPlan

        scenario = replace(self, changes=cell.changes).load()
        factories.resolve("pilots", cell.pilot)
        factories.resolve("visions", self.vision)
        seeds = range(checked_seed(self.first_seed), self.first_seed + self.count)
        return CampaignPlan(scenario, cell.pilot, self.vision, seeds, out, self.workers, self.logs, command_line())


_PROGRESS_S = 10.0
"""Between two lines of progress where there is no terminal."""

_ROWS_SHOWN = 20
"""Landings that are shown one by one; of more, the sums alone: table.md has every row."""


def _fly(plan: CampaignPlan) -> list[Landing]:
    from contextlib import closing

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    from shipland.evaluation.campaign import run_campaign
    from shipland.evaluation.rules import rules_table
    from shipland.evaluation.tables import landings_table, summary_of
    from shipland.report.campaign import write_campaign

    console = Console(stderr=True, highlight=False, soft_wrap=True)
    landings: list[Landing] = []
    area = plan.scenario.rig.landing_area
    columns = ("[progress.description]{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    said_s = time.monotonic()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("landings", total=len(plan.seeds))
        with closing(run_campaign(plan)) as flown:
            for landing in flown:
                if not landings:
                    console.print(f"{plan.out}: pilot {plan.pilot}, {len(plan.seeds)} landings")
                landings.append(landing)
                good = sum(each.good for each in landings)
                progress.update(task, advance=1, description=f"{good} of {len(landings)} in the {area}")
                if not console.is_terminal and time.monotonic() - said_s > _PROGRESS_S:
                    said_s = time.monotonic()
                    console.print(f"{len(landings)} of {len(plan.seeds)} flown, {good} in the {area}")
    write_campaign(plan, landings)
    rows = landings_table(landings, area) if len(landings) <= _ROWS_SHOWN else summary_of(landings, area)
    print(f"{rows}\n\n{rules_table(landings, plan.scenario.rig)}")
    console.print(f"{plan.out}: landings.csv, campaign.json, table.md, landings.png")
    return landings


def _write_sweep(command: Campaign, done: list[tuple[Cell, list[Landing]]], area: str) -> None:
    from shipland.evaluation.sweep import sweep_table
    from shipland.report.outputs import load_outputs
    from shipland.report.sweep_plots import plot_sweep

    text = sweep_table(done, area)
    (command.out / "sweep.md").write_text(f"{text}\n", encoding="utf-8")
    title = f"{command.scenario}, vision {command.vision}, {command.count} landings each"
    plot_sweep(command.out / "sweep.png", done, title, area, load_outputs().plots)
    print(f"\n{text}")
    print(f"{command.out}: sweep.md, sweep.png, and a folder for each of {len(done)} campaigns", file=sys.stderr)
