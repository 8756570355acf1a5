"""Camera calibration files of others: OpenCV's, and what ROS's camera_calibration writes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.frames import Array

_PINHOLE = ("plumb_bob", "radtan", "rational_polynomial")
"""Names of the distortion that `Camera` has: OpenCV's of a pinhole camera."""
_MODEL = re.compile(r'\bdistortion_model"?\s*[:>]\s*"?([\w-]+)')
_FISHEYE = re.compile(r'\bfisheye_model"?\s*[:>]\s*"?([1-9]|true)')


def read_calibration(path: Path) -> Camera:
    """The camera of a calibration file, OpenCV's (YAML, XML, JSON) or ROS's (YAML with `distortion_model`).

    Raises:
        DataError: the file is missing or broken, lacks something, or is of a fisheye's distortion.
    """
    text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    model = _MODEL.search(text)
    if _FISHEYE.search(text) or (model and model[1] not in _PINHOLE):
        raise DataError(
            f"calibration file {path} is of distortion model {model[1] if model else 'fisheye'}, expected one of "
            f"{', '.join(_PINHOLE)}: calibrate as a pinhole camera, or undistort the pictures before"
        )
    if model is None or not re.match(r"\w+:", text):
        return Camera.from_opencv_yaml(path)
    return _from_ros(path, text)


def _from_ros(path: Path, text: str) -> Camera:
    import cv2

    def numbers(name: str) -> Array:
        data = storage.getNode(name).getNode("data")
        return np.array([data.at(index).real() for index in range(data.size())])

    try:
        storage = cv2.FileStorage(f"%YAML:1.0\n---\n{text}", cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        width, height = storage.getNode("image_width"), storage.getNode("image_height")
        matrix = numbers("camera_matrix")
        if len(matrix) != 9 or not (width.isInt() and height.isInt()):
            raise DataError(f"calibration file {path} lacks nine numbers of camera_matrix, or a whole size")
        size_px = int(width.real()), int(height.real())
        return Camera(*size_px, matrix.reshape(3, 3), numbers("distortion_coefficients"))
    except ValueError as error:
        raise DataError(f"calibration file {path} cannot be used: {error}") from None
    except (cv2.error, SystemError):
        raise DataError(f"calibration file {path} is no YAML of ROS's camera_calibration") from None
