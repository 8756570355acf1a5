"""A campaign: many cells flown on shared workers into one folder, and read back from it."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from shipland.compiled import compiles_for_all
from shipland.config import build
from shipland.errors import DataError
from shipland.evaluation.folder import Rows, campaign_key, claimed, folder_in, read_campaign, read_key
from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import COLUMNS, Landing, as_text, row_of
from shipland.evaluation.suite import OF_THE_FLIER, Cell
from shipland.factories import name_of
from shipland.files import json_bytes, json_of, write_atomically, write_csv
from shipland.former import renamed
from shipland.rig import Rig
from shipland.sim.aircraft.parameters import AirframeParameters
from shipland.sim.ship.ship import ShipParameters
from shipland.stopping import stop_requests
from shipland.workers import run_jobs


class LostFlight(NamedTuple):
    """A flight without a landing: its process died, or it raised."""

    cell: str
    seed: int
    reason: str


Keep = Callable[[FlightJob, Landing], None]
Lose = Callable[[FlightJob, str], None]
Executor = Callable[[Iterable[FlightJob], Keep, Lose], Iterator[tuple[FlightJob, Landing]]]
"""Flies flights: yields each with its landing, calls `Keep` with each landing, `Lose` with each lost flight and why."""


@dataclass(frozen=True)
class CampaignPlan:
    """The flights to fly, of every cell with the seeds in this order, and the folder of their results.

    Attributes:
        out: folder; made when missing. CELL/landings.csv hold the rows, CELL/flights/SEED.mcap the logs of those that
            did not land in the square, cells.json what was asked for. None: the rows stay in memory.
        suite: name and version; empty for a grid of the command line.
        logs: keep the log of every flight.
        counts: of a cell that flies fewer than all seeds, by its name, how many of the first.
    """

    cells: Sequence[Cell]
    seeds: Sequence[int]
    out: Path | None = None
    suite: str = ""
    command: str = ""
    logs: bool = False
    counts: Mapping[str, int] = field(default_factory=dict)

    def jobs(self) -> Iterator[tuple[int, Cell]]:
        """Every flight, seed by seed over all cells."""
        for index, seed in enumerate(self.seeds):
            for cell in self.cells:
                if index < self.counts.get(cell.name, len(self.seeds)):
                    yield seed, cell


class OpenCampaign:
    """A plan's rows, opened by `open_campaign` for this process alone; flights that are `lost` are flown next time."""

    def __init__(self, plan: CampaignPlan) -> None:
        self.plan = plan
        self.lost: list[LostFlight] = []
        self._rows = {cell.name: Rows() for cell in plan.cells}
        if plan.out is not None:
            for cell in plan.cells:
                key = campaign_key(cell.scenario, cell.pilot, cell.vision)
                self._rows[cell.name] = folder_in(plan.out / cell.name, key)
            _check_scenarios(_cells_in(plan, plan.out), plan.out)

    def missing(self) -> Iterator[FlightJob]:
        """The flights that are missing, seed by seed over all cells."""
        plan = self.plan
        for seed, cell in plan.jobs():
            if seed not in self._rows[cell.name].seeds:
                log = None if plan.out is None else plan.out / cell.name / "flights" / f"{seed}.mcap"
                yield FlightJob(
                    cell.scenario, cell.pilot, cell.vision, seed, log, not plan.logs, cell.name, plan.command
                )

    def fly(self, executor: Executor) -> Generator[tuple[FlightJob, Landing], None, None]:
        """Fly what is missing and yield it as it is kept; closing the generator stops in order."""

        def keep(flight: FlightJob, landing: Landing) -> None:
            if flight.seed not in self._rows[flight.cell].seeds:  # a flight that comes twice counts once
                self._rows[flight.cell].append(landing)

        def lose(flight: FlightJob, reason: str) -> None:
            self.lost.append(LostFlight(flight.cell, flight.seed, reason))

        if self.plan.out is not None:
            _write_beside(self.plan, self.plan.out)
        yield from executor(self.missing(), keep, lose)

    def results(self) -> list[CellResult]:
        """The plan's cells with all their rows, those flown earlier included."""
        plan = self.plan
        found = {} if plan.out is None else {cell.name: cell for cell in read_cells([plan.out])}
        return [
            found.get(cell.name)
            or _result(cell.name, _about(cell, plan.suite), cell.scenario.table(), self._rows[cell.name].done)
            for cell in plan.cells
        ]


