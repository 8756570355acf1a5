"""Pictures from outside, decoded on a thread of their own: the newest one only, with its exposure time."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from shipland.config import key, parameters
from shipland.errors import VehicleError
from shipland.extras import require
from shipland.messages import GimbalAttitude, GroundTruth, TouchdownVerdict
from shipland.vehicles.address import without_password
from shipland.vehicles.checks import rate_hz

_WINDOW_S = 10.0
"""Window whose quickest picture gives the difference of the two clocks."""
_LEAST_KNOWN = 10
"""Pictures needed before their median decides which stamps are plausible."""
_LEAST_GATE_S = 0.1
"""Least gate: a stamp that is ahead of the median by less counts as jitter."""
_STEP = 3
"""Consecutive implausible stamps that agree: from this many on, the stream's clock has stepped."""
_DRIFT = 0.002
"""Rate at which a stream's clock may run away from ours; what falls behind faster is a latency that grows."""
_LATEST_S = 1.0
"""A picture that came later than the quickest by more than this is refused: it stood in a queue."""
REFUSED_S = 2.0
"""A source whose pictures are all refused, or broken, for so long is opened again: that empties the queue."""
_REOPEN_S, _LONGEST_REOPEN_S = 0.5, 2.0
"""Time until a source that failed without a picture is opened again, and its largest value after repeated doubling."""
_REOPEN_TIMEOUT_S = 3.0
"""Timeout of the first picture of a source that is opened again; the flight waits."""


@parameters
class StreamParameters:
    """`[camera]`."""

    latency_s: float = key(
        0.2, "from exposure to receipt", "chosen; measure yours: docs/how-to/fly-a-vehicle.md", ge=0, le=3
    )
    open_timeout_s: float = key(10.0, "to the first picture", ge=0.5, le=120)


@dataclass(frozen=True)
class StreamedPicture:
    """One picture as it came.

    Attributes:
        image: (H,W,3) BGR; None where the vision needs none.
        exposed_s: when it was exposed, `time.monotonic` [s].
        arrived_s: when it was received.
        gimbal: the camera's attitude at exposure where the picture brings it, else None.
        truth: where the camera is a simulator's.
    """

    image: npt.NDArray[np.uint8] | None
    exposed_s: float
    arrived_s: float
    gimbal: GimbalAttitude | None = None
    truth: GroundTruth | None = None


class PictureSource(Protocol):
    """Where pictures come from."""

    def pictures(self) -> Iterator[StreamedPicture]:
        """The pictures, from connecting on, each at its receipt; called again to connect again.

        Ends where there will be no more: a recording has been played, a simulated flight is over. Raises VehicleError
        where connecting again may bring more: a camera has stopped.
        """

    def close(self) -> None:
        """Let go, from another thread; `pictures` ends."""

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, from a source that knows it."""
        return None


class CameraStream:
    """Keeps the newest picture of a source, and opens the source again when it fails.

    One that fails before its first picture is not opened again: nothing flies yet, and whoever connects is told at
    once.
    """

    def __init__(self, source: PictureSource) -> None:
        self._source = source
        self._condition = threading.Condition()
        self._newest: StreamedPicture | None = None
        self._arrivals: deque[tuple[float, float]] = deque(maxlen=300)
        self._problem = ""
        self._ended = False
        self.played = False
        """Whether the source has come to its end, as a recording does: nothing is wrong then."""
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    @property
    def problem(self) -> str:
        """Why there are no pictures, in words; empty while there are."""
        return self._problem

    @property
    def rate_hz(self) -> float:
        """Of the pictures' receipt; see `checks.rate_hz`."""
        with self._condition:
            return rate_hz(arrived for arrived, _ in self._arrivals)

    @property
    def age_s(self) -> float:
        """Median age of the pictures at receipt [s]; NaN before the first."""
        with self._condition:
            ages = [arrived - exposed for arrived, exposed in self._arrivals]
        return float(np.median(ages)) if ages else math.nan

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def newest(self, after_s: float, timeout_s: float) -> StreamedPicture | None:
        """The newest picture exposed after a time, waiting for one; None when none comes in time."""
        with self._condition:
            self._condition.wait_for(lambda: self._ended or self._is_newer(after_s), timeout_s)
            return self._newest if self._is_newer(after_s) else None

    def verdict(self) -> TouchdownVerdict | None:
        """See `PictureSource`."""
        return self._source.verdict()

    def close(self) -> None:
        """End."""
        self._source.close()
        with self._condition:
            self._ended = True
            self._condition.notify_all()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def _is_newer(self, after_s: float) -> bool:
        return self._newest is not None and self._newest.exposed_s > after_s

    def _run(self) -> None:
        pause_s = 0.0
        while True:
            begun = self._newest
            over = self._receive()
            pause_s = 0.0 if self._newest is not begun else min(max(2.0 * pause_s, _REOPEN_S), _LONGEST_REOPEN_S)
            with self._condition:
                self._ended = self._ended or over or self._newest is None
                self._condition.notify_all()
                if self._condition.wait_for(lambda: self._ended, pause_s):
                    return

    def _receive(self) -> bool:
        """The pictures of a source that is opened; whether there will be no more."""
        try:
            for shot in self._source.pictures():
                with self._condition:
                    if self._ended:
                        return True
                    self._newest, self._problem = shot, ""
                    self._arrivals.append((shot.arrived_s, shot.exposed_s))
                    self._condition.notify_all()
        except VehicleError as error:
            self._problem = str(error)
        except Exception as error:  # decoders raise many things over a bad line
            self._problem = f"{type(error).__name__}: {error}"
        else:
            self._problem, self.played = "the stream has ended", True
            return True
        return False


