"""The regulator: from the estimate and the plan to the sticks, linear-quadratic on the state at the command's effect.

The state is an axis of the relative state and the stick input before; what is chosen is the change of that input. The
cost is the squared offset from the bar's place, its rate, the aircraft's acceleration and the rate of the input: a
steady wind costs nothing, so that nothing pulls the aircraft off its place. All commands that are still on the way are
in the prediction, which makes the delay a part of the state as a whole.

Just before contact the tilt against the deck is reduced to what a contact allows. In wind an aircraft holds its place
tilted, and a deck that rolls adds to that or takes from it. Up to `levelling.tilt_deg` remains: level, the aircraft
would drift with the wind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from shipland.estimation.relative_state import (
    ACTUATION,
    POSITION,
    STATES,
    VELOCITY,
    WAVE,
    AxisModel,
    Disturbances,
    discretised,
    dynamics,
    shaping,
)
from shipland.estimation.waves import WAVE_STATES, WaveMotion
from shipland.frames import Array, rotated
from shipland.guidance.horizon.descent import Descent, Phase
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.parameters import HorizonParameters, LevellingParameters, Weights
from shipland.guidance.response import Response, SticksPercent, clamp

if TYPE_CHECKING:
    from shipland.guidance.horizon.steering import Steering  # a policy: other flights do without

INPUT_RATE_SHARE = 2.0
"""Most that an input may change, as a share of the rate at which the vehicle can follow.

Beyond 1 it is followed late. Held back to 0.7, gusts of 9 m/s of wind are answered later still:
docs/results/guidance.md.
"""
_KICK_MPS2 = 3.0
"""Largest acceleration of an autopilot that tracks a speed: PX4's MPC_ACC_HOR as delivered."""
_STEPS_MS = (33, 67, 100, 200, 350, 530)
"""Cycles that gains are kept for; the nearest is taken."""
LONGEST_CONTACT_S = 3.0
"""The predicted time to contact is cut to this: farther ahead nothing is predicted."""
INPUT, TRACKED, TRACKED_RATE = STATES, STATES + 1, STATES + 2
"""Index of the input before in the control's state; of the speed that a servo with an integral tracks, and its rate."""


@dataclass(frozen=True)
class Gains:
    """Gains for one length of cycle.

    Attributes:
        step_s: the cycle.
        steady: (11,), or (13,) with a tracked speed: the change of the input is −steady · (state − reference).
        to_contact: (k, 11 or 13) the same, by whole cycles left to contact.
        offset_to_contact: (k + 1, 11 or 13) the offset at contact, so many cycles away, under `to_contact`.
    """

    step_s: float
    steady: Array
    to_contact: Array
    offset_to_contact: Array


@lru_cache(maxsize=256)
def gains_of(motion: AxisModel, noise: Disturbances, wave: WaveMotion, weights: Weights, step_ms: int) -> Gains:
    """Solve for one vehicle, sea and cycle."""
    from scipy.linalg import solve_discrete_are

    step_s = 1e-3 * step_ms
    a, b, q = dynamics(motion, noise, wave)
    tracked = [] if motion.inputs == 1 else [TRACKED, TRACKED_RATE]
    moving = [*range(STATES), *tracked]
    size = STATES + 1 + len(tracked)
    to_bar, rate, acceleration = np.zeros(size), np.zeros(size), np.zeros(size)
    waves, (of_deck, of_its_rate) = slice(WAVE, WAVE + WAVE_STATES), wave.tracked
    to_bar[POSITION], to_bar[waves], rate[VELOCITY], rate[waves] = 1.0, -of_deck, 1.0, -of_its_rate
    acceleration[:STATES] = a[VELOCITY]
    if tracked:
        a, b, q = _with_tracked(motion, a, b, q)
    transition, push, _ = discretised(a, b, q, step_s)
    big, entry = np.zeros((size, size)), np.zeros(size)
    big[np.ix_(moving, moving)], big[moving, INPUT], big[INPUT, INPUT] = transition, push[:, 0], 1.0
    entry[moving], entry[INPUT] = push[:, 0], 1.0
    cost = np.outer(to_bar, to_bar) + weights.speed * np.outer(rate, rate)
    cost = step_s * (cost + weights.acceleration * np.outer(acceleration, acceleration))
    effort = weights.input_rate / step_s
    # SciPy wants no eigenvalue on the unit circle: the input before has one, and is reached by the control.
    value = solve_discrete_are(big, entry[:, None], cost, np.array([[effort]]))
    steady = _gain(big, entry, value, effort)
    count = max(1, round(weights.horizon_s / step_s))
    final = weights.final_place * np.outer(to_bar, to_bar) + weights.final_speed * np.outer(rate, rate)
    rows, offsets = [], [to_bar]
    for _ in range(count):
        gain = _gain(big, entry, final, effort)
        closed = big - np.outer(entry, gain)
        final = cost + effort * np.outer(gain, gain) + closed.T @ final @ closed
        rows.append(gain)
        offsets.append(offsets[-1] @ closed)
    return Gains(step_s, steady, np.array(rows), np.array(offsets))


