"""An autopilot's state as the loop's telemetry."""

from __future__ import annotations

import math

import numpy as np

from shipland.messages import Telemetry
from shipland.vehicles.mavlink.health import ALERT_S
from shipland.vehicles.mavlink.state import AutopilotState

_SLOW_S = 10.0
"""Battery and radio are reported about once a second; what is older is not known."""
_STICKS_S = 2.0
"""Likewise the transmitter's sticks, ten times a second."""
_ANSWER_S = 2.0
"""Likewise an answer to our questions of the time, four a second; a link that lags makes old telemetry look new."""
_HEADING_S = 0.2
"""A velocity that is turned by a heading older than this is as old as the heading."""


def telemetry_of(state: AutopilotState, t_s: float) -> Telemetry:
    """The newest of everything, stamped with `t_s`; each part with its own time, or None where it is too old."""
    attitude, height = math.isfinite(state.attitude_t_s), math.isfinite(state.height_t_s)
    velocity = state.velocity_in_level_mps
    return Telemetry(
        t_s=t_s,
        roll_rad=state.roll_rad if attitude else None,
        pitch_rad=state.pitch_rad if attitude else None,
        heading_rad=state.heading_rad if attitude else None,
        height_m=state.height_m if height else None,
        velocity_in_level_mps=None if velocity is None else np.array(velocity),
        battery_percent=battery_at(state, t_s),
        link_percent=state.link_percent if t_s - state.link_t_s <= _SLOW_S else None,
        flying=state.armed,
        attitude_t_s=state.attitude_t_s if attitude else None,
        heading_t_s=state.attitude_t_s if attitude else None,
        height_t_s=state.height_t_s if height else None,
        velocity_t_s=None if velocity is None else _velocity_t_s(state),
        alerts=alerts_at(state, t_s),
    )


def _velocity_t_s(state: AutopilotState) -> float:
    """When the velocity was true, and the heading by which it is turned [s]."""
    fresh = state.velocity_t_s - state.attitude_t_s <= _HEADING_S
    return state.velocity_t_s if fresh else state.attitude_t_s


def battery_at(state: AutopilotState, t_s: float) -> float | None:
    """The first battery's charge [percent]; None where it is not known, or not any more."""
    return state.battery_percent if t_s - state.battery_t_s <= _SLOW_S else None


def transmitter_heard(state: AutopilotState, t_s: float) -> bool:
    """Whether a transmitter's sticks are reported at this time."""
    return bool(state.sticks_us) and t_s - state.sticks_t_s <= _STICKS_S


def alerts_at(state: AutopilotState, t_s: float) -> str:
    """What the vehicle says is wrong with it at this time, in words; empty while it is well."""
    words = [text for said_s, text in state.alerts.values() if text and t_s - said_s <= ALERT_S]
    if state.sticks_us and not transmitter_heard(state, t_s):
        words.append("the transmitter's sticks are no longer reported")
    if t_s - state.asked_s > _ANSWER_S:
        words.append(f"no answer for {t_s - state.asked_s:.0f} s: the link lags or is lost")
    return "; ".join(words)
