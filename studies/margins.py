"""What a pilot loses that was told a wrong response of its vehicle: latencies, lags, what full sticks mean.

The aircraft stays the same; what the pilot takes it for is changed, one figure at a time. The same seeds in every row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from shipland.guidance.pilot import Pilot, PilotSetup, horizon, learned, residual
from shipland.guidance.response import Response
from shipland.messages import FlightRecord
from shipland.scenario.fly import Flown, fly_quietly
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
    "speed of full sticks × 0.8": lambda told: _scaled(told, max_speed_mps=0.8),
    "speed of full sticks × 1.25": lambda told: _scaled(told, max_speed_mps=1.25),
    "servo × 0.7": lambda told: _scaled(told, servo_per_s=0.7),
    "servo × 1.4": lambda told: _scaled(told, servo_per_s=1.4),
    "approach × 0.7": lambda told: _scaled(told, approach_per_s=0.7),
    "approach × 1.4": lambda told: _scaled(told, approach_per_s=1.4),
}
"""Name: from the response as it is to the one that the pilot is told."""

_LAST_S = 8.0
"""Before contact, in which the standard deviation of pitch and roll stick is taken."""
PILOTS = {"horizon": horizon, "residual": residual, "learned": learned}
SCENARIOS = ("rig-natops", "ship-sea6")
TILT = tuple(told for told in TOLD if not told.startswith(("speed of", "servo", "approach")))
SPEED = tuple(told for told in TOLD if not told.startswith(("tilt of", "drag")))
GAIN_BELIEVED = "the sticks' gain is not found in flight"
_SPEED_STICKS = {"aircraft.loop.kind": "velocity", "delays.telemetry.profile": "mavlink"}
_OF_TILTS = {"guidance.horizon.weights_servo.acceleration": 0.0015, "guidance.horizon.weights_servo.input_rate": 3e-6}
SET: dict[str, dict[str, Any]] = {
    "as in the scenario": {},
    GAIN_BELIEVED: {"guidance.horizon.gain.deviation": 0.0},
    "9 m/s": {"wind.mean_mps": 9.0},
    "speed sticks": _SPEED_STICKS,
    "speed sticks, weights of tilts": _SPEED_STICKS | _OF_TILTS,
}
SETTINGS = (
    *(("horizon", name, "as in the scenario", told) for name, told in product(SCENARIOS, TILT)),
    *(
        ("horizon", name, sticks, told)
        for sticks, name, told in product(("speed sticks", "speed sticks, weights of tilts"), SCENARIOS, SPEED)
    ),
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
    flown, swings_percent = list[Flown](), list[float]()
    for seed in range(1, runs + 1):
        sticks = list[tuple[float, ...]]()
        flown.append(fly_quietly(scenario, pilot, "geometric", seed, partial(_remember, sticks)))
        rows, verdict = np.array(sticks), flown[-1].verdict
        before_s = (rows[-1, 0] if verdict is None else verdict.t_s) - rows[:, 0]
        swings_percent.append(float(np.hypot(*rows[(before_s > 0.0) & (before_s < _LAST_S), 1:].std(axis=0))))
    touched = [each.verdict.touchdown_in_deck_m for each in flown if each.verdict is not None]
    errors_m = [float(np.hypot(*place_m)) for place_m in touched if np.isfinite(place_m).all()]
    return {
        "success": share(sum(each.success for each in flown), runs),
        "error_m": float(np.median(errors_m)) if errors_m else None,
        "swing_percent": float(np.mean(swings_percent)),
    }


def _remember(sticks: list[tuple[float, ...]], record: FlightRecord) -> None:
    """Keep time, pitch and roll stick of a cycle."""
    command = record.decision.command
    sticks.append((command.t_s, command.pitch_percent, command.roll_percent))


STUDY = Study(
    question="What does a pilot lose that was told a wrong response of its vehicle?",
    columns={
        "pilot": Column("pilot"),
        "scenario": Column("scenario"),
        "set": Column("set"),
        "told": Column("the pilot is told"),
        "success": Column("success [%] (95 % interval)", ".0f", 100.0),
        "error_m": Column("error median [cm]", ".1f", 100.0),
        "swing_percent": Column("sticks' swing [%]", ".1f"),
    },
    cases=cases,
    measure=measure,
    runs=30,
    minutes=30,
)
