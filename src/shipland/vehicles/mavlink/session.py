"""A conversation with one autopilot: its state, what it is asked, what it answers."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import BinaryIO

from shipland.errors import VehicleError
from shipland.stopping import check_stop, sleep_or_stop
from shipland.vehicles.mavlink.dialect import Message, dialect
from shipland.vehicles.mavlink.link import MavlinkLink, Port
from shipland.vehicles.mavlink.setpoints import Target
from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, AutopilotState, RefusedError, absorb

FORCE = 21196
"""Second parameter of a disarm command that is obeyed in the air."""
_STREAMS_HZ = {
    "ATTITUDE": 50, "LOCAL_POSITION_NED": 50, "GLOBAL_POSITION_INT": 20, "VFR_HUD": 25, "EXTENDED_SYS_STATE": 5,
    "BATTERY_STATUS": 1, "RC_CHANNELS": 10, "DISTANCE_SENSOR": 20, "GIMBAL_DEVICE_ATTITUDE_STATUS": 30,
}  # fmt: skip
"""Messages asked for, a second."""

GUIDED, GUIDED_NOGPS = 4, 20
"""ArduPilot's modes that obey set-points."""
_BRAKE, _LOITER = 17, 5
"""ArduPilot's that hold: BRAKE whatever the transmitter's sticks say, if there is one; LOITER obeys them."""
_PX4_OFFBOARD, _PX4_AUTO, _PX4_POSITION = 6, 4, 3
_PX4_HOLD = 3
"""Sub-mode of AUTO."""
_MODE_NAMES = {
    ARDUPILOT: {
        0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 7: "CIRCLE",
        9: "LAND", 16: "POSHOLD", 17: "BRAKE", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
    },
}  # fmt: skip
_HOLD_ANSWER_S = 1.5
"""How long the answer to the last word is waited for; within it is said twice."""
_HISTORY = 512
"""Attitudes that are kept: ten seconds."""


