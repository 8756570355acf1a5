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

_ROOT_TWO_PI = math.sqrt(2.0 * math.pi)

_QUARTER_TURN = np.array([1.0, -1.0])
"""(column, row) swapped and multiplied by this is the outward normal of a clockwise side."""

_STATIONS = 24
"""Most columns (or rows, for steep sides) of pixels that one side is fitted to."""

_MOST_ACROSS = 12
"""Most pixels of a column on either side of the edge."""

_LEAST_CONTRAST = 12.0
"""Smallest difference of colour between inside and outside, in grey levels, that is measured."""

_LEAST_SIDE_CONTRAST = 0.15
"""The same for a single side, against the cue's."""

_RECENTRE = 0.4
"""A side farther than this fraction of the reach from where its pixels were taken is measured once more."""

_REFIT_PX = 0.02
"""A Gauss–Newton step longer than this is followed by another."""

_TRIES = 5
"""Times that sides are measured, each from where the last left them, before they are given up."""

_REACH_PER_BLUR = 2.5
"""Pixels must be taken so much farther out than the blur that the outermost show the plain colours."""

_BLUR_PX = (0.12, 8.0)
"""Range of the blur that is taken from the picture."""

_HELD_PX = 0.05
"""Standard deviation of a side that is taken to lie on the picture's edge."""


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

    The area under each column of pixels across a side finds it coarsely; then Gauss–Newton fits one straight edge to all
    of the side's pixels, each of which sees the edge through its own square and the picture's blur. What turns out far
    from where the pixels were taken, or blurred more than they reach, is measured once more.

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
        if fit is None or fit.blur_px * _REACH_PER_BLUR > float(sides.reach_px.min()):
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


@dataclass(frozen=True)
class _Pixels:
    """Pixels around the sides, (s,station,across) each.

    Attributes:
        colours: (…,3) float32.
        out_px: distance outward from the side.
        along: place along it, -1 to 1 between the ends of what is looked at.
        use: 1 where the pixel counts, 0 where it is another's double or outside of the picture.
    """

    colours: npt.NDArray[np.float32]
    out_px: Array
    along: Array
    use: Array


def _pixels(image: Image, sides: Sides, camera: Camera) -> _Pixels:
    """Columns of pixels across flat sides, rows across steep ones; (station, across) from inside to outside."""
    half_px = sides.half_px()
    steep = np.abs(sides.along[:, 1]) > np.abs(sides.along[:, 0])
    main = steep.astype(np.intp)
    each = np.arange(len(half_px))
    # Stations are whole columns (rows): as many as the side covers, spread evenly when there are too many.
    first_px, last_px = (
        distort(sides.middle_px + sign * half_px[:, None] * sides.along, camera)[each, main] for sign in (-1.0, 1.0)
    )
    low, high = np.ceil(np.minimum(first_px, last_px)), np.floor(np.maximum(first_px, last_px))
    count = np.clip(high - low + 1.0, 1.0, _STATIONS)
    order = np.arange(_STATIONS)
    station = np.rint(low[:, None] + np.minimum(order, count[:, None] - 1.0) * ((high - low) / np.maximum(count - 1.0, 1.0))[:, None])
    share = (station - first_px[:, None]) / np.where(last_px == first_px, 1.0, last_px - first_px)[:, None]
    foot = sides.middle_px[:, None] + ((2.0 * share - 1.0) * half_px[:, None])[..., None] * sides.along[:, None]
    foot_px = distort(foot.reshape(-1, 2), camera).reshape(foot.shape)
    middle = np.rint(np.where(steep[:, None], foot_px[..., 0], foot_px[..., 1]))
    reach = min(math.ceil(float(sides.reach_px.max())), _MOST_ACROSS)
    outward = np.where(np.where(steep, sides.outward[:, 0], sides.outward[:, 1]) >= 0.0, 1.0, -1.0)
    across = middle[..., None] + (outward[:, None] * np.arange(-reach, reach + 1))[:, None]
    columns = np.where(steep[:, None, None], across, station[..., None])
    rows = np.where(steep[:, None, None], station[..., None], across)
    from_column, from_row = columns - foot_px[..., 0, None], rows - foot_px[..., 1, None]
    (along_column, along_row), (out_column, out_row) = _scales(sides, foot, foot_px, camera)
    out_px = out_column * from_column + out_row * from_row
    along_px = (2.0 * share - 1.0)[..., None] * half_px[:, None, None] + along_column * from_column + along_row * from_row
    height, width = image.shape[:2]
    use = (order < count[:, None])[..., None] & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    index = np.clip(rows, 0, height - 1) * width + np.clip(columns, 0, width - 1)
    colours = image.reshape(-1, 3).take(index.astype(np.intp).ravel(), axis=0).astype(np.float32)
    return _Pixels(colours, out_px, along_px / half_px[:, None, None], use.astype(float))


