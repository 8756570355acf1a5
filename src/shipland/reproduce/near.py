"""Derivatives of the near law side by side: a hover with one false estimate at 6.5 s.

[Lee2022, §Close-range Tracking Controller]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipland.flight import fly
from shipland.frames import Array
from shipland.guidance.pilot import Pilot
from shipland.messages import Decision, FlightRecord, Frame, Observation, PilotCommand, Telemetry
from shipland.reproduce.ranges import exact_start
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.scenario import load_scenario
from shipland.vision.vision import Vision

FALSE_AT_S = 6.5
"""[Lee2022] names the time, not the size."""
FALSE_M = 0.5
"""To the right, in one frame."""
NOISE_M = 0.005
"""The paper's accuracy, "sub-centimeter", as a standard deviation of each coordinate."""
DURATION_S = 14.0
LAW_STEPS = (-2.0, -1.0, 0.0, 1.0, 2.0, 4.0)
"""Of the error, in standard deviations of the bell, for which the derivative's gain is told."""
SETTLED_S = 3.0
"""Before the false estimate: the span in which the stick's noise is read."""

CONTROLS: dict[str, dict[str, Any]] = {
    "linear D": {"derivative": "linear", "filter": "none"},
    "linear D, Kalman": {"derivative": "linear", "filter": "kalman"},
    "probabilistic D, Kalman": {"derivative": "probabilistic", "filter": "kalman"},
}


@dataclass(frozen=True)
class NearTrace:
    """A hover, at (n,) exposure times.

    Attributes:
        right_m: (n,) true position right of the landing point.
        seen_right_m: (n,) the same as the vision has it, noise and false estimate included; NaN without a pose.
        law_percent, sent_percent: (n,) roll stick of the law, and after the safety's slew bound.
    """

    t_s: Array
    right_m: Array
    seen_right_m: Array
    law_percent: Array
    sent_percent: Array


class Spoiled:
    """Vision with noise added to its poses, and one false estimate."""

    def __init__(self, eyes: Vision, noise_m: float, false_m: float, rng: np.random.Generator) -> None:
        self._eyes, self._noise_m, self._false_m, self._rng = eyes, noise_m, false_m, rng
        self._spoiled = False

    def see(self, frame: Frame) -> Observation:
        """What the eyes see, spoiled."""
        noise_m = self._noise_m * self._rng.normal(size=3)
        seen = self._eyes.see(frame)
        if seen.bar_pose is None:
            return seen
        place_m = seen.bar_pose.position_in_bar_m + noise_m
        if frame.t_s >= FALSE_AT_S and not self._spoiled:
            self._spoiled = True
            place_m = place_m + np.array([0.0, self._false_m, 0.0])
        return replace(seen, bar_pose=replace(seen.bar_pose, position_in_bar_m=place_m))


class Tapped:
    """A pilot with a record of its roll stick before safety."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self.roll_percent: list[float] = []

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """As the pilot."""
        decision = self._pilot.decide(observation, telemetry, sent)
        self.roll_percent.append(decision.command.roll_percent)
        return decision


def fly_hover(near: dict[str, Any], noise_m: float, false_m: float, slew: bool = True) -> NearTrace:
    """From 1.5 m astern and 0.5 m to starboard to the place above the deck, and stay there: it never lands.

    `near` is laid over `[guidance.near]`, noise is added to the vision's own in each coordinate; without `slew` the
    safety's bound does not stand after the law.
    """
    overlay: dict[str, Any] = {
        "ship": {"motion": "still"},
        "wind": {"mean_mps": 0.0, "mean_half_range_mps": 0.0},
        "start": exact_start(1.58, 18.4, 1.2),
        "guidance": {"near": near, "modes": {"settle_s": 1e9}},
        "safety": {} if slew else {"slew_percent_per_s": 1e4},
    }
    scenario = load_scenario("near", **overlay)
    vehicle = build_vehicle(scenario, 1, None)
    autonomy = build_autonomy(scenario, vehicle, "paper", "geometric", 1)
    spoiled = Spoiled(autonomy.vision, noise_m, false_m, np.random.default_rng(1))
    tapped = Tapped(autonomy.pilot)
    autonomy = replace(autonomy, vision=spoiled, pilot=tapped)
    records: list[FlightRecord] = []
    fly(vehicle, autonomy, DURATION_S, lambda: 0.0, records.append)
    middle_m = float(scenario.rig.deck_in_bar_m[1])
    camera_m = np.array(scenario.camera.position_in_body_m)
    rows = []
    for record, law_percent in zip(records, tapped.roll_percent, strict=True):
        if record.truth is None:
            continue
        pose, seen_m = record.observation.bar_pose, np.nan
        if pose is not None:
            seen_m = float(pose.position_in_bar_m[1]) - float(camera_m[0]) * np.sin(pose.yaw_rad) - middle_m
        right_m = float(record.truth.aircraft_in_bar_m[1]) - middle_m
        rows.append((record.frame.t_s, right_m, seen_m, law_percent, record.decision.command.roll_percent))
    return NearTrace(*np.array(rows, dtype=float).T)


@dataclass(frozen=True)
class NearFigures:
    """What a false estimate did.

    Attributes:
        noise_percent: standard deviation of the law's stick from step to step before it, over √2.
        peak_percent: largest stick of the law within half a second of it.
        sent_percent: the same after the safety's slew bound.
        excursion_m: farthest that the aircraft came away from where it would have been without, within 3 s.
    """

    noise_percent: float
    peak_percent: float
    sent_percent: float
    excursion_m: float


def near_figures(spoiled: NearTrace, clean: NearTrace) -> NearFigures:
    """Figures from a flight with the false estimate and the same flight without."""
    before = (spoiled.t_s > FALSE_AT_S - SETTLED_S) & (spoiled.t_s < FALSE_AT_S)
    just_after = (spoiled.t_s >= FALSE_AT_S) & (spoiled.t_s < FALSE_AT_S + 0.5)
    after = (spoiled.t_s >= FALSE_AT_S) & (spoiled.t_s < FALSE_AT_S + 3.0)
    clean_m = np.interp(spoiled.t_s, clean.t_s, clean.right_m)
    return NearFigures(
        noise_percent=float(np.std(np.diff(spoiled.law_percent[before])) / np.sqrt(2.0)),
        peak_percent=float(np.max(np.abs(spoiled.law_percent[just_after]))),
        sent_percent=float(np.max(np.abs(spoiled.sent_percent[just_after]))),
        excursion_m=float(np.max(np.abs(spoiled.right_m - clean_m)[after])),
    )
