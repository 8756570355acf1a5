"""Flight modes of the two autopilots, in their own numbers."""

from __future__ import annotations

from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, AutopilotState

GUIDED, GUIDED_NOGPS = 4, 20
"""ArduPilot's modes that obey set-points."""
BRAKE, LOITER, ALT_HOLD = 17, 5, 2
"""ArduPilot's that hold: BRAKE whatever the transmitter's sticks say, if there is one; the others obey them."""
PX4_OFFBOARD, PX4_AUTO, PX4_POSITION, PX4_ALTITUDE = 6, 4, 3, 2
PX4_HOLD, PX4_PRECISION_LAND = 3, 9
"""Sub-modes of AUTO."""
LAND = 9
"""ArduPilot's own landing."""
_MODE_KNOWN_S = 0.3
_NAMES = {
    ARDUPILOT: {
        0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 7: "CIRCLE",
        LAND: "LAND", 16: "POSHOLD", 17: "BRAKE", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
    },
    PX4: {1: "MANUAL", PX4_ALTITUDE: "ALTITUDE", PX4_POSITION: "POSITION", PX4_OFFBOARD: "OFFBOARD"},
}  # fmt: skip


def mode_known(state: AutopilotState, now_s: float) -> bool:
    """Whether a heartbeat has just shown the mode: after an older one it may be a person's by now."""
    return now_s - state.heartbeat_s <= _MODE_KNOWN_S


def mode_name(state: AutopilotState) -> str:
    """The flight mode in words."""
    number = state.mode
    if state.autopilot == PX4:
        number, sub = (state.mode >> 16) & 0xFF, (state.mode >> 24) & 0xFF
        if number == PX4_AUTO:
            return f"AUTO {sub}"
    return _NAMES.get(state.autopilot, {}).get(number, f"mode {number}")


def guided_name(state: AutopilotState) -> str:
    """The mode that obeys set-points, in words."""
    return "OFFBOARD" if state.autopilot == PX4 else "GUIDED"


def obeys_us(state: AutopilotState, by_speed: bool = False) -> bool:
    """Whether the mode obeys our set-points; `by_speed`: velocities, which GUIDED_NOGPS does not fly."""
    if state.autopilot == PX4:
        return (state.mode >> 16) & 0xFF == PX4_OFFBOARD
    return state.mode == GUIDED or (state.mode == GUIDED_NOGPS and not by_speed)


def own_landing(state: AutopilotState) -> tuple[int, int]:
    """Mode and sub-mode in which the autopilot lands on the landing target that it is told."""
    return (PX4_AUTO, PX4_PRECISION_LAND) if state.autopilot == PX4 else (LAND, 0)


def lands_by_itself(state: AutopilotState) -> bool:
    """Whether the autopilot is in that mode."""
    mode, sub_mode = own_landing(state)
    return state.mode == (mode << 16 | sub_mode << 24 if state.autopilot == PX4 else mode)
