"""The checklist's lines about a ROS 2 vehicle."""

from __future__ import annotations

import time
from collections.abc import Sequence

from shipland.vehicles.camera_stream import CameraStream
from shipland.vehicles.checks import Check, battery_check, limits_text, telemetry_check
from shipland.vehicles.ros2.setup import Ros2Setup
from shipland.vehicles.ros2.state import SILENT_S, Heard


def ros2_checks(heard: Heard, stream: CameraStream, setup: Ros2Setup, others: Sequence[str]) -> list[Check]:
    """What is known after a few seconds of listening; `others`: topics of set-points that another node publishes."""
    wanted, topics, now_s = setup.preflight, setup.topics, time.monotonic()
    telemetry, silent = heard.telemetry_at(now_s), heard.silent_s > SILENT_S
    stated = "" if setup.latency_s is None else f", {setup.latency_s:g} s of it stated"
    lines = [
        Check(
            "state", not silent,
            f"/{topics['state']} (mavros_msgs/State) has not come"
            if silent else f"/{topics['state']}: mode {heard.mode}, {'armed' if telemetry.flying else 'not armed'}",
        ),
        telemetry_check(heard.attitude_hz, wanted.telemetry_hz, f"/{topics['odom']}: attitude "),
        Check(
            "pictures", stream.rate_hz >= wanted.picture_hz,
            f"/{topics['image']}: {stream.rate_hz:.1f} Hz, at least {wanted.picture_hz:g}"
            + (f"; {stream.problem}" if stream.problem else ""),
        ),
        Check(
            "picture's age", stream.age_s <= wanted.picture_age_s,
            f"{stream.age_s:.3f} s at receipt{stated}, at most {wanted.picture_age_s:g}",
        ),
        Check("limits", True, limits_text(setup.response) + ", as configured: a ROS 2 vehicle does not tell them"),
        battery_check(telemetry.battery_percent, wanted.battery_percent, f"/{topics['battery']}: "),
    ]  # fmt: skip
    if others:
        words = f"another node publishes /{', /'.join(others)} (a second shipland?): end it, two would fly the vehicle"
        lines.append(Check("one commander", False, words))
    if setup.camera is None:
        lines.insert(0, Check("calibration", True, f"/{topics['camera_info']}"))
    tells = heard.tells_mount or setup.fixed_pitch_rad is not None or setup.frames is not None
    if not tells:
        words = f"/{topics['gimbal']} has not come; a camera fixed to the body is ?mount_deg=PITCH"
        lines.append(Check("gimbal", False, words))
    return lines
