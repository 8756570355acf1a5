"""What is wanted as MAVLink set-points: tilt, climb rate and heading, or a velocity in the body's heading."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.frames import quaternion_from_euler
from shipland.vehicles.mavlink.dialect import Message, dialect
from shipland.vehicles.wanted import HeadingSetPoint, Wanted

BODY_VELOCITY_MASK = 0b010111000111
"""Mask of SET_POSITION_TARGET_LOCAL_NED: only velocity and yaw rate count."""
_FRAME_BODY_NED = 8


@dataclass(frozen=True)
class MavlinkTarget:
    """Who the set-points are for."""

    system: int
    component: int = 1


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
    """SET_ATTITUDE_TARGET with an integrated heading; one for a flight."""

    def __init__(self, scale: ClimbScale, target: MavlinkTarget) -> None:
        self._scale, self._target = scale, target
        self._heading = HeadingSetPoint()

    def rest(self) -> None:
        """Another kind of set-point: the next heading begins at the aircraft's."""
        self._heading.rest()

    def message(self, wanted: Wanted, heading_rad: float, step_s: float, boot_ms: int) -> Message:
        """The next set-point."""
        heading_rad = self._heading.next_rad(wanted.turn_rad_s, heading_rad, step_s)
        quaternion = list(quaternion_from_euler(wanted.right, -wanted.forward, heading_rad))
        return dialect.MAVLink_set_attitude_target_message(
            boot_ms, self._target.system, self._target.component, 0, quaternion,
            0.0, 0.0, wanted.turn_rad_s, self._scale.thrust(wanted.climb_mps),
        )  # fmt: skip
