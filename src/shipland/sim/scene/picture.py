"""Putting the drawn layers of light together, in OpenCV: sky, sea by its cover at the horizon, ship by its cover."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from shipland.compiled import compiled
from shipland.frames import Array
from shipland.sim.scene.tone import Light16
from shipland.sim.scene.view import Crop

_CELL_PX = 16
"""To how many pixels `hidden_behind` is."""


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


def hidden_behind(layer: Light16, crop: Crop, margin_px: float) -> Crop:
    """The largest part of the picture, to some pixels, that a premultiplied layer (h,w,4) hides; empty for none.

    `margin_px` lie between it and what the layer shows.
    """
    size = crop.width // _CELL_PX, crop.height // _CELL_PX
    if min(size) < 1:
        return Crop(crop.left, crop.top, 0, 0)
    opaque = (layer[: size[1] * _CELL_PX, : size[0] * _CELL_PX, 3] == 65535).view(np.uint8)
    cells = cv2.resize(255 * opaque, size, interpolation=cv2.INTER_AREA) == 255
    left, top, width, height = (_CELL_PX * side for side in _largest_rectangle(cells))
    margin = int(np.ceil(margin_px))
    inner = max(width - 2 * margin, 0), max(height - 2 * margin, 0)
    return Crop(crop.left + left + margin, crop.top + top + margin, *inner)


@compiled
def _largest_rectangle(cells: npt.NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Left, top, width and height of the largest rectangle of true cells."""
    above, best = np.zeros(cells.shape[1], np.int64), (0, 0, 0, 0)
    for row in range(len(cells)):
        for column in range(len(above)):
            above[column] = above[column] + 1 if cells[row, column] else 0
        for left in range(len(above)):
            height = above[left]
            for right in range(left, len(above)):
                height = min(height, above[right])
                if (right + 1 - left) * height > best[2] * best[3]:
                    best = left, row + 1 - height, right + 1 - left, height
    return best


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
