"""A filter for late pictures: the belief stands at the newest picture, and what came since is replayed over it.

Pictures are the oldest news of all, so the belief never has to be taken back: velocity that is younger than the newest
picture waits, is used to look ahead, and enters for good when a younger picture comes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.estimation.kernels import add_input, mean_input, moved
from shipland.estimation.relative_state import REFERENCE, SPEED, STATES, Belief, Model, updated
from shipland.frames import Array

_KEPT_S = 4.0
_LATE_S = 0.1
"""A velocity may be this much older than the belief."""
_LEARNED = 0.08
"""Share with which a velocity changes what its errors are taken for: two seconds of 5 Hz."""
_STRIDE_MS = 80
"""Longest step of the mean: the input is averaged over it."""
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
        history = self.history
        from_s = add_input(history, self.count, from_s, value)
        self.count += 1
        if history[1, 0] < from_s - 2.0 * _KEPT_S:
            first = int(np.argmax(history[: self.count, 0] > from_s - _KEPT_S)) - 1
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


@dataclass(frozen=True)
class DelayedParameters:
    """How a `DelayedFilter` takes measurements.

    Attributes:
        velocity_gate, picture_gate: largest normalised innovation squared that is taken.
        velocity_mps: standard deviation of a velocity at first.
        velocity_most_mps: the most that it is then learned to be.
        velocity_repeats: readings err alike; so many times the variance seen is what one is given.
        flow_settle_s: time in which the vehicle's fusion follows the motion of what its optical flow sees.
        lag_s: without pictures the belief follows at most this far behind.
    """

    velocity_gate: float
    picture_gate: float
    velocity_mps: float
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
        velocity_least_mps: the least standard deviation that a velocity is given.
    """

    def __init__(self, model: Model, parameters: DelayedParameters, velocity_least_mps: float) -> None:
        self.model, self._parameters, self._velocity_least_mps = model, parameters, velocity_least_mps
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

    def copy(self) -> DelayedFilter:
        """Another of the same belief."""
        other = DelayedFilter(self.model, self._parameters, self._velocity_least_mps)
        other.belief, other.normalised = self.belief, self.normalised
        other._velocities, other._velocity_variance = list(self._velocities), self._velocity_variance
        return other

    def adopt(self, model: Model) -> None:
        """Go on with a model of another swing."""
        before, self.model = self.model.swing, model
        if self.belief is not None:
            self.belief = model.adopted(self.belief, before)

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
        expected, jacobian = self._expected(belief, reading)
        innovation = reading.measured_mps - expected
        known = np.einsum("ij,jk,ik->i", jacobian, belief.covariance, jacobian)
        found = float(np.mean(np.minimum(innovation**2, self._parameters.velocity_most_mps**2) - known))
        if math.isfinite(found):
            learned = self._velocity_variance + _LEARNED * (found - self._velocity_variance)
            self._velocity_variance = max(learned, 0.0)  # an uncertain belief expects more than is seen

    def _with(self, belief: Belief, reading: _Velocity) -> Belief:
        limits = self._parameters
        variance = limits.velocity_repeats * self._velocity_variance
        variance = min(max(variance, self._velocity_least_mps**2), limits.velocity_most_mps**2)
        noise, expected = variance * np.eye(self.model.axes), self._expected(belief, reading)
        return updated(belief, expected, reading.measured_mps, noise, limits.velocity_gate).belief

    def _expected(self, belief: Belief, reading: _Velocity) -> tuple[Array, Array]:
        return self.model.velocity(belief, reading.over_ship, self._parameters.flow_settle_s)

    def _moved(self, belief: Belief, to_s: float, inputs: Inputs, turn_rad_s: float) -> Belief:
        """The mean in short strides, because the input changes; the covariance at once."""
        all_ms = round(1e3 * (to_s - belief.t_s))
        if all_ms <= 0:
            return belief
        model = self.model
        all_of_it, push, noise = model.step(all_ms)
        transition = all_of_it
        whole, rest_ms = divmod(all_ms, _STRIDE_MS)
        if whole > 0:
            transition, push, _ = model.step(_STRIDE_MS)
        last_transition, last_push, _ = model.step(rest_ms) if whole > 0 and rest_ms > 0 else (transition, push, noise)
        mean, covariance = moved(
            belief.mean,
            belief.covariance,
            belief.t_s,
            (all_of_it, noise),
            (transition, push, last_transition, last_push),
            (whole, _STRIDE_MS, rest_ms),
            inputs.history,
            inputs.count,
            (turn_rad_s if model.axes == 2 else 0.0, SPEED, REFERENCE, STATES),
        )
        return Belief(belief.t_s + 1e-3 * all_ms, mean, covariance)
