"""Sticks in percent as MAVLink set-points: tilt, climb rate and heading, or a velocity in the body's heading."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.frames import wrap_angle
from shipland.guidance.response import Response
from shipland.messages import Intent, PilotCommand
from shipland.vehicles.mavlink.dialect import Message, dialect

BODY_VELOCITY_MASK = 0b010111000111
"""Mask of SET_POSITION_TARGET_LOCAL_NED: only velocity and yaw rate count."""
_FRAME_BODY_NED = 8
_HEADING_LEAD_RAD = 0.3
"""Largest lead of the heading set-point over the aircraft's heading, so that a blocked turn does not wind up."""


@dataclass(frozen=True)
class MavlinkTarget:
    """Who the set-points are for."""

    system: int
    component: int = 1


@dataclass(frozen=True)
class Wanted:
    """A command in the vehicle's own measures.

    Attributes:
        forward, right: tilts [rad] or speeds [m/s], as the vehicle's sticks mean.
        climb_mps: upward.
        turn_rad_s: clockwise.
        hold: brake and keep the place, whatever else stands here.
    """

    forward: float
    right: float
    climb_mps: float
    turn_rad_s: float
    hold: bool = False


HOLD = Wanted(0.0, 0.0, 0.0, 0.0, hold=True)


def wanted_of(command: PilotCommand, response: Response) -> Wanted:
    """A command on this vehicle; clipped to full sticks, and a hold where a stick is no number."""
    percents = (command.pitch_percent, command.roll_percent, command.heave_percent, command.yaw_percent)
    if command.intent is Intent.HOLD or not all(map(math.isfinite, percents)):
        return HOLD
    pitch, roll, heave, yaw = (0.01 * min(max(percent, -100.0), 100.0) for percent in percents)
    full = response.max_tilt_rad if response.kind == "attitude" else response.max_speed_mps
    return Wanted(full * pitch, full * roll, heave * response.max_climb_mps, yaw * response.max_turn_rad_s)


def pressed(response: Response, velocity_in_level_mps: tuple[float, float, float] | None, down_mps: float) -> Wanted:
    """What presses an aircraft on the deck it has touched: down, level, no turn, and carried along with the deck.

    Args:
        response: of this vehicle.
        velocity_in_level_mps: its own; a vehicle that flies speeds is commanded this one, so that it does not tilt.
        down_mps: descent.
    """
    forward, right = 0.0, 0.0
    if response.kind == "velocity" and velocity_in_level_mps is not None:
        forward, right, _ = velocity_in_level_mps
    return Wanted(forward, right, -down_mps, 0.0)


def velocity_message(wanted: Wanted, target: MavlinkTarget, boot_ms: int) -> Message:
    """SET_POSITION_TARGET_LOCAL_NED in the body's heading; for velocity vehicles, and any vehicle's hold."""
    forward, right = (0.0, 0.0) if wanted.hold else (wanted.forward, wanted.right)
    climb, turn = (0.0, 0.0) if wanted.hold else (wanted.climb_mps, wanted.turn_rad_s)
    return dialect.MAVLink_set_position_target_local_ned_message(
        boot_ms, target.system, target.component, _FRAME_BODY_NED, BODY_VELOCITY_MASK,
        0.0, 0.0, 0.0, forward, right, -climb, 0.0, 0.0, 0.0, 0.0, turn,
    )  # fmt: skip


def level_message(target: MavlinkTarget) -> Message:
    """SET_ATTITUDE_TARGET that levels an ArduPilot heading north and holds its height: a hold without a position."""
    return dialect.MAVLink_set_attitude_target_message(
        0, target.system, target.component, 0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.5
    )


@dataclass(frozen=True)
class ClimbScale:
    """What an ArduPilot makes of SET_ATTITUDE_TARGET's thrust: 0.5 holds, 1 and 0 are these rates [m/s]."""

    up_mps: float
    down_mps: float

    def thrust(self, climb_mps: float) -> float:
        """The thrust that asks for a vertical speed.

        >>> ClimbScale(2.5, 1.5).thrust(-0.75)
        0.25
        """
        full_mps = self.up_mps if climb_mps > 0.0 else self.down_mps
        return 0.5 + 0.5 * min(max(climb_mps / full_mps, -1.0), 1.0)


class AttitudeTarget:
    """SET_ATTITUDE_TARGET with an integrated heading; one for a flight.

    Args:
        scale: what thrust means.
        target: who it is for.
    """

    def __init__(self, scale: ClimbScale, target: MavlinkTarget) -> None:
        self._scale, self._target = scale, target
        self._heading_rad = math.nan

    def rest(self) -> None:
        """Another kind of set-point: the next heading begins at the aircraft's."""
        self._heading_rad = math.nan

    def message(self, wanted: Wanted, heading_rad: float, step_s: float, boot_ms: int) -> Message:
        """The next set-point.

        Args:
            wanted: tilts, climb and turn.
            heading_rad: the aircraft's.
            step_s: since the set-point before.
            boot_ms: our clock.
        """
        if math.isnan(self._heading_rad):
            self._heading_rad = heading_rad
        ahead = wrap_angle(self._heading_rad + wanted.turn_rad_s * step_s - heading_rad)
        ahead = min(max(ahead, -_HEADING_LEAD_RAD), _HEADING_LEAD_RAD)
        self._heading_rad = wrap_angle(heading_rad + ahead)
        quaternion = quaternion_of(wanted.right, -wanted.forward, self._heading_rad)
        return dialect.MAVLink_set_attitude_target_message(
            boot_ms, self._target.system, self._target.component, 0, quaternion,
            0.0, 0.0, wanted.turn_rad_s, self._scale.thrust(wanted.climb_mps),
        )  # fmt: skip


def quaternion_of(roll_rad: float, pitch_rad: float, yaw_rad: float) -> list[float]:
    """(w, x, y, z) of yaw, pitch, roll."""
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
