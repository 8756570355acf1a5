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

_AXES = np.array([[0, 1, 2, 3, 4, 5], [1, 0, 3, 2, 5, 4]])
"""Order of three (column, row) pairs as (main axis, other axis), for flat sides and for steep ones."""

_STATIONS = np.arange(24.0)
"""Most columns (rows, for steep sides) of pixels that one side is fitted to."""

_MOST_ACROSS = 12
"""Most pixels of a column on either side of the edge."""

_LEAST_CONTRAST = 12.0
"""Smallest difference of colour between inside and outside, in grey levels, that is measured."""

_LEAST_SIDE_CONTRAST = 0.15
"""The same for a single side, against the cue's."""

_RECENTRE = 0.4
"""A side farther than this fraction of the reach from where its pixels were taken is measured once more."""

_REFIT_PX = 0.08
"""A Gauss–Newton step longer than this is followed by another; the error left is of its square."""

_REBLUR = 0.15
"""The same for the blur, as a fraction of it."""

_STEPS = 6
"""Most Gauss–Newton steps."""

_TRIES = 5
"""Times that sides are measured, each from where the last left them, before they are given up."""

_REACH_PER_BLUR = 4.0
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
        variance: (3,s) of the offset, of the two together, of the slope.
        blur_px: standard deviation of the picture's blur.
    """

    sides: Sides
    offset_px: Array
    slope: Array
    variance: Array
    blur_px: float


def distort(undistorted_px: Array, camera: Camera) -> Array:
    """Pixels (n,2) of the picture for undistorted pixels (n,2)."""
    if not camera.has_distortion:
        return undistorted_px
    homogeneous = np.column_stack([undistorted_px, np.ones(len(undistorted_px))])
    return camera.project(homogeneous @ np.linalg.inv(camera.matrix).T)


def measure_sides(
    image: Image, sides: Sides, camera: Camera, floor_px: float, blur_px: float | None = None
) -> SideFit | None:
    """Where the sides lie, at sub-pixel.

    The area under each column of pixels across a side finds it coarsely; then Gauss–Newton fits one straight edge to
    all of the side's pixels, each of which sees the edge through its own square and the picture's blur. What turns out
    far from where the pixels were taken, or blurred more than they reach, is measured once more.

    Args:
        image: (H,W,3) BGR.
        sides: known to within two pixels.
        camera: its distortion is taken into account.
        floor_px: error of a single column of pixels that is not noise, standard deviation.
        blur_px: a guess of the picture's blur; None to take it from the picture.

    Returns:
        The fit and the sides as last centred; None when there is no contrast, or a side too far off.
    """
    for _ in range(_TRIES):
        fit = _fit(image, sides, camera, floor_px, blur_px)
        if fit is None or fit.blur_px * _REACH_PER_BLUR > float(sides.reach_px.min()):
            wider = sides.wider()
            if np.all(wider.reach_px == sides.reach_px):
                return fit
            sides, blur_px = wider, None
            continue
        ends_px = np.abs(fit.offset_px) + np.abs(fit.slope) * sides.half_px()
        if np.all(ends_px <= _RECENTRE * sides.reach_px):
            return fit
        sides = sides.moved(fit.offset_px, fit.slope)
    return None


def contrast_direction(inside: Array, outside: Array) -> Array | None:
    """The colour direction (3,) along which two mean colours (3,) differ by 1; None without contrast."""
    difference = np.asarray(inside - outside, dtype=float)
    size2 = float(difference @ difference)
    return difference / size2 if size2 >= _LEAST_CONTRAST**2 else None


def edge_response(inside_px: Array, blur_px: float) -> tuple[Array, Array, Array]:
    """What a pixel sees of a straight edge whose bright side covers its centre by `inside_px`, and its derivatives.

    A step averaged over a pixel's width and blurred by a Gaussian: G(d + ½) − G(d − ½), G(x) = x Φ(x/σ) + σ φ(x/σ).
    The derivatives are by the distance and by σ.
    """
    right = inside_px * (1.0 / blur_px)
    left = right - 0.5 / blur_px
    right += 0.5 / blur_px
    right_share, left_share = ndtr(right), ndtr(left)
    bells = np.exp(-0.5 * right * right) - np.exp(-0.5 * left * left)
    bells *= 1.0 / _ROOT_TWO_PI
    right *= right_share
    left *= left_share
    right -= left
    right += bells
    right *= blur_px
    right_share -= left_share
    return right, right_share, bells


@dataclass(frozen=True)
class _Pixels:
    """Pixels around the sides, from inside to outside: (s,station,across) each.

    Attributes:
        colours: (…,3) float32.
        out_px: distance outward from the side.
        along: place along it, -1 to 1 between the ends of what is looked at.
        use: 1 where the pixel counts; 0 where it is another's double, too far out, or outside of the picture.
        columns: (s,) columns (rows) of pixels that differ.
    """

    colours: npt.NDArray[np.float32]
    out_px: Array
    along: Array
    use: Array
    columns: Array


def _pixels(image: Image, sides: Sides, camera: Camera, half_px: Array) -> _Pixels:
    """Columns of pixels across flat sides, rows across steep ones."""
    steep = (np.abs(sides.along[:, 1]) > np.abs(sides.along[:, 0])).astype(np.intp)
    packed = np.concatenate([sides.middle_px, sides.along, sides.outward], axis=1)
    packed = packed[np.arange(len(steep))[:, None], _AXES[steep]].T[:, :, None]
    middle_main, middle_other, along_main, along_other, _, out_other = packed
    # Stations are whole columns (rows): as many as the side covers, spread evenly when there are too many.
    reach_main = np.abs(along_main) * half_px[:, None]
    first, last = np.ceil(middle_main - reach_main), np.floor(middle_main + reach_main)
    count = np.minimum(np.maximum(last - first + 1.0, 1.0), len(_STATIONS))
    spacing = (last - first) / np.maximum(count - 1.0, 1.0)
    station = np.rint(first + np.minimum(_STATIONS, count - 1.0) * spacing)
    along_px = (station - middle_main) / along_main
    across = np.arange(-(reach := min(math.ceil(float(sides.reach_px.max())), _MOST_ACROSS)), reach + 1.0)
    across = np.where(out_other >= 0.0, 1.0, -1.0)[..., None] * across
    if camera.has_distortion:
        lens = _lens(sides, along_px, steep, camera)
        station = np.rint(lens.foot_main_px)
        other = np.rint(lens.foot_other_px)[..., None] + across
        from_other, from_main = other - lens.foot_other_px[..., None], (station - lens.foot_main_px)[..., None]
        out_px = lens.out_by_other * from_other + lens.out_by_main * from_main
        along_px = along_px[..., None] + lens.along_by_other * from_other + lens.along_by_main * from_main
    else:
        foot_other = middle_other + along_px * along_other
        other = np.rint(foot_other)[..., None] + across
        from_other = other - foot_other[..., None]
        out_px = out_other[..., None] * from_other
        along_px = along_px[..., None] + along_other[..., None] * from_other
    use = ((np.abs(out_px) <= (sides.reach_px + 0.5)[:, None, None]) & (count > _STATIONS)[..., None]).astype(float)
    height, width = image.shape[:2]
    size_main, size_other = np.where(steep, height, width)[:, None], np.where(steep, width, height)[:, None, None]
    if np.any(station < 0.0) or np.any(station >= size_main) or np.any(other < 0.0) or np.any(other >= size_other):
        use *= ((station >= 0.0) & (station < size_main))[..., None] & (other >= 0.0) & (other < size_other)
        station, other = np.clip(station, 0.0, size_main - 1.0), np.clip(other, 0.0, size_other - 1.0)
    index = other * np.where(steep, 1.0, width)[:, None, None]
    index += (station * np.where(steep, width, 1.0)[:, None])[..., None]
    colours = image.reshape(-1, 3).take(index.astype(np.intp), axis=0).astype(np.float32)
    along_px *= (1.0 / half_px)[:, None, None]
    return _Pixels(colours, out_px, along_px, use, count[:, 0])


@dataclass(frozen=True)
class _Lens:
    """Where stations lie in the distorted picture (s,station), and the inverse scales there (s,station,1)."""

    foot_main_px: Array
    foot_other_px: Array
    along_by_main: Array
    along_by_other: Array
    out_by_main: Array
    out_by_other: Array


def _lens(sides: Sides, along_px: Array, steep: npt.NDArray[np.intp], camera: Camera) -> _Lens:
    foot = sides.middle_px[:, None] + along_px[..., None] * sides.along[:, None]
    shifted = np.stack([foot, foot + sides.along[:, None], foot + sides.outward[:, None]])
    raw_px = distort(shifted.reshape(-1, 2), camera).reshape(shifted.shape)
    raw_px = np.where(steep[None, :, None, None] > 0, raw_px[..., ::-1], raw_px)
    foot_px = raw_px[0]
    (a_main, a_other), (o_main, o_other) = ((raw_px[k] - foot_px).transpose(2, 0, 1)[..., None] for k in (1, 2))
    scale = 1.0 / (a_main * o_other - a_other * o_main)
    return _Lens(foot_px[..., 0], foot_px[..., 1], o_other * scale, -o_main * scale, -a_other * scale, a_main * scale)


def _contrasts(pixels: _Pixels, held: npt.NDArray[np.bool_] | None) -> Array | None:
    """Pixels (s,station,across) from 0 outside to 1 inside, by the outermost two; None without contrast."""
    colours = pixels.colours if held is None else pixels.colours[~held]
    mean = colours.sum(axis=(0, 1)) / max(colours.shape[0] * colours.shape[1], 1)
    direction = contrast_direction(0.5 * (mean[0] + mean[1]), 0.5 * (mean[-1] + mean[-2]))
    if direction is None:
        return None
    profile = pixels.colours @ direction.astype(np.float32)
    means = profile.sum(axis=1) / profile.shape[1]
    ground = 0.5 * (means[:, -1] + means[:, -2])
    span = 0.5 * (means[:, 0] + means[:, 1]) - ground
    if held is not None:
        span[held] = 1.0
    if not span.min() >= _LEAST_SIDE_CONTRAST:
        return None
    return np.asarray((profile - ground[:, None, None]) / span[:, None, None], float)


def _coarse(values: Array, pixels: _Pixels) -> Array:
    """(2,s) offset and tilt over the half length [px] from the area under each column of pixels."""
    count = values.shape[2]
    spacing_px = (pixels.out_px[:, :, -1] - pixels.out_px[:, :, 0]) / (count - 1)
    crossing_px = pixels.out_px[:, :, 0] + (values.sum(axis=2) - 0.5) * spacing_px
    middle_px = np.sort(crossing_px, axis=1)[:, crossing_px.shape[1] // 2, None]
    crossing_px = np.minimum(np.maximum(crossing_px, middle_px - 1.0), middle_px + 1.0)
    along = pixels.along[:, :, count // 2]
    mean = along.mean(axis=1)
    centred = along - mean[:, None]
    tilt_px = (centred * crossing_px).sum(axis=1) / np.maximum((centred * centred).sum(axis=1), 1e-6)
    return np.array([crossing_px.mean(axis=1) - tilt_px * mean, tilt_px])


def _blur_px(values: Array, pixels: _Pixels, ends: Array) -> float:
    """A first guess of the blur from the second moment of the edges.

    The differences of neighbouring pixels spread about an edge by σ² + 1/12 px² for a pixel's own size and 1/12 more
    for its sampling, on average over where the edge meets the pixels.
    """
    steps = values[:, :, :-1] - values[:, :, 1:]
    between_px = 0.5 * (pixels.out_px[:, :, :-1] + pixels.out_px[:, :, 1:])
    between_px -= ends[0][:, None, None] + ends[1][:, None, None] * pixels.along[:, :, :-1]
    spread = np.einsum("spx,spx,spx->s", steps, between_px, between_px) / np.maximum(steps.sum(axis=(1, 2)), 1e-3)
    spacing_px = pixels.out_px[:, 0, 1] - pixels.out_px[:, 0, 0]
    variance = float(np.sort(spread - (1.0 + spacing_px**2) / 12.0)[len(spread) // 2])
    return min(max(math.sqrt(max(variance, 0.0)), _BLUR_PX[0]), _BLUR_PX[1])


def _fit(image: Image, sides: Sides, camera: Camera, floor_px: float, blur_px: float | None) -> SideFit | None:
    half_px = sides.half_px()
    pixels = _pixels(image, sides, camera, half_px)
    values = _contrasts(pixels, sides.held)
    if values is None:
        return None
    ends = _coarse(values, pixels)
    if blur_px is None:
        blur_px = _blur_px(values, pixels, ends)
    for _ in range(_STEPS):
        inside_px = ends[1][:, None, None] * pixels.along
        inside_px += ends[0][:, None, None]
        inside_px -= pixels.out_px
        residual, density, by_blur = edge_response(inside_px, blur_px)
        np.subtract(values, residual, out=residual)
        density *= pixels.use
        by_blur *= pixels.use
        tilted = density * pixels.along
        a, b, c, p, q, blur_a, blur_b = (
            np.einsum("spx,spx->s", *pair)
            for pair in (
                (density, density),
                (density, tilted),
                (tilted, tilted),
                (density, residual),
                (tilted, residual),
                (density, by_blur),
                (tilted, by_blur),
            )
        )
        scale = 1.0 / np.maximum(a * c - b * b, 1e-9)
        step = np.array([c * p - b * q, a * q - b * p]) * scale
        # The blur is one for all sides: what it gains once every side has moved along with it.
        with_blur = np.array([c * blur_a - b * blur_b, a * blur_b - b * blur_a]) * scale
        gain = float(np.vdot(by_blur, residual) - (with_blur * (p, q)).sum())
        curvature = float(np.vdot(by_blur, by_blur) - (with_blur * (blur_a, blur_b)).sum())
        blurrier_px = gain / curvature if curvature > 1e-6 else 0.0
        blurrier_px = min(max(blurrier_px, -0.5 * blur_px, _BLUR_PX[0] - blur_px), blur_px)
        step -= with_blur * blurrier_px
        if sides.held is not None:
            step[:, sides.held] = 0.0
        ends += np.minimum(np.maximum(step, -1.0), 1.0)
        blur_px += blurrier_px
        if not (np.abs(step).max() > _REFIT_PX or abs(blurrier_px) > _REBLUR * blur_px):
            break
    off_px = np.abs(ends).sum(axis=0)
    if not (
        np.all(off_px <= sides.reach_px) if sides.held is None else np.all((off_px <= sides.reach_px) | sides.held)
    ):
        return None
    misfit2 = np.einsum("spx,spx,spx->s", residual, residual, pixels.use) - (step[0] * p + step[1] * q)
    noise2 = np.maximum(misfit2, 0.0) / np.maximum(np.einsum("spx->s", pixels.use) - 2.0, 1.0) * scale
    floor2 = floor_px**2 / pixels.columns
    variance = np.array([noise2 * c + floor2, -noise2 * b / half_px, (noise2 * a + 3.0 * floor2) / half_px**2])
    if sides.held is not None:
        ends[:, sides.held] = 0.0
        variance[:, sides.held] = (
            _HELD_PX**2 * np.array([np.ones_like(half_px), 0.0 * half_px, half_px**-2])[:, sides.held]
        )
    return SideFit(sides, ends[0], ends[1] / half_px, variance, blur_px)


def intersect_sides(fit: SideFit) -> tuple[Array, Array] | None:
    """Corners (n,4,2) [px] where each side meets the one before it, and the square root of their information.

    Returns:
        The corners, and (n,8,8) [1/px] what turns a deviation of a quadrilateral's corners into standard deviations of
        its sides' ends; None when neighbours are parallel.
    """
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
    first = np.sqrt(both + start_px * (2.0 * cross + start_px * square))
    mixed = (both + (start_px + end_px) * cross + start_px * end_px * square) / first
    second = np.sqrt(np.maximum(both + end_px * (2.0 * cross + end_px * square) - mixed * mixed, 1e-12))
    whiten = np.zeros((len(corners_px), 4, 2, 4, 2))
    by_first, by_second = normal / first[..., None], normal / second[..., None]
    by_mixed = by_first * (-mixed / second)[..., None]
    for side, following in enumerate(_NEXT):
        whiten[:, side, 0, side] = by_first[:, side]
        whiten[:, side, 1, side] = by_mixed[:, side]
        whiten[:, side, 1, following] = by_second[:, side]
    return corners_px, whiten.reshape(-1, 8, 8)
