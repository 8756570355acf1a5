"""The third stage: sub-pixel corners, where straight edges meet that are fitted to the pixels around the sides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from shipland.camera import Camera
from shipland.frames import Array
from shipland.vision.near.edge_pixels import (
    EdgePixels,
    Profile,
    Sides,
    contrasts,
    distort,
    edge_pixels,
    on_even_ground,
)
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.segment import Image, edge_distances, reaches_edge

_ROOT_TWO_PI = math.sqrt(2.0 * math.pi)

_RECENTRE = 0.4
"""A side farther than this fraction of the reach from where its pixels were taken is measured once more."""

_RECENTRE_BLURRED = 0.15
"""The same for much blurred pictures, as a fraction of the blur: the visible part of a side depends on its ends."""

_MUCH_BLURRED_PX = 0.75
"""Least blur of a much blurred picture; below, the error is 0.02 px at most."""

_REFIT_PX = 0.08
"""A Gauss–Newton step longer than this is followed by another; the error left is of its square."""

_REBLUR = 0.15
"""The same for the blur, as a fraction of it."""

_STEPS = 6
"""Most Gauss–Newton steps."""

_TRIES = 6
"""Times that sides are measured, each from where the last left them, before they are given up."""

_REACH_PER_BLUR = 3.0
"""Pixels must be taken so much farther out than the blur that the outermost show the plain colours."""

_BLUR_PX = (0.12, 8.0)
"""Range of the blur that is taken from the picture."""

_SHARP = 0.12
"""Blur, against the reach, up to which the outermost pixels show what is behind the cue and nothing of the edge."""

_ROUNDING_BLUR_PX = 0.5
"""Blur from which rounded corners reach the pixels of a side, and the edge reaches the outermost of them."""

_MISFIT = 0.024
"""Root-mean-square misfit, against the contrast, from which a picture is taken for coded and a side is measured by its
luma as well: above a sensor's noise, below that of coded colour."""

_MISFIT_LEVELS = 3.5
"""The same in grey levels of a sensor's noise, for small contrasts. Rendered pictures with noise of 1.5 have 1.5 to 2.7
where the lamp clips and its other colours are measured; H.264 at 8 Mbit/s has 5 and more in 95 % of such pictures."""

_DOUBTFUL_MISFIT = 0.15
"""Misfit from which sides are measured anew, with the blur taken from the picture."""

_MOST_MISFIT = 0.25
"""Misfit, measured anew, of sides that are no edges."""

_CODED_SIDE_PX = 20.0
"""Length of a side up to which coding moves it as a whole: about a block's."""

_TILTED_SIDE_PX, _MOST_TILTED = 28.0, 1.6
"""Length of a side from which coding moves one end against the middle as far as all of it, a shorter one moves as a
whole; and how much more that is at most, as variances."""

_BLOOM = 4.0
"""How much larger the common outward error of all sides may be where every colour clips."""

_STRAY_LEVEL = 0.4
"""Difference of a column's levels from the side's median, against the contrast, from which it shows another edge."""

_STRAY_PX = 1.0
"""The same of its edge from the side's line."""

_ALIKE = 0.7
"""Share of both up to which no column is looked for."""

_MOST_STRAY = 0.5
"""Share of a side's columns from which no line is that of most, and none is left out."""

_FIRST, _LAST = np.array([(0, 19), (0, 10), (9, 19), (2, 12), (5, 15), (7, 17), (3, 10), (9, 16), (1, 8), (11, 18)]).T
"""Pairs of stations through which lines are laid to find the one that most agree with."""

_HELD_PX = 0.05
"""Standard deviation of a side that is taken to lie on the picture's edge."""


