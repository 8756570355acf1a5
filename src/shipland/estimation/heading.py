"""Headings of the aircraft and of the bar, and the bar's turn: small filters at the times of pictures.

Headings are clockwise from the axes of the frame that the flight is estimated in (north by the compass; the first
nose direction without one). A pose measures the difference of the two, the compass the first; the yaw sticks propagate
it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters, scaled
from shipland.estimation.delayed import Inputs
from shipland.estimation.kernels import correct, predicted_covariance
from shipland.frames import Array, wrap_angle
from shipland.messages import BarPose


@parameters
class HeadingNoise:
    """`[guidance.horizon.heading]`."""

    nose_rad_per_sqrt_s: float = key(0.2, "random walk of the nose's heading against the yaw sticks")
    bar_rad_per_sqrt_s: float = scaled(0.002, "random walk of the bar's heading against its turn")
    turn_rad_s2: float = scaled(0.002, "growth of the uncertainty of the bar's turn [rad/s per √s]")
    compass_rad: float = key(0.05, "standard deviation of one compass reading")
    pose_rad: float = key(0.001, "least standard deviation of a pose's yaw")


class Headings(NamedTuple):
    """Nose, bar [rad] and the bar's turn [rad/s], clockwise, at one time.

    Attributes:
        covariance: (3,3).
        bar_known: a pose has shown the bar's heading.
        posed_s: time of the last pose.
    """

    t_s: float
    nose_rad: float
    bar_rad: float
    turn_rad_s: float
    covariance: Array
    bar_known: bool = False
    posed_s: float = -math.inf


def first_headings(t_s: float, nose_rad: float) -> Headings:
    """At the begin of a flight; of the bar nothing is known."""
    return Headings(t_s, nose_rad, nose_rad, 0.0, np.diag([0.03**2, 2.0**2, 0.05**2]))


def headings_at(before: Headings, t_s: float, turned_rad: float, noise: HeadingNoise) -> Headings:
    """Propagated to `t_s`, the nose turned by `turned_rad` by its sticks."""
    if t_s <= before.t_s:
        return before
    step_s = t_s - before.t_s
    turn = before.turn_rad_s if before.bar_known else 0.0
    if t_s - before.posed_s > _UNSEEN_S:  # a turn that is no longer seen decays
        turn *= math.exp(-step_s / _TURN_ENDS_S)
    walk = (noise.nose_rad_per_sqrt_s**2, noise.bar_rad_per_sqrt_s**2, noise.turn_rad_s2**2)
    nose_rad, bar_rad = before.nose_rad + turned_rad, before.bar_rad + turn * step_s
    covariance = _propagated(before.covariance, step_s, walk)
    return Headings(t_s, nose_rad, bar_rad, turn, covariance, before.bar_known, before.posed_s)


@compiled
def _propagated(covariance: Array, step_s: float, walk: tuple[float, float, float]) -> Array:
    transition, noise = np.eye(3), np.zeros((3, 3))
    transition[1, 2] = step_s
    for i in range(3):
        noise[i, i] = walk[i] * step_s
    return predicted_covariance(transition, covariance, noise)


def shifted(before: Headings, by_rad: float) -> Headings:
    """Both headings turned by `by_rad`; what they differ by stays."""
    by_rad = wrap_angle(by_rad)
    return before._replace(nose_rad=before.nose_rad + by_rad, bar_rad=before.bar_rad + by_rad)


def anchored(after: Headings, bar_rad: float) -> Headings:
    """With the axes of the flight turned so that the bar's heading is `bar_rad`, and known.

    Without a compass only the difference of the headings is observable. Otherwise an oscillating nose would be taken
    for an unseen turn, and axes, bar and position would oscillate with it.
    """
    (nose, both, nose_turn), (_, bar, bar_turn), (_, _, turn) = after.covariance.tolist()
    off, off_turn = nose - 2.0 * both + bar, nose_turn - bar_turn
    covariance = np.array([[off, 0.0, off_turn], [0.0, 0.0, 0.0], [off_turn, 0.0, turn]])
    return shifted(after, bar_rad - after.bar_rad)._replace(covariance=covariance)


def with_compass(before: Headings, heading_rad: float, noise: HeadingNoise) -> Headings:
    """A compass reading of its time; not finite is refused."""
    return _with(before, 0.0, heading_rad - before.nose_rad, noise.compass_rad**2, before.posed_s)


def with_pose(before: Headings, yaw_rad: float, variance_rad2: float, noise: HeadingNoise) -> Headings:
    """A pose's yaw: the nose against the bar."""
    variance_rad2 = max(variance_rad2, noise.pose_rad**2)
    if not before.bar_known:
        covariance = before.covariance.copy()
        covariance[1, :] = covariance[:, 1] = 0.0
        covariance[1, 1] = covariance[0, 0] + variance_rad2
        covariance[0, 1] = covariance[1, 0] = covariance[0, 0]
        bar_rad = wrap_angle(before.nose_rad - yaw_rad)
        return Headings(before.t_s, before.nose_rad, bar_rad, 0.0, covariance, True, before.t_s)
    return _with(before, -1.0, yaw_rad - (before.nose_rad - before.bar_rad), variance_rad2, before.t_s)


