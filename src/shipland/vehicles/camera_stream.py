"""Pictures from outside, decoded on a thread of their own: the newest one only, with its exposure time."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from shipland.config import require_within
from shipland.errors import VehicleError
from shipland.messages import GimbalAttitude, GroundTruth, TouchdownVerdict

_WINDOW_S = 10.0
"""In which the quickest picture tells the difference of the two clocks."""


@dataclass(frozen=True)
class StreamParameters:
    """`[camera]` of vehicles.toml.

    Attributes:
        latency_s: from exposure to receipt.
        open_timeout_s: to the first picture.
    """

    latency_s: float
    open_timeout_s: float

    def __post_init__(self) -> None:
        require_within(self, latency_s=(0.0, 3.0), open_timeout_s=(0.5, 120.0))


@dataclass(frozen=True)
class Shot:
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

    def pictures(self) -> Iterator[Shot]:
        """The pictures, from connecting on, each at its receipt; ends or raises VehicleError when there are no more."""

    def close(self) -> None:
        """Let go, from another thread; `pictures` ends."""

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, from a source that knows it."""


class CameraStream:
    """Keeps the newest picture of a source.

    Args:
        source: where the pictures come from.
    """

    def __init__(self, source: PictureSource) -> None:
        self._source = source
        self._condition = threading.Condition()
        self._newest: Shot | None = None
        self._arrivals: deque[tuple[float, float]] = deque(maxlen=300)
        self._problem = ""
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    @property
    def problem(self) -> str:
        """Why there are no more pictures, in words; empty while there are."""
        return self._problem

    @property
    def rate_hz(self) -> float:
        """Pictures a second of late; 0 before two have come."""
        with self._condition:
            arrivals = [arrived for arrived, _ in self._arrivals]
        span_s = arrivals[-1] - arrivals[0] if len(arrivals) > 1 else 0.0
        return (len(arrivals) - 1) / span_s if span_s > 0.0 else 0.0

    @property
    def age_s(self) -> float:
        """Median age of the pictures at receipt [s]; NaN before the first."""
        with self._condition:
            ages = [arrived - exposed for arrived, exposed in self._arrivals]
        return float(np.median(ages)) if ages else math.nan

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def newest(self, after_s: float, timeout_s: float) -> Shot | None:
        """The newest picture exposed after a time, waiting for one; None when none comes in time.

        Args:
            after_s: exposure time of the picture that is known.
            timeout_s: how long to wait.
        """
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
        try:
            for shot in self._source.pictures():
                with self._condition:
                    if self._ended:
                        return
                    self._newest = shot
                    self._arrivals.append((shot.arrived_s, shot.exposed_s))
                    self._condition.notify_all()
            self._problem = "the stream has ended"
        except VehicleError as error:
            self._problem = str(error)
        except Exception as error:  # decoders raise many things over a bad line
            self._problem = f"{type(error).__name__}: {error}"
        with self._condition:
            self._ended = True
            self._condition.notify_all()


class ExposureClock:
    """Exposure times from a stream's own stamps: the quickest picture of a while had the stated latency.

    Without it the jitter of network and decoder would be taken for motion.

    Args:
        latency_s: from exposure to receipt, of the quickest picture.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._offsets: deque[tuple[float, float]] = deque()
        self._last_s = -math.inf

    def exposed_s(self, stamp_s: float | None, arrived_s: float) -> float:
        """When a picture was exposed; later than the one before.

        Args:
            stamp_s: the stream's time stamp; None where it has none.
            arrived_s: receipt, on our clock.
        """
        exposed_s = arrived_s - self._latency_s
        if stamp_s is not None and math.isfinite(stamp_s):
            offset_s = arrived_s - stamp_s
            if self._offsets and abs(offset_s - self._offsets[-1][1]) > _WINDOW_S:
                self._offsets.clear()  # the stream began anew
            while self._offsets and arrived_s - self._offsets[0][0] > _WINDOW_S:
                self._offsets.popleft()
            self._offsets.append((arrived_s, offset_s))
            exposed_s = stamp_s + min(offset for _, offset in self._offsets) - self._latency_s
        self._last_s = max(exposed_s, self._last_s + 1e-4)
        return self._last_s


class VideoSource:
    """A stream, a device or a file by PyAV, or a GStreamer pipeline by OpenCV.

    Args:
        url: `rtsp://…`, `/dev/video0`, a file, or `gst:` and a pipeline that ends in an appsink.
        latency_s: from exposure to receipt.
        size_px: width and height that the calibration is for.
        open_timeout_s: to the first picture.
    """

    def __init__(self, url: str, latency_s: float, size_px: tuple[int, int], open_timeout_s: float) -> None:
        self._url, self._size_px, self._timeout_s = url, size_px, open_timeout_s
        self._clock = ExposureClock(latency_s)
        self._closed = False

    def pictures(self) -> Iterator[Shot]:
        """See `PictureSource`."""
        decoded = self._gstreamer() if self._url.startswith("gst:") else self._decoded()
        for image, stamp_s in decoded:
            arrived_s = time.monotonic()
            height_px, width_px = image.shape[:2]
            if (width_px, height_px) != self._size_px:
                wide, tall = self._size_px
                raise VehicleError(
                    f"{self._url} gives pictures of {width_px} × {height_px} px, the calibration is for {wide} × {tall}"
                )
            yield Shot(image, self._clock.exposed_s(stamp_s, arrived_s), arrived_s)
            if self._closed:
                return

    def close(self) -> None:
        """See `PictureSource`."""
        self._closed = True

    def verdict(self) -> TouchdownVerdict | None:
        """Nobody knows."""
        return None

    def _decoded(self) -> Iterator[tuple[npt.NDArray[np.uint8], float | None]]:
        import av

        device = self._url.startswith("/dev/video")
        options = {"fflags": "nobuffer", "flags": "low_delay"}
        if self._url.startswith("rtsp://"):
            options |= {"rtsp_transport": "tcp", "max_delay": "0"}
        live = device or "://" in self._url
        begun_s, first_s = time.monotonic(), None
        try:
            container = av.open(
                self._url, format="v4l2" if device else None, options=options, timeout=(self._timeout_s, 2.0)
            )
            with container:
                if not container.streams.video:
                    raise VehicleError(f"{self._url} holds no video stream")
                stream = container.streams.video[0]
                stream.thread_type = "SLICE"  # frame threads hold pictures back
                for picture in container.decode(stream):
                    stamp_s = None if picture.time is None else float(picture.time)
                    if not live and stamp_s is not None:  # a file comes at its own pace
                        first_s = stamp_s if first_s is None else first_s
                        time.sleep(max(0.0, begun_s + stamp_s - first_s - time.monotonic()))
                    yield np.asarray(picture.to_ndarray(format="bgr24"), np.uint8), stamp_s
        except (av.error.FFmpegError, OSError) as error:
            raise VehicleError(f"camera {self._url}: {error.strerror or error}") from None

    def _gstreamer(self) -> Iterator[tuple[npt.NDArray[np.uint8], float | None]]:
        import cv2

        capture = cv2.VideoCapture(self._url.removeprefix("gst:"), cv2.CAP_GSTREAMER)
        if not capture.isOpened():
            raise VehicleError(
                f"camera {self._url}: the pipeline does not run; it must end in an appsink, and OpenCV must be built "
                "with GStreamer (the pip package is not: use the distribution's python3-opencv)"
            )
        try:
            while not self._closed:
                ok, image = capture.read()
                if not ok:
                    return
                yield np.asarray(image, np.uint8), None
        finally:
            capture.release()
