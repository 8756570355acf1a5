"""What must be in order before a flight."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass

from shipland.config import key, parameters
from shipland.guidance.response import Response

_RATE_S = 2.0
"""Window, up to now, in which a rate is counted."""


@dataclass(frozen=True)
class Check:
    """One line of the checklist.

    Attributes:
        name: what was looked at.
        ok: fit to fly.
        words: what was found, and what to do where it is not in order.
    """

    name: str
    ok: bool
    words: str

    def line(self) -> str:
        """For the terminal."""
        return f"{'ok  ' if self.ok else 'FAIL'}  {self.name:<14} {self.words}"


@parameters
class PreflightParameters:
    """`[preflight]`."""

    picture_hz: float = key(10.0, "least rate of pictures", ge=1, le=240)
    picture_age_s: float = key(0.6, "largest: stated latency and time behind the quickest picture", ge=0.01, le=3)
    telemetry_hz: float = key(8.0, "least rate of attitudes", ge=1, le=400)
    round_trip_s: float = key(0.3, "largest time of a message there and back", ge=0.01, le=3)
    battery_percent: float = key(40.0, "least charge", ge=1, le=100)
    wind_share: float = key(0.6, "largest wind, as a share of what full tilt holds against", ge=0.01, le=1)


def rate_hz(times_s: Iterable[float]) -> float:
    """How often something comes, a second, by its times on `time.monotonic`; what has stopped has no rate."""
    now_s = time.monotonic()
    late_s = [t_s for t_s in times_s if now_s - t_s < _RATE_S]
    return (len(late_s) - 1) / (now_s - min(late_s)) if len(late_s) > 1 else 0.0


def telemetry_check(found_hz: float, least_hz: float, what: str = "") -> Check:
    """Attitudes a second; `what` says of what."""
    return Check("telemetry", found_hz >= least_hz, f"{what}{found_hz:.0f} Hz, at least {least_hz:g}")


def battery_check(percent: float | None, least_percent: float, source: str = "") -> Check:
    """The charge; `source` says where it should have come from."""
    if percent is None:
        return Check("battery", False, f"{source}unknown")
    return Check("battery", percent >= least_percent, f"{percent:.0f} %, at least {least_percent:g}")


def limits_text(response: Response) -> str:
    """What full sticks mean, for people."""
    level = f"{math.degrees(response.max_tilt_rad):.0f}°"
    if response.kind == "velocity":
        level = f"{response.max_speed_mps:g} m/s"
    turn_deg_s = math.degrees(response.max_turn_rad_s)
    return f"full sticks: {level}, {response.max_climb_mps:g} m/s up and down, {turn_deg_s:.0f} °/s"
