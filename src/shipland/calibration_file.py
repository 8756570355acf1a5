"""Camera calibration files: OpenCV's, read and written, and what ROS's camera_calibration writes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.frames import Array

PINHOLE = ("plumb_bob", "radtan", "rational_polynomial")
"""Names of the distortion that `Camera` has: OpenCV's of a pinhole camera."""
_MODEL = re.compile(r'\bdistortion_model"?\s*[:>]\s*"?([\w-]+)')
_FISHEYE = re.compile(r'\bfisheye_model"?\s*[:>]\s*"?([1-9]|true)')


def read_calibration(path: Path) -> Camera:
    """The camera of a calibration file, OpenCV's (YAML, XML, JSON) or ROS's (YAML with `distortion_model`).

    OpenCV's holds `camera_matrix`, `distortion_coefficients`, `image_width` and `image_height`. OpenCV knows no
    `row_time_s`: a line of that name gives it, in seconds. A line `digest`, as `write_calibration` writes it, must be
    that of the numbers.

    Raises:
        DataError: the file is missing or broken, lacks something, is of a fisheye's distortion, or its digest is
            another's.
    """
    import cv2

    if not path.is_file():
        raise DataError(f"calibration file {path} {'is a folder' if path.is_dir() else 'does not exist'}")
    text = path.read_text(encoding="utf-8", errors="replace")
    if "\0" in text:  # at which OpenCV stops reading, and takes what came before for the whole
        raise DataError(f"calibration file {path} is not an OpenCV YAML, XML or JSON file: it holds a zero byte")
    model = _MODEL.search(text)
    if _FISHEYE.search(text) or (model and model[1] not in PINHOLE):
        raise DataError(
            f"calibration file {path} is of distortion model {model[1] if model else 'fisheye'}, expected one of "
            f"{', '.join(PINHOLE)}: calibrate as a pinhole camera, or undistort the pictures before"
        )
    of_ros = model is not None and re.match(r"\w+:", text) is not None
    kind = "a YAML of ROS's camera_calibration" if of_ros else "an OpenCV YAML, XML or JSON file"
    source, flags = str(path), cv2.FILE_STORAGE_READ
    if of_ros:
        source, flags = f"%YAML:1.0\n---\n{text}", flags | cv2.FILE_STORAGE_MEMORY
    try:
        return _camera(cv2.FileStorage(source, flags), path, _listed if of_ros else _opencv_matrix)
    except ValueError as error:
        raise DataError(f"calibration file {path} cannot be used: {error}") from None
    except (cv2.error, SystemError):  # OpenCV's own words name its source files, not the fault
        said = "" if of_ros else " with camera_matrix and distortion_coefficients as opencv-matrix"
        raise DataError(f"calibration file {path} is not {kind}{said}") from None


def _camera(storage: Any, path: Path, numbers: Callable[[Any], Array | None]) -> Camera:  # noqa: ANN401 - OpenCV's
    matrix, distortion = numbers(storage.getNode("camera_matrix")), numbers(storage.getNode("distortion_coefficients"))
    width, height = storage.getNode("image_width"), storage.getNode("image_height")
    if matrix is None or not (width.isInt() and height.isInt()):
        raise DataError(f"calibration file {path} lacks camera_matrix, or whole image_width and image_height")
    coefficients = np.zeros(5) if distortion is None else distortion.ravel()
    row_time = storage.getNode("row_time_s")
    row_time_s = 0.0 if row_time.empty() else float(row_time.real())
    camera = Camera(int(width.real()), int(height.real()), matrix, coefficients, row_time_s)
    digest = storage.getNode("digest")
    if not digest.empty() and digest.string() != camera.digest:
        raise DataError(
            f"calibration file {path} is not as it was written: its numbers do not have its digest; copy it again, or "
            "take out the line 'digest' if you changed them"
        )
    return camera


def _opencv_matrix(node: Any) -> Array | None:  # noqa: ANN401 - OpenCV's
    found = node.mat()
    return None if found is None else np.asarray(found, dtype=float)


def _listed(node: Any) -> Array:  # noqa: ANN401 - OpenCV's
    """A matrix of ROS: rows, columns and a plain list."""
    rows, columns, data = (node.getNode(name) for name in ("rows", "cols", "data"))
    if data.size() != rows.real() * columns.real():
        raise ValueError(f"{node.name()} has {data.size()} numbers, expected {rows.real():g} × {columns.real():g}")
    return np.array([data.at(i).real() for i in range(data.size())]).reshape(int(rows.real()), int(columns.real()))


def write_calibration(camera: Camera, path: Path) -> None:
    """Write an OpenCV calibration file, with a digest of its numbers; DataError when it cannot be written."""
    import cv2

    if not path.parent.is_dir():
        raise DataError(f"calibration file {path} cannot be written: its folder does not exist")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if not storage.isOpened():
        raise DataError(f"calibration file {path} cannot be written")
    storage.write("image_width", camera.width_px)
    storage.write("image_height", camera.height_px)
    storage.write("camera_matrix", camera.matrix)
    storage.write("distortion_coefficients", camera.distortion.reshape(1, -1))
    if camera.row_time_s > 0.0:
        storage.write("row_time_s", camera.row_time_s)
    storage.write("digest", camera.digest)
    storage.release()
