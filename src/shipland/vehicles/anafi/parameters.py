"""`[anafi]`."""

from __future__ import annotations

from shipland.config import key, parameters
from shipland.vehicles.parameters import LinkParameters


@parameters
class AnafiParameters(LinkParameters):
    """`[anafi]`; full sticks are set on the aircraft and read back."""

    latency_s: float = key(
        0.28, "from exposure to receipt of the quickest picture", "Parrot's streaming latency as advertised", ge=0, le=3
    )
    event_latency_s: float = key(
        0.1, "from an event's being true to its receipt", "as [delays.telemetry.anafi]", ge=0, le=3
    )
