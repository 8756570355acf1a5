"""The pilot: five modes, the far law on boxes, a near control on corners [Lee2022, flowchart].

The aircraft's place is wanted over the deck's neutral point, as the level bar shows it; the deck's motion is neither
measured nor followed. With `near.PublishedNear` it is the published pilot; with `offset_free.OffsetFreeNear` ours.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shipland.frames import Array, wrap_angle
from shipland.guidance.far import FarControl, FarSight
from shipland.guidance.laws import clamp
from shipland.guidance.modes import ModeMemory, Situation, next_mode
from shipland.guidance.near import Measured, NearControl, NearEstimate, Sticks, measure
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.search import search
from shipland.messages import Box, Decision, Estimate, Intent, Mode, Observation, PilotCommand, Telemetry


class ModePilot:
    """Modes around a far control and a near control. Time comes with the data.

    In the far modes the heading is held at which the ship was first seen ahead: without a link to it nobody knows its
    course.
    """

    def __init__(self, setup: PilotSetup, far: FarControl, near: NearControl) -> None:
        parameters, rig, camera = setup.guidance, setup.rig, setup.camera
        self._parameters = parameters
        self._focal_px = camera.focal_px
        self._middle_px = (float(camera.matrix[0, 2]), float(camera.matrix[1, 2]))
        self._camera_in_body_m = np.asarray(setup.camera_in_body_m, dtype=float)
        self._half_view_rad = math.atan2(0.5 * camera.width_px, camera.focal_px)
        self._half_cue_m = float(np.max(np.abs(rig.target.points_in_bar_m[:, 1])))
        self._deck_down_m = float(rig.deck_in_bar_m[2])
        approach = parameters.approach
        self._hover_in_bar_m = rig.deck_in_bar_m - np.array([0.0, 0.0, approach.hover_height_m])
        self._retry_in_bar_m = rig.deck_in_bar_m - np.array(
            [approach.climb_out_back_m, 0.0, approach.climb_out_height_m]
        )
        self._wanted_in_bar_m = self._hover_in_bar_m
        self._far, self._near = far, near
        self._far_heading_rad: float | None = None
        self._seen_rad = 0.0
        self._search_side_rad = 0.0
        self._far_mode: Mode | None = None
        self._modes = ModeMemory()
        self._estimate: NearEstimate | None = None
        self._aircraft_in_bar_m: Array | None = None
        self._gimbal_pitch_rad = math.radians(parameters.search.camera_pitch_deg[0])
        self._sticks = Sticks(0.0, 0.0, 0.0, 0.0)
        self._now_s: float | None = None

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """One cycle: estimate, choose the mode, fly its law."""
        if sent is not None:
            sticks = Sticks(sent.pitch_percent, sent.roll_percent, sent.heave_percent, sent.yaw_percent)
            self._far.sent(sent.t_s, sticks)
            self._near.sent(sent.t_s, sticks)
        step_s = 0.0 if self._now_s is None else telemetry.t_s - self._now_s
        self._now_s = telemetry.t_s
        self._remember_side(observation, telemetry.heading_rad)
        observation = self._usable(observation)
        fresh = observation.bar_pose is not None
        if observation.bar_pose is not None:
            pose = observation.bar_pose
            measured = measure(observation.t_s, pose, self._wanted_in_bar_m, self._camera_in_body_m)
            self._take(measured, telemetry.t_s)
        self._modes = next_mode(self._situation(observation, telemetry), self._modes, self._parameters.modes)
        mode = self._modes.mode
        self._want(self._retry_in_bar_m if mode is Mode.CLIMB_OUT else self._hover_in_bar_m)
        self._sticks = self._fly(mode, observation, telemetry, fresh, step_s)
        self._point_camera(mode, observation, step_s)
        command = PilotCommand(telemetry.t_s, *self._sticks, self._gimbal_pitch_rad, _INTENTS[mode])
        estimate = self._estimate if mode in _NEAR_MODES else None
        known = None
        if estimate is not None and self._aircraft_in_bar_m is not None:
            known = Estimate(estimate.valid_s, self._aircraft_in_bar_m, estimate.yaw_rad)
        return Decision(command, mode, self._modes.reason, known)

    def _usable(self, observation: Observation) -> Observation:
        """The observation without boxes that are much larger than where the far laws lead: those are not for them."""
        most, ship, bar = self._parameters.approach.largest_box, observation.ship_box, observation.bar_box
        if ship is not None and ship.area_px2 > most * self._parameters.ship.pitch.setpoint:
            ship = None
        if bar is not None and bar.area_px2 > most * self._parameters.bar.pitch.setpoint:
            bar = None
        if ship is observation.ship_box and bar is observation.bar_box:
            return observation
        reason = "; ".join(text for text in (observation.reason, "too near for the far laws") if text)
        return replace(observation, ship_box=ship, bar_box=bar, reason=reason)

    def _want(self, place_in_bar_m: Array) -> None:
        """Lead the near control to another place; its estimate starts anew with the next picture."""
        if place_in_bar_m is not self._wanted_in_bar_m:
            self._wanted_in_bar_m, self._estimate = place_in_bar_m, None
            self._near.reset()

    def _take(self, measured: Measured, ready_s: float) -> None:
        before = self._estimate
        if before is not None and measured.t_s - before.t_s > self._parameters.modes.lost_s:
            self._near.reset()
        self._estimate = self._near.observe(measured, ready_s)
        self._aircraft_in_bar_m = self._estimate.aircraft_in_bar_m(self._wanted_in_bar_m)

    def _situation(self, observation: Observation, telemetry: Telemetry) -> Situation:
        approach, place_m = self._parameters.approach, self._aircraft_in_bar_m
        height_m = None if place_m is None else self._deck_down_m - float(place_m[2])
        distance_m = math.inf if place_m is None else float(np.linalg.norm(place_m))
        climbing_s = telemetry.t_s - self._modes.since_s
        clear = place_m is not None and bool(
            place_m[0] < self._retry_in_bar_m[0] + 1.0 and place_m[2] < self._retry_in_bar_m[2] + 0.5
        )
        return Situation(
            now_s=telemetry.t_s,
            observation=observation,
            landing_condition=self._landing_condition(telemetry.t_s),
            committed=height_m is not None and height_m < approach.commit_height_m,
            astray=self._astray(),
            near_ship=distance_m < approach.climb_out_radius_m,
            clear=climbing_s >= approach.climb_out_s and (clear or climbing_s >= 4.0 * approach.climb_out_s),
            flying=telemetry.flying,
        )

    def _landing_condition(self, now_s: float) -> str:
        approach, estimate = self._parameters.approach, self._estimate
        if estimate is None:
            return "no pose yet"
        if now_s - estimate.t_s > approach.max_data_age_s:
            return f"data {now_s - estimate.t_s:.1f} s old"
        forward_m, right_m, up_m = estimate.error_in_level_m
        if max(abs(forward_m), abs(right_m)) > 0.5 * approach.square_m * approach.square_margin:
            return f"{forward_m:+.2f} m forward, {right_m:+.2f} m right of the place wanted"
        if abs(up_m) > approach.max_height_error_m:
            return f"{up_m:+.2f} m to the hover height"
        if float(np.linalg.norm(estimate.rate_in_level_mps)) > approach.max_speed_mps:
            return "not steady"
        if abs(math.degrees(estimate.yaw_rad)) > approach.max_yaw_error_deg:
            return f"heading off by {math.degrees(estimate.yaw_rad):.0f}°"
        return ""

    def _astray(self) -> str:
        if self._modes.mode is not Mode.LAND or self._estimate is None:
            return ""
        off_m = float(np.max(np.abs(self._estimate.error_in_level_m[:2])))
        return f"{off_m:.2f} m off the place wanted while landing" if off_m > self._parameters.approach.astray_m else ""

    def _fly(self, mode: Mode, observation: Observation, telemetry: Telemetry, fresh: bool, step_s: float) -> Sticks:
        if mode in (Mode.APPROACH, Mode.LAND):
            return self._fly_near(mode, fresh)
        if mode in (Mode.TRACK_BAR, Mode.TRACK_SHIP):
            return self._fly_far(mode, observation, telemetry)
        if mode is Mode.CLIMB_OUT:
            return self._climb_out(telemetry, fresh)
        if mode is Mode.SEARCH:
            self._far_heading_rad = None
            searching_s = self._searching_s(telemetry.t_s)
            if searching_s <= step_s:
                self._search_side_rad = self._side_rad(telemetry.heading_rad)
            return search(searching_s, self._parameters.search, self._search_side_rad)[0]
        if mode is Mode.DONE:
            return Sticks(0.0, 0.0, 0.0, 0.0)
        keep = math.exp(-_DECAY * step_s / max(self._parameters.modes.memory_s, 1e-3))
        return Sticks(*(keep * stick for stick in self._sticks))

    def _remember_side(self, observation: Observation, heading_rad: float | None) -> None:
        """Where the target was seen last: a compass heading; without a compass a bearing."""
        box = observation.bar_box or observation.ship_box
        if observation.bar_pose is not None:
            column_px = float(np.mean(observation.bar_pose.corners_px[:, 0]))
        elif box is not None:
            column_px = box.centre_px[0]
        else:
            return
        self._seen_rad = self._bearing_rad(column_px) + (heading_rad or 0.0)

    def _bearing_rad(self, column_px: float) -> float:
        """Of a column of the picture, right of its middle."""
        return math.atan2(column_px - self._middle_px[0], self._focal_px)

    def _side_rad(self, heading_rad: float | None) -> float:
        """The bearing at which the target was seen last."""
        return wrap_angle(self._seen_rad - (heading_rad or 0.0))

    def _searching_s(self, now_s: float) -> float:
        return now_s - max(self._modes.since_s, 0.0)

    def _climb_out(self, telemetry: Telemetry, fresh: bool) -> Sticks:
        """Up and back: to the place of the next try while the corners are seen, else by sticks alone."""
        approach, climbing_s = self._parameters.approach, telemetry.t_s - self._modes.since_s
        if self._estimate is not None and self._stale_s() <= self._parameters.modes.lost_s:
            sticks = self._near.sticks(self._wanted_yaw_rad()) if fresh else self._sticks
            low = float(self._estimate.error_in_level_m[2]) > 0.5
            return sticks._replace(heave=max(sticks.heave, approach.climb_out_percent)) if low else sticks
        if climbing_s > 4.0 * approach.climb_out_s:
            return Sticks(0.0, 0.0, 0.0, 0.0)
        turn_percent = clamp(approach.climb_out_turn * math.degrees(self._side_rad(telemetry.heading_rad)), 100.0)
        yaw = turn_percent if telemetry.heading_rad is not None else 0.0
        return Sticks(-approach.back_off_percent, 0.0, approach.climb_out_percent, yaw)

    def _fly_near(self, mode: Mode, fresh: bool) -> Sticks:
        estimate = self._estimate
        if estimate is None or self._stale_s() > self._parameters.modes.lost_s:
            sticks = Sticks(0.0, 0.0, 0.0, 0.0)
        else:
            sticks = self._near.sticks(self._wanted_yaw_rad()) if fresh else self._sticks
        if mode is Mode.LAND:
            sticks = sticks._replace(heave=self._descent(estimate))
        return sticks

    def _wanted_yaw_rad(self) -> float:
        """Heading against the bar: along it, but never so that the bar leaves the picture sideways."""
        if self._aircraft_in_bar_m is None:
            return 0.0
        forward_m, right_m = -float(self._aircraft_in_bar_m[0]), -float(self._aircraft_in_bar_m[1])
        to_bar_rad = math.atan2(right_m, forward_m)
        cue_rad = math.atan2(self._half_cue_m, max(math.hypot(forward_m, right_m), 0.1))
        approach = self._parameters.approach
        room_rad = self._half_view_rad - cue_rad - math.radians(approach.bearing_margin_deg)
        widest_rad = clamp(room_rad, math.radians(approach.max_bearing_deg))
        return to_bar_rad - clamp(to_bar_rad, max(widest_rad, 0.0))

    def _descent(self, estimate: NearEstimate | None) -> float:
        approach = self._parameters.approach
        if estimate is None or self._aircraft_in_bar_m is None:
            return -approach.descent_percent
        ahead_m = estimate.error_in_level_m[:2] + approach.gate_s * estimate.rate_in_level_mps[:2]
        high = self._deck_down_m - float(self._aircraft_in_bar_m[2]) > approach.commit_height_m
        waits = high and float(np.max(np.abs(ahead_m))) > approach.gate_m
        return 0.0 if waits else -approach.descent_percent

    def _stale_s(self) -> float:
        if self._estimate is None or self._now_s is None:
            return math.inf
        return self._now_s - self._estimate.t_s

    def _fly_far(self, mode: Mode, observation: Observation, telemetry: Telemetry) -> Sticks:
        box, gains = observation.ship_box, self._parameters.ship
        if mode is Mode.TRACK_BAR:
            box, gains = observation.bar_box, self._parameters.bar
        if mode is not self._far_mode:
            self._far.reset()
            self._far_mode = mode
        if box is None:
            return self._sticks
        error_deg = self._heading_error_deg(box, telemetry.heading_rad)
        sight = FarSight(box, observation.t_s, telemetry.t_s, observation.gimbal.pitch_rad, error_deg)
        return self._far.sticks(sight, gains)

    def _heading_error_deg(self, box: Box, heading_rad: float | None) -> float | None:
        if heading_rad is None:
            return None
        if self._far_heading_rad is None:
            self._far_heading_rad = heading_rad + self._bearing_rad(box.centre_px[0])
        # The target must not leave the picture sideways.
        off_rad = wrap_angle(self._seen_rad - self._far_heading_rad)
        self._far_heading_rad += off_rad - clamp(off_rad, math.radians(self._parameters.approach.max_bearing_deg))
        return math.degrees(wrap_angle(self._far_heading_rad - heading_rad))

    def _point_camera(self, mode: Mode, observation: Observation, step_s: float) -> None:
        """Keep the target in the picture: the bar by its pose, a box by its row; look ahead and down in search."""
        box = {Mode.TRACK_BAR: observation.bar_box, Mode.TRACK_SHIP: observation.ship_box}.get(mode)
        if mode in _NEAR_MODES and self._estimate is not None and self._stale_s() <= self._parameters.modes.memory_s:
            wanted_rad = self._estimate.bar_elevation_rad
        elif box is not None:
            below_rad = math.atan2(box.centre_px[1] - self._middle_px[1], self._focal_px)
            wanted_rad = observation.gimbal.pitch_rad - below_rad
        elif mode is Mode.SEARCH and self._now_s is not None:
            wanted_rad = search(self._searching_s(self._now_s), self._parameters.search)[1]
        else:
            return
        time_constant_s = self._parameters.approach.gimbal_time_constant_s
        share = 1.0 - math.exp(-step_s / time_constant_s) if step_s > 0.0 else 1.0
        self._gimbal_pitch_rad += share * (wanted_rad - self._gimbal_pitch_rad)


_DECAY = 6.0
"""Time constants within the memory of mode 5: at its end the data fed before count for nothing."""
_NEAR_MODES = (Mode.APPROACH, Mode.LAND, Mode.NO_VISION, Mode.CLIMB_OUT)
_INTENTS = {
    Mode.LAND: Intent.LAND,
    Mode.APPROACH: Intent.FLY,
    Mode.TRACK_BAR: Intent.FLY,
    Mode.TRACK_SHIP: Intent.FLY,
    Mode.NO_VISION: Intent.FLY,
    Mode.SEARCH: Intent.HOLD,
    Mode.CLIMB_OUT: Intent.CLIMB_OUT,
    Mode.DONE: Intent.HOLD,
}
