"""A filter for late pictures: the estimate stands at the newest picture, and what came since is replayed over it.

Pictures are the oldest news of all, so the estimate is never taken back: velocity that is younger than the newest
picture waits, is used to look ahead, and enters for good when a younger picture comes.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters, scaled
from shipland.estimation.kernels import LONGEST_MS, Steps, add_input, correct, mean_input, propagate
from shipland.estimation.relative_state import (
    POSITION,
    STATES,
    VELOCITY,
    VELOCITY_BIAS,
    GaussianState,
    Model,
    pose_measurement,
    velocity_of,
)
from shipland.estimation.waves import Output
from shipland.frames import Array

_KEPT_S = 4.0
_LATE_S = 0.1
"""A velocity may be this much older than the estimate."""
_LEARNED = 0.08
"""Share with which a velocity changes what its errors are taken for: two seconds of 5 Hz."""
_ROWS = 512
"""Of the inputs' history, at first."""


class Inputs:
    """What was commanded, by the time at which it takes effect; constant from one command to the next.

    Args:
        size: components of a command.
    """

    def __init__(self, size: int) -> None:
        self._size, self.count = size, 1
        self.history: Array = np.zeros((_ROWS, 1 + 2 * size))
        """Rows of `kernels.mean_input`: since when, the value, the integral of all before it."""
        self.history[0, 0] = -1e9

    def add(self, from_s: float, value: Array) -> None:
        """From `from_s` on, `value`; an earlier time than the last one's counts as the last one's."""
        add_input(self.history, self.count, from_s, value)
        self.count += 1
        self.make_room()

    def make_room(self) -> None:
        """Room for one more row at least: forget what is old, else grow."""
        history, now_s = self.history, self.history[self.count - 1, 0]
        if history[1, 0] < now_s - 2.0 * _KEPT_S:
            first = int(np.argmax(history[: self.count, 0] > now_s - _KEPT_S)) - 1
            self.count -= first
            history[: self.count] = history[first : first + self.count].copy()
        elif self.count == len(history):
            self.history = np.vstack([history, np.zeros_like(history)])

    def mean(self, from_s: float, to_s: float) -> float:
        """Average of the first component over an interval; the value at its begin where it is empty."""
        return _first_mean(self.history, self.count, from_s, to_s)

    def latest(self) -> Array:
        """The newest command."""
        return self.history[self.count - 1, 1 : 1 + self._size].copy()


@parameters
class DelayedParameters:
    """How a `DelayedFilter` takes measurements."""

    velocity_gate: float = key(16.0, "largest normalised innovation squared of a velocity", ge=1, le=200)
    picture_gate: float = key(40.0, "largest normalised innovation squared of a picture", ge=1, le=200)
    velocity_mps: float = scaled(0.15, "standard deviation of a velocity at first")
    velocity_most_mps: float = scaled(0.5, "the most that it is then learned to be")
    velocity_repeats: float = key(2.0, "readings err alike; so many times the variance seen is what one is given")
    flow_settle_s: float = key(
        0.3, "time in which the vehicle's fusion follows the motion of what its optical flow sees"
    )
    lag_s: float = key(0.6, "without pictures the estimate follows at most this far behind", ge=0, le=5)


_WAITING = 16
"""Of the velocities that wait, at first."""


