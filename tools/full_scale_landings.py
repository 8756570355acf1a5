"""Landings at full scale, a line a cell: what the documentation's tables hold, in metres.

python tools/full_scale_landings.py out/frigate [out/lull …] [--runs 40]
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from shipland.evaluation.campaign import CellResult, read_cells
from shipland.evaluation.leaderboard import oracle_rates_of, rests_in_area
from shipland.evaluation.statistics import share_interval


def line(cell: CellResult, runs: int, rate: float) -> str:
    """One line of the table, of the flights with seeds up to `runs`."""
    landings = [it for it in cell.landings if it.seed <= runs]
    touched = [it for it in landings if it.touched]
    n, good = len(landings), sum(it.success for it in landings)
    low, high = share_interval(good, n)
    error_m = np.array([it.error_m for it in touched])
    own_m = np.array([np.hypot(it.control_forward_m, it.control_starboard_m) for it in touched])
    causes = Counter(it.cause for it in landings if it.cause)
    settings = ", ".join(f"{key.split('.')[-1]} {value}" for key, value in cell.settings)
    name = cell.scenario if not settings else f"{cell.scenario}, {settings}"
    parts = [
        name,
        str(n),
        f"{good} ({100.0 * good / n:.0f} %)",
        f"{100.0 * low:.1f}–{100.0 * high:.1f} %",
        f"{100.0 * rate:.1f} %",
        str(sum(rests_in_area(it, cell.rig) for it in landings)),
        f"{np.median(error_m):.2f} / {np.quantile(error_m, 0.9):.2f}",
        f"{np.median(own_m):.2f}",
        *(f"{np.median([getattr(it, key) for it in touched]):.2f}" for key in ("sink_mps", "slide_mps")),
        f"{np.median([it.tilt_deg for it in touched]):.0f}",
        f"{np.median([it.time_s for it in landings]):.0f}",
        ", ".join(f"{count} {cause}" for cause, count in causes.most_common()),
    ]
    return f"| {' | '.join(parts)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--runs", type=int, default=1_000_000, help="only seeds up to this one")
    asked = parser.parse_args()
    print(
        "| cell | flights | landed in the area | 95 % interval | oracle rate | rest in the area "
        "| error, median / 90 % [m] | control error [m] "
        "| sink [m/s] | slide [m/s] | tilt [°] | time [s] | causes of the others |"
    )
    print("|---|" + "---:|" * 11 + "---|")
    for folder in asked.folders:
        cells = read_cells([folder])
        oracle_rates = oracle_rates_of(cells, 60, folder / "oracle_rates.json")
        for cell in cells:
            if cell.landings:
                print(line(cell, asked.runs, oracle_rates[cell.group].share), flush=True)


if __name__ == "__main__":
    main()
