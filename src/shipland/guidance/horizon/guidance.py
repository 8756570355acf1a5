"""Guidance: from mode and estimate to a plan: reference, climb rate, yaw rate, and the descent of a landing.

Each mode has its goals: the point flown to, the height, the pace, the heading of the nose. The reference is a
trajectory towards them: a point that leads the aircraft, with a speed from which it can stop in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.frames import Array, rotated, wrap_angle
from shipland.guidance.horizon.descent import Descent, Fall, Outlook, Phase, next_descent
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.odds import odds_below, odds_in_area, odds_of_tilt
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.regulator import Gains, Plan, Reference, Regulator
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.response import clamp
from shipland.guidance.view import View
from shipland.messages import Mode
from shipland.rig import Rig

_AHEAD_RAD = math.radians(80.0)
"""Bearing from astern beyond which the ship stands in the way."""
_CLIMB_SLOPE = 0.15
"""Height above the hover for a metre of distance from `overhead_m` on."""
_BLIND_S = 1.5
"""Without a velocity of the vehicle for this long, gains are those for pictures alone."""
_MEMORY_S, _LIMIT_CYCLE = 2.0, 0.3
_SLOWEST_SHARE = 0.3
"""Of the final descent's sink rate, over a deck that sinks away."""
_BRAKE_MPS2, _ROOM_M = 2.5, 1.0
"""Deceleration of a reference that is faster than its pace, where it would overshoot its goal: a tilt of 14°; and the
way that stopping may always take."""


@dataclass(frozen=True)
class Pace:
    """How fast a reference may move.

    Attributes:
        speed_mps: greatest speed against its goal.
        brake_mps2: deceleration that it plans to stop with.
        acceleration_mps2: greatest change of its speed, unless it is too fast and stopping at its goal takes more.
        closing_per_s: near the goal the speed falls in proportion to the distance.
        tracking_error_max_m, tracking_error_max_mps: a larger difference between aircraft and reference resets the
            reference.
    """

    speed_mps: float
    brake_mps2: float
    acceleration_mps2: float
    closing_per_s: float
    tracking_error_max_m: float
    tracking_error_max_mps: float


def moved(before: Reference, step_s: float, goal_m: Array, goal_mps: Array, pace: Pace) -> Reference:
    """The reference a cycle later, on its way to a goal (2,) that itself moves with `goal_mps` (2,)."""
    if step_s <= 0.0:
        return before
    to_goal_m = goal_m - before.place_m
    distance_m = math.hypot(*to_goal_m.tolist())
    speed_mps = min(pace.speed_mps, math.sqrt(2.0 * pace.brake_mps2 * distance_m), pace.closing_per_s * distance_m)
    wanted_mps = goal_mps + to_goal_m * (speed_mps / max(distance_m, 1e-9))
    change = wanted_mps - before.speed_mps
    relative_mps = before.speed_mps - goal_mps
    room_m = max(distance_m if relative_mps @ to_goal_m > 0.0 else 0.0, _ROOM_M)
    squared = float(relative_mps @ relative_mps)
    stops_mps2 = min(squared / (2.0 * room_m), _BRAKE_MPS2) if squared > pace.speed_mps**2 else 0.0
    most = max(pace.acceleration_mps2, stops_mps2) * step_s
    size = math.hypot(*change.tolist())
    if size > most:
        change = change * (most / size)
    speed = before.speed_mps + change
    place = before.place_m + step_s * (before.speed_mps + 0.5 * change)
    return Reference(place, speed, change / step_s)


def reference_reset(reference: Reference, place_m: Array, speed_mps: Array, pace: Pace) -> Reference:
    """The reference as it is, or, too far from an aircraft at a place (2,) with a speed (2,), at that place.

    It keeps the speed that it had reached, within `tracking_error_max_mps`: a leap of the estimate is no reason to
    change it.
    """
    ahead_mps = reference.speed_mps - speed_mps
    apart_mps = math.hypot(*ahead_mps.tolist())
    if (
        math.hypot(*(reference.place_m - place_m).tolist()) <= pace.tracking_error_max_m
        and apart_mps <= pace.tracking_error_max_mps
    ):
        return reference
    return at_rest(place_m, speed_mps + ahead_mps * min(pace.tracking_error_max_mps / max(apart_mps, 1e-9), 1.0))


