"""`[anafi]`."""

from __future__ import annotations

from shipland.config import key, parameters


@parameters
class AnafiParameters:
    """`[anafi]`."""

    max_tilt_deg: float = key(
        15.0, "at full stick; set on the aircraft and read back", "as [aircraft.settings]", ge=1, le=45
    )
    max_climb_mps: float = key(
        1.0, "at full stick; set on the aircraft and read back", "as [aircraft.settings]", ge=0.1, le=5
    )
    max_turn_deg_s: float = key(
        40.0, "at full stick; set on the aircraft and read back", "as [aircraft.settings]", ge=1, le=180
    )
    connect_timeout_s: float = key(20.0, "to the connection and to the first picture", ge=1, le=600)
    engage_timeout_s: float = key(120.0, "until somebody has taken off", ge=0.1, le=3600)
    link_timeout_s: float = key(
        3.0, "without an event for so long the flight is over", "chosen: fifteen events of 5 Hz", ge=0.5, le=30
    )
    video_timeout_s: float = key(10.0, "without a picture for so long the flight is over", ge=0.5, le=60)
    latency_s: float = key(
        0.28, "from exposure to receipt of the quickest picture", "Parrot's streaming latency as advertised", ge=0, le=3
    )
    event_latency_s: float = key(
        0.1, "from an event's being true to its receipt", "as [delays.telemetry.anafi]", ge=0, le=3
    )
