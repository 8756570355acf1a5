"""Fly a grid of campaigns and print its table with ceilings and intervals; what was flown is kept and not flown again.

A cell is one scenario with one value of every axis and one pilot; its landings lie in OUT/CELL/landings.csv. All cells
share the worker processes. Ctrl-C, SIGTERM and --time-limit-s stop in order; the same command goes on from there.

python tools/fly_tables.py --out out/tables --scenarios rig-natops ship-sea6 --pilots paper offset_free
    --wind 0 5 9 --loop attitude velocity --telemetry anafi mavlink --count 200 --workers 16 --time-limit-s 540
python tools/fly_tables.py --out out/gains --scenarios rig-natops --pilots paper
    --axis aircraft.settings.max_tilt_deg=10,15,40
python tools/fly_tables.py --out out/tables … --print-only    # tables of what there is
"""

from __future__ import annotations

import argparse
import csv
import itertools
import re
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipland.errors import ShiplandError
from shipland.missions.campaign import Flight, land_once
from shipland.missions.ceiling import Ceiling, ceiling
from shipland.missions.folder import CampaignFolder, campaign_key, open_folder
from shipland.missions.landing import COLUMNS, Landing, row_of
from shipland.missions.scenarios import Scenario, load_scenario, scenario_table
from shipland.missions.statistics import share_interval
from shipland.missions.tables import pair_up
from shipland.missions.workers import run_jobs, stoppable

AXES = {"wind": "wind.mean_mps", "loop": "aircraft.loop.kind", "telemetry": "delays.telemetry.profile"}
"""Options that are short names of configuration keys."""
SAY_EVERY_S = 15.0


@dataclass(frozen=True)
class Cell:
    """One line of the table.

    Attributes:
        scenario: everything flown, but for pilot and seed.
        settings: (axis, value) pairs laid over the packaged scenario.
        pilot: who flies.
    """

    scenario: Scenario
    settings: tuple[tuple[str, str], ...]
    pilot: str

    @property
    def group(self) -> str:
        """Scenario and settings, as a folder's name without the pilot."""
        words = [self.scenario.name, *(f"{key.split('.')[-1]}={value}" for key, value in self.settings)]
        return re.sub(r"[^\w.=,+-]", "_", "_".join(words))

    @property
    def name(self) -> str:
        """The cell's folder."""
        return f"{self.group}_{re.sub(r'[^0-9A-Za-z_.-]', '.', self.pilot)}"


def cells_of(asked: argparse.Namespace) -> list[Cell]:
    """The grid, pilots innermost."""
    axes = {key: values for short, key in AXES.items() if (values := getattr(asked, short))}
    for text in asked.axis:
        key, _, values = text.partition("=")
        axes[key] = values.split(",")
    cells = []
    for name, values in itertools.product(asked.scenarios, itertools.product(*axes.values())):
        pairs = tuple(zip(axes, values, strict=True))
        changes = [*asked.set, *(f"{key}={value}" for key, value in pairs)]
        scenario = load_scenario(scenario_table(name, asked.config, changes))
        cells += [Cell(scenario, pairs, pilot) for pilot in asked.pilots]
    return cells


def fly(cells: list[Cell], asked: argparse.Namespace) -> dict[str, dict[int, Landing]]:
    """Fly what is missing; by cell and seed, all that there is."""
    begun_s, said_s, flown = time.monotonic(), time.monotonic(), 0
    seeds = range(asked.first_seed, asked.first_seed + asked.count)
    with stoppable(), ExitStack() as stack:
        folders: dict[str, CampaignFolder] = {}
        for cell in cells:
            key = campaign_key(cell.scenario, cell.pilot, asked.vision)
            folders[cell.name] = stack.enter_context(open_folder(asked.out / cell.name, key))
        missing = [
            Flight(cell.scenario, cell.pilot, asked.vision, seed, cell=cell.name)
            for seed in seeds
            for cell in cells
            if seed not in folders[cell.name].done
        ]

        def keep(flight: Flight, landing: Landing) -> None:
            folders[flight.cell].append(landing)

        say(f"{len(cells)} cells, {len(missing)} of {len(cells) * len(seeds)} flights to fly, {asked.workers} workers")
        if missing and not asked.print_only:
            jobs = run_jobs(land_once, missing, min(asked.workers, len(missing)), keep)
            try:
                with closing(jobs):
                    for _ in jobs:
                        flown, now_s = flown + 1, time.monotonic()
                        rate = flown / (now_s - begun_s)
                        if now_s - said_s > SAY_EVERY_S:
                            said_s = now_s
                            say(
                                f"{flown} of {len(missing)} flown, {(len(missing) - flown) / rate / 60.0:.1f} min to go"
                            )
                        if asked.time_limit_s and now_s - begun_s > asked.time_limit_s:
                            say(f"time limit: {flown} of {len(missing)} flown; the same command goes on from here")
                            break
            except KeyboardInterrupt:
                say(f"stopped: {flown} of {len(missing)} flown; the same command goes on from here")
        return {
            name: {seed: it for seed, it in folder.done.items() if seed in seeds} for name, folder in folders.items()
        }


