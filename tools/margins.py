"""What a pilot loses that was told a wrong response of its vehicle: latencies, lags, what full sticks mean.

    python tools/margins.py --out out/margins          # 11 vehicles, 2 scenarios, 50 flights each
    python tools/margins.py --pilots horizon residual --told "as it is" "time constants × 0.7" --out out/learned

The aircraft stays the same; what the pilot takes it for is changed, one figure at a time. The same seeds in every row.
Leaves margins.md and margins.json.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from rich.progress import track

from shipland.evaluation.statistics import share_interval
from shipland.guidance.pilot import Pilot, PilotSetup
from shipland.guidance.pilots import horizon, learned, residual
from shipland.guidance.response import Response
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario


def _scaled(response: Response, **by: float) -> Response:
    return replace(response, **{name: getattr(response, name) * factor for name, factor in by.items()})


TOLD = {
    "as it is": lambda told: told,
    "commands 66 ms later": lambda told: replace(told, uplink_s=told.uplink_s + 0.066),
    "commands 25 ms sooner": lambda told: replace(told, uplink_s=max(told.uplink_s - 0.025, 0.0)),
    "time constants × 0.7": lambda told: _scaled(told, lag_s=0.7, dead_time_s=0.7, climb_lag_s=0.7, turn_lag_s=0.7),
    "time constants × 1.4": lambda told: _scaled(told, lag_s=1.4, dead_time_s=1.4, climb_lag_s=1.4, turn_lag_s=1.4),
    "tilt of full sticks × 0.8": lambda told: _scaled(told, max_tilt_rad=0.8),
    "tilt of full sticks × 1.25": lambda told: _scaled(told, max_tilt_rad=1.25),
    "drag × 0.5": lambda told: _scaled(told, drag_per_s=0.5),
    "drag × 2": lambda told: _scaled(told, drag_per_s=2.0),
    "climb of full sticks × 0.8": lambda told: _scaled(told, max_climb_mps=0.8),
    "climb of full sticks × 1.25": lambda told: _scaled(told, max_climb_mps=1.25),
}
"""Name: from the response as it is to the one that the pilot is told."""


PILOTS = {"horizon": horizon, "residual": residual, "learned": learned}

Row = tuple[str, str, str, bool, float]
"""Pilot, scenario, what is told, landed in the square on its feet, touchdown's distance from the centre [m]."""


def _pilot(setup: PilotSetup, name: str, told: str) -> Pilot:
    return PILOTS[name](replace(setup, response=TOLD[told](setup.response)))


def fly_one(job: tuple[str, str, str, float | None, int]) -> Row:
    """One flight of a pilot, a scenario, a mean wind, a vehicle as it was told, and a seed."""
    pilot, name, told, wind_mps, seed = job
    changes = {} if wind_mps is None else {"wind.mean_mps": wind_mps}
    scenario = load_scenario(name, **changes)
    flown = fly_quietly(scenario, partial(_pilot, name=pilot, told=told), "geometric", seed)
    touchdown_m = np.full(2, np.nan) if flown.verdict is None else flown.verdict.touchdown_in_deck_m
    return pilot, name, told, flown.succeeded, float(np.hypot(*touchdown_m))


def table_of(rows: list[Row], columns: list[tuple[str, str]], runs: int) -> str:
    """Markdown: a line a vehicle as it was told, a group of columns a pilot and scenario."""
    heads = [f"`{pilot}`, {name}: of {runs} | 95 % interval | error median [cm]" for pilot, name in columns]
    lines = ["| the pilot is told | " + " | ".join(heads) + " |", "|---|" + "---:|---:|---:|" * len(columns)]
    for told in dict.fromkeys(row[2] for row in rows):
        cells = []
        for column in columns:
            some = [row for row in rows if row[:3] == (*column, told)]
            good = sum(row[3] for row in some)
            low, high = share_interval(good, len(some))
            median_cm = 100.0 * float(np.nanmedian([row[4] for row in some]))
            cells.append(f"{good} | {100 * low:.0f}–{100 * high:.0f} % | {median_cm:.1f}")
        lines.append(f"| {told} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main(
    out: Path = Path("out/margins"),
    scenarios: tuple[str, ...] = ("rig-natops", "ship-sea6"),
    pilots: tuple[Literal["horizon", "residual", "learned"], ...] = ("horizon",),
    told: tuple[str, ...] = tuple(TOLD),
    wind_mps: float | None = None,
    runs: int = 50,
    workers: int = 2,
) -> None:
    """Fly every row and write the table.

    Args:
        out: folder.
        scenarios: packaged names or TOML files.
        pilots: who is told so.
        told: the rows.
        wind_mps: mean wind; the scenario's own by default.
        runs: flights a row, scenario and pilot.
        workers: processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    if unknown := set(told) - TOLD.keys():
        raise SystemExit(f"nothing to tell is called {sorted(unknown)}; there are: {', '.join(TOLD)}")
    columns = [(pilot, name) for name in scenarios for pilot in pilots]
    seeds = range(1, runs + 1)
    jobs = [(pilot, name, what, wind_mps, seed) for pilot, name in columns for what in told for seed in seeds]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        rows = list(track(pool.map(fly_one, jobs, chunksize=4), "flights", total=len(jobs)))
    out.mkdir(parents=True, exist_ok=True)
    (out / "margins.json").write_text(json.dumps(rows), encoding="utf-8")
    text = table_of(rows, columns, runs)
    (out / "margins.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    tyro.cli(main)
