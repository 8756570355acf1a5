"""The pilot of five modes [Lee2022, §Nonlinear Control System]: estimate → mode → reference → control → gimbal.

The aircraft is led over the deck's neutral point, as the level bar shows it; the deck's motion is neither measured nor
followed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipland.estimation.heading import Compass
from shipland.frames import wrap_angle
from shipland.guidance.far import FarControl, FarSight, FarTables, FarTarget
from shipland.guidance.modes import INTENTS, ModeMemory, next_mode
from shipland.guidance.near import NearControl, NearEstimate, measure
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.response import HOLD, SticksPercent, clamp
from shipland.guidance.situation import PositionEstimate, References, situation_of, without_large_boxes
from shipland.guidance.view import View, flown_box_elevation_rad, search, smoothed_rad, target_column_px
from shipland.messages import Box, Decision, Estimate, Mode, Observation, PilotCommand, Telemetry


@dataclass(frozen=True)
class PilotState:
    """State of the pilot between cycles, without that of its two controls and its compass.

    Attributes:
        now_s: time of the last decision; None before the first.
        first_s: exposure of the first frame: the first search begins there.
        modes: memory of the mode function.
        position: place against the bar.
        seen_rad: compass heading at which the target was seen last; without a compass its bearing then.
        far_heading_rad: compass heading held in the far modes; None until a box is flown on.
        search_side_rad: bearing of the side that the search turns to first.
        far_mode: far mode that the far control flew last.
        gimbal_pitch_rad: camera pitch commanded last.
        sticks: sticks decided last.
    """

    now_s: float | None
    first_s: float
    modes: ModeMemory
    position: PositionEstimate
    seen_rad: float
    far_heading_rad: float | None
    search_side_rad: float
    far_mode: Mode | None
    gimbal_pitch_rad: float
    sticks: SticksPercent


class ModePilot:
    """Modes around a far control and a near control.

    In the far modes the heading is held at which the ship was first seen: without a link to it nobody knows its course.

    Args:
        setup: parameters, rig, camera.
        tables: Table 1 in the camera's pixels; much larger boxes than its setpoints are ignored.
        far: flies on boxes.
        near: flies on corners.
    """

    def __init__(self, setup: PilotSetup, tables: FarTables, far: FarControl, near: NearControl) -> None:
        self._guidance, self._tables, self._far, self._near = setup.guidance, tables, far, near
        self._view, self._compass = View.of(setup.camera), Compass()
        self._camera_in_body_m = np.asarray(setup.camera_in_body_m, dtype=float)
        self._references = References.of(setup.rig, setup.guidance.approach)
        self._reference_in_bar_m = self._references.hover_in_bar_m
        self._state = PilotState(
            now_s=None,
            first_s=0.0,
            modes=ModeMemory(),
            position=PositionEstimate(),
            seen_rad=0.0,
            far_heading_rad=None,
            search_side_rad=0.0,
            far_mode=None,
            gimbal_pitch_rad=math.radians(setup.guidance.search.camera_pitch_deg[0]),
            sticks=HOLD,
        )

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """One cycle: estimate, choose the mode, fly its law; never raises."""
        state = self._state
        step_s = 0.0 if state.now_s is None else telemetry.t_s - state.now_s
        if state.now_s is None:
            state = replace(state, first_s=observation.t_s)
        state = replace(state, now_s=telemetry.t_s)
        state = self._with_direction(state, observation, telemetry)
        observation = without_large_boxes(observation, self._tables, self._guidance.approach.largest_box)
        state = replace(state, position=self._with_picture(state.position, observation, telemetry))
        situation = situation_of(
            observation, telemetry, state.position, state.modes, self._references, self._guidance.approach, sent
        )
        state = replace(state, modes=next_mode(situation, state.modes, self._guidance.modes))
        state = replace(state, position=self._led_to(state.position, state.modes.mode))
        state = self._flown(state, observation, telemetry, step_s)
        wanted_rad = self._camera_pitch_rad(state, observation, telemetry.t_s)
        pitch_rad = smoothed_rad(
            state.gimbal_pitch_rad, wanted_rad, step_s, self._guidance.approach.gimbal_time_constant_s
        )
        self._state = state = replace(state, gimbal_pitch_rad=pitch_rad)
        mode = state.modes.mode
        command = PilotCommand(telemetry.t_s, *state.sticks, pitch_rad, INTENTS[mode])
        return Decision(
            command, mode, state.modes.reason, _estimate_of(state.position) if mode in _NEAR_MODES else None
        )

    def _with_direction(self, state: PilotState, observation: Observation, telemetry: Telemetry) -> PilotState:
        """Remember the compass, and the direction in which the target is seen."""
        if telemetry.heading_rad is None:
            self._compass = Compass()
        else:
            heading_s = telemetry.t_s if telemetry.heading_t_s is None else telemetry.heading_t_s
            self._compass.add(heading_s, telemetry.heading_rad)
        column_px = target_column_px(observation)
        if column_px is None:
            return state
        bearing_rad = self._view.bearing_rad(column_px, observation.gimbal.yaw_rad)
        return replace(state, seen_rad=bearing_rad + (self._compass.at(observation.t_s) or 0.0))

    def _with_picture(
        self, position: PositionEstimate, observation: Observation, telemetry: Telemetry
    ) -> PositionEstimate:
        """Filter the picture's errors to the present reference."""
        pose = observation.nose_pose
        if pose is None:
            return position
        age_s, own_mps = telemetry.t_s - observation.t_s, telemetry.velocity_in_level_mps
        measured = measure(observation.t_s, age_s, pose, self._reference_in_bar_m, self._camera_in_body_m, own_mps)
        measured = replace(
            measured,
            gimbal=observation.gimbal,
            heading_rad=self._compass.at(observation.t_s),
            velocity_t_s=telemetry.velocity_t_s,
        )
        before = position.estimate
        if before is not None and measured.t_s - before.t_s > self._guidance.modes.lost_s:
            self._near.reset()
        estimate = self._near.observe(measured)
        return PositionEstimate(estimate, estimate.aircraft_in_bar_m(self._reference_in_bar_m))

    def _led_to(self, position: PositionEstimate, mode: Mode) -> PositionEstimate:
        """Lead the near control to the mode's reference; with another one its estimate starts anew."""
        reference_in_bar_m = self._references.point_in_bar_m(mode)
        if reference_in_bar_m is self._reference_in_bar_m:
            return position
        self._reference_in_bar_m = reference_in_bar_m
        self._near.reset()
        return replace(position, estimate=None)

    def _flown(self, state: PilotState, observation: Observation, telemetry: Telemetry, step_s: float) -> PilotState:
        """The sticks of the mode."""
        mode, fresh = state.modes.mode, observation.bar_pose is not None
        if mode in (Mode.APPROACH, Mode.LAND):
            return replace(state, sticks=self._near_sticks(state, telemetry.t_s, fresh))
        if mode in (Mode.TRACK_BAR, Mode.TRACK_SHIP):
            return self._flown_far(state, observation, telemetry)
        if mode is Mode.GO_AROUND:
            return replace(state, sticks=self._go_around_sticks(state, telemetry, fresh))
        if mode is Mode.SEARCH:
            return self._searched(state, telemetry, step_s)
        if mode is Mode.DONE:
            return replace(state, sticks=HOLD)
        keep = math.exp(-_DECAY * step_s / max(self._guidance.modes.memory_s, 1e-3))
        return replace(state, sticks=SticksPercent(*(keep * stick for stick in state.sticks)))

    def _near_sticks(self, state: PilotState, now_s: float, fresh: bool) -> SticksPercent:
        """Approach and landing: the near law on fresh errors, the last sticks until they are lost."""
        position, sticks = state.position, HOLD
        if position.age_s(now_s) <= self._guidance.modes.lost_s:
            sticks = self._near.sticks(self._heading_rad(position)) if fresh else state.sticks
        if state.modes.mode is Mode.LAND:
            sticks = sticks._replace(heave=self._descent_percent(position))
        return sticks

    def _heading_rad(self, position: PositionEstimate) -> float:
        if position.aircraft_in_bar_m is None:
            return 0.0
        return self._references.heading_rad(position.aircraft_in_bar_m, self._view, self._guidance.approach)

    def _descent_percent(self, position: PositionEstimate) -> float:
        """Descent; `steady`, it waits above commit height while the error predicted for `gate_s` later is too large."""
        approach, estimate = self._guidance.approach, position.estimate
        if estimate is None or position.aircraft_in_bar_m is None or approach.at_once:
            return -approach.descent_percent
        predicted_m = estimate.error_in_level_m[:2] + approach.gate_s * estimate.rate_in_level_mps[:2]
        high = self._references.height_m(position.aircraft_in_bar_m) > approach.commit_height_m
        waits = high and float(np.max(np.abs(predicted_m))) > approach.gate_m
        return 0.0 if waits else -approach.descent_percent

    def _go_around_sticks(self, state: PilotState, telemetry: Telemetry, fresh: bool) -> SticksPercent:
        """Up and back: to the retry reference while the corners are seen, else by sticks alone."""
        approach, climbing_s = self._guidance.approach, telemetry.t_s - state.modes.since_s
        estimate = state.position.estimate
        if estimate is not None and state.position.age_s(telemetry.t_s) <= self._guidance.modes.lost_s:
            sticks = self._near.sticks(self._heading_rad(state.position)) if fresh else state.sticks
            low = float(estimate.error_in_level_m[2]) > 0.5
            return sticks._replace(heave=max(sticks.heave, approach.go_around_percent)) if low else sticks
        if climbing_s > 4.0 * approach.go_around_s:
            return HOLD
        yaw = 0.0
        if telemetry.heading_rad is not None:
            aside_rad = wrap_angle(state.seen_rad - telemetry.heading_rad)
            yaw = clamp(approach.go_around_turn * math.degrees(aside_rad), 100.0)
        return SticksPercent(-approach.back_off_percent, 0.0, approach.go_around_percent, yaw)

    def _searched(self, state: PilotState, telemetry: Telemetry, step_s: float) -> PilotState:
        searching_s = _searching_s(state, telemetry.t_s)
        side_rad = state.search_side_rad
        if searching_s <= step_s:
            side_rad = wrap_angle(state.seen_rad - (telemetry.heading_rad or 0.0))
        sticks = search(searching_s, self._guidance.search, side_rad)[0]
        return replace(state, sticks=sticks, search_side_rad=side_rad, far_heading_rad=None)

    def _flown_far(self, state: PilotState, observation: Observation, telemetry: Telemetry) -> PilotState:
        """The far law on the mode's box; without one the last sticks."""
        mode = state.modes.mode
        target, box = FarTarget.SHIP, observation.ship_box
        if mode is Mode.TRACK_BAR:
            target, box = FarTarget.BAR, observation.bar_box
        if mode is not state.far_mode:
            self._far.reset()
            state = replace(state, far_mode=mode)
        if box is None:
            return state
        held_rad = self._held_heading_rad(state, box, observation)
        error_deg = None
        if held_rad is not None and telemetry.heading_rad is not None:
            error_deg = math.degrees(wrap_angle(held_rad - telemetry.heading_rad))
        sight = FarSight(box, target, observation.t_s, observation.gimbal, error_deg)
        return replace(state, sticks=self._far.sticks(sight), far_heading_rad=held_rad)

    def _held_heading_rad(self, state: PilotState, box: Box, observation: Observation) -> float | None:
        """The compass heading to hold: that of the first box, moved so that the target stays in the picture."""
        heading_rad = self._compass.at(observation.t_s)
        if heading_rad is None:
            return state.far_heading_rad
        held_rad = state.far_heading_rad
        if held_rad is None:
            held_rad = heading_rad + self._view.bearing_rad(box.centre_px[0], observation.gimbal.yaw_rad)
        off_rad = wrap_angle(state.seen_rad - held_rad)
        return held_rad + off_rad - clamp(off_rad, math.radians(self._guidance.approach.max_bearing_deg))

    def _camera_pitch_rad(self, state: PilotState, observation: Observation, now_s: float) -> float | None:
        """Desired camera pitch: to the bar by its pose, to a box by its row, down in search; None: unchanged."""
        mode, estimate = state.modes.mode, state.position.estimate
        if mode in _NEAR_MODES and estimate is not None and now_s - estimate.t_s <= self._guidance.modes.memory_s:
            return estimate.bar_elevation_rad
        if mode is Mode.SEARCH:
            return search(_searching_s(state, now_s), self._guidance.search)[1]
        return flown_box_elevation_rad(mode, observation, self._view)


def _searching_s(state: PilotState, now_s: float) -> float:
    return now_s - max(state.modes.since_s, state.first_s)


def _estimate_of(position: PositionEstimate) -> Estimate | None:
    estimate: NearEstimate | None = position.estimate
    if estimate is None or position.aircraft_in_bar_m is None:
        return None
    return Estimate(estimate.t_s, position.aircraft_in_bar_m, estimate.yaw_rad)


_DECAY = 6.0
"""Time constants within the memory of mode 5: at its end the data fed before count for nothing."""
_NEAR_MODES = (Mode.APPROACH, Mode.LAND, Mode.NO_VISION, Mode.GO_AROUND)
