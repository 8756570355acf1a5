"""Screening of the corners [Lee2022, §Detected Points Screening] and of the pose."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipland.frames import Array
from shipland.vision.near.parameters import VisionParameters

_NEXT = np.array([1, 2, 3, 0])

_NOISE = 4.0
"""Standard deviations of a corner that a side's end may be off besides."""


def sides_agree(measured_px: Array, foreseen_px: Array, noise_px: float, parameters: VisionParameters) -> bool:
    """Whether opposite sides agree within ±10 % in length and ±5 % in slope.

    As printed, the lengths of opposite sides are compared with each other, and so are their slopes, here each against
    the other's direction, so that steep sides have one too. A rectangle seen obliquely from near by fails that: at 2 m
    and 40° off, one end of the rig's rectangle is 15 % longer than the other. Read against perspective, the ratio of
    the lengths and the difference of the slopes are compared with those that the pose foresees; for a distant or
    frontal view both readings are one.

    Args:
        measured_px: (k,4,2) corners, clockwise from the first.
        foreseen_px: (k,4,2) the same corners projected with the pose.
        noise_px: standard deviation of a measured corner; four of them are allowed besides.
        parameters: reading and tolerances.
    """
    (ratio, foreseen), (shorter_px, _) = _opposites(np.array([measured_px, foreseen_px]))
    if parameters.screening == "perspective":
        ratio = ratio / foreseen
    # Corners of a small rectangle are not known finely enough for the fractions to mean anything.
    unsure = (parameters.screening_px + _NOISE * noise_px) / np.minimum(shorter_px, 1e6)
    length = np.abs(ratio)
    tolerance = 1.0 + np.maximum(parameters.length_tolerance, unsure)
    steepest = np.maximum(parameters.slope_tolerance, unsure)
    agree = (length <= tolerance) & (length * tolerance >= 1.0)
    agree &= np.abs(ratio.imag) <= steepest * np.maximum(ratio.real, 1e-9)
    return bool(agree.all())


def _opposites(quads_px: Array) -> tuple[npt.NDArray[np.complex128], Array]:
    """(…,2) ratio of opposite sides, top to bottom and right to left, as complex numbers; (…,2) the shorter's length.

    The magnitude is the ratio of the lengths, the angle's tangent the difference of the slopes.
    """
    corners = quads_px.view(np.complex128)[..., 0]
    sides = corners[..., _NEXT] - corners
    lengths = np.abs(sides)
    with np.errstate(divide="ignore", invalid="ignore"):
        return sides[..., :2] / -sides[..., 2:], np.minimum(lengths[..., :2], lengths[..., 2:])
