"""What a pilot loses that was told a wrong response of its vehicle: latencies, lags, what full sticks mean.

The aircraft stays the same; what the pilot takes it for is changed, one figure at a time. The same seeds in every row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from shipland.guidance.pilot import Pilot, PilotSetup, horizon, learned, residual
from shipland.guidance.response import Response
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study, share


def _scaled(response: Response, **by: float) -> Response:
    return replace(response, **{name: getattr(response, name) * factor for name, factor in by.items()})


TIMES = ("lag_s", "dead_time_s", "climb_lag_s", "climb_dead_time_s", "turn_lag_s")
TOLD = {
    "as it is": lambda told: told,
    "commands 66 ms later": lambda told: replace(told, uplink_s=told.uplink_s + 0.066),
    "commands 25 ms sooner": lambda told: replace(told, uplink_s=max(told.uplink_s - 0.025, 0.0)),
    "time constants × 0.7": lambda told: _scaled(told, **dict.fromkeys(TIMES, 0.7)),
    "time constants × 1.4": lambda told: _scaled(told, **dict.fromkeys(TIMES, 1.4)),
    "tilt of full sticks × 0.8": lambda told: _scaled(told, max_tilt_rad=0.8),
    "tilt of full sticks × 1.25": lambda told: _scaled(told, max_tilt_rad=1.25),
    "drag × 0.5": lambda told: _scaled(told, drag_per_s=0.5),
    "drag × 2": lambda told: _scaled(told, drag_per_s=2.0),
    "climb of full sticks × 0.8": lambda told: _scaled(told, max_climb_mps=0.8),
    "climb of full sticks × 1.25": lambda told: _scaled(told, max_climb_mps=1.25),
}
"""Name: from the response as it is to the one that the pilot is told."""

PILOTS = {"horizon": horizon, "residual": residual, "learned": learned}
SCENARIOS = ("rig-natops", "ship-sea6")
GAIN_BELIEVED = "the sticks' gain is not found in flight"
SET: dict[str, dict[str, float]] = {
    "as in the scenario": {},
    GAIN_BELIEVED: {"guidance.horizon.gain.deviation": 0.0},
    "9 m/s": {"wind.mean_mps": 9.0},
}
SETTINGS = (
    *(("horizon", name, "as in the scenario", told) for name, told in product(SCENARIOS, TOLD)),
    *(
        ("horizon", name, GAIN_BELIEVED, told)
        for name, told in product(SCENARIOS, ("as it is", "tilt of full sticks × 0.8", "tilt of full sticks × 1.25"))
    ),
    *(
        (pilot, name, "9 m/s", told)
        for pilot, name, told in product(
            ("horizon", "residual"), SCENARIOS, ("time constants × 0.7", "time constants × 1.4")
        )
    ),
)
"""Pilot, scenario, what is set beside, what the pilot is told."""


def _pilot(setup: PilotSetup, name: str, told: str) -> Pilot:
    return PILOTS[name](replace(setup, response=TOLD[told](setup.response)))


def cases() -> Sequence[Case]:
    """All told vehicles to `horizon`, a gain also without its bank; wrong time constants to two pilots in more wind."""
    return [dict(zip(("pilot", "scenario", "set", "told"), setting, strict=True)) for setting in SETTINGS]


def measure(case: Case, runs: int) -> Row:
    """Flights with the seeds 1 … runs."""
    scenario = load_scenario(str(case["scenario"]), **SET[str(case["set"])])
    pilot = partial(_pilot, name=str(case["pilot"]), told=str(case["told"]))
    flown = [fly_quietly(scenario, pilot, "geometric", seed) for seed in range(1, runs + 1)]
    touched = [each.verdict.touchdown_in_deck_m for each in flown if each.verdict is not None]
    errors_m = [float(np.hypot(*place_m)) for place_m in touched if np.isfinite(place_m).all()]
    return {
        "success": share(sum(each.success for each in flown), runs),
        "error_m": float(np.median(errors_m)) if errors_m else None,
    }


STUDY = Study(
    question="What does a pilot lose that was told a wrong response of its vehicle?",
    columns={
        "pilot": Column("pilot"),
        "scenario": Column("scenario"),
        "set": Column("set"),
        "told": Column("the pilot is told"),
        "success": Column("success [%] (95 % interval)", ".0f", 100.0),
        "error_m": Column("error median [cm]", ".1f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=30,
    minutes=30,
)
