"""`[ros2]`."""

from __future__ import annotations

from typing import Literal

from shipland.config import key, parameters


@parameters
class Ros2Parameters:
    """`[ros2]`."""

    kind: Literal["attitude", "velocity"] = key(
        "velocity", "what set-points mean", "velocity: TwistStamped, REP-147's | attitude: AttitudeTarget, mavros's"
    )
    max_tilt_deg: float = key(15.0, "at full stick", "as [aircraft.settings]", ge=1, le=45)
    max_speed_mps: float = key(4.0, "at full stick, of the kind velocity", "as [mavlink]", ge=0.1, le=20)
    max_climb_mps: float = key(1.0, "at full stick", "as [aircraft.settings]", ge=0.1, le=5)
    max_turn_deg_s: float = key(40.0, "at full stick", "as [aircraft.settings]", ge=1, le=180)
    setpoint_hz: float = key(30.0, "set-points a second", "chosen: one a picture", ge=5, le=200)
    gimbal_hz: float = key(10.0, "commands to the camera's mount a second", ge=0.1, le=100)
    connect_timeout_s: float = key(20.0, "to the first of everything needed", ge=1, le=600)
    engage_timeout_s: float = key(120.0, "for the vehicle to be armed and obey set-points", ge=0.1, le=3600)
    stale_s: float = key(
        1.0, "without a command for so long it holds", "chosen: [Lee2022]'s longest cycle is 0.5 s", ge=0.1, le=5
    )
    link_timeout_s: float = key(3.0, "without the vehicle's state for so long the flight is over", ge=0.5, le=30)
    video_timeout_s: float = key(10.0, "likewise without a picture", ge=0.5, le=60)
