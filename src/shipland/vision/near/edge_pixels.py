"""Sides of quadrilaterals, the pixels around them, and their contrast: what the third stage measures on.

The 4n sides are those of n quadrilaterals, each from its first corner to the next, clockwise. Lines are in undistorted
pixels, where sides are straight. Pixels are (side, station, across): stations along a side, pixels across it from
inside to outside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.frames import Array
from shipland.vision.near.segment import Image

MOST_ACROSS = 12
"""Most pixels that are taken across a side, inward or outward."""

_STATIONS = 20
"""Columns (rows, for steep sides) of pixels of one side; where a side has fewer, the last one is repeated."""


@dataclass(frozen=True)
class Sides:
    """Straight sides, roughly known.

    Attributes:
        middle_px: (s,2).
        along: (s,2) unit direction.
        outward: (s,2) unit normal.
        length_px: (s,).
        half_px: (s,) half of the length that is looked at: off the corners by twice a usual blur.
        reach_px: (s,) how far across them pixels are taken.
        held: (s,) lies along the picture's edge and cannot be measured.
        corners: of each polygon.
    """

    middle_px: Array
    along: Array
    outward: Array
    length_px: Array
    half_px: Array
    reach_px: Array
    held: npt.NDArray[np.bool_]
    corners: int = 4

    @staticmethod
    def of(quads_px: Array, reach_px: float, held: npt.NDArray[np.bool_] | None = None) -> Sides:
        """The sides of quadrilaterals (n,4,2); pixels are taken no farther out than 0.42 of the shorter side."""
        count = quads_px.shape[0] * quads_px.shape[1]
        lines, sizes_px = np.empty((3, count, 2)), np.empty((3, count))
        _place_sides(quads_px, reach_px, lines, sizes_px)
        held = np.zeros(count, np.bool_) if held is None else held
        (middle_px, along, outward), (length_px, half_px, within_px) = lines, sizes_px
        return Sides(middle_px, along, outward, length_px, half_px, within_px, held, quads_px.shape[1])

    def wider(self) -> Sides:
        """The same with pixels taken twice as far out, as far as the quadrilaterals allow."""
        shorter_px = self.length_px.reshape(-1, self.corners).min(axis=1).repeat(self.corners)
        farthest_px = np.minimum(0.42 * shorter_px, MOST_ACROSS)
        reach_px = np.maximum(np.minimum(2.0 * self.reach_px, farthest_px), self.reach_px)
        return replace(self, reach_px=reach_px)


@compiled
def _place_sides(quads_px: Array, reach_px: float, lines: Array, sizes_px: Array) -> None:
    """Write `middle_px`, `along` and `outward` (3,s,2), and `length_px`, `half_px` and `reach_px` (3,s), of `Sides`."""
    corners = quads_px.shape[1]
    for quad in range(len(quads_px)):
        shortest_px = math.inf
        for corner in range(corners):
            side, after = quad * corners + corner, (corner + 1) % corners
            start, end = quads_px[quad, corner], quads_px[quad, after]
            x, y = end[0] - start[0], end[1] - start[1]
            length = math.sqrt(x * x + y * y)
            lines[0, side, 0], lines[0, side, 1] = 0.5 * (end[0] + start[0]), 0.5 * (end[1] + start[1])
            lines[1, side, 0], lines[1, side, 1] = x / length, y / length
            lines[2, side, 0], lines[2, side, 1] = y / length, -(x / length)
            sizes_px[0, side], sizes_px[1, side] = length, max(0.5 * length - 1.5, 0.3 * length)
            shortest_px = min(shortest_px, length)
        for side in range(quad * corners, (quad + 1) * corners):
            sizes_px[2, side] = min(reach_px, max(0.42 * shortest_px, 1.5))


def distort(undistorted_px: Array, camera: Camera) -> Array:
    """Pixels (n,2) of the picture for undistorted pixels (n,2)."""
    if not camera.has_distortion:
        return undistorted_px
    homogeneous = np.column_stack([undistorted_px, np.ones(len(undistorted_px))])
    return camera.project(homogeneous @ np.linalg.inv(camera.matrix).T)


_LUMA_BGR = np.array([0.114, 0.587, 0.299])
"""ITU-R BT.601, the luma of JPEG and of most video."""

_SHARES = np.linspace(-0.1, 1.1, 25)
"""Shares of the light inside at which luma is tabulated; beyond 0 and 1, so that noise is not cut off."""

_LEAST_LUMA = 10.0
"""Smallest difference of luma between inside and outside that is measured [grey levels]."""

_LEAST_CONTRAST = 6.0
"""Smallest difference of light between inside and outside that is measured [of 255]."""


def _light_of_levels() -> Array:
    levels = np.arange(256) / 255.0
    return 255.0 * np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)


LIGHT = _light_of_levels()
"""(256,) light, 0 … 255, of a grey level by sRGB's curve [IEC 61966-2-1]: an edge is symmetric about its place in light
only. Cameras have curves of their own; the pose solves for the edge bias that these leave."""

_LIGHT_A_LEVEL = np.gradient(LIGHT)
"""(256,) derivative of light by grey level."""

_CLIPPED = float(LIGHT[240])
"""Mean light from which a colour is taken to be saturated, or on the shoulder of a tone curve."""

_LEAST_SIDE_CONTRAST = 0.15
"""Smallest contrast of a single side, against the cue's."""

