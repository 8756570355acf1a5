"""Reads a camera's stream for a vehicle outside: frame by frame, until the flight is over or pictures stay away."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from shipland.messages import Frame, GimbalAttitude, GroundTruth, Telemetry, TouchdownVerdict
from shipland.vehicles.camera_stream import CameraStream, StreamedPicture
from shipland.vehicles.vehicle import LONGEST_WAIT_S

_REMEMBERED = 64
"""Given frames whose truth is kept."""
_VERDICT_S = 5.0
"""How long a simulated touchdown's verdict is waited for."""


class StreamReader:
    """Gives the newest picture as a frame, with the camera's attitude at its exposure.

    Args:
        stream: started.
        gimbal_at: the camera's attitude at a time, and how old the nearest reading is, for pictures without one.
        video_timeout_s: without a picture for so long the flight is over.
    """

    def __init__(
        self, stream: CameraStream, gimbal_at: Callable[[float], tuple[GimbalAttitude, float]], video_timeout_s: float
    ) -> None:
        self._stream, self._gimbal_at, self._timeout_s = stream, gimbal_at, video_timeout_s
        self._last_exposed_s = -math.inf
        self._pictured_s = time.monotonic()
        self._truths: dict[float, GroundTruth] = {}

    def begin(self) -> None:
        """The flight begins: the time without a picture counts from now."""
        self._pictured_s = time.monotonic()

    def read(
        self, ended: Callable[[], object], lost: Callable[[str], None], telemetry_at: Callable[[float], Telemetry]
    ) -> tuple[Frame | None, Telemetry] | None:
        """See `Vehicle.read`.

        Args:
            ended: whether the flight is over.
            lost: told why there are no more pictures, in words.
            telemetry_at: the newest, stamped with a time.
        """
        stream = self._stream
        if not ended():
            until_s = time.monotonic() + LONGEST_WAIT_S
            frame = self.look(LONGEST_WAIT_S)
            if frame is not None:
                self._pictured_s = time.monotonic()
                return frame, telemetry_at(self._pictured_s)
            judged = bool(stream.problem) and stream.verdict() is not None
            if not judged and time.monotonic() - self._pictured_s <= self._timeout_s:
                time.sleep(max(0.0, until_s - time.monotonic()))  # a stream that has ended does not wait
                return None, telemetry_at(time.monotonic())
            lost(stream.problem or f"no picture for {self._timeout_s:g} s")
        if self._truths:  # a simulator's camera; it gives its verdict when the aircraft has come to rest
            until_s = time.monotonic() + _VERDICT_S
            while stream.verdict() is None and not stream.problem and time.monotonic() < until_s:
                time.sleep(0.05)
        return None

    def look(self, timeout_s: float) -> Frame | None:
        """The newest picture not given; None when none comes in time."""
        shot = self._stream.newest(self._last_exposed_s, timeout_s)
        return None if shot is None else self._frame(shot)

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth of a frame that was given, from a simulator's camera."""
        return self._truths.get(t_s)

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, from a simulator's camera."""
        return self._stream.verdict()

    def _frame(self, shot: StreamedPicture) -> Frame:
        self._last_exposed_s = shot.exposed_s
        if shot.truth is not None:
            self._truths[shot.exposed_s] = shot.truth
            for stamp_s in list(self._truths)[:-_REMEMBERED]:
                del self._truths[stamp_s]
        gimbal, age_s = (shot.gimbal, 0.0) if shot.gimbal is not None else self._gimbal_at(shot.exposed_s)
        return Frame(shot.exposed_s, shot.image, gimbal, gimbal_age_s=age_s)
