"""The checklist's lines about link, camera and autopilot."""

from __future__ import annotations

import math
import time

from shipland.guidance.response import Response
from shipland.vehicles.camera_stream import CameraStream
from shipland.vehicles.checks import Check, battery_check, limits_text, rate_hz, telemetry_check
from shipland.vehicles.mavlink.dialect import AUTOPILOT, dialect
from shipland.vehicles.mavlink.modes import mode_name, obeys_us
from shipland.vehicles.mavlink.parameters import VehicleLimits
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.setup import MavlinkSetup
from shipland.vehicles.mavlink.state import PX4, AutopilotState
from shipland.vehicles.mavlink.telemetry import alerts_at, battery_at, transmitter_heard

_LONGEST_OWN_HOLD_S = 5.0
"""An autopilot that flies the last set-point for longer goes too far with it."""
_THROTTLE_US = (1300, 1700)
"""A throttle stick in the middle: LOITER neither sinks nor climbs by it."""
_NEEDED_HZ = 5.0
_NEEDED_FOR = {
    "HEARTBEAT": "a takeover by mode is seen late",
    "LOCAL_POSITION_NED": "no touchdown is seen, and no motor stopped",
    "VFR_HUD": "no touchdown is seen, and no motor stopped",
    "RC_CHANNELS": "a takeover by stick is seen late",
}
"""What becomes of a flight in which a message comes less often."""


def link_checks(
    session: Session, stream: CameraStream, limits: VehicleLimits, setup: MavlinkSetup, response: Response
) -> list[Check]:
    """What is known after a few seconds of listening."""
    state, wanted, now_s = session.state, setup.preflight, time.monotonic()
    name = "PX4" if state.autopilot == PX4 else "ArduPilot"
    deaf = obeys_us(state) and not obeys_us(state, response.kind == "velocity")
    lines = [
        Check(
            "autopilot", not deaf, f"{name}, system {session.link.vehicle}, mode {mode_name(state)}"
            + (", which flies no velocities: hand over in GUIDED, or fly tilts by ?kind=attitude" if deaf else ""),
        ),
        *_others(session, setup),
        _health(state, now_s),
        _transmitter(state, limits, now_s),
        telemetry_check(rate_hz(t_s for t_s, *_ in session.attitudes), wanted.telemetry_hz, "attitude "),
        _messages(session),
        Check(
            "round trip", 0.0 < state.round_trip_s <= wanted.round_trip_s,
            f"{1e3 * state.round_trip_s:.0f} ms, at most {1e3 * wanted.round_trip_s:.0f}; 0 is no answer (TIMESYNC)",
        ),
        _pictures(stream, setup, now_s),
        Check("picture's age", stream.age_s <= wanted.picture_age_s, _age_words(stream, setup)),
        Check("limits", True, limits_text(response)),
        Check("geofence", not limits.fence_problem, limits.fence_problem or limits.fence_words),
        Check(
            "failsafes", not limits.stops_motors,
            f"{limits.stops_motors}: stops the motors in the air; set 1, 2 or 3" if limits.stops_motors
            else "none that we read stops the motors in the air",
        ),
        battery_check(battery_at(state, now_s), wanted.battery_percent),
        Check(
            "signing", True,
            "on" if setup.key is not None else "off: whoever reaches the link can speak to the vehicle",
        ),
        Check(
            "motors", True,
            "our own touchdown detection stops them, by force if need be" if setup.parameters.force_disarm
            else "stopped by a plain disarm only (force_disarm = false)",
        ),
        _own_hold(limits, transmitter_heard(state, now_s) and limits.obeys_sticks),
    ]  # fmt: skip
    if setup.fixed_pitch_rad is None and not setup.brings_gimbal:
        lines.append(gimbal_check(state))
    return lines


def gimbal_check(state: AutopilotState) -> Check:
    """Whether it tells its attitude, and obeys us."""
    if not math.isfinite(state.gimbal_t_s):
        return Check("gimbal", False, "it does not tell its attitude; a fixed camera is ?mount_deg=PITCH")
    result, _ = state.acknowledged.get(dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, (-1, 0))
    if result == dialect.MAV_RESULT_ACCEPTED:
        return Check("gimbal", True, "it tells its attitude, and is ours to turn")
    denied = "no answer" if result < 0 else f"MAV_RESULT {result}"
    words = f"WARNING: it is not ours to turn ({denied}): low over the deck the cue leaves a picture that stays"
    return Check("gimbal", True, words)


def _messages(session: Session) -> Check:
    """Requested messages may have been refused, or the requests lost."""
    by_stick = transmitter_heard(session.state, time.monotonic())
    found_hz = {name: rate_hz(session.came_s(name)) for name in _NEEDED_FOR if by_stick or name != "RC_CHANNELS"}
    words = ", ".join(f"{name} {hz:.0f} Hz" for name, hz in found_hz.items())
    lacking = dict.fromkeys(_NEEDED_FOR[name] for name, hz in found_hz.items() if hz < _NEEDED_HZ)
    if lacking:
        words = f"WARNING: {words}, at least {_NEEDED_HZ:g}: {'; '.join(lacking)}"
    return Check("messages", True, words)


