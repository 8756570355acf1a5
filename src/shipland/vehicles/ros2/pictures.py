"""Pictures of a ROS 2 topic, with their exposure on our clock."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from shipland.camera import Camera
from shipland.errors import DataError, VehicleError
from shipland.vehicles.camera_stream import REFUSED_S, ExposureClock, PictureSource, StreamedPicture, wrong_size
from shipland.vehicles.ros2.conversions import seconds
from shipland.vehicles.ros2.image_messages import image_of
from shipland.vehicles.ros2.types import Message

_OLDEST_S, _AHEAD_S = 1.0, 0.05
"""A stamp that is older, or further ahead, is of another clock than ours."""
_WOKEN_S = 0.2


def image_kind(topic: str) -> str:
    """Type of a picture's topic, by image_transport's names."""
    return "sensor_msgs/msg/CompressedImage" if topic.endswith("/compressed") else "sensor_msgs/msg/Image"


def ours_s(stamp_s: float) -> float | None:
    """A stamp (`time.time`) on `time.monotonic` [s]; None where it is of another clock."""
    age_s = time.time() - stamp_s
    return time.monotonic() - max(age_s, 0.0) if -_AHEAD_S <= age_s <= _OLDEST_S else None


class TopicPictures(PictureSource):
    """A `PictureSource` that is fed from the node's thread by `take`.

    Args:
        camera: intrinsics that the pictures must fit, once known; raises VehicleError where they do not fit any more.
        latency_s: stated, where the stamps are of another clock than ours.
    """

    def __init__(self, camera: Callable[[], Camera | None], latency_s: float | None) -> None:
        self._camera = camera
        self._clock = None if latency_s is None else ExposureClock(latency_s)
        self._changed = threading.Condition()
        self._newest: tuple[Any, float] | None = None
        self._closed = False
        self.frame_id = "camera"
        """The optical frame that the pictures name."""

    def take(self, picture: Message) -> None:
        """A picture has come; one that was not looked at yet is left out."""
        with self._changed:
            self._newest = picture, time.monotonic()
            self._changed.notify_all()

    def pictures(self) -> Iterator[StreamedPicture]:
        """See `PictureSource`."""
        used_s = math.inf
        while not self._closed:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._newest is not None, _WOKEN_S)
                newest, self._newest = self._newest, None
            camera = self._camera()
            if newest is None or camera is None:
                continue
            picture, arrived_s = newest
            exposed_s = self._exposed_s(seconds(picture.header.stamp), arrived_s)
            if exposed_s is None:
                if arrived_s - used_s > REFUSED_S:
                    raise VehicleError(
                        "pictures are refused: by their stamps they come ever later (a queue, a slower clock), or jump"
                    )
                continue
            used_s = arrived_s
            try:
                image = image_of(picture)
            except DataError as error:
                raise VehicleError(str(error)) from None
            height_px, width_px, _ = image.shape
            if wrong := wrong_size("pictures are", (width_px, height_px), (camera.width_px, camera.height_px)):
                raise VehicleError(wrong)
            self.frame_id = picture.header.frame_id or self.frame_id
            yield StreamedPicture(image, exposed_s, arrived_s)

    def close(self) -> None:
        """See `PictureSource`."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _exposed_s(self, stamp_s: float, arrived_s: float) -> float | None:
        if self._clock is not None:
            return self._clock.exposed_s(stamp_s or None, arrived_s)  # zero is ROS's word for none
        exposed_s = ours_s(stamp_s)
        if exposed_s is None:
            raise VehicleError(
                f"pictures are stamped {time.time() - stamp_s:+.2f} s ago by this machine's clock: synchronise the "
                "clocks (chrony, PTP), or state ?latency_s= of the camera"
            )
        return exposed_s
