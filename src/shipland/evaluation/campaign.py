"""A campaign: many cells flown on shared workers into one folder, and read back from it."""

from __future__ import annotations

import csv
import json
import os
import platform
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shipland.config import build
from shipland.errors import DataError
from shipland.evaluation.folder import campaign_key, claimed, folder_in, read_campaign
from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import COLUMNS, Landing, row_of
from shipland.evaluation.suite import Cell
from shipland.evaluation.workers import run_jobs
from shipland.rig import Rig
from shipland.sim.aircraft.parameters import AirframeParameters
from shipland.sim.ship.ship import ShipParameters
from shipland.stopping import stop_requests

Keep = Callable[[FlightJob, Landing], None]
Lose = Callable[[FlightJob, str], None]
Executor = Callable[[Iterable[FlightJob], Keep, Lose], Iterator[tuple[FlightJob, Landing]]]
"""Flies flights: yields each with its landing, calls `Keep` with each landing, `Lose` with each lost flight and why."""


@dataclass(frozen=True)
class CampaignPlan:
    """The flights to fly, and the folder of their results.

    Attributes:
        cells: lines of the table.
        seeds: flown in every cell.
        out: folder; made when missing. CELL/landings.csv hold the rows, CELL/flights/SEED.mcap the logs of those that
            did not land in the square, cells.json what was asked for.
        suite: name and version; empty for a grid of the command line.
        command: command line to write down.
        logs: keep the log of every flight.
    """

    cells: Sequence[Cell]
    seeds: range
    out: Path
    suite: str = ""
    command: str = ""
    logs: bool = False


class OpenCampaign:
    """A plan's folder, opened by `open_campaign` for this process alone.

    Attributes:
        plan: as asked for.
        lost: (cell, seed, reason) of flights whose process died or that raised; they are flown again next time.
    """

    def __init__(self, plan: CampaignPlan) -> None:
        self.plan = plan
        self._folders = {
            cell.name: folder_in(plan.out / cell.name, campaign_key(cell.scenario, cell.pilot, cell.vision))
            for cell in plan.cells
        }
        self.lost: list[tuple[str, int, str]] = []
        _write_beside(plan)

    def missing(self) -> Iterator[FlightJob]:
        """The flights that are missing, seed by seed over all cells."""
        plan = self.plan
        for seed in plan.seeds:
            for cell in plan.cells:
                if seed not in self._folders[cell.name].seeds:
                    log = plan.out / cell.name / "flights" / f"{seed}.mcap"
                    yield FlightJob(
                        cell.scenario, cell.pilot, cell.vision, seed, log, not plan.logs, cell.name, plan.command
                    )

    def fly(self, executor: Executor) -> Generator[tuple[FlightJob, Landing], None, None]:
        """Fly what is missing and yield it as it is kept; closing the generator stops in order."""

        def keep(flight: FlightJob, landing: Landing) -> None:
            if flight.seed not in self._folders[flight.cell].seeds:  # a flight that comes twice counts once
                self._folders[flight.cell].append(landing)

        def lose(flight: FlightJob, reason: str) -> None:
            self.lost.append((flight.cell, flight.seed, reason))

        yield from executor(self.missing(), keep, lose)


@contextmanager
def open_campaign(plan: CampaignPlan) -> Iterator[OpenCampaign]:
    """The plan's folder, made when missing, for this process alone; Ctrl-C and SIGTERM are requests within.

    Raises:
        DataError: it holds landings of other code, configuration or weights, another process flies in it, or it cannot
            be written.
    """
    if (plan.out / "landings.csv").exists():
        raise DataError(f"{plan.out} holds one table of landings, not a campaign's cells; give another folder")
    with stop_requests(), claimed(plan.out):
        yield OpenCampaign(plan)


def processes(count: int) -> Executor:
    """Flights in `count` processes of this machine."""

    def executor(flights: Iterable[FlightJob], keep: Keep, lose: Lose) -> Iterator[tuple[FlightJob, Landing]]:
        return run_jobs(land_quietly, flights, count, keep, lose)

    return executor


