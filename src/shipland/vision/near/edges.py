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
from shipland.vision.near.edge_pixels import (
    Sides,
    contrasts,
    distort,
    outer_levels,
    set_on_even_ground,
    stations_of,
    take_pixels,
)
from shipland.vision.near.segment import Image, edge_distances
from shipland.vision.parameters import VisionParameters

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
        arrays = sides.outward, sides.length_px, sides.half_px, sides.reach_px, sides.held
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
def _ordered(values: Array) -> Array:
    """(n,) in ascending order: NumPy's sort takes seconds to compile."""
    ordered = np.empty(len(values))
    for index in range(len(values)):
        place = index
        while place > 0 and ordered[place - 1] > values[index]:
            ordered[place] = ordered[place - 1]
            place -= 1
        ordered[place] = values[index]
    return ordered


@compiled
def _crossings(values: Array, out_px: Array) -> Array:
    """(station,) where each column of a side's pixels (station,across) crosses the edge [px], by the area under it."""
    across, area = values.shape[1], values.sum(axis=1)
    share: Array = (area - 0.5) / (across - 1)
    return out_px[:, 0] + share * (out_px[:, across - 1] - out_px[:, 0])


@compiled
def _coarse(crossing_px: Array, along: Array) -> tuple[float, float]:
    """Offset and tilt over the half length [px] of a side (station,across), from where its columns (station,) cross."""
    stations, place = len(crossing_px), along[:, along.shape[1] // 2]
    middle_px = _ordered(crossing_px)[stations // 2]
    near_px = np.minimum(np.maximum(crossing_px, middle_px - 1.0), middle_px + 1.0)
    mean, mean2 = (place / stations).sum(), (place * place / stations).sum()
    offset_px, moment = (near_px / stations).sum(), (place * near_px / stations).sum()
    tilt_px = (moment - mean * offset_px) / max(mean2 - mean * mean, 1e-6)
    return offset_px - tilt_px * mean, tilt_px


@compiled
def _leave_out_strays(values: Array, pixels: Pixels, columns: Array) -> bool:
    """Whether columns of pixels do not show a side's edge, as where a finger lies over it; the nearest others stand in.

    They have other levels than most of the side, or an edge off the line on which most have theirs.
    """
    levels, out_px, along, use = pixels
    sides, stations, _ = values.shape
    if _all_alike(values, out_px, along):
        return False
    counted, stray = np.empty((sides, stations), np.bool_), np.empty((sides, stations), np.bool_)
    counts, strays, all_strays = np.empty(sides), np.empty(sides), 0.0
    for side in range(sides):
        for station in range(stations):
            counted[side, station] = use[side, station].max() > 0.0
        counts[side] = counted[side].sum()
        strays[side] = _mark_strays(values[side], out_px[side], along[side], counted[side], counts[side], stray[side])
        all_strays += strays[side]
    if all_strays == 0.0:
        return False
    for side in range(sides):
        columns[side] = max(columns[side] * ((counts[side] - strays[side]) / max(counts[side], 1.0)), 1.0)
        for station in range(stations):
            if stray[side, station]:
                counted[side, station], use[side, station] = False, 0.0
        for station in range(stations):
            nearest = _nearest(station, counted[side])
            out_px[side, station], along[side, station] = out_px[side, nearest], along[side, nearest]
            levels[side, station] = levels[side, nearest]
    return True


@compiled
def _nearest(station: int, kept: npt.NDArray[np.bool_]) -> int:
    """The kept station (station,) nearest to one; itself where none is kept."""
    for away in range(len(kept)):
        if station >= away and kept[station - away]:
            return station - away
        if station + away < len(kept) and kept[station + away]:
            return station + away
    return station


@compiled
def _all_alike(values: Array, out_px: Array, along: Array) -> bool:
    """Whether all stations have nearly the levels of their side, and their edges lie near its line."""
    sides, _, across = values.shape
    for side in range(sides):
        inner, outer = values[side, :, :2], values[side, :, across - 2 :]
        if max(np.abs(1.0 - inner).max(), np.abs(outer).max()) > _ALIKE * _STRAY_LEVEL:
            return False
        crossing_px = _crossings(values[side], out_px[side])
        offset_px, tilt_px = _coarse(crossing_px, along[side])
        off_px = crossing_px - (offset_px + tilt_px * along[side, :, across // 2])
        if not np.abs(off_px).max() <= _ALIKE * _STRAY_PX:
            return False
    return True


@compiled
def _mark_strays(
    values: Array,
    out_px: Array,
    along: Array,
    counted: npt.NDArray[np.bool_],
    count: float,
    stray: npt.NDArray[np.bool_],
) -> float:
    """Mark the stray ones among those columns of pixels (station,across) of a side that count; how many."""
    stations = len(values)
    inner, outer = 0.5 * (values[:, 0] + values[:, 1]), outer_levels(values)
    # Where there are fewer stations than room for them, the last one is repeated: all count alike here.
    alike = np.floor(np.arange(stations) * count / stations).astype(np.int64)
    inside, outside = _median(inner[alike]), _median(outer[alike])
    span = max(inside - outside, 0.1)
    fits = np.maximum(np.abs(inner - inside), np.abs(outer - outside)) <= _STRAY_LEVEL * span
    crossing_px = _crossings((values - outside) / span, out_px)
    fewest, best = math.inf, 0
    for pair in range(len(_FIRST)):
        first, last = alike[_FIRST[pair]], alike[_LAST[pair]]
        strays = _mark_off_line(crossing_px, along, first, last, fits, counted, stray)
        if strays < fewest:
            fewest, best = strays, pair
    first, last = alike[_FIRST[best]], alike[_LAST[best]]
    _mark_off_line(crossing_px, along, first, last, fits, counted, stray)
    if fewest < _MOST_STRAY * count:
        return fewest
    stray[:] = False
    return 0.0


@compiled
def _median(values: Array) -> float:
    """Of values (n,)."""
    ordered = _ordered(values)
    return 0.5 * float(ordered[(len(values) - 1) // 2] + ordered[len(values) // 2])


@compiled
def _mark_off_line(
    crossing_px: Array,
    along: Array,
    first: int,
    last: int,
    fits: npt.NDArray[np.bool_],
    counted: npt.NDArray[np.bool_],
    stray: npt.NDArray[np.bool_],
) -> float:
    """Mark stations that count and do not fit, or lie off the line through two of them; how many."""
    place = along[:, along.shape[1] // 2] - along[first, along.shape[1] // 2]
    slope = 0.0 if abs(place[last]) < 0.1 else (crossing_px[last] - crossing_px[first]) / place[last]
    off_px = crossing_px - crossing_px[first] - slope * place
    stray[:] = counted & ~(fits & (np.abs(off_px) <= _STRAY_PX))
    return float(stray.sum())


@compiled
def _first_blur_px(values: Array, out_px: Array, along: Array, ends: Array) -> float:
    """A first guess of the blur from the second moment of the edges.

    The differences of neighbouring pixels have the variance σ² + 1/12 px² for a pixel's own size and 1/12 more
    for its sampling, on average over where the edge meets the pixels.
    """
    sides = len(values)
    variances = np.empty(sides)
    for side in range(sides):
        level, place_px = values[side], out_px[side]
        fall = level[:, :-1] - level[:, 1:]
        line_px = ends[0, side] + ends[1, side] * along[side][:, :-1]
        between_px = 0.5 * (place_px[:, :-1] + place_px[:, 1:]) - line_px
        moment = (fall * between_px * between_px).sum()
        spacing_px = place_px[0, 1] - place_px[0, 0]
        variances[side] = moment / max(fall.sum(), 1e-3) - (1.0 + spacing_px * spacing_px) / 12.0
    return min(max(math.sqrt(max(_ordered(variances)[sides // 2], 0.0)), _BLUR_PX[0]), _BLUR_PX[1])


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
    outward, _, half_px, reach_px, _ = sides
    pixels = take_pixels(image, outward, reach_px, half_px, lens, columns)
    fit = _fit_light(pixels, sides, columns, blur_px, errors_px, False, ends, variance)
    if fit[0] and not fit[3]:
        return fit
    other_ends, other_variance = np.empty_like(ends), np.empty_like(variance)
    other = _fit_light(pixels, sides, columns, math.nan, errors_px, True, other_ends, other_variance)
    # Two coded fits are compared by their pixels; beside a clean one, what coding adds counts.
    of_fit, of_other = variance[0].sum(), other_variance[0].sum()
    if fit[0]:
        _add_coding(fit, sides, errors_px, variance)
    if other[0] and other[3]:
        _add_coding(other, sides, errors_px, other_variance)
    elif other[0]:
        of_fit, of_other = variance[0].sum(), other_variance[0].sum()
    if fit[0] and (not other[0] or of_fit <= of_other):
        return fit
    ends[:], variance[:] = other_ends, other_variance
    return other


def _add_coding(fit: Fit, sides: SideArrays, errors_px: tuple[float, float, float], variance: Array) -> None:
    """Add what coding adds to the variance of a fit whose misfit is that of coding."""
    outward, length_px, half_px, _, held = sides
    coded2 = (errors_px[2] * fit[2]) ** 2 * _CODED_SIDE_PX / np.maximum(length_px, _CODED_SIDE_PX)
    if fit[4]:  # which a side that crosses several rows of pixels (columns, if it is steep) averages out
        size = np.abs(outward)
        crossed = length_px * size.min(axis=1) / size.max(axis=1)
        coded2 += (errors_px[1] / np.maximum(crossed, 1.0)) ** 2
    tilted2 = coded2 * np.minimum(length_px / _TILTED_SIDE_PX, _MOST_TILTED) / half_px**2
    variance[0] += np.where(held, 0.0, coded2)
    variance[2] += np.where(held, 0.0, tilted2)


@compiled
def _fit_light(
    pixels: Pixels,
    sides: SideArrays,
    columns: Array,
    blur_px: float,
    errors_px: tuple[float, float, float],
    by_luma: bool,
    ends: Array,
    variance: Array,
) -> Fit:
    """`_fit_sides` by one kind of light; columns that do not show the edge are left out, of the first one."""
    levels, out_px, along, use = pixels
    _, length_px, half_px, reach_px, held = sides
    values = np.empty(out_px.shape)  # 1 inside and 0 outside
    there, clipped, per_level = contrasts(levels, held, by_luma, values)
    if there and not by_luma and _leave_out_strays(values, pixels, columns):
        there, clipped, per_level = contrasts(levels, held, False, values)
    if not there:
        return False, blur_px, 0.0, False, clipped
    count = len(values)
    _fit_coarsely(values, out_px, along, ends)
    if math.isnan(blur_px):
        blur_px = _first_blur_px(values, out_px, along, ends)
    if blur_px <= _SHARP * reach_px.min():
        for side in range(count):
            set_on_even_ground(values[side], along[side])
        _fit_coarsely(values, out_px, along, ends)
    sums, step, by_blur = np.empty((count, 10)), np.empty((count, 2)), np.empty((count, 2))
    for _ in range(_STEPS):
        gain = curvature = 0.0
        for side in range(count):
            sum_of = sums[side]
            _products(
                values[side],
                out_px[side],
                along[side],
                use[side],
                ends[0, side],
                ends[1, side],
                half_px[side],
                length_px[side],
                blur_px,
                sum_of,
            )
            a, b, c, p, q = sum_of[0], sum_of[1], sum_of[2], sum_of[3], sum_of[4]
            blur_a, blur_b = sum_of[5], sum_of[6]
            scale = 1.0 / max(a * c - b * b, 1e-9)
            step[side, 0], step[side, 1] = (c * p - b * q) * scale, (a * q - b * p) * scale
            # All sides have the same blur: its step is that of the Schur complement, with every side moved along.
            first, second = (c * blur_a - b * blur_b) * scale, (a * blur_b - b * blur_a) * scale
            by_blur[side, 0], by_blur[side, 1] = first, second
            gain += sum_of[8] - first * p - second * q
            curvature += sum_of[9] - first * blur_a - second * blur_b
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
            ends[0, side] = ends[1, side] = 0.0
            variance[0, side], variance[1, side], variance[2, side] = _HELD_PX**2, 0.0, _HELD_PX**2 / half2
            continue
        a, b, c = sums[side, 0], sums[side, 1], sums[side, 2]
        noise2 = variance[0, side]
        # The levels inside and outside come from two pixels a column each, and shift the edge as they err.
        floor2 = errors_px[0] ** 2 / columns[side] + noise2 * columns[side] / max(4.0 * a * a, 1e-9)
        noise2 *= 1.0 / max(a * c - b * b, 1e-9)
        variance[0, side] = noise2 * c + floor2 + whole2
        variance[1, side] = -noise2 * b / half_px[side]
        variance[2, side] = (noise2 * a + 3.0 * floor2 + whole2) / half2
    return True, blur_px, misfit, noisy, clipped


@compiled
def _fit_coarsely(values: Array, out_px: Array, along: Array, ends: Array) -> None:
    """Write offset and tilt (2,s) [px] of sides by the area under their columns of pixels (s,station,across)."""
    for side in range(len(values)):
        ends[0, side], ends[1, side] = _coarse(_crossings(values[side], out_px[side]), along[side])


@compiled
def _products(
    values: Array,
    out_px: Array,
    along: Array,
    use: Array,
    offset_px: float,
    tilt_px: float,
    half_px: float,
    length_px: float,
    blur_px: float,
    sums: Array,
) -> None:
    """Write sums over a side's pixels (station,across) of products of the fitted edge's derivatives and residual.

    By the offset o, the tilt t, the residual r and the blur s: (10,) oo, ot, tt, or, tr, os, ts, rr, sr, ss.
    """
    stations, across = values.shape
    rounded, width_px, ground, span = blur_px > _ROUNDING_BLUR_PX, math.sqrt(blur_px * blur_px + 1.0 / 12.0), 0.0, 1.0
    if rounded:  # The outermost pixels, which gave the levels 1 and 0, do not quite show them.
        levels = np.zeros(across)
        for step in (0, 1, across - 2, across - 1):
            for station in range(stations):
                inside_px = offset_px + tilt_px * along[station, step] - out_px[station, step]
                share = _left_by_ends(along[station, step] * half_px, 0.5 * length_px, width_px)
                levels[step] += edge_response(inside_px, blur_px)[0] * share / stations
        ground = 0.5 * (levels[across - 1] + levels[across - 2])
        span = 0.5 * (levels[0] + levels[1]) - ground
    oo = ot = tt = ro = rt = so = st = rr = sr = ss = 0.0
    for station in range(stations):
        for step in range(across):
            if use[station, step] == 0.0:
                continue
            place = along[station, step]
            seen, by_offset, by_blur = edge_response(offset_px + tilt_px * place - out_px[station, step], blur_px)
            if rounded:
                share = _left_by_ends(place * half_px, 0.5 * length_px, width_px)
                seen, by_offset, by_blur = seen * share, by_offset * share, by_blur * share
            residual = ground + values[station, step] * span - seen
            by_tilt = by_offset * place
            oo, ot, tt = oo + by_offset * by_offset, ot + by_offset * by_tilt, tt + by_tilt * by_tilt
            ro, rt = ro + by_offset * residual, rt + by_tilt * residual
            so, st = so + by_offset * by_blur, st + by_tilt * by_blur
            rr, sr, ss = rr + residual * residual, sr + by_blur * residual, ss + by_blur * by_blur
    sums[0], sums[1], sums[2], sums[3], sums[4] = oo, ot, tt, ro, rt
    sums[5], sums[6], sums[7], sums[8], sums[9] = so, st, rr, sr, ss


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
            out_x, out_y, slope = outward[side, 0], outward[side, 1], ends[1, side] / half_px[side]
            length = math.sqrt(1.0 + slope * slope)
            # The direction (−out_y, out_x) turned outward by the slope.
            lines[corner, 0] = middle_px[side, 0] + ends[0, side] * out_x
            lines[corner, 1] = middle_px[side, 1] + ends[0, side] * out_y
            lines[corner, 2], lines[corner, 3] = (slope * out_x - out_y) / length, (slope * out_y + out_x) / length
        for corner in range(corners):
            before = (corner - 1) % corners
            x, y, along, down = lines[corner, 0], lines[corner, 1], lines[corner, 2], lines[corner, 3]
            before_x, before_y, before_along, before_down = (
                lines[before, 0],
                lines[before, 1],
                lines[before, 2],
                lines[before, 3],
            )
            turn = before_along * down - before_down * along
            if not abs(turn) >= _LEAST_TURN:
                return math.nan
            # From the middle of the side before, along it, to where it meets this one.
            lever_px = ((x - before_x) * down - (y - before_y) * along) / turn
            corners_px[polygon, corner, 0] = before_x + lever_px * before_along
            corners_px[polygon, corner, 1] = before_y + lever_px * before_down
            # Each side's normal is (down, −along).
            moved = 0.0 if held[polygon * corners + corner] else 1.0
            before_moved = 0.0 if held[polygon * corners + before] else 1.0
            cosine = down * before_down + along * before_along
            here, there = (moved - cosine * before_moved), (before_moved - cosine * moved)
            bias[polygon, corner, 0] = (here * down + there * before_down) / (1.0 - cosine * cosine)
            bias[polygon, corner, 1] = -(here * along + there * before_along) / (1.0 - cosine * cosine)
        for corner in range(corners):
            side, following = polygon * corners + corner, (corner + 1) % corners
            x, y, along, down = lines[corner, 0], lines[corner, 1], lines[corner, 2], lines[corner, 3]
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


def _held(image: Image, quads_px: Array, camera: Camera) -> npt.NDArray[np.bool_]:
    """(4n,) sides that lie on the picture's edge, where `find_quads` has set them."""
    raw_px = distort(quads_px.reshape(-1, 2), camera).reshape(quads_px.shape)
    on = edge_distances(raw_px, image.shape[1], image.shape[0]) < 0.5
    return np.asarray((on & np.roll(on, -1, axis=1)).any(axis=-1).reshape(-1))