_UNEVEN = 0.15
"""Standard deviation of the levels outside along a side, against its contrast, from which stations have levels of their
own: what is behind the cue ends or changes there."""

_LEAST_STATION_CONTRAST = 0.3
"""Smallest contrast of one station, against the side's, that shows the edge."""


def stations_of(sides: Sides, camera: Camera) -> tuple[Array, Array]:
    """Where the columns of pixels of flat sides, the rows of steep ones, meet them; and how many of each side differ.

    Returns:
        (s,station,7): place along the side [px], place in the picture along and across the stations' axis [px], and how
        places along the side and outward change with these two.
        (s,) count of stations.
    """
    lens, count = np.empty((len(sides.length_px), _STATIONS, 7)), np.empty(len(sides.length_px))
    _place_stations(sides.middle_px, sides.along, sides.outward, sides.half_px, lens, count)
    if camera.has_distortion:
        foot = sides.middle_px[:, None] + lens[..., :1] * sides.along[:, None]
        shifted = np.stack([foot, foot + sides.along[:, None], foot + sides.outward[:, None]])
        raw_px = distort(shifted.reshape(-1, 2), camera).reshape(shifted.shape)
        raw_px = np.where(
            (np.abs(sides.along[:, 1]) > np.abs(sides.along[:, 0]))[:, None, None], raw_px[..., ::-1], raw_px
        )
        (a_main, a_other), (o_main, o_other) = (raw_px[1:] - raw_px[0]).transpose(0, 3, 1, 2)
        scale = 1.0 / (a_main * o_other - a_other * o_main)
        lens[..., 1:3] = raw_px[0]
        lens[..., 3:] = np.stack([o_other * scale, -o_main * scale, -a_other * scale, a_main * scale], axis=-1)
    return lens, count


@compiled
def _place_stations(middle_px: Array, along: Array, outward: Array, half_px: Array, lens: Array, count: Array) -> None:
    """Write `stations_of` without distortion: whole columns (rows), spread evenly where there are too many."""
    for side in range(len(half_px)):
        main = 1 if abs(along[side, 1]) > abs(along[side, 0]) else 0
        middle, slope = middle_px[side, main], along[side, main]
        reach = abs(slope) * half_px[side]
        first, last = math.ceil(middle - reach), math.floor(middle + reach)
        count[side] = min(max(last - first + 1.0, 1.0), float(_STATIONS))
        spacing = (last - first) / max(count[side] - 1.0, 1.0)
        for index in range(_STATIONS):
            column = np.rint(first + min(float(index), count[side] - 1.0) * spacing)
            along_px = (column - middle) / slope
            lens[side, index, 0], lens[side, index, 1] = along_px, column
            lens[side, index, 2] = middle_px[side, 1 - main] + along_px * along[side, 1 - main]
            lens[side, index, 3], lens[side, index, 4] = 0.0, along[side, 1 - main]
            lens[side, index, 5], lens[side, index, 6] = 0.0, outward[side, 1 - main]


