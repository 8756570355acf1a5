"""The flight's video, written frame by frame while flying: onboard picture, chase view, instruments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from shipland.camera import Camera
from shipland.config import key, parameters, require
from shipland.errors import DataError
from shipland.extras import installed
from shipland.files import writing
from shipland.frames import Pose
from shipland.messages import Estimate, FlightRecord, GroundTruth, TouchdownVerdict
from shipland.record.columns import derive
from shipland.report.lettering import Image
from shipland.report.overlay import STRIP_HEIGHT_PX, STRIP_WIDTH_PX, Instruments, draw_sight, draw_verdict, draw_zoom
from shipland.rig import Rig

if TYPE_CHECKING:
    import av.container

_KEPT_S = 2.0
"""Time for which moments are kept: longer than a pilot's prediction and a detector's cycle."""


class Moments:
    """The estimates and truths of the last two seconds."""

    def __init__(self) -> None:
        self._estimates: list[Estimate] = []
        self._truths: list[GroundTruth] = []
        self._has_estimate = False

    def note(self, record: FlightRecord) -> None:
        """Take a cycle."""
        estimate = record.decision.estimate
        self._has_estimate = estimate is not None
        if estimate is not None:
            self._estimates = [*(it for it in self._estimates if it.t_s >= estimate.t_s - _KEPT_S), estimate]
        if record.truth is not None:
            self.note_truth(record.truth)

    def note_truth(self, truth: GroundTruth) -> None:
        """Take a truth; one already taken changes nothing."""
        if not self._truths or truth.t_s > self._truths[-1].t_s:
            self._truths = [*(it for it in self._truths if it.t_s >= truth.t_s - _KEPT_S), truth]

    def at(self, t_s: float, truth: GroundTruth | None) -> tuple[Estimate | None, GroundTruth | None]:
        """The newest estimate whose time has come by `t_s` with the truth of that time; else None and `truth`."""
        due = [item for item in self._estimates if t_s - _KEPT_S < item.t_s <= t_s + 1e-6]
        if not self._has_estimate or not due:
            return None, truth
        estimate = max(due, key=lambda item: item.t_s)
        pairs = list(pairwise(self._truths)) or [(only, only) for only in self._truths]
        around = (pair for pair in pairs if pair[0].t_s - 1e-6 <= estimate.t_s <= pair[1].t_s + 1e-6)
        return estimate, next((between(*pair, estimate.t_s) for pair in around), None)


def between(before: GroundTruth, after: GroundTruth, t_s: float) -> GroundTruth:
    """The truth at a time between two, or nearest to it: places by line, turns by the shortest arc."""
    span_s = after.t_s - before.t_s
    share = 0.0 if span_s <= 0.0 else min(1.0, max(0.0, (t_s - before.t_s) / span_s))
    moved: dict[str, Any] = {"t_s": before.t_s + share * span_s}
    for name, first in vars(before).items():
        last = getattr(after, name)
        if isinstance(first, Pose):
            turn = Rotation.from_matrix(first.rotation.T @ last.rotation).as_rotvec()
            rotation = first.rotation @ Rotation.from_rotvec(share * turn).as_matrix()
            moved[name] = Pose(rotation, first.translation_m + share * (last.translation_m - first.translation_m))
        elif isinstance(first, np.ndarray):
            moved[name] = first + share * (last - first)
    return replace(before, **moved)


Chase = Callable[[GroundTruth], Image]
"""Renders the outside view, (h, TRACES_WIDTH_PX, 3) BGR for choice, of a moment."""

_TICK_S = Fraction(1, 90000)
_BLANK: tuple[int, int, int] = (60, 56, 52)


@parameters
class VideoParameters:
    """`[outputs.video]`."""

    rate_hz: float = key(30.0, "frames a second of flight", ge=1, le=120)
    chase_rate_hz: float = key(
        15.0, "renderings of the outside view a second of flight", "costs as much as the camera's own pictures", gt=0
    )
    crf: float = key(
        26.5, "rate factor of H.264 (High profile); lower is better", "half the size of ultrafast at 28", ge=1, le=51
    )
    preset: str = key("superfast", "of x264; faster is larger", "the flight waits for the encoder: 9 ms a picture")
    tune: str = key("animation", "of x264: what kind of picture it is", "edges of letters and traces stay sharp")
    verdict_hold_s: float = key(2.5, "the last picture, with the verdict, is shown for so long", ge=0)
    trace_s: float = key(10.0, "span of the traces of the deck's motion", "a period of the deck's roll", gt=0)

    def __post_init__(self) -> None:
        require(0.0 < self.chase_rate_hz <= self.rate_hz, "chase_rate_hz must be in 0 … rate_hz")


class VideoWriter:
    """An MP4 of BGR pictures: H.264 where PyAV is installed and has libx264, else OpenCV's MPEG-4."""

    def __init__(
        self, path: Path, width_px: int, height_px: int, parameters: VideoParameters, key_frames: int = 250
    ) -> None:
        """Open `path`, writing over what was there, with an even width and height; DataError where it cannot be.

        At least every `key_frames`-th picture of H.264 stands for itself.
        """
        with writing(path, "video"):
            path.touch()
        encoder = _H264 if _has_x264() else _Mpeg4
        self._encoder: _H264 | _Mpeg4 = encoder(path, width_px, height_px, parameters, key_frames)
        self._shape = (height_px, width_px, 3)

    def write(self, image: Image, t_s: float) -> None:
        """Append one picture (height, width, 3), at its time after the first."""
        if image.shape != self._shape:
            raise ValueError(f"VideoWriter wants pictures of shape {self._shape}, got {image.shape}")
        self._encoder.write(image, t_s)

    def close(self) -> None:
        """Finish the file."""
        self._encoder.close()


