"""`shipland campaign`: many landings of one scenario, of every combination of values and pilots, or of a suite."""

from __future__ import annotations

import shlex
import sys
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shipland.commands.options import Changes, checked_seed, command_line, names_of
from shipland.errors import ConfigError

if TYPE_CHECKING:
    from shipland.evaluation.campaign import CampaignPlan, OpenCampaign

_SAY_EVERY_S = 15.0


@dataclass(frozen=True)
class Campaign:
    """Fly the cells of a suite, or every combination of the scenarios and values given here.

    A cell is one scenario with one value of every setting and one pilot; all cells share the workers and fly the same
    seeds. Leaves cells.json, tables.md, flights.csv, and in a folder a cell landings.csv, table.md, landings.png and
    the logs of flights that did not land in the square. Ctrl-C, SIGTERM and --time-limit-s stop in order; run
    the command again to resume. Results of other code, configuration or weights are refused. Exit code: 0 everything
    is flown, however it landed, 1 not, 2 bad input, 130 stopped by a person.

    Example: shipland campaign --scenario near --runs 20 --out out/near20

    Example: shipland campaign near --pilot paper,horizon --runs 100 --out out/near

    Example: shipland campaign --scenario rig-natops,ship-sea6 --set wind.mean_mps=0,5,9
        --set aircraft.loop.kind=attitude,velocity --runs 200 --time-limit-s 540 --out out/tables
    """

    suite: Annotated[str, tyro.conf.Positional] = ""
    """Name of a suite (see `shipland suites`), or the path of its TOML file; none with --scenario."""
    out: Path = Path("out/campaign")
    """Output folder; made when missing."""
    scenario: str = ""
    """As in `shipland fly`, instead of a suite; several with commas between."""
    pilot: str = "horizon"
    """Who flies, as in `shipland fly`; several with commas between."""
    vision: str = "geometric"
    """Who sees, as in `shipland fly`; a suite says it itself."""
    changes: Annotated[Changes, tyro.conf.arg(name="set", metavar="KEY=A,B,…")] = ()
    """Values of a key, laid over every cell, as `--set wind.mean_mps=0,5,9`; may be given again."""
    config: Path | None = None
    """TOML file laid over every scenario."""
    only: tuple[str, ...] = ()
    """Shell patterns of cells to fly, as `--only 'rig-*mean_mps=5*'`."""
    runs: int = 20
    """Flights a cell."""
    first_seed: int = 1
    """Seed of the first."""
    workers: int = 2
    """Processes; without meaning with --cluster."""
    cluster: str = ""
    """Fly on a Ray cluster: its address, or `auto` (extra `cluster`)."""
    time_limit_s: float = 0.0
    """Stop in order after so long; 0: no limit."""
    oracle_motions: int = 60
    """Motions drawn for each oracle rate; 0: none are drawn."""
    logs: bool = False
    """Keep the log of every flight, without pictures, in CELL/flights: `shipland paper --flights` draws from them."""
    print_only: bool = False
    """Fly nothing; print the tables of what there is."""

    def run(self) -> int:
        """Fly and print; 0 when everything asked for is flown, 1 when not."""
        from shipland.evaluation.campaign import open_campaign, read_cells, write_rows
        from shipland.evaluation.leaderboard import leaderboard, oracle_rates_of, pairs, rivals
        from shipland.report.campaign import write_campaign

        plan = self._plan()
        stopped = False
        with open_campaign(plan) as campaign:
            left = sum(1 for _ in campaign.missing())
            if left and not self.print_only:
                done, stopped = self._fly(campaign, left)
                left -= done
        names = [cell.name for cell in plan.cells]
        everything = read_cells([plan.out])
        write_rows(plan.out / "flights.csv", everything)
        asked = {cell.name: cell for cell in everything if cell.name in names}
        cells = [asked[name] for name in names]
        for planned, flown in zip(plan.cells, cells, strict=True):
            if flown.landings:
                write_campaign(plan.out / flown.name, planned, flown.landings)
        oracle_rates = {}
        if self.oracle_motions:
            oracle_rates = oracle_rates_of(cells, self.oracle_motions, plan.out / "oracle_rates.json")
        parts = ["\n".join(leaderboard(cells, oracle_rates)), "\n".join(rivals(cells))]
        if len({cell.pilot for cell in cells}) > 1:
            parts.append("\n".join(pairs(cells)))
        text = "\n\n".join(parts)
        print(text)
        (plan.out / "tables.md").write_text(text + "\n", encoding="utf-8")
        print(
            f"{plan.out}: tables.md, flights.csv, and for each cell a folder with landings.csv, table.md, landings.png "
            f"and logs; one page of all: shipland report {shlex.quote(str(plan.out))}",
            file=sys.stderr,
        )
        return 130 if stopped else int(left > 0)

    def _plan(self) -> CampaignPlan:
        from shipland.evaluation.campaign import CampaignPlan
        from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of, load_suite

        for name, value in (("runs", self.runs), ("workers", self.workers)):
            if value < 1:
                raise ConfigError(f"--{name} must be at least 1, got {value}")
        if self.suite and self.scenario:
            raise ConfigError("give either a suite (`shipland suites` names them) or --scenario")
        pilots = names_of("pilot", self.pilot)
        if self.oracle_motions == 1 or self.oracle_motions < 0:
            raise ConfigError(f"--oracle-motions must be 0, or 2 and more, got {self.oracle_motions}")
        words = ""
        entries: tuple[SuiteEntry, ...] = (SuiteEntry(names_of("scenario", self.scenario or "near"), (), self.vision),)
        if self.suite:
            suite = load_suite(self.suite)
            words, entries = f"{suite.name} {suite.version}", suite.cells
        cells = cells_of(entries, Overrides(pilots, self.changes, self.config, self.only))
        seeds = range(checked_seed(self.first_seed), self.first_seed + self.runs)
        return CampaignPlan(cells, seeds, self.out, words, command_line(), self.logs)

    def _fly(self, campaign: OpenCampaign, left: int) -> tuple[int, bool]:
        """Fly with a progress line; how many were flown, and whether a person stopped it."""
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        from shipland.evaluation.campaign import processes
        from shipland.evaluation.statistics import share_interval
        from shipland.rig import area_of

        if self.cluster:
            from shipland.evaluation.cluster import cluster

            executor = cluster(self.cluster)
        else:
            executor = processes(min(self.workers, left))
        flown, good, stopped = 0, 0, False
        begun_s = said_s = time.monotonic()
        console = Console(stderr=True, highlight=False)
        cells, area = len(campaign.plan.cells), area_of(cell.scenario.rig for cell in campaign.plan.cells)
        console.print(f"{cells} cell{'s' * (cells > 1)}, {left} of {cells * self.runs} flights to fly")
        columns = ("[progress.description]{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        try:
            with (
                Progress(*columns, console=console, disable=not console.is_terminal) as progress,
                closing(campaign.fly(executor)) as flights,
            ):
                task = progress.add_task("flights", total=left)
                for _, landing in flights:
                    flown, good, now_s = flown + 1, good + landing.success, time.monotonic()
                    low, high = share_interval(good, flown)
                    words = f"{good} of {flown} landed in the {area} ({100.0 * low:.0f}–{100.0 * high:.0f} %)"
                    progress.update(task, advance=1, description=words)
                    if not console.is_terminal and now_s - said_s > _SAY_EVERY_S:
                        said_s = now_s
                        minutes = (left - flown) * (now_s - begun_s) / flown / 60.0
                        print(f"{words}, {left - flown} to fly, {minutes:.1f} min to go", file=sys.stderr, flush=True)
                    if self.time_limit_s and now_s - begun_s > self.time_limit_s:
                        break
        except KeyboardInterrupt:
            stopped = True
            console.print("stopped")
        spent_s = time.monotonic() - begun_s
        console.print(
            f"{flown} of {left} flown in {spent_s:.0f} s ({60.0 * flown / spent_s:.0f} a minute)"
            + ("" if flown == left else "; run the command again to resume")
        )
        for cell, seed, reason in campaign.lost[:10]:
            console.print(f"lost: {cell}, seed {seed}: {reason}")
        if len(campaign.lost) > 10:
            console.print(f"lost: {len(campaign.lost) - 10} more")
        return flown, stopped
