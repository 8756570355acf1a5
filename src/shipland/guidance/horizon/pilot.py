"""The pilot: estimate → mode → reference → control → camera."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shipland.estimation.relative_state import ACTUATION, GUST, POSITION, STATES, VELOCITY, WAVE, WAVE_RATE, WIND
from shipland.estimation.wave_motion import WAVE_STATES
from shipland.frames import Array, rotated, wrap_angle
from shipland.guidance.horizon.blind import open_loop_go_around
from shipland.guidance.horizon.descent import Descent, Over, Phase, contact_in_s, dropped, next_descent, reacquire_at_m
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.gains import INPUT, INPUT_RATE_SHARE, TRACKED, TRACKED_RATE, Gains, gains_of
from shipland.guidance.horizon.goals import Goals
from shipland.guidance.horizon.levelling import speed_near_contact, tilt_near_contact
from shipland.guidance.horizon.limit_cycle import LimitCycleDetector
from shipland.guidance.horizon.look_down import DOWN_RAD, GimbalLookDown, next_look_down
from shipland.guidance.horizon.navigator import Navigator
from shipland.guidance.horizon.reference import Reference, at_rest, moved, reference_reset
from shipland.guidance.horizon.steering import LONGEST_CONTACT_S, Steered, Steering
from shipland.guidance.laws import clamp
from shipland.guidance.modes import INTENTS, ModeMemory, Situation, next_mode, overruled
from shipland.guidance.near import SticksPercent
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.response import Response
from shipland.guidance.search import search
from shipland.guidance.view import View, target_column_px
from shipland.messages import Decision, Estimate, Mode, Observation, PilotCommand, Telemetry

_STEPS_MS = (33, 67, 100, 200, 350, 530)
"""Cycles that gains are kept for; the nearest is taken."""
_BLIND_S = 1.5
"""Without a velocity of the vehicle for this long, gains are those for pictures alone."""
_SILENT_S = 1.0
"""A vehicle that heard no command for so long holds by itself, and nobody followed where it went."""
_OLD_S = 2.0
"""A deck that was seen longer ago than this is not landed on by what was seen of it."""
_TRACKS = (Mode.TRACK_SHIP, Mode.TRACK_BAR, Mode.APPROACH, Mode.LAND, Mode.NO_VISION, Mode.GO_AROUND)


class HorizonPilot:
    """Flies to the landing point that the level bar shows, from the first box to contact, on one estimate.

    Args:
        setup: of the flight.
        steering: a policy that changes the horizontal input near the landing point; None flies without.
    """

    def __init__(self, setup: PilotSetup, steering: Steering | None = None) -> None:
        self._steering = steering
        guidance, rig, camera = setup.guidance, setup.rig, setup.camera
        self._parameters, self._mode_parameters = guidance.horizon, guidance.modes
        self._margins = guidance.horizon.margins
        self._approach, self._search = guidance.approach, guidance.search
        self._response = setup.response
        self._navigator = Navigator(guidance.horizon, setup.response, rig, camera, setup.camera_in_body_m)
        self._view = View.of(camera)
        self._limit_cycle = LimitCycleDetector()
        limits, response = guidance.horizon, setup.response
        to_level_s = limits.levelling.before_contact_s(response)
        self._final_descent_height_m = (
            limits.descent.contact_height_m + dropped(to_level_s, 0.0, response.climb_lag_s, limits.descent)[0]
        )
        self._goals = Goals(guidance.horizon, guidance.approach, rig, self._view)
        self._camera_in_body_m = np.asarray(setup.camera_in_body_m, dtype=float)
        self._deck_in_bar_m = rig.deck_in_bar_m
        self._modes = ModeMemory()
        self._reference: Reference | None = None
        self._descent: Descent | None = None
        self._look_down: GimbalLookDown | None = None
        self._sticks = SticksPercent(0.0, 0.0, 0.0, 0.0)
        self._gimbal_pitch_rad = math.radians(self._search.camera_pitch_deg[0])
        self._now_s: float | None = None
        self._first_s, self._heard_s = 0.0, -math.inf
        self._step_s = 1.0 / 30.0
        self._side_rad = 0.0
        self._contact_m = self._distance_m = math.inf

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None = None) -> Decision:
        """One cycle; never raises."""
        now_s, navigator = telemetry.t_s, self._navigator
        if self._now_s is None:
            self._first_s = now_s
        step_s = 0.0 if self._now_s is None else now_s - self._now_s
        if step_s > 0.0:
            self._step_s += 0.3 * (step_s - self._step_s)
        self._now_s = now_s
        if sent is not None:
            navigator.sent(sent)
        observation = self._unless_silent(observation, telemetry)
        navigator.landing = self._modes.mode in (Mode.LAND, Mode.GO_AROUND)
        navigator.take(observation, telemetry)
        if navigator.landing and navigator.doubted:
            observation = replace(observation, bar_pose=None, reason=navigator.doubted)
        self._remember_side(observation)
        estimate = navigator.estimate(navigator.effect_s(now_s))
        fresh_s = now_s - navigator.seen_s
        usable = estimate is not None and (
            fresh_s <= self._mode_parameters.memory_s + 1.0 or estimate.spread_m <= self._parameters.position_std_max_m
        )
        self._modes = next_mode(
            replace(
                self._situation(observation, telemetry, estimate if usable else None),
                overruled=overruled(sent, self._modes.mode),
            ),
            self._modes,
            self._mode_parameters,
        )
        mode = self._modes.mode
        if mode is not Mode.LAND:
            self._descent = self._look_down = None
        if mode in _TRACKS and usable and estimate is not None:
            sticks = self._track(mode, estimate, step_s)
        else:
            self._reference = None
            sticks = self._without_estimate(mode, now_s)
        self._sticks = sticks
        self._point_camera(mode, observation, estimate if usable else None, step_s)
        command = PilotCommand(now_s, *sticks, self._gimbal_pitch_rad, INTENTS[mode])
        at_picture = navigator.estimate(navigator.taken_s(observation.t_s)) if usable else None
        note = "" if self._steering is None else self._steering.note
        reason = "; ".join(filter(None, (self._modes.reason, note)))
        return Decision(command, mode, reason, _shown(at_picture))

    def _unless_silent(self, observation: Observation, telemetry: Telemetry) -> Observation:
        """The observation; an empty one where this process or the link stood still, and the place is forgotten."""
        heard_s = max(observation.t_s, telemetry.newest_s)
        silent_s = heard_s - self._heard_s
        self._heard_s = max(heard_s, self._heard_s)
        if not _SILENT_S < silent_s < math.inf:
            return observation
        self._navigator.forget_place()
        return Observation(observation.t_s, observation.gimbal, reason=f"nothing heard for {silent_s:.1f} s")

    # --- modes -------------------------------------------------------------------------------------------------

    def _situation(self, observation: Observation, telemetry: Telemetry, estimate: Estimated | None) -> Situation:
        approach = self._approach
        climbing_s = telemetry.t_s - self._modes.since_s
        height_m, clear = math.inf, False
        if estimate is not None:
            place = estimate.aircraft_in_bar_m
            height_m = float(self._deck_in_bar_m[2] - place[2])
            self._distance_m = math.sqrt(place.dot(place))
            back_m = float(self._deck_in_bar_m[0]) - approach.go_around_back_m
            high = height_m > approach.go_around_height_m - self._margins.clear_below_m
            clear = bool(place[0] < back_m + self._margins.clear_ahead_m and high)
        in_final_descent = self._descent is not None and self._descent.phase is Phase.FINAL_DESCENT
        return Situation(
            now_s=telemetry.t_s,
            observation=observation,
            landing_condition=self._landing_condition(estimate),
            committed=in_final_descent or height_m < self._margins.committed_m,
            abort_reason=self._abort_reason(estimate),
            near_ship=self._distance_m < approach.go_around_radius_m,
            clear=climbing_s >= approach.go_around_s and (clear or climbing_s >= 4.0 * approach.go_around_s),
            flying=telemetry.flying,
            watching=self._descent is not None and self._descent.phase in (Phase.DECK_WATCH, Phase.REACQUIRE),
        )

    @property
    def _watching(self) -> bool:
        return self._descent is not None and self._descent.phase is Phase.DECK_WATCH

    def _landing_condition(self, estimate: Estimated | None) -> str:
        limits, approach = self._parameters, self._approach
        if estimate is None or not estimate.bar_known:
            return "no pose yet"
        offset = self._offset(estimate)
        off_m = math.hypot(*offset.tolist())
        if off_m > limits.land_offset_m:
            return f"{off_m:.2f} m off the landing point"
        up_m = float(self._deck_in_bar_m[2]) - estimate.down_m - approach.hover_height_m
        if abs(up_m) > 2.0 * approach.max_height_error_m:
            return f"{-up_m:+.2f} m to the hover height"
        yaw_rad = wrap_angle(estimate.nose_rad - estimate.bar_rad)
        if abs(math.degrees(yaw_rad)) > approach.max_yaw_error_deg:
            return f"heading off by {math.degrees(yaw_rad):.0f}°"
        if self._unfit_m(estimate) > limits.contact_std_max_m:
            return f"offset at contact uncertain by {self._unfit_m(estimate):.2f} m"
        return ""

    def _unfit_m(self, estimate: Estimated) -> float:
        """Standard deviation of the place at the command's effect, the worse axis."""
        covariance, share = estimate.across.covariance, estimate.near * estimate.wave.tracked_share
        spread = [
            covariance[i, i] + share * (share * covariance[i + WAVE, i + WAVE] - 2.0 * covariance[i, i + WAVE])
            for i in (POSITION, STATES + POSITION)
        ]
        return math.sqrt(max(*spread, 0.0))

    def _abort_reason(self, estimate: Estimated | None) -> str:
        if self._modes.mode is not Mode.LAND or estimate is None:
            return ""
        # From the bar as it is seen: which part of a motion is the bar's own swing is far less certain.
        off_m = math.hypot(*(estimate.place_m - rotated(self._deck_in_bar_m[:2], estimate.bar_rad)).tolist())
        return f"{off_m:.2f} m off the landing point" if off_m > self._parameters.abort_offset_m else ""

    def _offset(self, estimate: Estimated) -> Array:
        """(2,) from the landing point, in the axes of the flight."""
        return estimate.followed_m - rotated(self._deck_in_bar_m[:2], estimate.bar_rad)

    # --- references and control --------------------------------------------------------------------------------

    def _track(self, mode: Mode, estimate: Estimated, step_s: float) -> SticksPercent:
        goal_m, goal_mps = self._goals.of(mode, estimate)
        pace = self._goals.pace(estimate, goal_m)
        place_m, speed_mps = estimate.followed_m, estimate.followed_mps
        reference = moved(self._reference or at_rest(place_m, speed_mps), step_s, goal_m, goal_mps, pace)
        # Far from its reference the aircraft is led anew from where it is: the gains are for small errors.
        self._reference = reference_reset(reference, place_m, speed_mps, pace)
        self._limit_cycle.take(self._navigator.input_before() / self._response.full_input, step_s)
        far = math.hypot(*self._offset(estimate).tolist()) > self._margins.gentle_m
        gains = self._gains(gentle=far or (self._limit_cycle.swinging and mode is not Mode.LAND))
        heave_mps = self._heave_mps(mode, estimate, gains, step_s)
        wanted = self._wanted_input(estimate, gains)
        if self._steering is not None and mode in (Mode.APPROACH, Mode.LAND) and estimate.bar_known:
            wanted = self._steered(self._steering, estimate, gains, wanted)
        return self._sticks_of(estimate, wanted, heave_mps)

    def _gains(self, gentle: bool) -> Gains:
        step_ms = min(_STEPS_MS, key=lambda ms: abs(ms - 1e3 * self._step_s))
        navigator, parameters = self._navigator, self._parameters
        blind = self._now_s is None or self._now_s - navigator.velocity_s > _BLIND_S
        weights = parameters.weights_blind if blind or gentle else parameters.weights
        servo = navigator.motion.servo_per_s > 0.0
        noise = parameters.horizontal_servo if servo else parameters.horizontal
        return gains_of(navigator.motion, noise, navigator.wave, weights, step_ms)

    def _wanted_input(self, estimate: Estimated, gains: Gains) -> Array:
        """(2,) the input from now on, in the axes of the flight."""
        before, wanted = self._navigator.input_before(), np.empty(2)
        rows = gains.steady
        if self._descent is not None and self._descent.phase is Phase.FINAL_DESCENT:
            left = round(self._contact_in_s(estimate) / gains.step_s)
            if left <= len(gains.to_contact):
                rows = gains.to_contact[max(left, 1) - 1]  # contact is late on a deck that falls away
        most = INPUT_RATE_SHARE * self._response.max_input_rate * gains.step_s
        for axis in range(2):
            change = -float(rows @ self._control_state(estimate, axis, before[axis]))
            wanted[axis] = before[axis] + clamp(change, most)
        return wanted

    def _steered(self, steering: Steering, estimate: Estimated, gains: Gains, wanted: Array) -> Array:
        """(2,) the input as a policy would have it, in the axes of the flight, no faster than can be followed."""
        across, bar_rad, before = estimate.across, estimate.bar_rad, self._navigator.input_before()
        descent = self._descent

        def in_bar(vector: Array) -> Array:
            return rotated(vector, -bar_rad)

        asked = steering.input_mps2(
            Steered(
                offset_m=in_bar(self._offset(estimate)),
                speed_mps=in_bar(estimate.followed_mps),
                thrust_mps2=in_bar(across.of(ACTUATION)),
                gust_mps2=in_bar(across.of(GUST)),
                wind_mps2=in_bar(across.of(WIND)),
                wave_m=in_bar(across.of(WAVE)),
                wave_mps=in_bar(across.of(WAVE_RATE)),
                input_mps2=in_bar(before),
                wanted_mps2=in_bar(wanted),
                height_m=self._height_m(estimate),
                sink_mps=estimate.down_mps,
                contact_s=min(self._contact_in_s(estimate), LONGEST_CONTACT_S),
                landing=descent is not None,
                in_final_descent=descent is not None and descent.phase is Phase.FINAL_DESCENT,
            )
        )
        most = INPUT_RATE_SHARE * self._response.max_input_rate * gains.step_s
        return before + np.clip(rotated(asked, bar_rad) - before, -most, most)

    def _control_state(self, estimate: Estimated, axis: int, before: float) -> Array:
        """(11,), or (13,), the state of an axis against the reference."""
        assert self._reference is not None
        reference, response = self._reference, self._response
        state = np.empty(STATES + 1)
        state[:STATES], state[INPUT] = estimate.followed_states(axis), before
        thrust = float(reference.rate_mps2[axis]) + response.drag_per_s * float(reference.speed_mps[axis])
        state[POSITION] -= reference.place_m[axis]
        state[VELOCITY] -= reference.speed_mps[axis]
        state[ACTUATION] -= thrust
        servo = response.servo_per_s
        tracked = self._navigator.servo
        if tracked is not None:
            approach_per_s = response.approach_per_s
            state = np.append(state, tracked.state[:, axis])
            state[TRACKED] -= reference.speed_mps[axis]
            state[TRACKED_RATE] -= reference.rate_mps2[axis]
            state[INPUT] -= float(reference.speed_mps[axis]) + float(reference.rate_mps2[axis]) / approach_per_s
        else:
            gain = self._navigator.motion.gain
            state[INPUT] -= float(reference.speed_mps[axis]) + thrust / servo if servo > 0.0 else thrust / gain
        return state

    def _offset_at_contact_m(self, estimate: Estimated, gains: Gains) -> float:
        """Predicted for a drop that begins now."""
        return math.hypot(*self._offsets_at_contact_m(estimate, gains).tolist())

    def _offsets_at_contact_m(self, estimate: Estimated, gains: Gains) -> Array:
        """(2,) from the landing point, in the axes of the flight."""
        left = min(max(round(self._contact_in_s(estimate) / gains.step_s), 0), len(gains.to_contact))
        rows, before = gains.offset_to_contact[left], self._navigator.input_before()
        return np.array([float(rows @ self._control_state(estimate, i, before[i])) for i in range(2)])

    def _from_deck_m(self, estimate: Estimated, gains: Gains) -> float:
        """From the deck's centre at contact, predicted for a drop that begins now; infinite while it is not known."""
        left_s, limits = self._contact_in_s(estimate), self._parameters
        if self._watching:
            reacquire_s, lag_s = limits.descent.reacquire_s, self._response.climb_lag_s
            height_m = reacquire_at_m(self._height_m(estimate), reacquire_s, limits.descent)
            left_s = reacquire_s + contact_in_s(height_m, limits.descent.sink_mps, lag_s, limits.descent)
        shifts_m, deviation_m = estimate.deck_later(left_s)
        if estimate.deck_rises_mps(left_s) > limits.deck_rise_max_mps:
            return math.inf
        old = self._now_s is None or self._now_s - self._navigator.deck_s > _OLD_S
        if old or not deviation_m <= limits.deck_std_max_m:
            return math.inf
        if self._watching:  # what is off here until then is flown out
            return math.hypot(*shifts_m.tolist())
        return math.hypot(*(self._offsets_at_contact_m(estimate, gains) - shifts_m).tolist())

    def _height_m(self, estimate: Estimated) -> float:
        return float(self._deck_in_bar_m[2]) - estimate.down_m

    def _contact_in_s(self, estimate: Estimated) -> float:
        lag_s = self._response.climb_lag_s
        return contact_in_s(self._height_m(estimate), estimate.down_mps, lag_s, self._parameters.descent)

    def _heave_mps(self, mode: Mode, estimate: Estimated, gains: Gains, step_s: float) -> float:
        """Climb rate wanted, upward."""
        path, approach, height_m = self._parameters.path, self._approach, self._height_m(estimate)
        rate_mps = 0.0
        if mode is Mode.LAND:
            offset_m = math.hypot(*self._offset(estimate).tolist())
            self._contact_m = self._offset_at_contact_m(estimate, gains)
            lull, tilt_limited = self._lull(estimate), self._tilt_limited(estimate)
            from_deck_m = self._from_deck_m(estimate, gains) if self._parameters.moment == "deck" else None
            over = Over(
                now_s=estimate.t_s,
                step_s=step_s,
                height_m=height_m,
                offset_m=offset_m,
                offset_at_contact_m=self._contact_m,
                lull=lull,
                contact_imminent=tilt_limited and self._contact_imminent(height_m),
                from_deck_m=from_deck_m,
                final_descent_height_m=self._final_descent_height_m if tilt_limited else 0.0,
            )
            before = self._descent
            self._descent = descent = next_descent(before, over, self._parameters.descent)
            rate_mps = self._deck_mps(estimate)
            if descent.phase is Phase.FINAL_DESCENT:
                return rate_mps - self._parameters.descent.final_descent_mps
            wanted_m = descent.height_m
            if before is not None and step_s > 0.0:
                rate_mps += (descent.height_m - before.height_m) / step_s
        elif mode is Mode.GO_AROUND:
            wanted_m = approach.go_around_height_m
        elif not estimate.bar_known:
            wanted_m = float(self._deck_in_bar_m[2]) + path.far_above_m
        else:
            hover_m = approach.hover_height_m
            distance_m = math.hypot(*self._offset(estimate).tolist())
            far_m = float(self._deck_in_bar_m[2]) + path.far_above_m
            higher_m = 0.15 * max(distance_m - self._margins.overhead_m, 0.0)
            wanted_m = min(hover_m + higher_m, max(far_m, hover_m))
        climb_mps = clamp(path.climb_per_s * (wanted_m - height_m), path.climb_mps)
        return rate_mps + climb_mps

    def _deck_mps(self, estimate: Estimated) -> float:
        """Upward speed of the deck when a climb that is asked for now has come about."""
        wave = estimate.wave
        states = estimate.down.mean[WAVE : WAVE + WAVE_STATES]
        return -wave.observed_share * float(wave.later(states, self._response.climb_lag_s)[1])

    def _lull(self, estimate: Estimated) -> bool:
        if self._parameters.moment == "any" or not estimate.wave.bar_moves:
            return True
        return math.hypot(*estimate.across.of(WAVE + 1).tolist()) < self._parameters.lull_mps

    def _sticks_of(self, estimate: Estimated, wanted: Array, heave_mps: float) -> SticksPercent:
        response, path = self._response, self._parameters.path
        if self._descent is not None and self._descent.phase is Phase.FINAL_DESCENT:
            wanted = self._near_contact(estimate, wanted)
        pitch, roll = (response.stick_of(value) for value in rotated(wanted, -estimate.nose_rad))
        pitch, roll = _kept_moving(clamp(pitch, 100.0), clamp(roll, 100.0), response)
        turn_rad_s = path.turn_per_s * wrap_angle(self._goals.nose_rad(estimate) - estimate.nose_rad)
        if estimate.bar_known:
            turn_rad_s += estimate.turn_rad_s
        return SticksPercent(
            pitch,
            roll,
            clamp(100.0 * heave_mps / response.max_climb_mps, 100.0),
            clamp(100.0 * turn_rad_s / response.max_turn_rad_s, 100.0),
        )

    def _near_contact(self, estimate: Estimated, wanted: Array) -> Array:
        """(2,) the input, in the axes of the flight, with the tilt taken out in time."""
        response, levelling = self._response, self._parameters.levelling
        left_s, tracked = self._contact_in_s(estimate), self._navigator.servo
        if response.kind == "attitude":
            return tilt_near_contact(wanted, left_s, response, levelling)
        if tracked is None or left_s >= levelling.before_contact_s(response):
            return wanted
        speed_mps, rate_mps2 = tracked.state
        tilt = self._navigator.trim_mps2 + estimate.across.of(ACTUATION) - rate_mps2
        return speed_near_contact(wanted, tilt, speed_mps, response, levelling)

    def _contact_imminent(self, height_m: float) -> bool:
        """A contact is near, and foreseen close to the landing point."""
        levelling = self._parameters.levelling
        above_m = height_m - self._parameters.descent.contact_height_m
        return above_m < levelling.touch_m and self._contact_m <= levelling.touch_offset_m

    def _tilt_limited(self, estimate: Estimated) -> bool:
        """The wind takes so much tilt to hold that contact must not come by itself."""
        held_mps2 = estimate.across.of(WIND) if self._navigator.servo is None else self._navigator.trim_mps2
        return math.hypot(*held_mps2.tolist()) > self._parameters.levelling.touch_mps2

    # --- without an estimate -----------------------------------------------------------------------------------

    def _without_estimate(self, mode: Mode, now_s: float) -> SticksPercent:
        approach, since_s = self._approach, self._in_mode_s(now_s)
        if mode is Mode.SEARCH:
            return search(since_s, self._search, self._side_rad)[0]
        if mode is Mode.GO_AROUND:
            navigator = self._navigator
            tilt = rotated(navigator.trim_mps2, -navigator.nose_rad(now_s)) if navigator.servo is None else None
            return open_loop_go_around(since_s, approach, self._response, tilt)
        return SticksPercent(0.0, 0.0, 0.0, 0.0)

    def _in_mode_s(self, now_s: float) -> float:
        """How long the mode has lasted, or, in the first mode, the flight."""
        return now_s - max(self._modes.since_s, self._first_s)

    def _remember_side(self, observation: Observation) -> None:
        column_px = target_column_px(observation)
        if column_px is not None:
            self._side_rad = self._view.bearing_rad(column_px)

    # --- camera ------------------------------------------------------------------------------------------------

    def _point_camera(self, mode: Mode, observation: Observation, estimate: Estimated | None, step_s: float) -> None:
        if self._watching and self._now_s is not None:
            limits = self._parameters
            posed_s = self._modes.corners.last_s if observation.bar_pose is not None else -math.inf
            self._look_down = next_look_down(
                self._look_down, self._now_s, posed_s, limits.look_down_max_s, limits.look_up_s
            )
            if self._look_down.down:
                self._gimbal_pitch_rad = DOWN_RAD
                return
        box = {Mode.TRACK_BAR: observation.bar_box, Mode.TRACK_SHIP: observation.ship_box}.get(mode)
        blind = mode is Mode.SEARCH or (mode is Mode.GO_AROUND and estimate is None)
        if blind and self._now_s is not None:
            wanted_rad = search(self._in_mode_s(self._now_s), self._search)[1]
        elif box is not None:
            wanted_rad = observation.gimbal.pitch_rad - self._view.depression_rad(box.centre_px[1])
        elif estimate is not None:
            lens_m = estimate.down_m + float(self._camera_in_body_m[2])
            ahead_m = math.hypot(*estimate.place_m.tolist()) - float(self._camera_in_body_m[0])
            wanted_rad = math.atan2(lens_m, max(ahead_m, 0.3))
        else:
            return
        hasty = step_s <= 0.0 or self._look_down is not None
        share = 1.0 if hasty else 1.0 - math.exp(-step_s / self._approach.gimbal_time_constant_s)
        self._gimbal_pitch_rad += share * (wanted_rad - self._gimbal_pitch_rad)


def _shown(estimate: Estimated | None) -> Estimate | None:
    """The estimate as others read it: in `bar`, once its heading is known."""
    if estimate is None or not estimate.bar_known:
        return None
    velocity = np.array([*rotated(estimate.speed_mps, -estimate.bar_rad).tolist(), estimate.down_mps])
    yaw_rad = wrap_angle(estimate.nose_rad - estimate.bar_rad)
    return Estimate(estimate.t_s, estimate.aircraft_in_bar_m, yaw_rad, velocity, estimate.covariance)


def _kept_moving(pitch: float, roll: float, response: Response) -> tuple[float, float]:
    """Sticks in the steps that they travel in, never so small that the vehicle begins to hold its place by itself."""
    step, least = response.stick_step_percent, response.hold_below_percent
    if step > 0.0:
        pitch, roll = step * round(pitch / step), step * round(roll / step)
    if max(abs(pitch), abs(roll)) >= least:
        return pitch, roll
    return math.copysign(least, pitch), roll
