"""Headings of nose and bar through a flight: compass, poses and yaw sticks, for a ship that turns or does not."""

from __future__ import annotations

import numpy as np

from shipland.estimation.delayed import Inputs
from shipland.estimation.heading import (
    Compass,
    HeadingNoise,
    Headings,
    anchored,
    first_headings,
    headings_at,
    shifted,
    with_compass,
    with_pose,
)
from shipland.messages import BarPose


class HeadingFilters:
    """Two filters: one for a ship that keeps its course, quiet, and one for a ship that turns.

    Where the one takes over from the other, the bar's heading does not step: the estimate's axes turn with it.

    Args:
        steady: of a ship that keeps its course.
        turning: of one that turns.
        turn_from_rad_s: yaw rate of the ship from which it counts as turning.
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
        if self._turning.bar_known and abs(self._turning.turn_rad_s) > self._turn_from_rad_s:
            if not turning_before:
                self._turning = shifted(self._turning, quiet.bar_rad - self._turning.bar_rad)
            self.now = self._turning
        else:
            self.now = quiet
        return self.now

    def _turned_rad(self, from_s: float, to_s: float) -> float:
        """How far the yaw sticks turned the nose; nothing backwards in time."""
        return float(self._turns.mean(from_s, to_s)[0]) * (to_s - from_s) if to_s > from_s else 0.0

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
