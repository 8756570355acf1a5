"""Labels of a picture for a detector's training: tight boxes and visible shares from an identity pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipland.sim.scene.view import Crop

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Label:
    """One object in the picture.

    Attributes:
        left_px, top_px, right_px, bottom_px: edges of the tightest box around what is visible, in coordinates whose
            pixel centres are whole numbers: the whole picture is −0.5 … width − 0.5. Distortion is not applied.
        visible: share of the object that is in the picture and not behind something else, 0 … 1.
    """

    left_px: float
    top_px: float
    right_px: float
    bottom_px: float
    visible: float


@dataclass(frozen=True)
class Labels:
    """The platform, with superstructure, deck and bar, and the board with the cue; None for what cannot be seen."""

    ship: Label | None
    bar: Label | None


def area_px2(mask: Mask, crop: Crop) -> float:
    """Area of a mask (h,w) over a crop [px²]."""
    return float(np.count_nonzero(mask)) * crop.area / mask.size


def label(seen: Mask, crop: Crop, whole_px2: float) -> Label | None:
    """The label of an object seen over a crop of the picture (h,w); None when nothing of it is seen.

    `whole_px2` is its area with nothing before it, in the picture and beyond.
    """
    columns, rows = np.flatnonzero(seen.any(axis=0)), np.flatnonzero(seen.any(axis=1))
    if not len(columns):
        return None
    x = crop.left - 0.5 + crop.width / seen.shape[1] * np.array([columns[0], columns[-1] + 1])
    y = crop.top - 0.5 + crop.height / seen.shape[0] * np.array([rows[0], rows[-1] + 1])
    share = min(area_px2(seen, crop) / max(whole_px2, 1e-9), 1.0)
    return Label(float(x[0]), float(y[0]), float(x[1]), float(y[1]), share)
