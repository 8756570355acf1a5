"""Screening of the corners [Lee2022, §Detected Points Screening] and of the pose."""

from __future__ import annotations

import numpy as np

from shipland.frames import Array
from shipland.vision.parameters import VisionParameters


def sides_agree(measured_px: Array, foreseen_px: Array, parameters: VisionParameters) -> bool:
    """Whether opposite sides agree within ±10 % in length and ±5 % in slope.

    As printed, the two lengths of opposite sides are compared with each other, and so are their slopes (rise over
    run along the side's own main direction). A rectangle seen obliquely from near by fails that: at 2 m and 40° off, the bar's near end is
    14 % longer than its far end. Read against perspective, the ratio of the lengths and the difference of the
    slopes are compared with those that the pose foresees; for a distant or frontal view both readings are one.

    Args:
        measured_px: (k,4,2) corners, clockwise from the first.
        foreseen_px: (k,4,2) the same corners projected with the pose.
        parameters: reading and tolerances.
    """
    count = len(measured_px)
    ratio, slope = _opposites(np.concatenate([measured_px, foreseen_px]))
    if parameters.screening == "perspective":
        ratio, slope = ratio[:count] / ratio[count:], slope[:count] - slope[count:]
    else:
        ratio, slope = ratio[:count], slope[:count]
    sides_px = np.hypot(*np.moveaxis(measured_px[:, [1, 2, 3, 0]] - measured_px, -1, 0))
    # Corners of a small rectangle are not known finely enough for the fractions to mean anything.
    unsure = parameters.screening_px / np.minimum(sides_px[:, :2], sides_px[:, 2:])
    length_tolerance = np.maximum(parameters.length_tolerance, unsure)
    slope_tolerance = np.maximum(parameters.slope_tolerance, unsure)
    return bool(
        np.all(np.abs(np.log(ratio)) <= np.log1p(length_tolerance)) and np.all(np.abs(slope) <= slope_tolerance)
    )


def _opposites(quads_px: Array) -> tuple[Array, Array]:
    """(k,2) ratio of opposite sides' lengths, and (k,2) difference of their slopes, top–bottom and right–left."""
    sides = quads_px[:, [1, 2, 3, 0]] - quads_px
    lengths = np.hypot(sides[..., 0], sides[..., 1])
    first, second = sides[:, :2], -sides[:, 2:]
    # The slope against the common direction of the pair: the tangent of the angle between them.
    cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    along = np.sum(first * second, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return lengths[:, :2] / lengths[:, 2:], cross / along
