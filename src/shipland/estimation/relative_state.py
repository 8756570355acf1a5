"""The relative state: where the aircraft is against the bar, how it moves, and what pushes it.

One Kalman filter of linear motion over a few axes that do not turn. An estimate stands at one time; `Model.predicted`
moves it through a known input, `updated` takes a measurement of that very time. Both are pure.

The states of an axis, in the order of the indices below:

| index | state | unit |
|---|---|---|
| `POSITION` | of the aircraft against the bar's mean place | m |
| `VELOCITY` | its rate | m/s |
| `ACTUATION` | acceleration that the autopilot makes of the sticks, lagging | m/s² |
| `GUST` | acceleration by turbulence, coloured | m/s² |
| `WIND` | acceleration by the mean wind and by what is not modelled, slow | m/s² |
| `VELOCITY_BIAS` | the vehicle's own velocity less `VELOCITY`: the ship's velocity, optical flow's bias; slow | m/s |
| `WAVE` | of the deck, and on a ship of the bar, about its mean place | m |
| `WAVE_RATE` | its rate | m/s |
| | and the two of the waves that drive it (`WaveMotion`) | |

With u the input, k the drag and T the lag: ṗ = v; v̇ = a + g + s − k v; ȧ = (U − a)/T, where U = u for a vehicle whose
sticks mean a tilt, and U = κ (u − v − c) for one that tracks a velocity over its own reference. A picture of a bar
that the ship carries shows p − o, and one of a bar that stands still p.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters
from shipland.estimation.kernels import (
    Steps,
    correct,
    matrices_of,
    predicted_covariance,
    propagate_covariance,
    steps_from,
)
from shipland.estimation.waves import WAVE_STATES, Output, WaveMotion, WaveShares
from shipland.frames import Array

POSITION, VELOCITY, ACTUATION, GUST, WIND, VELOCITY_BIAS, WAVE, WAVE_RATE = range(8)
STATES = WAVE + WAVE_STATES
"""Of one axis."""


@dataclass(frozen=True)
class AxisModel:
    """How the vehicle moves along an axis.

    Attributes:
        lag_s: of the acceleration behind what is asked for.
        drag_per_s: deceleration for a metre per second.
        servo_per_s: zero where the input is an acceleration; else the gain from speed error to acceleration.
        over_ship: share of ship in the optical flow's view that the servo flies on; the rest is at rest.
        settle_s: time in which the servo's own velocity follows the motion of what is in view.
        integral_per_s2: gain from the integral of the servo's speed error to acceleration; zero where it has none.
        approach_per_s, smoothing_s: of the speed that a servo with an integral tracks, behind the one asked for.
        gain: of an input that is an acceleration: by what factor it does more than it should.
    """

    lag_s: float
    drag_per_s: float
    servo_per_s: float = 0.0
    over_ship: float = 0.0
    settle_s: float = 0.0
    integral_per_s2: float = 0.0
    approach_per_s: float = 0.0
    smoothing_s: float = 0.0
    gain: float = 1.0

    @property
    def inputs(self) -> int:
        """Of one axis: the input; for a servo with an integral its tracked speed r, first as r + ṙ/κ, then alone."""
        return 2 if self.integral_per_s2 > 0.0 else 1


@parameters
class Disturbances:
    """Sizes of what is not known: standard deviations and correlation times."""

    gust_mps2: float = key(0.8, "acceleration by turbulence", ge=0)
    gust_time_s: float = key(2.5, "time constant of turbulence", gt=0)
    wind_mps2: float = key(1.5, "acceleration by the mean wind", ge=0)
    wind_time_s: float = key(300.0, "time constant of the mean wind", gt=0)
    velocity_bias_mps: float = key(0.5, "error of the velocity reference", ge=0)
    velocity_bias_time_s: float = key(300.0, "time constant of that error", gt=0)
    speed_noise: float = key(0.06, "power density of an acceleration without memory [m²/s³]", ge=0)


class GaussianState(NamedTuple):
    """The state of all axes and its covariance at one time.

    Attributes:
        t_s: the time that it holds for.
        mean: (STATES × axes,) axis by axis.
        covariance: square of that size.
    """

    t_s: float
    mean: Array
    covariance: Array

    def of(self, state: int) -> Array:
        """(axes,) the mean of one state on every axis."""
        return np.asarray(self.mean[state::STATES])


def dynamics(motion: AxisModel, noise: Disturbances, wave: WaveMotion) -> tuple[Array, Array, Array]:
    """Continuous time, one axis: matrix (n,n), input matrix (n, inputs), noise densities (n,), n = STATES."""
    a, b, q = np.zeros((STATES, STATES)), np.zeros((STATES, motion.inputs)), np.zeros(STATES)
    a[POSITION, VELOCITY] = 1.0
    a[VELOCITY, [VELOCITY, ACTUATION, GUST, WIND]] = -motion.drag_per_s, 1.0, 1.0, 1.0
    a[ACTUATION, ACTUATION] = -1.0 / motion.lag_s
    gain = motion.servo_per_s if motion.servo_per_s > 0.0 else motion.gain
    b[ACTUATION, 0] = gain / motion.lag_s
    if motion.servo_per_s > 0.0:
        _, own = velocity_of(np.zeros(STATES), 1, motion.over_ship, motion.settle_s, wave.frequency_rad_s, wave.deck)
        a[ACTUATION] -= gain / motion.lag_s * own[0]
        a[WIND] -= motion.integral_per_s2 * own[0]
        b[WIND, 1:] = motion.integral_per_s2
    slow = ((GUST, noise.gust_mps2, noise.gust_time_s), (WIND, noise.wind_mps2, noise.wind_time_s))
    for state, deviation, time_s in (*slow, (VELOCITY_BIAS, noise.velocity_bias_mps, noise.velocity_bias_time_s)):
        a[state, state] -= 1.0 / time_s
        q[state] = 2.0 * deviation**2 / time_s
    a[WAVE:, WAVE:], q[WAVE:] = wave.matrix, wave.noise
    q[VELOCITY] = noise.speed_noise
    return a, b, q


def shaping(motion: AxisModel) -> tuple[Array, Array]:
    """Continuous time, of a servo's tracked speed and its rate: matrix (2,2), input vector (2,)."""
    a = np.array([[0.0, 1.0], [-motion.approach_per_s / motion.smoothing_s, -1.0 / motion.smoothing_s]])
    return a, np.array([0.0, motion.approach_per_s / motion.smoothing_s])


