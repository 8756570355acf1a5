"""Whether `horizon` knows what it does not know: errors of its estimate, squared, over what it states, in flight.

    python tools/pilot_consistency.py --out out/pilot_consistency     # 200 flights, two scenarios

Errors of place are those at each picture's exposure, against the truth of that instant; a flight's errors follow each
other closely, so that a flight counts once: its mean over the approach and the way down. Leaves table.md.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import tyro
from rich.progress import track

from shipland.frames import Array, euler_from_rotation
from shipland.messages import FlightRecord, Mode
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario

AXES = ("forward", "right", "down", "yaw")
NEAREST_M = 0.3
"""Lower over the deck than this a flight no longer counts: ground effect and contact."""
NEAR_M = 3.0
"""Range of the bar over the deck."""


def errors_of(job: tuple[str, int]) -> tuple[str, Array]:
    """Scenario and (n,9): errors [m, m, m, rad], their stated variances, and the range of the bar [m]."""
    name, seed = job
    scenario = load_scenario(name)
    truths: list[list[float]] = []
    stated: list[list[float]] = []

    def on_cycle(record: FlightRecord) -> None:
        truth, estimate = record.truth, record.decision.estimate
        if truth is None:
            return
        bar_from_body = truth.ned_from_bar.inverse() @ truth.ned_from_body
        yaw_rad = euler_from_rotation(bar_from_body.rotation)[2]
        truths.append([truth.t_s, *truth.aircraft_in_bar_m, yaw_rad])
        flown = record.decision.mode in (Mode.APPROACH, Mode.LAND)
        high = float(scenario.rig.deck_in_bar_m[2] - truth.aircraft_in_bar_m[2]) > NEAREST_M
        if estimate is None or estimate.covariance is None or not (flown and high):
            return
        stated.append([estimate.t_s, *estimate.aircraft_in_bar_m, estimate.yaw_rad, *np.diag(estimate.covariance)])

    fly_quietly(scenario, "horizon", "geometric", seed, on_cycle)
    truth, told = np.array(truths), np.array(stated).reshape(-1, 9)
    errors = np.column_stack([told[:, 1 + k] - np.interp(told[:, 0], truth[:, 0], truth[:, 1 + k]) for k in range(4)])
    return name, np.hstack([errors, told[:, 5:], np.linalg.norm(told[:, 1:4], axis=1)[:, None]])


def table_of(flights: dict[str, list[Array]]) -> str:
    """Markdown: root mean square error, stated deviation, and the mean of error² over variance with its interval."""

    def parts(rows: Array) -> tuple[Array, Array]:
        near = rows[:, 8] < NEAR_M
        return rows[near], rows[~near]

    lines = [
        "| scenario | of | flights | rms error | stated | error² / variance | 95 % interval |",
        "|---|---|" + "---:|" * 5,
    ]
    groups = {}
    for name, each in flights.items():
        near, far = zip(*map(parts, each), strict=True)
        groups[f"{name}, to {NEAR_M:g} m"] = [rows for rows in near if len(rows)]
        groups[f"{name}, beyond"] = [rows for rows in far if len(rows)]
    for name, each in groups.items():
        for k, axis in enumerate(AXES):
            error2 = np.array([np.mean(rows[:, k] ** 2) for rows in each])
            variance = np.array([np.mean(rows[:, 4 + k]) for rows in each])
            ratio = np.array([np.mean(rows[:, k] ** 2 / rows[:, 4 + k]) for rows in each])
            half = 1.96 * ratio.std(ddof=1) / np.sqrt(len(ratio))
            size, unit = (np.degrees(1.0), "°") if axis == "yaw" else (100.0, "cm")
            lines.append(
                f"| {name} | {axis} | {len(each)} | {size * np.sqrt(error2.mean()):.2f} {unit} "
                f"| {size * np.sqrt(variance.mean()):.2f} {unit} | {ratio.mean():.2f} "
                f"| {ratio.mean() - half:.2f}–{ratio.mean() + half:.2f} |"
            )
    return "\n".join(lines) + "\n"


def main(
    out: Path = Path("out/pilot_consistency"),
    scenarios: tuple[str, ...] = ("rig-natops", "ship-sea6"),
    runs: int = 100,
    workers: int = 2,
) -> None:
    """Fly and write the table."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    jobs = [(name, seed) for name in scenarios for seed in range(1, runs + 1)]
    flights: dict[str, list[Array]] = {name: [] for name in scenarios}
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for name, rows in track(pool.map(errors_of, jobs, chunksize=4), "flights", total=len(jobs)):
            if len(rows):
                flights[name].append(rows)
    out.mkdir(parents=True, exist_ok=True)
    text = table_of(flights)
    (out / "table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    tyro.cli(main)
