"""Run-time assurance: every pilot is untrusted, what it commands is bounded, monitored, and replaced when need be.

A cycle is one sentence: update the estimate, let the monitor look, let the switch choose who flies, bound the sticks.
Places come from the safety's own estimate, what a command is for from its intent; the pilot's estimate and mode are
never used. The pattern is that of ASTM F3269.
"""

from __future__ import annotations

import math
from dataclasses import replace

from shipland.camera import Camera
from shipland.config import key, parameters, require, scaled
from shipland.frames import Array
from shipland.guidance.response import Response
from shipland.messages import Decision, Intent, Mode, Observation, Override, PilotCommand, Telemetry
from shipland.rig import Rig
from shipland.safety.axes import Axes
from shipland.safety.cue_checks import CueHeight, CueHeightParameters
from shipland.safety.estimate import Place, SafetyEstimate, SafetyEstimator, Vector
from shipland.safety.monitor import Look, MonitorParameters, Ship, findings
from shipland.safety.recovery import RecoveryParameters, Rung, Switch, next_switch, sticks_of

_LOOK_AHEAD_S = 0.5
"""A descent is stopped so much earlier, after a cycle of it: the stick's slew, the uplink and the vehicle's braking."""

_CLIMB_PERCENT, _CLIMB_MARGIN_M = 60.0, 0.5
"""Without a pilot: how fast, and how far above the floor."""
_BY_HAND_PERCENT = 50.0
"""How fast a person's key sends it up."""


@parameters
class SafetyParameters:
    """`[safety]`."""

    max_percent: float = key(100.0, "bound on each stick", ge=1, le=100)
    slew_percent_per_s: float = key(
        1000.0, "bound on each stick's rate", "at 300 gusts at 7 m/s of wind are not held", ge=10, le=10000
    )
    stale_s: float = key(
        1.5, "a command to fly on older data becomes zero sticks; older places are not used", ge=0.1, le=5
    )
    floor_m: float = scaled(
        0.75, "least height of the aircraft's centre over the neutral deck unless landing on it", ge=0, le=100
    )
    floor_height_m: float = scaled(
        0.5, "least height over the take-off point, where the deck's is not known", ge=0, le=100
    )
    bar_clearance_m: float = scaled(1.2, "least distance of the aircraft's centre to the bar's plane", ge=0.1, le=100)
    fence_distance_m: float = scaled(400.0, "greatest distance to the bar", ge=5, le=20000)
    fence_height_m: float = scaled(60.0, "greatest height over the take-off point", ge=1, le=1000)
    low_battery_percent: float = key(
        15.0, "below this the reason carries a warning; no flight is broken off: the deck is nearest", ge=0, le=100
    )
    contact_height_m: float = scaled(
        0.9, "of the centre over the neutral deck at a contact", "heave limit, and 16 cm to spare", ge=0.05, le=20
    )
    contact_sight_s: float = key(
        1.0, "a sight of the bar or the deck that is older does not show contact height", ge=0.1, le=5
    )
    cue_height: CueHeightParameters = key(CueHeightParameters(), "which poses hang too low")
    monitor: MonitorParameters = key(MonitorParameters(), "what is looked for")
    recovery: RecoveryParameters = key(RecoveryParameters(), "what is done about it")

    def __post_init__(self) -> None:
        require(self.fence_distance_m > self.bar_clearance_m, "fence_distance_m > bar_clearance_m must hold")
        require(self.fence_height_m > self.floor_height_m, "fence_height_m > floor_height_m must hold")


