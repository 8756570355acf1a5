"""A recording as a vehicle: what was seen is seen again, what is sent goes nowhere."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.messages import Frame, GimbalAttitude, GroundTruth, PilotCommand, Telemetry, TouchdownVerdict
from shipland.vehicles.camera_stream import wrong_size

_REMEMBERED = 64
"""Given frames whose truth is kept."""


@dataclass(frozen=True)
class Recorded:
    """One recorded picture.

    Attributes:
        frame: the picture at its exposure.
        arrived_s: when it was received, on the frame's clock [s].
        telemetry: the newest at receipt; its `t_s` is when the values were received.
        truth: at the exposure, where somebody knew it.
    """

    frame: Frame
    arrived_s: float
    telemetry: Telemetry
    truth: GroundTruth | None = None


class ReplayVehicle:
    """A `Vehicle` and `GroundTruthSource` over a recording, in order of receipt; see `in_order`.

    Time is the recording's: after `send` the pipeline is free at the command's time, and `read` gives the newest
    picture that had arrived by then and was not given, else it waits for the next one, as a link does. Sticks move
    nothing.

    Args:
        recorded: the pictures, at most as long as needed: an iterator is read as the replay goes on.
        camera: intrinsics of the pictures.
        verdict: how the recorded flight ended.
    """

    def __init__(
        self, recorded: Iterator[Recorded] | Sequence[Recorded], camera: Camera, verdict: TouchdownVerdict | None = None
    ) -> None:
        self._source, self._camera, self._verdict = in_order(recorded), camera, verdict
        self._ahead: Recorded | None = None
        self._newest: Recorded | None = None
        self._truths: deque[tuple[float, GroundTruth]] = deque(maxlen=_REMEMBERED)
        self._now_s, self._is_open, self._ended = -math.inf, False, False

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures."""
        return self._camera

    def open(self) -> None:
        """Read the first picture; DataError when there is none."""
        if self._newest is None and self._peek() is None:
            raise DataError("the recording holds no pictures to replay")
        self._is_open = True

    def read(self) -> tuple[Frame, Telemetry] | None:
        """The newest picture received by now and not given, else the next; None at the recording's end."""
        if not self._is_open or self._peek() is None:
            return None
        chosen = self._take()
        while (following := self._peek()) is not None and following.arrived_s <= self._now_s:
            chosen = self._take()
        self._now_s = max(self._now_s, chosen.arrived_s)
        if chosen.truth is not None:
            self._truths.append((chosen.frame.t_s, chosen.truth))
        return chosen.frame, replace(chosen.telemetry, t_s=self._now_s)

    def telemetry_at(self, t_s: float) -> Telemetry:
        """What had been received with the newest picture given, stamped with `t_s`."""
        if math.isfinite(t_s):
            self._now_s = max(self._now_s, t_s)
        if self._newest is None:
            return Telemetry(self._now_s)
        return replace(self._newest.telemetry, t_s=self._now_s)

    def send(self, command: PilotCommand) -> None:
        """The pipeline is free at the command's time; the sticks are ignored."""
        if self._is_open and math.isfinite(command.t_s):
            self._now_s = max(self._now_s, command.t_s)

    def close(self) -> None:
        """End the replay."""
        self._is_open = False

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The recorded truth of a picture that `read` gave, by its exposure time [s]."""
        return dict(self._truths).get(t_s)

    def verdict(self) -> TouchdownVerdict | None:
        """How the recorded flight ended, once the replay has."""
        return self._verdict if self._ended else None

    def _peek(self) -> Recorded | None:
        if self._ahead is None and not self._ended:
            self._ahead = next(self._source, None)
            self._ended = self._ahead is None
        return self._ahead

    def _take(self) -> Recorded:
        assert self._ahead is not None  # both callers have peeked
        self._newest, self._ahead = self._ahead, None
        return self._newest


def in_order(recorded: Iterable[Recorded]) -> Iterator[Recorded]:
    """Those exposed and received after the one before, without one that is ahead of what follows it.

    Taken for its time, a picture stamped far ahead would leave all others behind.
    """
    before: Recorded | None = None
    waiting: Recorded | None = None
    for item in recorded:
        if not _is_after(item, before):
            continue
        if waiting is not None and _is_after(item, waiting):
            yield waiting
            before = waiting
        waiting = item
    if waiting is not None:
        yield waiting


def _is_after(item: Recorded, before: Recorded | None) -> bool:
    return before is None or (item.frame.t_s > before.frame.t_s and item.arrived_s >= before.arrived_s)


def recorded_video(path: Path, camera: Camera, pitch_rad: float, latency_s: float) -> Iterator[Recorded]:
    """A video's pictures, with nothing known but when they were exposed, under a constant pitch.

    Raises:
        DataError: no video, or its pictures are of another size than the calibration.
    """
    from shipland.vision.pictures import read_video

    gimbal = GimbalAttitude(0.0, pitch_rad)
    for t_s, image in read_video(path):
        height_px, width_px = image.shape[:2]
        if wrong := wrong_size(f"{path} holds pictures", (width_px, height_px), (camera.width_px, camera.height_px)):
            raise DataError(wrong)
        arrived_s = t_s + latency_s
        telemetry = Telemetry(arrived_s, flying=True)
        yield Recorded(Frame(t_s, image, gimbal), arrived_s, telemetry)