def discretised(a: Array, b: Array, q: Array, step_s: float) -> tuple[Array, Array, Array]:
    """Transition (n,n), input (n,m) and noise covariance (n,n) of a step (C. Van Loan, 1978)."""
    from scipy.linalg import expm  # a fifth of a second that what flies nothing does without

    n, m = b.shape
    with_input = np.zeros((n + m, n + m))
    with_input[:n, :n], with_input[:n, n:] = a, b
    moved = expm(with_input * step_s)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, np.diag(q), a.T
    result = expm(block * step_s)
    transition = result[n:, n:].T
    covariance = transition @ result[:n, n:]
    return moved[:n, :n], moved[:n, n:], 0.5 * (covariance + covariance.T)


class Model:
    """Steps of any length, in whole milliseconds, over one or more equal axes.

    Args:
        axes: how many.
        motion: of the vehicle.
        noise: what is not known.
        wave: wave motion of deck and bar.
        shares: of the wave motion on two axes; None where it is alike on every axis.
    """

    def __init__(
        self, axes: int, motion: AxisModel, noise: Disturbances, wave: WaveMotion, shares: WaveShares | None = None
    ) -> None:
        self.axes, self.motion, self.noise, self.wave = axes, motion, noise, wave
        self.shape: Array = np.eye(axes) if shares is None else shares.shape
        """(axes, axes) of the wave motion."""
        self.steps = _axis_steps(motion, noise, wave)
        """What `kernels.propagate` takes."""

    def step(self, step_ms: int) -> tuple[Array, Array, Array]:
        """Transition (n,n), input matrix (n, axes × inputs) and noise (n,n); for analysis."""
        (one, noise, push, wave_noise), alike = matrices_of(self.steps, step_ms), np.eye(self.axes)
        inputs = np.hstack([np.kron(alike, column[:, None]) for column in push.T[: self.motion.inputs]])
        return np.kron(alike, one), inputs, np.kron(alike, noise) + np.kron(self.shape, wave_noise)

    def covariance_after(self, covariance: Array, step_ms: int) -> Array:
        """(n,n) a while after a covariance, nothing measured meanwhile."""
        after = covariance.copy()
        propagate_covariance(after, matrices_of(self.steps, step_ms), self.shape)
        return after

    def _wave_shares(self) -> Array:
        """(n,n) covariance of the wave motion while nothing is known of it; zero for all else."""
        size = STATES * self.axes
        covariance = np.zeros((size, size))
        for axis in range(self.axes):
            for other in range(self.axes):
                covariance[_wave(axis), _wave(other)] = self.shape[axis, other] * self.wave.covariance
        return covariance

    def start(
        self, t_s: float, place_m: Array, covariance_m2: Array, speed_mps: float, ship_std_mps: float = 0.0
    ) -> GaussianState:
        """An estimate from a first place (axes,) with its covariance (axes, axes).

        Args:
            t_s: of the place.
            place_m: from the bar.
            covariance_m2: of it.
            speed_mps: standard deviation of the speed, for a ship that lies still.
            ship_std_mps: standard deviation of the ship's speed.
        """
        noise = self.noise
        deviations = [0.0, math.hypot(speed_mps, ship_std_mps), 0.5, noise.gust_mps2, noise.wind_mps2]
        deviations.append(ship_std_mps or noise.velocity_bias_mps)
        deviation = np.array([*deviations, *[0.0] * (STATES - WAVE)] * self.axes)
        mean, covariance = np.zeros(len(deviation)), np.diag(deviation**2) + self._wave_shares()
        mean[POSITION::STATES] = place_m
        covariance[POSITION::STATES, POSITION::STATES] = covariance_m2
        return GaussianState(t_s, mean, covariance)

    def adopted(self, estimate: GaussianState, before: WaveMotion) -> GaussianState:
        """An estimate of a model with the wave motion `before`.

        Where the bar moves by both the estimate is kept. Else the offset from the bar is kept, and the wave motion
        starts from its prior.
        """
        if before.bar_moves and self.wave.bar_moves:
            return estimate
        n = len(estimate.mean)
        forget, share = np.eye(n), np.eye(n)
        for axis in range(self.axes):
            first = STATES * axis
            forget[first + POSITION, first + WAVE] = forget[first + VELOCITY, first + WAVE_RATE] = -float(
                before.bar_moves
            )
            forget[_wave(axis), _wave(axis)] = 0.0
            # The bar's mean place is as uncertain as its wave motion, and correlated: only their difference is seen.
            share[first + POSITION, first + WAVE] = share[first + VELOCITY, first + WAVE_RATE] = float(
                self.wave.bar_moves
            )
        covariance = share @ (forget @ estimate.covariance @ forget.T + self._wave_shares()) @ share.T
        return GaussianState(estimate.t_s, forget @ estimate.mean, covariance)

    def predicted(self, estimate: GaussianState, step_ms: int, given: Array) -> GaussianState:
        """The estimate after a step through the input `given` (axes,), constant meanwhile; for analysis."""
        transition, inputs, noise = self.step(step_ms)
        return GaussianState(
            estimate.t_s + 1e-3 * step_ms,
            transition @ estimate.mean + inputs @ given,
            predicted_covariance(transition, estimate.covariance, noise),
        )

    def pose(self, estimate: GaussianState) -> tuple[Array, Array]:
        """What a picture shows of the place: expected value (axes,) and its Jacobian (axes, n)."""
        return pose_measurement(estimate.mean, self.axes, self.wave.bar[0])

    def velocity(self, estimate: GaussianState, over_ship: float = 0.0, settle_s: float = 0.0) -> tuple[Array, Array]:
        """What the vehicle measures of its own velocity: expected value (axes,) and its Jacobian (axes, n).

        Args:
            estimate: at the measurement's time.
            over_ship: share of the optical flow's view that is ship, and so moves with the bar.
            settle_s: time in which the vehicle's fusion follows the motion of what is in view; the lag of a resonator
                is a mixture of its two states.
        """
        return velocity_of(estimate.mean, self.axes, over_ship, settle_s, self.wave.frequency_rad_s, self.wave.deck)


