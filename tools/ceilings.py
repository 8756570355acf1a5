"""What a perfect aircraft would score, scenario by scenario: no pilot, no flight, only the ship's motion.

python tools/ceilings.py [--motions 60] [--scenarios rig-sea6 ship-sea6 …]
python tools/ceilings.py --sweep     # wave direction, scale, time rule, point on the ship, in sea state 6
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from shipland.evaluation.ceiling import ceiling
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.sim.ship.ship import ShipParameters

SCENARIOS = ("rig-natops", "rig-sea6", "ship-natops", "ship-sea5", "ship-sea6")
SEED = 1
MIDSHIPS_M = (0.0, 0.0, -6.0)


def sweep(base: ShipParameters) -> dict[str, ShipParameters]:
    """Settings of sea state 6, by their names."""
    rows: dict[str, ShipParameters] = {}
    for full_ship, where in ((False, "rig"), (True, "ship")):
        ship = replace(base, full_ship=full_ship)
        for from_deg in (60.0, 120.0):
            turned = replace(ship, sea=replace(ship.sea, waves_from_deg=from_deg))
            rows[f"{where}, {from_deg:.0f}°"] = turned
            rows[f"{where}, {from_deg:.0f}°, scale 11.5"] = replace(turned, scale=replace(ship.scale, length=11.5))
            rows[f"{where}, {from_deg:.0f}°, lengths only"] = replace(
                turned, scale=replace(ship.scale, time="length_only")
            )
            midships = replace(turned, sea=replace(turned.sea, flight_deck_m=MIDSHIPS_M))
            rows[f"{where}, {from_deg:.0f}°, midships"] = midships
            rows[f"{where}, {from_deg:.0f}°, midships, scale 11.5"] = replace(
                midships, scale=replace(ship.scale, length=11.5)
            )
    return rows


def row(name: str, scenario: Scenario, ship: ShipParameters, motions: int) -> str:
    """One line of the table."""
    found = ceiling(ship, scenario.rig, scenario.aircraft.airframe, motions, np.random.default_rng(SEED))
    low, high = found.interval
    forward_m, starboard_m = found.deviation_m
    return (
        f"| {name} | {100.0 * found.share:.1f} % | {100.0 * low:.1f}–{100.0 * high:.1f} % | {found.sway_m:.3f} "
        f"| {forward_m:.3f} | {starboard_m:.3f} |"
    )


def main() -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=60)
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS, metavar="NAME")
    parser.add_argument("--sweep", action="store_true")
    asked = parser.parse_args()
    print("| setting | ceiling | 95 % interval | sway rms [m] | perfect touchdown rms, forward [m] | starboard [m] |")
    print("|---|---:|---:|---:|---:|---:|")
    if asked.sweep:
        scenario = load_scenario(scenario_table("rig-sea6"))
        for name, ship in sweep(scenario.ship).items():
            print(row(name, scenario, ship, asked.motions), flush=True)
        return
    for name in asked.scenarios:
        scenario = load_scenario(scenario_table(name))
        print(row(name, scenario, scenario.ship, asked.motions), flush=True)


if __name__ == "__main__":
    main()
