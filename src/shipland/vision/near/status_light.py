"""The ship's status light, read where the cue's pose says that it is: red means that the ship waves off."""

from __future__ import annotations

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.cue import Polygon
from shipland.frames import Pose
from shipland.vision.near.segment import Image

_INNER = 0.7
"""Share of its side that is read: the rim mixes with the board."""
_LEAST_PX = 1.5
"""A smaller one is not read."""
_LEAST_RED, _PURE = 60.0, 2.0
"""Mean red of one that shines [grey levels], and its ratio to green and blue."""


def is_red(image: Image, camera: Camera, camera_from_plane: Pose, light: Polygon) -> bool:
    """Whether a status light shines red.

    Args:
        image: (H,W,3) BGR.
        camera: intrinsics.
        camera_from_plane: pose of the cue's plane (right, down, forward).
        light: in that plane, about its origin.
    """
    corners_m = np.array([(*corner_m, 0.0) for corner_m in light.corners_m])
    corners_px = camera.project(camera_from_plane.apply(_INNER * corners_m))
    if not np.isfinite(corners_px).all() or np.ptp(corners_px, axis=0).min() < _LEAST_PX:
        return False
    low, high = np.floor(corners_px.min(axis=0)).astype(int), np.ceil(corners_px.max(axis=0)).astype(int) + 1
    if low.min() < 0 or high[0] > image.shape[1] or high[1] > image.shape[0]:
        return False
    mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
    cv2.fillConvexPoly(mask, np.rint(corners_px - low).astype(np.int32), 255)
    blue, green, red, _ = cv2.mean(image[low[1] : high[1], low[0] : high[0]], mask)
    return bool(red >= _LEAST_RED and red >= _PURE * max(blue, green))