def _has_x264() -> bool:
    if not installed("film"):
        return False
    import av

    return "libx264" in av.codec.codecs_available


class _H264:
    """By PyAV; one encoder thread, so reproducible."""

    def __init__(self, path: Path, width_px: int, height_px: int, parameters: VideoParameters, key_frames: int) -> None:
        import av

        try:
            options = {"movflags": "+faststart", "fflags": "+bitexact"}
            place = str(path.absolute())  # of "12:30/flight.mp4" FFmpeg would take 12 for a protocol
            self._container: av.container.OutputContainer = av.open(place, "w", format="mp4", options=options)
            x264 = {"profile": "high", "preset": parameters.preset, "tune": parameters.tune}
            x264 |= {"crf": str(parameters.crf), "g": str(key_frames), "threads": "1"}
            rate = Fraction(round(parameters.rate_hz * 1000), 1000)
            self._stream = self._container.add_stream("libx264", rate=rate, options=x264)
        except (OSError, av.FFmpegError) as error:
            raise DataError(f"video {path} cannot be written: {error}") from None
        self._stream.width, self._stream.height, self._stream.pix_fmt = width_px, height_px, "yuv420p"
        self._stream.codec_context.thread_count = 1
        # OpenCV's YUV is BT.601, studio range; unsaid, players take wide pictures for BT.709.
        self._stream.codec_context.colorspace, self._stream.codec_context.color_range = 6, 1
        self._stream.time_base = self._stream.codec_context.time_base = _TICK_S
        self._empty = True

    def write(self, image: Image, t_s: float) -> None:
        import av

        yuv = cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420)
        frame = av.VideoFrame.from_ndarray(yuv, format="yuv420p")  # type: ignore[arg-type]
        frame.pts, frame.time_base, self._empty = round(t_s / _TICK_S), _TICK_S, False
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        try:
            if not self._empty:
                self._container.mux(self._stream.encode())
        finally:
            self._container.close()


class _Mpeg4:
    """By OpenCV, at a steady rate: three times as large as H.264, and players show it, browsers do not."""

    def __init__(self, path: Path, width_px: int, height_px: int, parameters: VideoParameters, _: int) -> None:
        codec = cv2.VideoWriter.fourcc(*"mp4v")
        self._writer = cv2.VideoWriter(str(path), codec, parameters.rate_hz, (width_px, height_px))
        if not self._writer.isOpened():
            raise DataError(f"video {path} cannot be written: OpenCV has no encoder for it")
        self.close = self._writer.release

    def write(self, image: Image, t_s: float) -> None:  # noqa: ARG002
        self._writer.write(image)


