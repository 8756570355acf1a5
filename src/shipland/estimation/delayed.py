"""A filter for late pictures: the belief stands at the newest picture, and what came since is replayed over it.

Pictures are the oldest news of all, so the belief never has to be taken back: velocity that is younger than the newest
picture waits, is used to look ahead, and enters for good when a younger picture comes.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np

from shipland.estimation.relative_state import REFERENCE, SPEED, STATES, Belief, Model, updated
from shipland.frames import Array

_KEPT_S = 4.0
_LATE_S = 0.1
"""A velocity may be this much older than the belief."""
_LEARNED = 0.08
"""Share with which a velocity changes what its errors are taken for: two seconds of 5 Hz."""
_STRIDE_MS = 80
"""Longest step of the mean: the input is averaged over it."""


class Inputs:
    """What was commanded, by the time at which it takes effect; constant from one command to the next.

    Args:
        size: components of a command.
    """

    def __init__(self, size: int) -> None:
        self._times: list[float] = [-1e9]
        self._values: list[Array] = [np.zeros(size)]
        self._sums: list[Array] = [np.zeros(size)]

    def add(self, from_s: float, value: Array) -> None:
        """From `from_s` on, `value`; an earlier time than the last one's counts as the last one's."""
        from_s = max(from_s, self._times[-1])
        passed_s = from_s - self._times[-1] if len(self._times) > 1 else 0.0
        self._sums.append(self._sums[-1] + passed_s * self._values[-1])
        self._times.append(from_s)
        self._values.append(value)
        if self._times[1] < from_s - 2.0 * _KEPT_S:
            first = bisect_right(self._times, from_s - _KEPT_S) - 1
            self._times, self._values, self._sums = self._times[first:], self._values[first:], self._sums[first:]

    def mean(self, from_s: float, to_s: float) -> Array:
        """Average over an interval; the value at its begin where it is empty."""
        if to_s - from_s < 1e-6:
            return self._values[bisect_right(self._times, from_s) - 1]
        return (self._sum(to_s) - self._sum(from_s)) / (to_s - from_s)

    def latest(self) -> Array:
        """The newest command."""
        return self._values[-1]

    def _sum(self, t_s: float) -> Array:
        index = bisect_right(self._times, t_s) - 1
        if index <= 0:
            # Before the first command nothing was given; the sentinel's own value is zero.
            first_s = self._times[0] if self._times[0] > -1e8 else t_s
            return self._sums[0] + (t_s - first_s) * self._values[0]
        return self._sums[index] + (t_s - self._times[index]) * self._values[index]


@dataclass(frozen=True)
class DelayedParameters:
    """How a `DelayedFilter` takes measurements.

    Attributes:
        velocity_gate, picture_gate: largest normalised innovation squared that is taken.
        velocity_mps: standard deviation of a velocity at first, and the range that it is then learned in.
        velocity_least_mps, velocity_most_mps: that range.
        velocity_repeats: readings err alike; so many times the variance seen is what one is given.
        flow_settle_s: time in which the vehicle's fusion follows the motion of what its optical flow sees.
        lag_s: without pictures the belief follows at most this far behind.
    """

    velocity_gate: float
    picture_gate: float
    velocity_mps: float
    velocity_least_mps: float
    velocity_most_mps: float
    velocity_repeats: float
    flow_settle_s: float
    lag_s: float


@dataclass(frozen=True)
class _Velocity:
    """A reading that waits for a picture: when it was true, and the share of ship in the view."""

    t_s: float
    measured_mps: Array
    over_ship: float


class DelayedFilter:
    """Belief at the newest picture, and a look ahead from it.

    Args:
        model: of the motion.
        parameters: of the measurements.
    """

    def __init__(self, model: Model, parameters: DelayedParameters) -> None:
        self.model, self._parameters = model, parameters
        self.belief: Belief | None = None
        self.normalised = 1.0
        """Of the newest picture."""
        self._velocities: list[_Velocity] = []
        self._velocity_variance = parameters.velocity_mps**2 / parameters.velocity_repeats
        self._refused = 0

    def start(self, t_s: float, place_m: Array, covariance_m2: Array, speed_mps: float) -> None:
        """Begin at a place."""
        self.belief = self.model.start(t_s, place_m, covariance_m2, speed_mps)
        self._refused = 0

    def adopt(self, model: Model) -> None:
        """Go on with a model of another swing."""
        self.model = model
        if self.belief is not None:
            self.belief = model.adopted(self.belief)

    def velocity(self, t_s: float, measured_mps: Array, over_ship: float = 0.0) -> None:
        """The vehicle's own velocity (axes,), true at `t_s`; `over_ship` as in `Model.velocity`."""
        if not self._velocities or t_s > self._velocities[-1].t_s + 1e-6:
            self._velocities.append(_Velocity(t_s, measured_mps, over_ship))

    def picture(
        self, t_s: float, place_m: Array, covariance_m2: Array, inputs: Inputs, turn_rad_s: float = 0.0
    ) -> bool:
        """A picture's place (axes,) of its exposure; False where it was refused as astray, or is too old."""
        if self.belief is None or t_s < self.belief.t_s - 1e-3:
            return False
        self._settle(t_s, inputs, turn_rad_s)
        seen = self.model.seen(self.belief)
        taken = updated(self.belief, seen, place_m, covariance_m2, self._parameters.picture_gate)
        self.belief, self.normalised = taken.belief, taken.normalised
        self._refused = 0 if taken.accepted else self._refused + 1
        return taken.accepted

    @property
    def refused(self) -> int:
        """Pictures refused since the last one that was taken."""
        return self._refused

    def follow(self, now_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> None:
        """Without pictures: keep the belief from falling further behind than `lag_s`."""
        to_s = now_s - self._parameters.lag_s
        if self.belief is not None and self.belief.t_s < to_s:
            self._settle(to_s, inputs, turn_rad_s)

    def ahead(self, t_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> Belief | None:
        """The belief at a later time, through what is known to be commanded until then."""
        belief = self.belief
        if belief is None:
            return None
        for reading in self._velocities:
            if reading.t_s <= t_s:
                belief = self._with(self._moved(belief, reading.t_s, inputs, turn_rad_s), reading)
        return self._moved(belief, t_s, inputs, turn_rad_s)

    def _settle(self, to_s: float, inputs: Inputs, turn_rad_s: float) -> None:
        """Advance the belief for good, and learn from the velocities on the way how large their errors are."""
        belief, waiting = self.belief, []
        assert belief is not None
        for reading in self._velocities:
            if reading.t_s > to_s:
                waiting.append(reading)
            elif reading.t_s > belief.t_s - _LATE_S:
                belief = self._moved(belief, reading.t_s, inputs, turn_rad_s)
                self._learn(belief, reading)
                belief = self._with(belief, reading)
        self._velocities = waiting
        self.belief = self._moved(belief, to_s, inputs, turn_rad_s)

    def _learn(self, belief: Belief, reading: _Velocity) -> None:
        expected, jacobian = self.model.velocity(belief, reading.over_ship, self._parameters.flow_settle_s)
        innovation = reading.measured_mps - expected
        known = np.einsum("ij,jk,ik->i", jacobian, belief.covariance, jacobian)
        found = float(np.mean(np.minimum(innovation**2, self._parameters.velocity_most_mps**2) - known))
        if math.isfinite(found):
            self._velocity_variance += _LEARNED * (found - self._velocity_variance)

    def _with(self, belief: Belief, reading: _Velocity) -> Belief:
        limits = self._parameters
        variance = limits.velocity_repeats * self._velocity_variance
        variance = min(max(variance, limits.velocity_least_mps**2), limits.velocity_most_mps**2)
        noise = variance * np.eye(len(reading.measured_mps))
        expected = self.model.velocity(belief, reading.over_ship, self._parameters.flow_settle_s)
        return updated(belief, expected, reading.measured_mps, noise, limits.velocity_gate).belief

    def _moved(self, belief: Belief, to_s: float, inputs: Inputs, turn_rad_s: float) -> Belief:
        """The mean in short strides, because the input changes; the covariance at once."""
        left_ms = all_ms = round(1e3 * (to_s - belief.t_s))
        if all_ms <= 0:
            return belief
        transition, _, noise = self.model.step(all_ms)
        covariance = transition @ belief.covariance @ transition.T + noise
        mean, t_s = belief.mean, belief.t_s
        while left_ms > 0:
            step_ms = min(left_ms, _STRIDE_MS)
            transition, push, _ = self.model.step(step_ms)
            after_s = t_s + 1e-3 * step_ms
            mean = transition @ mean + push @ inputs.mean(t_s, after_s)
            if turn_rad_s != 0.0 and self.model.axes == 2:
                mean = _turned(mean, turn_rad_s, 1e-3 * step_ms)
            t_s, left_ms = after_s, left_ms - step_ms
        return replace(belief, t_s=t_s, mean=mean, covariance=covariance)


def _turned(mean: Array, turn_rad_s: float, step_s: float) -> Array:
    """A ship that turns: its way, the velocity reference, turns with it, and the aircraft's own speed does not.

    The mean wind's push, as seen over the ship's way, is left as it is.
    """
    ahead, aside = (float(mean[STATES * axis + REFERENCE]) for axis in range(2))
    if not (math.isfinite(ahead) and math.isfinite(aside)):
        return mean
    change = (-turn_rad_s * aside * step_s, turn_rad_s * ahead * step_s)
    mean = mean.copy()
    for axis in range(2):
        mean[STATES * axis + REFERENCE] += change[axis]
        mean[STATES * axis + SPEED] -= change[axis]
    return mean
