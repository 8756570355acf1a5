"""Who obeys a ship that waves off: its red light flashes for twelve seconds, from a moment that differs by flight.

A contact while it is red is counted apart by how long it had been: what had begun to touch, nobody stops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shipland.messages import FlightRecord, Mode
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study, share

FLOWN = (
    *(("rig-natops", pilot) for pilot in ("horizon", "paper", "velocity_matching", "image_servoing", "deck_following")),
    ("ship-sea6", "horizon"),
)
"""Scenario and pilot."""
LASTS_S, FIRST_S, LAST_S = 12.0, 8.0, 24.0
GOLDEN = 0.6180339887498949
SOON_S = 1.0
LIGHT_M = 0.12


def red_s(seed: int) -> tuple[float, float]:
    """From and to, spread evenly over the approach and the landing."""
    begin_s = FIRST_S + (LAST_S - FIRST_S) * (seed * GOLDEN % 1.0)
    return begin_s, begin_s + LASTS_S


def cases() -> Sequence[Case]:
    """Pilots and scenarios, in still air, in which all of them land."""
    return [{"scenario": name, "pilot": pilot} for name, pilot in FLOWN]


def measure(case: Case, runs: int) -> Row:
    """Flights with the seeds 1 … runs, near starts."""
    landing = bad = success = 0
    touched_s: list[float] = []  # after the light's begin, while it is red
    for seed in range(1, runs + 1):
        begin_s, end_s = red_s(seed)
        over = {"rig": {"status_light_m": LIGHT_M}, "ship": {"waves_off_s": [[begin_s, end_s]]}}
        scenario = load_scenario(str(case["scenario"]), wind={"mean_mps": 0.0}, **over)
        records: list[FlightRecord] = []
        flown = fly_quietly(scenario, str(case["pilot"]), "geometric", seed, records.append)
        verdict = flown.verdict
        after_s = verdict.t_s - begin_s if verdict is not None and verdict.touched else math.inf
        if 0.0 <= after_s < LASTS_S:
            touched_s.append(after_s)
        if after_s >= 0.0:
            landing += [it.decision.mode for it in records if it.telemetry.t_s <= begin_s][-1] is Mode.LAND
        bad += verdict is not None and not verdict.landed
        success += flown.success
    return {
        "flights": runs,
        "landing": landing,
        "touched_soon": sum(it < SOON_S for it in touched_s),
        "touched_later": share(sum(it >= SOON_S for it in touched_s), runs),
        "success": share(success, runs),
        "bad": bad,
    }


STUDY = Study(
    question="Who obeys a ship that waves off by its red light?",
    columns={
        "scenario": Column("scenario"),
        "pilot": Column("pilot"),
        "flights": Column("flights", "d"),
        "landing": Column("landing as it turns red", "d"),
        "touched_soon": Column("touched within its first second", "d"),
        "touched_later": Column("touched later while it is red [%] (95 % interval)", ".0f", 100.0),
        "success": Column("in the end in the square [%] (95 % interval)", ".0f", 100.0),
        "bad": Column("bad contact", "d"),
    },
    cases=cases,
    measure=measure,
    runs=60,
    minutes=10,
)
