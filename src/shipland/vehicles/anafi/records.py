"""An ANAFI's records as telemetry, and commands as its sticks: pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from shipland.frames import euler_from_quaternion, rotation_from_euler, wrap_angle
from shipland.messages import GimbalAttitude, Intent, PilotCommand, Telemetry

FLYING = ("hovering", "flying", "takingoff", "landing", "motor_ramping", "usertakeoff", "emergency_landing")
"""Flying states in which motors run."""
_STANDING = ("landed", "emergency")
"""Flying states in which motors stand still."""


def sticks_of(command: PilotCommand) -> list[int]:
    """PCMD's roll, pitch, yaw and gaz in whole percent; all released for a hold or what is no number.

    >>> sticks_of(PilotCommand(0.0, 10.4, -20.0, 5.0, 200.0, 0.0))
    [-20, 10, 100, 5]
    """
    values = (command.roll_percent, command.pitch_percent, command.yaw_percent, command.heave_percent)
    if command.intent is Intent.HOLD or not all(map(math.isfinite, values)):
        return [0, 0, 0, 0]
    return [round(min(max(value, -100.0), 100.0)) for value in values]


def with_metadata(before: Telemetry, metadata: Mapping[str, Any], exposed_s: float) -> tuple[Telemetry, GimbalAttitude]:
    """Telemetry after a picture's metadata, where it knows nothing newer, and the camera's attitude in `level`.

    The metadata are PDrAW's, whatever the aircraft's own format: the aircraft at the picture's exposure, the camera's
    electronic stabilisation included.

    Raises:
        ValueError: a value is not finite, or a quaternion is not set.
        KeyError: a value is missing.
    """
    roll, pitch, yaw = _euler(metadata["drone"]["quat"])
    camera_roll, camera_pitch, camera_yaw = _euler(metadata["camera"]["quat"])
    speed, heading = metadata["drone"]["speed"], wrap_angle(yaw)
    north, east, down = (finite(speed[name]) for name in ("north", "east", "down"))
    turned = _with_attitude(before, roll, pitch, heading, exposed_s)
    told = _with_velocity(turned, (north, east, down), heading, exposed_s)
    return told, GimbalAttitude(camera_roll, camera_pitch, wrap_angle(camera_yaw - yaw))


def merged(before: Telemetry, kind: str, values: Mapping[str, Any], t_s: float) -> Telemetry:
    """Telemetry after one of the ANAFI's events, with ARSDK's arguments by name, true at `t_s`.

    Raises:
        ValueError: a value is not finite, or a state is unknown.
        KeyError: a value is missing.
    """
    if kind == "attitude":
        roll, pitch, yaw = (finite(values[name]) for name in ("roll", "pitch", "yaw"))
        return _with_attitude(before, roll, pitch, wrap_angle(yaw), t_s)
    if kind == "altitude":
        return replace(before, height_m=finite(values["altitude"]), height_t_s=t_s)
    if kind == "speed" and before.heading_rad is not None:
        north, east, down = (finite(values[name]) for name in ("speedX", "speedY", "speedZ"))
        return _with_velocity(before, (north, east, down), before.heading_rad, t_s)
    if kind == "battery":
        return replace(before, battery_percent=min(100.0, max(0.0, finite(values["percent"]))))
    if kind == "link":
        # the last four bits: 1 … 5 bars
        return replace(before, link_percent=min(100.0, 20.0 * (int(values["value"]) & 0x0F)))
    if kind == "flying":
        if values["state"] not in FLYING + _STANDING:
            raise ValueError(f"no flying state: {values['state']}")
        return replace(before, flying=values["state"] in FLYING)
    if kind == "alert":
        return replace(before, alerts="" if values["state"] == "none" else f"alert: {values['state']}")
    return before


def gimbal_of(values: Mapping[str, Any]) -> GimbalAttitude:
    """The event of the gimbal; raises as `merged` does."""
    return GimbalAttitude(*(math.radians(finite(values[name])) for name in ("roll_absolute", "pitch_absolute")))


def _with_attitude(before: Telemetry, roll: float, pitch: float, heading: float, t_s: float) -> Telemetry:
    if before.attitude_t_s is not None and before.attitude_t_s >= t_s:
        return before
    return replace(before, roll_rad=roll, pitch_rad=pitch, heading_rad=heading, attitude_t_s=t_s, heading_t_s=t_s)


def _with_velocity(
    before: Telemetry, velocity_in_ned_mps: tuple[float, float, float], heading_rad: float, t_s: float
) -> Telemetry:
    if before.velocity_t_s is not None and before.velocity_t_s >= t_s:
        return before
    level = rotation_from_euler(0.0, 0.0, heading_rad).T @ velocity_in_ned_mps
    return replace(before, velocity_in_level_mps=level, velocity_t_s=t_s)


def _euler(quaternion: Mapping[str, Any]) -> tuple[float, float, float]:
    w, x, y, z = (finite(quaternion[name]) for name in "wxyz")
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if abs(norm - 1.0) > 0.01:  # sent in 16 bits; one that is not set is zero
        raise ValueError(f"no unit quaternion: {quaternion}")
    return euler_from_quaternion((w / norm, x / norm, y / norm, z / norm))


def finite(value: Any) -> float:  # noqa: ANN401 - from JSON
    """A value as a number; raises as `merged` does."""
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"not finite: {value}")
    return number
