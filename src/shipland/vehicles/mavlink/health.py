"""What an autopilot says is wrong with itself, in words; empty while it is well."""

from __future__ import annotations

import math

from shipland.vehicles.mavlink.dialect import Message, dialect

ALERT_S = 3.0
"""An alert that is not said again for so long is over; every one of these messages comes twice a second or more."""
_NOT_FLOWN_BY = {"PREARM_CHECK", "LOGGING", "EXTENSION_USED", "ENUM_END"}
"""Bits of SYS_STATUS that do not concern the flight."""
_SENSORS = {
    bit: name.replace("_", " ").lower()
    for bit, entry in dialect.enums["MAV_SYS_STATUS_SENSOR"].items()
    if (name := entry.name.removeprefix("MAV_SYS_STATUS_").removeprefix("SENSOR_")) not in _NOT_FLOWN_BY
}
_ARDUPILOT_VARIANCE = 0.8
"""FS_EKF_THRESH as delivered, above which an ArduPilot takes its own failsafe."""
_PX4_RATIO = 1.0
"""From here on PX4's estimator rejects the measurement."""
_WANTED = {1: "no attitude", 4: "no vertical speed"}
"""Bits of both autopilots' estimator flags that must be set."""
_CONSTANT_POSITION = 128
_ARDUPILOT_UNWANTED = {_CONSTANT_POSITION: "no position", 1024: "not initialised", 32768: "GPS glitch"}
_PX4_UNWANTED = {_CONSTANT_POSITION: "no position", 1024: "GPS glitch", 2048: "accelerometer error"}
_STATES = {5: "CRITICAL", 6: "EMERGENCY"}
"""MAV_STATE."""


def heartbeat_alert(it: Message) -> str:
    """Of HEARTBEAT."""
    return f"the autopilot says {_STATES[it.system_status]}" if it.system_status in _STATES else ""


def sensors_alert(it: Message) -> str:
    """Of SYS_STATUS: what is present, enabled and not healthy."""
    ill = it.onboard_control_sensors_present & it.onboard_control_sensors_enabled & ~it.onboard_control_sensors_health
    names = ", ".join(words for bit, words in _SENSORS.items() if ill & bit)
    return f"not healthy: {names}" if names else ""


def ardupilot_estimator_alert(it: Message) -> str:
    """Of EKF_STATUS_REPORT."""
    parts = {
        "velocity": it.velocity_variance, "place": it.pos_horiz_variance, "height": it.pos_vert_variance,
        "compass": it.compass_variance,
    }  # fmt: skip
    return _estimator_alert(it.flags, _ARDUPILOT_UNWANTED, parts, _ARDUPILOT_VARIANCE)


def px4_estimator_alert(it: Message) -> str:
    """Of ESTIMATOR_STATUS."""
    parts = {
        "velocity": it.vel_ratio, "place": it.pos_horiz_ratio, "height": it.pos_vert_ratio, "compass": it.mag_ratio,
    }  # fmt: skip
    return _estimator_alert(it.flags, _PX4_UNWANTED, parts, _PX4_RATIO)


def _estimator_alert(flags: int, unwanted: dict[int, str], innovations: dict[str, float], most: float) -> str:
    words = [text for bit, text in _WANTED.items() if not flags & bit]
    words += [text for bit, text in unwanted.items() if flags & bit]
    words += [
        f"{name} innovation {part / most:.1f} of its limit"
        for name, part in innovations.items()
        if math.isfinite(part) and part >= most
    ]
    return f"estimator: {', '.join(words)}" if words else ""