@lru_cache(maxsize=16)
def _axis_steps(motion: AxisModel, noise: Disturbances, wave: WaveMotion) -> Steps:
    """Of one axis."""
    a, b, q = dynamics(motion, noise, wave)
    wave_q = np.where(np.arange(STATES) < WAVE, 0.0, q)
    one = np.zeros((4, STATES, STATES))
    one[0], one[2, :, : b.shape[1]], one[3] = discretised(a, b, wave_q, 1e-3)
    one[1] = discretised(a, b, q - wave_q, 1e-3)[2]
    return steps_from(one)


def _wave(axis: int) -> slice:
    """The wave motion's states of an axis."""
    return slice(STATES * axis + WAVE, STATES * (axis + 1))


@compiled
def pose_measurement(mean: Array, axes: int, shown: Array) -> tuple[Array, Array]:
    """`Model.pose` of a mean, where what is seen moves by (4,) these shares of the wave motion's states."""
    expected, jacobian = np.zeros(axes), np.zeros((axes, len(mean)))
    for axis in range(axes):
        first = STATES * axis
        expected[axis], jacobian[axis, first + POSITION] = mean[first + POSITION], 1.0
        for k in range(WAVE_STATES):
            expected[axis] -= shown[k] * mean[first + WAVE + k]
            jacobian[axis, first + WAVE + k] = -shown[k]
    return expected, jacobian


