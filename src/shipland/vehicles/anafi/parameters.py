"""`[anafi]` of vehicles.toml."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.config import require_within


@dataclass(frozen=True)
class AnafiParameters:
    """`[anafi]` of vehicles.toml.

    Attributes:
        max_tilt_deg, max_climb_mps, max_turn_deg_s: set on the aircraft and read back; what full sticks mean.
        connect_timeout_s: to the connection and to the first picture.
        engage_timeout_s: until somebody has taken off.
        link_timeout_s: without an event of the aircraft for so long the flight is over.
        video_timeout_s: without a picture for so long the flight is over.
        latency_s: from exposure to receipt of the quickest picture.
        event_latency_s: from an event's being true to its receipt.
    """

    max_tilt_deg: float
    max_climb_mps: float
    max_turn_deg_s: float
    connect_timeout_s: float
    engage_timeout_s: float
    link_timeout_s: float
    video_timeout_s: float
    latency_s: float
    event_latency_s: float

    def __post_init__(self) -> None:
        require_within(
            self,
            max_tilt_deg=(1.0, 45.0),
            max_climb_mps=(0.1, 5.0),
            max_turn_deg_s=(1.0, 180.0),
            connect_timeout_s=(1.0, 600.0),
            engage_timeout_s=(0.1, 3600.0),
            link_timeout_s=(0.5, 30.0),
            video_timeout_s=(0.5, 60.0),
            latency_s=(0.0, 3.0),
            event_latency_s=(0.0, 3.0),
        )