class Session:
    """One autopilot over one link.

    Args:
        port: the bytes.
        system, component: our own ids.
        vehicle: system id to follow; None for the first that is heard.
        key: for signing, or None.
        log: for raw messages, or None.
        on_state: called on the receiving thread after each message, with the state before and after.
    """

    def __init__(
        self,
        port: Port,
        system: int,
        component: int,
        vehicle: int | None,
        key: bytes | None,
        log: BinaryIO | None,
        on_state: Callable[[AutopilotState, AutopilotState], None],
    ) -> None:
        self._on_state = on_state
        self.link = MavlinkLink(port, system, component, self._take, key, log)
        self.link.follow(vehicle)
        self.state = AutopilotState()
        """The newest; replaced as a whole by the receiving thread."""
        self.refused = 0
        """Sound messages with impossible values."""
        self.attitudes: deque[tuple[float, float, float]] = deque(maxlen=_HISTORY)
        """(time, roll, pitch) of the body."""
        self.mounts: deque[tuple[float, float, float]] = deque(maxlen=_HISTORY)
        """(time, roll, pitch) of the camera's mount against the horizon."""

    def _take(self, message: Message, received_s: float) -> None:
        before = self.state
        try:
            after = absorb(before, message, received_s)
        except (RefusedError, ValueError, TypeError, OverflowError):
            self.refused += 1
            return
        if after.attitude_t_s != before.attitude_t_s:
            self.attitudes.append((after.attitude_t_s, after.roll_rad, after.pitch_rad))
        if after.gimbal_t_s != before.gimbal_t_s:
            self.mounts.append((after.gimbal_t_s, after.gimbal_roll_rad, after.gimbal_pitch_rad))
        self.state = after
        self._on_state(before, after)

    @property
    def target(self) -> Target:
        """Who we talk to."""
        return Target(self.link.vehicle)

    @property
    def mode_name(self) -> str:
        """The flight mode in words."""
        state = self.state
        if state.autopilot == PX4:
            main, sub = (state.mode >> 16) & 0xFF, (state.mode >> 24) & 0xFF
            names = {1: "MANUAL", 2: "ALTITUDE", _PX4_POSITION: "POSITION", _PX4_AUTO: f"AUTO {sub}", 6: "OFFBOARD"}
            return names.get(main, f"mode {main}")
        return _MODE_NAMES.get(state.autopilot, {}).get(state.mode, f"mode {state.mode}")

    def is_ours(self, state: AutopilotState) -> bool:
        """Whether a mode obeys our set-points."""
        if state.autopilot == PX4:
            return (state.mode >> 16) & 0xFF == _PX4_OFFBOARD
        return state.mode in (GUIDED, GUIDED_NOGPS)

    def connect(self, timeout_s: float) -> None:
        """Wait for a heartbeat and ask for what is needed; VehicleError when nobody is there."""
        self.link.start()
        self.wait(lambda state: math.isfinite(state.heartbeat_s), timeout_s, "no heartbeat from an autopilot")
        if self.state.autopilot not in (ARDUPILOT, PX4):
            raise VehicleError(
                f"the autopilot says that it is of kind {self.state.autopilot} (MAV_AUTOPILOT); "
                "ArduPilot (3) and PX4 (12) can be flown"
            )
        for name, rate_hz in _STREAMS_HZ.items():
            number = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
            self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rate_hz)
        self.command(dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, self.link_ids[0], self.link_ids[1], -1, -1)
        self.wait(lambda state: math.isfinite(state.attitude_t_s), timeout_s, "no attitude from the vehicle")

    @property
    def link_ids(self) -> tuple[int, int]:
        """Our system and component id."""
        return self.link.own

    def wait(self, until: Callable[[AutopilotState], bool], timeout_s: float, otherwise: str) -> None:
        """Wait for the state to become something; VehicleError says what did not come."""
        end_s = time.monotonic() + timeout_s
        while not until(self.state):
            check_stop()
            if time.monotonic() > end_s:
                raise VehicleError(f"{otherwise} within {timeout_s:g} s")
            time.sleep(0.02)

    def command(self, number: int, *parameters: float) -> None:
        """Send COMMAND_LONG; its acknowledgement shows in the state."""
        target = self.target
        values = [*map(float, parameters), *[0.0] * (7 - len(parameters))]
        self.link.send(dialect.MAVLink_command_long_message(target.system, target.component, number, 0, *values))

    def ask(self, number: int, *parameters: float, timeout_s: float = 3.0) -> int:
        """Send a command and wait for its MAV_RESULT, sending again each second; -1 when none comes."""
        before = self.state.acknowledged.get(number, (0, 0))[1]
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            self.command(number, *parameters)
            again_s = time.monotonic() + 1.0
            while time.monotonic() < min(again_s, end_s):
                result, count = self.state.acknowledged.get(number, (0, 0))
                if count > before:
                    return result
                check_stop()
                time.sleep(0.01)
        return -1

    def ask_mode(self, ardupilot: int, px4: tuple[int, int]) -> int:
        """Ask for a flight mode, in the autopilot's own numbers; its MAV_RESULT."""
        numbers = px4 if self.state.autopilot == PX4 else (ardupilot, 0)
        return self.ask(dialect.MAV_CMD_DO_SET_MODE, 1, *numbers)

    def ask_guided(self) -> int:
        """Ask for the mode that obeys us."""
        return self.ask_mode(GUIDED, (_PX4_OFFBOARD, 0))

    def ask_hold(self) -> int:
        """Ask for a mode in which the vehicle holds its place by itself; its MAV_RESULT.

        Where that is refused, as without a position, the last set-point stands until the autopilot's own timeout.
        """
        numbers = (_PX4_AUTO, _PX4_HOLD) if self.state.autopilot == PX4 else (_BRAKE, 0)
        return self.ask(dialect.MAV_CMD_DO_SET_MODE, 1, *numbers, timeout_s=_HOLD_ANSWER_S)

    def hand_over(self) -> None:
        """Ask for a mode that obeys the sticks; without waiting for the answer."""
        numbers = (_PX4_POSITION, 0) if self.state.autopilot == PX4 else (_LOITER, 0)
        self.command(dialect.MAV_CMD_DO_SET_MODE, 1, *numbers)

    def read_parameters(self, names: Sequence[str], timeout_s: float = 3.0) -> dict[str, float]:
        """The values of those parameters that the vehicle has."""
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s and (missing := [name for name in names if name not in self.state.parameters]):
            for name in missing:
                target = self.target
                self.link.send(
                    dialect.MAVLink_param_request_read_message(target.system, target.component, name.encode(), -1)
                )
            sleep_or_stop(0.3)
            if len(missing) == len([name for name in names if name not in self.state.parameters]) < len(names):
                break  # the rest it does not have
        return {name: self.state.parameters[name] for name in names if name in self.state.parameters}

    def beat(self) -> None:
        """Our heartbeat, and the question for the round trip."""
        self.link.send(
            dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
            )
        )
        self.link.send(dialect.MAVLink_timesync_message(0, time.monotonic_ns()))
