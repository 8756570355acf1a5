"""Many landings: `shipland.campaign` and `shipland campaign` are this one function."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from shipland import factories
from shipland.api import checked_seed, whole_number
from shipland.compiled import say_that_it_compiles
from shipland.errors import ConfigError, DataError
from shipland.evaluation.campaign import (
    CampaignPlan,
    CellResult,
    LostFlight,
    OpenCampaign,
    open_campaign,
    processes,
    read_cells,
    rows_of,
    write_rows,
)
from shipland.evaluation.cluster import cluster as on_cluster
from shipland.evaluation.landing import Landing, column_of
from shipland.evaluation.leaderboard import (
    Pairings,
    campaign_pairings,
    leaderboard,
    oracle_rates_of,
    pairings_table,
    pilot_pairings,
    rivals,
)
from shipland.evaluation.suite import Overrides, Suite, SuiteEntry, cells_of, load_suite, sealed_seeds
from shipland.evaluation.tables import summary_of
from shipland.evaluation.tally import Tally
from shipland.extras import require
from shipland.factories import Factory
from shipland.files import write_atomically, writing
from shipland.progress import followed
from shipland.rig import area_of
from shipland.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Campaign", "CampaignProgress", "Comparison", "campaign", "load_suite"]

_MOST_LOST = 10
"""Lost flights that are named."""


@dataclass(frozen=True)
class CampaignProgress:
    """How far a campaign is; comes before the first flight and after each.

    Attributes:
        cells: lines of its table.
        flights: all of them, with those flown earlier.
        to_fly: flights that were missing at the start.
        flown: of these.
        success: of those flown, landed in the landing area.
        lost: flights without a landing, and why.
        area: what the landing area is called.
    """

    cells: int
    flights: int
    to_fly: int
    flown: int
    success: int
    lost: Sequence[LostFlight]
    area: str


@dataclass(frozen=True, repr=False)
class Comparison:
    """Paired tests, seed by seed; prints as a table in Markdown.

    Attributes:
        pairings: `Pairing` by what was compared: (scenario and settings, pilots) or (cell,).
    """

    pairings: Pairings

    def __repr__(self) -> str:
        return pairings_table(self.pairings)

    def _repr_markdown_(self) -> str:
        return repr(self)


@dataclass(frozen=True, repr=False)
class Campaign:
    """Many landings, cell by cell: a cell is a scenario with its settings and a pilot.

    Attributes:
        cells: what was asked for, each with its `landings` in order of their seeds.
        left: flights asked for that are missing.
        lost: those of them whose process died or that raised, with the reason.
        folder: where the rows lie; None without one.
    """

    cells: tuple[CellResult, ...]
    left: int = 0
    lost: tuple[LostFlight, ...] = ()
    folder: Path | None = None

    def __repr__(self) -> str:
        return f"<{self._words}>"

    def _repr_html_(self) -> str:
        from shipland.report.notebook import campaign_html

        return campaign_html(self._words, self.cells)

    @property
    def _words(self) -> str:
        name = self.cells[0].name if len(self.cells) == 1 else f"{len(self.cells)} cells"
        left = f"; {self.left} not flown" * (self.left > 0)
        where = "" if self.folder is None else f", in {self.folder}"
        tally = Tally.of(self.landings)
        area = area_of(cell.rig for cell in self.cells)
        share = f"{tally.landed} of {tally.flights} landed in the {area} ({tally.interval_text()})"
        return f"Campaign of {name}: {share}{left}{where}"

    @property
    def landings(self) -> tuple[Landing, ...]:
        """Of all cells."""
        return tuple(landing for cell in self.cells for landing in cell.landings)

    @property
    def summary(self) -> str:
        """A line a cell: how many landed in the square, or circle, with the 95 % interval, and the medians."""
        lines = [summary_of(cell.landings, cell.rig.landing_area) for cell in self.cells]
        if len(lines) == 1:
            return lines[0]
        return "\n".join(f"{cell.name}: {line}" for cell, line in zip(self.cells, lines, strict=True))

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `flights.csv`: cell, pilot, settings, and the columns of a landing."""
        return list(rows_of(self.cells))

    def table(self) -> dict[str, npt.NDArray[Any]]:
        """The same as arrays (n,) by name, as data frames take them.

        A number that a flight does not have is NaN, a yes or no None in an array of objects; a setting's values are
        numbers where all of them are.
        """
        return {name: column_of(name, [row[name] for row in self.rows]) for name in (self.rows or [{}])[0]}

    def tables(self, oracle_motions: int = 0) -> str:
        """`tables.md`: a line a cell, the rules of other publications, and pilots in pairs.

        Args:
            oracle_motions: motions drawn for each oracle rate; 0: none are drawn.
        """
        kept = None if self.folder is None else self.folder / "oracle_rates.json"
        rates = oracle_rates_of(self.cells, oracle_motions, kept)
        parts = [leaderboard(self.cells, rates), rivals(self.cells)]
        if len({cell.pilot for cell in self.cells}) > 1:
            parts.append(pairings_table(pilot_pairings(self.cells)))
        return "\n\n".join(parts)

    def plot(self) -> Figure:
        """Where they touched, pilot by pilot, and each cell's share in the landing area with its 95 % interval."""
        from shipland.report.landing_plots import plot_cells

        require("plots", "Campaign.plot()")
        return plot_cells(self.cells)

    def compare(self, other: Campaign | None = None) -> Comparison:
        """McNemar's exact test and a paired bootstrap of the median errors, on the seeds that both flew.

        Args:
            other: the cells in common are compared; of two campaigns with one pilot each, the scenarios and settings in
                common. None: the pilots of this one.

        Raises:
            ConfigError: there is nothing to compare.
        """
        if other is not None:
            return Comparison(campaign_pairings(self.cells, other.cells))
        found = pilot_pairings(self.cells)
        if not found:
            raise ConfigError(
                "one pilot flew; give several to campaign(pilot=[…]), or another campaign to compare with"
            )
        return Comparison(found)


