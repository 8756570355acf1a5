"""What a MAVLink vehicle has said of itself, as one frozen state; a message makes the next one."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from shipland.frames import euler_from_quaternion, wrap_angle
from shipland.vehicles.mavlink.dialect import AUTOPILOT, Message, dialect
from shipland.vehicles.mavlink.health import (
    ardupilot_estimator_alert,
    heartbeat_alert,
    px4_estimator_alert,
    sensors_alert,
)

ARDUPILOT, PX4 = 3, 12
"""MAV_AUTOPILOT of the two that are flown."""
_NONE_U8, _NONE_U16 = 255, 65535
_FORWARD = (
    dialect.MAV_VTOL_STATE_TRANSITION_TO_FW, dialect.MAV_VTOL_STATE_TRANSITION_TO_MC, dialect.MAV_VTOL_STATE_FW,
)  # fmt: skip
_REBOOT_S = 1.0
"""The autopilot's clock went back by so much: it has restarted."""
_ODD = 3
"""Messages by another clock within `_WINDOW_S`: a restart, two vehicles with one id, or a link that was late. One alone
changes nothing."""
_WINDOW_S = 1.0
"""Window in which the clocks' difference counts as constant; short, as a simulated vehicle's clock may run slow."""
_LONGEST_TRIP_S = 2.0
"""Latest answer that counts."""
_TRIPS = 5
"""Round trips of which the quickest counts; a link that has become slow shows after as many."""
_GIMBALS = {AUTOPILOT, 154, 171, 172, 173, 174, 175}
"""Components that tell a gimbal's attitude: gimbals themselves, and an autopilot for one that speaks no MAVLink."""
_YAW_FROM_NORTH, _YAW_FROM_NOSE = (
    dialect.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME, dialect.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME,
)  # fmt: skip
_ANY_COMPONENT = {"GIMBAL_DEVICE_ATTITUDE_STATUS", "RADIO_STATUS"}
"""Messages that count from others than the autopilot."""
_FIRST_BATTERY = 0
_DONE = (dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS)
"""Answers that do not deny."""
_PULSES_US, _LEAST_THROTTLE_US = (800, 2200), 950
"""Pulse widths of sticks, and of the throttle's where an ArduPilot tells no other; what is beyond is a receiver's word
that it hears no transmitter."""
STICK_NAMES = {
    ARDUPILOT: ("RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_THROTTLE", "RCMAP_YAW"),
    PX4: ("RC_MAP_ROLL", "RC_MAP_PITCH", "RC_MAP_THROTTLE", "RC_MAP_YAW"),
}
"""Parameters that name the sticks' channels, from 1; 0 and what is not told are the usual channel."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Clock:
    """A component's own clock against ours; a message makes the next one.

    Attributes:
        boot_s: newest time of it.
        offset_s: our clock minus it and the quickest message's travel time, of the last while.
        next_offset_s, window_s: the same of the while that has begun, and when that was.
        restarts: how often it restarted.
        odd, odd_s: how many messages of late it seems to have gone back or ahead by, as those of another vehicle with
            the same id; and when the newest came.
    """

    boot_s: float = math.nan
    offset_s: float = math.inf
    next_offset_s: float = math.inf
    window_s: float = -math.inf
    restarts: int = 0
    odd: int = 0
    odd_s: float = -math.inf

    def at(self, boot_ms: int, received_s: float) -> tuple[Clock, float]:
        """The clock moved on, and when a message was sent, on ours, but for the quickest one's travel time."""
        boot_s, known = 1e-3 * boot_ms, self
        offset_s = received_s - boot_s
        back, ahead = boot_s < self.boot_s - _REBOOT_S, offset_s < self.offset_s - _REBOOT_S < math.inf
        if back or ahead:
            odd = self.odd + 1 if received_s - self.odd_s < _WINDOW_S else 1
            if odd < _ODD:
                return replace(self, odd=odd, odd_s=received_s), received_s
            known = Clock(boot_s, restarts=self.restarts + back)
        known_s, next_s, window_s = known.offset_s, known.next_offset_s, known.window_s
        if received_s - window_s > _WINDOW_S:  # the clocks run apart, or a simulated one falls behind
            known_s, next_s, window_s = min(next_s, offset_s), math.inf, received_s
        known_s, next_s = min(known_s, offset_s), min(next_s, offset_s)
        newest_s = boot_s if not known.boot_s > boot_s else known.boot_s
        clock = Clock(newest_s, known_s, next_s, window_s, known.restarts, known.odd, known.odd_s)
        return clock, boot_s + known_s


