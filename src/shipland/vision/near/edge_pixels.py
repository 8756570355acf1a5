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
        held: (s,) lies along the picture's edge and cannot be measured.
        corners: of each polygon.
    """

    middle_px: Array
    along: Array
    outward: Array
    length_px: Array
    reach_px: Array
    held: npt.NDArray[np.bool_]
    corners: int = 4

    @staticmethod
    def of(quads_px: Array, reach_px: float, held: npt.NDArray[np.bool_] | None = None) -> Sides:
        """The sides of quadrilaterals (n,4,2); pixels are taken no farther out than 0.42 of the shorter side."""
        corners = quads_px.shape[1]
        ends = np.roll(quads_px, -1, axis=1)
        side_px = (ends - quads_px).reshape(-1, 2)
        length_px = np.sqrt(side_px[:, 0] * side_px[:, 0] + side_px[:, 1] * side_px[:, 1])
        along = side_px / length_px[:, None]
        shorter_px = length_px.reshape(-1, corners).min(axis=1).repeat(corners)
        reach = np.minimum(reach_px, np.maximum(0.42 * shorter_px, 1.5))
        middle_px = 0.5 * (ends + quads_px).reshape(-1, 2)
        held = np.zeros(len(length_px), np.bool_) if held is None else held
        return Sides(middle_px, along, along[:, ::-1] * _QUARTER_TURN, length_px, reach, held, corners)

    def half_px(self) -> Array:
        """(s,) half of each side's length that is looked at: off the corners by twice a usual blur."""
        return np.maximum(0.5 * self.length_px - 1.5, 0.3 * self.length_px)

    def wider(self) -> Sides:
        """The same with pixels taken twice as far out, as far as the quadrilaterals allow."""
        shorter_px = self.length_px.reshape(-1, self.corners).min(axis=1).repeat(self.corners)
        farthest_px = np.minimum(0.42 * shorter_px, MOST_ACROSS)
        reach_px = np.maximum(np.minimum(2.0 * self.reach_px, farthest_px), self.reach_px)
        return replace(self, reach_px=reach_px)


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
    _place_stations(sides.middle_px, sides.along, sides.outward, sides.half_px(), lens, count)
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
    reach = min(math.ceil(reach_px.max()), MOST_ACROSS)
    shape = (len(lens), _STATIONS, 2 * reach + 1)
    levels = np.empty((shape[0], shape[1], shape[2], 3), np.uint8)
    out_px, along, use = np.empty(shape), np.empty(shape), np.empty(shape)
    height, width = image.shape[:2]
    for side in range(shape[0]):
        steep = abs(outward[side, 0]) > abs(outward[side, 1])
        outer = math.copysign(1.0, outward[side, 0 if steep else 1])
        for index in range(_STATIONS):
            along_px, main, other, along_by_main, along_by_other, out_by_main, out_by_other = lens[side, index]
            from_main = np.rint(main) - main
            for step in range(shape[2]):
                line = np.rint(other) + outer * (step - reach)
                column, row = (line, np.rint(main)) if steep else (np.rint(main), line)
                out = out_by_other * (line - other) + out_by_main * from_main
                out_px[side, index, step] = out
                place = along_px + along_by_other * (line - other) + along_by_main * from_main
                along[side, index, step] = place / half_px[side]
                inside = 0.0 <= column < width and 0.0 <= row < height
                counts = inside and index < count[side] and abs(out) <= reach_px[side] + 0.5
                use[side, index, step] = 1.0 if counts else 0.0
                levels[side, index, step] = image[
                    int(min(max(row, 0.0), height - 1.0)), int(min(max(column, 0.0), width - 1.0))
                ]
    return levels, out_px, along, use


def contrast_direction(inside: Array, outside: Array) -> Array | None:
    """The direction (c,) of light along which two mean lights (c,) differ by 1; None without contrast."""
    direction = np.empty(len(inside))
    return direction if _write_direction(np.asarray(inside, float), np.asarray(outside, float), direction) else None