def campaign(
    scenario: Scenario | str | Path | Suite | Iterable[Scenario | str | Path] = "near",
    *,
    pilot: str | Factory | Iterable[str | Factory] = "horizon",
    vision: str | Factory = "geometric",
    runs: int = 20,
    first_seed: int = 1,
    salt: str | Path | None = None,
    settings: str | Iterable[str] = (),
    config: str | Path | None = None,
    only: str | Iterable[str] = (),
    workers: int | None = None,
    cluster: str = "",
    out: str | Path | None = None,
    logs: bool = False,
    time_limit_s: float = 0.0,
    oracle_motions: int = 60,
    progress: bool | Callable[[CampaignProgress], None] = True,
    command: str = "",
) -> Campaign:
    """Fly every combination of scenarios, values and pilots on the same seeds.

    Scripts and notebooks need no `__main__` guard, and pilots may be defined in them. Ctrl-C stops in order with a
    KeyboardInterrupt; without `out` what was flown is lost then.

    Args:
        scenario: as in `fly`; one or several, or a suite (`load_suite`).
        pilot: as in `fly`; one or several.
        vision: as in `fly`; a suite says it itself.
        runs: flights a cell.
        first_seed: of each cell.
        salt: file whose bytes derive the seeds that are flown in their places; nobody knows them without it.
        settings: values of a key, laid over every cell, as `wind.mean_mps=0,5,9`; one text or several.
        config: TOML file laid over every scenario.
        only: shell patterns of cells to fly.
        workers: processes; None: one a core; 0: nothing is flown, and what the folder holds is given back.
        cluster: fly on a Ray cluster instead: its address, or `auto`.
        out: folder for rows, tables and the logs of flights that did not land; what it holds already is not flown
            again. None: the rows stay in memory.
        logs: keep the log of every flight.
        time_limit_s: stop in order after so long [s] and give back what was flown; 0: no limit.
        oracle_motions: motions drawn for each oracle rate of the folder's tables; 0: none are drawn.
        progress: True shows a bar, False nothing; a function is called before the first flight and after each.
        command: command line to write down.

    Raises:
        ConfigError: a wrong scenario, name, setting or machine; or `out` with a pilot that no file holds by name.
        DataError: the folder holds rows of other code, configuration or weights, or cannot be written; workers die; or
            not one flight came to its end.
    """
    first_seed, runs, pilots = checked_seed(first_seed), whole_number("runs", runs, 1), _several(pilot)
    changes, patterns = _texts("settings", settings), _texts("only", only)
    if not time_limit_s >= 0.0:
        raise ConfigError(f"time_limit_s must be 0, for no limit, or more, got {time_limit_s}")
    if whole_number("oracle_motions", oracle_motions) == 1:
        raise ConfigError("oracle_motions must be 0, or 2 and more, got 1")
    if logs and out is None:
        raise ConfigError("logs are kept in a folder: give out")
    if isinstance(scenario, Suite):
        words, entries = f"{scenario.name} {scenario.version}", scenario.cells
    else:
        sources = tuple(it if isinstance(it, Scenario) else str(it) for it in _several(scenario))
        words, entries = "", (SuiteEntry(sources, (), vision),)
    if not pilots or not any(entry.scenarios for entry in entries):
        raise ConfigError("nothing to fly: a campaign wants one scenario and one pilot, or more")
    laid_over = None if config is None else Path(config)
    cells = cells_of(entries, Overrides(pilots, changes, laid_over, patterns))
    folder = None if out is None else Path(out)
    if folder is not None:
        for cell in cells:
            _check_named("pilots", cell.pilot)
            _check_named("visions", cell.vision)
    seeds = range(first_seed, first_seed + runs) if salt is None else sealed_seeds(Path(salt), first_seed, runs)
    plan = CampaignPlan(cells, seeds, folder, words, command, logs)
    found = fly_plan(plan, workers, cluster, time_limit_s, progress)
    if folder is not None:
        _write(found, plan, folder, oracle_motions)
    return found