@contextmanager
def open_campaign(plan: CampaignPlan) -> Iterator[OpenCampaign]:
    """The plan's rows: in its folder, made when missing, for this process alone, or in memory without one.

    Ctrl-C and SIGTERM are requests within. DataError where it holds landings of other code, configuration or weights,
    another process flies in it, or it cannot be written.
    """
    if plan.out is not None and (plan.out / "landings.csv").exists():
        raise DataError(f"{plan.out} holds one table of landings, not a campaign's cells; give another folder")
    with stop_requests(), nullcontext() if plan.out is None else claimed(plan.out):
        yield OpenCampaign(plan)


def processes(count: int) -> Executor:
    """Flights in `count` processes of this machine.

    Where several processes have no machine code yet, the first flight has one of its own: a compiler never gives its
    memory back, and what one has compiled the others only load.
    """

    def executor(flights: Iterable[FlightJob], keep: Keep, lose: Lose) -> Iterator[tuple[FlightJob, Landing]]:
        waiting = iter(flights)
        if count > 1 and compiles_for_all():
            yield from run_jobs(land_quietly, islice(waiting, 1), count, keep, lose)
        yield from run_jobs(land_quietly, waiting, count, keep, lose)

    return executor


def _write_beside(plan: CampaignPlan, out: Path) -> None:
    """cells.json: what was asked for, earlier cells of the folder included."""
    table = {
        "command": plan.command,
        "machine": {"platform": platform.platform(), "processor": _processor(), "cores": os.cpu_count()},
        "cells": _cells_in(plan, out),
    }
    write_atomically(out / "cells.json", json_bytes(table))


def _cells_in(plan: CampaignPlan, out: Path) -> dict[str, Any]:
    """What cells.json says of each cell, by its name; of earlier cells of the folder too."""
    before = read_about(out)["cells"] if cells_file(out).exists() else {}
    return before | {cell.name: _about(cell, plan.suite) for cell in plan.cells}


def _check_scenarios(cells: Mapping[str, Any], out: Path) -> None:
    """DataError where two cells of a folder are of one group and not of one scenario."""
    scenarios = _Scenarios()
    for name, about in cells.items():
        try:
            scenarios.check(name, about["group"], renamed(read_key(out / name)["scenario"]))
        except (AttributeError, KeyError, TypeError) as error:
            raise _not_left(name, error) from None


class _Scenarios:
    """What the flights of each group meet: the same, as its pilots are compared seed by seed."""

    def __init__(self) -> None:
        self._met: dict[str, tuple[str, dict[str, Any]]] = {}

    def check(self, name: str, group: str, scenario: Mapping[str, Any]) -> None:
        """Take one more cell; DataError where another of its group met something else."""
        task = {section: values for section, values in scenario.items() if section not in OF_THE_FLIER}
        other, met = self._met.setdefault(group, (name, task))
        if met != task:
            raise DataError(
                f"{name} and {other} are both called {group}, but were not flown in the same scenario; "
                "give another folder"
            )


def _not_left(name: str, error: Exception) -> DataError:
    return DataError(f"{name}: not what a campaign leaves: {error!r}")


def _about(cell: Cell, suite: str) -> dict[str, Any]:
    """What cells.json says of a cell."""
    return {
        "suite": suite,
        "scenario": cell.scenario.name,
        "settings": dict(cell.settings),
        "group": cell.group,
        "pilot": name_of(cell.pilot),
        "vision": name_of(cell.vision),
    }


