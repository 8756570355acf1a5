"""The pilot `horizon`: estimator → modes → guidance → regulator → gimbal."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shipland.frames import Array
from shipland.guidance.horizon.descent import Descent, Phase
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.estimator import Estimator
from shipland.guidance.horizon.guidance import Guidance
from shipland.guidance.horizon.modes import situation_of
from shipland.guidance.horizon.regulator import Plan, Reference, Regulator
from shipland.guidance.modes import INTENTS, ModeMemory, next_mode, overruled
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.response import HOLD, Response, SticksPercent, clamp
from shipland.guidance.view import View, flown_box_elevation_rad, search, smoothed_rad, target_column_px
from shipland.messages import Decision, Estimate, Mode, Observation, PilotCommand, Telemetry

if TYPE_CHECKING:
    from shipland.guidance.horizon.steering import Steering  # a policy: other flights do without

_SILENT_S = 1.0
"""After a gap this long without picture and telemetry the position is unknown: the vehicle held by itself meanwhile."""
_TRACKS = (Mode.TRACK_SHIP, Mode.TRACK_BAR, Mode.APPROACH, Mode.LAND, Mode.NO_VISION, Mode.GO_AROUND)


class PilotState(NamedTuple):
    """State of the pilot between cycles, without that of its filters.

    Attributes:
        gimbal_pitch_rad: camera pitch commanded last.
        first_s, now_s: time of the first and of the last decision; None before the first.
        heard_s: time of the newest picture or telemetry.
        cycle_s: mean length of a cycle of late.
        modes: memory of the mode function.
        distance_m: last known distance to the bar.
        seen_rad: bearing at which the target was seen last: the search turns to that side first.
        reference, descent: of the flight on the estimate, and of a landing.
        odds: of a landing; None where they are not known.
    """

    gimbal_pitch_rad: float
    first_s: float | None = None
    now_s: float | None = None
    heard_s: float = -math.inf
    cycle_s: float = 1.0 / 30.0
    modes: ModeMemory = ModeMemory()
    distance_m: float = math.inf
    seen_rad: float = 0.0
    reference: Reference | None = None
    descent: Descent | None = None
    odds: float | None = None


@dataclass(frozen=True)
class Planned:
    """A cycle before its sticks.

    Attributes:
        state: of the pilot after the cycle.
        now_s: time of the decision.
        estimate: at the command's effect; None while it cannot be flown on.
        plan: what the regulator follows; None in modes that are flown without an estimate.
        at_picture: the estimate at the picture's exposure; None while the bar's heading is not known.
    """

    state: PilotState
    now_s: float
    estimate: Estimated | None
    plan: Plan | None
    at_picture: Estimate | None


class HorizonPilot:
    """Flies to the landing point that the level bar shows, from the first box to contact, on one estimate.

    Args:
        setup: of the flight.
        steering: a policy that changes the horizontal input near the landing point; None flies without.
    """

    def __init__(self, setup: PilotSetup, steering: Steering | None = None) -> None:
        self._parameters, self._response, self._steering = setup.guidance, setup.response, steering
        self._estimator = Estimator(
            setup.guidance.horizon, setup.response, setup.rig, setup.camera, setup.camera_in_body_m
        )
        self._regulator = Regulator(setup.guidance.horizon, setup.response, steering)
        self._guidance = Guidance(setup, self._regulator)
        self._view = View.of(setup.camera)
        self._camera_in_body_m: Array = np.asarray(setup.camera_in_body_m, dtype=float)
        self._state = PilotState(math.radians(setup.guidance.search.camera_pitch_deg[0]))

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None = None) -> Decision:
        """One cycle; never raises."""
        return self.command(self.plan(observation, telemetry, sent))

    def plan(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None = None) -> Planned:
        """The cycle without its sticks: estimator, modes, guidance and gimbal."""
        now_s, estimator = telemetry.t_s, self._estimator
        step_s = 0.0 if self._state.now_s is None else now_s - self._state.now_s
        state = _in_time(self._state, now_s, step_s)
        observation, state = self._estimated(observation, telemetry, sent, state)
        estimate = estimator.estimate(estimator.effect_s(now_s))
        if estimate is not None and not self._usable(estimate, now_s):
            estimate = None
        state, plan = self._in_mode(observation, telemetry, sent, estimate, state), None
        mode = state.modes.mode
        if estimate is not None and mode in _TRACKS:
            plan = self._guidance.plan(mode, estimate, (state.reference, state.descent), now_s, (step_s, state.cycle_s))
            state = _with_descent(state._replace(reference=plan.reference, odds=plan.odds), plan.descent)
        else:
            state = state._replace(reference=None, odds=None)
        self._state = state = self._with_gimbal(observation, estimate, state, step_s)
        return Planned(state, now_s, estimate, plan, estimator.at_picture(estimator.taken_s(observation.t_s)))

    def command(self, planned: Planned) -> Decision:
        """The regulator's part: the sticks of what was planned last; changes nothing that the pilot remembers."""
        state, estimate, plan = planned.state, planned.estimate, planned.plan
        if estimate is not None and plan is not None:
            sticks = self._regulator.sticks(estimate, plan)
        else:
            sticks = self._without_estimate(state, planned.now_s)
        mode = state.modes.mode
        command = PilotCommand(planned.now_s, *sticks, state.gimbal_pitch_rad, INTENTS[mode])
        note = "" if self._steering is None else self._steering.note
        reason = "; ".join(filter(None, (state.modes.reason, note)))
        descent = None if plan is None else plan.descent
        probability = None if descent is None or descent.odds is None else descent.odds.now
        return Decision(command, mode, reason, planned.at_picture, probability)

    def own_input(self, planned: Planned) -> tuple[Array, Estimated, Plan] | None:
        """What a policy is asked about a plan, as `Steering.instead_of` takes it; None where it is not asked."""
        estimate, plan = planned.estimate, planned.plan
        if estimate is None or plan is None or not plan.steerable:
            return None
        return self._regulator.input(estimate, plan), estimate, plan

    def _estimated(
        self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None, state: PilotState
    ) -> tuple[Observation, PilotState]:
        """Update the estimator; the observation without what must not be flown on."""
        estimator, landing = self._estimator, state.modes.mode in (Mode.LAND, Mode.GO_AROUND)
        if sent is not None:
            estimator.sent(sent)
        heard_s = max(observation.t_s, telemetry.newest_s)
        silent_s = heard_s - state.heard_s if math.isfinite(state.heard_s) else 0.0
        if _SILENT_S < silent_s < math.inf:
            estimator.forget_place()
            observation = Observation(observation.t_s, observation.gimbal, reason=f"nothing heard for {silent_s:.1f} s")
        estimator.take(observation, telemetry, landing)
        if landing and estimator.rejected:
            observation = replace(observation, bar_pose=None, reason=estimator.rejected)
        column_px = target_column_px(observation)
        seen_rad = state.seen_rad
        if column_px is not None:
            seen_rad = self._view.bearing_rad(column_px, observation.gimbal.yaw_rad)
        return observation, state._replace(heard_s=max(heard_s, state.heard_s), seen_rad=seen_rad)

    def _usable(self, estimate: Estimated, now_s: float) -> bool:
        """The position was seen of late, or is known well enough without."""
        seen_of_late = now_s - self._estimator.seen_s <= self._parameters.modes.memory_s + 1.0
        return seen_of_late or estimate.position_std_m <= self._parameters.horizon.position_std_max_m

    def _in_mode(
        self,
        observation: Observation,
        telemetry: Telemetry,
        sent: PilotCommand | None,
        estimate: Estimated | None,
        state: PilotState,
    ) -> PilotState:
        """The next mode; outside a landing there is no descent."""
        if estimate is not None:
            place_m = estimate.aircraft_in_bar_m
            state = state._replace(distance_m=math.sqrt(place_m.dot(place_m)))
        situation = situation_of(
            observation, telemetry, estimate, (state.descent, state.odds), state.modes, self._parameters
        )
        situation = situation._replace(
            near_ship=state.distance_m < self._parameters.approach.go_around_radius_m,
            overruled=overruled(sent, state.modes.mode),
        )
        state = state._replace(modes=next_mode(situation, state.modes, self._parameters.modes))
        return state if state.modes.mode is Mode.LAND else state._replace(descent=None)

    def _without_estimate(self, state: PilotState, now_s: float) -> SticksPercent:
        """The sticks of a mode that is flown without an estimate."""
        if state.modes.mode is Mode.SEARCH:
            return search(_in_mode_s(state, now_s), self._parameters.search, state.seen_rad)[0]
        if state.modes.mode is Mode.GO_AROUND:
            tilt_mps2 = self._estimator.trim_in_level_mps2(now_s)
            since_s = _in_mode_s(state, now_s)
            return open_loop_go_around(since_s, self._parameters.approach, self._response, tilt_mps2)
        return HOLD

    def _with_gimbal(
        self, observation: Observation, estimate: Estimated | None, state: PilotState, step_s: float
    ) -> PilotState:
        """The camera pitch commanded next."""
        assert state.now_s is not None
        pitch_rad = smoothed_rad(
            state.gimbal_pitch_rad,
            self._camera_pitch_rad(observation, estimate, state, state.now_s),
            step_s,
            self._parameters.approach.gimbal_time_constant_s,
        )
        return state._replace(gimbal_pitch_rad=pitch_rad)

    def _camera_pitch_rad(
        self, observation: Observation, estimate: Estimated | None, state: PilotState, now_s: float
    ) -> float | None:
        """Desired camera pitch: that of the search, to a box by its row, to the bar; None: unchanged."""
        mode = state.modes.mode
        if mode is Mode.SEARCH or (mode is Mode.GO_AROUND and estimate is None):
            return search(_in_mode_s(state, now_s), self._parameters.search)[1]
        box_rad = flown_box_elevation_rad(mode, observation, self._view)
        if box_rad is not None or estimate is None:
            return box_rad
        lens_m = estimate.down_m + float(self._camera_in_body_m[2])
        ahead_m = math.hypot(*estimate.place_m.tolist()) - float(self._camera_in_body_m[0])
        return math.atan2(lens_m, max(ahead_m, 0.3))


