"""What a ROS 2 vehicle has said, and who commands it."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import replace
from typing import Any

from shipland.messages import GimbalAttitude, Telemetry
from shipland.vehicles.checks import rate_hz
from shipland.vehicles.gimbal import Reading, gimbal_at
from shipland.vehicles.hand_over import HandOver, hand_over_words
from shipland.vehicles.ros2.conversions import gimbal_of, seconds, with_odometry
from shipland.vehicles.ros2.pictures import ours_s
from shipland.vehicles.ros2.types import Message
from shipland.vehicles.touchdown import motors_stopped

_READINGS = 200
"""Attitudes kept: four seconds at 50 Hz."""
SILENT_S = 2.0
"""A state that came longer ago is not the present one."""
_SLOW_S = 10.0
"""A battery that is reported less often is not known."""

_OBEYING = {"attitude": ("GUIDED",), "velocity": ("GUIDED", "OFFBOARD")}
"""Modes that obey set-points of a kind, by mavros's names: thrust is no climb in a PX4's OFFBOARD, and an ArduPilot's
GUIDED_NOGPS does not fly a velocity of zero, our hold."""


class Heard:
    """The vehicle's messages, merged on the node's thread, read from any.

    Control is ours once the vehicle was given to us (`HandOver`) and is armed, while it says that it obeys set-points;
    once it has been ours, the first message that says otherwise ends it for good. A link that is lost says nothing.

    Args:
        kind: of the set-points, attitude or velocity.
    """

    def __init__(self, kind: str) -> None:
        self._obeying = _OBEYING[kind]
        self._lock = threading.RLock()
        self._telemetry, self._telemetry_s = Telemetry(0.0), -math.inf
        self._attitudes: deque[Reading] = deque(maxlen=_READINGS)
        self._mounts: deque[Reading] = deque(maxlen=_READINGS)
        self._battery: tuple[float, float] | None = None
        self._state: Any = None
        self._state_s = -math.inf
        self.land: bool | None = None
        """What `/shipland/land` said last."""
        self._odometry_stamps, self._mount_stamps = _Stamps(), _Stamps()
        self._engaged = self._bridged = self._asked = False
        self._hand_over: HandOver | None = None
        self.landing = False
        """Whether the descent that is flown ends on the deck: motors that stop then have landed it."""
        self.over = ""
        """Why the flight is over, in words, though nobody has taken the vehicle, which is to hold; else empty."""
        self.lost = ""
        """Why control is gone for good, in words; empty while it is not."""

    def take_odometry(self, odometry: Message) -> None:
        """nav_msgs/Odometry; raises as `with_odometry` does. One that comes late is a reading of its time alone."""
        true_s = self._odometry_stamps.true_s(odometry)
        with self._lock:
            told = with_odometry(self._telemetry, odometry, true_s)
            if true_s >= self._telemetry_s:
                self._telemetry, self._telemetry_s = told, true_s
            if told.roll_rad is not None and told.pitch_rad is not None and told.attitude_t_s == true_s:
                self._attitudes.append((true_s, told.roll_rad, told.pitch_rad, 0.0))

    def take_gimbal(self, attitude: Message) -> None:
        """geometry_msgs/QuaternionStamped; raises as `gimbal_of` does."""
        gimbal = gimbal_of(attitude)
        if gimbal is not None:
            true_s = self._mount_stamps.true_s(attitude)
            self._mounts.append((true_s, gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad))

    def take_battery(self, battery: Message) -> None:
        """sensor_msgs/BatteryState."""
        share = float(battery.percentage)
        if 0.0 <= share <= 1.0:
            self._battery = 100.0 * share, time.monotonic()

    def take_state(self, state: Message) -> None:
        """mavros_msgs/State."""
        with self._lock:
            self._state, self._state_s = state, time.monotonic()
            if state.connected and not self._bridged:
                self._bridged = True
                if self._hand_over is not None:  # what it saw before was the bridge's word, not the autopilot's
                    self._hand_over = HandOver(self._asked)
            self._see()
            if self._cut_off:
                self._finish("link lost: the vehicle's bridge has lost the autopilot")
            elif self._engaged and not state.armed:
                self._lose(motors_stopped(self.landing))
            elif self._engaged and not self._obeys(state):
                self._lose(f"the pilot took over: {self.mode}")

    def take_land(self, asked: Message) -> None:
        """std_msgs/Bool: true asks for a landing, false ends it."""
        with self._lock:
            self.land = bool(asked.data)
            if not self.land:
                self._finish("ended by /shipland/land")

    def watch_silence(self, timeout_s: float) -> None:
        """The flight is over when the vehicle's state has not come for so long; it may hear more than it is heard."""
        with self._lock:
            if self.silent_s > timeout_s:
                self._finish(f"link lost: the vehicle's state has not come for {timeout_s:g} s")

    @property
    def silent_s(self) -> float:
        """For how long the vehicle's state has not come [s]."""
        return time.monotonic() - self._state_s

    def expect(self, asked: bool) -> None:
        """From now on a hand-over counts; `asked` as of `HandOver`."""
        with self._lock:
            self._asked, self._hand_over = asked, HandOver(asked)
            self._see()

    @property
    def given(self) -> bool:
        """Handed over, and armed, by its own word."""
        with self._lock:  # not between a state and what it says of the hand-over
            given = self._hand_over is not None and self._hand_over.given
            return given and self.silent_s <= SILENT_S and not self._cut_off and bool(self._state.armed)

    @property
    def hand_over_words(self) -> str:
        """What the operator has to do."""
        known = self.silent_s <= SILENT_S
        if known and self._hand_over is not None and self._hand_over.given:
            return "arm the vehicle, and take off"
        obeys = known and self._obeys(self._state)
        return hand_over_words(" or ".join(self._obeying), self.mode, obeys)

    @property
    def ours(self) -> bool:
        """Whether set-points may leave."""
        return self._engaged and not self.lost

    @property
    def mode(self) -> str:
        """As the vehicle names it, while it does."""
        return "unknown" if self.silent_s > SILENT_S else str(self._state.mode) or "a mode without a name"

    def begin(self, called: bool) -> bool:
        """From now on it is ours, and what the vehicle says otherwise ends that; False where that was taken back.

        Args:
            called: a landing must have been asked for.
        """
        with self._lock:
            self._engaged = self.given and (bool(self.land) or not called)
            return self._engaged

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""
        battery, now_s = self._battery, time.monotonic()
        fresh = battery is not None and now_s - battery[1] <= _SLOW_S
        return replace(
            self._telemetry,
            t_s=t_s if math.isfinite(t_s) else now_s,
            battery_percent=battery[0] if battery is not None and fresh else None,
            flying=self._state is not None and bool(self._state.armed),
        )

    def gimbal_at(self, t_s: float, fixed_pitch_rad: float | None) -> tuple[GimbalAttitude, float]:
        """The camera's attitude at an exposure, and how old the nearest reading is."""
        return gimbal_at(t_s, sorted(self._attitudes), sorted(self._mounts), fixed_pitch_rad)

    @property
    def tells_mount(self) -> bool:
        """Whether the camera's mount has told its attitude."""
        return bool(self._mounts)

    @property
    def attitude_hz(self) -> float:
        """Of attitudes; see `checks.rate_hz`."""
        return rate_hz(true_s for true_s, *_ in list(self._attitudes))

    def _obeys(self, state: Message) -> bool:
        """Whether it obeys set-points, by its mode's name, or by `guided` where it has no modes.

        mavros's `guided` is a flag of the heartbeat: true in LOITER, RTL and AUTO, false in a PX4's OFFBOARD.
        """
        return state.mode in self._obeying if state.mode else bool(state.guided)

    @property
    def _cut_off(self) -> bool:
        """Whether the bridge has lost the autopilot: armed and mode are not its word then."""
        return self._bridged and not self._state.connected

    def _see(self) -> None:
        if self._hand_over is not None and self._state is not None and not self._cut_off:
            self._hand_over.see(self._obeys(self._state))

    def _finish(self, reason: str) -> None:
        if self.ours:
            self.over = self.over or reason

    def _lose(self, reason: str) -> None:
        self.lost = self.lost or reason


class _Stamps:
    """When the messages of one topic were true; a stamp of another clock counts as now.

    Once stamps were of our clock, one that is older than any of another's is late: it must not seem new.
    """

    def __init__(self) -> None:
        self._our_clock = False

    def true_s(self, stamped: Message) -> float:
        """On the loop's clock [s]."""
        stamp_s = seconds(stamped.header.stamp)
        true_s, age_s = ours_s(stamp_s), time.time() - stamp_s
        self._our_clock = self._our_clock or true_s is not None
        if true_s is None:
            true_s = time.monotonic() - (max(age_s, 0.0) if self._our_clock else 0.0)
        return true_s
