"""The checklist's lines about link, camera and autopilot."""

from __future__ import annotations

import math

from shipland.guidance.response import Response
from shipland.vehicles.camera_stream import CameraStream
from shipland.vehicles.checks import Check
from shipland.vehicles.mavlink.parameters import VehicleLimits
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.setup import MavlinkSetup
from shipland.vehicles.mavlink.state import PX4


def link_checks(
    session: Session, stream: CameraStream, limits: VehicleLimits, setup: MavlinkSetup, response: Response
) -> list[Check]:
    """What is known after a few seconds of listening."""
    state, wanted = session.state, setup.preflight
    times_s = [t_s for t_s, _, _ in session.attitudes][-100:]
    span_s = times_s[-1] - times_s[0] if len(times_s) > 1 else 0.0
    rate_hz = (len(times_s) - 1) / span_s if span_s > 0.0 else 0.0
    name = "PX4" if state.autopilot == PX4 else "ArduPilot"
    lines = [
        Check("autopilot", True, f"{name}, system {session.link.vehicle}, mode {session.mode_name}"),
        Check(
            "telemetry", rate_hz >= wanted.telemetry_hz,
            f"attitude {rate_hz:.0f} Hz, at least {wanted.telemetry_hz:g}",
        ),
        Check(
            "round trip", 0.0 < state.round_trip_s <= wanted.round_trip_s,
            f"{1e3 * state.round_trip_s:.0f} ms, at most {1e3 * wanted.round_trip_s:.0f}; 0 is no answer (TIMESYNC)",
        ),
        Check(
            "pictures", stream.rate_hz >= wanted.picture_hz,
            f"{stream.rate_hz:.1f} Hz, at least {wanted.picture_hz:g}",
        ),
        Check(
            "picture's age", stream.age_s <= wanted.picture_age_s,
            f"{stream.age_s:.3f} s at receipt, at most {wanted.picture_age_s:g}",
        ),
        Check("limits", True, limits_text(response)),
        Check(
            "geofence", limits.fence,
            "on" if limits.fence else "off on the vehicle: set FENCE_ENABLE = 1 (ArduPilot) or GF_ACTION (PX4)",
        ),
        Check(
            "battery", state.battery_percent is not None and state.battery_percent >= wanted.battery_percent,
            "unknown" if state.battery_percent is None
            else f"{state.battery_percent:.0f} %, at least {wanted.battery_percent:g}",
        ),
        Check(
            "signing", True,
            "on" if setup.key is not None else "off: whoever reaches the link can speak to the vehicle",
        ),
        Check(
            "motors", True,
            "our own touchdown detection stops them, by force if need be" if setup.parameters.force_disarm
            else "stopped by a plain disarm only (force_disarm = false)",
        ),
        Check("own hold", math.isfinite(limits.hold_after_s), f"{limits.hold_after_s:g} s after the last set-point"),
    ]  # fmt: skip
    if setup.fixed_pitch_rad is None and not math.isfinite(state.gimbal_t_s) and not setup.brings_gimbal:
        lines.append(Check("gimbal", False, "it does not tell its attitude; a fixed camera is ?mount_deg=PITCH"))
    return lines


def limits_text(response: Response) -> str:
    """What full sticks mean, for people."""
    level = f"{math.degrees(response.max_tilt_rad):.0f}°"
    if response.kind == "velocity":
        level = f"{response.max_speed_mps:g} m/s"
    turn_deg_s = math.degrees(response.max_turn_rad_s)
    return f"full sticks: {level}, {response.max_climb_mps:g} m/s up and down, {turn_deg_s:.0f} °/s"
