"""A conversation with one autopilot: its state, what it is asked, what it answers."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, BinaryIO

from shipland.errors import VehicleError
from shipland.stopping import check_stop, sleep_or_stop
from shipland.vehicles.gimbal import Reading
from shipland.vehicles.mavlink.dialect import AUTOPILOT, Codec, Message, dialect
from shipland.vehicles.mavlink.guard import Orders
from shipland.vehicles.mavlink.link import LinkCounts, MavlinkLink
from shipland.vehicles.mavlink.modes import GUIDED, GUIDED_NOGPS, PX4_OFFBOARD, mode_known, mode_shown, modes_of
from shipland.vehicles.mavlink.setpoints import level_message, velocity_message
from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, AutopilotState, absorb
from shipland.vehicles.waiting import wait_until
from shipland.vehicles.wanted import HOLD

if TYPE_CHECKING:
    from shipland.vehicles.mavlink.guard_process import GuardedPort

FORCE = 21196
"""Second parameter of a disarm command that is obeyed in the air."""
_SET_MODE = dialect.MAV_CMD_DO_SET_MODE
_IN_OUR_MODE = {_SET_MODE, dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_NAV_TAKEOFF}
"""Commands that are not sent where the mode may be a person's by now."""
_STREAMS_HZ = {
    "HEARTBEAT": 10, "ATTITUDE": 50, "LOCAL_POSITION_NED": 50, "GLOBAL_POSITION_INT": 20, "VFR_HUD": 25,
    "BATTERY_STATUS": 1, "RC_CHANNELS": 10, "DISTANCE_SENSOR": 20, "GIMBAL_DEVICE_ATTITUDE_STATUS": 30, "SYS_STATUS": 2,
    "EKF_STATUS_REPORT": 2, "ESTIMATOR_STATUS": 2, "EXTENDED_SYS_STATE": 5,
}  # fmt: skip
"""Requested messages and their rates [Hz]; a change of mode is seen at the next heartbeat, whose rate a PX4 keeps."""
_STREAM_ANSWER_S = 1.5
"""Timeout of the answer to each of these requests, which are sent twice within it."""
_HOLD_ANSWER_S, _HOLD_AGAIN_S = 1.5, 0.8
"""Timeout of the final hold command, and the time until it is sent again."""
_NOT_OURS = -3
"""MAVLink's word for the system and component in control of a gimbal: no longer the sender."""
_PARAMETERS_S = 3.0
"""Timeout of the answers for parameters."""
_HISTORY = 512
"""Attitudes that are kept: ten seconds."""
_COUNTED = ("HEARTBEAT", "LOCAL_POSITION_NED", "VFR_HUD", "RC_CHANNELS")
"""The autopilot's messages whose receipts are kept: by them a takeover and a touchdown are seen."""
PATIENT_HAND_OVERS = 3
"""Requests for a mode that keeps the place, for a pilot at the sticks, before one that keeps the height, and as many
for that before one that holds by itself."""
HAND_OVERS = 2 * PATIENT_HAND_OVERS + 1
"""Requests until each of these modes was asked for."""
_MULTICOPTERS = {2, 3, 4, 13, 14, 15, 29, 35, 43}
"""MAV_TYPE; a mode's number means something else on an ArduPilot of another kind."""
_PX4_VTOLS = set(range(19, 26))
"""MAV_TYPE; they hover, and PX4's modes are the same on all its vehicles."""


