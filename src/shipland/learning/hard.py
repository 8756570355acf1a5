"""Windows where a detector errs: whole frames are drawn, looked at by it, and cut around what it took for the target.

A whole frame holds twenty times the sea, the decoys and the drops of a window, at the scale that flight sees them; only
what fools the detector is kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from shipland.learning.shot import NearestBox
from shipland.messages import Box
from shipland.vision.far.decode import PIXEL_CENTRE

Picture = npt.NDArray[np.uint8]
Corner = tuple[int, int]
MOST_WINDOWS = 4
LEAST_CONFIDENCE = 0.1
_MARGIN = 0.12
_TRIES = 10


def hard_corners(
    size_px: tuple[int, int],
    crop_px: int,
    target: NearestBox | None,
    partly: NearestBox | None,
    found: Sequence[Box],
    least_visible: float,
    rng: np.random.Generator,
) -> list[Corner]:
    """Corners (column, row) of the windows to keep: over the target, then over false boxes, else anywhere.

    Args:
        size_px: width and height of the frame.
        crop_px: side of a window.
        target: the target's box (left, top, right, bottom) [px, edges at whole numbers].
        partly: box of a target that is not labelled, because too little of it is seen; no window may touch it.
        found: the detector's boxes, most confident first.
        least_visible: part of the target's box that must lie in a window that touches it.
        rng: of the places.
    """
    room = np.maximum(np.array(size_px) - crop_px, 0)
    corners: list[Corner] = []

    def add(centre: npt.NDArray[np.float64], reach_px: float) -> None:
        for _ in range(_TRIES):
            place = np.clip(np.round(centre + rng.uniform(-reach_px, reach_px, 2) - 0.5 * crop_px), 0, room).astype(int)
            corner = (int(place[0]), int(place[1]))
            cut = None if target is None else window_box(target, corner, crop_px)
            if partly is not None and window_box(partly, corner, crop_px) is not None:
                continue
            if cut is None or target is None or _area(cut) >= least_visible * _area(target):
                corners.append(corner)
                return

    if target is not None:
        longer = max(target[2] - target[0], target[3] - target[1])
        middle = 0.5 * np.array([target[0] + target[2], target[1] + target[3]])
        add(middle, max(0.5 * (crop_px - longer) - 2.0, 0.0))
    for box in found:
        place = np.array(box.centre_px) + PIXEL_CENTRE
        if len(corners) == MOST_WINDOWS:
            break
        if box.confidence < LEAST_CONFIDENCE or _hits(place, target) or _hits(place, partly):
            continue
        inside = [np.abs(place - np.array(at) - 0.5 * crop_px).max() <= (0.5 - _MARGIN) * crop_px for at in corners]
        if not any(inside):
            add(place, 0.3 * crop_px)
    if not corners:
        add(rng.uniform(0.0, size_px), 0.0)
    return corners


def window_box(box: NearestBox, corner: Corner, crop_px: int) -> NearestBox | None:
    """The part of a box inside a window, in the window's pixels; None where they do not meet."""
    left, top = (min(max(box[axis] - corner[axis], 0.0), float(crop_px)) for axis in (0, 1))
    right, bottom = (min(max(box[2 + axis] - corner[axis], 0.0), float(crop_px)) for axis in (0, 1))
    return (left, top, right, bottom) if right > left and bottom > top else None


def compressed(picture: Picture, quality: int) -> Picture:
    """The picture after JPEG's loss."""
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def _area(box: NearestBox) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def _hits(place: npt.NDArray[np.float64], box: NearestBox | None) -> bool:
    if box is None:
        return False
    return bool(box[0] - 2.0 <= place[0] <= box[2] + 2.0 and box[1] - 2.0 <= place[1] <= box[3] + 2.0)
