"""Landing by a tag on the deck, camera down: the deck's place, velocity and attitude are followed until contact.

The bar leads to the hover, as with `velocity_matching`; near it the camera turns down, and the tag's pose is all that
is flown on. The law is that of a tracked trajectory [Mellinger2012]: acceleration = k_p e + k_v ė + feed-forward, the
trajectory being the deck; low over it the aircraft takes the deck's attitude too, as it does on an inclined surface
there. A Kalman filter for a target of constant velocity gives ė and bridges what the tag is not seen.

[Mellinger2012] Mellinger, Michael, Kumar: Trajectory generation and control for precise aggressive maneuvers with
quadrotors, IJRR 31(5). Theirs is nonlinear, at 100 Hz by motion capture, with thrust and moments as inputs; here tilt
or speed and climb rate, at the pictures' rate. None of their figures is reproduced. The tag is idealised: see
`shipland.geometric`; the drawn deck has markings in its place, which give no attitude.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.frames import Array
from shipland.guidance.far import FarControl, FarTables
from shipland.guidance.mode_pilot import ModePilot, PilotState
from shipland.guidance.near import NearControl, NearEstimate
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.response import SticksPercent, clamp
from shipland.guidance.situation import PositionEstimate
from shipland.messages import DeckSight, Mode, Observation, Telemetry

_STEEPEST_RAD = -1.05
"""The camera looks down at least so steeply: shallower, it would look for the bar."""
_LONGEST_GAP_S = 1.0
_TRIM_S = 1.5
_UP: Array = np.array([1.0, 1.0, -1.0])


class DeckFollowing(ModePilot):
    """The published modes, whose hover and descent are over the deck as it is seen, once it is."""

    def __init__(self, setup: PilotSetup, tables: FarTables, far: FarControl, near: NearControl) -> None:
        super().__init__(setup, tables, far, near)
        self._parameters, self._response = setup.guidance.deck_following, setup.response
        self._turned_s = -math.inf
        self._down = False
        self._seen_s = -math.inf
        """Exposure of the newest sight of the tag."""
        self._state_m: Array = np.zeros((2, 3))
        """Deck's centre from the aircraft's, and the deck's velocity; forward, right, down, at the newest sight."""
        self._covariance: Array = np.zeros((2, 2))
        self._own_mps: Array = np.zeros(3)
        self._normal: Array = np.array([0.0, 0.0, 1.0])
        self._integral_mps2: Array = np.zeros(2)
        self._trimmed_s = math.inf

    def _with_picture(
        self, position: PositionEstimate, observation: Observation, telemetry: Telemetry
    ) -> PositionEstimate:
        """The tag's errors where it is seen, else the bar's."""
        told_mps, deck = telemetry.velocity_in_level_mps, observation.deck
        if told_mps is not None and np.isfinite(told_mps).all():
            self._own_mps = told_mps
        before = position.estimate or self._state.position.estimate
        if deck is None or before is None:
            return super()._with_picture(position, observation, telemetry)
        self._observe(deck, observation.t_s)
        error_m, rate_mps = self._state_m[0] * _UP, (self._state_m[1] - self._own_mps) * _UP
        error_m[2] += self._guidance.approach.hover_height_m
        estimate = NearEstimate(observation.t_s, error_m, rate_mps, before.yaw_rad, before.bar_elevation_rad)
        return PositionEstimate(estimate, estimate.aircraft_in_bar_m(self._references.hover_in_bar_m))

    def _observe(self, deck: DeckSight, t_s: float) -> None:
        """A step of the Kalman filter of `velocity_matching`, on three axes."""
        parameters, gap_s = self._parameters, t_s - self._seen_s
        seen_m = deck.centre_in_level_m + self._camera_in_body_m
        if not 0.0 < gap_s <= _LONGEST_GAP_S:
            self._state_m = np.array([seen_m, np.zeros(3)])
            self._covariance = np.diag([parameters.sight_m**2, 1.0])
        else:
            transition, push = np.array([[1.0, gap_s], [0.0, 1.0]]), np.array([0.5 * gap_s**2, gap_s])
            covariance = transition @ self._covariance @ transition.T
            covariance = covariance + parameters.target_mps2**2 * np.outer(push, push)
            gain = covariance[:, 0] / (covariance[0, 0] + parameters.sight_m**2)
            predicted = transition @ self._state_m - np.outer([gap_s, 0.0], self._own_mps)
            self._state_m = predicted + np.outer(gain, seen_m - predicted[0])
            self._covariance = covariance - np.outer(gain, covariance[0])
            off_m = np.clip(self._state_m[0, :2], -parameters.most_m, parameters.most_m)
            self._integral_mps2 = self._integral_mps2 + gap_s * parameters.integral_per_s3 * off_m
        self._seen_s = t_s
        if deck.normal_in_level is not None:
            self._normal = deck.normal_in_level

    def _near_sticks(self, state: PilotState, now_s: float, fresh: bool) -> SticksPercent:
        """By the tag while it was seen lately, predicted to now; else by the bar."""
        age_s = now_s - self._seen_s
        response, parameters = self._response, self._parameters
        if not self._down or age_s > parameters.patience_s:
            by_bar = super()._near_sticks(state, now_s, fresh)
            if response.kind == "attitude" and not self._down:  # the mean tilt, which holds against the wind
                share = -math.expm1(-max(now_s - self._trimmed_s, 0.0) / _TRIM_S)
                inputs_mps2 = np.array([response.input_of(by_bar.pitch), response.input_of(by_bar.roll)])
                self._integral_mps2 = self._integral_mps2 + share * (inputs_mps2 - self._integral_mps2)
                self._trimmed_s = now_s
            return by_bar
        rate_mps = self._state_m[1] - self._own_mps
        error_m = self._state_m[0] + age_s * rate_mps
        near_m = np.clip(error_m[:2], -parameters.most_m, parameters.most_m)
        if response.kind == "attitude":
            wanted = parameters.position_per_s2 * near_m + parameters.velocity_per_s * rate_mps[:2]
            wanted = wanted + self._integral_mps2
        else:
            wanted = parameters.speed_per_s * near_m + self._state_m[1, :2]
            wanted = wanted + self._integral_mps2 / parameters.velocity_per_s
        sticks = [response.stick_of(float(value)) for value in wanted]
        if response.kind == "attitude" and error_m[2] < parameters.attitude_below_m:
            tilts_rad = (math.atan2(float(part), float(self._normal[2])) for part in self._normal[:2])
            sticks = [
                stick - 100.0 * tilt / response.max_tilt_rad for stick, tilt in zip(sticks, tilts_rad, strict=True)
            ]
        heave = 100.0 * (self._guidance.approach.hover_height_m - float(error_m[2])) / response.max_climb_mps
        if state.modes.mode is Mode.LAND:
            heave = self._descent_percent(state.position)
        heave -= 100.0 * float(self._state_m[1, 2]) / response.max_climb_mps
        return SticksPercent(clamp(sticks[0], 100.0), clamp(sticks[1], 100.0), clamp(heave, 100.0), 0.0)

    def _camera_pitch_rad(self, state: PilotState, observation: Observation, now_s: float) -> float | None:
        """Down at the deck where it is near below, else as the modes look."""
        down = self._looks_down(state, now_s)
        if down is not self._down:
            self._down, self._turned_s = down, now_s
        if not down:
            return super()._camera_pitch_rad(state, observation, now_s)
        if now_s - self._seen_s > self._parameters.patience_s:
            return -0.5 * math.pi
        ahead_m, _, down_m = (self._state_m[0] - self._camera_in_body_m).tolist()
        return min(max(-math.atan2(down_m, ahead_m), -0.5 * math.pi), _STEEPEST_RAD)

    def _looks_down(self, state: PilotState, now_s: float) -> bool:
        parameters, estimate = self._parameters, state.position.estimate
        if state.modes.mode is Mode.LAND:
            return True
        if self._down:
            lost_s = now_s - max(self._seen_s, self._turned_s)
            return state.modes.mode in (Mode.APPROACH, Mode.NO_VISION) and lost_s <= parameters.patience_s
        if state.modes.mode is not Mode.APPROACH or estimate is None or now_s - self._turned_s < parameters.upward_s:
            return False
        slow = math.hypot(*estimate.rate_in_level_mps[:2].tolist()) < parameters.begin_mps
        return slow and float(np.max(np.abs(estimate.error_in_level_m))) < parameters.begin_m
