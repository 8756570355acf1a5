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

from shipland.estimation.relative_state import POSITION, STATES, VELOCITY, WAVE, GaussianState, Model, dynamics, updated
from shipland.estimation.waves import WaveMotion
from shipland.frames import Array
from shipland.guidance.horizon.assumptions import motion_of
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.regulator import gains_of
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
"""Pictures for one velocity: 5 Hz, as old as they are."""
FRESH_S = 0.03
"""Age of a velocity that comes with every picture."""
ACCELEROMETER_MPS2 = 0.3
"""Standard deviation of a horizontal acceleration: half a degree of attitude is 0.09 m/s², rotors shake the rest."""
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


def hover_m(
    axis: Axis, horizon: HorizonParameters, response: Response, delay_s: float, free: bool, acceleration_mps2: float = 0
) -> float:
    """Standard deviation of the offset from the deck's centre.

    Args:
        axis: what moves.
        horizon: the pilot's parameters.
        response: of the vehicle.
        delay_s: from a picture's exposure to the first answer to it.
        free: acceleration and stick cost next to nothing.
        acceleration_mps2: standard deviation of an acceleration that comes with every picture, only `FRESH_S` old, and
            the velocity with it; infinite: that velocity alone; 0: velocities at 5 Hz, as old as the pictures.
    """
    noise = replace(horizon.horizontal_at(axis.gust_mps2), gust_mps2=axis.gust_mps2)
    wave = WaveMotion(axis.wave_m, 2.1, horizon.wave.damping, True, (axis.deck, 0.0, 0.0, 0.0))
    model, still = Model(1, motion_of(response), noise, wave), np.zeros(1)
    rate = dynamics(model.motion, noise, wave)[0][[VELOCITY]]

    def with_telemetry(estimate: GaussianState) -> GaussianState:
        velocity = model.velocity(estimate, 0.5, horizon.delayed.flow_settle_s)
        estimate = updated(estimate, velocity, still, horizon.measured.velocity_mps**2 * np.eye(1))[0]
        if not 0.0 < acceleration_mps2 < math.inf:
            return estimate
        return updated(estimate, (rate @ estimate.mean, rate), still, acceleration_mps2**2 * np.eye(1))[0]

    estimate = model.start(0.0, still, 0.01 * np.eye(1), 0.5)
    for index in range(900):
        estimate = model.predicted(estimate, STEP_MS, np.zeros(model.motion.inputs))
        estimate = updated(estimate, model.pose(estimate), still, PLACE_M**2 * np.eye(1))[0]
        if acceleration_mps2 > 0.0 or index % VELOCITY_EVERY == 0:
            estimate = with_telemetry(estimate)
    younger_s = delay_s - response.uplink_s - response.dead_time_s - FRESH_S
    younger = int(1e3 * younger_s / STEP_MS) if acceleration_mps2 > 0.0 else 0
    for _ in range(younger):
        estimate = with_telemetry(model.predicted(estimate, STEP_MS, np.zeros(model.motion.inputs)))
    left_ms = round(1e3 * delay_s) - younger * STEP_MS
    error = model.predicted(estimate, left_ms, np.zeros(model.motion.inputs)).covariance
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
        "velocity_m": hover_m(axis, horizon, response, delay_s, True, math.inf),
        "acceleration_m": hover_m(axis, horizon, response, delay_s, True, ACCELEROMETER_MPS2),
    }


STUDY = Study(
    question="How still can the pilot hover over the deck, by its own model?",
    columns={
        "axis": Column("one axis, offset from the deck's centre [cm]"),
        "gains_m": Column("the pilot's gains", ".1f", 100.0),
        "bound_m": Column("no caution (LQG bound)", ".1f", 100.0),
        "half_delay_m": Column("no caution, half the delay", ".1f", 100.0),
        "velocity_m": Column("no caution, velocity at 30 Hz", ".1f", 100.0),
        "acceleration_m": Column("and acceleration to 0.3 m/s²", ".1f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=1,
    minutes=1,
)