@compiled
def less_wave(mean: Array, motion: Output, near: float = 1.0) -> tuple[Array, Array]:
    """(axes,) place less `near` of a motion by the waves, and its rate, from the mean of all states."""
    axes = len(mean) // STATES
    shares, rates = motion
    place, rate = np.empty(axes), np.empty(axes)
    for axis in range(axes):
        first = STATES * axis
        place[axis], rate[axis] = mean[first + POSITION], mean[first + VELOCITY]
        for k in range(WAVE_STATES):
            place[axis] -= near * shares[k] * mean[first + WAVE + k]
            rate[axis] -= near * rates[k] * mean[first + WAVE + k]
    return place, rate


@compiled
def position_covariance(covariance: Array, shares: Array) -> Array:
    """(axes, axes) covariance of the place less (4,) these shares of the wave motion's states, from that of all."""
    axes = len(covariance) // STATES
    result = np.empty((axes, axes))
    for i in range(axes):
        for j in range(axes):
            a, b = STATES * i, STATES * j
            total = covariance[a + POSITION, b + POSITION]
            for k in range(WAVE_STATES):
                total -= shares[k] * (covariance[a + POSITION, b + WAVE + k] + covariance[b + POSITION, a + WAVE + k])
                for m in range(WAVE_STATES):
                    total += shares[k] * shares[m] * covariance[a + WAVE + k, b + WAVE + m]
            result[i, j] = total
    return result


@compiled
def velocity_of(
    mean: Array, axes: int, over_ship: float, settle_s: float, w: float, below: Output
) -> tuple[Array, Array]:
    """`Model.velocity` of a mean, with a wave motion of `w` [rad/s], by which what is below moves so."""
    share = over_ship / (1.0 + (w * settle_s) ** 2)
    expected, jacobian = np.zeros(axes), np.zeros((axes, len(mean)))
    for axis in range(axes):
        first = STATES * axis
        jacobian[axis, first + VELOCITY], jacobian[axis, first + VELOCITY_BIAS] = 1.0, 1.0 - over_ship
        expected[axis] = mean[first + VELOCITY] + (1.0 - over_ship) * mean[first + VELOCITY_BIAS]
        for k in range(WAVE_STATES):
            entry = -share * settle_s * w * w * below[0][k] - share * below[1][k]
            jacobian[axis, first + WAVE + k] = entry
            expected[axis] += entry * mean[first + WAVE + k]
    return expected, jacobian


def updated(
    estimate: GaussianState, expected: tuple[Array, Array], measured: Array, covariance: Array
) -> tuple[GaussianState, float]:
    """The estimate after a measurement (m,) of its own time, and the normalised innovation squared; for analysis.

    A flight's filter is `DelayedFilter`, by the same `kernels.correct`.

    Args:
        estimate: before.
        expected: (m,) and its Jacobian (m,n): `Model.pose`, `Model.velocity`.
        measured: the measurement.
        covariance: (m,m) of its error.
    """
    predicted, jacobian = expected
    after = GaussianState(estimate.t_s, estimate.mean.copy(), estimate.covariance.copy())
    return after, correct(after.mean, after.covariance, jacobian, measured - predicted, covariance, math.inf)