def _in_time(state: PilotState, now_s: float, step_s: float) -> PilotState:
    """The state at the time of a decision."""
    first_s = now_s if state.first_s is None else state.first_s
    cycle_s = state.cycle_s + 0.3 * (step_s - state.cycle_s) if step_s > 0.0 else state.cycle_s
    return state._replace(now_s=now_s, first_s=first_s, cycle_s=cycle_s)


def _with_descent(state: PilotState, descent: Descent | None) -> PilotState:
    """The state with a descent; a final descent tells with which odds it began."""
    before = None if state.descent is None else state.descent.phase
    if descent is not None and descent.odds is not None and before is not descent.phase is Phase.FINAL_DESCENT:
        reason = f"final descent at odds of {100.0 * descent.odds.now:.0f} %"
        state = state._replace(modes=state.modes._replace(reason=reason))
    return state._replace(descent=descent)


def _in_mode_s(state: PilotState, now_s: float) -> float:
    """How long the mode has lasted; in the first mode, the flight."""
    return now_s - max(state.modes.since_s, state.first_s or 0.0)


def open_loop_go_around(
    since_s: float, approach: ApproachParameters, response: Response, tilt_mps2: Array | None
) -> SticksPercent:
    """The sticks.

    Args:
        since_s: the go-around's begin.
        approach: its height, time and sticks.
        response: of the vehicle.
        tilt_mps2: (2,) forward and right in `level`, by the mean tilt of late: where a stick means a tilt, who backs
            off level is taken by the wind. None where it means a speed.
    """
    climb_s = approach.go_around_height_m / (0.01 * approach.go_around_percent * response.max_climb_mps)
    if since_s <= climb_s:
        return SticksPercent(0.0, 0.0, approach.go_around_percent, 0.0)
    if since_s > climb_s + approach.go_around_s:
        return SticksPercent(0.0, 0.0, 0.0, 0.0)
    forward, right = (0.0, 0.0) if tilt_mps2 is None else map(response.stick_of, tilt_mps2.tolist())
    return SticksPercent(clamp(forward - approach.back_off_percent, 100.0), clamp(right, 100.0), 0.0, 0.0)