class ExposureClock:
    """Exposure times from a stream's own stamps: the quickest picture of a while had the stated latency.

    Without it the jitter of network and decoder would be taken for motion. The offset of the two clocks is receipt
    minus stamp, and no picture is quicker than the quickest: a stamp whose offset lies far below the median's, or that
    goes back, is not used, and its picture is refused. Where such stamps go on and agree with one another the
    stream's clock has stepped, and its offset is found again. The quickest offset rises by the clocks' drift at most:
    pictures that come later and later, as by a decoder that is too slow, are known to be old.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._offsets: deque[tuple[float, float]] = deque()
        self._implausible: deque[tuple[float, float]] = deque(maxlen=_STEP)
        self._quickest: tuple[float, float] = -math.inf, math.inf
        """When it was found, and the least offset of the two clocks."""
        self._stamp_s = self._last_s = -math.inf

    def begin(self) -> None:
        """The stream is opened again: its stamps begin again."""
        self._offsets.clear()
        self._implausible.clear()
        self._quickest = -math.inf, math.inf
        self._stamp_s = -math.inf

    def exposed_s(self, stamp_s: float | None, arrived_s: float) -> float | None:
        """When a picture was exposed; later than the one before, and `latency_s` to `latency_s` + 1 s before receipt.

        Args:
            stamp_s: the stream's time stamp; None where it has none.
            arrived_s: receipt, on our clock.

        Returns:
            The time on our clock; None where the stamp is refused.
        """
        exposed_s = arrived_s - self._latency_s
        if stamp_s is not None and math.isfinite(stamp_s):
            if not self._admits(stamp_s, arrived_s):
                return None
            exposed_s = stamp_s + self._quickest_s(arrived_s) - self._latency_s
            if arrived_s - exposed_s > self._latency_s + _LATEST_S:
                return None
        self._last_s = max(exposed_s, self._last_s + 1e-4)
        return self._last_s

    def _quickest_s(self, arrived_s: float) -> float:
        """The least offset, of the last while or drifted since."""
        found_s, least_s = self._quickest
        late_s = min(offset_s for _, offset_s in self._offsets)
        if math.isfinite(least_s):
            late_s = min(late_s, least_s + _DRIFT * max(0.0, arrived_s - found_s))
        self._quickest = arrived_s, late_s
        return late_s

    def _admits(self, stamp_s: float, arrived_s: float) -> bool:
        """Whether a stamp is plausible by those before, which it then joins."""
        known = arrived_s, arrived_s - stamp_s
        while self._offsets and arrived_s - self._offsets[0][0] > _WINDOW_S:
            self._offsets.popleft()
        if stamp_s < self._stamp_s or self._is_ahead(known[1]):
            self._implausible.append(known)
            implausible_s = [offset_s for _, offset_s in self._implausible]
            if len(implausible_s) < _STEP or max(implausible_s) - min(implausible_s) > _LEAST_GATE_S:
                return False
            self._offsets, self._quickest = deque(self._implausible), (-math.inf, math.inf)
        else:
            self._offsets.append(known)
        self._implausible.clear()
        self._stamp_s = stamp_s
        return True

    def _is_ahead(self, offset_s: float) -> bool:
        """Whether a picture with this offset would have been quicker than the others' jitter allows."""
        if len(self._offsets) < _LEAST_KNOWN:
            return False
        ordered_s = sorted(known_s for _, known_s in self._offsets)
        median_s, quick_s = ordered_s[len(ordered_s) // 2], ordered_s[len(ordered_s) // 10]
        return offset_s < median_s - max(_LEAST_GATE_S, 3.0 * (median_s - quick_s))


def wrong_size(what: str, size_px: tuple[int, int], calibrated_px: tuple[int, int]) -> str:
    """That pictures are not of the size that the calibration is for, in words after `what`; empty where they are."""
    if size_px == calibrated_px:
        return ""
    return "{} of {} × {} px, the calibration is for {} × {}".format(what, *size_px, *calibrated_px)


class VideoSource(PictureSource):
    """A stream, a device or a file by PyAV, or a GStreamer pipeline by OpenCV.

    Args:
        url: `rtsp://…`, `/dev/video0` or its lasting name in `/dev/v4l/by-id/`, a file, or `gst:` and a pipeline that
            ends in an appsink.
        latency_s: from exposure to receipt.
        size_px: width and height that the calibration is for.
        open_timeout_s: to the first picture.
    """

    def __init__(self, url: str, latency_s: float, size_px: tuple[int, int], open_timeout_s: float) -> None:
        self._url, self._size_px, self._timeout_s = url, size_px, open_timeout_s
        self._name = without_password(url)
        self._is_device = url.startswith(("/dev/video", "/dev/v4l/"))
        recorded = "filesrc" in url or url.startswith("file://")
        self._live = not recorded and (self._is_device or url.startswith("gst:") or "://" in url)
        self._clock = ExposureClock(latency_s)
        self._closed = False

    def pictures(self) -> Iterator[StreamedPicture]:
        """See `PictureSource`."""
        self._clock.begin()
        used_s = math.inf
        decoded = self._gstreamer() if self._url.startswith("gst:") else self._decoded()
        for image, stamp_s in decoded:
            arrived_s = time.monotonic()
            height_px, width_px = image.shape[:2]
            if wrong := wrong_size(f"{self._name} gives pictures", (width_px, height_px), self._size_px):
                raise VehicleError(wrong)
            exposed_s = self._clock.exposed_s(stamp_s, arrived_s)
            if exposed_s is not None:
                used_s = arrived_s
                yield StreamedPicture(image, exposed_s, arrived_s)
            elif self._live and arrived_s - used_s > REFUSED_S:
                raise VehicleError(f"camera {self._name}: its pictures come more than {_LATEST_S:g} s late")
            if self._closed:
                return
        if self._live and not self._closed:
            raise VehicleError(f"camera {self._name}: the stream has ended")

    def close(self) -> None:
        """See `PictureSource`."""
        self._closed = True

    def _decoded(self) -> Iterator[tuple[npt.NDArray[np.uint8], float | None]]:
        require("film", f"camera {self._name}", VehicleError)
        import av

        options = {"fflags": "nobuffer", "flags": "low_delay"}
        if self._url.startswith("rtsp://"):
            options |= {"rtsp_transport": "tcp", "max_delay": "0"}
        begun_s, first_s = time.monotonic(), None
        try:
            container = av.open(
                self._url, format="v4l2" if self._is_device else None, options=options, timeout=(self._timeout_s, 2.0)
            )
            self._timeout_s = min(self._timeout_s, _REOPEN_TIMEOUT_S)
            with container:
                if not container.streams.video:
                    raise VehicleError(f"{self._name} holds no video stream")
                stream = container.streams.video[0]
                stream.thread_type = "SLICE"  # frame threads hold pictures back
                for picture in _pictures(container, stream):
                    stamp_s = None if picture.time is None else float(picture.time)
                    if not self._live and stamp_s is not None:  # a file comes at its own pace
                        first_s = stamp_s if first_s is None else first_s
                        time.sleep(max(0.0, begun_s + stamp_s - first_s - time.monotonic()))
                    yield np.asarray(picture.to_ndarray(format="bgr24"), np.uint8), stamp_s
        except (av.error.FFmpegError, OSError) as error:
            raise VehicleError(f"camera {self._name}: {error.strerror or error}") from None

    def _gstreamer(self) -> Iterator[tuple[npt.NDArray[np.uint8], float | None]]:
        import cv2

        capture = cv2.VideoCapture(self._url.removeprefix("gst:"), cv2.CAP_GSTREAMER)
        if not capture.isOpened():
            raise VehicleError(
                f"camera {self._name}: the pipeline does not run; it must end in an appsink, and OpenCV must be built "
                "with GStreamer (the pip package is not: use the distribution's python3-opencv)"
            )
        try:
            while not self._closed:
                ok, image = capture.read()
                if not ok:
                    return
                if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
                    got = f"{image.shape} {image.dtype}"
                    raise VehicleError(f"camera {self._name}: gives {got}; end it in video/x-raw,format=BGR ! appsink")
                yield np.asarray(image, np.uint8), None
        finally:
            capture.release()


def _pictures(container: Any, stream: Any) -> Iterator[Any]:  # noqa: ANN401 - PyAV is imported where it is used
    """The pictures of a stream; one that cannot be decoded costs itself, until for `REFUSED_S` none can."""
    from av.error import InvalidDataError

    decoded_s = time.monotonic()
    for packet in container.demux(stream):
        try:
            pictures = packet.decode()
        except InvalidDataError:
            if time.monotonic() - decoded_s > REFUSED_S:
                raise
            continue
        for picture in pictures:
            yield picture
            decoded_s = time.monotonic()
