"""Headings of the aircraft and of the bar, and the bar's turn: a small filter at the times of pictures.

Headings are clockwise from the axes of the frame that the flight is estimated in (north by the compass; the first
nose direction without one). A pose tells the difference of the two, the compass the first; the yaw sticks carry it on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipland.frames import Array, wrap_angle


@dataclass(frozen=True)
class HeadingNoise:
    """`[guidance.horizon.heading]`.

    Attributes:
        nose_rad_per_sqrt_s: what the nose's heading strays from the yaw sticks.
        bar_rad_per_sqrt_s: what the bar's heading strays from its turn.
        turn_rad_s2: growth of the uncertainty of the bar's turn [rad/s per √s].
        compass_rad: standard deviation of one compass reading.
        pose_rad: least standard deviation of a pose's yaw.
    """

    nose_rad_per_sqrt_s: float
    bar_rad_per_sqrt_s: float
    turn_rad_s2: float
    compass_rad: float
    pose_rad: float


@dataclass(frozen=True)
class Headings:
    """Nose, bar [rad], the bar's turn [rad/s], and their covariance (3,3), at one time.

    Attributes:
        bar_known: a pose has told the bar's heading.
    """

    t_s: float
    mean: Array
    covariance: Array
    bar_known: bool = False

    @property
    def nose_rad(self) -> float:
        """Of the aircraft's nose."""
        return float(self.mean[0])

    @property
    def bar_rad(self) -> float:
        """Of the bar's forward axis."""
        return float(self.mean[1])

    @property
    def turn_rad_s(self) -> float:
        """Of the bar, clockwise."""
        return float(self.mean[2])


def first_headings(t_s: float, nose_rad: float) -> Headings:
    """At the begin of a flight; of the bar nothing is known."""
    return Headings(t_s, np.array([nose_rad, nose_rad, 0.0]), np.diag([0.03**2, 2.0**2, 0.05**2]))


def headings_at(before: Headings, t_s: float, turned_rad: float, noise: HeadingNoise) -> Headings:
    """Carried on to `t_s`, the nose turned by `turned_rad` by its sticks."""
    step_s = t_s - before.t_s
    if step_s <= 0.0:
        return before
    nose, bar, turn = before.mean.tolist()
    turn = turn if before.bar_known else 0.0
    mean = np.array([nose + turned_rad, bar + turn * step_s, turn])
    transition = np.eye(3)
    transition[1, 2] = step_s
    covariance = transition @ before.covariance @ transition.T
    covariance[0, 0] += noise.nose_rad_per_sqrt_s**2 * step_s
    covariance[1, 1] += noise.bar_rad_per_sqrt_s**2 * step_s
    covariance[2, 2] += noise.turn_rad_s2**2 * step_s
    return replace(before, t_s=t_s, mean=mean, covariance=covariance)


def with_compass(before: Headings, heading_rad: float, noise: HeadingNoise) -> Headings:
    """A compass reading of its time; not finite is refused."""
    return _corrected(before, np.array([1.0, 0.0, 0.0]), heading_rad, noise.compass_rad**2)


def with_pose(before: Headings, yaw_rad: float, variance_rad2: float, noise: HeadingNoise) -> Headings:
    """A pose's yaw: the nose against the bar."""
    variance_rad2 = max(variance_rad2, noise.pose_rad**2)
    if not before.bar_known:
        mean, covariance = before.mean.copy(), before.covariance.copy()
        mean[1], mean[2] = wrap_angle(before.nose_rad - yaw_rad), 0.0
        covariance[1, :] = covariance[:, 1] = 0.0
        covariance[1, 1] = covariance[0, 0] + variance_rad2
        covariance[0, 1] = covariance[1, 0] = covariance[0, 0]
        return replace(before, mean=mean, covariance=covariance, bar_known=True)
    return _corrected(before, np.array([1.0, -1.0, 0.0]), yaw_rad, variance_rad2)


def _corrected(before: Headings, row: Array, measured_rad: float, variance: float) -> Headings:
    innovation = measured_rad - float(row @ before.mean)
    if not (math.isfinite(innovation) and math.isfinite(variance)):
        return before
    crossed = before.covariance @ row
    spread = float(row @ crossed) + variance
    mean = before.mean + crossed * (wrap_angle(innovation) / spread)
    covariance = before.covariance - np.outer(crossed, crossed) / spread
    return replace(before, mean=mean, covariance=0.5 * (covariance + covariance.T))
