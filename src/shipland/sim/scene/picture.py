"""Putting the drawn layers of light together, in OpenCV: sky, sea by its cover at the horizon, ship by its cover."""

from __future__ import annotations

import cv2
import numpy as np

from shipland.frames import Array
from shipland.sim.scene.tone import Light16
from shipland.sim.scene.view import Crop


def horizon_rows(line: Array, width_px: int, height_px: int) -> tuple[int, int]:
    """First row that holds any sea, and first row from which on there is sea alone.

    `line` (3,) is a u + b v + c = px below the horizon.
    """
    a, b, c = line
    columns = np.array([0.0, width_px - 1.0])
    if abs(b) < 1e-3:
        return (0, height_px) if abs(a) > 1e-9 else ((0, 0) if c > 0 else (height_px, height_px))
    edges = -(a * columns + c) / b
    low, high = edges.min() - 1.0, edges.max() + 1.0
    if b < 0.0:
        return 0, height_px
    return int(np.clip(np.floor(low), 0, height_px)), int(np.clip(np.ceil(high) + 1, 0, height_px))


def join_at_horizon(sky: Light16, sea: Light16, line: Array, rows: tuple[int, int], out: Light16) -> None:
    """Blend rows first … last of `sky` and `sea` (each (last − first, W, 4)) into `out` by the sea's cover."""
    first, last = rows
    v, u = np.mgrid[first:last, 0 : out.shape[1]].astype(np.float32)
    below = np.clip(np.float32(line[0]) * u + np.float32(line[1]) * v + np.float32(line[2] + 0.5), 0.0, 1.0)
    part = out[first:last]
    part[:] = sea
    cv2.copyTo(sky, (below <= 0.0).astype(np.uint8), part)
    edge = np.nonzero((below > 0.0) & (below < 1.0))
    cover = below[edge][:, None]
    part[edge] = (cover * sea[edge] + (1.0 - cover) * sky[edge] + np.float32(0.5)).astype(np.uint16)


def reduce(layer: Light16, crop: Crop, samples_a_px: int) -> Light16:
    """Area-average a premultiplied layer (h n, w n, 4) down to its crop."""
    if samples_a_px == 1:
        return layer
    return np.asarray(cv2.resize(layer, (crop.width, crop.height), interpolation=cv2.INTER_AREA), np.uint16)


def lay_over(picture: Light16, layer: Light16, crop: Crop) -> None:
    """Lay a premultiplied layer (h,w,4) over its crop of the picture by its cover."""
    part = picture[crop.top : crop.top + crop.height, crop.left : crop.left + crop.width]
    alpha = layer[..., 3]
    whole = alpha == 65535
    cv2.copyTo(layer, whole.astype(np.uint8), part)
    edge = np.unravel_index(np.flatnonzero((alpha > 0) & ~whole), alpha.shape)
    under = part[edge].astype(np.uint32) * (65535 - alpha[edge]).astype(np.uint32)[:, None]
    part[edge] = np.minimum(layer[edge] + (under + 32767) // 65535, 65535).astype(np.uint16)