def at_rest(place_m: Array, speed_mps: Array) -> Reference:
    """A reference that begins where the aircraft is, with its speed, and brakes or goes on from there."""
    return Reference(place_m, speed_mps, np.zeros(2))


class Goals:
    """Points, heights and headings; remembers since when the aircraft waits at the stand-off.

    Args:
        parameters: of the pilot.
        approach: heights and distances of the modes.
        rig: the bar, and the deck below it.
        view: of the camera.
    """

    def __init__(self, parameters: HorizonParameters, approach: ApproachParameters, rig: Rig, view: View) -> None:
        self._path, self._margins, self._approach, self._view = parameters.path, parameters.margins, approach, view
        self._half_cue_m = float(np.max(np.abs(rig.cue.points_in_bar_m[:, 1])))
        self._deck_in_bar_m = rig.deck_in_bar_m
        self._waiting_s: float | None = None

    def of(self, mode: Mode, estimate: Estimated) -> tuple[Array, Array]:
        """(2,) the point flown to, from the bar, and (2,) its velocity by the bar's turn, in the axes of the flight."""
        path, approach = self._path, self._approach
        if estimate.bar_known:
            self._waiting_s = None
        else:
            distance_m = math.hypot(*estimate.place_m.tolist())
            too_high_m = (-estimate.down_m - path.far_above_m) / math.tan(math.radians(path.glide_path_deg))
            # From nearer it backs off: a least distance alone would spiral in, or meet an approaching ship.
            stand_off_m = max(path.stand_off_m, too_high_m)
            if estimate.course_rad is not None:  # astern of a ship under way
                goal_in_bar_m = self._past_ship(
                    rotated(estimate.place_m, -estimate.course_rad), np.array([-stand_off_m, 0.0])
                )
                return rotated(goal_in_bar_m, estimate.course_rad), np.zeros(2)
            goal_m = estimate.place_m * (stand_off_m / max(distance_m, 1.0))
            return rotated(goal_m, self._round_rad(estimate.t_s, distance_m)), np.zeros(2)
        ahead_m = float(self._deck_in_bar_m[0])
        if mode is Mode.GO_AROUND:
            ahead_m -= approach.go_around_back_m
        else:
            off_axis_m = abs(float(estimate.aircraft_in_bar_m[1]))
            above_m = max(-estimate.down_m - path.far_above_m - self._margins.above_path_m, 0.0)
            short_m = max(
                path.line_up * max(off_axis_m - self._margins.on_axis_m, 0.0),
                above_m / math.tan(math.radians(path.glide_path_deg)),
            )
            ahead_m -= short_m if mode is not Mode.LAND else 0.0
        goal_in_bar_m = self._past_ship(estimate.aircraft_in_bar_m[:2], np.array([ahead_m, 0.0]))
        goal_m = rotated(goal_in_bar_m, estimate.bar_rad)
        return goal_m, estimate.by_turn_mps(goal_m)

    def pace(self, estimate: Estimated, goal_m: Array) -> Pace:
        """Towards a goal: fast far from it, gentle near."""
        path = self._path
        to_goal_m = math.hypot(*(goal_m - estimate.place_m).tolist())
        share = min(max((to_goal_m - path.near_m) / path.near_m, 0.0), 1.0)
        speed_mps = path.near_mps + share * (path.far_mps - path.near_mps)
        brake_mps2 = path.near_brake_mps2 + share * (path.far_brake_mps2 - path.near_brake_mps2)
        return Pace(
            speed_mps,
            brake_mps2,
            path.acceleration_mps2,
            path.closing_per_s,
            path.tracking_error_max_m,
            path.tracking_error_max_mps,
        )

    def height_m(self, mode: Mode, estimate: Estimated) -> float:
        """Height over the deck, in every mode but the landing."""
        deck_down_m, hover_m = float(self._deck_in_bar_m[2]), self._approach.hover_height_m
        if mode is Mode.GO_AROUND:
            return self._approach.go_around_height_m
        far_m = deck_down_m + self._path.far_above_m
        if not estimate.bar_known:
            return far_m
        distance_m = math.hypot(*estimate.offset_m.tolist())
        higher_m = _CLIMB_SLOPE * max(distance_m - self._margins.overhead_m, 0.0)
        return min(hover_m + higher_m, max(far_m, hover_m))

    def nose_rad(self, estimate: Estimated) -> float:
        """Along the bar's axis while the bar stays in the picture; towards the bar while its heading is not known."""
        if not estimate.bar_known:
            return estimate.to_bar_rad
        cue_rad = math.atan2(self._half_cue_m, max(math.hypot(*estimate.place_m.tolist()), 0.1))
        room_rad = self._view.half_view_rad - cue_rad - math.radians(self._approach.bearing_margin_deg)
        widest_rad = max(clamp(room_rad, math.radians(self._approach.max_bearing_deg)), 0.0)
        off_rad = wrap_angle(estimate.to_bar_rad - estimate.bar_rad)
        return estimate.bar_rad + off_rad - clamp(off_rad, widest_rad)

    def _past_ship(self, aircraft_in_bar_m: Array, goal_in_bar_m: Array) -> Array:
        """The goal (2,), or, from ahead of the ship, a point on the way around it."""
        ahead_m, right_m = aircraft_in_bar_m.tolist()
        off_astern_rad, distance_m = math.atan2(right_m, -ahead_m), math.hypot(ahead_m, right_m)
        if abs(off_astern_rad) < _AHEAD_RAD or distance_m < self._margins.overhead_m + self._half_cue_m:
            return goal_in_bar_m
        radius_m = max(distance_m, 2.0 * self._approach.go_around_back_m)
        wanted_rad = off_astern_rad - math.copysign(math.radians(self._path.round_lead_deg), off_astern_rad)
        return radius_m * np.array([-math.cos(wanted_rad), math.sin(wanted_rad)])

    def _round_rad(self, t_s: float, distance_m: float) -> float:
        """Bearing of the goal around the bar: non-zero after a wait at the stand-off without corners."""
        path = self._path
        if distance_m > 2.0 * path.stand_off_m:
            self._waiting_s = None
        elif self._waiting_s is None:
            self._waiting_s = t_s
        if self._waiting_s is None or t_s - self._waiting_s < path.round_after_s:
            return 0.0
        return math.radians(path.round_lead_deg)


