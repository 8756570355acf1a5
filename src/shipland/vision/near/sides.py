"""Sides of quadrilaterals: where they lie, and where they meet.

The 4n sides are those of n quadrilaterals, each from its first corner to the next, clockwise. Everything is in
undistorted pixels, where sides are straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array

_SIDE, _NEXT, _BEFORE = np.array([[0, 1, 2, 3], [1, 2, 3, 0], [3, 0, 1, 2]])

MOST_ACROSS = 12
"""Most pixels that are taken across a side, inward or outward."""

_QUARTER_TURN = np.array([1.0, -1.0])
"""(column, row) swapped and multiplied by this is the outward normal of a clockwise side."""


@dataclass(frozen=True)
class Sides:
    """Straight sides, roughly known.

    Attributes:
        middle_px: (s,2).
        along: (s,2) unit direction.
        outward: (s,2) unit normal.
        length_px: (s,).
        reach_px: (s,) how far across them pixels are taken.
        held: (s,) lies along the picture's edge and cannot be measured; None when no side does.
    """

    middle_px: Array
    along: Array
    outward: Array
    length_px: Array
    reach_px: Array
    held: npt.NDArray[np.bool_] | None

    @staticmethod
    def of(quads_px: Array, reach_px: float, held: npt.NDArray[np.bool_] | None = None) -> Sides:
        """The sides of quadrilaterals (n,4,2); pixels are taken no farther out than 0.42 of the shorter side."""
        ends = quads_px[:, _NEXT]
        way = (ends - quads_px).reshape(-1, 2)
        length_px = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
        along = way / length_px[:, None]
        shorter_px = length_px.reshape(-1, 4).min(axis=1).repeat(4)
        reach = np.minimum(reach_px, np.maximum(0.42 * shorter_px, 1.5))
        middle_px = 0.5 * (ends + quads_px).reshape(-1, 2)
        return Sides(middle_px, along, along[:, ::-1] * _QUARTER_TURN, length_px, reach, held)

    def half_px(self) -> Array:
        """(s,) half of each side's length that is looked at: off the corners by twice a usual blur."""
        return np.maximum(0.5 * self.length_px - 1.5, 0.3 * self.length_px)

    def wider(self) -> Sides:
        """The same with pixels taken twice as far out, as far as the quadrilaterals allow."""
        shorter_px = self.length_px.reshape(-1, 4).min(axis=1).repeat(4)
        farthest_px = np.minimum(0.42 * shorter_px, MOST_ACROSS)
        reach_px = np.maximum(np.minimum(2.0 * self.reach_px, farthest_px), self.reach_px)
        return replace(self, reach_px=reach_px)

    def moved(self, offset_px: Array, slope: Array) -> Sides:
        """The sides shifted outward and turned."""
        along = self.along + slope[:, None] * self.outward
        along /= np.sqrt(1.0 + slope * slope)[:, None]
        middle_px = self.middle_px + offset_px[:, None] * self.outward
        return Sides(middle_px, along, along[:, ::-1] * _QUARTER_TURN, self.length_px, self.reach_px, self.held)


@dataclass(frozen=True)
class SideFit:
    """Where the sides lie, outward positive.

    Attributes:
        sides: what offset and slope are counted from.
        offset_px: (s,) at the middle.
        slope: (s,).
        variance: (3,s) of the offset, of the two together, of the slope.
        blur_px: standard deviation of the picture's blur.
        misfit: root-mean-square residual of the pixels, against the contrast.
    """

    sides: Sides
    offset_px: Array
    slope: Array
    variance: Array
    blur_px: float
    misfit: float


def distort(undistorted_px: Array, camera: Camera) -> Array:
    """Pixels (n,2) of the picture for undistorted pixels (n,2)."""
    if not camera.has_distortion:
        return undistorted_px
    homogeneous = np.column_stack([undistorted_px, np.ones(len(undistorted_px))])
    return camera.project(homogeneous @ np.linalg.inv(camera.matrix).T)


@dataclass(frozen=True)
class Meeting:
    """Where sides meet.

    Attributes:
        corners_px: (n,4,2) between each side and the one before it.
        whiten: (n,8,8) [1/px] what turns a deviation of a quadrilateral's corners into standard deviations of its
            sides' ends.
        growth: (n,4,2) how the corners move when all sides move outward by one.
        noise_px: standard deviation of a side's end, root mean square.
    """

    corners_px: Array
    whiten: Array
    growth: Array
    noise_px: float


def intersect_sides(fit: SideFit) -> Meeting | None:
    """The corners of fitted sides; None when neighbours are parallel."""
    moved = fit.sides.moved(fit.offset_px, fit.slope)
    along, normal = moved.along.reshape(-1, 4, 2), moved.outward.reshape(-1, 4, 2)
    middle_px = moved.middle_px.reshape(-1, 4, 2)
    before = along[:, _BEFORE]
    determinant = before[..., 0] * along[..., 1] - before[..., 1] * along[..., 0]
    if not np.abs(determinant).min() >= 0.2:
        return None
    # From the middle of the side before, along it, to where it meets this one.
    middle_before_px = middle_px[:, _BEFORE]
    way = middle_px - middle_before_px
    lever_px = (way[..., 0] * along[..., 1] - way[..., 1] * along[..., 0]) / determinant
    corners_px = middle_before_px + lever_px[..., None] * before
    # Deviations of the two ends' distances from a side have its variance V0 + (x + y) V1 + x y V2 at the levers x, y.
    start_px = ((corners_px - middle_px) * along).sum(axis=-1)
    end_px = lever_px[:, _NEXT]
    both, cross, square = fit.variance.reshape(3, -1, 4)
    at_start, at_end = both + start_px * cross, cross + start_px * square
    first = np.sqrt(at_start + start_px * at_end)
    mixed = (at_start + end_px * at_end) / first
    second = np.sqrt(np.maximum(both + end_px * (2.0 * cross + end_px * square) - mixed * mixed, 1e-12))
    whiten = np.zeros((len(corners_px), 4, 2, 4, 2))
    whiten[:, _SIDE, 0, _SIDE] = by_first = normal / first[..., None]
    whiten[:, _SIDE, 1, _SIDE] = by_first * (-mixed / second)[..., None]
    whiten[:, _SIDE, 1, _NEXT] = normal / second[..., None]
    normal_before = normal[:, _BEFORE]
    growth = (normal + normal_before) / (1.0 + (normal * normal_before).sum(axis=-1, keepdims=True))
    return Meeting(corners_px, whiten.reshape(-1, 8, 8), growth, math.sqrt(float(np.vdot(first, first)) / first.size))