def _scales(sides: Sides, foot: Array, foot_px: Array, camera: Camera) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """What one column and one row of the picture are along a side and outward of it, in undistorted pixels."""
    if not camera.has_distortion:
        shape = (2, -1, 1, 1)
        (along_column, along_row), (out_column, out_row) = sides.along.T.reshape(shape), sides.outward.T.reshape(shape)
        return (along_column, along_row), (out_column, out_row)
    along, outward = (
        (distort((foot + direction[:, None]).reshape(-1, 2), camera).reshape(foot.shape) - foot_px)[..., None]
        for direction in (sides.along, sides.outward)
    )
    determinant = along[..., 0, :] * outward[..., 1, :] - along[..., 1, :] * outward[..., 0, :]
    return (
        (outward[..., 1, :] / determinant, -outward[..., 0, :] / determinant),
        (-along[..., 1, :] / determinant, along[..., 0, :] / determinant),
    )


def contrast_direction(inside: Array, outside: Array) -> Array | None:
    """The colour direction (3,) along which two mean colours (3,) differ by 1; None without contrast."""
    difference = np.asarray(inside - outside, dtype=float)
    size2 = float(difference @ difference)
    return difference / size2 if size2 >= _LEAST_CONTRAST**2 else None


def _fit(image: Image, sides: Sides, camera: Camera, floor_px: float) -> SideFit | None:
    pixels = _pixels(image, sides, camera)
    values = _contrasts(pixels, sides)
    if values is None:
        return None
    half_px = sides.half_px()
    ends = _coarse(values, pixels)
    blur_px = _blur_px(values, pixels, ends)
    # Only pixels that the fit was centred on count: farther ones see the next thing.
    use = pixels.use * (np.abs(pixels.out_px) <= sides.reach_px[:, None, None] + 0.5)
    count = np.maximum(use.sum(axis=(1, 2)) - 2.0, 1.0)
    for _ in range(5):
        from_edge_px = ends[0][:, None, None] + ends[1][:, None, None] * pixels.along - pixels.out_px
        model, density = edge_response(from_edge_px, blur_px)
        residual = (values - model) * use
        density *= use
        tilted = density * pixels.along
        a, b, c = (np.einsum("spx,spx->s", *pair) for pair in ((density, density), (density, tilted), (tilted, tilted)))
        p, q = np.einsum("spx,spx->s", density, residual), np.einsum("spx,spx->s", tilted, residual)
        determinant = np.maximum(a * c - b * b, 1e-9)
        step = np.array([c * p - b * q, a * q - b * p]) / determinant
        step[:, sides.held] = 0.0
        ends += np.clip(step, -1.0, 1.0)
        if not np.abs(step).max() > _REFIT_PX:
            break
    if not np.all((np.abs(ends).sum(axis=0) <= sides.reach_px) | sides.held):
        return None
    noise2 = np.einsum("spx,spx->s", residual, residual) / count
    covariance = np.empty((len(a), 2, 2))
    covariance[:, 0, 0] = noise2 * c / determinant + floor_px**2
    covariance[:, 0, 1] = covariance[:, 1, 0] = -noise2 * b / determinant / half_px
    covariance[:, 1, 1] = (noise2 * a / determinant + 3.0 * floor_px**2) / half_px**2
    if sides.held.any():
        ends[:, sides.held] = 0.0
        covariance[sides.held] = _HELD_PX**2 * np.eye(2)
        covariance[sides.held, 1, 1] /= half_px[sides.held] ** 2
    return SideFit(sides, ends[0], ends[1] / half_px, covariance, blur_px)


