"""What an aircraft without error would score: no pilot, no flight, only the ship's motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shipland.evaluation.oracle import oracle_rate
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.ship.ship import ShipParameters
from studies.harness import Case, Column, Row, Study, estimate

SCENARIOS = ("rig-natops", "rig-sea6", "ship-natops", "ship-sea5", "ship-sea6")
SEED = 1
MIDSHIPS_M = (0.0, 0.0, -6.0)


def sweep(base: ShipParameters) -> dict[str, ShipParameters]:
    """Settings of sea state 6, by their names."""
    rows: dict[str, ShipParameters] = {}
    for full_ship, where in ((False, "rig"), (True, "ship")):
        ship = replace(base, full_ship=full_ship)
        smaller, lengths = replace(ship.scale, length=11.5), replace(ship.scale, time="length_only")
        for from_deg in (60.0, 120.0):
            name, turned = f"{where}, {from_deg:.0f}°", replace(ship, sea=replace(ship.sea, waves_from_deg=from_deg))
            midships = replace(turned, sea=replace(turned.sea, flight_deck_m=MIDSHIPS_M))
            rows[name] = turned
            rows[f"{name}, scale 11.5"] = replace(turned, scale=smaller)
            rows[f"{name}, lengths only"] = replace(turned, scale=lengths)
            rows[f"{name}, midships"] = midships
            rows[f"{name}, midships, scale 11.5"] = replace(midships, scale=smaller)
    return rows


def cases() -> Sequence[Case]:
    """The scenarios as they are, then the sweep."""
    settings = sweep(load_scenario(scenario_table("rig-sea6")).ship)
    return [
        *({"group": "scenarios", "setting": name} for name in SCENARIOS),
        *({"group": "sweep", "setting": name} for name in settings),
    ]


def measure(case: Case, runs: int) -> Row:
    """The oracle rate over `runs` motions."""
    swept, setting = case["group"] == "sweep", str(case["setting"])
    scenario = load_scenario(scenario_table("rig-sea6" if swept else setting))
    ship = sweep(scenario.ship)[setting] if swept else scenario.ship
    found = oracle_rate(ship, scenario.rig, scenario.aircraft.airframe, runs, np.random.default_rng(SEED))
    forward_m, starboard_m = found.deviation_m
    return {
        "oracle_rate": estimate(found.share, found.interval),
        "sway_m": found.sway_m,
        "forward_m": float(forward_m),
        "starboard_m": float(starboard_m),
    }


STUDY = Study(
    question="How often would an aircraft without error land in the square?",
    columns={
        "setting": Column("setting"),
        "oracle_rate": Column("oracle rate [%] (95 % interval)", ".1f", 100.0),
        "sway_m": Column("sway rms [m]", ".3f"),
        "forward_m": Column("oracle touchdown rms, forward [m]", ".3f"),
        "starboard_m": Column("starboard [m]", ".3f"),
    },
    cases=cases,
    measure=measure,
    runs=40,
    minutes=3,
)
