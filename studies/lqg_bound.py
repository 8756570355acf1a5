"""How still the pilot `horizon` can hover over a deck, by its own model: estimate and control together, no flight.

For one horizontal axis of a vehicle whose sticks mean a tilt: the standard deviation of the offset from the deck's
centre under the pilot's gains, when gusts and wave motion are what the model takes them for. Without costs of
acceleration and stick rate it is the bound of linear quadratic Gaussian control.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipland.estimation.relative_state import POSITION, STATES, WAVE, Model, updated
from shipland.estimation.wave_motion import WaveMotion
from shipland.frames import Array
from shipland.guidance.horizon.assumptions import motion_of
from shipland.guidance.horizon.gains import gains_of
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.response import Response
from shipland.scenario.autonomy import response_of
from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study

SCENARIO = "ship-sea6"
"""Whose vehicle flies, with its delays."""
STEP_MS = 33
PLACE_M = 0.005
"""Standard deviation of a picture's place near the bar."""
VELOCITY_EVERY = 6
"""Pictures for one velocity: 5 Hz."""
FREE = {"acceleration": 1e-5, "input_rate": 1e-8}


@dataclass(frozen=True)
class Axis:
    """A sea and an air: swing of the bar [m], share of it that the deck has, acceleration by gusts [m/s²]."""

    name: str
    wave_m: float
    deck: float
    gust_mps2: float


AXES = (
    Axis("bar at rest, 5 m/s over land", 0.003, 0.0, 0.3),
    Axis("bar at rest, 9 m/s over land", 0.003, 0.0, 1.4),
    Axis("bar at rest, 9 m/s over the sea", 0.003, 0.0, 0.4),
    Axis("sea state 5, surge", 0.015, 0.7, 0.15),
    Axis("sea state 5, sway", 0.098, 0.7, 0.15),
    Axis("sea state 6, surge", 0.03, 0.7, 0.15),
    Axis("sea state 6, sway", 0.147, 0.7, 0.15),
    Axis("sea state 6, sway, 9 m/s", 0.147, 0.7, 0.4),
)


def hover_m(axis: Axis, horizon: HorizonParameters, response: Response, delay_s: float, free: bool) -> float:
    """Standard deviation of the offset from the deck's centre.

    Args:
        axis: what moves.
        horizon: the pilot's parameters.
        response: of the vehicle.
        delay_s: from a picture's exposure to the first answer to it.
        free: acceleration and stick cost next to nothing.
    """
    noise = replace(horizon.horizontal_at(axis.gust_mps2), gust_mps2=axis.gust_mps2)
    wave = WaveMotion(axis.wave_m, 2.1, horizon.wave.damping, True, (axis.deck, 0.0, 0.0, 0.0))
    model = Model(1, motion_of(response), noise, wave)
    estimate = model.start(0.0, np.zeros(1), 0.01 * np.eye(1), 0.5)
    for index in range(900):
        estimate = model.predicted(estimate, STEP_MS, np.zeros(model.motion.inputs))
        estimate = updated(estimate, model.pose(estimate), np.zeros(1), PLACE_M**2 * np.eye(1))[0]
        if index % VELOCITY_EVERY == 0:
            velocity = model.velocity(estimate, 0.5, horizon.delayed.flow_settle_s)
            estimate = updated(estimate, velocity, np.zeros(1), horizon.measured.velocity_mps**2 * np.eye(1))[0]
    error = model.predicted(estimate, round(1e3 * delay_s), np.zeros(model.motion.inputs)).covariance
    transition, inputs, spread = model.step(STEP_MS)
    weights = replace(horizon.weights, **FREE) if free else horizon.weights
    closed = np.eye(STATES + 1)
    closed[:STATES, :STATES], closed[:STATES, STATES] = transition, inputs[:, 0]
    entry = np.append(inputs[:, 0], 1.0)
    closed -= np.outer(entry, gains_of(model.motion, noise, wave, weights, STEP_MS).steady)
    news: Array = np.zeros((STATES + 1, STATES + 1))
    news[:STATES, :STATES] = transition @ error @ transition.T + spread - error
    state = news.copy()
    for _ in range(3000):
        state = closed @ state @ closed.T + news
    state[:STATES, :STATES] += error
    offset = np.zeros(STATES + 1)
    offset[[POSITION, WAVE]] = 1.0, -axis.deck
    return math.sqrt(float(offset @ state @ offset))


def cases() -> Sequence[Case]:
    """What moves."""
    return [{"axis": axis.name} for axis in AXES]


def measure(case: Case, _runs: int) -> Row:
    """One axis; the model needs no repetition."""
    axis = next(each for each in AXES if each.name == case["axis"])
    loaded = load_scenario(SCENARIO)
    horizon, response, delays = loaded.guidance.horizon, response_of(loaded), loaded.delays
    delay_s = delays.video_s + delays.near_s + response.uplink_s + response.dead_time_s
    return {
        "gains_m": hover_m(axis, horizon, response, delay_s, free=False),
        "bound_m": hover_m(axis, horizon, response, delay_s, free=True),
        "half_delay_m": hover_m(axis, horizon, response, 0.5 * delay_s, free=True),
    }


STUDY = Study(
    question="How still can the pilot hover over the deck, by its own model?",
    columns={
        "axis": Column("one axis, offset from the deck's centre [cm]"),
        "gains_m": Column("the pilot's gains", ".1f", 100.0),
        "bound_m": Column("no caution (LQG bound)", ".1f", 100.0),
        "half_delay_m": Column("no caution, half the delay", ".1f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=1,
    measured=("estimation", "guidance/horizon", "guidance/response.py", "scenario/autonomy.py"),
    minutes=1,
)