class LimitCycleDetector:
    """Whether the sticks oscillate from stop to stop: no gust causes that, only a loop that has lost its margin.

    At the stops the vehicle follows late, and by less than its model says. Gains by the model sustain such a limit
    cycle, and the filters of gain and latency adapt to it. Measured is the variance of the input over the last
    seconds, as a share of the squared full input.
    """

    def __init__(self) -> None:
        self._mean: Array = np.zeros(2)
        self._variance = 0.0

    @property
    def oscillating(self) -> bool:
        """From stop to stop: there the variance is above a half; gusts of 9 m/s of wind make a tenth of it."""
        return self._variance > _LIMIT_CYCLE

    def take(self, share: Array, step_s: float) -> None:
        """The input (2,), as a share of the full one, has been so for a while."""
        kept = math.exp(-max(step_s, 0.0) / _MEMORY_S)  # a clock may leap back
        off = share - self._mean
        self._mean = self._mean + (1.0 - kept) * off
        self._variance = kept * self._variance + (1.0 - kept) * float(off @ off)


class Guidance:
    """Plans a cycle; remembers the goals' wait and whether the sticks oscillate.

    Args:
        setup: of the flight.
        regulator: whose prediction the descent is decided on.
    """

    def __init__(self, setup: PilotSetup, regulator: Regulator) -> None:
        self._parameters, self._response = setup.guidance.horizon, setup.response
        self._hover_height_m = setup.guidance.approach.hover_height_m
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
        contact_s = self._contact_s(self._fall(estimate, estimate.sink_mps), estimate.height_m)
        descent = odds = None
        if mode is Mode.LAND or (mode is Mode.APPROACH and not far):
            odds = self._odds(estimate, before[1], reference, gains)
        if mode is Mode.LAND:
            assert odds is not None
            outlook = Outlook(
                now_s=estimate.t_s,
                step_s=step_s,
                height_m=estimate.height_m,
                sink_mps=estimate.sink_mps,
                offset_m=math.hypot(*estimate.offset_m.tolist()),
                odds=odds,
                climb_in_s=self._response.climb_in_s,
                hover_height_m=self._hover_height_m,
            )
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

    def _odds(self, estimate: Estimated, before: Descent | None, reference: Reference, gains: Gains) -> float:
        """Of a landing by a final descent from now, or while it sinks from the height of the wait."""
        descent = self._parameters.descent
        height_m, sink_mps = estimate.height_m, estimate.sink_mps
        if before is None or before.phase is Phase.SINK:
            height_m, sink_mps = min(height_m, descent.wait_height_m), 0.0
        fall = self._fall(estimate, sink_mps)
        contact_s = self._contact_s(fall, height_m)
        offsets_m, covariance_m2 = self._regulator.at_contact(estimate, reference, gains, contact_s)
        odds = odds_in_area(self._rig, offsets_m, covariance_m2, estimate.bar_rad)
        tilt_mps2 = math.hypot(*(estimate.tilt_mps2 - estimate.deck_normal_mps2(contact_s)).tolist())
        odds *= odds_of_tilt(tilt_mps2, contact_s, self._response, self._parameters.levelling)
        _, fall_mps = fall.after(contact_s)
        deck_mps = estimate.deck_rises_mps(contact_s) - estimate.followed_rises_mps(contact_s)
        return odds * odds_below(descent.sink_max_mps, fall_mps + deck_mps, descent.sink_std_mps)

    def _contact_s(self, fall: Fall, height_m: float) -> float:
        """Time to contact in a final descent from a height over the deck."""
        return fall.contact_in_s(height_m - self._parameters.descent.contact_height_m)

    def _fall(self, estimate: Estimated, sink_mps: float) -> Fall:
        """A final descent that begins now: a deck may sink away as fast as the vehicle can follow."""
        final_mps, response = self._parameters.descent.final_descent_mps, self._response
        most_mps = response.max_climb_mps + estimate.followed_rises_mps(response.climb_in_s)
        final_mps = min(final_mps, max(most_mps, _SLOWEST_SHARE * final_mps))
        return Fall(sink_mps, final_mps, response.climb_lag_s, response.climb_after_s)

    def _reference(self, mode: Mode, estimate: Estimated, before: Reference | None, step_s: float) -> Reference:
        """The reference a cycle later, towards the mode's goal; reset where the aircraft cannot follow it."""
        goal_m, goal_mps = self._goals.of(mode, estimate)
        pace = self._goals.pace(estimate, goal_m)
        place_m, speed_mps = estimate.followed_m, estimate.followed_mps
        reference = moved(before or at_rest(place_m, speed_mps), step_s, goal_m, goal_mps, pace)
        return reference_reset(reference, place_m, speed_mps, pace)

    def _descent_mps(self, estimate: Estimated, descent: Descent) -> float:
        """Climb rate of a landing, upward: with the deck, as it moves when a climb rate has come about."""
        rate_mps = estimate.followed_rises_mps(self._response.climb_in_s)
        if descent.phase is Phase.FINAL_DESCENT:
            return rate_mps - self._parameters.descent.final_descent_mps
        return rate_mps + descent.rate_mps + self._climb_mps(descent.height_m, estimate)

    def _climb_mps(self, height_m: float, estimate: Estimated) -> float:
        """Climb rate to a height over the deck, upward."""
        path = self._parameters.path
        return clamp(path.climb_per_s * (height_m - estimate.height_m), path.climb_mps)

    def _turn_rad_s(self, estimate: Estimated) -> float:
        """Yaw rate to the heading wanted, with that heading's own rate."""
        off_rad = wrap_angle(self._goals.nose_rad(estimate) - estimate.nose_rad)
        turn_rad_s = self._parameters.path.turn_per_s * off_rad
        return turn_rad_s + (estimate.turn_rad_s if estimate.bar_known else estimate.to_bar_rad_s)
