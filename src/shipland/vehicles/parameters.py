"""What the sections of all vehicles outside have in common."""

from __future__ import annotations

import math
from collections.abc import Mapping

from shipland.config import key, parameters


@parameters
class LinkParameters:
    """Full sticks, and how long to wait for whom."""

    max_tilt_deg: float = key(
        15.0, "at full stick, within the vehicle's own limits", "as [aircraft.settings]", ge=1, le=45
    )
    max_climb_mps: float = key(
        1.0, "at full stick, within the vehicle's own limits", "as [aircraft.settings]", ge=0.1, le=5
    )
    max_turn_deg_s: float = key(
        40.0, "at full stick, within the vehicle's own limits", "as [aircraft.settings]", ge=1, le=180
    )
    connect_timeout_s: float = key(20.0, "to the connection, and to the first of everything needed", ge=1, le=600)
    engage_timeout_s: float = key(120.0, "for the operator to give us the vehicle", ge=0.1, le=3600)
    link_timeout_s: float = key(
        3.0, "without a word of the vehicle for so long the flight is over", "chosen; one a second", ge=0.5, le=30
    )
    video_timeout_s: float = key(10.0, "likewise without a picture", ge=0.5, le=60)

    def full_sticks(
        self, kind: str, *, tilt_rad: float = math.inf, climb_mps: float = math.inf, speed_mps: float = 0.0
    ) -> dict[str, object]:
        """What full sticks mean, as keys of `Response`; tilt and climb within the vehicle's own limits."""
        speeds = {"max_speed_mps": speed_mps} if kind == "velocity" else {"max_speed_mps": 0.0, "servo_per_s": 0.0}
        return speeds | {
            "kind": kind,
            "max_tilt_rad": min(math.radians(self.max_tilt_deg), tilt_rad),
            "max_climb_mps": min(self.max_climb_mps, climb_mps),
            "max_turn_rad_s": math.radians(self.max_turn_deg_s),
        }


def measured(kind: str, table: Mapping[str, object]) -> dict[str, object]:
    """`[response.KIND]` of `[response]`: lags that were assumed or identified; empty where there are none."""
    found = table.get(kind, {})
    assert isinstance(found, Mapping)
    return dict(found)


@parameters
class SetpointParameters(LinkParameters):
    """Of a vehicle that is flown by set-points."""

    max_speed_mps: float = key(
        4.0, "at full stick, within the vehicle's own limits", "chosen, of the kind velocity", ge=0.1, le=20
    )
    setpoint_hz: float = key(
        50.0, "set-points a second", "10–50 Hz for SET_ATTITUDE_TARGET; PX4 wants more than 2 Hz", ge=5, le=200
    )
    gimbal_hz: float = key(10.0, "commands to the camera's mount a second", ge=0.1, le=100)
    stale_s: float = key(
        1.0, "without a command for so long it holds", "chosen: [Lee2022]'s longest cycle is 0.5 s", ge=0.1, le=5
    )
