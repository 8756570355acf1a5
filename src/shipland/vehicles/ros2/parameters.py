"""`[ros2]`."""

from __future__ import annotations

from typing import Literal

from shipland.config import key, parameters
from shipland.vehicles.parameters import SetpointParameters


@parameters
class Ros2Parameters(SetpointParameters):
    """`[ros2]`."""

    kind: Literal["attitude", "velocity"] = key(
        "velocity", "what set-points mean", "velocity: TwistStamped, REP-147's | attitude: AttitudeTarget, mavros's"
    )
    setpoint_hz: float = key(30.0, "set-points a second", "chosen: one a picture", ge=5, le=200)