class Safety:
    """Bounds every command, and flies itself away where the pilot would come to harm; each act is named in the reason.

    Args:
        parameters: the bounds.
        rig: dimensions, for the deck's place, what must not be struck, and ranges from boxes.
        camera: intrinsics, for ranges from boxes.
        camera_in_body_m: (3,) the camera's optical centre.
        response: what the sticks do on this vehicle.
    """

    def __init__(
        self, parameters: SafetyParameters, rig: Rig, camera: Camera, camera_in_body_m: Array, response: Response
    ) -> None:
        self._parameters, self._response = parameters, response
        self._deck_in_bar_m = rig.deck_in_bar_m
        self._half_deck_m = 0.5 * rig.deck_size_m
        self._ship = Ship.of(rig)
        self._estimator = SafetyEstimator(rig, camera, camera_in_body_m)
        self._estimate = SafetyEstimate()
        self._switch = Switch()
        self._cue_height, self._axes = CueHeight.of(parameters.cue_height, rig), Axes(response)
        self._last: PilotCommand | None = None

    @property
    def estimate(self) -> SafetyEstimate:
        """The safety's own estimate of the aircraft's position."""
        return self._estimate

    def admitted(self, observation: Observation, telemetry: Telemetry) -> Observation:
        """The observation as the pilot may have it: without a pose that is of the cue's mirror image; never raises."""
        self._cue_height, observation = self._cue_height.with_height(telemetry).checked(observation)
        return observation

    def check(
        self, decision: Decision, observation: Observation, telemetry: Telemetry, override: Override | None = None
    ) -> Decision:
        """The decision with its command made safe, or the recovery's; never raises.

        A person's override ends a recovery, a refusal too, and is held to the bounds alone; once it is lifted the
        monitor judges afresh.
        """
        self._estimate = self._estimator.updated(observation, telemetry)
        self._axes.take(self._last, telemetry)
        if override is not None:
            decision = by_hand(decision, override, telemetry.t_s, self._last)
        elif not all(map(math.isfinite, (*decision.command.sticks_percent, decision.command.gimbal_pitch_rad))):
            reason = "; ".join(filter(None, (decision.reason, "command not finite")))
            decision = self.without_pilot(reason, telemetry, self._last)
        command, notes = self._fresh(decision.command, telemetry.t_s)
        look = self._look(decision.command, telemetry)
        after = next_switch(self._switch, look, findings(look), self._parameters.recovery)
        self._switch = after if override is None else Switch()
        recovery, mode = self._switch.recovery, decision.mode
        if recovery is not None:
            estimate, limits = self._estimate, self._parameters.recovery
            before_rad = command.gimbal_pitch_rad
            command = sticks_of(recovery.rung, estimate, telemetry.t_s, before_rad, self._response, limits)
            mode = Mode.GO_AROUND
            notes.append(f"{'refused' if recovery.refuses else 'safety'}: {recovery.words}: {recovery.rung.value}")
        self._last = command = self._limited(self._bounded(command, look, notes), telemetry.t_s)
        battery = telemetry.battery_percent
        if battery is not None and battery < self._parameters.low_battery_percent:
            notes.append(f"battery at {battery:.0f} %")
        reason = "; ".join(filter(None, (decision.reason, *notes)))
        return Decision(command, mode, reason, decision.estimate, decision.landing_probability)

    def without_pilot(self, reason: str, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """What is flown when there is no pilot: up and away from a deck that is near, else hold; never raises."""
        self._cue_height = self._cue_height.unwatched()
        gimbal_rad, limits = 0.0 if sent is None else sent.gimbal_pitch_rad, self._parameters
        over_deck_m = self._estimate.over_deck_at(telemetry.t_s, limits.stale_s)
        hold = PilotCommand.hold(telemetry.t_s, gimbal_rad)
        if over_deck_m is None or over_deck_m >= limits.floor_m + _CLIMB_MARGIN_M or not telemetry.flying:
            return Decision(hold, None, f"{reason}: hold")
        climb = replace(hold, heave_percent=_CLIMB_PERCENT, intent=Intent.GO_AROUND)
        return Decision(climb, Mode.GO_AROUND, f"{reason}: go around")

    def _fresh(self, command: PilotCommand, t_s: float) -> tuple[PilotCommand, list[str]]:
        """The pilot's command at this time, or a hold where it is flown on data that is too old."""
        notes = list[str]()
        stale_s = t_s - self._estimate.seen_s
        if command.intent is Intent.FLY and stale_s > self._parameters.stale_s and any(command.sticks_percent):
            command = PilotCommand.hold(t_s, command.gimbal_pitch_rad)
            notes.append(f"data {stale_s:.1f} s old: hold" if math.isfinite(stale_s) else "nothing seen yet: hold")
        return command, notes

    def _look(self, command: PilotCommand, telemetry: Telemetry) -> Look:
        estimate, stale_s, t_s = self._estimate, self._parameters.stale_s, telemetry.t_s
        return Look(
            t_s=t_s,
            command=command,
            telemetry=telemetry,
            estimate=estimate,
            place_m=estimate.place_at(t_s, stale_s),
            velocity_mps=estimate.velocity_at(t_s, stale_s),
            over_deck_m=estimate.over_deck_at(t_s, stale_s),
            ship=self._ship,
            response=self._response,
            limits=self._parameters.monitor,
            reversed_stick=self._axes.reversed_stick,
        )

    def _at_contact_height(self, t_s: float) -> bool:
        """Whether a fresh sight shows the aircraft over the deck, and low enough to touch it."""
        limits, place_m = self._parameters, self._estimate.place_at(t_s, self._parameters.contact_sight_s)
        low = place_m is not None and self._estimate.deck_down_m - place_m[2] <= limits.contact_height_m
        return low and self._over_deck(place_m)

    def _bounded(self, command: PilotCommand, look: Look, notes: list[str]) -> PilotCommand:
        """Inside fence, floor and clearance; a ditching that was asked for has no floor."""
        recovery = self._switch.recovery
        if recovery is not None and recovery.rung is Rung.LAND:
            return command
        return self._bounded_place(self._bounded_height(command, look, notes), look, notes)

    def _bounded_height(self, command: PilotCommand, look: Look, notes: list[str]) -> PilotCommand:
        """No climb above the fence, no descent below the floor unless over the deck to land on it."""
        limits, estimate, over_deck_m = self._parameters, look.estimate, look.over_deck_m
        height_m = estimate.height_at(look.t_s, limits.stale_s)
        if command.heave_percent > 0.0:
            if height_m is None or height_m <= limits.fence_height_m:
                return command
            notes.append("fence: too high")
        elif command.heave_percent < 0.0:
            if command.intent is Intent.LAND and self._over_deck(look.place_m):
                return command
            cycle_s = 0.0 if self._last is None else max(look.t_s - self._last.t_s, 0.0)
            asked_mps = -0.01 * command.heave_percent * look.response.max_climb_mps
            sink_m = _LOOK_AHEAD_S * estimate.sink_mps + cycle_s * max(asked_mps, estimate.sink_mps)
            if over_deck_m is not None:
                if over_deck_m - sink_m >= limits.floor_m:
                    return command
                notes.append(f"floor: {over_deck_m:.2f} m over the deck")
            elif height_m is not None:
                if height_m - sink_m >= limits.floor_height_m:
                    return command
                notes.append(f"floor: {height_m:.2f} m over the take-off point")
            else:
                notes.append("floor: height unknown")
        return replace(command, heave_percent=0.0)

    def _over_deck(self, place_m: Place | None) -> bool:
        if place_m is None:
            return False
        aside_m = max(
            abs(place - float(deck)) for place, deck in zip(place_m[:2], self._deck_in_bar_m[:2], strict=True)
        )
        return aside_m <= self._half_deck_m

    def _bounded_place(self, command: PilotCommand, look: Look, notes: list[str]) -> PilotCommand:
        """No way towards a bar that is too near, none away from one that is too far."""
        limits, estimate, place_m = self._parameters, look.estimate, look.place_m
        distance_m = estimate.bar_distance_m()
        if place_m is not None and -place_m[0] < limits.bar_clearance_m:
            forward = math.cos(estimate.yaw_rad), -math.sin(estimate.yaw_rad)
            command = _without(command, forward, f"{-place_m[0]:.2f} m to the bar", notes)
        elif distance_m < limits.bar_clearance_m:
            command = _without(command, estimate.bar_in_level(), f"{distance_m:.2f} m to the bar", notes)
        if distance_m > limits.fence_distance_m:
            to_bar = estimate.bar_in_level()
            command = _without(command, (-to_bar[0], -to_bar[1]), f"fence: {distance_m:.0f} m from the bar", notes)
        return command

    def _limited(self, command: PilotCommand, t_s: float) -> PilotCommand:
        """The command at this time, its sticks within their range and rate."""
        limit, last = self._parameters.max_percent, self._last or command
        step = math.inf if self._last is None else self._parameters.slew_percent_per_s * max(0.0, t_s - last.t_s)
        sticks = [
            max(before - step, min(before + step, max(-limit, min(limit, stick))))
            for stick, before in zip(command.sticks_percent, last.sticks_percent, strict=True)
        ]
        pitch, roll, heave, yaw = sticks
        at_contact_height = self._at_contact_height(t_s)
        return PilotCommand(t_s, pitch, roll, heave, yaw, command.gimbal_pitch_rad, command.intent, at_contact_height)


def _gimbal_rad(command: PilotCommand, last: PilotCommand | None) -> float:
    """The camera pitch asked for [rad]; where that is no number, the last one that was sent."""
    if math.isfinite(command.gimbal_pitch_rad):
        return command.gimbal_pitch_rad
    return 0.0 if last is None else last.gimbal_pitch_rad


def by_hand(decision: Decision, override: Override, t_s: float, last: PilotCommand | None = None) -> Decision:
    """What a person asks for in place of a decision; the camera looks where the pilot wants it."""
    gimbal_rad = _gimbal_rad(decision.command, last)
    command, mode = PilotCommand.hold(t_s, gimbal_rad), decision.mode
    if override is Override.CLIMB:
        command, mode = replace(command, heave_percent=_BY_HAND_PERCENT, intent=Intent.GO_AROUND), Mode.GO_AROUND
    return replace(decision, command=command, mode=mode, reason=override.value)


def _without(command: PilotCommand, direction: Vector, note: str, notes: list[str]) -> PilotCommand:
    """The command without its part along a horizontal unit vector in `level`; unchanged where it has none."""
    pitch, roll = command.pitch_percent, command.roll_percent
    along = direction[0] * pitch + direction[1] * roll
    if along <= 0.0:
        return command
    notes.append(note)
    return replace(command, pitch_percent=pitch - along * direction[0], roll_percent=roll - along * direction[1])
