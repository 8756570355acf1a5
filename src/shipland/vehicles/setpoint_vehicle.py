"""What vehicles that are flown by set-points over a link share; a subclass speaks the link.

Set-points leave at a steady rate from a thread of their own, whatever the loop does, and only while control is ours.
"""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import ExitStack

from shipland.errors import VehicleError
from shipland.messages import Frame, GimbalAttitude, GroundTruth, PilotCommand, Telemetry, TouchdownVerdict
from shipland.vehicles.camera_stream import CameraStream, PictureSource
from shipland.vehicles.pace import First, Pace
from shipland.vehicles.parameters import SetpointParameters
from shipland.vehicles.stream_reader import StreamReader
from shipland.vehicles.vehicle import unless_late


class SetpointVehicle(ABC):
    """A `Vehicle` on `time.monotonic`; a `GroundTruthSource` where its camera is a simulator's.

    Args:
        parameters: of the link.
    """

    def __init__(self, parameters: SetpointParameters) -> None:
        self._parameters = parameters
        self._stack = ExitStack()
        self._stream: CameraStream | None = None
        self._reader: StreamReader | None = None
        self._pace: Pace | None = None
        self._lock = threading.Lock()
        self._command: tuple[PilotCommand, float] | None = None
        self._engaged = self._closed = False
        self._end_reason = ""
        self._gimbal_s = -math.inf

    @property
    def end_reason(self) -> str:
        """Why the flight is over, in words; empty in flight."""
        return self._end_reason

    @property
    def late_s(self) -> list[float]:
        """How late each set-point left [s]."""
        return [] if self._pace is None else list(self._pace.late_s)

    @abstractmethod
    def connect(self) -> None:
        """Link and camera, without taking control; once is enough. VehicleError when something does not answer."""

    @abstractmethod
    def _engage(self) -> None:
        """Take the vehicle, once connected, as far as that was allowed."""

    @abstractmethod
    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""

    @abstractmethod
    def close(self) -> None:
        """Leave the vehicle holding, where it is still ours, and let go of it; no signal cuts it short."""

    @abstractmethod
    def _tick(self, step_s: float) -> None:
        """One turn of the set-points' thread, `step_s` after the last."""

    def open(self) -> None:
        """Connect, and take the vehicle as far as that was allowed; VehicleError when it does not come to us."""
        if self._closed:
            raise VehicleError("this flight is over; make a new vehicle for the next one")
        self.connect()
        try:
            self._engage()
        except BaseException:
            self.close()
            raise

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """The newest picture not given, or none within `LONGEST_WAIT_S`; None when the flight is over."""
        if self._reader is None or self._closed or not self._engaged:
            return None
        return self._reader.read(lambda: self.end_reason, self._video_lost, self.telemetry_at)

    def look(self, timeout_s: float) -> Frame | None:
        """The newest picture not given, without flying: only connected. None when none comes in time."""
        return None if self._reader is None else self._reader.look(timeout_s)

    def send(self, command: PilotCommand) -> None:
        """The newest sticks; they leave with the next set-point."""
        with self._lock:
            now_s = time.monotonic()
            self._command = unless_late(command, now_s), now_s

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth of a frame that `read` gave, from a simulator's camera."""
        return None if self._reader is None else self._reader.truth_at(t_s)

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, from a simulator's camera."""
        return None if self._reader is None else self._reader.verdict()

    def _start_stream(self, source: PictureSource) -> CameraStream:
        stream = self._stream = CameraStream(source)
        self._stack.callback(stream.close)
        stream.start()
        return stream

    def _await_picture(
        self, timeout_s: float, silent: str, gimbal_at: Callable[[float], tuple[GimbalAttitude, float]]
    ) -> None:
        """The first picture of the started stream; VehicleError, `silent` where the stream says nothing itself."""
        stream = self._stream
        assert stream is not None  # started
        if stream.newest(-math.inf, timeout_s) is None:
            raise VehicleError(f"no picture from the camera: {stream.problem or silent}")
        self._reader = StreamReader(stream, gimbal_at, self._parameters.video_timeout_s)

    def _start_set_points(self, name: str, first: First = "thread") -> None:
        pace = self._pace = Pace(self._tick, self._parameters.setpoint_hz, name, first)
        self._stack.callback(pace.stop)
        pace.start()

    def _begin(self) -> None:
        """The flight begins."""
        assert self._reader is not None  # connected
        self._reader.begin()
        self._engaged = True

    def _end(self, reason: str) -> None:
        """No more frames; the first reason stands."""
        self._end_reason = self._end_reason or reason

    def _video_lost(self, words: str) -> None:
        self._end(f"video lost: {words}; the vehicle holds")

    def _newest(self, now_s: float) -> PilotCommand | None:
        """The sticks to fly; None, a hold, without any that are fresh, and once the flight is over."""
        with self._lock:
            command = self._command
        if command is None or self._end_reason or now_s - command[1] > self._parameters.stale_s:
            return None
        return command[0]

    def _turns_camera(self, pitch_rad: float, now_s: float) -> bool:
        """Whether the camera is to be turned to `pitch_rad` now: not to a NaN, and no oftener than `gimbal_hz`."""
        if not math.isfinite(pitch_rad) or now_s - self._gimbal_s < 1.0 / self._parameters.gimbal_hz:
            return False
        self._gimbal_s = now_s
        return True
