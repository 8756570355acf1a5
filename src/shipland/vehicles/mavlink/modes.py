"""Flight modes of the two autopilots, in their own numbers."""

from __future__ import annotations

from typing import NamedTuple

from shipland.vehicles.mavlink.guard import ANSWERED_S
from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, AutopilotState

GUIDED, GUIDED_NOGPS = 4, 20
"""ArduPilot's modes that obey set-points."""
PX4_OFFBOARD, _PX4_AUTO, _PX4_POSITION, _PX4_ALTITUDE = 6, 4, 3, 2
_MODE_KNOWN_S = 0.3
_NAMES = {
    ARDUPILOT: {
        0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 7: "CIRCLE",
        9: "LAND", 16: "POSHOLD", 17: "BRAKE", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
    },
    PX4: {1: "MANUAL", _PX4_ALTITUDE: "ALTITUDE", _PX4_POSITION: "POSITION", PX4_OFFBOARD: "OFFBOARD"},
}  # fmt: skip


class Modes(NamedTuple):
    """What is asked of an autopilot: mode and sub-mode in its own numbers."""

    guided_name: str
    guided: tuple[int, int]
    """Obeys set-points."""
    hold: tuple[int, int]
    """Holds the place whatever a transmitter's sticks say."""
    landing: tuple[int, int]
    """Lands on the landing target that the autopilot is told."""
    stick_place: tuple[int, int]
    """Obeys the sticks and keeps the place; may be refused for want of one."""
    stick_height: tuple[int, int]
    """Obeys the sticks and keeps the height."""


_ARDUPILOT_MODES = Modes("GUIDED", (GUIDED, 0), hold=(17, 0), landing=(9, 0), stick_place=(5, 0), stick_height=(2, 0))
_PX4_MODES = Modes(
    "OFFBOARD", (PX4_OFFBOARD, 0), hold=(_PX4_AUTO, 3), landing=(_PX4_AUTO, 9), stick_place=(_PX4_POSITION, 0),
    stick_height=(_PX4_ALTITUDE, 0),
)  # fmt: skip


def modes_of(state: AutopilotState) -> Modes:
    """The autopilot's."""
    return _PX4_MODES if state.autopilot == PX4 else _ARDUPILOT_MODES


def mode_shown(state: AutopilotState, now_s: float) -> bool:
    """Whether a heartbeat that shows the mode has just come."""
    return now_s - state.heartbeat_s <= _MODE_KNOWN_S


def mode_known(state: AutopilotState, now_s: float) -> bool:
    """The same, over a link that does not lag: else it may be a person's by now."""
    return mode_shown(state, now_s) and now_s - state.asked_s <= ANSWERED_S


def mode_name(state: AutopilotState) -> str:
    """The flight mode in words."""
    number = state.mode
    if state.autopilot == PX4:
        number, sub = (state.mode >> 16) & 0xFF, (state.mode >> 24) & 0xFF
        if number == _PX4_AUTO:
            return f"AUTO {sub}"
    name = _NAMES.get(state.autopilot, {}).get(number, f"mode {number}")
    return f"{name} in forward flight" if state.forward else name


def obeys_us(state: AutopilotState, by_speed: bool = False) -> bool:
    """Whether the mode obeys our set-points; `by_speed`: velocities, which GUIDED_NOGPS does not fly.

    A VTOL in forward flight does not: a velocity of zero is no hold there.
    """
    if state.forward:
        return False
    if state.autopilot == PX4:
        return (state.mode >> 16) & 0xFF == PX4_OFFBOARD
    return state.mode == GUIDED or (state.mode == GUIDED_NOGPS and not by_speed)


def lands_by_itself(state: AutopilotState) -> bool:
    """Whether the autopilot is in the mode in which it lands on the landing target."""
    mode, sub_mode = modes_of(state).landing
    return state.mode == (mode << 16 | sub_mode << 24 if state.autopilot == PX4 else mode)