@compiled
def _write_direction(inside: Array, outside: Array, direction: Array) -> bool:
    size2 = 0.0
    for colour in range(len(inside)):
        direction[colour] = inside[colour] - outside[colour]
        size2 += direction[colour] ** 2
    direction /= size2
    return size2 > _LEAST_CONTRAST**2


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
    sides, stations, across = values.shape
    ends = np.zeros((2, 3))
    for side in range(sides):
        if held[side]:
            continue
        for station in range(stations):
            for colour in range(3):
                for end, step in ((0, 0), (0, 1), (1, across - 2), (1, across - 1)):
                    ends[end, colour] += LIGHT[levels[side, station, step, colour]]
    ends *= 0.5 / max(stations * np.count_nonzero(~held), 1)
    inside, outside = ends
    # The edge of a saturated colour is moved outward; the other colours are not affected.
    clear = np.maximum(inside, outside) < _CLIPPED
    weights = np.empty(3)
    clipped = not clear.all()
    if clipped and not by_luma and _write_direction(inside * clear, outside * clear, weights):
        clipped = False
    elif not _write_direction(inside, outside, weights):
        return False, clipped, 0.0
    if by_luma:
        if not _mix_by_luma(levels, inside, outside, values):
            return False, clipped, 0.0
        weights = _LUMA_BGR / np.sum(_LUMA_BGR * (inside - outside))
    else:
        for side in range(sides):
            for station in range(stations):
                for step in range(across):
                    blue, green, red = levels[side, station, step]
                    values[side, station, step] = (
                        LIGHT[blue] * weights[0] + LIGHT[green] * weights[1] + LIGHT[red] * weights[2]
                    )
    for side in range(sides):
        ground = 0.5 * (values[side, :, across - 1].sum() + values[side, :, across - 2].sum()) / stations
        span = 0.5 * (values[side, :, 0].sum() + values[side, :, 1].sum()) / stations - ground
        span = 1.0 if held[side] else span
        if not span >= _LEAST_SIDE_CONTRAST:
            return False, clipped, 0.0
        values[side] = (values[side] - ground) * (1.0 / span)
        _level_by_station(values[side])
    noise2 = 0.0
    for lights in ends:
        noise2 += 0.5 * np.sum((weights * np.interp(lights, LIGHT, _LIGHT_A_LEVEL)) ** 2)
    return True, clipped, math.sqrt(noise2)


@compiled
def _outer(values: Array) -> Array:
    """(station,) levels outside."""
    return 0.5 * (values[:, -1] + values[:, -2])


@compiled
def _level_by_station(values: Array) -> None:
    """Counts each station's values (station,across) from its own levels, in place, where a side's differ along it."""
    outer = _outer(values)
    if not outer.std() > _UNEVEN:
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
        along: (station,) places of the stations.
    """
    outer = _outer(values)
    if outer.std() > _UNEVEN:  # whose stations have levels of their own
        return
    apart = along - along.mean()
    slope = (apart * outer).sum() / max((apart * apart).sum(), 1e-9)
    for station in range(len(values)):
        ground = slope * apart[station]
        values[station] = (values[station] - ground) / (1.0 - ground)


@compiled
def _mix_by_luma(levels: npt.NDArray[np.uint8], inside: Array, outside: Array, values: Array) -> bool:
    """Write the share (s,station,across) of the light inside in pixels (…,3), by their luma.

    The luma of a mixture of two lights (3,) rises with the share of the brighter, though not in proportion. False where
    the two have nearly the same luma.
    """
    luma = np.zeros(len(_SHARES))
    for index in range(len(_SHARES)):
        for colour in range(3):
            light = (outside[colour] + _SHARES[index] * (inside[colour] - outside[colour])) / 255.0
            level = 12.92 * light if light <= 0.0031308 else 1.055 * max(light, 0.0) ** (1.0 / 2.4) - 0.055
            luma[index] += 255.0 * level * _LUMA_BGR[colour]
    shares = _SHARES
    if luma[-1] < luma[0]:
        luma, shares = luma[::-1].copy(), _SHARES[::-1].copy()
    if not (np.diff(luma).min() > 0.0 and luma[-1] - luma[0] > _LEAST_LUMA):
        return False
    for side in range(len(values)):
        for station in range(values.shape[1]):
            for step in range(values.shape[2]):
                blue, green, red = levels[side, station, step]
                seen = blue * _LUMA_BGR[0] + green * _LUMA_BGR[1] + red * _LUMA_BGR[2]
                after = min(max(np.searchsorted(luma, seen), 1), len(luma) - 1)
                rise = (shares[after] - shares[after - 1]) / (luma[after] - luma[after - 1])
                seen = min(max(seen, luma[0]), luma[-1])
                values[side, station, step] = shares[after - 1] + rise * (seen - luma[after - 1])
    return True
