"""What of an ANAFI is fit to fly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shipland.vehicles.anafi.setup import AnafiParameters
from shipland.vehicles.checks import Check, PreflightParameters, battery_check, telemetry_check


@dataclass(frozen=True)
class AnafiState:
    """What is known of it before a flight.

    Attributes:
        limits: read back after they were set; None for one that was not reported.
        battery_percent: None where it was not reported.
        picture_hz: pictures' rate.
        late_s: by how much 19 of 20 pictures came later than the quickest, at most.
        telemetry_hz: attitudes a second, events and pictures' metadata together.
        problem: what the far end complained of; empty where nothing.
    """

    limits: Mapping[str, float | None]
    battery_percent: float | None
    picture_hz: float
    late_s: float
    telemetry_hz: float
    problem: str


def anafi_checks(state: AnafiState, parameters: AnafiParameters, wanted: PreflightParameters) -> list[Check]:
    """The lines of the checklist."""
    asked = (parameters.max_tilt_deg, parameters.max_climb_mps, parameters.max_turn_deg_s)
    read = tuple(state.limits.get(key) for key in ("tilt_deg", "climb_mps", "turn_deg_s"))
    same = all(value is not None and abs(value - want) < 0.05 * want for value, want in zip(read, asked, strict=True))
    fence = "off: switch it on in FreeFlight"
    if state.limits.get("fence"):
        fence = f"{state.limits.get('fence_distance_m')} m far, {state.limits.get('fence_height_m')} m high"
    pictures = state.problem or f"{state.picture_hz:.0f} Hz, at least {wanted.picture_hz:g}"
    age_s = parameters.latency_s + state.late_s
    age = (
        f"{parameters.latency_s:g} s to the quickest, stated and not measured, and {state.late_s:.3f} s more, measured "
        f"(19 of 20); at most {wanted.picture_age_s:g} in all"
    )
    return [
        Check("limits", same, f"asked for {asked}, read back {read}: tilt [°], climb [m/s], turn [°/s]"),
        telemetry_check(state.telemetry_hz, wanted.telemetry_hz),
        Check("pictures", not state.problem and state.picture_hz >= wanted.picture_hz, pictures),
        Check("picture's age", age_s <= wanted.picture_age_s, age),
        Check("geofence", bool(state.limits.get("fence")), fence),
        battery_check(state.battery_percent, wanted.battery_percent),
    ]  # fmt: skip