@compiled
def take_pixels(
    image: Image, outward: Array, reach_px: Array, half_px: Array, lens: Array, count: Array
) -> tuple[npt.NDArray[np.uint8], Array, Array, Array]:
    """Columns of pixels across flat sides, rows across steep ones; (s,station,across) each.

    Returns:
        levels (…,3), the picture's; distance outward from the side [px]; place along it, -1 to 1 between the ends of
        what is looked at; 1 where the pixel counts, 0 where it repeats another, is too far out or not in the picture.
    """
    sides, (height, width) = len(lens), image.shape[:2]
    reach = min(math.ceil(reach_px.max()), MOST_ACROSS)
    across = 2 * reach + 1
    levels = np.empty((sides, _STATIONS, across, 3), np.uint8)
    out_px, along = np.empty((sides, _STATIONS, across)), np.empty((sides, _STATIONS, across))
    use = np.empty((sides, _STATIONS, across))
    for side in range(sides):
        steep = abs(outward[side, 0]) > abs(outward[side, 1])
        outer = math.copysign(1.0, outward[side, 0 if steep else 1])
        for index in range(_STATIONS):
            main, other = lens[side, index, 1], lens[side, index, 2]
            nearest, nearest_line = np.rint(main), np.rint(other)
            out_of_main = lens[side, index, 5] * (nearest - main)
            along_of_main = lens[side, index, 3] * (nearest - main)
            for step in range(across):
                line = nearest_line + outer * (step - reach)
                column, row = (line, nearest) if steep else (nearest, line)
                out = lens[side, index, 6] * (line - other) + out_of_main
                place = lens[side, index, 0] + lens[side, index, 4] * (line - other) + along_of_main
                inside = 0.0 <= column < width and 0.0 <= row < height
                counts = inside and index < count[side] and abs(out) <= reach_px[side] + 0.5
                out_px[side, index, step] = out
                along[side, index, step] = place / half_px[side]
                use[side, index, step] = 1.0 if counts else 0.0
                row_seen = int(min(max(row, 0.0), height - 1.0))
                column_seen = int(min(max(column, 0.0), width - 1.0))
                for colour in range(3):
                    levels[side, index, step, colour] = image[row_seen, column_seen, colour]
    return levels, out_px, along, use


def contrast_direction(inside: Array, outside: Array) -> Array | None:
    """The direction (c,) of light along which two mean lights (c,) differ by 1; None without contrast."""
    direction, whole = np.empty(len(inside)), np.ones(len(inside))
    lights = np.asarray(inside, float), np.asarray(outside, float)
    return direction if _write_direction(*lights, whole, direction) else None


@compiled
def _write_direction(inside: Array, outside: Array, clear: Array, direction: Array) -> bool:
    """Write `contrast_direction` of the colours that are 1 in `clear`; 0 for the others."""
    size2 = 0.0
    for colour in range(len(inside)):
        direction[colour] = (inside[colour] - outside[colour]) * clear[colour]
        size2 += direction[colour] ** 2
    if not size2 > _LEAST_CONTRAST**2:
        return False
    for colour in range(len(inside)):
        direction[colour] /= size2
    return True


