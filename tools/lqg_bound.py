"""How still the pilot `horizon` can hover over a deck, by its own model: estimate and control together, no flight.

    python tools/lqg_bound.py

For one horizontal axis of a vehicle whose sticks mean a tilt: the standard deviation of the offset from the deck's
centre under the pilot's gains, when gusts and swing are what the model takes them for. Without the pilot's caution
(costs of acceleration and of the stick's rate) it is the bound of linear quadratic Gaussian control; both are printed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import tyro

from shipland.estimation.relative_state import POSITION, STATES, WAVE, Model, updated
from shipland.estimation.wave_motion import WaveMotion
from shipland.frames import Array
from shipland.guidance.horizon.assumptions import motion_of
from shipland.guidance.horizon.gains import gains_of
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.response import Response
from shipland.scenario.autonomy import response_of
from shipland.scenario.scenario import load_scenario

STEP_MS = 33
PLACE_M = 0.005
"""Standard deviation of a picture's place near the bar."""
VELOCITY_EVERY = 6
"""Pictures for one velocity: 5 Hz."""
FREE = {"acceleration": 1e-5, "input_rate": 1e-8}


@dataclass(frozen=True)
class Case:
    """A sea and an air: swing of the bar [m], share of it that the deck has, acceleration by gusts [m/s²]."""

    name: str
    wave_m: float
    deck: float
    gust_mps2: float


CASES = (
    Case("bar at rest, 5 m/s over land", 0.003, 0.0, 0.3),
    Case("bar at rest, 9 m/s over land", 0.003, 0.0, 1.4),
    Case("bar at rest, 9 m/s over the sea", 0.003, 0.0, 0.4),
    Case("sea state 5, surge", 0.015, 0.7, 0.15),
    Case("sea state 5, sway", 0.098, 0.7, 0.15),
    Case("sea state 6, surge", 0.03, 0.7, 0.15),
    Case("sea state 6, sway", 0.147, 0.7, 0.15),
    Case("sea state 6, sway, 9 m/s", 0.147, 0.7, 0.4),
)


def hover_m(case: Case, horizon: HorizonParameters, response: Response, delay_s: float, free: bool) -> float:
    """Standard deviation of the offset from the deck's centre.

    Args:
        case: what moves.
        horizon: the pilot's parameters.
        response: of the vehicle.
        delay_s: from a picture's exposure to the first answer to it.
        free: acceleration and stick cost next to nothing.
    """
    noise = replace(horizon.horizontal_at(case.gust_mps2), gust_mps2=case.gust_mps2)
    wave = WaveMotion(case.wave_m, 2.1, horizon.wave.damping, True, case.deck)
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
    offset[[POSITION, WAVE]] = 1.0, -case.deck
    return math.sqrt(float(offset @ state @ offset))


def main(scenario: str = "ship-sea6") -> None:
    """Print the table.

    Args:
        scenario: whose vehicle flies, with its delays.
    """
    loaded = load_scenario(scenario)
    horizon, response, delays = loaded.guidance.horizon, response_of(loaded), loaded.delays
    delay_s = delays.video_s + delays.near_s + response.uplink_s + response.dead_time_s
    print(f"Offset from the deck's centre along one axis [cm]; {delay_s:.2f} s from picture to answer\n")
    print("| | the pilot's gains | no caution | no caution, half the delay |")
    print("|---|---:|---:|---:|")
    for case in CASES:
        sizes = [
            hover_m(case, horizon, response, *how) for how in ((delay_s, False), (delay_s, True), (0.5 * delay_s, True))
        ]
        print(f"| {case.name} | " + " | ".join(f"{100.0 * size:.1f}" for size in sizes) + " |")


if __name__ == "__main__":
    tyro.cli(main)
