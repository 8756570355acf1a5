"""Fly at a ship under way: three courses, ten speeds, some seeds, each pilot; who lands, and how far the others trail.

    python tools/courses.py --out out/courses

Goes on where it was broken off. Leaves courses.csv, table.md and courses.png.
"""

from __future__ import annotations

import csv
import math
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.progress import track

from shipland.config import merge
from shipland.errors import DataError
from shipland.messages import GroundTruth
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table

COURSES = ("straight", "s", "turn90")
SPEEDS_MPS = tuple(0.5 * step for step in range(10))
PRINTED = Path(__file__).parent.parent / "examples" / "near_printed.toml"
NEAR = {"distance_m": 10.0, "distance_half_range_m": 2.0, "height_m": 2.0, "height_half_range_m": 0.5}
FLIERS: dict[str, tuple[str, Path | None, dict[str, float]]] = {
    "horizon": ("horizon", None, {}),
    "paper": ("paper", None, {}),
    "paper, from 10 m": ("paper", None, NEAR),
    "paper as printed, from 10 m": ("paper", PRINTED, NEAR),
}
"""Name: pilot, configuration laid over the scenario, start in place of the scenario's."""
_LANDED_AT_M = 0.05
"""Where a flight that landed is drawn."""
TRAIL_S = 20.0
"""Trailing is the median over so long before contact or the end of the flight."""


@dataclass(frozen=True)
class Row:
    """One flight; `trail_m` astern of the deck's neutral centre, along the ship's course, `off_m` over ground."""

    pilot: str
    course: str
    speed_mps: float
    seed: int
    in_square: bool
    landed: bool
    time_s: float
    trail_m: float
    off_m: float
    reason: str


def fly_row(pilot: str, course: str, speed_mps: float, seed: int) -> Row:
    """Fly one."""
    kind, config, start = FLIERS[pilot]
    table = scenario_table("under-way", config)
    way: dict[str, Any] = {"kind": course if speed_mps > 0.0 else "still", "speed_mps": speed_mps}
    scenario = load_scenario(merge(table, {"ship": {"course": way}, "start": start}))
    truths: list[GroundTruth] = []
    flown = fly_quietly(scenario, kind, "geometric", seed, lambda row: truths.append(row.truth) if row.truth else None)
    verdict = flown.verdict
    end_s = flown.result.t_s if verdict is None else verdict.t_s
    last = [truth for truth in truths if end_s - TRAIL_S <= truth.t_s <= end_s]
    place = [(truth.ned_from_ship.inverse() @ truth.ned_from_body).translation_m for truth in last] or [
        np.full(3, np.nan)
    ]
    forward_m, right_m = np.median(np.array(place)[:, :2], axis=0)
    good = verdict is not None and verdict.landed
    return Row(
        pilot,
        course,
        speed_mps,
        seed,
        flown.succeeded,
        good,
        round(end_s, 2),
        round(-float(forward_m), 3),
        round(math.hypot(forward_m, right_m), 3),
        flown.reason,
    )


def read_rows(path: Path) -> list[Row]:
    """Rows flown before; DataError when the file is another one."""
    rows = []
    for values in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
        try:
            typed: dict[str, Any] = {name: values[name] for name in ("pilot", "course", "reason")}
            typed |= {name: values[name] == "True" for name in ("in_square", "landed")}
            typed |= {name: float(values[name]) for name in ("speed_mps", "time_s", "trail_m", "off_m")}
            rows.append(Row(**typed, seed=int(values["seed"])))
        except (KeyError, ValueError):
            raise DataError(f"{path}: not a row of courses: {values}; remove it to fly it again") from None
    return rows


def table_of(rows: list[Row], pilots: list[str], seeds: int) -> str:
    """Markdown: a line a speed; landed in the square, or by how much the flight trailed."""
    text = []
    for pilot in pilots:
        text += [f"Pilot {pilot}: flights of {seeds} that landed in the square; else the median distance trailed [m]."]
        text += ["", "| speed [m/s] | " + " | ".join(COURSES) + " |", "|---:|" + "---:|" * len(COURSES)]
        for speed in SPEEDS_MPS:
            cells = []
            for course in COURSES:
                some = [row for row in rows if (row.pilot, row.course, row.speed_mps) == (pilot, course, speed)]
                in_square, on_deck = sum(row.in_square for row in some), sum(row.landed for row in some)
                trail = [row.trail_m for row in some if not row.landed]
                cell = f"{in_square} ({on_deck} on the deck)" if some else "–"
                cells.append(cell + (f"; {np.median(trail):.1f} m" if trail else ""))
            text.append(f"| {speed:g} | " + " | ".join(cells) + " |")
        total = {course: [row for row in rows if (row.pilot, row.course) == (pilot, course)] for course in COURSES}
        sums = [f"{sum(r.in_square for r in some)} of {len(some)}" for some in total.values()]
        text += ["| all | " + " | ".join(sums) + " |", ""]
    return "\n".join(text)


def plot(rows: list[Row], pilots: list[str], path: Path) -> None:
    """Over speed: who landed, in a row at the bottom, and how far off the others stayed."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(pilots), figsize=(4.2 * len(pilots), 3.4), sharey=True, squeeze=False)
    for axis, pilot in zip(axes[0], pilots, strict=True):
        for index, course in enumerate(COURSES):
            some = [row for row in rows if (row.pilot, row.course) == (pilot, course)]
            x = np.array([row.speed_mps for row in some]) + 0.06 * (index - 1)
            y = np.array([_LANDED_AT_M * 1.3 ** (index - 1) if row.landed else row.off_m for row in some])
            landed = np.array([row.landed for row in some], dtype=bool)
            axis.plot(x[landed], y[landed], "o", color=f"C{index}", ms=5, label=f"{course}: landed")
            axis.plot(x[~landed], y[~landed], "x", color=f"C{index}", ms=5, label=f"{course}: did not")
        axis.set(title=pilot, xlabel="ship's speed [m/s]", yscale="log")
        axis.grid(alpha=0.3)
    for axis in axes[0]:
        axis.set_ylim(0.6 * _LANDED_AT_M, 600.0)
    axes[0][0].set_ylabel("off at the end [m]; landed: below")
    axes[0][-1].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=90)
    plt.close(figure)


def main(
    out: Path = Path("out/courses"), seeds: int = 3, workers: int = 2, pilots: tuple[str, ...] = tuple(FLIERS)
) -> None:
    """Fly what is missing and write table and plot."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "courses.csv"
    rows = read_rows(path) if path.exists() else []
    done = {(row.pilot, row.course, row.speed_mps, row.seed) for row in rows}
    wanted = [
        (pilot, course, speed, seed)
        for pilot in pilots
        for course in COURSES
        for speed in SPEEDS_MPS
        for seed in range(1, seeds + 1)
    ]
    missing = [each for each in wanted if each not in done]
    names = [each.name for each in fields(Row)]
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with (
        path.open("a", newline="", encoding="utf-8") as file,
        ProcessPoolExecutor(workers, get_context("spawn")) as pool,
    ):
        writer = csv.DictWriter(file, names)
        if not rows:
            writer.writeheader()
        futures = [pool.submit(fly_row, *each) for each in missing]
        try:
            for future in track(as_completed(futures), "flights", total=len(futures)):
                rows.append(future.result())
                writer.writerow(asdict(rows[-1]))
                file.flush()
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    text = table_of(rows, list(pilots), seeds)
    (out / "table.md").write_text(text, encoding="utf-8")
    plot(rows, list(pilots), out / "courses.png")
    print(text)


if __name__ == "__main__":
    tyro.cli(main)