def fly_plan(
    plan: CampaignPlan,
    workers: int | None = None,
    cluster: str = "",
    time_limit_s: float = 0.0,
    progress: bool | Callable[[CampaignProgress], None] = True,
) -> Campaign:
    """Fly what a plan's folder lacks; arguments and errors as of `campaign`. No tables are written."""
    if workers is not None:
        workers = whole_number("workers", workers)
    with open_campaign(plan) as opened:
        left = sum(1 for _ in opened.missing())
        if left and workers != 0:
            _fly(opened, left, workers, cluster, time_limit_s, progress)
            left = sum(1 for _ in opened.missing())  # flights that ended while the others were stopped are kept too
        found = Campaign(tuple(opened.results()), left, tuple(opened.lost), plan.out)
    if found.lost and not found.landings:
        raise DataError(
            f"not one flight came to its end; {found.lost[0].cell}, seed {found.lost[0].seed}: {found.lost[0].reason}"
        )
    return found


def _check_named(group: str, given: str | Factory) -> None:
    """ConfigError where another factory may have the same name: what is kept under that name would be taken for both.

    So have lambdas, functions within functions, partial functions and objects: their names leave out what is in them.
    """
    if isinstance(given, str):
        return
    name = factories.name_of(given)
    module, _, path = name.partition(":")
    found: Any = sys.modules.get(module)
    for part in path.split("."):
        found = getattr(found, part, None)
    if found != given:
        raise ConfigError(
            f"{name}, of the {group}, is not the only one of that name, and a folder keeps rows by name; "
            "write a function or a class of its own at the top of a file, or give no folder"
        )


def _several(given: Any) -> tuple[Any, ...]:  # noqa: ANN401 - one, or several one by one
    return tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)


def _texts(name: str, given: str | Iterable[str]) -> tuple[str, ...]:
    texts = _several(given)
    if not all(isinstance(text, str) for text in texts):
        raise ConfigError(f"{name} must be a text or several, got {texts!r}")
    return texts


def _fly(
    opened: OpenCampaign,
    left: int,
    workers: int | None,
    cluster: str,
    time_limit_s: float,
    progress: bool | Callable[[CampaignProgress], None],
) -> None:
    """Fly what is missing."""
    here = min(workers or len(os.sched_getaffinity(0)), left)
    executor = on_cluster(cluster) if cluster else processes(here)
    plan, flown, success, begun_s = opened.plan, 0, 0, time.monotonic()
    if progress is not False:
        say_that_it_compiles()
    cells, area = len(plan.cells), area_of(cell.scenario.rig for cell in plan.cells)
    flights = sum(1 for _ in plan.jobs())

    def tell() -> None:
        if callable(progress):
            progress(CampaignProgress(cells, flights, left, flown, success, opened.lost, area))

    def told() -> Generator[str, None, None]:
        nonlocal flown, success
        with closing(opened.fly(executor)) as landings:
            for _, landing in landings:
                flown, success = flown + 1, success + landing.success
                tell()
                yield f"{success} of {flown} landed in the {area} ({Tally(flown, success).interval_text(0)})"

    tell()
    if progress is True:
        print(f"{cells} cell{'s' * (cells > 1)}, {left} of {flights} flights to fly", file=sys.stderr, flush=True)
    with closing(told()) as one_by_one:
        try:
            for _ in followed(one_by_one, "flights", left) if progress is True else one_by_one:
                if time_limit_s and time.monotonic() - begun_s > time_limit_s:
                    break
        finally:
            if progress is True:
                spent_s = time.monotonic() - begun_s
                again = "; run it again to resume" if plan.out is not None and flown < left else ""
                rate = f"{60.0 * flown / spent_s:.0f} a minute"
                print(f"{flown} of {left} flown in {spent_s:.0f} s ({rate}){again}", file=sys.stderr)
                for cell, seed, reason in opened.lost[:_MOST_LOST]:
                    print(f"lost: {cell}, seed {seed}: {reason}", file=sys.stderr)
                if len(opened.lost) > _MOST_LOST:
                    print(f"lost: {len(opened.lost) - _MOST_LOST} more", file=sys.stderr)


def _write(found: Campaign, plan: CampaignPlan, folder: Path, oracle_motions: int) -> None:
    """Tables and pictures beside the rows."""
    from shipland.report.landing_plots import write_campaign

    with writing(folder / "flights.csv"):
        write_rows(folder / "flights.csv", read_cells([folder]))
    for planned, flown in zip(plan.cells, found.cells, strict=True):
        if flown.landings:
            write_campaign(folder / flown.name, planned, flown.landings)
    with writing(folder / "tables.md"):
        write_atomically(folder / "tables.md", f"{found.tables(oracle_motions)}\n".encode())
