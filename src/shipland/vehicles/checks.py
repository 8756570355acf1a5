"""What must be in order before a flight."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.config import require_within


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


@dataclass(frozen=True)
class PreflightParameters:
    """`[preflight]` of vehicles.toml.

    Attributes:
        picture_hz, picture_age_s: least rate and largest age of pictures.
        telemetry_hz: least rate of attitudes.
        round_trip_s: largest time of a message there and back.
        battery_percent: least charge.
        wind_share: largest wind, as a share of what full tilt can hold against.
    """

    picture_hz: float
    picture_age_s: float
    telemetry_hz: float
    round_trip_s: float
    battery_percent: float
    wind_share: float

    def __post_init__(self) -> None:
        require_within(
            self,
            picture_hz=(1.0, 240.0),
            picture_age_s=(0.01, 3.0),
            telemetry_hz=(1.0, 400.0),
            round_trip_s=(0.01, 3.0),
            battery_percent=(1.0, 100.0),
            wind_share=(0.01, 1.0),
        )
