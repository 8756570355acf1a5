"""A filter for late pictures: the estimate stands at the newest picture, and what came since is replayed over it.

Pictures are the oldest news of all, so the estimate is never taken back: velocity that is younger than the newest
picture waits, is used to look ahead, and enters for good when a younger picture comes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters, scaled
from shipland.estimation.kernels import add_input, correct, mean_input, propagate
from shipland.estimation.relative_state import (
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

    def mean(self, from_s: float, to_s: float) -> Array:
        """Average over an interval; the value at its begin where it is empty."""
        return mean_input(self.history, self.count, from_s, to_s)

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


@dataclass(frozen=True)
class _Velocity:
    """A reading that waits for a picture: when it was true, and the share of ship in the view."""

    t_s: float
    measured_mps: Array
    over_ship: float


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
        self._velocities: list[_Velocity] = []
        self._velocity_variance = parameters.velocity_mps**2 / parameters.velocity_repeats
        variances = velocity_least_mps**2, parameters.velocity_most_mps**2
        self._velocity_limits = parameters.velocity_repeats, *variances, parameters.velocity_gate
        self._refused = 0

    def start(
        self, t_s: float, place_m: Array, covariance_m2: Array, speed_mps: float, ship_std_mps: float = 0.0
    ) -> None:
        """Begin at a place, as `Model.start` does."""
        self.estimate = self.model.start(t_s, place_m, covariance_m2, speed_mps, ship_std_mps)
        self._refused = 0

    def copy(self) -> DelayedFilter:
        """Another of the same estimate."""
        other = DelayedFilter(self.model, self._parameters, self._velocity_least_mps)
        other.estimate, other.normalised = _copied(self.estimate), self.normalised
        other._velocities, other._velocity_variance = list(self._velocities), self._velocity_variance
        return other

    def adopt(self, model: Model) -> None:
        """Go on with a model of other waves."""
        before, self.model = self.model.wave, model
        if self.estimate is not None:
            self.estimate = model.adopted(self.estimate, before)

    def update_velocity(self, t_s: float, measured_mps: Array, over_ship: float = 0.0) -> None:
        """The vehicle's own velocity (axes,), true at `t_s`; `over_ship` as in `Model.velocity`."""
        if not self._velocities or t_s > self._velocities[-1].t_s + 1e-6:
            self._velocities.append(_Velocity(t_s, measured_mps, over_ship))

    def update_pose(
        self, t_s: float, place_m: Array, covariance_m2: Array, inputs: Inputs, turn_rad_s: float = 0.0
    ) -> bool:
        """A picture's place (axes,) of its exposure; False where the innovation gate rejects it, or it is too old."""
        if self.estimate is None or t_s < self.estimate.t_s - 1e-3:
            return False
        self._take_velocities(t_s, inputs, turn_rad_s)
        self.estimate = estimate = self._moved(self.estimate, t_s, inputs, turn_rad_s)
        shown, gate = self.model.wave.bar[0], self._parameters.picture_gate
        self.normalised = float(_take_picture(estimate.mean, estimate.covariance, shown, place_m, covariance_m2, gate))
        accepted = self.normalised <= gate
        self._refused = 0 if accepted else self._refused + 1
        return accepted

    @property
    def refused(self) -> int:
        """Pictures refused since the last one that was taken."""
        return self._refused

    def follow(self, now_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> None:
        """Without pictures: keep the estimate from falling further behind than `lag_s`."""
        to_s = now_s - self._parameters.lag_s
        if self.estimate is not None and self.estimate.t_s < to_s:
            self._take_velocities(to_s, inputs, turn_rad_s)
            self.estimate = self._moved(self.estimate, to_s, inputs, turn_rad_s)

    def predict(self, t_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> GaussianState | None:
        """The estimate at a later time, through what is known to be commanded until then."""
        estimate = _copied(self.estimate)
        if estimate is None:
            return None
        for reading in self._velocities:
            if reading.t_s <= t_s:
                estimate, _ = self._with(estimate, reading, inputs, turn_rad_s, learns=False)
        return self._moved(estimate, t_s, inputs, turn_rad_s)

    def _take_velocities(self, to_s: float, inputs: Inputs, turn_rad_s: float) -> None:
        """Take the velocities until a time, for good, and learn from them how large their errors are."""
        waiting = []
        for reading in self._velocities:
            assert self.estimate is not None
            if reading.t_s > to_s:
                waiting.append(reading)
            elif reading.t_s > self.estimate.t_s - _LATE_S:
                self.estimate, variance = self._with(self.estimate, reading, inputs, turn_rad_s, learns=True)
                self._velocity_variance = variance
        self._velocities = waiting

    def _with(
        self, estimate: GaussianState, reading: _Velocity, inputs: Inputs, turn_rad_s: float, learns: bool
    ) -> tuple[GaussianState, float]:
        """The estimate moved to a velocity and with it, and the variance of one reading; `learns` from this one."""
        wave, estimate = self.model.wave, self._moved(estimate, reading.t_s, inputs, turn_rad_s)
        view = (reading.over_ship, self._parameters.flow_settle_s, wave.frequency_rad_s, wave.deck)
        reading_mps, limits = (reading.measured_mps, self._velocity_variance), self._velocity_limits
        return estimate, _take_velocity(estimate.mean, estimate.covariance, reading_mps, view, limits, learns)

    def _moved(self, estimate: GaussianState, to_s: float, inputs: Inputs, turn_rad_s: float) -> GaussianState:
        """The estimate moved to a time, in whole milliseconds, and never backwards."""
        from_s, mean, covariance = estimate
        step_ms, model = round(1e3 * (to_s - from_s)), self.model
        if step_ms <= 0:
            return estimate
        turn_rad_s = turn_rad_s if model.axes == 2 else 0.0
        way = from_s, step_ms, model.steps(step_ms), model.shape, inputs.history, inputs.count, turn_rad_s
        propagate(mean, covariance, way, VELOCITY, VELOCITY_BIAS)  # as a call of its own: within others LLVM slows it
        return GaussianState(from_s + 1e-3 * step_ms, mean, covariance)


_View = tuple[float, float, float, Output]
"""Of `velocity_of`: the share of ship in view, its settling time, the wave motion's frequency, the deck's motion."""
_Limits = tuple[float, float, float, float]
"""Of a velocity: repeats of a reading, the least and the most variance that it is given, the gate."""


def _copied(estimate: GaussianState | None) -> GaussianState | None:
    return None if estimate is None else GaussianState(estimate.t_s, estimate.mean.copy(), estimate.covariance.copy())


@compiled
def _take_picture(mean: Array, covariance: Array, shown: Array, place_m: Array, noise: Array, gate: float) -> float:
    """Take a picture's place (axes,) unless gated out; the normalised innovation squared."""
    expected, jacobian = pose_measurement(mean, len(place_m), shown)
    return float(correct(mean, covariance, jacobian, place_m - expected, noise, gate))


@compiled
def _take_velocity(
    mean: Array,
    covariance: Array,
    reading_mps: tuple[Array, float],
    view: _View,
    limits: _Limits,
    learns: bool,
) -> float:
    """Take a velocity (axes,) unless gated out; the variance of a reading, given with it, as it now is."""
    (measured_mps, variance), (over_ship, settle_s, frequency_rad_s, below) = reading_mps, view
    axes, (repeats, least, most, gate) = len(measured_mps), limits
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