class DelayedFilter:
    """The state at the newest picture, and a look ahead from it.

    Args:
        model: of the motion.
        parameters: of the measurements.
        velocity_least_mps: the least standard deviation that a velocity is given.
    """

    def __init__(self, model: Model, parameters: DelayedParameters, velocity_least_mps: float) -> None:
        self.model, self._parameters, self._velocity_least_mps = model, parameters, velocity_least_mps
        self.estimate: GaussianState | None = None
        """At the newest picture; its arrays are the filter's own, and change."""
        self.normalised = 1.0
        """Of the newest picture."""
        self.refused = 0
        """Pictures refused since the last one that was taken."""
        self._waiting: Array = np.empty((_WAITING, 2 + model.axes))
        """Rows of velocities that wait for a picture: when true, the share of ship in the view, the reading."""
        self._count = 0
        self._variance = parameters.velocity_mps**2 / parameters.velocity_repeats
        variances = velocity_least_mps**2, parameters.velocity_most_mps**2
        repeats, gate = parameters.velocity_repeats, parameters.velocity_gate
        self._limits = parameters.flow_settle_s, repeats, *variances, gate

    def start(
        self, t_s: float, place_m: Array, covariance_m2: Array, speed_mps: float, ship_std_mps: float = 0.0
    ) -> None:
        """Begin at a place, as `Model.start` does."""
        self.estimate = self.model.start(t_s, place_m, covariance_m2, speed_mps, ship_std_mps)
        self.refused = 0

    def restart_position(
        self, t_s: float, place_m: Array, covariance_m2: Array, inputs: Inputs, turn_rad_s: float = 0.0
    ) -> None:
        """Begin the position anew by a picture's place (axes,); speeds stay.

        For a source whose error is another than that of the places before: the difference of two errors is no motion.
        """
        if self.estimate is None or t_s < self.estimate.t_s - 1e-3:
            return
        _, mean, covariance = self._follow(self.estimate, t_s, inputs, turn_rad_s)
        expected, _ = pose_measurement(mean, self.model.axes, self.model.wave.bar[0])
        positions = np.arange(self.model.axes) * STATES + POSITION
        mean[positions] += place_m - expected
        covariance[positions, :] = covariance[:, positions] = 0.0
        covariance[np.ix_(positions, positions)] = covariance_m2
        self.refused = 0

    def copy(self) -> DelayedFilter:
        """Another of the same estimate."""
        other = DelayedFilter(self.model, self._parameters, self._velocity_least_mps)
        other.estimate, other.normalised = _copied(self.estimate), self.normalised
        other._waiting, other._count, other._variance = self._waiting.copy(), self._count, self._variance
        return other

    def adopt(self, model: Model) -> None:
        """Go on with a model of other waves."""
        before, self.model = self.model.wave, model
        if self.estimate is not None:
            self.estimate = model.adopted(self.estimate, before)

    def update_velocity(self, t_s: float, measured_mps: Array, over_ship: float = 0.0) -> None:
        """The vehicle's own velocity (axes,), true at `t_s`; `over_ship` as in `Model.velocity`."""
        waiting, count = self._waiting, self._count
        if count and t_s <= waiting[count - 1, 0] + 1e-6:
            return
        if count == len(waiting):
            self._waiting = waiting = np.vstack([waiting, np.empty_like(waiting)])
        waiting[count, 0], waiting[count, 1], waiting[count, 2:] = t_s, over_ship, measured_mps
        self._count += 1

    def update_pose(
        self, t_s: float, place_m: Array, covariance_m2: Array, inputs: Inputs, turn_rad_s: float = 0.0
    ) -> bool:
        """A picture's place (axes,) of its exposure; False where the innovation gate rejects it, or it is too old."""
        if self.estimate is None or t_s < self.estimate.t_s - 1e-3:
            return False
        estimate = self._follow(self.estimate, t_s, inputs, turn_rad_s)
        shown, gate = self.model.wave.bar[0], self._parameters.picture_gate
        self.normalised = _take_picture(estimate.mean, estimate.covariance, shown, place_m, covariance_m2, gate)
        accepted = self.normalised <= gate
        self.refused = 0 if accepted else self.refused + 1
        return accepted

    def follow(self, now_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> None:
        """Without pictures: keep the estimate from falling further behind than `lag_s`."""
        to_s = now_s - self._parameters.lag_s
        if self.estimate is not None and self.estimate.t_s < to_s:
            self._follow(self.estimate, to_s, inputs, turn_rad_s)

    def predict(self, t_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> GaussianState | None:
        """The estimate at a later time, through what is known to be commanded until then."""
        estimate = _copied(self.estimate)
        if estimate is None:
            return None
        state = *estimate, self._waiting, self._count, self._variance
        then_s, _, _ = _moved(state, t_s, self._way(inputs, turn_rad_s), self._limits, False)
        return GaussianState(then_s, estimate.mean, estimate.covariance)

    def _follow(self, estimate: GaussianState, to_s: float, inputs: Inputs, turn_rad_s: float) -> GaussianState:
        """The estimate at a time, with the velocities until then, for good."""
        state = *estimate, self._waiting, self._count, self._variance
        way = self._way(inputs, turn_rad_s)
        then_s, self._count, self._variance = _moved(state, to_s, way, self._limits, True)
        self.estimate = GaussianState(then_s, estimate.mean, estimate.covariance)
        return self.estimate

    def _way(self, inputs: Inputs, turn_rad_s: float) -> _Way:
        model, turn_rad_s = self.model, turn_rad_s if self.model.axes == 2 else 0.0
        wave = model.wave
        return model.steps, model.shape, (wave.frequency_rad_s, wave.deck), inputs.history, inputs.count, turn_rad_s


_State = tuple[float, Array, Array, Array, int, float]
"""Of a filter: time, mean, covariance; velocities that wait and how many; the variance of one reading."""
_Way = tuple[Steps, Array, tuple[float, Output], Array, int, float]
"""Matrices, shares of the common noise; the wave motion's frequency and the deck's motion; history and count of the
inputs; the ship's turn."""
_Limits = tuple[float, float, float, float, float]
"""Of a velocity: the settling time of its view, repeats of a reading, least and most variance that it is given, gate.
"""


def _copied(estimate: GaussianState | None) -> GaussianState | None:
    return None if estimate is None else GaussianState(estimate.t_s, estimate.mean.copy(), estimate.covariance.copy())


@compiled
def _first_mean(history: Array, count: int, from_s: float, to_s: float) -> float:
    return float(mean_input(history, count, from_s, to_s)[0])


@compiled
def _moved(state: _State, to_s: float, way: _Way, limits: _Limits, for_good: bool) -> tuple[float, int, float]:
    """Move an estimate to a time, with the velocities until then; the time, how many wait, the variance of a reading.

    `for_good` these wait no more, and what their errors are is learned from them.
    """
    t_s, mean, covariance, waiting, count, variance = state
    kept = 0
    for row in waiting[:count]:
        if row[0] > to_s:
            if for_good:
                waiting[kept] = row
            kept += 1
        elif not for_good or row[0] > t_s - _LATE_S:
            t_s = _propagated(t_s, mean, covariance, row[0], way)
            variance = _take_velocity(mean, covariance, (row[2:], row[1], variance), way[2], limits, for_good)
    return _propagated(t_s, mean, covariance, to_s, way), kept if for_good else count, variance


@compiled
def _propagated(t_s: float, mean: Array, covariance: Array, to_s: float, way: _Way) -> float:
    """Move an estimate to a time in place, in whole milliseconds, and never backwards; the time."""
    step_ms = min(round(1e3 * (to_s - t_s)), LONGEST_MS)
    if step_ms <= 0:
        return t_s
    steps, shares, _, history, count, turn_rad_s = way
    propagate(mean, covariance, (t_s, step_ms, steps, shares, history, count, turn_rad_s), VELOCITY, VELOCITY_BIAS)
    return t_s + 1e-3 * step_ms


@compiled
def _take_picture(mean: Array, covariance: Array, shown: Array, place_m: Array, noise: Array, gate: float) -> float:
    """Take a picture's place (axes,) unless gated out; the normalised innovation squared."""
    expected, jacobian = pose_measurement(mean, len(place_m), shown)
    return float(correct(mean, covariance, jacobian, place_m - expected, noise, gate))


@compiled
def _take_velocity(
    mean: Array,
    covariance: Array,
    reading: tuple[Array, float, float],
    wave: tuple[float, Output],
    limits: _Limits,
    learns: bool,
) -> float:
    """Take a velocity (axes,) unless gated out; the variance of a reading, given with it, as it now is."""
    (measured_mps, over_ship, variance), (frequency_rad_s, below) = reading, wave
    axes, (settle_s, repeats, least, most, gate) = len(measured_mps), limits
    expected, jacobian = velocity_of(mean, axes, over_ship, settle_s, frequency_rad_s, below)
    innovation = measured_mps - expected
    if learns:
        variance = _learned(variance, innovation, jacobian, covariance, most)
    correct(mean, covariance, jacobian, innovation, min(max(repeats * variance, least), most) * np.eye(axes), gate)
    return variance


@compiled
def _learned(variance: float, innovation: Array, jacobian: Array, covariance: Array, most: float) -> float:
    """What a reading's variance is taken for after an innovation: its square less what the estimate explains of it."""
    axes, n = jacobian.shape
    found = 0.0
    for axis in range(axes):
        known = 0.0
        for j in range(n):
            for k in range(n):
                known += jacobian[axis, j] * covariance[j, k] * jacobian[axis, k]
        found += min(innovation[axis] * innovation[axis], most) - known
    found /= axes
    if not math.isfinite(found):
        return variance
    # An uncertain estimate expects more than is seen.
    learned: float = max(variance + _LEARNED * (found - variance), 0.0)
    return learned
