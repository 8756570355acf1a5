"""Guidance: from mode and estimate to a plan: reference, climb rate, yaw rate, and the descent of a landing."""

from __future__ import annotations

import math

from shipland.frames import Array, wrap_angle
from shipland.guidance.horizon.descent import Descent, Phase, contact_in_s, dropped, next_descent, outlook_of
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.gains import Gains
from shipland.guidance.horizon.goals import Goals
from shipland.guidance.horizon.levelling import odds_of_tilt
from shipland.guidance.horizon.limit_cycle import LimitCycleDetector
from shipland.guidance.horizon.odds import odds_below, odds_in_area
from shipland.guidance.horizon.reference import Reference, at_rest, moved, reference_reset
from shipland.guidance.horizon.regulator import Plan, Regulator
from shipland.guidance.laws import clamp
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.view import View
from shipland.messages import Mode

_BLIND_S = 1.5
"""Without a velocity of the vehicle for this long, gains are those for pictures alone."""


class Guidance:
    """Plans a cycle; remembers the goals' wait and whether the sticks oscillate.

    Args:
        setup: of the flight.
        regulator: whose prediction the descent is decided on.
    """

    def __init__(self, setup: PilotSetup, regulator: Regulator) -> None:
        self._guidance, self._response = setup.guidance, setup.response
        self._parameters = setup.guidance.horizon
        self._goals = Goals(self._parameters, setup.guidance.approach, setup.rig, View.of(setup.camera))
        self._rig = setup.rig
        self._regulator, self._limit_cycle = regulator, LimitCycleDetector()

    def plan(
        self,
        mode: Mode,
        estimate: Estimated,
        before: tuple[Reference | None, Descent | None],
        now_s: float,
        steps_s: tuple[float, float],
    ) -> Plan:
        """The plan of a cycle.

        Args:
            mode: that is flown.
            estimate: at the command's effect.
            before: reference and descent of the cycle before; None where there was none.
            now_s: time of the decision.
            steps_s: since the cycle before, and the mean of late.
        """
        parameters, actuation, (step_s, cycle_s) = self._parameters, estimate.actuation, steps_s
        reference = self._reference(mode, estimate, before[0], step_s)
        self._limit_cycle.take(actuation.input_before / self._response.full_input, step_s)
        far = math.hypot(*estimate.offset_m.tolist()) > parameters.margins.gentle_m
        blind = now_s - actuation.velocity_s > _BLIND_S
        oscillating = self._limit_cycle.oscillating and mode is not Mode.LAND
        gains = self._regulator.gains(estimate, far or blind or oscillating, cycle_s)
        contact_s = contact_in_s(estimate.height_m, estimate.down_mps, self._response.climb_lag_s, parameters.descent)
        descent = odds = None
        if mode is Mode.LAND or (mode is Mode.APPROACH and not far):
            foreseen = self._foreseen(estimate, before[1], reference, gains)
            odds = foreseen[1]
        if mode is Mode.LAND:
            outlook = outlook_of(before[1], estimate, foreseen, (now_s, step_s), self._guidance, self._response)
            descent = next_descent(before[1], outlook, parameters.descent)
            climb_mps = self._descent_mps(estimate, descent)
        else:
            climb_mps = self._climb_mps(self._goals.height_m(mode, estimate), estimate)
        return Plan(
            reference,
            gains,
            climb_mps,
            self._turn_rad_s(estimate),
            contact_s,
            descent,
            odds,
            steerable=mode in (Mode.APPROACH, Mode.LAND) and estimate.bar_known,
        )

    def _foreseen(
        self, estimate: Estimated, before: Descent | None, reference: Reference, gains: Gains
    ) -> tuple[Array, float]:
        """Of a final descent from now, or while it sinks from the wait: (2,) offset at contact, odds of a landing."""
        descent, levelling, lag_s = self._parameters.descent, self._parameters.levelling, self._response.climb_lag_s
        height_m, sink_mps = estimate.height_m, estimate.down_mps
        if before is None or before.phase is Phase.SINK:
            height_m, sink_mps = min(height_m, descent.wait_height_m), 0.0
        contact_s = contact_in_s(height_m, sink_mps, lag_s, descent)
        offsets_m, covariance_m2 = self._regulator.at_contact(estimate, reference, gains, contact_s)
        odds = odds_in_area(self._rig, offsets_m, covariance_m2, estimate.bar_rad)
        odds *= odds_of_tilt(estimate.tilt_mps2, contact_s, self._response, levelling)
        _, fall_mps = dropped(contact_s, sink_mps, lag_s, descent)
        deck_mps = estimate.deck_rises_mps(contact_s) - estimate.bar_rises_mps(contact_s)
        return offsets_m, odds * odds_below(descent.sink_max_mps, fall_mps + deck_mps, descent.sink_std_mps)

    def _reference(self, mode: Mode, estimate: Estimated, before: Reference | None, step_s: float) -> Reference:
        """The reference a cycle later, towards the mode's goal; reset where the aircraft cannot follow it."""
        goal_m, goal_mps = self._goals.of(mode, estimate)
        pace = self._goals.pace(estimate, goal_m)
        place_m, speed_mps = estimate.followed_m, estimate.followed_mps
        reference = moved(before or at_rest(place_m, speed_mps), step_s, goal_m, goal_mps, pace)
        return reference_reset(reference, place_m, speed_mps, pace)

    def _descent_mps(self, estimate: Estimated, descent: Descent) -> float:
        """Climb rate of a landing, upward: with the bar's heave, as it is when a climb rate has come about."""
        rate_mps = estimate.bar_rises_mps(self._response.climb_lag_s)
        if descent.phase is Phase.FINAL_DESCENT:
            return rate_mps - self._parameters.descent.final_descent_mps
        return rate_mps + descent.rate_mps + self._climb_mps(descent.height_m, estimate)

    def _climb_mps(self, height_m: float, estimate: Estimated) -> float:
        """Climb rate to a height over the neutral deck, upward."""
        path = self._parameters.path
        return clamp(path.climb_per_s * (height_m - estimate.height_m), path.climb_mps)

    def _turn_rad_s(self, estimate: Estimated) -> float:
        """Yaw rate to the heading wanted, with that heading's own rate."""
        off_rad = wrap_angle(self._goals.nose_rad(estimate) - estimate.nose_rad)
        turn_rad_s = self._parameters.path.turn_per_s * off_rad
        return turn_rad_s + (estimate.turn_rad_s if estimate.bar_known else estimate.to_bar_rad_s)
