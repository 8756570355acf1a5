"""What vehicles that are flown by set-points over a link share; a subclass speaks the link.

Set-points leave at a steady rate from a thread of their own, whatever the loop does, and only while control is ours.
"""

from __future__ import annotations

import math
import threading
import time
from abc import abstractmethod
from collections import deque

import numpy as np
import numpy.typing as npt

from shipland.errors import VehicleError
from shipland.messages import Frame, GimbalAttitude, GroundTruth, PilotCommand, Telemetry, TouchdownVerdict
from shipland.vehicles.camera_stream import CameraStream, PictureSource
from shipland.vehicles.link_vehicle import LinkVehicle
from shipland.vehicles.pace import Pace
from shipland.vehicles.parameters import SetpointParameters
from shipland.vehicles.priority import First
from shipland.vehicles.vehicle import LONGEST_WAIT_S, unless_late
from shipland.vehicles.wanted import HeadingSetPoint

_REMEMBERED = 64
"""Given frames whose truth is kept."""
_VERDICT_S = 5.0
"""How long a simulated touchdown's verdict is waited for."""


class SetpointVehicle(LinkVehicle):
    """A `GroundTruthSource` as well, where its camera is a simulator's."""

    def __init__(self, parameters: SetpointParameters) -> None:
        super().__init__()
        self._parameters = parameters
        self._stream: CameraStream | None = None
        self._given_s, self._pictured_s = -math.inf, time.monotonic()
        self._image: npt.NDArray[np.uint8] | None = None
        self._truths: deque[tuple[float, GroundTruth]] = deque(maxlen=_REMEMBERED)
        self._pace: Pace | None = None
        self._lock = threading.Lock()
        self._command: tuple[PilotCommand, float] | None = None
        self._gimbal_s = -math.inf
        self._heading = HeadingSetPoint()

    @property
    def late_s(self) -> list[float]:
        """How late each set-point left [s]."""
        return [] if self._pace is None else list(self._pace.late_s)

    @abstractmethod
    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""

    @abstractmethod
    def _gimbal_at(self, t_s: float) -> tuple[GimbalAttitude, float]:
        """The camera's attitude at a time, and how old the nearest reading is, for pictures without one."""

    @abstractmethod
    def _tick(self, step_s: float) -> None:
        """One turn of the set-points' thread, `step_s` after the last."""

    @abstractmethod
    def _turn_camera(self, pitch_rad: float) -> None:
        """Command the camera's pitch against the horizon, upward positive."""

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """The newest picture not given, or none within `LONGEST_WAIT_S`; None when the flight is over."""
        stream, timeout_s = self._stream, self._parameters.video_timeout_s
        if stream is None or self._closed or not self._engaged:
            return None
        if not self.end_reason:
            until_s = time.monotonic() + LONGEST_WAIT_S
            while (frame := self.look(max(0.0, until_s - time.monotonic()))) is not None:
                if self._is_another(frame):
                    self._pictured_s = time.monotonic()
                    return frame, self.telemetry_at(self._pictured_s)
            judged = bool(stream.problem) and stream.verdict() is not None
            if not judged and time.monotonic() - self._pictured_s <= timeout_s:
                time.sleep(max(0.0, until_s - time.monotonic()))  # a stream that has ended does not wait
                return None, self.telemetry_at(time.monotonic())
            self._end(f"video lost: {stream.problem or f'no picture for {timeout_s:g} s'}; the vehicle holds")
        if self._truths:  # a simulator's camera; it gives its verdict when the aircraft has come to rest
            until_s = time.monotonic() + _VERDICT_S
            while stream.verdict() is None and not stream.problem and time.monotonic() < until_s:
                time.sleep(0.05)
        return None

    def _is_another(self, frame: Frame) -> bool:
        """Whether a picture differs from the one before: no two of a camera have the same noise.

        A decoder or a grabber that has lost its camera shows the last picture again, with new times.
        """
        before, self._image = self._image, frame.image
        return frame.image is None or before is None or not np.array_equal(frame.image, before)

    def look(self, timeout_s: float) -> Frame | None:
        """The newest picture not given, without flying: only connected. None when none comes in time."""
        shot = None if self._stream is None else self._stream.newest(self._given_s, timeout_s)
        if shot is None:
            return None
        self._given_s = shot.exposed_s
        if shot.truth is not None:
            self._truths.append((shot.exposed_s, shot.truth))
        gimbal, age_s = (shot.gimbal, 0.0) if shot.gimbal is not None else self._gimbal_at(shot.exposed_s)
        return Frame(shot.exposed_s, shot.image, gimbal, gimbal_age_s=age_s)

    def video_lost(self, silent_s: float) -> str:
        """Why `look` gave nothing for so long, in words; empty where a recording has been played."""
        if self._stream is None or self._stream.played:
            return ""
        return f"video lost: {self._stream.problem or f'no picture for {silent_s:g} s'}"

    def send(self, command: PilotCommand) -> None:
        """The newest sticks; they leave with the next set-point."""
        with self._lock:
            now_s = time.monotonic()
            self._command = unless_late(command, now_s), now_s

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth of a frame that `read` gave, from a simulator's camera."""
        return dict(self._truths).get(t_s)

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, from a simulator's camera."""
        return None if self._stream is None else self._stream.verdict()

    def _start_stream(self, source: PictureSource) -> None:
        self._stream = CameraStream(source)
        self._stack.callback(self._stream.close)
        self._stream.start()

    def _await_picture(self, timeout_s: float, silent: str) -> None:
        """The first picture of the started stream; VehicleError, `silent` where the stream says nothing itself."""
        assert self._stream is not None  # started
        if self._stream.newest(-math.inf, timeout_s) is None:
            raise VehicleError(f"no picture from the camera: {self._stream.problem or silent}")

    def _start_set_points(self, name: str, first: First = "thread") -> None:
        pace = self._pace = Pace(self._turn, self._parameters.setpoint_hz, name, first)
        self._stack.callback(pace.stop)
        pace.start()

    def _turn(self, step_s: float) -> None:
        if self._engaged and (words := self._suspended):
            self._end(f"{words}; the vehicle holds")
        self._tick(step_s)

    def _begin(self) -> None:
        """The flight begins; VehicleError where the machine was suspended while it was waited for."""
        self._refuse_if_suspended()
        self._pictured_s, self._engaged = time.monotonic(), True

    def _end(self, reason: str) -> None:
        """No more frames; the first reason stands."""
        self._end_reason = self._end_reason or reason

    def _newest(self, now_s: float) -> PilotCommand | None:
        """The sticks to fly; None, a hold, without any that are fresh, and once the flight is over."""
        with self._lock:
            command = self._command
        if command is None or self._end_reason or now_s - command[1] > self._parameters.stale_s:
            return None
        return command[0]

    def _aim(self, command: PilotCommand | None, now_s: float) -> None:
        """Turn the camera where the pilot wants it: not to a NaN, and no oftener than `gimbal_hz`."""
        if command is None or not math.isfinite(command.gimbal_pitch_rad):
            return
        if now_s - self._gimbal_s >= 1.0 / self._parameters.gimbal_hz:
            self._gimbal_s = now_s
            self._turn_camera(command.gimbal_pitch_rad)
