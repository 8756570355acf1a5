"""Projection for the rasteriser: OpenCV's pinhole as clip space, screen boxes, horizon, exact edge lines.

Row 0 of every target is the picture's top row, so nothing is flipped on read-back. A pixel's centre is a whole
number in `image` and a half in the rasteriser's window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array, Pose

Map = npt.NDArray[np.float32]
_BIG = 1e9


@dataclass(frozen=True)
class Crop:
    """A part of the picture: left, top, width, height [px]."""

    left: int
    top: int
    width: int
    height: int

    @property
    def area(self) -> int:
        """Pixels in it."""
        return self.width * self.height


def clip_from_rel(camera: Camera, ned_from_camera: Pose, crop: Crop, near_m: float, far_m: float) -> Array:
    """(4,4) from camera-relative ned [m] to clip space of a crop of the picture."""
    k = camera.matrix
    depth = (far_m + near_m) / (far_m - near_m), -2.0 * far_m * near_m / (far_m - near_m)
    clip_from_camera = np.array(
        [
            [
                2.0 * k[0, 0] / crop.width,
                2.0 * k[0, 1] / crop.width,
                2.0 * (k[0, 2] + 0.5 - crop.left) / crop.width - 1.0,
                0.0,
            ],
            [0.0, 2.0 * k[1, 1] / crop.height, 2.0 * (k[1, 2] + 0.5 - crop.top) / crop.height - 1.0, 0.0],
            [0.0, 0.0, depth[0], depth[1]],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )
    turn = np.eye(4)
    turn[:3, :3] = ned_from_camera.rotation.T
    return np.asarray(clip_from_camera @ turn, dtype=float)


def rays(camera: Camera, ned_from_camera: Pose) -> Array:
    """(3,3): columns ray_x, ray_y, ray_0 in ned, so that ray = u ray_x + v ray_y + ray_0."""
    return np.asarray(ned_from_camera.rotation @ np.linalg.inv(camera.matrix), dtype=float)


def horizon_line(camera: Camera, ned_from_camera: Pose) -> Array:
    """(3,) line of the horizon: a u + b v + c is the distance below it [px]; the sign alone where there is none."""
    line: Array = rays(camera, ned_from_camera)[2]
    length = float(np.hypot(line[0], line[1]))
    if length < 1e-9:
        return np.array([0.0, 0.0, _BIG if line[2] > 0.0 else -_BIG])
    return line / length


def picture_corners(camera: Camera) -> Array:
    """(4,2) corners of the picture [px]."""
    return picture_polygon(Crop(0, 0, camera.width_px, camera.height_px))


def picture_polygon(crop: Crop, line: Array | None = None, offset_px: float = 0.0) -> Array:
    """(n,2) corners [px] of a part of the picture, or of its part where line·(u,v,1) + offset ≥ 0, if any."""
    left, top = crop.left - 0.5, crop.top - 0.5
    right, bottom = left + crop.width, top + crop.height
    box: Array = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    if line is None:
        return box
    return _cut(box, np.asarray(box @ line[:2] + line[2] + offset_px))


def _cut(corners: Array, values: Array) -> Array:
    """The part (n,k) of a convex polygon (m,k) where a linear function with these values (m,) at its corners is ≥ 0."""
    kept: list[Array] = []
    for here in range(len(corners)):
        there = (here + 1) % len(corners)
        if values[here] >= 0.0:
            kept.append(corners[here])
        if (values[here] >= 0.0) != (values[there] >= 0.0):
            share = values[here] / (values[here] - values[there])
            kept.append(corners[here] + share * (corners[there] - corners[here]))
    return np.array(kept).reshape(-1, corners.shape[1])


def without(crop: Crop, inner: Crop) -> list[Crop]:
    """Up to four parts of a crop that cover it without `inner`."""
    left, top = max(inner.left, crop.left), max(inner.top, crop.top)
    right = min(inner.left + inner.width, crop.left + crop.width)
    bottom = min(inner.top + inner.height, crop.top + crop.height)
    if right <= left or bottom <= top:
        return [crop]
    parts = [
        Crop(crop.left, crop.top, crop.width, top - crop.top),
        Crop(crop.left, bottom, crop.width, crop.top + crop.height - bottom),
        Crop(crop.left, top, left - crop.left, bottom - top),
        Crop(right, top, crop.left + crop.width - right, bottom - top),
    ]
    return [part for part in parts if part.area > 0]


def clipped_polygon(camera: Camera, corners_in_camera_m: Array, near_m: float = 0.05) -> Array:
    """(n,2) pixels of a polygon (m,3) in `camera`, cut where it comes nearer than `near_m`."""
    points = _cut(corners_in_camera_m, corners_in_camera_m[:, 2] - near_m) @ camera.matrix.T
    return np.asarray(points[:, :2] / points[:, 2:])


def screen_box(
    camera: Camera, points_in_camera_m: Array, near_m: float = 0.02, margin_px: float = 2.0, beyond: float = 0.0
) -> Crop | None:
    """The picture's part that holds the points' convex hull, whole when it reaches behind; None when outside.

    Args:
        camera: intrinsics.
        points_in_camera_m: (n,3).
        near_m: what is nearer is behind.
        margin_px: added on all sides.
        beyond: how far the box may reach out of the picture, in pictures.
    """
    size = np.array([camera.width_px, camera.height_px])
    low, high = -np.floor(beyond * size), size + np.floor(beyond * size)
    depth = points_in_camera_m[:, 2]
    if depth.max() <= near_m:
        return None
    if depth.min() > near_m:
        pixels = points_in_camera_m @ camera.matrix.T
        pixels = pixels[:, :2] / pixels[:, 2:]
        if (pixels.min(axis=0) > size + margin_px).any() or (pixels.max(axis=0) < -margin_px).any():
            return None
        low = np.clip(np.floor(pixels.min(axis=0) - margin_px), low, high)
        high = np.clip(np.ceil(pixels.max(axis=0) + margin_px) + 1, low, high)
    left, top, width, height = *low.astype(int), *(high - low).astype(int)
    return Crop(int(left), int(top), int(width), int(height)) if width > 0 and height > 0 else None


def box_before(camera: Camera, corners_in_camera_m: Array, near_m: float, crop: Crop) -> Crop:
    """The part of a crop that holds what of boxes, of eight corners (8n,3) each, is not nearer than `near_m`."""
    boxes = corners_in_camera_m.reshape(-1, 8, 3)
    starts, ends = (boxes[:, one] for one in np.triu_indices(8, 1))
    ahead, beyond = starts[..., 2] - near_m, ends[..., 2] - near_m
    crosses = (ahead > 0.0) != (beyond > 0.0)
    share = (ahead / np.where(crosses, ahead - beyond, 1.0))[..., None]
    points = np.concatenate([boxes[boxes[..., 2] >= near_m], (starts + share * (ends - starts))[crosses]])
    if not len(points):
        return Crop(crop.left, crop.top, 0, 0)
    pixels = points @ camera.matrix.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    first, last = (crop.left, crop.top), (crop.left + crop.width, crop.top + crop.height)
    left, top = np.clip(np.floor(pixels.min(axis=0) - 2.0), first, last).astype(int).tolist()
    right, bottom = np.clip(np.ceil(pixels.max(axis=0) + 3.0), first, last).astype(int).tolist()
    return Crop(left, top, right - left, bottom - top)


def edge_lines(camera: Camera, camera_from_plane: Array, corners_m: Array) -> Array:
    """(4n,4) lines of the cue's edges in the picture: a u + b v + c = px inside the edge, last column zero.

    Args:
        camera: intrinsics; distortion is not applied.
        camera_from_plane: (3,3) columns right, down and origin of the cue's plane in `camera`.
        corners_m: (n,4,2) corners (right, down) in the plane, clockwise from top-left.
    """
    homography = camera.matrix @ camera_from_plane
    if abs(np.linalg.det(homography)) < 1e-9:
        return np.zeros((4 * len(corners_m), 4))
    along = np.roll(corners_m, -1, axis=1) - corners_m
    inward = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    plane_lines = np.concatenate([inward, -np.sum(inward * corners_m, axis=-1, keepdims=True)], axis=-1)
    lines = plane_lines.reshape(-1, 3) @ np.linalg.inv(homography)
    lines /= np.maximum(np.hypot(lines[:, 0], lines[:, 1]), 1e-12)[:, None]
    return np.column_stack([lines, np.zeros(len(lines))])


def pinhole_around(camera: Camera) -> tuple[Camera, Map, Map]:
    """A distortion-free camera that sees all a distorted one sees, and the remap (columns, rows) back to it [px].

    The wider picture is at most three times as wide and high; what a lens bends in from beyond is left out.
    """
    size = np.array([camera.width_px, camera.height_px])
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    pixels = camera.undistort(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))
    low = np.floor(np.clip(pixels.min(axis=0), -size, 0.0)) - 2.0
    high = np.ceil(np.clip(pixels.max(axis=0), size, 2.0 * size)) + 2.0
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= low
    width, height = (high - low + 1.0).astype(int)
    moved = (pixels - low).astype(np.float32).reshape(camera.height_px, camera.width_px, 2)
    return Camera(int(width), int(height), matrix), moved[..., 0].copy(), moved[..., 1].copy()
