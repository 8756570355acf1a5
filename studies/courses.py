"""Landings on a ship under way: three courses, ten speeds, geometric camera."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from shipland.config import merge
from shipland.messages import GroundTruth
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table
from studies.harness import ROOT, Case, Column, Row, Study, share

COURSES = ("straight", "s", "turn90")
SPEEDS_MPS = tuple(0.5 * step for step in range(10))
NEAR = {"distance_m": 10.0, "distance_half_range_m": 2.0, "height_m": 2.0, "height_half_range_m": 0.5}
PILOTS: dict[str, tuple[str, Path | None, dict[str, float]]] = {
    "horizon": ("horizon", None, {}),
    "paper": ("paper", None, {}),
    "paper, from 10 m": ("paper", None, NEAR),
    "paper as printed, from 10 m": ("paper", ROOT / "examples" / "near_printed.toml", NEAR),
}
"""Name: pilot, configuration laid over the scenario, start in place of the scenario's."""
LAST_S = 20.0
"""The offset is the median over so long before contact or the end of the flight."""
LANDED_AT_M = 0.05
"""Where a flight that landed is drawn."""


def cases() -> Sequence[Case]:
    """Pilots and courses."""
    return [{"pilot": pilot, "course": course} for pilot, course in product(PILOTS, COURSES)]


def fly(case: Case, speed_mps: float, seed: int) -> dict[str, Any]:
    """One flight; `astern_m` of the deck's neutral centre along the ship's course, `off_m` in any direction."""
    pilot, config, start = PILOTS[str(case["pilot"])]
    course = {"kind": case["course"] if speed_mps > 0.0 else "still", "speed_mps": speed_mps}
    changes = {"ship": {"course": course}, "start": start}
    scenario = load_scenario(merge(scenario_table("under-way", config), changes))
    truths: list[GroundTruth] = []
    flown = fly_quietly(scenario, pilot, "geometric", seed, lambda row: truths.append(row.truth) if row.truth else None)
    end_s = flown.result.t_s if flown.verdict is None else flown.verdict.t_s
    last = [truth for truth in truths if end_s - LAST_S <= truth.t_s <= end_s]
    places_m = [(truth.ned_from_ship.inverse() @ truth.ned_from_body).translation_m for truth in last]
    forward_m, right_m = np.median(places_m, axis=0)[:2].tolist() if last else (None, None)
    return {
        "speed_mps": speed_mps,
        "success": flown.success,
        "landed": flown.verdict is not None and flown.verdict.landed,
        "time_s": end_s,
        "astern_m": -forward_m if last else None,
        "off_m": float(np.hypot(forward_m, right_m)) if last else None,
        "reason": flown.reason,
    }


def measure(case: Case, runs: int) -> Row:
    """Flights with the seeds 1 … runs at every speed; the row keeps each."""
    flights = [fly(case, speed_mps, seed) for speed_mps, seed in product(SPEEDS_MPS, range(1, runs + 1))]
    return {
        "success": share(sum(each["success"] for each in flights), len(flights)),
        "landed": sum(each["landed"] for each in flights) / len(flights),
        "time_s": float(np.median([each["time_s"] for each in flights])),
        "flights": flights,
    }


def picture(rows: Sequence[Row], path: Path) -> None:
    """Over speed: who landed, in a row at the bottom, and how far off the others stayed."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(PILOTS), figsize=(4.2 * len(PILOTS), 3.4), sharey=True, layout="constrained")
    for row in rows:
        index, axis = COURSES.index(row["course"]), axes[list(PILOTS).index(row["pilot"])]
        for landed, mark, word in ((True, "o", "landed"), (False, "x", "did not")):
            some = [each for each in row["flights"] if each["landed"] == landed]
            speeds = [each["speed_mps"] + 0.06 * (index - 1) for each in some]
            off_m = [LANDED_AT_M * 1.3 ** (index - 1) if landed else each["off_m"] or np.nan for each in some]
            axis.plot(speeds, off_m, mark, color=f"C{index}", ms=5, label=f"{row['course']}: {word}")
        axis.set(title=row["pilot"], xlabel="ship's speed [m/s]", yscale="log", ylim=(0.6 * LANDED_AT_M, 600.0))
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_ylabel("off at the end [m]; landed: below")
    axes[-1].legend(fontsize=7)
    figure.savefig(path, dpi=90)


STUDY = Study(
    question="Who lands on a ship under way?",
    columns={
        "pilot": Column("pilot"),
        "course": Column("course"),
        "success": Column("in the square [%] (95 % interval)", ".0f", 100.0),
        "landed": Column("on the deck [%]", ".0f", 100.0),
        "time_s": Column("time, median [s]", ".0f"),
    },
    cases=cases,
    measure=measure,
    runs=1,
    measured=("estimation", "flight.py", "geometric", "guidance", "safety", "scenario", "sim"),
    minutes=20,
    picture=picture,
)