@compiled
def contrasts(
    levels: npt.NDArray[np.uint8], held: npt.NDArray[np.bool_], by_luma: bool, values: Array
) -> tuple[bool, bool, float]:
    """Write light of pixels (s,station,across) from 0 outside to 1 inside, by the outermost two.

    Args:
        levels: (s,station,across,3) from inside to outside.
        held: (s,) sides that are not to be measured.
        by_luma: take the light of the pixels' luma, which coded pictures keep at full resolution, instead of the colour
            that differs most.
        values: written.

    Returns:
        Whether there is contrast; whether the inside saturates; by how much a pixel's share differs, root mean square,
        for every grey level that a sensor's noise has.
    """
    inside, outside, clear, weights = np.zeros(3), np.zeros(3), np.empty(3), np.empty(3)
    _end_lights(levels, held, inside, outside)
    # The edge of a saturated colour is moved outward; the other colours are not affected.
    clipped = False
    for colour in range(3):
        clear[colour] = 1.0 if max(inside[colour], outside[colour]) < _CLIPPED else 0.0
        clipped = clipped or clear[colour] == 0.0
    if clipped and not by_luma and _write_direction(inside, outside, clear, weights):
        clipped = False
    else:
        clear[0] = clear[1] = clear[2] = 1.0
        if not _write_direction(inside, outside, clear, weights):
            return False, clipped, 0.0
    if by_luma:
        if not _mix_by_luma(levels, inside, outside, values):
            return False, clipped, 0.0
        span = 0.0
        for colour in range(3):
            span += _LUMA_BGR[colour] * (inside[colour] - outside[colour])
        for colour in range(3):
            weights[colour] = _LUMA_BGR[colour] / span
    else:
        _mix(levels, weights, values)
    if not _scale_sides(held, values):
        return False, clipped, 0.0
    noise2 = 0.0
    for lights in (inside, outside):
        of_end = 0.0
        for colour in range(3):
            of_end += (weights[colour] * _light_a_level(lights[colour])) ** 2
        noise2 += 0.5 * of_end
    return True, clipped, math.sqrt(noise2)


@compiled
def _end_lights(levels: npt.NDArray[np.uint8], held: npt.NDArray[np.bool_], inside: Array, outside: Array) -> None:
    """Write the mean lights (3,) of the innermost and of the outermost two pixels; both are 0 before."""
    sides, stations, across = levels.shape[:3]
    measured = 0
    for side in range(sides):
        if held[side]:
            continue
        measured += 1
        for station in range(stations):
            for colour in range(3):
                for step in range(2):
                    inside[colour] += LIGHT[levels[side, station, step, colour]]
                    outside[colour] += LIGHT[levels[side, station, across - 2 + step, colour]]
    share = 0.5 / max(stations * measured, 1)
    for colour in range(3):
        inside[colour] *= share
        outside[colour] *= share


@compiled
def _light_a_level(light: float) -> float:
    """Derivative of light by grey level, where a grey level has that light."""
    below = 0
    while below < len(LIGHT) - 2 and LIGHT[below + 1] <= light:
        below += 1
    rise = (_LIGHT_A_LEVEL[below + 1] - _LIGHT_A_LEVEL[below]) / (LIGHT[below + 1] - LIGHT[below])
    return float(rise * (light - LIGHT[below]) + _LIGHT_A_LEVEL[below])


@compiled
def _mix(levels: npt.NDArray[np.uint8], weights: Array, values: Array) -> None:
    """Write the sum (s,station,across) of the lights of pixels (…,3), each colour with its weight (3,)."""
    for side in range(len(values)):
        for station in range(values.shape[1]):
            for step in range(values.shape[2]):
                blue = LIGHT[levels[side, station, step, 0]]
                green = LIGHT[levels[side, station, step, 1]]
                red = LIGHT[levels[side, station, step, 2]]
                values[side, station, step] = blue * weights[0] + green * weights[1] + red * weights[2]


@compiled
def _scale_sides(held: npt.NDArray[np.bool_], values: Array) -> bool:
    """Count values from 0 outside to 1 inside of their side, in place; False where one has too little contrast."""
    sides, stations, across = values.shape
    for side in range(sides):
        of_side = values[side]
        ground = 0.5 * (of_side[:, across - 1].sum() + of_side[:, across - 2].sum()) / stations
        span = 1.0 if held[side] else 0.5 * (of_side[:, 0].sum() + of_side[:, 1].sum()) / stations - ground
        if not span >= _LEAST_SIDE_CONTRAST:
            return False
        of_side[:] = (of_side - ground) * (1.0 / span)
        _level_by_station(of_side)
    return True


