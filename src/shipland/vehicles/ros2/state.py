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
_SLOW_S = 10.0
"""A battery that is reported less often is not known."""

_OBEYING = {"attitude": ("GUIDED",), "velocity": ("GUIDED", "OFFBOARD")}
"""Modes that obey set-points of a kind, by mavros's names: thrust is no climb in a PX4's OFFBOARD, and an ArduPilot's
GUIDED_NOGPS does not fly a velocity of zero, our hold."""


class Heard:
    """The vehicle's messages, merged on the node's thread, read from any.

    Control is ours once the vehicle was given to us (`HandOver`) and is armed, while it says that it obeys set-points;
    once it has been ours, the first message that says otherwise ends it for good.

    Args:
        kind: of the set-points, attitude or velocity.
    """

    def __init__(self, kind: str) -> None:
        self._obeying = _OBEYING[kind]
        self._lock = threading.RLock()
        self._telemetry = Telemetry(0.0)
        self._attitudes: deque[Reading] = deque(maxlen=_READINGS)
        self._mounts: deque[Reading] = deque(maxlen=_READINGS)
        self._battery: tuple[float, float] | None = None
        self._state: Any = None
        self.state_s = -math.inf
        """When the vehicle's state came last [s]."""
        self.land: bool | None = None
        """What `/shipland/land` said last."""
        self.called_off = False
        """It said false in flight."""
        self._engaged = self._our_clock = self._bridged = False
        self._hand_over: HandOver | None = None
        self.landing = False
        """Whether the descent that is flown ends on the deck: motors that stop then have landed it."""
        self.lost = ""
        """Why control is gone for good, in words; empty while it is not."""

    def take_odometry(self, odometry: Message) -> None:
        """nav_msgs/Odometry; raises as `with_odometry` does."""
        true_s = self._true_s(seconds(odometry.header.stamp))
        with self._lock:
            told = self._telemetry = with_odometry(self._telemetry, odometry, true_s)
            if told.roll_rad is not None and told.pitch_rad is not None and told.attitude_t_s == true_s:
                self._attitudes.append((true_s, told.roll_rad, told.pitch_rad, 0.0))

    def take_gimbal(self, attitude: Message) -> None:
        """geometry_msgs/QuaternionStamped."""
        gimbal = gimbal_of(attitude)
        if gimbal is not None:
            true_s = self._true_s(seconds(attitude.header.stamp))
            self._mounts.append((true_s, gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad))

    def take_battery(self, battery: Message) -> None:
        """sensor_msgs/BatteryState."""
        share = float(battery.percentage)
        if 0.0 <= share <= 1.0:
            self._battery = 100.0 * share, time.monotonic()

    def take_state(self, state: Message) -> None:
        """mavros_msgs/State."""
        with self._lock:
            self._state, self.state_s = state, time.monotonic()
            self._bridged = self._bridged or bool(state.connected)
            cut_off = self._bridged and not state.connected  # armed and mode are not the autopilot's word then
            if self._hand_over is not None and not cut_off:
                self._hand_over.see(self._obeys(state))
            if self._engaged and cut_off:
                self._lose("link lost: the vehicle's bridge has lost the autopilot")
            elif self._engaged and not state.armed:
                self._lose(motors_stopped(self.landing))
            elif self._engaged and not self._obeys(state):
                self._lose(f"the pilot took over: {self.mode}")

    def take_land(self, asked: Message) -> None:
        """std_msgs/Bool: true asks for a landing, false ends it."""
        with self._lock:
            self.land = bool(asked.data)
            self.called_off = self.called_off or (self._engaged and not self.land)

    def watch_silence(self, timeout_s: float) -> None:
        """Control is gone when the vehicle's state has not come for so long."""
        if self._engaged and time.monotonic() - self.state_s > timeout_s:
            with self._lock:
                self._lose(f"link lost: the vehicle's state has not come for {timeout_s:g} s")

    def expect(self, asked: bool) -> None:
        """From now on a hand-over counts; `asked` as of `HandOver`."""
        with self._lock:
            self._hand_over = HandOver(asked)
            if self._state is not None:
                self._hand_over.see(self._obeys(self._state))

    @property
    def given(self) -> bool:
        """Handed over, and armed, by its own word."""
        with self._lock:  # not between a state and what it says of the hand-over
            return self._hand_over is not None and self._hand_over.given and bool(self._state.armed)

    @property
    def hand_over_words(self) -> str:
        """What the operator has to do."""
        if self._hand_over is not None and self._hand_over.given:
            return "arm the vehicle, and take off"
        obeys = self._state is not None and self._obeys(self._state)
        return hand_over_words(" or ".join(self._obeying), self.mode, obeys)

    @property
    def ours(self) -> bool:
        """Whether set-points may leave."""
        return self._engaged and not self.lost

    @property
    def mode(self) -> str:
        """As the vehicle names it."""
        return "unknown" if self._state is None else str(self._state.mode) or "a mode without a name"

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
        return gimbal_at(t_s, list(self._attitudes), list(self._mounts), fixed_pitch_rad)

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

    def _true_s(self, stamp_s: float) -> float:
        """When what is stamped was true; a stamp of another clock counts as now.

        Once stamps were of our clock, one that is older than any of another's is late: it must not seem new.
        """
        true_s, age_s = ours_s(stamp_s), time.time() - stamp_s
        self._our_clock = self._our_clock or true_s is not None
        if true_s is None:
            true_s = time.monotonic() - (max(age_s, 0.0) if self._our_clock else 0.0)
        return true_s

    def _lose(self, reason: str) -> None:
        self.lost = self.lost or reason