class FlightVideo:
    """Draws and writes a flight's video in the pace of its exposure times; pictures are held until the next cycle.

    Nothing of the flight is kept but the newest cycle and the deck's motion over `trace_s`.
    """

    def __init__(
        self, path: Path, rig: Rig, camera: Camera, parameters: VideoParameters, chase: Chase | None = None
    ) -> None:
        """Write to `path` from the first frame on; `chase` is called with true and interpolated moments."""
        path.unlink(missing_ok=True)
        self._path, self._rig, self._parameters, self._chase = path, rig, parameters, chase
        self._scale = STRIP_WIDTH_PX / camera.width_px
        self._picture_height_px = 2 * round(0.5 * self._scale * camera.height_px)
        self._instruments = Instruments(with_traces=chase is not None, trace_s=parameters.trace_s)
        height_px = self._picture_height_px + STRIP_HEIGHT_PX
        self._canvas = np.full((height_px, self._instruments.width_px, 3), _BLANK, np.uint8)
        self._writer: VideoWriter | None = None
        self._newest: FlightRecord | None = None
        self._moments = Moments()
        self._start_s, self._ticks = 0.0, 0
        self._chase_due_s = -np.inf
        self._stale = False

    def append(self, record: FlightRecord) -> None:
        """Take a cycle; writes the frames up to it."""
        if self._newest is None:
            self._start_s = record.frame.t_s
        else:
            self._write_until(self._newest, record.frame.t_s, record.truth)
        self._newest = record
        self._moments.note(record)
        self._stale = True

    def finish(self, verdict: TouchdownVerdict | None) -> None:
        """Write the last cycle, hold it with the verdict, and close."""
        if self._newest is not None:
            self._write_until(self._newest, self._newest.frame.t_s + 1.0 / self._parameters.rate_hz, None)
            if verdict is not None:
                draw_verdict(self._picture, verdict)
            for _ in range(round(self._parameters.verdict_hold_s * self._parameters.rate_hz)):
                self._write_canvas()
        self.close()

    def close(self) -> None:
        """Finish the file as it is; more than once does no harm."""
        self._newest = None
        if self._writer is not None:
            writer, self._writer = self._writer, None
            writer.close()

    @property
    def _picture(self) -> Image:
        return self._canvas[: self._picture_height_px, :STRIP_WIDTH_PX]

    def _write_until(self, newest: FlightRecord, end_s: float, next_truth: GroundTruth | None) -> None:
        """Write the frames due before `end_s`, moving the chase view towards the next truth."""
        for truth in (newest.truth, next_truth):
            if truth is not None:
                self._moments.note_truth(truth)
                self._instruments.note(truth.t_s, derive(replace(newest, truth=truth), self._rig))
        while (t_s := self._start_s + self._ticks / self._parameters.rate_hz) < end_s - 1e-6:
            due = t_s >= self._chase_due_s - 1e-6
            moment = newest.truth
            if due and moment is not None and next_truth is not None:
                moment = between(moment, next_truth, t_s)
            if self._stale:
                self._draw_picture(newest)
            if self._stale or due:
                self._draw_instruments(replace(newest, truth=moment), t_s)
            if due and moment is not None:
                self._draw_chase(moment)
                self._chase_due_s = t_s + 1.0 / self._parameters.chase_rate_hz
            self._stale = False
            self._write_canvas()

    def _write_canvas(self) -> None:
        if self._writer is None:
            height_px, width_px = self._canvas.shape[:2]
            self._writer = VideoWriter(self._path, width_px, height_px, self._parameters)
        self._writer.write(self._canvas, self._ticks / self._parameters.rate_hz)
        self._ticks += 1

    def _draw_picture(self, record: FlightRecord) -> None:
        picture, image = self._picture, record.frame.image
        if image is None:
            picture[:] = _BLANK
        else:
            cv2.resize(image, (picture.shape[1], picture.shape[0]), dst=picture, interpolation=cv2.INTER_LINEAR)
        draw_sight(picture, record.observation, self._scale)
        if image is not None:
            draw_zoom(picture, image, record.observation)

    def _draw_chase(self, truth: GroundTruth) -> None:
        if self._chase is None:
            return
        view, image = self._canvas[: self._picture_height_px, STRIP_WIDTH_PX:], self._chase(truth)
        view[:] = image if image.shape == view.shape else cv2.resize(image, (view.shape[1], view.shape[0]))
        view[:, 0] = 0

    def _draw_instruments(self, record: FlightRecord, t_s: float) -> None:
        estimate, truth = self._moments.at(t_s, record.truth)
        places = derive(replace(record, decision=replace(record.decision, estimate=estimate), truth=truth), self._rig)
        self._canvas[self._picture_height_px :] = self._instruments.draw(record, places, t_s)
