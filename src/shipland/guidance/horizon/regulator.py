"""The regulator: from the estimate and the plan to the sticks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.estimation.relative_state import ACTUATION, GUST, POSITION, STATES, VELOCITY, WAVE, WAVE_RATE, WIND
from shipland.frames import Array, rotated
from shipland.guidance.horizon.descent import Descent, Phase
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.gains import INPUT, INPUT_RATE_SHARE, TRACKED, TRACKED_RATE, Gains, gains_of
from shipland.guidance.horizon.levelling import speed_near_contact, tilt_near_contact
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.reference import Reference
from shipland.guidance.horizon.steering import LONGEST_CONTACT_S, Steered, Steering
from shipland.guidance.laws import clamp
from shipland.guidance.near import SticksPercent
from shipland.guidance.response import Response

_STEPS_MS = (33, 67, 100, 200, 350, 530)
"""Cycles that gains are kept for; the nearest is taken."""


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
        noise = parameters.horizontal_servo if motion.servo_per_s > 0.0 else parameters.horizontal
        weights = parameters.weights_blind if gentle else parameters.weights
        return gains_of(motion, noise, estimate.wave, weights, step_ms)

    def at_contact(
        self, estimate: Estimated, reference: Reference, gains: Gains, contact_s: float
    ) -> tuple[Array, Array]:
        """(2,) and (2,2): offset from the deck's centre predicted for a contact in `contact_s`, and its covariance."""
        left = min(max(round(contact_s / gains.step_s), 0), len(gains.to_contact))
        contact_s = min(contact_s, LONGEST_CONTACT_S)
        rows = gains.offset_to_contact[left]
        offsets_m = [rows @ self._control_state(estimate, reference, axis) for axis in range(2)]
        return np.array(offsets_m) - estimate.deck_later(contact_s), estimate.over_deck_covariance_later(contact_s)

    def sticks(self, estimate: Estimated, plan: Plan) -> SticksPercent:
        """The sticks of a plan."""
        response = self._response
        wanted = self._input(estimate, plan)
        if self._steering is not None and plan.steerable:
            asked = self._steering.input_mps2(self._seen(estimate, plan, wanted))
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

    def _input(self, estimate: Estimated, plan: Plan) -> Array:
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
        if response.kind == "attitude":
            return tilt_near_contact(wanted, plan.contact_s, response, levelling)
        if actuation.tracked is None or plan.contact_s >= levelling.before_contact_s(response):
            return wanted
        speed_mps, rate_mps2 = actuation.tracked
        tilt = actuation.trim_mps2 + estimate.across.of(ACTUATION) - rate_mps2
        return speed_near_contact(wanted, tilt, speed_mps, response, levelling)

    def steered(self, estimate: Estimated, plan: Plan) -> Steered:
        """What a policy sees."""
        return self._seen(estimate, plan, self._input(estimate, plan))

    def _seen(self, estimate: Estimated, plan: Plan, wanted: Array) -> Steered:
        across = estimate.across

        def in_bar(vector: Array) -> Array:
            return rotated(vector, -estimate.bar_rad)

        return Steered(
            offset_m=in_bar(estimate.offset_m),
            speed_mps=in_bar(estimate.followed_mps),
            thrust_mps2=in_bar(across.of(ACTUATION)),
            gust_mps2=in_bar(across.of(GUST)),
            wind_mps2=in_bar(across.of(WIND)),
            wave_m=in_bar(across.of(WAVE)),
            wave_mps=in_bar(across.of(WAVE_RATE)),
            input_mps2=in_bar(estimate.actuation.input_before),
            wanted_mps2=in_bar(wanted),
            height_m=estimate.height_m,
            sink_mps=estimate.down_mps,
            contact_s=min(plan.contact_s, LONGEST_CONTACT_S),
            landing=plan.descent is not None,
            in_final_descent=plan.in_final_descent,
        )


def _quantised(pitch: float, roll: float, response: Response) -> tuple[float, float]:
    """Sticks in the vehicle's steps, never so small that the vehicle begins to hold its position by itself."""
    step, least = response.stick_step_percent, response.hold_below_percent
    if step > 0.0:
        pitch, roll = step * round(pitch / step), step * round(roll / step)
    if max(abs(pitch), abs(roll)) >= least:
        return pitch, roll
    return math.copysign(least, pitch), roll
