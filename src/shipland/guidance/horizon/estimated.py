"""The estimate of the pilot `horizon` at one time, and the axes that it is told in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shipland.estimation.relative_state import POSITION, STATES, WAVE, GaussianState, position_covariance
from shipland.estimation.wave_motion import WAVE_STATES, WaveMotion
from shipland.frames import Array, rotated


@dataclass(frozen=True)
class Estimated:
    """The estimate at one time; horizontal vectors in the axes of the flight, which do not turn.

    Attributes:
        t_s: the time that it holds for.
        across: place and motion against the bar, horizontally; downward.
        down: likewise, downward.
        wave: what both take the deck's and the bar's wave motion for.
        near: how much of `wave.tracked_share` is followed from here, 0 to 1.
        place_m, speed_mps: (2,) of the aircraft from the bar, in the axes of the flight, and its rate.
        followed_m, followed_mps: (2,) of the aircraft from what it follows of the bar: the place that errs over the
            deck, and its rate.
        down_m, down_mps: below the bar's centre, and its rate.
        nose_rad, bar_rad: headings in the axes of the flight.
        turn_rad_s: of the bar.
        bar_known: the bar's heading has been seen.
        yaw_variance: of the difference of the two headings [rad²].
        to_bar_rad: heading of the bar from the aircraft; by the newest box, where that was seen last: a ship that turns
            is soon not where the filter takes it to be.
    """

    t_s: float
    across: GaussianState
    down: GaussianState
    wave: WaveMotion
    near: float
    place_m: Array
    speed_mps: Array
    followed_m: Array
    followed_mps: Array
    down_m: float
    down_mps: float
    nose_rad: float
    bar_rad: float
    turn_rad_s: float
    bar_known: bool
    yaw_variance: float
    to_bar_rad: float

    @cached_property
    def spread_m(self) -> float:
        """Standard deviation of the place along the worse axis."""
        covariance = self.across.covariance
        return math.sqrt(max(covariance[POSITION, POSITION], covariance[STATES + POSITION, STATES + POSITION], 0.0))

    def deck_later(self, passed_s: float) -> tuple[Array, float]:
        """Where the deck's centre will be.

        Returns:
            (2,) from the place that errs over the deck (`followed_m`), in the axes of the flight, and the standard
            deviation of it along the worse axis.
        """
        share, wave = self.wave.deck_share - self.near * self.wave.tracked_share, self.wave
        shifts, variances = [], []
        for axis in range(2):
            states = slice(STATES * axis + WAVE, STATES * axis + WAVE + WAVE_STATES)
            shifts.append(share * float(wave.later(self.across.mean[states], passed_s)[0]))
            variances.append(share**2 * wave.variance_later(self.across.covariance[states, states], passed_s))
        return np.array(shifts), math.sqrt(max(*variances, 0.0))

    def deck_rises_mps(self, passed_s: float) -> float:
        """Upward speed of the deck a while later."""
        states = self.down.mean[WAVE : WAVE + WAVE_STATES]
        return -self.wave.deck_share * float(self.wave.later(states, passed_s)[1])

    def followed_states(self, axis: int) -> Array:
        """(STATES,) of an axis for the gains, with that part of the wave motion that is followed."""
        states = self.across.mean[STATES * axis : STATES * (axis + 1)].copy()
        states[WAVE : WAVE + WAVE_STATES] *= self.near
        return np.asarray(states)

    @cached_property
    def aircraft_in_bar_m(self) -> Array:
        """(3,)."""
        ahead_m, right_m = rotated(self.place_m, -self.bar_rad).tolist()
        return np.array([ahead_m, right_m, self.down_m])

    @property
    def covariance(self) -> Array:
        """(4,4) of `aircraft_in_bar_m` and yaw [m, m, m, rad].

        Poses enter turned by the bar's heading and leave turned back by it, so that its error cancels in the place;
        place and yaw come from filters of their own, so that what they share is not known and stands as zero.
        """
        cosine, sine = math.cos(self.bar_rad), math.sin(self.bar_rad)
        axes = np.array([[cosine, sine], [-sine, cosine]])
        covariance = np.zeros((4, 4))
        shown = self.wave.observed_share
        covariance[:2, :2] = axes @ position_covariance(self.across.covariance, shown) @ axes.T
        covariance[2, 2] = position_covariance(self.down.covariance, shown)[0, 0]
        covariance[3, 3] = self.yaw_variance
        return covariance
