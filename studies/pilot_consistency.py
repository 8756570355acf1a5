"""Whether `horizon` knows what it does not know: errors of its estimate, squared, over what it states, in flight.

Errors of place are those at each picture's exposure, against the truth of that instant; a flight's errors follow each
other closely, so that a flight counts once: its mean over the approach and the way down.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipland.frames import Array, euler_from_rotation
from shipland.messages import FlightRecord, Mode
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario
from shipland.statistics import Interval
from studies.harness import Case, Column, Row, Study, estimate

SCENARIOS = ("rig-natops", "ship-sea6")
AXES = ("forward", "right", "down", "yaw")
NEAREST_M = 0.3
"""Lower over the deck than this a flight no longer counts: ground effect and contact."""
NEAR_M = 3.0
"""Range of the bar over the deck."""


def errors_of(name: str, seed: int) -> Array:
    """(n,9): errors [m, m, m, rad], their stated variances, and the range of the bar [m]."""
    scenario = load_scenario(name)
    truths: list[list[float]] = []
    stated: list[list[float]] = []

    def on_cycle(record: FlightRecord) -> None:
        truth, estimated = record.truth, record.decision.estimate
        if truth is None:
            return
        yaw_rad = euler_from_rotation((truth.ned_from_bar.inverse() @ truth.ned_from_body).rotation)[2]
        truths.append([truth.t_s, *truth.aircraft_in_bar_m, yaw_rad])
        flown = record.decision.mode in (Mode.APPROACH, Mode.LAND)
        high = float(scenario.rig.deck_in_bar_m[2] - truth.aircraft_in_bar_m[2]) > NEAREST_M
        if estimated is not None and estimated.covariance is not None and flown and high:
            place = [*estimated.aircraft_in_bar_m, estimated.yaw_rad]
            stated.append([estimated.t_s, *place, *np.diag(estimated.covariance)])

    fly_quietly(scenario, "horizon", "geometric", seed, on_cycle)
    truth, told = np.array(truths), np.array(stated).reshape(-1, 9)
    errors = np.column_stack([told[:, 1 + k] - np.interp(told[:, 0], truth[:, 0], truth[:, 1 + k]) for k in range(4)])
    return np.hstack([errors, told[:, 5:], np.linalg.norm(told[:, 1:4], axis=1)[:, None]])


def cases() -> Sequence[Case]:
    """Scenarios."""
    return [{"scenario": name} for name in SCENARIOS]


def measure(case: Case, runs: int) -> list[Row]:
    """Flights with the seeds 1 … runs; a row for each axis, over the deck and farther off."""
    flights = [errors_of(str(case["scenario"]), seed) for seed in range(1, runs + 1)]
    rows = []
    for where, near in ((f"to {NEAR_M:g} m", True), ("beyond", False)):
        parts = [part for flight in flights if len(part := flight[(flight[:, 8] < NEAR_M) == near])]
        for k, axis in enumerate(AXES):
            unit = float(np.degrees(1.0)) if axis == "yaw" else 100.0
            ratios = [float(np.mean(part[:, k] ** 2 / part[:, 4 + k])) for part in parts]
            mean, half = float(np.mean(ratios)), 1.96 * float(np.std(ratios, ddof=1)) / len(ratios) ** 0.5
            error2, variance = [np.mean(part[:, k] ** 2) for part in parts], [np.mean(part[:, 4 + k]) for part in parts]
            rows.append(
                {
                    "range": where,
                    "axis": f"{axis} [{'°' if axis == 'yaw' else 'cm'}]",
                    "flights": len(parts),
                    "rms": unit * float(np.mean(error2)) ** 0.5,
                    "stated": unit * float(np.mean(variance)) ** 0.5,
                    "ratio": estimate(mean, Interval(mean - half, mean + half)),
                }
            )
    return rows


STUDY = Study(
    question="Is the covariance true that the pilot states in flight?",
    columns={
        "scenario": Column("scenario"),
        "range": Column("from the bar"),
        "axis": Column("of"),
        "flights": Column("flights", "d"),
        "rms": Column("rms error", ".2f"),
        "stated": Column("stated", ".2f"),
        "ratio": Column("error² / variance (95 % interval)", ".2f"),
    },
    cases=cases,
    measure=measure,
    runs=100,
    minutes=3,
)