def _others(session: Session, setup: MavlinkSetup) -> list[Check]:
    """Whoever else is heard and makes it doubtful which vehicle is flown, or by whom."""
    link, found = session.link, list[tuple[str, str]]()
    others = set(link.others)  # the receiving thread adds to them
    vehicles = sorted(system for system, component in others if component == AUTOPILOT)
    if link.vehicle in vehicles:
        words = f"system {link.vehicle} speaks from two addresses: two vehicles, or one by two ways; let one come here"
        found.append(("one vehicle", words))
    elif vehicles and setup.vehicle is None:
        words = ", ".join(map(str, vehicles))
        found.append(("one vehicle", f"also heard: system {words}; which is flown is left to chance: state ?system="))
    if session.state.clock.restarts:
        words = "the autopilot's clock went back: it has restarted, or two vehicles speak with the same system id"
        found.append(("one vehicle", words))
    if link.own in others:
        system, component = link.own
        words = f"another program speaks as system {system}, component {component}: a second shipland on this vehicle?"
        found.append(("one shipland", words))
    return [Check(name, False, words) for name, words in found]


def _health(state: AutopilotState, now_s: float) -> Check:
    """On the ground the autopilot's own arming checks decide."""
    alerts = alerts_at(state, now_s)
    words = alerts or "the vehicle complains of nothing"
    return Check("health", not (alerts and state.armed), words if state.armed else f"{words}; it is not armed")


def _transmitter(state: AutopilotState, limits: VehicleLimits, now_s: float) -> Check:
    """A flight without a transmitter is the user's to choose; one whose receiver has lost it is not."""
    if transmitter_heard(state, now_s):
        if not limits.obeys_sticks:
            words = "WARNING: heard, but the vehicle does not obey it (COM_RC_IN_MODE): a moved stick ends in a hold"
            return Check("transmitter", True, words)
        throttle_us = state.sticks_us[2]
        advice = ""
        if not state.armed and state.autopilot != PX4:
            advice = ": an ArduPilot arms with it at the bottom only; to take over by stick, put it in the middle"
        elif not _THROTTLE_US[0] <= throttle_us <= _THROTTLE_US[1]:
            advice = ": put it in the middle, or taking over by stick begins with a climb or a descent"
        return Check("transmitter", True, f"heard, throttle stick at {throttle_us} µs{advice}")
    if state.alerts.get("receiver", (now_s, ""))[1]:
        return Check("transmitter", False, "the receiver is in failsafe: it hears no transmitter; switch that on")
    return Check(
        "transmitter", True,
        "WARNING: no transmitter is heard: taking over by stick is not possible, only by mode or key",
    )  # fmt: skip


def _pictures(stream: CameraStream, setup: MavlinkSetup, now_s: float) -> Check:
    """Their rate, and that they still come."""
    least_hz, newest = setup.preflight.picture_hz, stream.newest(-math.inf, 0.0)
    silent_s = math.inf if newest is None else now_s - newest.arrived_s
    words = f"{stream.rate_hz:.1f} Hz, at least {least_hz:g}; the newest came {silent_s:.1f} s ago"
    return Check("pictures", stream.rate_hz >= least_hz and silent_s <= 5.0 / least_hz, words)


def _age_words(stream: CameraStream, setup: MavlinkSetup) -> str:
    """What of the pictures' age was measured, and what only stated."""
    age_s, most = stream.age_s, f"at most {setup.preflight.picture_age_s:g}"
    if setup.latency_s is None:
        return f"{age_s:.3f} s at receipt, measured; {most}"
    late_s = max(0.0, age_s - setup.latency_s)
    return (
        f"{age_s:.3f} s, {most}: {setup.latency_s:.3f} s stated, not measured (film a running clock: "
        f"docs/how-to/fly-a-vehicle.md), and {late_s:.3f} s behind the quickest picture, measured"
    )


def _own_hold(limits: VehicleLimits, with_sticks: bool) -> Check:
    """What it does without set-points; `with_sticks`: there is a transmitter that it obeys."""
    if math.isnan(limits.hold_after_s):
        words = "it does not tell GUID_TIMEOUT (ArduPilot) or COM_OF_LOSS_T (PX4): when it holds by itself is unknown"
        return Check("own hold", False, words)
    problem = limits.hold_problem if with_sticks else limits.hold_problem_alone
    words = f"{limits.hold_after_s:g} s after the last set-point, at most {_LONGEST_OWN_HOLD_S:g}"
    soon = limits.hold_after_s <= _LONGEST_OWN_HOLD_S
    return Check("own hold", soon and not problem, "; ".join(filter(None, (words, problem))))
