"""What stands between every pilot and the vehicle: bounds, slew, stale data, fence, floor. Outside every pilot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from shipland.config import require
from shipland.messages import Decision, Intent, Mode, Observation, PilotCommand, Telemetry
from shipland.rig import Rig


@dataclass(frozen=True)
class SafetyParameters:
    """`[safety]`.

    Attributes:
        max_percent: bound on each stick.
        slew_percent_per_s: bound on each stick's rate.
        stale_s: data older than this while a mode flies on vision turns the sticks to zero.
        floor_m: least height of the aircraft's centre over the neutral deck unless landing.
        bar_clearance_m: least distance of the aircraft's centre to the bar's plane.
        fence_distance_m: greatest distance to the bar.
        fence_height_m: greatest height over the take-off point.
        low_battery_percent: below this a warning stands in the reason.
    """

    max_percent: float
    slew_percent_per_s: float
    stale_s: float
    floor_m: float
    bar_clearance_m: float
    fence_distance_m: float
    fence_height_m: float
    low_battery_percent: float

    def __post_init__(self) -> None:
        require(0.0 < self.max_percent <= 100.0, "max_percent must be in (0, 100]")
        require(self.slew_percent_per_s > 0.0, "slew_percent_per_s must be positive")


class Safety:
    """Bounds every command; each intervention is named in the decision's reason."""

    def __init__(self, parameters: SafetyParameters, rig: Rig) -> None:
        self._parameters = parameters
        self._deck_down_m = float(rig.deck_in_bar_m[2])
        self._last: PilotCommand | None = None
        self._fresh_s = -math.inf

    def check(self, decision: Decision, observation: Observation, telemetry: Telemetry) -> Decision:
        """The decision with its command made safe; never raises."""
        command, notes = decision.command, []
        if not all(map(math.isfinite, _sticks(command))) or not math.isfinite(command.gimbal_pitch_rad):
            gimbal_rad = command.gimbal_pitch_rad if math.isfinite(command.gimbal_pitch_rad) else 0.0
            command, notes = PilotCommand.hold(command.t_s, gimbal_rad), ["command not finite: hold"]
        if observation.bar_pose or observation.bar_box or observation.ship_box:
            self._fresh_s = observation.t_s
        stale_s = telemetry.t_s - self._fresh_s
        if decision.mode in _VISUAL_MODES and stale_s > self._parameters.stale_s:
            command = PilotCommand.hold(command.t_s, command.gimbal_pitch_rad)
            notes.append(f"data {stale_s:.1f} s old: hold")
        command = self._fence(command, decision, telemetry, notes)
        command = self._limit(command)
        self._last = command
        battery = telemetry.battery_percent
        if battery is not None and battery < self._parameters.low_battery_percent:
            notes.append(f"battery at {battery:.0f} %")
        reason = "; ".join([decision.reason, *notes]) if notes else decision.reason
        return replace(decision, command=command, reason=reason)

    def _fence(self, command: PilotCommand, decision: Decision, telemetry: Telemetry, notes: list[str]) -> PilotCommand:
        limits, place_m = self._parameters, None
        if decision.estimate is not None:
            place_m = decision.estimate.aircraft_in_bar_m
        if (
            telemetry.height_m is not None
            and telemetry.height_m > limits.fence_height_m
            and command.heave_percent > 0.0
        ):
            command = replace(command, heave_percent=0.0)
            notes.append("fence: too high")
        if place_m is None:
            return command
        over_deck_m = self._deck_down_m - float(place_m[2])
        landing = command.intent is Intent.LAND
        if not landing and over_deck_m < limits.floor_m and command.heave_percent < 0.0:
            command = replace(command, heave_percent=0.0)
            notes.append(f"floor: {over_deck_m:.2f} m over the deck")
        if -float(place_m[0]) < limits.bar_clearance_m and command.pitch_percent > 0.0:
            command = replace(command, pitch_percent=0.0)
            notes.append(f"{-float(place_m[0]):.2f} m to the bar")
        if -float(place_m[0]) > limits.fence_distance_m and command.pitch_percent < 0.0:
            command = replace(command, pitch_percent=0.0)
            notes.append("fence: too far")
        return command

    def _limit(self, command: PilotCommand) -> PilotCommand:
        limit = self._parameters.max_percent
        sticks = [max(-limit, min(limit, stick)) for stick in _sticks(command)]
        if self._last is not None:
            step = self._parameters.slew_percent_per_s * max(0.0, command.t_s - self._last.t_s)
            sticks = [
                max(before - step, min(before + step, stick))
                for stick, before in zip(sticks, _sticks(self._last), strict=True)
            ]
        pitch, roll, heave, yaw = sticks
        return replace(command, pitch_percent=pitch, roll_percent=roll, heave_percent=heave, yaw_percent=yaw)


_VISUAL_MODES = (Mode.APPROACH, Mode.TRACK_BAR, Mode.TRACK_SHIP)


def _sticks(command: PilotCommand) -> tuple[float, float, float, float]:
    return command.pitch_percent, command.roll_percent, command.heave_percent, command.yaw_percent