def _write_beside(plan: CampaignPlan) -> None:
    """cells.json: what was asked for, earlier cells of the folder included."""
    path = plan.out / "cells.json"
    before = read_about(plan.out) if cells_file(plan.out).exists() else {"cells": {}}
    cells = {
        cell.name: {
            "suite": plan.suite,
            "scenario": cell.scenario.name,
            "settings": dict(cell.settings),
            "group": cell.group,
            "pilot": cell.pilot,
            "vision": cell.vision,
        }
        for cell in plan.cells
    }
    table = {
        "command": plan.command,
        "machine": {"platform": platform.platform(), "processor": _processor(), "cores": os.cpu_count()},
        "cells": before["cells"] | cells,
    }
    part = path.with_suffix(".part")
    part.write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    part.replace(path)


def read_about(folder: Path) -> dict[str, Any]:
    """cells.json of a folder: command, machine and cells; DataError when there is none or it is broken."""
    path = cells_file(folder)
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(table["cells"], dict):
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


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


@dataclass(frozen=True)
class CellResult:
    """The landings of one cell in a folder.

    Attributes:
        name, group, suite, pilot, vision: as of `Cell` and `CampaignPlan`.
        settings: (key, value) pairs.
        scenario: its name.
        rig, ship, airframe: what a landing is judged by, read back from what was flown.
        landings: in order of their seeds.
        logs: the folder with the logs of failures, for links.
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
    logs: Path


def read_cells(folders: Sequence[Path]) -> list[CellResult]:
    """The cells of one folder, or of several merged: a seed that two of them hold counts once.

    Raises:
        DataError: a folder holds no campaign or a broken one, or the same cell was flown with other code, configuration
            or weights in two of them.
    """
    found: dict[str, CellResult] = {}
    keys: dict[str, dict[str, Any]] = {}
    for folder in folders:
        for name, about in read_about(folder)["cells"].items():
            key = json.loads((folder / name / "campaign.json").read_text(encoding="utf-8"))
            bound = {word: key[word] for word in ("source", "configuration", "weights", "own_code")}
            if keys.setdefault(name, bound) != bound:
                raise DataError(f"{name}: flown with other code, configuration or weights in {folder} than before")
            flown, landings = key["scenario"], {it.seed: it for it in read_campaign(folder / name)}
            if name in found:
                landings = {it.seed: it for it in found[name].landings} | landings
            found[name] = CellResult(
                name=name,
                group=about["group"],
                suite=about["suite"],
                pilot=about["pilot"],
                vision=about["vision"],
                settings=tuple(about["settings"].items()),
                scenario=about["scenario"],
                rig=build(Rig, flown["rig"], "rig"),
                ship=build(ShipParameters, flown["ship"], "ship"),
                airframe=build(AirframeParameters, flown["aircraft"]["airframe"], "aircraft.airframe"),
                landings=tuple(landings[seed] for seed in sorted(landings)),
                logs=folder / name / "flights",
            )
    return list(found.values())


def write_rows(path: Path, cells: Sequence[CellResult]) -> None:
    """Write `flights.csv`; numbers that a flight does not have are empty."""
    keys = list(dict.fromkeys(key for cell in cells for key, _ in cell.settings))
    part = path.with_suffix(".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        head = ["suite", "cell", "scenario", "pilot", "vision"]
        rows = csv.DictWriter(file, [*head, *keys, *COLUMNS], restval="", lineterminator="\n")
        rows.writeheader()
        for cell in cells:
            beside = {"suite": cell.suite, "cell": cell.name, "scenario": cell.scenario, "pilot": cell.pilot}
            beside |= {"vision": cell.vision} | dict(cell.settings)
            rows.writerows(beside | row_of(landing) for landing in cell.landings)
    part.replace(path)
