"""The third stage: sub-pixel corners, where straight edges meet that are fitted to the pixels around the sides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.frames import Array
from shipland.vision.near.edge_pixels import Sides, contrasts, distort, set_on_even_ground, stations_of, take_pixels
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.segment import Image, edge_distances, reaches_edge

_NODES, _LAST_NODE = 64, 8.5
"""Places a unit at which the normal distribution is tabulated, and up to where it differs from 0 and 1."""

_SIXTH = 1.0 / 6.0

_AT = np.arange(-_NODES * _LAST_NODE, _NODES * _LAST_NODE + 1.0) / _NODES
_SHARE, _DENSITY = ndtr(_AT), np.exp(-0.5 * _AT * _AT) / math.sqrt(2.0 * math.pi)

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

_FIRST = np.array([0, 0, 9, 2, 5, 7, 3, 9, 1, 11])
_LAST = np.array([19, 10, 19, 12, 15, 17, 10, 16, 8, 18])
"""Pairs of stations through which lines are laid to find the one that most agree with."""

_LEAST_TURN = 0.2
"""Sine of the least angle between neighbouring sides that meet in a corner."""

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


Fit = tuple[bool, float, float, bool, bool]
"""Whether sides could be fitted; standard deviation of the picture's blur [px]; root-mean-square residual of pixels,
against the contrast; whether that is larger than sensors leave; whether the inside saturates."""

SideArrays = tuple[Array, Array, Array, Array, npt.NDArray[np.bool_]]
"""Of sides (s,…): outward normal, length, half of it that is looked at, reach [px], held."""

Pixels = tuple[npt.NDArray[np.uint8], Array, Array, Array]
"""Of `take_pixels`: levels, distance outward, place along the side, whether they count."""


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
    guess_px = math.nan if blur_px is None else blur_px
    errors_px = (parameters.edge_floor_px, parameters.edge_clipped_px, parameters.edge_coded_px)
    count, (polygons, corners) = len(sides.length_px), quads_px.shape[:2]
    for attempt in range(_TRIES):
        lens, columns = stations_of(sides, camera)
        arrays = sides.outward, sides.length_px, sides.half_px(), sides.reach_px, sides.held
        ends, variance = np.empty((2, count)), np.empty((3, count))
        fitted, blur, misfit, noisy, clipped = _fit_sides(
            image, arrays, lens, columns, guess_px, errors_px, ends, variance
        )
        if not fitted or blur * _REACH_PER_BLUR > float(sides.reach_px.min()):
            wider = sides.wider()
            if np.any(wider.reach_px > sides.reach_px):
                sides, guess_px = wider, math.nan
                continue
        if not fitted or (attempt > 0 and misfit > _MOST_MISFIT):
            return None
        corners_px, bias_px = np.empty((polygons, corners, 2)), np.empty((polygons, corners, 2))
        whiten = np.zeros((polygons, 2 * corners, 2 * corners))
        noise_px = _intersect(sides.middle_px, arrays, ends, variance, corners_px, whiten, bias_px)
        if not noise_px >= 0.0:
            return None
        settled = blur <= _MUCH_BLURRED_PX or attempt > _TRIES // 2
        near = _RECENTRE * sides.reach_px if settled else _RECENTRE_BLURRED * blur
        if np.all(np.abs(ends).sum(axis=0) <= near) and (attempt > 0 or misfit <= _DOUBTFUL_MISFIT):
            bias_px *= parameters.edge_bias_px * (_BLOOM if clipped else 1.0)
            held = sides.held.reshape(polygons, corners) if sides.held.any() else None
            return MeasuredCorners(corners_px, whiten, noise_px, bias_px, blur, held, coded=noisy)
        if misfit > _DOUBTFUL_MISFIT:
            guess_px = math.nan
        sides = replace(Sides.of(corners_px, 0.0, sides.held), reach_px=sides.reach_px)
    return None


@compiled
def normal(x: float) -> tuple[float, float]:
    """The normal distribution Φ(x) and its density, to 1e-15: Taylor's series about tabulated places."""
    if not abs(x) < _LAST_NODE:
        return (1.0 if x > 0.0 else 0.0), 0.0
    index = int((x + _LAST_NODE) * _NODES + 0.5)
    a, density = _AT[index], _DENSITY[index]
    d, a2 = x - a, a * a
    c2, c3 = 0.5 * (a2 - 1.0), _SIXTH * a * (3.0 - a2)
    c4, c5 = 0.25 * _SIXTH * (a2 * (a2 - 6.0) + 3.0), -0.05 * _SIXTH * a * (a2 * (a2 - 10.0) + 15.0)
    share = 1.0 + d * (-0.5 * a + d * (2.0 * _SIXTH * c2 + d * (0.25 * c3 + d * (0.2 * c4 + d * _SIXTH * c5))))
    return _SHARE[index] + density * d * share, density * (1.0 + d * (-a + d * (c2 + d * (c3 + d * (c4 + d * c5)))))