def _with_tracked(motion: AxisModel, a: Array, b: Array, q: Array) -> tuple[Array, Array, Array]:
    """The dynamics with the tracked speed and its rate as two more states (12,), driven by the speed asked for."""
    n = STATES + 2
    own, asked = shaping(motion)
    wide, entry = np.zeros((n, n)), np.zeros((n, 1))
    wide[:STATES, :STATES], wide[STATES:, STATES:], entry[STATES:, 0] = a, own, asked
    wide[:STATES, STATES], wide[:STATES, STATES + 1] = b.sum(axis=1), b[:, 0] / motion.servo_per_s
    return wide, entry, np.append(q, np.zeros(2))


def _gain(big: Array, entry: Array, value: Array, effort: float) -> Array:
    weighted = entry @ value
    return np.asarray((weighted @ big) / (effort + weighted @ entry))


def tilt_near_contact(
    wanted: Array, normal_mps2: Array, left_s: float, response: Response, parameters: LevellingParameters
) -> Array:
    """(2,) the input of sticks that mean a tilt [m/s²].

    Args:
        wanted: (2,) by the gains.
        normal_mps2: (2,) of a tilt along the deck's normal at contact.
        left_s: to contact, from the command's effect.
        response: of the vehicle.
        parameters: of the levelling.
    """
    early_s = max(left_s - parameters.before_contact_s(response), 0.0)
    return normal_mps2 + shortened(wanted - normal_mps2, parameters.tilt_mps2 + response.max_input_rate * early_s)


def speed_near_contact(
    wanted: Array,
    normal_mps2: Array,
    tilt: Array,
    tracked_mps: Array,
    response: Response,
    parameters: LevellingParameters,
) -> Array:
    """(2,) the input of sticks that mean a speed [m/s]: the autopilot levels out where it is to change its speed.

    Args:
        wanted: (2,) by the gains.
        normal_mps2: (2,) acceleration by a tilt along the deck's normal at contact.
        tilt: (2,) acceleration by the aircraft's tilt, but for what changes of the tracked speed ask for [m/s²].
        tracked_mps: (2,) the speed that the autopilot tracks.
        response: of the vehicle.
        parameters: of the levelling.
    """
    change = shortened(response.approach_per_s * (wanted - tracked_mps), _KICK_MPS2)
    tilted = tilt + change - normal_mps2
    level = shortened(tilted, parameters.tilt_mps2)
    if level is tilted:
        return wanted
    return tracked_mps + shortened(normal_mps2 + level - tilt, _KICK_MPS2) / response.approach_per_s


def shortened(vector: Array, most: float) -> Array:
    """(2,) the vector, no longer than `most`."""
    size = math.hypot(*vector.tolist())
    return vector if size <= most else vector * (most / size)


@dataclass(frozen=True)
class Reference:
    """Where the aircraft shall be, against the bar, in the axes of the estimate.

    Attributes:
        place_m: (2,).
        speed_mps: (2,) its rate.
        rate_mps2: (2,) and that of the speed.
    """

    place_m: Array
    speed_mps: Array
    rate_mps2: Array


@dataclass(frozen=True)
class Plan:
    """What guidance hands to the regulator.

    Attributes:
        reference: of the horizontal motion.
        gains: that track it.
        climb_mps: climb rate, upward.
        turn_rad_s: yaw rate, clockwise.
        contact_s: time to contact in a final descent that begins now, or has begun.
        descent: of a landing; None outside one.
        odds: of a landing, if the final descent began now or from the wait; None far from the landing point.
        steerable: near the landing point, where a policy may change the input.
    """

    reference: Reference
    gains: Gains
    climb_mps: float
    turn_rad_s: float
    contact_s: float
    descent: Descent | None
    odds: float | None
    steerable: bool

    @property
    def in_final_descent(self) -> bool:
        """The final descent has begun."""
        return self.descent is not None and self.descent.phase is Phase.FINAL_DESCENT