def _never() -> bool:
    return False


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
        port: GuardedPort,
        system: int,
        component: int,
        vehicle: int | None,
        key: bytes | None,
        log: BinaryIO | None,
        on_state: Callable[[AutopilotState, AutopilotState], None],
    ) -> None:
        self._on_state, self._key = on_state, key
        self.link = MavlinkLink(port, system, component, vehicle, self._take, key, log)
        self.state = AutopilotState()
        """The newest; replaced as a whole by the receiving thread."""
        self.refused = 0
        """Sound messages with impossible values."""
        self.awake_s = -math.inf
        """Until when this process last stood still: what came meanwhile is not read yet, and the mode not known."""
        self._lock = threading.Lock()
        self._attitudes: deque[Reading] = deque(maxlen=_HISTORY)
        self._mounts: deque[Reading] = deque(maxlen=_HISTORY)
        self._came = {name: deque[float](maxlen=_HISTORY) for name in _COUNTED}
        self._streams = itertools.cycle(_STREAMS_HZ)

    @property
    def attitudes(self) -> list[Reading]:
        """Attitudes of the body, as received so far."""
        with self._lock:
            return list(self._attitudes)

    @property
    def mounts(self) -> list[Reading]:
        """Attitudes of the camera's mount against the horizon, as received so far."""
        with self._lock:
            return list(self._mounts)

    def came_s(self, name: str) -> list[float]:
        """When the newest of the counted messages came."""
        with self._lock:
            return list(self._came[name])

    def _take(self, message: Message, received_s: float) -> None:
        before = self.state
        if message.get_type() == "COMMAND_ACK" and not self._is_for_us(message):
            return
        try:
            after = absorb(before, message, received_s)
        except (ValueError, TypeError, OverflowError):
            self.refused += 1
            return
        with self._lock:
            if message.get_type() in self._came and after is not before:
                self._came[message.get_type()].append(received_s)
            if after.attitude_t_s != before.attitude_t_s and math.isfinite(after.attitude_t_s):
                self._attitudes.append((after.attitude_t_s, after.roll_rad, after.pitch_rad, 0.0))
            if after.gimbal_t_s != before.gimbal_t_s and math.isfinite(after.gimbal_t_s):
                self._mounts.append((after.gimbal_t_s, *after.gimbal_rad))
        self.state = after
        self._on_state(before, after)

    def _is_for_us(self, answer: Message) -> bool:
        """Whether a command's answer is to us or a broadcast, and not to another ground station."""
        system, component = self.link.own
        return answer.target_system in (0, system) and answer.target_component in (0, component)

    def connect(self, timeout_s: float) -> None:
        """Wait for a heartbeat, saying ours, and request messages; VehicleError without a vehicle."""
        self.link.start()
        said_s = -math.inf

        def heard(state: AutopilotState) -> bool:
            nonlocal said_s
            if (now_s := time.monotonic()) - said_s >= 1.0:
                said_s = now_s
                self.beat()
            return math.isfinite(state.heartbeat_s)

        try:
            self.wait(heard, timeout_s, "no heartbeat from an autopilot")
        except VehicleError as error:
            raise VehicleError(f"{error}; {advice_on_silence(self.link.counts)}") from None
        if self.state.autopilot not in (ARDUPILOT, PX4):
            raise VehicleError(
                f"the autopilot says that it is of kind {self.state.autopilot} (MAV_AUTOPILOT); "
                "ArduPilot (3) and PX4 (12) can be flown"
            )
        if self.state.kind not in _MULTICOPTERS | (_PX4_VTOLS if self.state.autopilot == PX4 else set()):
            raise VehicleError(
                f"the autopilot says that it flies a vehicle of kind {self.state.kind} (MAV_TYPE); multicopters can be "
                "flown"
            )
        for name in _STREAMS_HZ:
            self.ask(*_rate_request(name), timeout_s=_STREAM_ANSWER_S)
        self.ask(dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, *self.link.own, -1, -1, timeout_s=_STREAM_ANSWER_S)
        self.wait(lambda state: math.isfinite(state.attitude_t_s), timeout_s, "no attitude from the vehicle")

    def give_gimbal_back(self) -> None:
        """Let whoever asks next turn it; a ground station's requests are refused while we are in control of it."""
        if self.link.vehicle:
            self.command(dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, _NOT_OURS, _NOT_OURS, -1, -1)

    def wait(self, until: Callable[[AutopilotState], object], timeout_s: float, otherwise: str) -> None:
        """Wait for the state to become something; VehicleError says what did not come."""
        wait_until(lambda: until(self.state), timeout_s, lambda: otherwise)

    def command(self, number: int, *parameters: float) -> bool:
        """Send COMMAND_LONG; its acknowledgement shows in the state. Whether it was sent.

        A mode, motors and a take-off are asked for only while the present mode is known: a person may have chosen
        another since.
        """
        if number in _IN_OUR_MODE and not self._awake(mode_known):
            return False
        return self._send_command(number, *parameters)

    def _awake(self, tells: Callable[[AutopilotState, float], bool]) -> bool:
        """Whether the newest state tells the mode, by a heartbeat that did not wait for us."""
        state = self.state
        return tells(state, time.monotonic()) and state.heartbeat_s > self.awake_s

    def _send_command(self, number: int, *parameters: float) -> bool:
        values = [*map(float, parameters), *[0.0] * (7 - len(parameters))]
        return self.link.send(dialect.MAVLink_command_long_message(self.link.vehicle, AUTOPILOT, number, 0, *values))

    def ask(
        self, number: int, *parameters: float, timeout_s: float = 3.0, unless: Callable[[], object] = _never
    ) -> int:
        """Send a command and wait for its MAV_RESULT, sending again each second.

        Args:
            number: of the command.
            parameters: of the command.
            timeout_s: how long.
            unless: ends the requests: the command has taken effect, or is not wanted any more.

        Returns:
            The result; -1 when none came.
        """
        before = self.state.answers(number)
        end_s, again_s = time.monotonic() + timeout_s, -math.inf
        while (now_s := time.monotonic()) < end_s:
            result, count = self.state.acknowledged.get(number, (0, 0))
            if count > before:
                return result
            if unless():
                return -1
            if now_s >= again_s and self.command(number, *parameters):
                again_s = now_s + 1.0
            check_stop()
            time.sleep(0.01)
        return -1

    def ask_hold(self, is_ours: Callable[[AutopilotState], bool]) -> None:
        """Ask for a mode in which the vehicle holds its place by itself, until it has left ours.

        Where it is refused, as without a position, the last set-point stands until the autopilot's own timeout.

        Args:
            is_ours: whether a state's mode is ours to end.
        """
        answers = self.state.answers(_SET_MODE)
        end_s, again_s = time.monotonic() + _HOLD_ANSWER_S, -math.inf
        while (now_s := time.monotonic()) < end_s:
            state = self.state
            if not is_ours(state) or state.denied(_SET_MODE, answers):
                return
            if now_s >= again_s and self.command(_SET_MODE, 1, *modes_of(state).hold):
                again_s = now_s + _HOLD_AGAIN_S
            time.sleep(0.01)

    def guard_orders(self, setpoint_hz: float, gap_s: float, silence_s: float) -> Orders:
        """What the link's guard is to do without us, on this autopilot; see `Orders`."""
        vehicle, codec = self.link.vehicle, Codec(*self.link.own)

        def packed(message: Message) -> str:
            return codec.encode(message).hex()

        hold = packed(velocity_message(HOLD, vehicle, 0))
        holds = {str(GUIDED): hold, str(GUIDED_NOGPS): packed(level_message(vehicle))}
        px4 = self.state.autopilot == PX4
        mode = (1.0, *map(float, modes_of(self.state).hold), 0.0, 0.0, 0.0, 0.0)
        ask = dialect.MAVLink_command_long_message(vehicle, AUTOPILOT, _SET_MODE, 0, *mode)
        return Orders(
            own=self.link.own,
            vehicle=vehicle,
            autopilot=self.state.autopilot,
            key="" if self._key is None else self._key.hex(),
            setpoint_hz=setpoint_hz,
            gap_s=gap_s,
            silence_s=silence_s,
            mode_mask=0xFF0000 if px4 else 0xFFFFFFFF,
            holds={str(PX4_OFFBOARD << 16): hold} if px4 else holds,
            ask=packed(ask),
            beat=packed(_heartbeat()),
        )

    def hand_over(self, attempt: int) -> bool:
        """Ask for a mode that obeys the sticks, without waiting for the answer; whether it was asked for.

        Args:
            attempt: from 0, below `HAND_OVERS`; a mode that keeps the place may be refused for want of one, and then
                the height is kept; a vehicle that obeys no sticks refuses both, and is to hold.
        """
        modes = modes_of(self.state)
        mode = (modes.stick_place, modes.stick_height, modes.hold)[min(attempt // PATIENT_HAND_OVERS, 2)]
        # over a link that lags too: in ours the sticks are dead
        return self._awake(mode_shown) and self._send_command(_SET_MODE, 1, *mode)

    def read_parameters(self, names: Sequence[str], enough: Callable[[Mapping[str, float]], bool]) -> dict[str, float]:
        """The values of those parameters that the vehicle has.

        Args:
            names: of all that may be of use; a vehicle answers nothing for one that it does not have.
            enough: whether those that have come will do; until then a lost answer is requested again.
        """
        end_s, known = time.monotonic() + _PARAMETERS_S, dict[str, float]()
        while time.monotonic() < end_s:
            missing = [name for name in names if name not in known]
            for name in missing:
                self.link.send(
                    dialect.MAVLink_param_request_read_message(self.link.vehicle, AUTOPILOT, name.encode(), -1)
                )
            sleep_or_stop(0.3)
            found = self.state.parameters
            known = {name: found[name] for name in names if name in found}
            nothing_new = len(known) + len(missing) == len(names)
            if len(known) == len(names) or (nothing_new and enough(known)):
                break
        return known

    def beat(self) -> None:
        """Our heartbeat."""
        self.link.send(_heartbeat())

    def ask_heartbeat(self) -> None:
        """A request for the vehicle's heartbeat, which shows its mode."""
        self.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_HEARTBEAT)

    def ask_time(self) -> None:
        """The question for the round trip, whose answer shows how old what comes may be."""
        self.link.send(dialect.MAVLink_timesync_message(0, time.monotonic_ns()))

    def ask_stream(self) -> None:
        """The next message's rate once more: whoever shares the link may have set another."""
        self.command(*_rate_request(next(self._streams)))


def _rate_request(name: str) -> tuple[int, int, float]:
    number: int = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    return dialect.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e6 / _STREAMS_HZ[name]


def _heartbeat() -> Message:
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )


def advice_on_silence(counts: LinkCounts) -> str:
    """What to try when no autopilot was heard, by what was."""
    if counts.foreign:
        return (
            f"{counts.foreign} messages came, none of an autopilot's heartbeat with the system id asked for: is it "
            "?system= that excludes it, or was only a ground station heard?"
        )
    if counts.malformed:
        return "bytes came, but no sound message: check the baud rate, and the signing key on both sides"
    return (
        "nothing came: udp: listens, so the autopilot must send to this address (ArduPilot's simulator: "
        "--out HOST:PORT; a companion's mavlink-router: an endpoint in Normal mode); udpout: speaks first; another "
        "program on this port, or a firewall, takes it away"
    )
