"""Pictures of a ROS 2 topic: whose stamps are believed, and what is said of those that are not."""

import time
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra ros2")

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.vehicles.camera_stream import StreamedPicture
from shipland.vehicles.ros2 import pictures
from shipland.vehicles.ros2.image_messages import image_message

CAMERA = Camera.from_fov(64, 36, 69.0)
PICTURE = np.zeros((36, 64, 3), np.uint8)
COUNT = 100


class OverError(Exception):
    """All pictures have come."""


def streamed(monkeypatch: pytest.MonkeyPatch, rate: float) -> Iterator[StreamedPicture]:
    """Of pictures that come ten a second, by a camera whose clock runs at `rate`; at 0 it does not stamp."""
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(pictures, "time", SimpleNamespace(monotonic=lambda: now.s, time=time.time))

    def camera() -> Camera:
        """Asked for once a picture: the next has come."""
        now.s += 0.1
        if now.s > 100.0 + 0.1 * COUNT:
            raise OverError
        topic.take(image_message(PICTURE, rate * now.s, "camera"))
        return CAMERA

    topic = pictures.TopicPictures(camera, latency_s=0.1)
    return topic.pictures()


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_with_a_stated_latency_pictures_without_a_stamp_are_as_good(
    rate: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ROS's word for no stamp is zero, which is no clock that stands still."""
    ages_s: list[float] = []
    with pytest.raises(OverError):
        for shot in streamed(monkeypatch, rate):
            ages_s.append(shot.arrived_s - shot.exposed_s)  # noqa: PERF401 - those before the end are kept
    assert ages_s == pytest.approx([0.1] * (COUNT - 1), abs=1e-6)


def test_pictures_that_come_ever_later_are_said_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a simulator that runs at half the speed of ours."""
    with pytest.raises(VehicleError, match="they come ever later"):
        list(streamed(monkeypatch, 0.5))