class Regulator:
    """Linear-quadratic, on the state predicted to the command's effect; keeps nothing between cycles.

    Args:
        parameters: of the pilot.
        response: of the vehicle.
        steering: a policy that changes the horizontal input near the landing point; None flies without.
    """

    def __init__(self, parameters: HorizonParameters, response: Response, steering: Steering | None) -> None:
        self._parameters, self._response, self._steering = parameters, response, steering

    def gains(self, estimate: Estimated, gentle: bool, cycle_s: float) -> Gains:
        """Those of the nearest length of cycle; `gentle` ones are for large errors and for pictures alone."""
        step_ms = min(_STEPS_MS, key=lambda ms: abs(ms - 1e3 * cycle_s))
        parameters, motion = self._parameters, estimate.actuation.motion
        noise, weights = parameters.horizontal, parameters.weights
        if motion.servo_per_s > 0.0:
            noise, weights = parameters.horizontal_servo, parameters.weights_servo
        return gains_of(motion, noise, estimate.wave, parameters.weights_blind if gentle else weights, step_ms)

    def at_contact(
        self, estimate: Estimated, reference: Reference, gains: Gains, contact_s: float
    ) -> tuple[Array, Array]:
        """(2,) and (2,2): offset from the deck's centre predicted for a contact in `contact_s`, and its covariance.

        The gains bring the aircraft to the reference, which trails the landing point of a ship that turns.
        """
        left = min(max(round(contact_s / gains.step_s), 0), len(gains.to_contact))
        contact_s = min(contact_s, LONGEST_CONTACT_S)
        rows = gains.offset_to_contact[left]
        offsets_m = [rows @ self._control_state(estimate, reference, axis) for axis in range(2)]
        trails_mps = reference.speed_mps - estimate.by_turn_mps(estimate.landing_point_m)
        trails_m = reference.place_m - estimate.landing_point_m + contact_s * trails_mps
        offset_m = trails_m + np.array(offsets_m) - estimate.deck_later(contact_s)
        return offset_m, estimate.over_deck_covariance_later(contact_s)

    def sticks(self, estimate: Estimated, plan: Plan) -> SticksPercent:
        """The sticks of a plan."""
        response = self._response
        wanted = self.input(estimate, plan)
        if self._steering is not None and plan.steerable:
            asked = self._steering.instead_of(wanted, estimate, plan)
            before, most = estimate.actuation.input_before, self._most_change(plan.gains)
            wanted = before + np.clip(rotated(asked, estimate.bar_rad) - before, -most, most)
        if plan.in_final_descent:
            wanted = self._levelled(estimate, plan, wanted)
        pitch, roll = (response.stick_of(value) for value in rotated(wanted, -estimate.nose_rad))
        return SticksPercent(
            *_quantised(clamp(pitch, 100.0), clamp(roll, 100.0), response),
            clamp(100.0 * plan.climb_mps / response.max_climb_mps, 100.0),
            clamp(100.0 * plan.turn_rad_s / response.max_turn_rad_s, 100.0),
        )

    def input(self, estimate: Estimated, plan: Plan) -> Array:
        """(2,) the input from now on, in the axes of the flight."""
        gains, before, wanted = plan.gains, estimate.actuation.input_before, np.empty(2)
        rows = gains.steady
        left = round(plan.contact_s / gains.step_s)
        if plan.in_final_descent and left <= len(gains.to_contact):
            rows = gains.to_contact[max(left, 1) - 1]  # contact is late on a deck that falls away
        most = self._most_change(gains)
        for axis in range(2):
            change = -float(rows @ self._control_state(estimate, plan.reference, axis))
            wanted[axis] = before[axis] + clamp(change, most)
        return wanted

    def _most_change(self, gains: Gains) -> float:
        """Largest change of the input in a cycle."""
        return INPUT_RATE_SHARE * self._response.max_input_rate * gains.step_s

    def _control_state(self, estimate: Estimated, reference: Reference, axis: int) -> Array:
        """(11,), or (13,), the state of an axis against the reference."""
        response, actuation = self._response, estimate.actuation
        speed_mps, rate_mps2 = reference.speed_mps[axis], reference.rate_mps2[axis]
        acceleration = float(rate_mps2) + response.drag_per_s * float(speed_mps)
        state = np.empty(STATES + 1)
        state[:STATES], state[INPUT] = estimate.followed_states(axis), actuation.input_before[axis]
        state[POSITION] -= reference.place_m[axis]
        state[VELOCITY] -= speed_mps
        state[ACTUATION] -= acceleration
        servo = response.servo_per_s
        if actuation.tracked is not None:
            state = np.append(state, actuation.tracked[:, axis])
            state[TRACKED] -= speed_mps
            state[TRACKED_RATE] -= rate_mps2
            state[INPUT] -= float(speed_mps) + float(rate_mps2) / response.approach_per_s
        elif servo > 0.0:
            state[INPUT] -= float(speed_mps) + acceleration / servo
        else:
            state[INPUT] -= acceleration / actuation.motion.gain
        return state

    def _levelled(self, estimate: Estimated, plan: Plan, wanted: Array) -> Array:
        """(2,) the input, in the axes of the flight, with the tilt taken out in time for contact."""
        response, levelling, actuation = self._response, self._parameters.levelling, estimate.actuation
        normal_mps2 = estimate.deck_normal_mps2(min(plan.contact_s, LONGEST_CONTACT_S))
        if response.kind == "attitude":
            return tilt_near_contact(wanted, normal_mps2, plan.contact_s, response, levelling)
        if actuation.tracked is None or plan.contact_s >= levelling.before_contact_s(response):
            return wanted
        speed_mps, rate_mps2 = actuation.tracked
        tilt = actuation.trim_mps2 + estimate.across.of(ACTUATION) - rate_mps2
        return speed_near_contact(wanted, normal_mps2, tilt, speed_mps, response, levelling)


def _quantised(pitch: float, roll: float, response: Response) -> tuple[float, float]:
    """Sticks in the vehicle's steps, never so small that the vehicle begins to hold its position by itself."""
    step, least = response.stick_step_percent, response.hold_below_percent
    if step > 0.0:
        pitch, roll = step * round(pitch / step), step * round(roll / step)
    if max(abs(pitch), abs(roll)) >= least:
        return pitch, roll
    return math.copysign(least, pitch), roll