@dataclass(frozen=True)
class MeasuredCorners:
    """Corners at sub-pixel.

    Attributes:
        corners_px: (n,4,2) undistorted.
        whiten: (n,8,8) [1/px] turns deviations of a quadrilateral's (column, row) × four corners into standard
            deviations.
        noise_px: standard deviation of a corner on either axis, about: of the sides' ends, root mean square.
        edge_bias_px: (n,4,2) how the corners move when all sides err outward together, by one standard deviation; None
            when the method has no sides.
        blur_px: standard deviation of the picture's blur; None when the method does not measure it.
        held: (n,4) sides that lie along the picture's edge; None for none.
        hidden: (n,4) sides that something hides, which were not measured; None for none.
        coded: the picture was compressed, by its misfit.
    """

    corners_px: Array
    whiten: Array
    noise_px: float
    edge_bias_px: Array | None = None
    blur_px: float | None = None
    held: npt.NDArray[np.bool_] | None = None
    hidden: npt.NDArray[np.bool_] | None = None
    coded: bool = False


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
        noisy: the misfit is larger than sensors leave.
        clipped: the inside saturates.
    """

    sides: Sides
    offset_px: Array
    slope: Array
    variance: Array
    blur_px: float
    misfit: float
    noisy: bool
    clipped: bool


def measure_corners(
    image: Image, quads_px: Array, camera: Camera, parameters: VisionParameters, blur_px: float | None = None
) -> MeasuredCorners | None:
    """Corners where the lines fitted to the sides meet, in undistorted pixels, where sides are straight.

    The area under each column of pixels across a side finds it coarsely. Then Gauss–Newton fits one straight edge to
    all of the side's pixels, each of which sees the edge through its own square and the picture's blur. A side that
    turns out far from where its pixels were taken, or blurred more than they reach, is measured once more.

    Args:
        image: (H,W,3) BGR.
        quads_px: (n,4,2) corners to within two pixels, clockwise, undistorted.
        camera: its distortion is taken out.
        parameters: sizes and error floors.
        blur_px: a guess of the picture's blur, as the last one's; None to take it from the picture.

    Returns:
        None when there is no contrast, a side is too far off, or sides are parallel.
    """
    sides = Sides.of(quads_px, parameters.edge_reach_px, _held(image, quads_px, camera))
    for attempt in range(_TRIES):
        fit = _fit(image, sides, camera, parameters, blur_px)
        if fit is None or fit.blur_px * _REACH_PER_BLUR > float(sides.reach_px.min()):
            wider = sides.wider()
            if np.any(wider.reach_px > sides.reach_px):
                sides, blur_px = wider, None
                continue
        if fit is not None and attempt > 0 and fit.misfit > _MOST_MISFIT:
            return None
        met = None if fit is None else _intersected(fit, parameters.edge_bias_px * (_BLOOM if fit.clipped else 1.0))
        if fit is None or met is None:
            return None
        ends_px = np.abs(fit.offset_px) + np.abs(fit.slope) * sides.half_px()
        settled = fit.blur_px <= _MUCH_BLURRED_PX or attempt > _TRIES // 2
        near = _RECENTRE * sides.reach_px if settled else _RECENTRE_BLURRED * fit.blur_px
        if np.all(ends_px <= near) and (attempt > 0 or fit.misfit <= _DOUBTFUL_MISFIT):
            return met
        if fit.misfit > _DOUBTFUL_MISFIT:
            blur_px = None
        sides = replace(Sides.of(met.corners_px, 0.0, sides.held), reach_px=sides.reach_px)
    return None


def edge_response(inside_px: Array, blur_px: float) -> tuple[Array, Array, Array]:
    """What a pixel sees of a straight edge whose bright side covers its centre by `inside_px`, and its derivatives.

    A step averaged over a pixel's width and blurred by a Gaussian: G(d + ½) − G(d − ½), G(x) = x Φ(x/σ) + σ φ(x/σ).
    The derivatives are by the distance and by σ.
    """
    ends = np.empty((2, *inside_px.shape))
    np.multiply(inside_px, 1.0 / blur_px, out=ends[1])
    np.add(ends[1], 0.5 / blur_px, out=ends[0])
    ends[1] -= 0.5 / blur_px
    share = ndtr(ends)
    bell = ends * ends
    bell *= -0.5
    np.exp(bell, out=bell)
    bells = bell[0]
    bells -= bell[1]
    bells *= 1.0 / _ROOT_TWO_PI
    ends *= share
    response = ends[0]
    response -= ends[1]
    response += bells
    response *= blur_px
    density = share[0]
    density -= share[1]
    return response, density, bells


def stray_stations(values: Array, pixels: EdgePixels) -> npt.NDArray[np.bool_] | None:
    """(s,station) columns of pixels that do not show a side's edge, as where a finger lies over it; None for none.

    They have other levels than most of the side, or an edge off the line on which most have theirs.
    """
    ends = _coarse(values, pixels)
    if _all_alike(values, pixels, ends):
        return None
    count, stations = values.shape[2], np.arange(values.shape[1])
    counted = np.asarray(pixels.use.any(axis=2))
    # Where there are fewer stations than room for them, the last one is repeated: all count alike here.
    alike = stations * counted.sum(axis=1)[:, None] // len(stations)
    inner, outer = 0.5 * (values[:, :, 0] + values[:, :, 1]), 0.5 * (values[:, :, -1] + values[:, :, -2])
    inside, outside = (np.median(np.take_along_axis(ends, alike, 1), axis=1)[:, None] for ends in (inner, outer))
    span = np.maximum(inside - outside, 0.1)
    stray = np.maximum(np.abs(inner - inside), np.abs(outer - outside)) > _STRAY_LEVEL * span
    share = (values.sum(axis=2) / count - outside) / span
    innermost_px = pixels.out_px[:, :, 0]
    crossing_px = innermost_px + (share * count - 0.5) / (count - 1) * (pixels.out_px[:, :, -1] - innermost_px)
    along = pixels.along[:, :, count // 2]
    first, last = alike[:, _FIRST], alike[:, _LAST]
    start, end = np.take_along_axis(along, first, 1), np.take_along_axis(along, last, 1)
    start_px, end_px = np.take_along_axis(crossing_px, first, 1), np.take_along_axis(crossing_px, last, 1)
    slope = (end_px - start_px) / np.where(np.abs(end - start) < 0.1, np.inf, end - start)
    off_px = np.abs(crossing_px[:, None] - start_px[..., None] - slope[..., None] * (along[:, None] - start[..., None]))
    agree = (off_px <= _STRAY_PX) & ~stray[:, None] & counted[:, None]
    best = np.argmax(agree.sum(axis=2), axis=1)
    stray = np.asarray(counted & ~agree[np.arange(len(values)), best])
    few = np.asarray(stray.sum(axis=1) < _MOST_STRAY * counted.sum(axis=1))
    stray &= few[:, None]
    return stray if stray.any() else None


def _all_alike(values: Array, pixels: EdgePixels, ends: Array) -> bool:
    """Whether all stations have nearly the levels of their side, and their edges lie near its line `ends` (2,s)."""
    inner, outer = values[:, :, :2], values[:, :, -2:]
    if max(1.0 - inner.min(), inner.max() - 1.0, -outer.min(), outer.max()) > _ALIKE * _STRAY_LEVEL:
        return False
    count = values.shape[2]
    innermost_px = pixels.out_px[:, :, 0]
    crossing_px = (values.sum(axis=2) - 0.5) / (count - 1) * (pixels.out_px[:, :, -1] - innermost_px) + innermost_px
    crossing_px -= ends[0][:, None] + ends[1][:, None] * pixels.along[:, :, count // 2]
    return bool(np.abs(crossing_px).max() <= _ALIKE * _STRAY_PX)


def _coarse(values: Array, pixels: EdgePixels) -> Array:
    """(2,s) offset and tilt over the half length [px] from the area under each column of pixels."""
    stations, count = values.shape[1:]
    innermost_px = pixels.out_px[:, :, 0]
    crossing_px = values @ np.full(count, 1.0 / (count - 1))
    crossing_px -= 0.5 / (count - 1)
    crossing_px *= pixels.out_px[:, :, -1] - innermost_px
    crossing_px += innermost_px
    middle_px = np.sort(crossing_px, axis=1)[:, stations // 2, None]
    crossing_px = np.minimum(np.maximum(crossing_px, middle_px - 1.0), middle_px + 1.0)
    along = pixels.along[:, :, count // 2]
    weights = np.full(stations, 1.0 / stations)
    mean, offset_px = along @ weights, crossing_px @ weights
    variance = (along * along) @ weights - mean * mean
    tilt_px = ((along * crossing_px) @ weights - mean * offset_px) / np.maximum(variance, 1e-6)
    return np.array([offset_px - tilt_px * mean, tilt_px])


def _blur_px(values: Array, pixels: EdgePixels, ends: Array) -> float:
    """A first guess of the blur from the second moment of the edges.

    The differences of neighbouring pixels have the variance σ² + 1/12 px² for a pixel's own size and 1/12 more
    for its sampling, on average over where the edge meets the pixels.
    """
    steps = values[:, :, :-1] - values[:, :, 1:]
    between_px = 0.5 * (pixels.out_px[:, :, :-1] + pixels.out_px[:, :, 1:])
    between_px -= ends[0][:, None, None] + ends[1][:, None, None] * pixels.along[:, :, :-1]
    moment = np.einsum("spx,spx,spx->s", steps, between_px, between_px) / np.maximum(steps.sum(axis=(1, 2)), 1e-3)
    spacing_px = pixels.out_px[:, 0, 1] - pixels.out_px[:, 0, 0]
    variance = float(np.sort(moment - (1.0 + spacing_px**2) / 12.0)[len(moment) // 2])
    return min(max(math.sqrt(max(variance, 0.0)), _BLUR_PX[0]), _BLUR_PX[1])


def _rounding(pixels: EdgePixels, sides: Sides, half_px: Array, blur_px: float) -> Array:
    """(s,station,across) what the blur leaves of the inside near a side's ends, where its neighbours cut it off."""
    width_px = math.sqrt(blur_px * blur_px + 1.0 / 12.0)
    along = pixels.along * (half_px / width_px)[:, None, None]
    end = (0.5 / width_px * sides.length_px)[:, None, None]
    left = ndtr(along + end)
    left -= ndtr(along - end)
    return np.asarray(left)


