"""The estimate of the pilot `horizon` at one time: what its modes, guidance, regulator and gimbal read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shipland.estimation.relative_state import (
    ACTUATION,
    POSITION,
    STATES,
    VELOCITY_BIAS,
    WAVE,
    AxisModel,
    GaussianState,
    Model,
    position_covariance,
)
from shipland.estimation.waves import WAVE_STATES, WaveMotion
from shipland.frames import GRAVITY_MPS2, Array, rotated

_STEP_MS = 20
"""To which times are rounded in predictions: a model keeps a matrix for each."""
_COURSE_SIGMAS = 2.0
"""Standard deviations of a velocity by which a ship must move for it to have a course."""


@dataclass(frozen=True)
class Actuation:
    """What the sticks have made of the vehicle, known from what was sent and from its attitude.

    Attributes:
        motion: the horizontal motion model in use.
        input_before: (2,) the newest input sent, in the axes of the flight [m/s², or m/s for a servo].
        tracked: (2,2) the speed that an autopilot tracks and its rate, by axes; None where its servo is not modelled.
        trim_mps2: (2,) acceleration by the mean tilt; of a vehicle that holds its position, against the mean wind.
        velocity_s: when the newest velocity of the vehicle was true.
    """

    motion: AxisModel
    input_before: Array
    tracked: Array | None
    trim_mps2: Array
    velocity_s: float


@dataclass(frozen=True)
class Estimated:
    """The estimate at one time; horizontal vectors in the axes of the flight, which do not turn.

    Attributes:
        t_s: the time that it holds for.
        across: horizontal state against the bar.
        down: vertical state, downward.
        model: horizontal, of the motion.
        wave, heave: models of the deck's and the bar's wave motion, horizontal and vertical.
        tracked_near: share of `wave.tracked` that is tracked at this distance, 0 to 1.
        place_m, speed_mps: (2,) of the aircraft from the bar, and its rate.
        followed_m, followed_mps: (2,) of the aircraft from the tracked part of the bar's motion: the position that is
            controlled over the deck, and its rate.
        down_m, down_mps: below the bar's centre, and its rate.
        nose_rad, bar_rad: headings in the axes of the flight.
        turn_rad_s: of the bar.
        bar_known: the bar's heading has been seen.
        to_bar_rad: heading of the bar from the aircraft; by the newest box, where that was seen last: the filter lags
            behind a ship that turns.
        to_bar_rad_s: its rate.
        deck_in_bar_m: (3,) the deck's neutral point.
        actuation: what the sticks have made of the vehicle.
    """

    t_s: float
    across: GaussianState
    down: GaussianState
    model: Model
    wave: WaveMotion
    heave: WaveMotion
    tracked_near: float
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
    to_bar_rad: float
    to_bar_rad_s: float
    deck_in_bar_m: Array
    actuation: Actuation

    @cached_property
    def offset_m(self) -> Array:
        """(2,) from the landing point, in the axes of the flight."""
        return self.followed_m - self.landing_point_m

    @cached_property
    def landing_point_m(self) -> Array:
        """(2,) from the bar, in the axes of the flight."""
        return rotated(self.deck_in_bar_m[:2], self.bar_rad)

    def by_turn_mps(self, place_m: Array) -> Array:
        """(2,) velocity by the bar's turn of a place (2,) from the bar."""
        return self.turn_rad_s * np.array([-place_m[1], place_m[0]])

    @cached_property
    def course_rad(self) -> float | None:
        """Direction of the ship's velocity, in the axes of the flight; None while that is not known from zero."""
        north, east = self.across.of(VELOCITY_BIAS).tolist()
        variances = np.diagonal(self.across.covariance)[VELOCITY_BIAS::STATES].tolist()
        return math.atan2(east, north) if north**2 + east**2 > _COURSE_SIGMAS**2 * max(variances) else None

    @property
    def observed_offset_m(self) -> Array:
        """(2,) from the landing point by the bar as it is seen, in the axes of the flight."""
        return self.place_m - self.landing_point_m

    @cached_property
    def height_m(self) -> float:
        """Of the aircraft's centre over the deck, whose height against a ship's bar a pitch changes."""
        return float(self.deck_in_bar_m[2]) - self.down_m + self._deck_below_bar(0)

    @cached_property
    def sink_mps(self) -> float:
        """The rate of `height_m`, downward."""
        return self.down_mps - self._deck_below_bar(1)

    @cached_property
    def tilt_mps2(self) -> Array:
        """(2,) acceleration by the aircraft's tilt."""
        tilt_mps2, actuation = self.across.of(ACTUATION), self.actuation
        return tilt_mps2 if actuation.tracked is None else tilt_mps2 + actuation.trim_mps2

    def over_deck_covariance_later(self, passed_s: float) -> Array:
        """(2,2) covariance of the place over the deck after `passed_s` in which nothing is measured."""
        covariance = self.model.covariance_after(self.across.covariance, _STEP_MS * round(1e3 * passed_s / _STEP_MS))
        return position_covariance(covariance, self.wave.deck[0])

    @cached_property
    def position_std_m(self) -> float:
        """Standard deviation of the observed position along the worse axis."""
        covariance = self.across.covariance
        return math.sqrt(max(covariance[POSITION, POSITION], covariance[STATES + POSITION, STATES + POSITION], 0.0))

    def deck_later(self, passed_s: float) -> Array:
        """(2,) the deck's centre after `passed_s`, from that of the controlled position, in the axes of the flight."""
        return self._wave_later(self.wave.deck[0] - np.asarray(self.tracked_near * self.wave.tracked[0]), passed_s)

    def deck_normal_mps2(self, passed_s: float) -> Array:
        """(2,) acceleration by a tilt along the deck's normal after `passed_s`.

        By a ship's roll its bar sways farther than the deck below it. Zero where the bar is at rest: it shows no roll.
        """
        if not self.wave.bar_moves:
            return np.zeros(2)
        per_m = GRAVITY_MPS2 / float(self.deck_in_bar_m[2])
        return self._wave_later((self.wave.bar[0] - self.wave.deck[0]) * per_m, passed_s)

    def _wave_later(self, shares: Array, passed_s: float) -> Array:
        """(2,) a sum of the states (4,) of the horizontal wave motion, after `passed_s`."""
        return np.array([shares @ self.wave.later(self.across.mean[_wave_of(axis)], passed_s) for axis in range(2)])

    def deck_rises_mps(self, passed_s: float) -> float:
        """Upward speed of the deck after `passed_s`."""
        return -float(self.heave.deck[1] @ self._heave_later(passed_s))

    def followed_rises_mps(self, passed_s: float) -> float:
        """That of the deck as the bar shows it, which is followed: none of a bar at rest."""
        return float(self.heave.bar_moves) * self.deck_rises_mps(passed_s)

    def _deck_below_bar(self, derivative: int) -> float:
        """By how much a ship's deck is lower than its heave alone would have it, or the rate of that."""
        shares = self.heave.deck[derivative] - self.heave.bar[derivative]
        return float(self.heave.bar_moves) * float(shares @ self._heave_later(0.0))

    def _heave_later(self, passed_s: float) -> Array:
        """(4,) the states of the vertical wave motion after `passed_s`."""
        return self.heave.later(self.down.mean[WAVE : WAVE + WAVE_STATES], passed_s)

    def followed_states(self, axis: int) -> Array:
        """(STATES,) of an axis for the gains, with the tracked part of the wave motion."""
        states = self.across.mean[STATES * axis : STATES * (axis + 1)].copy()
        states[WAVE : WAVE + WAVE_STATES] *= self.tracked_near
        return np.asarray(states)

    @cached_property
    def aircraft_in_bar_m(self) -> Array:
        """(3,)."""
        ahead_m, right_m = rotated(self.place_m, -self.bar_rad).tolist()
        return np.array([ahead_m, right_m, self.down_m])


def _wave_of(axis: int) -> slice:
    """The states of the wave motion along an axis."""
    return slice(STATES * axis + WAVE, STATES * axis + WAVE + WAVE_STATES)