def read_about(folder: Path) -> dict[str, Any]:
    """cells.json of a folder: command, machine and cells; DataError when there is none or it is broken."""
    path = cells_file(folder)
    try:
        table = json_of(path.read_text(encoding="utf-8"))
        machine = table["machine"]
        texts = (table["command"], machine["platform"], machine["processor"])
        if not (isinstance(table["cells"], dict) and isinstance(machine["cores"], int | None) and _are_texts(texts)):
            raise TypeError
    except OSError as error:
        raise DataError(f"{folder} holds no campaign: {path.name}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise DataError(f"{path} is not readable; give another folder") from None
    return dict(table)


def cells_file(folder: Path) -> Path:
    """cells.json of a folder, or bench.json, as it was called."""
    former = folder / "bench.json"
    return former if former.exists() and not (folder / "cells.json").exists() else folder / "cells.json"


def _are_texts(values: Iterable[object]) -> bool:
    return all(isinstance(value, str) for value in values)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


@dataclass(frozen=True)
class CellResult:
    """The landings of one cell in a folder, in order of their seeds; its names as of `Cell` and `CampaignPlan`.

    Attributes:
        rig, ship, airframe: what a landing is judged by, read back from what was flown.
        logs: by seed, the folder with the logs of failures, for links; empty without one.
        key: campaign.json, as `campaign_key` makes it; empty of rows in memory.
    """

    name: str
    group: str
    suite: str
    pilot: str
    vision: str
    settings: tuple[tuple[str, str], ...]
    scenario: str
    rig: Rig
    ship: ShipParameters
    airframe: AirframeParameters
    landings: tuple[Landing, ...]
    logs: Mapping[int, Path] = field(default_factory=dict)
    key: Mapping[str, Any] = field(default_factory=dict)

    @property
    def version(self) -> str:
        """Of the code that flew it; empty where that is not known."""
        return str(self.key.get("version", ""))


def _result(
    name: str, about: Mapping[str, Any], flown: Mapping[str, Any], landings: Mapping[int, Landing]
) -> CellResult:
    """Of what cells.json says of a cell, the configuration that was flown, and the landings by seed."""
    settings, words = dict(about["settings"]), ("suite", "scenario", "group", "pilot", "vision")
    if not _are_texts((*settings.values(), *(about[word] for word in words))):
        raise TypeError("expected texts in cells.json")
    return CellResult(
        name,
        settings=tuple(settings.items()),
        **{word: about[word] for word in words},
        rig=build(Rig, flown["rig"], "rig"),
        ship=build(ShipParameters, flown["ship"], "ship"),
        airframe=build(AirframeParameters, flown["aircraft"]["airframe"], "aircraft.airframe"),
        landings=tuple(landings[seed] for seed in sorted(landings)),
    )


def read_cells(folders: Sequence[Path]) -> list[CellResult]:
    """The cells of one folder, or of several merged: a seed that two of them hold counts once.

    DataError where a folder holds no campaign or a broken one, or two flew a cell with other code, configuration or
    weights.
    """
    found: dict[str, CellResult] = {}
    keys: dict[str, dict[str, Any]] = {}
    scenarios = _Scenarios()
    for folder in folders:
        for name, about in read_about(folder)["cells"].items():
            try:
                key = read_key(folder / name)
                bound = {word: key[word] for word in ("source", "configuration", "weights", "own_code")}
                if keys.setdefault(name, bound) != bound:
                    raise DataError(f"{name}: flown with other code, configuration or weights in {folder} than before")
                landings = {it.seed: it for it in read_campaign(folder / name)}
                logs = dict.fromkeys(landings, folder / name / "flights")
                if name in found:
                    landings = {it.seed: it for it in found[name].landings} | landings
                    logs = {**found[name].logs, **logs}
                flown = renamed(key["scenario"])
                made = _result(name, about, flown, landings)
                scenarios.check(name, made.group, flown)
                found[name] = replace(made, logs=logs, key=key)
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                raise _not_left(name, error) from None
    return list(found.values())


def rows_of(cells: Sequence[CellResult]) -> Iterator[dict[str, Any]]:
    """A row a flight, as in `flights.csv`: all have the same keys; a setting that a cell does not have is empty."""
    settings = dict.fromkeys((key for cell in cells for key, _ in cell.settings), "")
    for cell in cells:
        beside = {"suite": cell.suite, "cell": cell.name, "scenario": cell.scenario, "pilot": cell.pilot}
        beside |= {"vision": cell.vision} | settings | dict(cell.settings)
        for landing in cell.landings:
            yield beside | row_of(landing)


def write_rows(path: Path, cells: Sequence[CellResult]) -> None:
    """Write `flights.csv`; numbers that a flight does not have are empty."""
    settings = dict.fromkeys(key for cell in cells for key, _ in cell.settings)
    head = ["suite", "cell", "scenario", "pilot", "vision", *settings, *COLUMNS]
    write_csv(path, head, map(as_text, rows_of(cells)))
