"""Pictures and intrinsics as ROS 2 messages."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from shipland.calibration_file import PINHOLE
from shipland.camera import Camera
from shipland.errors import DataError
from shipland.vehicles.ros2.conversions import header
from shipland.vehicles.ros2.types import Message, message

_SAME_LENS = 0.0025
"""Largest difference of one lens, of the picture's width: 0.5 % of a distance, as much as a calibration is good for."""


def camera_info(camera: Camera, t_s: float, frame: str) -> Message:
    """sensor_msgs/CameraInfo; coefficients past the eighth (thin prism, tilt) have no place there."""
    k = camera.distortion.tolist()
    model = "plumb_bob" if len(k) <= 5 else "rational_polynomial"
    return message(
        "sensor_msgs/msg/CameraInfo",
        header=header(t_s, frame),
        width=camera.width_px,
        height=camera.height_px,
        distortion_model=model,
        d=np.array([*k, 0.0][:5] if len(k) <= 5 else k[:8]),
        k=camera.matrix.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([camera.matrix, np.zeros(3)]).ravel(),
    )


def camera_of(info: Message, topic: str = "") -> Camera:
    """Intrinsics of a CameraInfo, for the pictures of a topic; image_proc's rectified ones have P and no distortion.

    Raises:
        DataError: it is not calibrated, or of a model that OpenCV's pinhole has not.
    """
    rectified = any(part.startswith("image_rect") for part in topic.split("/"))
    if not rectified and info.distortion_model not in ("", *PINHOLE):
        raise DataError(
            f"camera_info: distortion model {info.distortion_model!r}; expected one of {', '.join(PINHOLE)}"
        )
    matrix = np.array(info.p, float).reshape(3, 4)[:, :3] if rectified else np.array(info.k, float).reshape(3, 3)
    if not matrix.any():
        name = "P" if rectified else "K"
        raise DataError(f"camera_info says that the camera is not calibrated: {name} is zero; give --calibration FILE")
    distortion = np.zeros(5) if rectified or not len(info.d) else np.array(info.d, dtype=float)
    try:
        return Camera(int(info.width), int(info.height), matrix, distortion)
    except ValueError as error:
        raise DataError(f"camera_info: {error}") from None


def same_lens(camera: Camera, other: Camera) -> bool:
    """Whether pictures of the other may be measured with these intrinsics: by what differs over the whole picture."""
    width_px, height_px = camera.width_px, camera.height_px
    if (width_px, height_px) != (other.width_px, other.height_px):
        return False
    across, down = np.meshgrid(np.linspace(0.0, width_px - 1.0, 5), np.linspace(0.0, height_px - 1.0, 5))
    pixels = np.column_stack([across.ravel(), down.ravel()])
    moved_px = other.project(camera.back_project(pixels)) - pixels
    return bool(np.all(np.hypot(*moved_px.T) <= _SAME_LENS * width_px))  # NaN, of no pixel, is not


def image_message(image: npt.NDArray[np.uint8], t_s: float, frame: str) -> Message:
    """sensor_msgs/Image, bgr8."""
    height_px, width_px, _ = image.shape
    return message(
        "sensor_msgs/msg/Image",
        header=header(t_s, frame),
        height=height_px,
        width=width_px,
        encoding="bgr8",
        step=3 * width_px,
        data=np.ascontiguousarray(image).ravel(),
    )


def jpeg_message(image: npt.NDArray[np.uint8], t_s: float, frame: str) -> Message:
    """sensor_msgs/CompressedImage, as image_transport's `compressed` with its default quality."""
    _, data = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, 95))
    return message(
        "sensor_msgs/msg/CompressedImage", header=header(t_s, frame), format="bgr8; jpeg compressed bgr8", data=data
    )


_CHANNELS = {"bgr8": (3, None), "rgb8": (3, cv2.COLOR_RGB2BGR), "mono8": (1, cv2.COLOR_GRAY2BGR),
             "8UC3": (3, None), "bgra8": (4, cv2.COLOR_BGRA2BGR), "rgba8": (4, cv2.COLOR_RGBA2BGR)}  # fmt: skip
"""Channels of an encoding, and how they become BGR."""


def image_of(picture: Message) -> npt.NDArray[np.uint8]:
    """(H,W,3) BGR of an Image or a CompressedImage; DataError when it is neither whole nor of a known encoding."""
    if picture.__msgtype__ == "sensor_msgs/msg/CompressedImage":
        data = np.frombuffer(picture.data, np.uint8)
        decoded = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
        if decoded is None:
            raise DataError(f"a compressed picture ({picture.format!r}) cannot be decoded")
        return np.asarray(decoded, np.uint8)
    if picture.encoding not in _CHANNELS:
        raise DataError(f"pictures are {picture.encoding!r}; expected one of {', '.join(_CHANNELS)}")
    channels, conversion = _CHANNELS[picture.encoding]
    least_step_b = max(picture.width, 1) * channels
    if picture.step < least_step_b or len(picture.data) < picture.step * max(picture.height, 1):
        raise DataError(f"a picture of {picture.width} × {picture.height} px came with {len(picture.data)} bytes")
    rows = np.asarray(picture.data, np.uint8)[: picture.step * picture.height].reshape(picture.height, picture.step)
    pixels = rows[:, : picture.width * channels].reshape(picture.height, picture.width, channels)
    return (
        np.ascontiguousarray(pixels) if conversion is None else np.asarray(cv2.cvtColor(pixels, conversion), np.uint8)
    )