def table(cells: list[Cell], flown: dict[str, dict[int, Landing]], ceilings: dict[str, Ceiling]) -> Iterator[str]:
    """Markdown, a line a cell."""
    keys = [key.split(".")[-1] for key, _ in cells[0].settings]
    yield " | ".join(
        ["| scenario", *keys, "pilot", "flights", "in the square", "95 % interval", "ceiling", "on its feet",
         "perfect at its instants", "error median [cm]", "own error median [cm]", "time median [s]", "causes |"]
    )  # fmt: skip
    yield "|" + "---|" * (len(keys) + 2) + "---:|" * 9 + "---|"
    for cell in cells:
        landings = list(flown[cell.name].values())
        if not landings:
            continue
        n, good, touched = len(landings), sum(it.good for it in landings), [it for it in landings if it.touched]
        low, high = share_interval(good, n)
        perfect = f"{sum(bool(it.perfect_in_square) for it in touched)} of {len(touched)}"
        own_m = [float(np.hypot(it.own_forward_m, it.own_starboard_m)) for it in touched]
        medians = [100.0 * _median([it.error_m for it in touched]), 100.0 * _median(own_m)]
        causes: dict[str, int] = {}
        for it in landings:
            if it.cause:
                causes[it.cause] = causes.get(it.cause, 0) + 1
        words = ", ".join(f"{count} {cause}" for cause, count in sorted(causes.items(), key=lambda pair: -pair[1]))
        yield " | ".join(
            [
                f"| {cell.scenario.name}",
                *(value for _, value in cell.settings),
                cell.pilot,
                str(n),
                f"{good} ({100.0 * good / n:.0f} %)",
                f"{100.0 * low:.0f}–{100.0 * high:.0f} %",
                f"{100.0 * ceilings[cell.group].share:.1f} %" if cell.group in ceilings else "",
                str(sum(it.landed for it in landings)),
                perfect,
                *(f"{value:.1f}" for value in medians),
                f"{_median([it.time_s for it in touched]):.0f}",
                f"{words} |",
            ]
        )
    yield ""
    yield (
        "Interval: Clopper and Pearson; it takes flights for independent, each with its own motion, wind and start. "
        "Ceiling: a perfect aircraft at any instant, from motions of their own."
    )


def pairs(cells: list[Cell], flown: dict[str, dict[int, Landing]]) -> Iterator[str]:
    """Markdown: every two pilots of one group on the same seeds."""
    yield (
        "| scenario and settings | pilots | seeds | only the first | only the second | McNemar p "
        "| error median, first less second [cm] |"
    )
    yield "|---|---|---:|---:|---:|---:|---:|"
    for first, second in itertools.combinations(cells, 2):
        if first.group == second.group:
            found = pair_up(
                list(flown[first.name].values()), list(flown[second.name].values()), np.random.default_rng(1)
            )
            low, high = (100.0 * value for value in found.error_interval_m)
            yield (
                f"| {first.group} | {first.pilot}, {second.pilot} | {found.flights} | {found.only_first} | "
                f"{found.only_second} | {found.p_value:.2g} | {100.0 * found.error_difference_m:.1f} "
                f"({low:.1f} … {high:.1f}) |"
            )


def write_rows(path: Path, cells: list[Cell], flown: dict[str, dict[int, Landing]]) -> None:
    """All rows in one table, with the cell and its settings in front."""
    settings = [key for key, _ in cells[0].settings]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["cell", "scenario", "pilot", *settings, *COLUMNS], lineterminator="\n")
        writer.writeheader()
        for cell in cells:
            head = {"cell": cell.name, "scenario": cell.scenario.name, "pilot": cell.pilot, **dict(cell.settings)}
            writer.writerows(head | row_of(landing) for landing in flown[cell.name].values())


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def say(text: str) -> None:
    """One line of progress."""
    print(text, file=sys.stderr, flush=True)


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenarios", nargs="+", required=True, metavar="NAME")
    parser.add_argument("--pilots", nargs="+", default=["paper", "offset_free"], metavar="NAME")
    parser.add_argument("--vision", default="geometric")
    for short, key in AXES.items():
        parser.add_argument(f"--{short}", nargs="+", default=[], metavar="VALUE", help=f"values of {key}")
    parser.add_argument("--axis", action="append", default=[], metavar="KEY=A,B,…", help="values of any other key")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="laid over every cell")
    parser.add_argument("--config", type=Path, help="TOML file laid over every scenario")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200, help="seeds a cell")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--time-limit-s", type=float, default=0.0, help="stop in order after so long; 0: no limit")
    parser.add_argument("--ceiling-motions", type=int, default=60, help="0: no ceilings")
    parser.add_argument("--print-only", action="store_true", help="fly nothing")
    asked = parser.parse_args()
    try:
        cells = cells_of(asked)
        flown = fly(cells, asked)
        ceilings: dict[str, Ceiling] = {}
        by_motion: dict[str, Ceiling] = {}
        for cell in cells if asked.ceiling_motions else []:
            key = repr((cell.scenario.ship, cell.scenario.rig, cell.scenario.aircraft.airframe))
            if key not in by_motion:
                args = (cell.scenario.ship, cell.scenario.rig, cell.scenario.aircraft.airframe)
                by_motion[key] = ceiling(*args, asked.ceiling_motions, np.random.default_rng(1))
            ceilings[cell.group] = by_motion[key]
    except ShiplandError as error:
        sys.exit(f"fly_tables: {error}")
    text = "\n".join([*table(cells, flown, ceilings), "", *(pairs(cells, flown) if len(asked.pilots) > 1 else [])])
    print(text)
    (asked.out / "tables.md").write_text(text + "\n", encoding="utf-8")
    write_rows(asked.out / "flights.csv", cells, flown)


if __name__ == "__main__":
    main()
