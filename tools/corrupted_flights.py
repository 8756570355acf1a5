"""Flights with spoiled data: no exception, no stick step beyond the slew bound, control regained within 2 s.

python tools/corrupted_flights.py 1000 [--pilot paper] [--scenario rig-natops] [--first 1]
"""

from __future__ import annotations

import argparse
import math
import sys
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from shipland.flight import fly
from shipland.frames import Array
from shipland.messages import FlightRecord, PilotCommand
from shipland.missions.corruption import Burst, Corruptor, draw_bursts
from shipland.missions.crew import build_crew, build_vehicle
from shipland.missions.scenarios import Scenario, load_scenario

LENGTH_S = 16.0
BURSTS = 2
REGAINED_S = 2.0
GAP_S = 0.5
TRUE_M = 0.5
"""An estimate this near to the truth counts as control regained."""


@dataclass(frozen=True)
class Outcome:
    """One flight.

    Attributes:
        over_slew_percent: worst stick step beyond the slew bound, by the loop's clock.
        over_slew_true_percent: likewise by the vehicle's true clock, which the loop does not know while times are bad.
        regained_s: how long each burst was felt after its end.
        highest_percent: largest stick.
    """

    over_slew_percent: float
    over_slew_true_percent: float
    regained_s: tuple[float, ...]
    highest_percent: float


def flown(scenario: Scenario, pilot: str, seed: int) -> Outcome:
    """Fly one seed with spoiled data."""
    rng = np.random.default_rng([seed, 20])
    bursts = draw_bursts(rng, LENGTH_S - REGAINED_S - 3.0, BURSTS)
    vehicle = build_vehicle(scenario, seed, None)
    crew = build_crew(scenario, vehicle, pilot, "geometric", seed)
    liar = Corruptor(vehicle, crew.vision, bursts, rng)
    records: list[FlightRecord] = []
    times_s: list[float] = []

    def on_cycle(record: FlightRecord) -> None:
        records.append(record)
        times_s.append(liar.true_s)

    fly(liar, replace(crew, vision=liar), LENGTH_S, lambda: 0.0, on_cycle)
    commands = [record.decision.command for record in records]
    slew = scenario.safety.slew_percent_per_s
    by_loop = over_slew(commands, [command.t_s for command in commands], slew)
    highest = max((float(np.max(np.abs(sticks(command)))) for command in commands), default=0.0)
    found = tuple(regained(records, times_s, bursts))
    return Outcome(by_loop, over_slew(commands, times_s, slew), found, highest)


def over_slew(commands: list[PilotCommand], times_s: list[float], slew_percent_per_s: float) -> float:
    """The largest step of a stick beyond the bound [percent]."""
    worst = 0.0
    for (before, after), (first_s, second_s) in zip(pairwise(commands), pairwise(times_s), strict=True):
        step = np.abs(sticks(after) - sticks(before))
        worst = max(worst, float(np.max(step)) - slew_percent_per_s * (second_s - first_s))
    return worst


def sticks(command: PilotCommand) -> Array:
    """(4,) of a command [percent]."""
    return np.array([command.pitch_percent, command.roll_percent, command.heave_percent, command.yaw_percent])


def regained(records: list[FlightRecord], times_s: list[float], bursts: tuple[Burst, ...]) -> list[float]:
    """Of each burst: from its end and the first clean picture of the bar on, until the pilot's place is true [s].

    Left out are bursts that another follows within the two seconds, or the flight's end, and those after which the bar
    does not stay in the picture: there the pilot has nothing to see it by.
    """
    found = []
    for burst in bursts:
        window_s = burst.to_s + REGAINED_S
        if any(other.from_s < window_s + 1.0 and other.to_s > burst.to_s for other in bursts if other is not burst):
            continue
        after = [(t_s, record) for t_s, record in zip(times_s, records, strict=True) if t_s >= burst.to_s]
        seen = [t_s for t_s, record in after if record.observation.bar_pose is not None]
        if not seen or times_s[-1] < seen[0] + REGAINED_S:
            continue
        in_view_s = [t_s for t_s in seen if t_s <= seen[0] + REGAINED_S]
        if np.max(np.diff([*in_view_s, seen[0] + REGAINED_S])) > GAP_S:
            continue
        true_s = next((t_s for t_s, record in after if t_s >= seen[0] and is_true(record, records)), math.inf)
        found.append(true_s - seen[0])
    return found


def is_true(record: FlightRecord, records: list[FlightRecord]) -> bool:
    """Whether the pilot's estimate is near the truth of its time."""
    estimate = record.decision.estimate
    truths = [item.truth for item in records if item.truth is not None]
    if estimate is None or not truths:
        return False
    nearest = min(truths, key=lambda truth: abs(truth.t_s - estimate.t_s))
    if abs(nearest.t_s - estimate.t_s) > 0.1:
        return False
    return float(np.linalg.norm(nearest.aircraft_in_bar_m - estimate.aircraft_in_bar_m)) < TRUE_M


def main() -> None:
    """Fly them and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("flights", type=int)
    parser.add_argument("--pilot", default="paper")
    parser.add_argument("--scenario", default="rig-natops")
    parser.add_argument("--first", type=int, default=1)
    request = parser.parse_args()
    scenario = load_scenario(request.scenario)
    outcomes = []
    with suppress(KeyboardInterrupt):  # what was flown so far is told
        for seed in range(request.first, request.first + request.flights):
            outcomes.append(flown(scenario, request.pilot, seed))
            print(f"\r{len(outcomes)} of {request.flights}", end="", file=sys.stderr, flush=True)
    if not outcomes:
        return
    times_s = np.array([t_s for outcome in outcomes for t_s in outcome.regained_s])
    late = int((times_s > REGAINED_S).sum())
    over, over_true = (
        max(getattr(outcome, name) for outcome in outcomes) for name in ("over_slew_percent", "over_slew_true_percent")
    )
    print(
        f"\n{len(outcomes)} flights, no exception; largest stick {max(o.highest_percent for o in outcomes):.1f} %; "
        f"largest step beyond the slew bound {over:.2g} % by the loop's clock, {over_true:.2g} % by the true one; "
        f"control regained after {len(times_s)} bursts: median {np.median(times_s):.2f} s, largest "
        f"{times_s.max(initial=0.0):.2f} s, {late} later than {REGAINED_S:g} s"
    )


if __name__ == "__main__":
    main()
