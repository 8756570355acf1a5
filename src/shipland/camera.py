"""The pinhole camera with OpenCV's distortion: project and back-project.

OpenCV is imported where a lens distorts alone: a flight with the geometric camera does without its 33 MB.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from shipland.config import key, parameters, require
from shipland.errors import DataError
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose, rotation_from_euler
from shipland.messages import GimbalAttitude


@parameters
class CameraParameters:
    """What `configs/*.toml` says of a camera in section `[camera]`."""

    width_px: int = key(1280, "of the picture", "[Lee2022]: 720p stream", ge=16)
    height_px: int = key(720, "of the picture", "[Lee2022]: 720p stream", ge=16)
    horizontal_fov_deg: float = key(
        69.0, "full horizontal field of view", "Parrot ANAFI data sheet, video mode", gt=0, lt=170
    )
    frame_rate_hz: float = key(30.0, "pictures a second", "Parrot ANAFI stream", gt=0)
    position_in_body_m: tuple[float, float, float] = key(
        (0.09, 0.0, 0.0), "optical centre in `body`", "chosen: the gimbal sits at the nose"
    )
    gimbal_rate_rad_s: float = key(3.14, "largest rate of the gimbal's pitch", "Parrot ANAFI data sheet: 180°/s", gt=0)
    gimbal_min_rad: float = key(
        -1.5708, "lowest pitch of the gimbal against the horizon", "Parrot ANAFI data sheet: ±90°"
    )
    gimbal_max_rad: float = key(
        1.5708, "highest pitch of the gimbal against the horizon", "Parrot ANAFI data sheet: ±90°"
    )
    gimbal_noise_rad: float = key(
        0.0009, "standard deviation of what stabilisation leaves in roll and pitch", "chosen: 0.05°", ge=0
    )
    gimbal_bias_rad: float = key(
        0.0004, "error of roll and pitch that stays for a flight", "chosen: trimmed; untrimmed has ten times that", ge=0
    )

    def __post_init__(self) -> None:
        require(self.gimbal_min_rad < self.gimbal_max_rad, "gimbal_min_rad must be below gimbal_max_rad")


_LONGEST_READ_OUT_S = 0.2
"""Longest read-out of a shutter [s]; a larger value was given in another unit."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics.

    Attributes:
        width_px, height_px: picture size.
        matrix: (3,3) OpenCV camera matrix [px]; pixel centres at whole numbers.
        distortion: (k,) OpenCV coefficients, k of 4, 5, 8, 12 or 14; zeros for none.
        row_time_s: from the exposure of one row to that of the next, as a rolling shutter reads them from the top; 0
            for a camera that exposes all rows at once. A picture's time is that of its middle row.
    """

    width_px: int
    height_px: int
    matrix: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))
    row_time_s: float = 0.0

    def __post_init__(self) -> None:
        if not (1 <= self.width_px < 65536 and 1 <= self.height_px < 65536):
            raise ValueError(f"Camera wants a picture of 1 to 65535 px a side, got {self.width_px} × {self.height_px}")
        if np.shape(self.matrix) != (3, 3):
            raise ValueError(f"Camera.matrix wants shape (3, 3), got {np.shape(self.matrix)}")
        if self.distortion.ndim != 1 or self.distortion.size not in (4, 5, 8, 12, 14):
            raise ValueError(f"Camera.distortion wants 4, 5, 8, 12 or 14 values, got {np.shape(self.distortion)}")
        if not (np.isfinite(self.matrix).all() and np.isfinite(self.distortion).all()):
            raise ValueError("Camera wants finite intrinsics")
        if not 0.0 <= self.row_time_s * self.height_px <= _LONGEST_READ_OUT_S:
            raise ValueError(
                f"Camera.row_time_s is the time from one row to the next: expected 0 to "
                f"{_LONGEST_READ_OUT_S / self.height_px:.2g} s at {self.height_px} rows, got {self.row_time_s}"
            )
        if self.matrix[0, 0] <= 0.0 or self.matrix[1, 1] <= 0.0:
            raise ValueError(f"Camera wants positive focal lengths, got {self.matrix[0, 0]}, {self.matrix[1, 1]}")
        if self.matrix[1, 0] != 0.0 or list(self.matrix[2]) != [0.0, 0.0, 1.0]:
            raise ValueError(
                f"Camera.matrix wants the form [[fx, s, cx], [0, fy, cy], [0, 0, 1]], got {self.matrix.tolist()}"
            )

    @staticmethod
    def from_fov(width_px: int, height_px: int, horizontal_fov_deg: float) -> Camera:
        """Distortion-free camera with square pixels and the principal point in the picture's middle."""
        focal_px = 0.5 * width_px / np.tan(0.5 * np.radians(horizontal_fov_deg))
        matrix = np.array(
            [[focal_px, 0.0, 0.5 * (width_px - 1)], [0.0, focal_px, 0.5 * (height_px - 1)], [0.0, 0.0, 1.0]]
        )
        return Camera(width_px, height_px, matrix)

    @staticmethod
    def from_parameters(parameters: CameraParameters) -> Camera:
        """The ideal camera of a configuration."""
        return Camera.from_fov(parameters.width_px, parameters.height_px, parameters.horizontal_fov_deg)

    @property
    def focal_px(self) -> float:
        """Mean focal length [px]."""
        return float(0.5 * (self.matrix[0, 0] + self.matrix[1, 1]))

    @cached_property
    def has_distortion(self) -> bool:
        """Whether any coefficient is not zero."""
        return bool(np.any(self.distortion))

    def project(self, points_in_camera_m: Array) -> Array:
        """Pixels (n,2) of points (n,3) in `camera` [m]; NaN for points not in front of the camera.

        OpenCV's distortion holds inside the field of view only: points far outside it may fold back into the picture.
        """
        points = np.asarray(points_in_camera_m, dtype=float).reshape(-1, 3)
        pixels = np.full((len(points), 2), np.nan)
        front = points[:, 2] > 1e-9
        if front.any():
            pixels[front] = self._pixels(points[front])
        return pixels

    def _pixels(self, points: Array) -> Array:
        if not self.has_distortion:
            in_plane = points[:, :2] * (1.0 / points[:, 2:])
            return np.asarray(in_plane * self.matrix.diagonal()[:2] + self.matrix[:2, 2])
        import cv2

        pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), self.matrix, self.distortion)
        return np.asarray(pixels, dtype=float).reshape(-1, 2)

    def undistort(self, pixels: Array) -> Array:
        """Pixels (n,2) as a distortion-free camera with the same matrix would see them."""
        points = np.asarray(pixels, dtype=float).reshape(-1, 2)
        if not self.has_distortion or not len(points):
            return points
        import cv2

        # cv2.undistortPoints stops after five iterations: 0.7 px short in a wide lens's corners.
        until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
        undistorted = cv2.undistortPointsIter(
            points.reshape(-1, 1, 2), self.matrix, self.distortion, np.eye(3), self.matrix, until
        )
        return np.asarray(undistorted, dtype=float).reshape(-1, 2)

    def back_project(self, pixels: Array) -> Array:
        """Unit rays (n,3) in `camera` through pixels (n,2)."""
        undistorted = self.undistort(pixels)
        homogeneous = np.column_stack([undistorted, np.ones(len(undistorted))])
        rays = homogeneous @ np.linalg.inv(self.matrix).T
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def for_pictures(self, name: str, width_px: int, height_px: int) -> Camera:
        """Of pictures of another size and the same aspect; DataError for another aspect, with the pictures' name."""
        if (width_px, height_px) == (self.width_px, self.height_px):
            return self
        if abs(width_px * self.height_px / self.width_px - height_px) > 1.0:
            raise DataError(
                f"{name} is {width_px} × {height_px} px, the calibration is for {self.width_px} × {self.height_px} px; "
                "expected that size or the same aspect; give its own with --calibration (see `shipland calibrate`)"
            )
        return self.scaled(width_px, height_px)

    def scaled(self, width_px: int, height_px: int) -> Camera:
        """The same camera at another picture size of the same aspect."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        matrix = self.matrix.copy()
        matrix[0] *= sx
        matrix[1] *= sy
        matrix[0, 2] += 0.5 * (sx - 1.0)
        matrix[1, 2] += 0.5 * (sy - 1.0)
        return Camera(width_px, height_px, matrix, self.distortion, self.row_time_s / sy)

    @property
    def digest(self) -> str:
        """First 16 hex digits of the SHA-256 of its numbers, by which a damaged calibration file is known."""
        numbers = [self.width_px, self.height_px, *self.matrix.ravel(), *self.distortion, self.row_time_s]
        return hashlib.sha256((np.array(numbers, "<f8") + 0.0).tobytes()).hexdigest()[:16]


def level_from_camera(gimbal: GimbalAttitude) -> Array:
    """Rotation (3,3) from `camera` to `level` for a gimbal attitude."""
    return rotation_from_euler(gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad) @ CAMERA_FROM_MOUNT.T


def camera_pose(ned_from_body: Pose, heading_rad: float, gimbal: GimbalAttitude, camera_in_body_m: Array) -> Pose:
    """ned_from_camera: the optical centre is carried by the body, the attitude by the gimbal."""
    rotation = rotation_from_euler(0.0, 0.0, heading_rad) @ level_from_camera(gimbal)
    return Pose(rotation, ned_from_body.apply(camera_in_body_m))