def _fit(
    image: Image, sides: Sides, camera: Camera, parameters: VisionParameters, blur_px: float | None
) -> SideFit | None:
    pixels = edge_pixels(image, sides, camera, sides.half_px())
    profile = contrasts(pixels, sides.held, by_luma=False)
    if profile is not None and (stray := stray_stations(profile[0], pixels)) is not None:
        pixels = pixels.without(stray)
        profile = contrasts(pixels, sides.held, by_luma=False)
    fit = _fit_to(profile, pixels, sides, parameters, blur_px)
    if fit is not None and not fit.noisy:
        return fit
    by_luma = _fit_to(contrasts(pixels, sides.held, by_luma=True), pixels, sides, parameters, None)
    fits = [it for it in (fit, by_luma) if it is not None]
    if not fits:
        return None
    stated = [_as_coded(it, parameters) if it.noisy else it for it in fits]
    # Two coded fits are compared by their pixels; beside a clean one, what coding adds counts.
    compared = fits if all(it.noisy for it in fits) else stated
    return stated[int(np.argmin([float(it.variance[0].sum()) for it in compared]))]


def _as_coded(fit: SideFit, parameters: VisionParameters) -> SideFit:
    """A fit whose misfit is that of coding, with what coding adds to its variance."""
    sides = fit.sides
    coded2 = (parameters.edge_coded_px * fit.misfit) ** 2 * _CODED_SIDE_PX / np.maximum(sides.length_px, _CODED_SIDE_PX)
    if fit.clipped:  # which a side that crosses several rows of pixels (columns, if it is steep) averages out
        crossed = sides.length_px * np.abs(sides.along).min(axis=1) / np.abs(sides.along).max(axis=1)
        coded2 += (parameters.edge_clipped_px / np.maximum(crossed, 1.0)) ** 2
    tilted2 = coded2 * np.minimum(sides.length_px / _TILTED_SIDE_PX, _MOST_TILTED) / sides.half_px() ** 2
    more = np.array([coded2, np.zeros_like(coded2), tilted2])
    return replace(fit, variance=fit.variance + (more if sides.held is None else more * ~sides.held))