@compiled
def edge_response(inside_px: float, blur_px: float) -> tuple[float, float, float]:
    """What a pixel sees of a straight edge whose bright side covers its centre by `inside_px`, and its derivatives.

    A step averaged over a pixel's width and blurred by a Gaussian: G(d + ½) − G(d − ½), G(x) = x Φ(x/σ) + σ φ(x/σ).
    The derivatives are by the distance and by σ.
    """
    scale = 1.0 / blur_px
    far, near = (inside_px + 0.5) * scale, (inside_px - 0.5) * scale
    far_share, far_density = normal(far)
    near_share, near_density = normal(near)
    by_blur = far_density - near_density
    return blur_px * (far * far_share - near * near_share + by_blur), far_share - near_share, by_blur


@compiled
def _crossings(values: Array, out_px: Array, crossing_px: Array) -> None:
    """Write where each column of a side's pixels (station,across) crosses the edge [px], by the area under it."""
    across = values.shape[1]
    for station in range(len(values)):
        share = (values[station].sum() - 0.5) / (across - 1)
        crossing_px[station] = out_px[station, 0] + share * (out_px[station, -1] - out_px[station, 0])


@compiled
def _coarse(crossing_px: Array, along: Array) -> tuple[float, float]:
    """Offset and tilt over the half length [px] of a side, from where its columns of pixels (station,) cross it."""
    stations = len(crossing_px)
    middle_px = np.sort(crossing_px)[stations // 2]
    mean = mean2 = offset_px = moment = 0.0
    for station in range(stations):
        near_px = min(max(crossing_px[station], middle_px - 1.0), middle_px + 1.0)
        mean += along[station] / stations
        mean2 += along[station] * along[station] / stations
        offset_px += near_px / stations
        moment += along[station] * near_px / stations
    tilt_px = (moment - mean * offset_px) / max(mean2 - mean * mean, 1e-6)
    return offset_px - tilt_px * mean, tilt_px


@compiled
def _leave_out_strays(values: Array, pixels: Pixels, columns: Array) -> bool:
    """Whether columns of pixels do not show a side's edge, as where a finger lies over it; the nearest others stand in.

    They have other levels than most of the side, or an edge off the line on which most have theirs.
    """
    levels, out_px, along, use = pixels
    sides, stations = values.shape[:2]
    if _all_alike(values, out_px, along):
        return False
    stray, counted = np.zeros((sides, stations), np.bool_), np.empty((sides, stations), np.bool_)
    for side in range(sides):
        for station in range(stations):
            counted[side, station] = use[side, station].any()
        _mark_strays(values[side], out_px[side], along[side, :, values.shape[2] // 2], counted[side], stray[side])
    if not stray.any():
        return False
    for side in range(sides):
        kept = counted[side] & ~stray[side]
        share = np.sum(kept) / max(1.0 * np.sum(counted[side]), 1.0)
        columns[side] = max(columns[side] * share, 1.0)
        for station in range(stations):
            if stray[side, station]:
                use[side, station] = 0.0
            if kept.any() and not kept[station]:
                nearest = np.argmin(np.abs(np.arange(stations) - station) + np.where(kept, 0, stations))
                levels[side, station] = levels[side, nearest]
                out_px[side, station] = out_px[side, nearest]
                along[side, station] = along[side, nearest]
    return True


@compiled
def _all_alike(values: Array, out_px: Array, along: Array) -> bool:
    """Whether all stations have nearly the levels of their side, and their edges lie near its line."""
    crossing_px = np.empty(values.shape[1])
    for side in range(len(values)):
        for station in range(values.shape[1]):
            levels = values[side, station]
            inner, outer = min(levels[0], levels[1]), max(levels[-1], levels[-2])
            brighter, darker = max(levels[0], levels[1]), min(levels[-1], levels[-2])
            if max(max(1.0 - inner, brighter - 1.0), max(-darker, outer)) > _ALIKE * _STRAY_LEVEL:
                return False
        middle = along[side, :, values.shape[2] // 2]
        _crossings(values[side], out_px[side], crossing_px)
        offset_px, tilt_px = _coarse(crossing_px, middle)
        if not np.abs(crossing_px - (offset_px + tilt_px * middle)).max() <= _ALIKE * _STRAY_PX:
            return False
    return True


@compiled
def _mark_strays(
    values: Array, out_px: Array, along: Array, counted: npt.NDArray[np.bool_], stray: npt.NDArray[np.bool_]
) -> None:
    """Mark the stray ones among the columns of pixels (station,across) of a side."""
    stations = len(values)
    # Where there are fewer stations than room for them, the last one is repeated: all count alike here.
    alike = np.arange(stations) * np.count_nonzero(counted) // stations
    inner, outer = 0.5 * (values[:, 0] + values[:, 1]), 0.5 * (values[:, -1] + values[:, -2])
    inside, outside = np.median(inner[alike]), np.median(outer[alike])
    span, crossing_px = max(inside - outside, 0.1), np.empty(stations)
    _crossings((values - outside) / span, out_px, crossing_px)
    fits = np.maximum(np.abs(inner - inside), np.abs(outer - outside)) <= _STRAY_LEVEL * span
    most = -1
    for pair in range(len(_FIRST)):
        first, last = alike[_FIRST[pair]], alike[_LAST[pair]]
        run = along[last] - along[first]
        slope = 0.0 if abs(run) < 0.1 else (crossing_px[last] - crossing_px[first]) / run
        off_px = np.abs(crossing_px - crossing_px[first] - slope * (along - along[first]))
        agree = fits & counted & (off_px <= _STRAY_PX)
        if agree.sum() > most:
            most = agree.sum()
            stray[:] = counted & ~agree
    if not np.count_nonzero(stray) < _MOST_STRAY * np.count_nonzero(counted):
        stray[:] = False


@compiled
def _first_blur_px(values: Array, out_px: Array, along: Array, ends: Array) -> float:
    """A first guess of the blur from the second moment of the edges.

    The differences of neighbouring pixels have the variance σ² + 1/12 px² for a pixel's own size and 1/12 more
    for its sampling, on average over where the edge meets the pixels.
    """
    sides, stations, across = values.shape
    variances = np.empty(sides)
    for side in range(sides):
        moment = weight = 0.0
        for station in range(stations):
            for step in range(across - 1):
                fall = values[side, station, step] - values[side, station, step + 1]
                between_px = 0.5 * (out_px[side, station, step] + out_px[side, station, step + 1])
                between_px -= ends[0, side] + ends[1, side] * along[side, station, step]
                moment += fall * between_px * between_px
                weight += fall
        spacing_px = out_px[side, 0, 1] - out_px[side, 0, 0]
        variances[side] = moment / max(weight, 1e-3) - (1.0 + spacing_px * spacing_px) / 12.0
    return min(max(math.sqrt(max(np.sort(variances)[sides // 2], 0.0)), _BLUR_PX[0]), _BLUR_PX[1])


@compiled
def _fit_sides(
    image: Image,
    sides: SideArrays,
    lens: Array,
    columns: Array,
    blur_px: float,
    errors_px: tuple[float, float, float],
    ends: Array,
    variance: Array,
) -> Fit:
    """Fit lines to sides by the colour that differs most, and by luma where that is noisy.

    Args:
        image: (H,W,3) BGR.
        sides: what is measured.
        lens: where stations lie.
        columns: (s,) how many of them.
        blur_px: a guess; NaN to take it from the picture.
        errors_px: `edge_floor_px`, `edge_clipped_px` and `edge_coded_px`.
        ends: (2,s) written: offset outward, and tilt over the half length [px].
        variance: (3,s) written: of the offset, of the two together, of the slope.
    """
    outward, length_px, half_px, reach_px, held = sides
    pixels = take_pixels(image, outward, reach_px, half_px, lens, columns)
    values = np.empty(pixels[1].shape)
    there, clipped, per_level = contrasts(pixels[0], held, False, values)
    if there and _leave_out_strays(values, pixels, columns):
        there, clipped, per_level = contrasts(pixels[0], held, False, values)
    fit = failed = False, blur_px, 0.0, False, clipped
    if there:
        fit = _fit_to(values, pixels, sides, columns, blur_px, errors_px, clipped, per_level, ends, variance)
        if fit[0] and not fit[3]:
            return fit
    other_ends, other_variance = np.empty_like(ends), np.empty_like(variance)
    there, clipped, per_level = contrasts(pixels[0], held, True, values)
    other = failed
    if there:
        other = _fit_to(
            values, pixels, sides, columns, math.nan, errors_px, clipped, per_level, other_ends, other_variance
        )
    # Two coded fits are compared by their pixels; beside a clean one, what coding adds counts.
    of_fit, of_other = variance[0].sum(), other_variance[0].sum()
    if fit[0]:
        _add_coding(fit, outward, length_px, half_px, held, errors_px, variance)
    if other[0] and other[3]:
        _add_coding(other, outward, length_px, half_px, held, errors_px, other_variance)
    elif other[0]:
        of_fit, of_other = variance[0].sum(), other_variance[0].sum()
    if fit[0] and (not other[0] or of_fit <= of_other):
        return fit
    ends[:], variance[:] = other_ends, other_variance
    return other


@compiled
def _add_coding(
    fit: Fit,
    outward: Array,
    length_px: Array,
    half_px: Array,
    held: npt.NDArray[np.bool_],
    errors_px: tuple[float, float, float],
    variance: Array,
) -> None:
    """Add what coding adds to the variance of a fit whose misfit is that of coding."""
    for side in range(len(length_px)):
        if held[side]:
            continue
        coded2 = (errors_px[2] * fit[2]) ** 2 * _CODED_SIDE_PX / max(length_px[side], _CODED_SIDE_PX)
        if fit[4]:  # which a side that crosses several rows of pixels (columns, if it is steep) averages out
            size = np.abs(outward[side])
            crossed = length_px[side] * size.min() / size.max()
            coded2 += (errors_px[1] / max(crossed, 1.0)) ** 2
        variance[0, side] += coded2
        variance[2, side] += coded2 * min(length_px[side] / _TILTED_SIDE_PX, _MOST_TILTED) / half_px[side] ** 2


@compiled
def _fit_to(
    values: Array,
    pixels: Pixels,
    sides: SideArrays,
    columns: Array,
    blur_px: float,
    errors_px: tuple[float, float, float],
    clipped: bool,
    per_level: float,
    ends: Array,
    variance: Array,
) -> Fit:
    """`_fit_sides` to the light of pixels (s,station,across), 1 inside and 0 outside; it is changed."""
    _, out_px, along, use = pixels
    _, length_px, half_px, reach_px, held = sides
    count, stations, across = values.shape
    crossing_px = np.empty(stations)
    for side in range(count):
        _crossings(values[side], out_px[side], crossing_px)
        ends[0, side], ends[1, side] = _coarse(crossing_px, along[side, :, across // 2])
    if math.isnan(blur_px):
        blur_px = _first_blur_px(values, out_px, along, ends)
    if blur_px <= _SHARP * reach_px.min():
        for side in range(count):
            set_on_even_ground(values[side], along[side, :, across // 2])
            _crossings(values[side], out_px[side], crossing_px)
            ends[0, side], ends[1, side] = _coarse(crossing_px, along[side, :, across // 2])
    sums, step, by_blur = np.empty((count, 10)), np.empty((count, 2)), np.empty((count, 2))
    for _ in range(_STEPS):
        gain = curvature = 0.0
        for side in range(count):
            sums[side] = _products(
                values[side],
                out_px[side],
                along[side],
                use[side],
                ends[:, side],
                half_px[side],
                length_px[side],
                blur_px,
            )
            a, b, c, p, q, blur_a, blur_b, _, blur_residual, blur2 = sums[side]
            scale = 1.0 / max(a * c - b * b, 1e-9)
            step[side, 0], step[side, 1] = (c * p - b * q) * scale, (a * q - b * p) * scale
            # All sides have the same blur: its step is that of the Schur complement, with every side moved along.
            first, second = (c * blur_a - b * blur_b) * scale, (a * blur_b - b * blur_a) * scale
            by_blur[side, 0], by_blur[side, 1] = first, second
            gain += blur_residual - first * p - second * q
            curvature += blur2 - first * blur_a - second * blur_b
        blurrier_px = gain / curvature if curvature > 1e-6 else 0.0
        blurrier_px = min(max(blurrier_px, -0.5 * blur_px, _BLUR_PX[0] - blur_px), blur_px)
        largest = 0.0
        for side in range(count):
            for end in range(2):
                step[side, end] = 0.0 if held[side] else step[side, end] - by_blur[side, end] * blurrier_px
                largest = max(largest, abs(step[side, end]))
                ends[end, side] += min(max(step[side, end], -1.0), 1.0)
        blur_px += blurrier_px
        if not (largest > _REFIT_PX or abs(blurrier_px) > _REBLUR * blur_px):
            break
    misfit2 = 0.0
    for side in range(count):
        if not (held[side] or abs(ends[0, side]) + abs(ends[1, side]) <= reach_px[side]):
            return False, blur_px, 0.0, False, clipped
        residual2 = sums[side, 7] - (step[side, 0] * sums[side, 3] + step[side, 1] * sums[side, 4])
        variance[0, side] = max(residual2, 0.0) / max(use[side].sum() - 2.0, 1.0)
        misfit2 += variance[0, side] / count
    misfit = math.sqrt(misfit2)
    noisy = misfit > max(_MISFIT, _MISFIT_LEVELS * per_level)
    whole2 = errors_px[1] ** 2 if clipped and not noisy else 0.0
    for side in range(count):
        half2 = half_px[side] ** 2
        if held[side]:
            ends[:, side] = 0.0
            variance[0, side], variance[1, side], variance[2, side] = _HELD_PX**2, 0.0, _HELD_PX**2 / half2
            continue
        a, b, c = sums[side, :3]
        noise2 = variance[0, side]
        # The levels inside and outside come from two pixels a column each, and shift the edge as they err.
        floor2 = errors_px[0] ** 2 / columns[side] + noise2 * columns[side] / max(4.0 * a * a, 1e-9)
        noise2 *= 1.0 / max(a * c - b * b, 1e-9)
        variance[0, side] = noise2 * c + floor2 + whole2
        variance[1, side] = -noise2 * b / half_px[side]
        variance[2, side] = (noise2 * a + 3.0 * floor2 + whole2) / half2
    return True, blur_px, misfit, noisy, clipped


@compiled
def _products(
    values: Array,
    out_px: Array,
    along: Array,
    use: Array,
    ends: Array,
    half_px: float,
    length_px: float,
    blur_px: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Sums over a side's pixels (station,across) of products of the derivatives and the residual of the fitted edge.

    By the offset o, the tilt t, the residual r and the blur s: oo, ot, tt, or, tr, os, ts, rr, sr, ss.
    """
    stations, across = values.shape
    rounded, width_px, ground, span = blur_px > _ROUNDING_BLUR_PX, math.sqrt(blur_px * blur_px + 1.0 / 12.0), 0.0, 1.0
    if rounded:  # The outermost pixels, which gave the levels 1 and 0, do not quite show them.
        levels = np.zeros(across)
        for step in (0, 1, across - 2, across - 1):
            for station in range(stations):
                inside_px = ends[0] + ends[1] * along[station, step] - out_px[station, step]
                share = _left_by_ends(along[station, step] * half_px, 0.5 * length_px, width_px)
                levels[step] += edge_response(inside_px, blur_px)[0] * share / stations
        ground = 0.5 * (levels[-1] + levels[-2])
        span = 0.5 * (levels[0] + levels[1]) - ground
    oo = ot = tt = ro = rt = so = st = rr = sr = ss = 0.0
    for station in range(stations):
        for step in range(across):
            if use[station, step] == 0.0:
                continue
            place = along[station, step]
            seen, by_offset, by_blur = edge_response(ends[0] + ends[1] * place - out_px[station, step], blur_px)
            if rounded:
                share = _left_by_ends(place * half_px, 0.5 * length_px, width_px)
                seen, by_offset, by_blur = seen * share, by_offset * share, by_blur * share
            residual = ground + values[station, step] * span - seen
            by_tilt = by_offset * place
            oo, ot, tt = oo + by_offset * by_offset, ot + by_offset * by_tilt, tt + by_tilt * by_tilt
            ro, rt, so, st = (
                ro + by_offset * residual,
                rt + by_tilt * residual,
                so + by_offset * by_blur,
                st + by_tilt * by_blur,
            )
            rr, sr, ss = rr + residual * residual, sr + by_blur * residual, ss + by_blur * by_blur
    return oo, ot, tt, ro, rt, so, st, rr, sr, ss


@compiled
def _left_by_ends(along_px: float, half_length_px: float, width_px: float) -> float:
    """What the blur leaves of the inside near a side's ends, where its neighbours cut it off."""
    return normal((along_px + half_length_px) / width_px)[0] - normal((along_px - half_length_px) / width_px)[0]


@compiled
def _intersect(
    middle_px: Array, sides: SideArrays, ends: Array, variance: Array, corners_px: Array, whiten: Array, bias: Array
) -> float:
    """Write the corners of fitted sides, each between a side and the one before it.

    Args:
        middle_px: (s,2) of the sides as they were measured.
        sides: the same.
        ends: of the fit.
        variance: of the fit.
        corners_px: (n,4,2) written, of `MeasuredCorners`.
        whiten: (n,8,8) written, of the same.
        bias: (n,4,2) written: `edge_bias_px` of the same, for 1 px.

    Returns:
        Standard deviation of a corner on either axis, about; NaN when neighbours are parallel.
    """
    outward, _, half_px, _, held = sides
    polygons, corners = corners_px.shape[:2]
    lines = np.empty((corners, 4))
    noise2 = 0.0
    for polygon in range(polygons):
        for corner in range(corners):
            side = polygon * corners + corner
            out, slope = outward[side], ends[1, side] / half_px[side]
            length = math.sqrt(1.0 + slope * slope)
            # The direction (−out₁, out₀) turned outward by the slope.
            lines[corner, 0] = middle_px[side, 0] + ends[0, side] * out[0]
            lines[corner, 1] = middle_px[side, 1] + ends[0, side] * out[1]
            lines[corner, 2], lines[corner, 3] = (slope * out[0] - out[1]) / length, (slope * out[1] + out[0]) / length
        for corner in range(corners):
            x, y, along, down = lines[corner]
            before_x, before_y, before_along, before_down = lines[corner - 1]
            turn = before_along * down - before_down * along
            if not abs(turn) >= _LEAST_TURN:
                return math.nan
            # From the middle of the side before, along it, to where it meets this one.
            lever_px = ((x - before_x) * down - (y - before_y) * along) / turn
            corners_px[polygon, corner, 0] = before_x + lever_px * before_along
            corners_px[polygon, corner, 1] = before_y + lever_px * before_down
            # Each side's normal is (down, −along).
            moved = 0.0 if held[polygon * corners + corner] else 1.0
            before_moved = 0.0 if held[polygon * corners + (corner - 1) % corners] else 1.0
            cosine = down * before_down + along * before_along
            here, there = (moved - cosine * before_moved), (before_moved - cosine * moved)
            bias[polygon, corner, 0] = (here * down + there * before_down) / (1.0 - cosine * cosine)
            bias[polygon, corner, 1] = -(here * along + there * before_along) / (1.0 - cosine * cosine)
        for corner in range(corners):
            side, following = polygon * corners + corner, (corner + 1) % corners
            x, y, along, down = lines[corner]
            # Deviations of the two ends' distances from a side have its variance V0 + (x + y) V1 + x y V2 at x, y.
            start_px = (corners_px[polygon, corner, 0] - x) * along + (corners_px[polygon, corner, 1] - y) * down
            end_px = (corners_px[polygon, following, 0] - x) * along + (corners_px[polygon, following, 1] - y) * down
            both, cross, square = variance[0, side], variance[1, side], variance[2, side]
            first = math.sqrt(both + start_px * cross + start_px * (cross + start_px * square))
            mixed = (both + start_px * cross + end_px * (cross + start_px * square)) / first
            second = math.sqrt(max(both + end_px * (2.0 * cross + end_px * square) - mixed * mixed, 1e-12))
            noise2 += first * first / (polygons * corners)
            for axis, normal_axis in enumerate((down, -along)):
                whiten[polygon, 2 * corner, 2 * corner + axis] = normal_axis / first
                whiten[polygon, 2 * corner + 1, 2 * corner + axis] = -normal_axis * mixed / (first * second)
                whiten[polygon, 2 * corner + 1, 2 * following + axis] = normal_axis / second
    return math.sqrt(noise2)


def _held(image: Image, quads_px: Array, camera: Camera) -> npt.NDArray[np.bool_] | None:
    """(4n,) sides that lie on the picture's edge, where `find_quads` has set them; None when none does."""
    raw_px = distort(quads_px.reshape(-1, 2), camera).reshape(quads_px.shape)
    if not reaches_edge(raw_px, image.shape[1], image.shape[0]):
        return None
    on = edge_distances(raw_px, image.shape[1], image.shape[0]) < 0.5
    held = (on & np.roll(on, -1, axis=1)).any(axis=-1).reshape(-1)
    return held if held.any() else None
