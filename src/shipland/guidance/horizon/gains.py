"""Gains of the horizontal control: linear-quadratic, on the whole state predicted to a command's effect.

The state is an axis of the relative state and the stick input before; what is chosen is the change of that input. The
cost is the squared offset from the bar's place, its rate, the aircraft's acceleration and the rate of the input: a
steady wind costs nothing, so that nothing pulls the aircraft off its place. All commands that are still on the way are
in the prediction, which makes the delay a part of the state as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shipland.config import key, parameters, scaled
from shipland.estimation.relative_state import (
    POSITION,
    STATES,
    VELOCITY,
    WAVE,
    AxisModel,
    Disturbances,
    discretised,
    dynamics,
    shaping,
)
from shipland.estimation.waves import WAVE_STATES, WaveMotion
from shipland.frames import Array

INPUT_RATE_SHARE = 2.0
"""Most that an input may change, as a share of the rate at which the vehicle can follow.

Beyond 1 it is followed late. Held back to 0.7, gusts of 9 m/s of wind are answered later still:
docs/results/guidance.md.
"""
INPUT, TRACKED, TRACKED_RATE = STATES, STATES + 1, STATES + 2
"""Index of the input before in the control's state; of the speed that a servo with an integral tracks, and its rate."""


@parameters
class Weights:
    """`[guidance.horizon.weights]`: costs against a squared metre."""

    speed: float = scaled(0.01, "of a squared metre per second against the bar [s²]", power=1.0, ge=0)
    acceleration: float = scaled(0.0015, "of the aircraft's own, squared [s⁴]", power=2.0, ge=0)
    input_rate: float = scaled(
        3e-6, "of the rate of the input asked for, squared [s⁶ for tilts, s⁴ for speeds]", power=3.0, gt=0
    )
    final_place: float = key(1.0, "on place at contact, where the time to it is known", ge=0)
    final_speed: float = key(0.1, "on speed at contact", ge=0)
    horizon_s: float = scaled(2.0, "longest time to contact that gains are kept for", ge=0)


@dataclass(frozen=True)
class Gains:
    """Gains for one length of cycle.

    Attributes:
        step_s: the cycle.
        steady: (11,), or (13,) with a tracked speed: the change of the input is −steady · (state − reference).
        to_contact: (k, 11 or 13) the same, by whole cycles left to contact.
        offset_to_contact: (k + 1, 11 or 13) the offset at contact, so many cycles away, under `to_contact`.
    """

    step_s: float
    steady: Array
    to_contact: Array
    offset_to_contact: Array


@lru_cache(maxsize=256)
def gains_of(motion: AxisModel, noise: Disturbances, wave: WaveMotion, weights: Weights, step_ms: int) -> Gains:
    """Solve for one vehicle, sea and cycle."""
    from scipy.linalg import solve_discrete_are

    step_s = 1e-3 * step_ms
    a, b, q = dynamics(motion, noise, wave)
    tracked = [] if motion.inputs == 1 else [TRACKED, TRACKED_RATE]
    moving = [*range(STATES), *tracked]
    size = STATES + 1 + len(tracked)
    to_bar, rate, acceleration = np.zeros(size), np.zeros(size), np.zeros(size)
    waves, (of_deck, of_its_rate) = slice(WAVE, WAVE + WAVE_STATES), wave.tracked
    to_bar[POSITION], to_bar[waves], rate[VELOCITY], rate[waves] = 1.0, -of_deck, 1.0, -of_its_rate
    acceleration[:STATES] = a[VELOCITY]
    if tracked:
        a, b, q = _with_tracked(motion, a, b, q)
    transition, push, _ = discretised(a, b, q, step_s)
    big, entry = np.zeros((size, size)), np.zeros(size)
    big[np.ix_(moving, moving)], big[moving, INPUT], big[INPUT, INPUT] = transition, push[:, 0], 1.0
    entry[moving], entry[INPUT] = push[:, 0], 1.0
    cost = np.outer(to_bar, to_bar) + weights.speed * np.outer(rate, rate)
    cost = step_s * (cost + weights.acceleration * np.outer(acceleration, acceleration))
    effort = weights.input_rate / step_s
    # SciPy wants no eigenvalue on the unit circle: the input before has one, and is reached by the control.
    value = solve_discrete_are(big, entry[:, None], cost, np.array([[effort]]))
    steady = _gain(big, entry, value, effort)
    count = max(1, round(weights.horizon_s / step_s))
    final = weights.final_place * np.outer(to_bar, to_bar) + weights.final_speed * np.outer(rate, rate)
    rows, offsets = [], [to_bar]
    for _ in range(count):
        gain = _gain(big, entry, final, effort)
        closed = big - np.outer(entry, gain)
        final = cost + effort * np.outer(gain, gain) + closed.T @ final @ closed
        rows.append(gain)
        offsets.append(offsets[-1] @ closed)
    return Gains(step_s, steady, np.array(rows), np.array(offsets))


def _with_tracked(motion: AxisModel, a: Array, b: Array, q: Array) -> tuple[Array, Array, Array]:
    """The dynamics with the tracked speed and its rate as two more states (12,), driven by the speed asked for."""
    n = STATES + 2
    own, asked = shaping(motion)
    wide, entry = np.zeros((n, n)), np.zeros((n, 1))
    wide[:STATES, :STATES], wide[STATES:, STATES:], entry[STATES:, 0] = a, own, asked
    wide[:STATES, STATES], wide[:STATES, STATES + 1] = b.sum(axis=1), b[:, 0] / motion.servo_per_s
    return wide, entry, np.append(q, np.zeros(2))


def _gain(big: Array, entry: Array, value: Array, effort: float) -> Array:
    weighted = entry @ value
    return np.asarray((weighted @ big) / (effort + weighted @ entry))