def _with(before: Headings, bar: float, innovation_rad: float, variance: float, posed_s: float) -> Headings:
    """With a reading of the nose's heading plus `bar` times the bar's; as it was where that is not finite."""
    if not (math.isfinite(innovation_rad) and math.isfinite(variance)):
        return before
    mean, covariance = (before.nose_rad, before.bar_rad, before.turn_rad_s), before.covariance.copy()
    mean = _corrected(mean, covariance, bar, wrap_angle(innovation_rad), variance)
    return Headings(before.t_s, *mean, covariance, before.bar_known, posed_s)


_Mean = tuple[float, float, float]


@compiled
def _corrected(before: _Mean, covariance: Array, bar: float, innovation_rad: float, variance: float) -> _Mean:
    """The mean after a reading; the covariance in place."""
    row, off, noise = np.array([[1.0, bar, 0.0]]), np.array([innovation_rad]), np.array([[variance]])
    mean = np.array([before[0], before[1], before[2]])
    correct(mean, covariance, row, off, noise, math.inf)
    return mean[0], mean[1], mean[2]


class Compass:
    """The newest readings of a compass, so that a picture is taken with the heading of its own exposure."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_READINGS_KEPT)
        self._headings_rad: deque[float] = deque(maxlen=_READINGS_KEPT)
        self._off_rad = 0.0
        self._leapt_s: float | None = None

    def add(self, t_s: float, heading_rad: float) -> None:
        """A reading and its time; what is not finite or no news changes nothing."""
        if math.isfinite(t_s) and math.isfinite(heading_rad) and not (self._times and t_s <= self._times[-1]):
            self._times.append(t_s)
            self._headings_rad.append(heading_rad)

    def silent(self, t_s: float) -> bool:
        """No reading for a while before `t_s`, or none at all."""
        return not self._times or t_s - self._times[-1] > _SILENT_S

    def since(self, before_s: float, t_s: float) -> tuple[float, float] | None:
        """The newest reading after `before_s` and not after `t_s`: its time and heading; None without one."""
        last = bisect_right(self._times, t_s) - 1
        if last < 0 or self._times[last] <= before_s:
            return None
        return self._times[last], self._headings_rad[last]

    def accepted(
        self, headings: Headings, t_s: float, turned_rad: Callable[[float, float], float]
    ) -> tuple[float, float] | None:
        """The newest reading that is news at `t_s`: its time and heading; None without one that is accepted.

        While poses tell the nose against the bar, a leap of the compass is no turn: neither can have turned so fast. It
        is refused, and where the compass keeps to it, taken for its own error from then on.

        Args:
            headings: before the reading.
            t_s: of the picture.
            turned_rad: how far the yaw sticks turned the nose from one time to another.
        """
        # A reading counts once: between readings the nose may oscillate, which an interpolation would miss.
        reading = self.since(headings.t_s, t_s)
        if reading is None:
            return None
        read_s, heading_rad = reading[0], reading[1] - self._off_rad
        off_rad = wrap_angle(heading_rad - headings.nose_rad - turned_rad(headings.t_s, read_s))
        if t_s - headings.posed_s > _POSED_S or abs(off_rad) < _LEAP_RAD:
            self._leapt_s = None
            return read_s, heading_rad
        if self._leapt_s is None:
            self._leapt_s = t_s
        elif t_s - self._leapt_s > _LEAPS_S:
            self._off_rad, self._leapt_s = wrap_angle(self._off_rad + off_rad), None
        return None

    def at(self, t_s: float) -> float | None:
        """Heading [rad] by line between readings, the nearest one outside them; None without a reading."""
        times, headings_rad = self._times, self._headings_rad
        if not times:
            return None
        after = bisect_right(times, t_s)
        if after in (0, len(times)):
            return headings_rad[0 if after == 0 else -1]
        begin_s, begin_rad = times[after - 1], headings_rad[after - 1]
        share = (t_s - begin_s) / (times[after] - begin_s)
        return begin_rad + share * wrap_angle(headings_rad[after] - begin_rad)


_READINGS_KEPT = 64
_POSED_S, _LEAP_RAD, _LEAPS_S = 0.5, math.radians(10.0), 1.0
"""With a pose as young as this a compass that is off by more has leapt, and after so long has a new error."""
_SILENT_S = 5.0
"""A compass without a reading for this long counts as absent."""
_UNSEEN_S = 2.0
"""A turn is kept for this long without a pose …"""
_TURN_ENDS_S = 5.0
"""… and then decays, with this time constant."""
_STILL_TURNS = 0.4
"""A ship that turned counts as turning down to this share: what is left of the turn, the quiet filter would keep."""


class HeadingFilters:
    """Two filters: one for a ship that keeps its course, quiet, and one for a ship that turns.

    Where the one takes over from the other, the bar's heading does not step: the estimate's axes turn with it.

    Args:
        steady: of a ship that keeps its course.
        turning: of one that turns.
        turn_from_rad_s: yaw rate of the ship from which it counts as turning, until it is well below.
    """

    def __init__(self, steady: HeadingNoise, turning: HeadingNoise, turn_from_rad_s: float) -> None:
        self._noise, self._noise_turning, self._turn_from_rad_s = steady, turning, turn_from_rad_s
        self._turns = Inputs(1)
        self._compass = Compass()
        self._turning: Headings | None = None
        self.now: Headings | None = None
        """The headings at the newest picture."""

    @property
    def turning(self) -> bool:
        """The ship counts as one that turns."""
        return self.now is self._turning

    @property
    def turn_rad_s(self) -> float:
        """Of the bar, where its heading has been seen."""
        return self.now.turn_rad_s if self.now is not None and self.now.bar_known else 0.0

    def sent(self, effect_s: float, turn_rad_s: float) -> None:
        """What the yaw stick asks for, from `effect_s` on."""
        self._turns.add(effect_s, np.array([turn_rad_s]))

    def compass(self, t_s: float, heading_rad: float) -> None:
        """A reading and its time."""
        self._compass.add(t_s, heading_rad)

    def nose_at(self, t_s: float) -> float:
        """The nose's heading, propagated by the yaw sticks; 0 before the first picture."""
        headings = self.now
        if headings is None:
            return 0.0
        return headings.nose_rad + self._turned_rad(headings.t_s, t_s)

    def take(self, t_s: float, pose: BarPose | None) -> Headings:
        """The headings at a picture."""
        if self.now is None or self._turning is None:
            self.now = self._turning = first_headings(t_s, self._compass.at(t_s) or 0.0)
        turning_before = self.turning
        reading = self._compass.accepted(self.now, t_s, self._turned_rad)
        self._turning = self._with_news(self._turning, t_s, pose, reading, self._noise_turning)
        quiet = self._with_news(self.now, t_s, pose, reading, self._noise)
        least_rad_s = self._turn_from_rad_s * (_STILL_TURNS if turning_before else 1.0)
        if self._turning.bar_known and abs(self._turning.turn_rad_s) > least_rad_s:
            if not turning_before:
                self._turning = shifted(self._turning, quiet.bar_rad - self._turning.bar_rad)
            self.now = self._turning
        else:
            self.now = quiet
        return self.now

    def _turned_rad(self, from_s: float, to_s: float) -> float:
        """How far the yaw sticks turned the nose; nothing backwards in time."""
        return self._turns.mean(from_s, to_s) * (to_s - from_s) if to_s > from_s else 0.0

    def _with_news(
        self,
        headings: Headings,
        t_s: float,
        pose: BarPose | None,
        reading: tuple[float, float] | None,
        noise: HeadingNoise,
    ) -> Headings:
        headings = headings_at(headings, t_s, self._turned_rad(headings.t_s, t_s), noise)
        if reading is not None:
            read_s, heading_rad = reading
            headings = with_compass(headings, heading_rad + self._turned_rad(read_s, t_s), noise)
        if pose is not None:
            after = with_pose(headings, pose.yaw_rad, float(pose.covariance[3, 3]), noise)
            alone = headings.bar_known and self._compass.silent(t_s)
            headings = anchored(after, headings.bar_rad) if alone else after
        return headings