@compiled
def outer_levels(values: Array) -> Array:
    """Levels outside (station,) of a side (station,across)."""
    across = values.shape[1]
    return 0.5 * (values[:, across - 1] + values[:, across - 2])


@compiled
def _are_uneven(levels: Array) -> bool:
    """Whether the levels outside (station,) of a side differ along it."""
    off = levels - levels.sum() / len(levels)
    return bool((off * off / len(levels)).sum() > _UNEVEN**2)


@compiled
def _level_by_station(values: Array) -> None:
    """Counts each station's values (station,across) from its own levels, in place, where a side's differ along it."""
    outer = outer_levels(values)
    if not _are_uneven(outer):
        return
    for station in range(len(values)):
        span = 0.5 * (values[station, 0] + values[station, 1]) - outer[station]
        if span > _LEAST_STATION_CONTRAST:
            values[station] = (values[station] - outer[station]) / span


@compiled
def set_on_even_ground(values: Array, along: Array) -> None:
    """Light (station,across) of a side from 0 outside to 1 inside, where what is outside changes evenly along it.

    A board's stains and shadows, a tenth of the contrast from one end to the other, would tilt a side by 0.05 px.

    Args:
        values: light of which 0 is what is outside on average over the side; changed.
        along: (station,across) places of the pixels along the side.
    """
    outer = outer_levels(values)
    if _are_uneven(outer):  # whose stations have levels of their own
        return
    place = along[:, along.shape[1] // 2]
    apart = place - place.sum() / len(place)
    ground = (apart * outer).sum() / max((apart * apart).sum(), 1e-9) * apart
    for station in range(len(values)):
        values[station] = (values[station] - ground[station]) / (1.0 - ground[station])


@compiled
def _mix_by_luma(levels: npt.NDArray[np.uint8], inside: Array, outside: Array, values: Array) -> bool:
    """Write the share (s,station,across) of the light inside in pixels (…,3), by their luma.

    The luma of a mixture of two lights (3,) rises with the share of the brighter, though not in proportion. False where
    the two have nearly the same luma.
    """
    count = len(_SHARES)
    shares, luma = np.empty(count), np.empty(count)
    brighter = _luma(inside, outside, 1.0) >= _luma(inside, outside, 0.0)
    for index in range(count):
        shares[index] = _SHARES[index if brighter else count - 1 - index]
        luma[index] = _luma(inside, outside, shares[index])
        if index > 0 and not luma[index] > luma[index - 1]:
            return False
    if not luma[count - 1] - luma[0] > _LEAST_LUMA:
        return False
    for side in range(len(values)):
        for station in range(values.shape[1]):
            for step in range(values.shape[2]):
                seen = 0.0
                for colour in range(3):
                    seen += levels[side, station, step, colour] * _LUMA_BGR[colour]
                after = 1
                while after < count - 1 and luma[after] < seen:
                    after += 1
                rise = (shares[after] - shares[after - 1]) / (luma[after] - luma[after - 1])
                seen = min(max(seen, luma[0]), luma[count - 1])
                values[side, station, step] = shares[after - 1] + rise * (seen - luma[after - 1])
    return True


@compiled
def _luma(inside: Array, outside: Array, share: float) -> float:
    """Luma [grey levels] of a mixture of two lights (3,), by the share of that inside."""
    luma = 0.0
    for colour in range(3):
        light = (outside[colour] + share * (inside[colour] - outside[colour])) / 255.0
        level = 12.92 * light if light <= 0.0031308 else 1.055 * max(light, 0.0) ** (1.0 / 2.4) - 0.055
        luma += 255.0 * level * _LUMA_BGR[colour]
    return luma
