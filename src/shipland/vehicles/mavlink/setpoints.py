"""What is wanted as MAVLink set-points: tilt, climb rate and heading, or a velocity in the body's heading."""

from __future__ import annotations

from shipland.frames import quaternion_from_euler
from shipland.vehicles.mavlink.dialect import AUTOPILOT, Message, dialect
from shipland.vehicles.wanted import Wanted

BODY_VELOCITY_MASK = 0b010111000111
"""Mask of SET_POSITION_TARGET_LOCAL_NED: only velocity and yaw rate count."""


def velocity_message(wanted: Wanted, system: int, boot_ms: int) -> Message:
    """SET_POSITION_TARGET_LOCAL_NED in the body's heading; for velocity vehicles, and any vehicle's hold."""
    forward, right = (0.0, 0.0) if wanted.hold else (wanted.forward, wanted.right)
    climb, turn = (0.0, 0.0) if wanted.hold else (wanted.climb_mps, wanted.turn_rad_s)
    return dialect.MAVLink_set_position_target_local_ned_message(
        boot_ms, system, AUTOPILOT, dialect.MAV_FRAME_BODY_NED, BODY_VELOCITY_MASK,
        0.0, 0.0, 0.0, forward, right, -climb, 0.0, 0.0, 0.0, 0.0, turn,
    )  # fmt: skip


def level_message(system: int) -> Message:
    """SET_ATTITUDE_TARGET that levels an ArduPilot heading north and holds its height: a hold without a position."""
    return dialect.MAVLink_set_attitude_target_message(
        0, system, AUTOPILOT, 0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 0.5
    )


def attitude_message(wanted: Wanted, heading_rad: float, thrust: float, system: int, boot_ms: int) -> Message:
    """SET_ATTITUDE_TARGET with the heading to turn to and `thrust_of` the climb."""
    quaternion = list(quaternion_from_euler(wanted.right, -wanted.forward, heading_rad))
    return dialect.MAVLink_set_attitude_target_message(
        boot_ms, system, AUTOPILOT, 0, quaternion, 0.0, 0.0, wanted.turn_rad_s, thrust
    )