@dataclass(frozen=True)
class AutopilotState:
    """The newest of everything; times are ours, `time.monotonic` [s], and NaN before the first message.

    Attributes:
        heartbeat_s: last heartbeat.
        autopilot: MAV_AUTOPILOT.
        kind: MAV_TYPE.
        mode: custom mode.
        armed: motors may run.
        forward: a VTOL that flies as an aeroplane, or changes into one or back.
        clock: the autopilot's.
        trips_s: the last round trips.
        asked_s: when we asked the newest question of the time that was answered: what comes now is no older.
        attitude_t_s: when the attitude was true.
        roll_rad, pitch_rad, heading_rad: attitude.
        velocity_t_s: when position and velocity were true.
        velocity_in_ned_mps: over ground.
        north_m, east_m, down_m: from the autopilot's origin.
        height_t_s, height_m: above the take-off point.
        throttle_percent: of the motors.
        throttle_t_s: when.
        range_t_s, range_m: when it came, and the downward rangefinder; None without.
        battery_t_s, battery_percent: when it came, and the first battery's charge; None where unknown.
        link_t_s, link_percent: when it came, and a telemetry radio's signal; None without one.
        gimbal: component and device that are followed: the first that reported an attitude; None before.
        gimbal_clock: its own.
        gimbal_t_s, gimbal_rad: roll and pitch of the mount against the horizon, yaw against the nose; NaN without one.
        sticks_t_s, sticks_us: when they came, and pulse widths of roll, pitch, throttle and yaw; empty without a
            transmitter.
        alerts: what it says is wrong, in words, by what is looked at, and when; empty words while it is well.
        parameters: read so far, by name.
        acknowledged: result of the last command of each number, with a running count.
        texts: what it said in words, newest last.
    """

    heartbeat_s: float = math.nan
    autopilot: int = 0
    kind: int = 0
    mode: int = -1
    armed: bool = False
    forward: bool = False
    clock: Clock = Clock()
    trips_s: tuple[float, ...] = ()
    asked_s: float = math.nan
    attitude_t_s: float = math.nan
    roll_rad: float = math.nan
    pitch_rad: float = math.nan
    heading_rad: float = math.nan
    velocity_t_s: float = math.nan
    velocity_in_ned_mps: Vector = (math.nan, math.nan, math.nan)
    north_m: float = math.nan
    east_m: float = math.nan
    down_m: float = math.nan
    height_t_s: float = math.nan
    height_m: float = math.nan
    throttle_t_s: float = math.nan
    throttle_percent: float = math.nan
    range_t_s: float = math.nan
    range_m: float | None = None
    battery_t_s: float = math.nan
    battery_percent: float | None = None
    link_t_s: float = math.nan
    link_percent: float | None = None
    gimbal: tuple[int, int] | None = None
    gimbal_clock: Clock = Clock()
    gimbal_t_s: float = math.nan
    gimbal_rad: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    sticks_t_s: float = math.nan
    sticks_us: tuple[int, ...] = ()
    alerts: dict[str, tuple[float, str]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    acknowledged: dict[int, tuple[int, int]] = field(default_factory=dict)
    texts: tuple[str, ...] = ()

    def answers(self, command: int) -> int:
        """How many commands of a number were answered."""
        return self.acknowledged.get(command, (0, 0))[1]

    def denied(self, command: int, answers: int) -> bool:
        """Whether the last command of a number was denied, after the first `answers` of its answers."""
        result, count = self.acknowledged.get(command, (0, 0))
        return count > answers and result not in _DONE

    @property
    def round_trip_s(self) -> float:
        """Shortest round trip of the last time exchanges [s]; 0 before the first."""
        return min(self.trips_s, default=0.0)

    @property
    def velocity_in_level_mps(self) -> Vector | None:
        """Forward-right-down along the heading; None before both are known."""
        north, east, down = self.velocity_in_ned_mps
        if not (math.isfinite(north) and math.isfinite(self.heading_rad)):
            return None
        c, s = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return c * north + s * east, c * east - s * north, down


def absorb(state: AutopilotState, message: Message, received_s: float) -> AutopilotState:
    """The state after a message; the same where it says nothing new, or comes from a component that does not count.

    Raises:
        ValueError: a value is not finite or out of all bounds; the state stays as it was.
    """
    name = message.get_type()
    handler = _HANDLERS.get(name)
    if handler is None or not (name in _ANY_COMPONENT or message.get_srcComponent() == AUTOPILOT):
        return state
    return handler(state, message, received_s)


def _finite(*values: float, bound: float = 1e6) -> None:
    if not all(math.isfinite(value) and abs(value) <= bound for value in values):
        raise ValueError(str(values))


def _clock(state: AutopilotState, boot_ms: int, received_s: float) -> tuple[AutopilotState, float]:
    """The state with the autopilot's clock moved on, and the message's time on ours.

    The quickest message of a while tells the clocks' difference; half of the quickest round trip is its travel
    time.
    """
    clock, sent_s = state.clock.at(boot_ms, received_s)
    return replace(state, clock=clock), sent_s - 0.5 * state.round_trip_s


def _alerted(state: AutopilotState, about: str, received_s: float, words: str) -> AutopilotState:
    return replace(state, alerts=state.alerts | {about: (received_s, words)})


def _heartbeat(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    foreign = state.autopilot in (ARDUPILOT, PX4) and it.autopilot != state.autopilot
    if foreign or it.autopilot == dialect.MAV_AUTOPILOT_INVALID:  # another program's, which speaks as component 1
        return state
    armed = bool(it.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    state = _alerted(state, "autopilot", received_s, heartbeat_alert(it))
    return replace(
        state, heartbeat_s=received_s, autopilot=it.autopilot, kind=it.type, mode=it.custom_mode, armed=armed
    )


def _extended(state: AutopilotState, it: Message, _received_s: float) -> AutopilotState:
    return replace(state, forward=it.vtol_state in _FORWARD)


def _attitude(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    _finite(it.roll, it.pitch, it.yaw, it.rollspeed, it.pitchspeed, it.yawspeed, bound=200.0)
    state, t_s = _clock(state, it.time_boot_ms, received_s)
    return replace(
        state, attitude_t_s=t_s, roll_rad=it.roll, pitch_rad=it.pitch, heading_rad=wrap_angle(it.yaw),
    )  # fmt: skip


def _local_position(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    _finite(it.x, it.y, it.z, it.vx, it.vy, it.vz)
    state, t_s = _clock(state, it.time_boot_ms, received_s)
    velocity = (it.vx, it.vy, it.vz)
    return replace(state, velocity_t_s=t_s, velocity_in_ned_mps=velocity, north_m=it.x, east_m=it.y, down_m=it.z)


def _global_position(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    state, t_s = _clock(state, it.time_boot_ms, received_s)
    return replace(state, height_t_s=t_s, height_m=1e-3 * it.relative_alt)


def _hud(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    return replace(state, throttle_t_s=received_s, throttle_percent=float(it.throttle))


def _range(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    if it.orientation != dialect.MAV_SENSOR_ROTATION_PITCH_270:  # downwards
        return state
    known = it.min_distance <= it.current_distance <= it.max_distance
    return replace(state, range_t_s=received_s, range_m=1e-2 * it.current_distance if known else None)


def _battery(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    if it.id != _FIRST_BATTERY:
        return state
    remaining = it.battery_remaining
    percent = float(remaining) if 0 <= remaining <= 100 else None
    return replace(state, battery_t_s=received_s, battery_percent=percent)


def _radio(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    percent = None if it.rssi == _NONE_U8 else 100.0 * it.rssi / 254.0
    return replace(state, link_t_s=received_s, link_percent=percent)


def _gimbal(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    speaker = it.get_srcComponent(), it.gimbal_device_id
    if speaker[0] not in _GIMBALS or state.gimbal not in (None, speaker):
        return state
    w, x, y, z = it.q
    if not 0.9 < math.hypot(w, x, y, z) < 1.1:  # of zeros, an attitude that is not known
        raise ValueError(str(it.q))
    clock, sent_s = state.gimbal_clock.at(it.time_boot_ms, received_s)
    roll_rad, pitch_rad, yaw_rad = euler_from_quaternion((w, x, y, z))
    # of a gimbal that names neither frame, the lock says which it is
    framed = it.flags & (_YAW_FROM_NORTH | _YAW_FROM_NOSE)
    if it.flags & (_YAW_FROM_NORTH if framed else dialect.GIMBAL_DEVICE_FLAGS_YAW_LOCK):
        _finite(state.heading_rad)
        yaw_rad = wrap_angle(yaw_rad - state.heading_rad)
    return replace(
        state, gimbal=speaker, gimbal_clock=clock, gimbal_t_s=sent_s - 0.5 * state.round_trip_s,
        gimbal_rad=(roll_rad, pitch_rad, yaw_rad),
    )  # fmt: skip


def _receiver(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    named = enumerate(STICK_NAMES.get(state.autopilot, STICK_NAMES[ARDUPILOT]), 1)
    channels = [int(state.parameters.get(name, 0.0)) or usual for usual, name in named]
    sticks = tuple(int(getattr(it, f"chan{channel}_raw", _NONE_U16)) for channel in channels)
    reported = it.chancount >= max(channels) and _NONE_U16 not in sticks
    told = state.parameters
    least_us = told.get("FS_THR_VALUE", _LEAST_THROTTLE_US) if told.get("FS_THR_ENABLE") else _LEAST_THROTTLE_US
    within = all(_PULSES_US[0] <= stick <= _PULSES_US[1] for stick in sticks)
    moved_by_hand = reported and within and sticks[2] >= least_us
    heard = reported or state.sticks_us or state.alerts.get("receiver", (0.0, ""))[1]
    words = "the receiver is in failsafe" if heard and not moved_by_hand else ""
    state = _alerted(state, "receiver", received_s, words)
    return replace(state, sticks_t_s=received_s, sticks_us=sticks if moved_by_hand else ())


def _parameter(state: AutopilotState, it: Message, _received_s: float) -> AutopilotState:
    value = float(it.param_value)
    if state.autopilot == PX4 and it.param_type in (5, 6):  # PX4 sends whole numbers as their bytes
        value = float(struct.unpack("<i", struct.pack("<f", it.param_value))[0])
    _finite(value, bound=1e12)
    return replace(state, parameters=state.parameters | {it.param_id: value})


def _acknowledge(state: AutopilotState, it: Message, _received_s: float) -> AutopilotState:
    return replace(state, acknowledged=state.acknowledged | {it.command: (it.result, state.answers(it.command) + 1)})


def _text(state: AutopilotState, it: Message, _received_s: float) -> AutopilotState:
    return replace(state, texts=(*state.texts[-49:], str(it.text)))


def _times(state: AutopilotState, it: Message, received_s: float) -> AutopilotState:
    """The answer to our own question: tc1 is the autopilot's clock, ts1 what we asked with [ns]."""
    asked_s = 1e-9 * it.ts1
    round_trip_s = received_s - asked_s
    if it.tc1 <= 0 or not 0.0 <= round_trip_s < _LONGEST_TRIP_S:
        return state
    return replace(state, trips_s=(*state.trips_s[1 - _TRIPS :], round_trip_s), asked_s=asked_s)


_Handler = Callable[[AutopilotState, Message, float], AutopilotState]


def _alerting(about: str, words_of: Callable[[Message], str]) -> _Handler:
    return lambda state, it, received_s: _alerted(state, about, received_s, words_of(it))


_HANDLERS: dict[str, _Handler] = {
    "HEARTBEAT": _heartbeat,
    "EXTENDED_SYS_STATE": _extended,
    "ATTITUDE": _attitude,
    "LOCAL_POSITION_NED": _local_position,
    "GLOBAL_POSITION_INT": _global_position,
    "VFR_HUD": _hud,
    "DISTANCE_SENSOR": _range,
    "BATTERY_STATUS": _battery,
    "RADIO_STATUS": _radio,
    "SYS_STATUS": _alerting("sensors", sensors_alert),
    "EKF_STATUS_REPORT": _alerting("estimator", ardupilot_estimator_alert),
    "ESTIMATOR_STATUS": _alerting("estimator", px4_estimator_alert),
    "GIMBAL_DEVICE_ATTITUDE_STATUS": _gimbal,
    "RC_CHANNELS": _receiver,
    "PARAM_VALUE": _parameter,
    "COMMAND_ACK": _acknowledge,
    "STATUSTEXT": _text,
    "TIMESYNC": _times,
}
