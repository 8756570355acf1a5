"""Motion blur: a layer averaged over the exposure, each instant a homography of the picture at its middle."""

from __future__ import annotations

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.sim.scene.tone import Light16
from shipland.sim.state import SceneState

_LEAST_PX = 0.75
_MOST_INSTANTS = 12


def homographies(
    camera: Camera, state: SceneState, shutter_s: float, plane: tuple[Array, float] | None, corners_px: Array
) -> list[Array]:
    """(3,3) maps of the picture at the exposure's middle to instants spread over it; empty when nothing moves.

    Args:
        camera: intrinsics.
        state: the camera's velocity and rate.
        shutter_s: exposure time [s].
        plane: unit normal (3,) in `camera` and distance [m] of what is seen, normal·X = distance; None for infinity.
        corners_px: (n,2) where the motion counts: an instant about every pixel of the longest path.
    """
    if shutter_s <= 0.0:
        return []
    rate = state.camera_rate_in_camera_rad_s
    velocity = state.ned_from_camera.rotation.T @ state.camera_velocity_in_ned_mps
    inverse = np.linalg.inv(camera.matrix)

    def at(time_s: float) -> Array:
        turned = cv2.Rodrigues(np.asarray(-rate * time_s, dtype=float).reshape(3, 1))[0]
        moved = np.eye(3)
        if plane is not None:
            moved -= time_s / plane[1] * np.outer(velocity, plane[0])
        return np.asarray(camera.matrix @ turned @ moved @ inverse)

    path_px = longest_way_px([at(-0.5 * shutter_s), at(0.5 * shutter_s)], corners_px)
    if not path_px > _LEAST_PX:
        return []
    count = int(np.clip(np.ceil(path_px) + 1, 3, _MOST_INSTANTS))
    shares = (np.arange(count) + 0.5) / count - 0.5
    return [at(float(share) * shutter_s) for share in shares]


def longest_way_px(maps: list[Array], corners_px: Array) -> float:
    """The longest path of the corners between the first and the last instant [px]; 0 for no maps."""
    if not maps:
        return 0.0
    return float(np.linalg.norm(_apply(maps[-1], corners_px) - _apply(maps[0], corners_px), axis=1).max())


def average(layer: Light16, maps: list[Array], layer_from_picture: Array) -> Light16:
    """The mean light of a layer (h,w,4) over the maps of `homographies`.

    A picture is continued at its borders; a cropped layer must have a margin as wide as that path. `layer_from_picture`
    (3,3) takes the picture's pixels to the layer's.
    """
    if not maps:
        return layer
    back = np.linalg.inv(layer_from_picture)
    total = np.zeros(layer.shape, np.float32)
    size = (layer.shape[1], layer.shape[0])
    for matrix in maps:
        whole = layer_from_picture @ matrix @ back
        moved = cv2.warpPerspective(layer, whole, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        cv2.accumulate(moved, total)
    return np.asarray(cv2.addWeighted(total, 1.0 / len(maps), total, 0.0, 0.0, dtype=cv2.CV_16U), np.uint16)


def _apply(matrix: Array, pixels: Array) -> Array:
    points = np.column_stack([pixels, np.ones(len(pixels))]) @ matrix.T
    return np.asarray(points[:, :2] / np.where(np.abs(points[:, 2:]) < 1e-6, 1e-6, points[:, 2:]))