def edge_response(inside_px: Array, blur_px: float) -> tuple[Array, Array]:
    """What a pixel sees of a straight edge whose bright side covers its centre by `inside_px`, and the derivative.

    A step, averaged over a pixel's width and blurred by a Gaussian: [G(d + ½) − G(d − ½)] with G(x) = x Φ(x/σ) + σ φ(x/σ).
    """
    right, left = (inside_px + 0.5) / blur_px, (inside_px - 0.5) / blur_px
    right_share, left_share = ndtr(right), ndtr(left)
    bells = np.exp(-0.5 * right * right) - np.exp(-0.5 * left * left)
    model = blur_px * (right * right_share - left * left_share + bells / _ROOT_TWO_PI)
    return model, right_share - left_share


def _coarse(values: Array, pixels: _Pixels) -> Array:
    """(2,s) offset and tilt over the half length [px] from the area under each column of pixels."""
    step_px = (pixels.out_px[..., -1] - pixels.out_px[..., 0]) / (values.shape[2] - 1)
    crossing_px = pixels.out_px[..., 0] - 0.5 * step_px + values.sum(axis=-1) * step_px
    middle_px = np.sort(crossing_px, axis=1)[:, crossing_px.shape[1] // 2, None]
    crossing_px = np.clip(crossing_px, middle_px - 1.0, middle_px + 1.0)
    along, use = pixels.along.mean(axis=-1), pixels.use[..., values.shape[2] // 2]
    total = np.maximum(use.sum(axis=1), 1.0)
    along_mean = (use * along).sum(axis=1) / total
    mean_px = (use * crossing_px).sum(axis=1) / total
    centred = use * (along - along_mean[:, None])
    tilt_px = (centred * crossing_px).sum(axis=1) / np.maximum((centred * along).sum(axis=1), 1e-6)
    return np.array([mean_px - tilt_px * along_mean, tilt_px])


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


def _contrasts(pixels: _Pixels, sides: Sides) -> Array | None:
    """Pixels (s,station,across) from 0 outside to 1 inside, by the outermost of each side; None without contrast."""
    plain_px = np.maximum(sides.reach_px - 1.0, 1.0)[:, None, None]
    inside = pixels.use * (pixels.out_px <= -plain_px)
    outside = pixels.use * (pixels.out_px >= plain_px)
    if sides.held.any():
        inside[sides.held] = outside[sides.held] = 0.0
    means = [part.ravel() @ pixels.colours / max(float(part.sum()), 1.0) for part in (inside, outside)]
    direction = contrast_direction(means[0], means[1])
    if direction is None:
        return None
    profile = (pixels.colours @ direction.astype(np.float32)).reshape(pixels.use.shape)
    level, ground = (
        np.einsum("spx,spx->s", part, profile) / np.maximum(part.sum(axis=(1, 2)), 1e-6) for part in (inside, outside)
    )
    span = level - ground
    if sides.held.any():
        span[sides.held] = 1.0
    if not np.all(span >= _LEAST_SIDE_CONTRAST):
        return None
    return np.asarray(1.0 + (profile - level[:, None, None]) / span[:, None, None])


def _blur_px(values: Array, pixels: _Pixels, ends: Array) -> float:
    """Standard deviation of the picture's blur besides the pixels' own size, from the second moment of the edge.

    Differences of neighbouring pixels spread about the edge by σ² + 1/12 of a pixel for its size, and 1/12 for sampling.
    """
    steps = values[..., :-1] - values[..., 1:]
    edge_px = (ends[0][:, None, None] + ends[1][:, None, None] * pixels.along)[..., :-1]
    spacing = pixels.out_px[..., 1:] - pixels.out_px[..., :-1]
    from_edge_px = pixels.out_px[..., :-1] + 0.5 * spacing - edge_px
    near = np.abs(from_edge_px) <= 0.5 * (pixels.out_px[..., -1:] - pixels.out_px[..., :1]) - 1.0
    spread = np.einsum("spx,spx->s", pixels.use[..., 1:] * near * steps, from_edge_px**2)
    weight = np.maximum(np.einsum("spx,spx->s", pixels.use[..., 1:] * near, steps), 1e-3)
    variance = float(np.sort(spread / weight - (1.0 + spacing[:, 0, 0] ** 2) / 12.0)[len(weight) // 2])
    return min(max(math.sqrt(max(variance, 0.0)), _BLUR_PX[0]), _BLUR_PX[1])