def _fit_to(
    profile: Profile | None, pixels: EdgePixels, sides: Sides, parameters: VisionParameters, blur_px: float | None
) -> SideFit | None:
    if profile is None:
        return None
    half_px = sides.half_px()
    values, clipped, per_level = profile
    ends = _coarse(values, pixels)
    if blur_px is None:
        blur_px = _blur_px(values, pixels, ends)
    if blur_px <= _SHARP * float(sides.reach_px.min()):
        values = on_even_ground(values, pixels.along[:, :, values.shape[2] // 2])
        ends = _coarse(values, pixels)
    sides_count, stations, across = values.shape
    columns = np.empty((4, sides_count, stations, across))
    for _ in range(_STEPS):
        inside_px = ends[1][:, None, None] * pixels.along
        inside_px += ends[0][:, None, None]
        inside_px -= pixels.out_px
        residual, density, by_blur = edge_response(inside_px, blur_px)
        if blur_px > _ROUNDING_BLUR_PX:
            rounding = _rounding(pixels, sides, half_px, blur_px)
            for part in (residual, density, by_blur):
                part *= rounding
            # The outermost pixels, which gave the levels 1 and 0, do not quite show them.
            levels = residual.sum(axis=1) / residual.shape[1]
            ground = 0.5 * (levels[:, -1] + levels[:, -2])
            span = 0.5 * (levels[:, 0] + levels[:, 1]) - ground
            residual = ground[:, None, None] + values * span[:, None, None] - residual
        else:
            np.subtract(values, residual, out=residual)
        np.multiply(density, pixels.use, out=columns[0])
        np.multiply(columns[0], pixels.along, out=columns[1])
        np.multiply(residual, pixels.use, out=columns[2])
        np.multiply(by_blur, pixels.use, out=columns[3])
        by_side = columns.reshape(4, sides_count, -1).transpose(1, 0, 2)
        gram = np.ascontiguousarray((by_side @ by_side.transpose(0, 2, 1)).transpose(1, 2, 0))
        (a, b, p, blur_a), (_, c, q, blur_b), (_, _, residual2, blur_residual), (_, _, _, blur2) = gram
        scale = 1.0 / np.maximum(a * c - b * b, 1e-9)
        step = np.array([c * p - b * q, a * q - b * p]) * scale
        # All sides have the same blur: its step is that of the Schur complement, with every side moved along.
        with_blur = np.array([c * blur_a - b * blur_b, a * blur_b - b * blur_a]) * scale
        gain = float(blur_residual.sum() - with_blur[0] @ p - with_blur[1] @ q)
        curvature = float(blur2.sum() - with_blur[0] @ blur_a - with_blur[1] @ blur_b)
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
    misfit2 = residual2 - (step[0] * p + step[1] * q)
    noise2 = np.maximum(misfit2, 0.0) / np.maximum(pixels.use.reshape(sides_count, -1).sum(axis=1) - 2.0, 1.0)
    misfit = math.sqrt(float(noise2.mean()))
    # The levels inside and outside come from two pixels a column each, and shift the edge as they err.
    levels2 = noise2 * pixels.columns / np.maximum(4.0 * a * a, 1e-9)
    noise2 *= scale
    floor2 = parameters.edge_floor_px**2 / pixels.columns + levels2
    noisy = misfit > max(_MISFIT, _MISFIT_LEVELS * per_level)
    whole2 = parameters.edge_clipped_px**2 if clipped and not noisy else 0.0
    variance = np.array(
        [noise2 * c + floor2 + whole2, -noise2 * b / half_px, (noise2 * a + 3.0 * floor2 + whole2) / half_px**2]
    )
    if sides.held is not None:
        ends[:, sides.held] = 0.0
        variance[:, sides.held] = (
            _HELD_PX**2 * np.array([np.ones_like(half_px), 0.0 * half_px, half_px**-2])[:, sides.held]
        )
    return SideFit(sides, ends[0], ends[1] / half_px, variance, blur_px, misfit, noisy, clipped)


def _intersected(fit: SideFit, edge_bias_std_px: float) -> MeasuredCorners | None:
    """The corners of fitted sides, each between a side and the one before it; None when neighbours are parallel."""
    moved = fit.sides.moved(fit.offset_px, fit.slope)
    corners = fit.sides.corners
    side = np.arange(corners)
    following, preceding = (side + 1) % corners, side - 1
    along, normal = moved.along.reshape(-1, corners, 2), moved.outward.reshape(-1, corners, 2)
    middle_px = moved.middle_px.reshape(-1, corners, 2)
    before = along[:, preceding]
    determinant = before[..., 0] * along[..., 1] - before[..., 1] * along[..., 0]
    if not np.abs(determinant).min() >= 0.2:
        return None
    # From the middle of the side before, along it, to where it meets this one.
    middle_before_px = middle_px[:, preceding]
    apart_px = middle_px - middle_before_px
    lever_px = (apart_px[..., 0] * along[..., 1] - apart_px[..., 1] * along[..., 0]) / determinant
    corners_px = middle_before_px + lever_px[..., None] * before
    # Deviations of the two ends' distances from a side have its variance V0 + (x + y) V1 + x y V2 at the levers x, y.
    start_px = ((corners_px - middle_px) * along).sum(axis=-1)
    end_px = lever_px[:, following]
    both, cross, square = fit.variance.reshape(3, -1, corners)
    at_start, at_end = both + start_px * cross, cross + start_px * square
    first = np.sqrt(at_start + start_px * at_end)
    mixed = (at_start + end_px * at_end) / first
    second = np.sqrt(np.maximum(both + end_px * (2.0 * cross + end_px * square) - mixed * mixed, 1e-12))
    whiten = np.zeros((len(corners_px), corners, 2, corners, 2))
    whiten[:, side, 0, side] = by_first = normal / first[..., None]
    whiten[:, side, 1, side] = by_first * (-mixed / second)[..., None]
    whiten[:, side, 1, following] = normal / second[..., None]
    normal_before = normal[:, preceding]
    moved_px = (
        np.ones(along.shape[:2]) if fit.sides.held is None else (~fit.sides.held).astype(float).reshape(-1, corners)
    )
    moved_px, moved_before_px = moved_px[..., None], moved_px[:, preceding, None]
    cosine = (normal * normal_before).sum(axis=-1, keepdims=True)
    edge_bias = (moved_px - cosine * moved_before_px) * normal + (moved_before_px - cosine * moved_px) * normal_before
    edge_bias /= 1.0 - cosine * cosine
    noise_px = math.sqrt(float(np.vdot(first, first)) / first.size)
    held = None if fit.sides.held is None else fit.sides.held.reshape(-1, corners)
    return MeasuredCorners(
        corners_px,
        whiten.reshape(-1, 2 * corners, 2 * corners),
        noise_px,
        edge_bias_std_px * edge_bias,
        fit.blur_px,
        held,
        coded=fit.noisy,
    )


def _held(image: Image, quads_px: Array, camera: Camera) -> npt.NDArray[np.bool_] | None:
    """(4n,) sides that lie on the picture's edge, where `find_quads` has set them; None when none does."""
    raw_px = distort(quads_px.reshape(-1, 2), camera).reshape(quads_px.shape)
    if not reaches_edge(raw_px, image.shape[1], image.shape[0]):
        return None
    on = edge_distances(raw_px, image.shape[1], image.shape[0]) < 0.5
    held = (on & np.roll(on, -1, axis=1)).any(axis=-1).reshape(-1)
    return held if held.any() else None
