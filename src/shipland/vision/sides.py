"""Sides of quadrilaterals at sub-pixel: found coarsely, fitted as straight edges, intersected.

Arrays are (side, profile, sample); the 4n sides are those of n quadrilaterals, each from its first corner to the
next, clockwise. Everything is in undistorted pixels, where sides are straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from shipland.camera import Camera
from shipland.frames import Array
from shipland.vision.bar import Image

_NEXT, _BEFORE = [1, 2, 3, 0], [3, 0, 1, 2]

_QUARTER_TURN = np.array([1.0, -1.0])
"""(column, row) swapped and multiplied by this is the outward normal of a clockwise side."""

_PROFILES = 16
"""Profiles across a side."""

_UNIT = np.linspace(-1.0, 1.0, _PROFILES)
"""Their places along the part of the side that is looked at."""

_RECENTRE = 0.38
"""A side farther than this fraction of the reach from where its profiles were centred is measured once more; the
fit from there errs by 0.02 px at most."""

_REFIT_PX = 0.1
"""A Gauss–Newton step longer than this is followed by another."""

_STEP_PX = 0.5
"""Distance of samples along a profile."""

_MOST_SAMPLES = 12
"""Most of them on either side; long profiles are sampled more thinly."""

_LEAST_CONTRAST = 12.0
"""Smallest difference of colour between inside and outside, in grey levels, that is measured."""

_LEAST_SIDE_CONTRAST = 0.15
"""The same for a single side, against the cue's."""

_BILINEAR_VARIANCE = 4.0 / 9.0
"""Bilinear interpolation at random phase leaves this much of the pixels' noise variance."""

_HELD_PX = 0.05
"""Standard deviation of a side that is taken to lie on the picture's edge."""

_TRIES = 5
"""Times that sides are measured, each from where the last left them, before they are given up."""

_BLUR_PER_REACH = 0.45
"""Profiles must reach so much farther than the blur that their ends lie on the plain colours."""

_BLUR_PX = (0.4, 8.0)
"""Range of the blur that is taken from the picture."""


