"""A filter for late pictures: the belief stands at the newest picture, and what came since is replayed over it.

Pictures are the oldest news of all, so the belief never has to be taken back: velocity that is younger than the newest
picture waits, is used to look ahead, and enters for good when a younger picture comes.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import replace

import numpy as np

from shipland.estimation.relative_state import REFERENCE, SPEED, STATES, Belief, Model, updated
from shipland.frames import Array

_KEPT_S = 4.0
_STRIDE_MS = 40
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


class DelayedFilter:
    """Belief at the newest picture, and a look ahead from it.

    Args:
        model: of the motion; may be exchanged for one of other sizes at any time.
        velocity_gate, picture_gate: largest normalised innovation squared that is taken.
        lag_s: without pictures the belief follows at most this far behind.
    """

    def __init__(self, model: Model, velocity_gate: float, picture_gate: float, lag_s: float) -> None:
        self.model = model
        self.belief: Belief | None = None
        self.normalised = 1.0
        """Of the newest picture."""
        self._gates, self._lag_s = (velocity_gate, picture_gate), lag_s
        self._velocities: list[tuple[float, Array, float]] = []
        self._refused = 0

    def start(self, t_s: float, place_m: Array, covariance_m2: Array, speed_mps: float) -> None:
        """Begin at a place."""
        self.belief = self.model.start(t_s, place_m, covariance_m2, speed_mps)
        self._refused = 0

    def velocity(self, t_s: float, measured_mps: Array, deviation_mps: float) -> None:
        """The vehicle's own velocity (axes,), true at `t_s`."""
        if self._velocities and t_s <= self._velocities[-1][0] + 1e-6:
            return
        self._velocities.append((t_s, measured_mps, deviation_mps**2))

    def picture(
        self, t_s: float, place_m: Array, covariance_m2: Array, inputs: Inputs, turn_rad_s: float = 0.0
    ) -> bool:
        """A picture's place (axes,) of its exposure; False where it was refused as astray, or is too old."""
        if self.belief is None or t_s < self.belief.t_s - 1e-3:
            return False
        self.belief = self._advanced(self.belief, t_s, inputs, turn_rad_s)
        self._velocities = [item for item in self._velocities if item[0] > self.belief.t_s]
        taken = updated(self.belief, self.model.seen(self.belief), place_m, covariance_m2, self._gates[1])
        self.belief, self.normalised = taken.belief, taken.normalised
        self._refused = 0 if taken.accepted else self._refused + 1
        return taken.accepted

    @property
    def refused(self) -> int:
        """Pictures refused since the last one that was taken."""
        return self._refused

    def follow(self, now_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> None:
        """Without pictures: keep the belief from falling further behind than `lag_s`."""
        if self.belief is not None and self.belief.t_s < now_s - self._lag_s:
            self.belief = self._advanced(self.belief, now_s - self._lag_s, inputs, turn_rad_s)
            self._velocities = [item for item in self._velocities if item[0] > self.belief.t_s]

    def ahead(self, t_s: float, inputs: Inputs, turn_rad_s: float = 0.0) -> Belief | None:
        """The belief at a later time, through what is known to be commanded until then."""
        return None if self.belief is None else self._advanced(self.belief, t_s, inputs, turn_rad_s)

    def _advanced(self, belief: Belief, to_s: float, inputs: Inputs, turn_rad_s: float) -> Belief:
        for t_s, measured, variance in self._velocities:
            if belief.t_s - 0.1 < t_s <= to_s:
                belief = self._moved(belief, t_s, inputs, turn_rad_s)
                noise = variance * np.eye(len(measured))
                belief = updated(belief, self.model.velocity(belief), measured, noise, self._gates[0]).belief
        return self._moved(belief, to_s, inputs, turn_rad_s)

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
