"""`[anafi]` of vehicles.toml."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.config import require


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
        for name, value in vars(self).items():
            require(value > 0.0, f"{name} must be positive, got {value}")