@dataclass(frozen=True)
class Sides:
    """Straight sides, roughly known.

    Attributes:
        middle_px: (s,2).
        along: (s,2) unit direction.
        outward: (s,2) unit normal.
        length_px: (s,).
        reach_px: (s,) half-length of the profiles across them.
        held: (s,) lies along the picture's edge and cannot be measured.
    """

    middle_px: Array
    along: Array
    outward: Array
    length_px: Array
    reach_px: Array
    held: npt.NDArray[np.bool_]

    @staticmethod
    def of(quads_px: Array, reach_px: float, held: npt.NDArray[np.bool_] | None = None) -> Sides:
        """The sides of quadrilaterals (n,4,2); profiles reach no farther than 0.42 of the shorter side."""
        starts = quads_px.reshape(-1, 2)
        ends = quads_px[:, _NEXT].reshape(-1, 2)
        length_px = np.maximum(np.hypot(*(ends - starts).T), 1e-6)
        along = (ends - starts) / length_px[:, None]
        outward = along[:, ::-1] * _QUARTER_TURN
        shorter_px = length_px.reshape(-1, 4).min(axis=1).repeat(4)
        reach = np.minimum(reach_px, np.maximum(0.42 * shorter_px, 1.5))
        if held is None:
            held = np.zeros(len(starts), bool)
        return Sides(0.5 * (starts + ends), along, outward, length_px, reach, held)

    def half_px(self) -> Array:
        """(s,) half of each side's length that is looked at: off the corners by twice a usual blur."""
        return np.maximum(0.5 * self.length_px - 1.5, 0.3 * self.length_px)

    def samples_px(self, half_px: Array) -> tuple[Array, Array, Array]:
        """Columns and rows of samples (s,profile,sample), and their places across (s,sample) [px, outward positive]."""
        samples = 2 * min(math.ceil(float(self.reach_px.max()) / _STEP_PX), _MOST_SAMPLES) + 1
        across_px = self.reach_px[:, None] * np.linspace(-1.0, 1.0, samples)
        along_px = half_px[:, None] * _UNIT
        columns, rows = (
            (self.middle_px[:, axis, None] + along_px * self.along[:, axis, None])[:, :, None]
            + (across_px * self.outward[:, axis, None])[:, None]
            for axis in (0, 1)
        )
        return columns, rows, across_px

    def wider(self) -> Sides:
        """The same with profiles twice as long, as far as the quadrilaterals allow."""
        shorter_px = self.length_px.reshape(-1, 4).min(axis=1).repeat(4)
        reach_px = np.maximum(np.minimum(2.0 * self.reach_px, 0.42 * shorter_px), self.reach_px)
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
        covariance: (s,2,2) of both.
        blur_px: standard deviation of the picture's blur.
    """

    sides: Sides
    offset_px: Array
    slope: Array
    covariance: Array
    blur_px: float


def distort(undistorted_px: Array, camera: Camera) -> Array:
    """Pixels (n,2) of the picture for undistorted pixels (n,2)."""
    if not camera.has_distortion:
        return undistorted_px
    homogeneous = np.column_stack([undistorted_px, np.ones(len(undistorted_px))])
    return camera.project(homogeneous @ np.linalg.inv(camera.matrix).T)


def measure_sides(image: Image, sides: Sides, camera: Camera, floor_px: float) -> SideFit | None:
    """Where the sides lie, at sub-pixel.

    The area under each profile finds the side coarsely; then Gauss–Newton fits one ideal edge, blurred as the picture
    is, to all profiles of a side. What turns out far from where the profiles were centred, or blurred more than they
    reach, is measured once more.

    Args:
        image: (H,W,3) BGR.
        sides: known to within two pixels.
        camera: its distortion is taken into account.
        floor_px: standard deviation that no averaging removes.

    Returns:
        The fit and the sides as last centred; None when there is no contrast, or a side too far off.
    """
    for _ in range(_TRIES):
        fit = _fit(image, sides, camera, floor_px)
        if fit is None or fit.blur_px > _BLUR_PER_REACH * float(sides.reach_px.min()):
            wider = sides.wider()
            if np.all(wider.reach_px == sides.reach_px):
                return fit
            sides = wider
            continue
        ends_px = np.abs(fit.offset_px) + np.abs(fit.slope) * sides.half_px()
        if np.all(ends_px <= _RECENTRE * sides.reach_px):
            return fit
        sides = sides.moved(fit.offset_px, fit.slope)
    return None


def contrast_direction(inside: Array, outside: Array) -> Array | None:
    """The colour direction (3,) along which samples (n,3) inside and outside differ by 1; None without contrast."""
    difference = np.asarray(inside.mean(axis=0, dtype=float) - outside.mean(axis=0, dtype=float))
    size2 = float(difference @ difference)
    return difference / size2 if size2 >= _LEAST_CONTRAST**2 else None


def _fit(image: Image, sides: Sides, camera: Camera, floor_px: float) -> SideFit | None:
    half_px = sides.half_px()
    columns, rows, across_px = sides.samples_px(half_px)
    values = _contrasts(image, columns, rows, camera, sides.held)
    if values is None:
        return None
    step_px = across_px[:, 1] - across_px[:, 0]
    crossing_px = (values.sum(axis=-1) - 0.5 * across_px.shape[1]) * step_px[:, None]
    middle_px = np.sort(crossing_px, axis=1)[:, _PROFILES // 2, None]
    crossing_px = np.clip(crossing_px, middle_px - 1.0, middle_px + 1.0)
    offset_px = crossing_px.mean(axis=1)
    tilt_px = crossing_px @ _UNIT / (_UNIT @ _UNIT)
    blur_px = _blur_px(values, step_px)
    for _ in range(4):
        edge_px = offset_px[:, None] + tilt_px[:, None] * _UNIT
        argument = (edge_px[..., None] - across_px[:, None]) / blur_px
        residual = values - ndtr(argument)
        argument *= argument
        argument *= -0.5
        density = np.exp(argument, out=argument)
        density /= blur_px * np.sqrt(2.0 * np.pi)
        pull = np.einsum("spx,spx->sp", density, residual)
        push = np.einsum("spx,spx->sp", density, density)
        a, b, c = push.sum(axis=1), push @ _UNIT, push @ _UNIT**2
        p, q = pull.sum(axis=1), pull @ _UNIT
        determinant = np.maximum(a * c - b * b, 1e-9)
        by_offset, by_tilt = (c * p - b * q) / determinant, (a * q - b * p) / determinant
        offset_px, tilt_px = offset_px + by_offset, tilt_px + by_tilt
        longest_px = float(((np.abs(by_offset) + np.abs(by_tilt)) * ~sides.held).max())
        if not longest_px > _REFIT_PX:
            break
    if not np.all((np.abs(offset_px) + np.abs(tilt_px) <= sides.reach_px) | sides.held):
        return None
    misfit2 = np.einsum("spx,spx->s", residual, residual) - (by_offset * p + by_tilt * q)
    noise2 = np.maximum(misfit2, 0.0) / (residual[0].size * _BILINEAR_VARIANCE)
    # A sample stands for its share of a pixel's area: more samples than pixels bring nothing new.
    scale = noise2 / (step_px * 2.0 * half_px / (_PROFILES - 1)) / determinant
    covariance = np.empty((len(a), 2, 2))
    covariance[:, 0, 0] = scale * c + floor_px**2
    covariance[:, 0, 1] = covariance[:, 1, 0] = -scale * b / half_px
    covariance[:, 1, 1] = (scale * a + 3.0 * floor_px**2) / half_px**2
    if sides.held.any():
        offset_px[sides.held] = tilt_px[sides.held] = 0.0
        covariance[sides.held] = _HELD_PX**2 * np.eye(2)
        covariance[sides.held, 1, 1] /= half_px[sides.held] ** 2
    return SideFit(sides, offset_px, tilt_px / half_px, covariance, blur_px)


def intersect_sides(fit: SideFit) -> tuple[Array, Array] | None:
    """Corners (n,4,2) [px] where each side meets the one before it, and their covariances (n,8,8) [px²].

    None when neighbours are parallel or a corner is far from where its sides end.
    """
    moved = fit.sides.moved(fit.offset_px, fit.slope)
    along, normal = moved.along.reshape(-1, 4, 2), moved.outward.reshape(-1, 4, 2)
    middle_px = moved.middle_px.reshape(-1, 4, 2)
    distance_px = (normal * middle_px).sum(axis=-1)
    before, before_px = normal[:, _BEFORE], distance_px[:, _BEFORE]
    determinant = before[..., 0] * normal[..., 1] - before[..., 1] * normal[..., 0]
    if not np.all(np.abs(determinant) >= 0.2):
        return None
    # How a corner moves with the side before it and with its own: along the other one of the two.
    gain = np.empty((len(normal), 4, 2, 2))
    gain[..., 0] = -along / determinant[..., None]
    gain[..., 1] = along[:, _BEFORE] / determinant[..., None]
    corners_px = gain[..., 0] * before_px[..., None] + gain[..., 1] * distance_px[..., None]
    levers = np.empty((len(normal), 4, 2))
    levers[..., 0] = ((corners_px - middle_px[:, _BEFORE]) * along[:, _BEFORE]).sum(axis=-1)
    levers[..., 1] = ((corners_px - middle_px) * along).sum(axis=-1)
    jacobian = np.zeros((len(normal), 4, 2, 4, 2))
    spread = np.zeros((len(normal), 4, 2, 4, 2))
    by_side = fit.covariance.reshape(-1, 4, 2, 2)
    for corner, previous in enumerate(_BEFORE):
        jacobian[:, corner, :, previous, 0] = gain[:, corner, :, 0]
        jacobian[:, corner, :, previous, 1] = gain[:, corner, :, 0] * levers[:, corner, None, 0]
        jacobian[:, corner, :, corner, 0] = gain[:, corner, :, 1]
        jacobian[:, corner, :, corner, 1] = gain[:, corner, :, 1] * levers[:, corner, None, 1]
        spread[:, corner, :, corner] = by_side[:, corner]
    flat = jacobian.reshape(-1, 8, 8)
    return corners_px, flat @ spread.reshape(-1, 8, 8) @ flat.transpose(0, 2, 1)


def _contrasts(image: Image, columns: Array, rows: Array, camera: Camera, held: npt.NDArray[np.bool_]) -> Array | None:
    """Samples (s,profile,sample) from 0 outside to 1 inside, bilinear between pixels; None without contrast."""
    shape = columns.shape
    columns, rows = columns.ravel(), rows.ravel()
    if camera.has_distortion:
        columns, rows = distort(np.column_stack([columns, rows]), camera).T
    height, width = image.shape[:2]
    columns, rows = np.clip(columns, 0.0, width - 1.001), np.clip(rows, 0.0, height - 1.001)
    left, top = columns.astype(np.intp), rows.astype(np.intp)
    index = top * width + left
    around = image.reshape(-1, 3).take(np.concatenate([index, index + 1, index + width, index + width + 1]), axis=0)
    few = around[: len(index)].reshape(*shape, 3)[~held, ::4]
    direction = contrast_direction(few[:, :, :2].reshape(-1, 3), few[:, :, -2:].reshape(-1, 3))
    if direction is None:
        return None
    contrast = (around.astype(np.float32) @ direction.astype(np.float32)).reshape(4, -1)
    right_share, lower_share = columns - left, rows - top
    upper = contrast[0] + right_share * (contrast[1] - contrast[0])
    lower = contrast[2] + right_share * (contrast[3] - contrast[2])
    profile = (upper + lower_share * (lower - upper)).reshape(shape)
    inside = 0.5 * (profile[:, :, 0] + profile[:, :, 1]).mean(axis=1)
    span = inside - 0.5 * (profile[:, :, -1] + profile[:, :, -2]).mean(axis=1)
    if held.any():
        span[held] = 1.0
    if not np.all(span >= _LEAST_SIDE_CONTRAST):
        return None
    return np.asarray(1.0 + (profile - inside[:, None, None]) / span[:, None, None])


def _blur_px(values: Array, step_px: Array) -> float:
    """Standard deviation of the Gaussian whose step has the profiles' gradient energy, 1 / (2 √π σ)."""
    energy = ((values[..., 1:] - values[..., :-1]) ** 2).sum(axis=-1) / step_px[:, None]
    median = float(np.sort(energy, axis=None)[energy.size // 2])
    return min(max(1.0 / (2.0 * math.sqrt(math.pi) * max(median, 1e-3)), _BLUR_PX[0]), _BLUR_PX[1])
