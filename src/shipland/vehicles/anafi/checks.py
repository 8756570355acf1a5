"""What of an ANAFI is fit to fly."""

from __future__ import annotations

from collections.abc import Mapping

from shipland.vehicles.anafi.setup import AnafiParameters
from shipland.vehicles.checks import Check

Limits = Mapping[str, float | None]
"""Limits of the aircraft as it reports them, by name; None for one that it does not report."""


def limits_check(limits: Limits, parameters: AnafiParameters) -> Check:
    """Whether the limits are those that were asked for."""
    asked = (parameters.max_tilt_deg, parameters.max_climb_mps, parameters.max_turn_deg_s)
    read = tuple(limits.get(key) for key in ("tilt_deg", "climb_mps", "turn_deg_s"))
    same = all(value is not None and abs(value - want) < 0.05 * want for value, want in zip(read, asked, strict=True))
    return Check("limits", same, f"asked for {asked}, read back {read}: tilt [°], climb [m/s], turn [°/s]")


def age_check(latency_s: float, late_s: float, most_s: float) -> Check:
    """The pictures' age; `late_s`: by how much 19 of 20 came later than the quickest, at most."""
    words = (
        f"{latency_s:g} s to the quickest, stated and not measured, and {late_s:.3f} s more, measured (19 of 20); at "
        f"most {most_s:g} in all"
    )
    return Check("picture's age", latency_s + late_s <= most_s, words)


def fence_check(limits: Limits) -> Check:
    """Whether the aircraft's own fence is on."""
    words = "off: switch it on in FreeFlight"
    if limits.get("fence"):
        words = f"{limits.get('fence_distance_m')} m far, {limits.get('fence_height_m')} m high"
    return Check("geofence", bool(limits.get("fence")), words)
