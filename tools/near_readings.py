"""Fly the near law as printed and with each of its two bounds: what errata 12 and 13 are about.

    python tools/near_readings.py

Geometric camera, scenario `near`, ten seeds each. Prints a table.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shipland.config import merge
from shipland.messages import FlightRecord
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table

SEEDS = range(1, 11)
AXES = ("pitch", "roll", "heave", "yaw")
PRINTED_SUM = {axis: {"integral_band": 1e9} for axis in AXES}
PRINTED_ERROR = {axis: {"error_limit": 1e9} for axis in AXES}
READINGS: dict[str, dict[str, Any]] = {
    "both bounds (the default)": {},
    "whole error, bounded sum": PRINTED_ERROR,
    "bounded error, whole sum": PRINTED_SUM,
    "as printed": merge(PRINTED_ERROR, PRINTED_SUM) | {"derivative": "printed"},
}


def main() -> None:
    """Fly and print."""
    table = scenario_table("near")
    print("| reading | in the square | past the place wanted, median [m] | time to land, median [s] |")
    print("|---|---:|---:|---:|")
    for name, overlay in READINGS.items():
        scenario = load_scenario(merge(table, {"guidance": {"near": overlay}}))
        wanted_m = float(scenario.rig.deck_in_bar_m[0])
        good, past_m, times_s = 0, [], []
        for seed in SEEDS:
            rows: list[FlightRecord] = []
            flown = fly_quietly(scenario, "paper", "geometric", seed, rows.append)
            good += flown.success
            past_m.append(max(row.truth.aircraft_in_bar_m[0] for row in rows if row.truth is not None) - wanted_m)
            if flown.verdict is not None:
                times_s.append(flown.verdict.t_s)
        time = f"{np.median(times_s):.1f}" if times_s else "–"
        print(f"| {name} | {good} of {len(SEEDS)} | {np.median(past_m):.2f} | {time} |", flush=True)


if __name__ == "__main__":
    main()
