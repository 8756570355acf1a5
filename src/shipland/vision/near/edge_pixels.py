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
from shipland.frames import Array
from shipland.vision.near.segment import Image

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
        corners: of each polygon.
    """

    middle_px: Array
    along: Array
    outward: Array
    length_px: Array
    reach_px: Array
    held: npt.NDArray[np.bool_] | None
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

    def moved(self, offset_px: Array, slope: Array) -> Sides:
        """The sides shifted outward and turned."""
        along = self.along + slope[:, None] * self.outward
        along /= np.sqrt(1.0 + slope * slope)[:, None]
        middle_px = self.middle_px + offset_px[:, None] * self.outward
        outward = along[:, ::-1] * _QUARTER_TURN
        return replace(self, middle_px=middle_px, along=along, outward=outward)


def distort(undistorted_px: Array, camera: Camera) -> Array:
    """Pixels (n,2) of the picture for undistorted pixels (n,2)."""
    if not camera.has_distortion:
        return undistorted_px
    homogeneous = np.column_stack([undistorted_px, np.ones(len(undistorted_px))])
    return camera.project(homogeneous @ np.linalg.inv(camera.matrix).T)


_AXES = np.array([[0, 1, 2, 3, 4, 5], [1, 0, 3, 2, 5, 4]])
"""Order of three (column, row) pairs as (main axis, other axis), for flat sides and for steep ones."""

_STATIONS = np.arange(20.0)
"""Numbers of the columns (rows, for steep sides) of pixels of one side: 20 at most."""

_LUMA_BGR = np.array([0.114, 0.587, 0.299])
"""ITU-R BT.601, the luma of JPEG and of most video."""

_SHARES = np.linspace(-0.1, 1.1, 25)
"""Shares of the light inside at which luma is tabulated; beyond 0 and 1, so that noise is not cut off."""

_LEAST_LUMA = 10.0
"""Smallest difference of luma between inside and outside that is measured [grey levels]."""

_LEAST_CONTRAST = 6.0
"""Smallest difference of light between inside and outside that is measured [of 255]."""


def _levels_of(light: Array) -> Array:
    """Grey levels of light, 0 … 255, by the inverse of sRGB's curve, extrapolated at both ends."""
    share = light / 255.0
    return 255.0 * np.where(share <= 0.0031308, 12.92 * share, 1.055 * np.maximum(share, 0.0) ** (1.0 / 2.4) - 0.055)


def _light_of_levels() -> npt.NDArray[np.float32]:
    levels = np.arange(256) / 255.0
    light = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    return np.asarray(255.0 * light, np.float32)


LIGHT = _light_of_levels()
"""(256,) light, 0 … 255, of a grey level by sRGB's curve [IEC 61966-2-1]: an edge is symmetric about its place in light
only. Cameras have curves of their own; the pose solves for the edge bias that these leave."""

_LIGHT_A_LEVEL = np.gradient(LIGHT.astype(float))
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


@dataclass(frozen=True)
class EdgePixels:
    """Pixels around the sides, from inside to outside: (s,station,across) each.

    Attributes:
        levels: (…,3) uint8, the picture's.
        out_px: distance outward from the side.
        along: place along it, -1 to 1 between the ends of what is looked at.
        use: 1 where the pixel counts; 0 where it repeats another, is too far out, or outside of the picture.
        columns: (s,) number of distinct columns (rows) of pixels.
    """

    levels: npt.NDArray[np.uint8]
    out_px: Array
    along: Array
    use: Array
    columns: Array

    def without(self, stray: npt.NDArray[np.bool_]) -> EdgePixels:
        """The same with stray stations (s,station) in whose place the nearest other one is repeated."""
        stations = np.arange(stray.shape[1])
        counted = self.use.any(axis=2)
        apart = np.abs(stations[:, None] - stations) + len(stations) * (stray | ~counted)[:, None]
        index = np.where(stray | ~counted, apart.argmin(axis=2), stations)[..., None]
        kept = np.count_nonzero(counted & ~stray, axis=1) / np.maximum(np.count_nonzero(counted, axis=1), 1)
        return EdgePixels(
            np.take_along_axis(self.levels, index[..., None], axis=1),
            np.take_along_axis(self.out_px, index, axis=1),
            np.take_along_axis(self.along, index, axis=1),
            self.use * ~stray[..., None],
            np.maximum(self.columns * kept, 1.0),
        )


def edge_pixels(image: Image, sides: Sides, camera: Camera, half_px: Array) -> EdgePixels:
    """Columns of pixels across flat sides, rows across steep ones.

    Args:
        image: (H,W,3) BGR.
        sides: roughly known.
        camera: its distortion is taken into account.
        half_px: (s,) half of each side's length that is looked at.
    """
    size = np.abs(sides.along)
    steep = (size[:, 1] > size[:, 0]).astype(np.intp)
    packed = np.concatenate([sides.middle_px, sides.along, sides.outward], axis=1)
    packed = np.take_along_axis(packed, _AXES[steep], axis=1).T[:, :, None]
    middle_main, middle_other, along_main, along_other, _, out_other = packed
    # Stations are whole columns (rows): as many as the side covers, spread evenly when there are too many.
    reach_main = np.abs(along_main) * half_px[:, None]
    first, last = np.ceil(middle_main - reach_main), np.floor(middle_main + reach_main)
    count = np.minimum(np.maximum(last - first + 1.0, 1.0), len(_STATIONS))
    spacing = (last - first) / np.maximum(count - 1.0, 1.0)
    station = np.rint(first + np.minimum(_STATIONS, count - 1.0) * spacing)
    along_px = (station - middle_main) / along_main
    across = np.arange(-(reach := min(math.ceil(float(sides.reach_px.max())), MOST_ACROSS)), reach + 1.0)
    across = np.copysign(across, out_other[..., None] * across)
    if camera.has_distortion:
        lens = _lens(sides, along_px, steep, camera)
        station = np.rint(lens.foot_main_px)
        other = np.rint(lens.foot_other_px)[..., None] + across
        from_other, from_main = other - lens.foot_other_px[..., None], (station - lens.foot_main_px)[..., None]
        out_px = lens.out_by_other * from_other + lens.out_by_main * from_main
        along_px = along_px[..., None] + lens.along_by_other * from_other + lens.along_by_main * from_main
    else:
        foot_other = middle_other + along_px * along_other
        nearest = np.rint(foot_other)
        other = nearest[..., None] + across
        from_other = (nearest - foot_other)[..., None] + across
        out_px = out_other[..., None] * from_other
        along_px = along_px[..., None] + along_other[..., None] * from_other
    within = np.abs(out_px) <= (sides.reach_px + 0.5)[:, None, None]
    within &= (count > _STATIONS)[..., None]
    height, width = image.shape[:2]
    per_side = np.array([[width, height], [height, width], [1, width], [width, 1]], float)[:, steep, None]
    size_main, size_other, stride_main, stride_other = per_side
    size_other = size_other[..., None]
    if station.min() < 0.0 or other.min() < 0.0 or (station >= size_main).any() or (other >= size_other).any():
        within &= ((station >= 0.0) & (station < size_main))[..., None] & (other >= 0.0) & (other < size_other)
        station, other = np.clip(station, 0.0, size_main - 1.0), np.clip(other, 0.0, size_other - 1.0)
    index = other * stride_other[..., None]
    index += (station * stride_main)[..., None]
    levels = image.reshape(-1, 3).take(index.astype(np.intp), axis=0)
    along_px *= (1.0 / half_px)[:, None, None]
    return EdgePixels(levels, out_px, along_px, within.astype(float), count[:, 0])


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


def contrast_direction(inside: Array, outside: Array) -> Array | None:
    """The direction (c,) of light along which two mean lights (c,) differ by 1; None without contrast."""
    difference = np.asarray(inside - outside, dtype=float)
    size2 = float(difference @ difference)
    return difference / size2 if size2 > _LEAST_CONTRAST**2 else None


Profile = tuple[Array, bool, float]
"""Light of pixels (s,station,across) from 0 outside to 1 inside; whether the inside saturates; by how much a pixel's
share differs, root mean square, for every grey level that a sensor's noise has."""


def contrasts(pixels: EdgePixels, held: npt.NDArray[np.bool_] | None, *, by_luma: bool) -> Profile | None:
    """Light of pixels (s,station,across) from 0 outside to 1 inside, by the outermost two; None without contrast.

    Args:
        pixels: from inside to outside.
        held: (s,) sides that are not to be measured.
        by_luma: take the light of the pixels' luma, which coded pictures keep at full resolution, instead of the colour
            that differs most.
    """
    sides, stations, across, colours = pixels.levels.shape
    light = LIGHT.take(pixels.levels)
    sums = np.ones(stations, np.float32) @ light.reshape(sides, stations, across * colours)
    sums = sums.reshape(sides, across, colours)
    ends = (sums if held is None else sums[~held])[:, [0, 1, -2, -1]].sum(axis=0)
    ends *= 0.5 / max(stations * (sides if held is None else int(np.count_nonzero(~held))), 1)
    inside, outside = ends[0] + ends[1], ends[2] + ends[3]
    # The edge of a saturated colour is moved outward; the other colours are not affected.
    clear = np.maximum(inside, outside) < _CLIPPED
    direction = None if clear.all() or by_luma else contrast_direction(inside * clear, outside * clear)
    clipped = direction is None and not clear.all()
    if direction is None:
        direction = contrast_direction(inside, outside)
    if direction is None:
        return None
    profile: npt.NDArray[np.floating]
    means: npt.NDArray[np.floating]
    if by_luma:
        mixed = _mixed_by_luma(pixels.levels, inside, outside)
        if mixed is None:
            return None
        profile, means = mixed, mixed.sum(axis=1) / stations
    else:
        weights = direction.astype(np.float32)
        profile = (light.reshape(-1, colours) @ weights).reshape(sides, stations, across)
        means = sums @ (weights / np.float32(stations))
    ground = 0.5 * (means[:, -1] + means[:, -2])
    span = 0.5 * (means[:, 0] + means[:, 1]) - ground
    if held is not None:
        span[held] = 1.0
    if not span.min() >= _LEAST_SIDE_CONTRAST:
        return None
    values = np.asarray(profile, float)
    values -= ground[:, None, None]
    values *= (1.0 / span)[:, None, None]
    _level_by_station(values)
    weights2 = _LUMA_BGR / (_LUMA_BGR @ (inside - outside)) if by_luma else direction
    noise2 = [float(np.sum((weights2 * np.interp(ends, LIGHT, _LIGHT_A_LEVEL)) ** 2)) for ends in (inside, outside)]
    return values, clipped, math.sqrt(0.5 * sum(noise2))


def _level_by_station(values: Array) -> None:
    """Counts each station's values (s,station,across) from its own levels, in place, where a side's differ along it."""
    inner, outer = 0.5 * (values[:, :, 0] + values[:, :, 1]), 0.5 * (values[:, :, -1] + values[:, :, -2])
    uneven = outer.std(axis=1) > _UNEVEN
    if uneven.any():
        span = inner - outer
        own = uneven[:, None] & (span > _LEAST_STATION_CONTRAST)
        values[own] = (values[own] - outer[own][:, None]) / span[own][:, None]


def on_even_ground(values: Array, along: Array) -> Array:
    """Light (s,station,across) from 0 outside to 1 inside, where what is outside changes evenly along a side.

    A board's stains and shadows, a tenth of the contrast from one end to the other, would tilt a side by 0.05 px.

    Args:
        values: light of which 0 is what is outside on average over a side.
        along: (s,station) places of the stations.
    """
    outer = 0.5 * (values[:, :, -1] + values[:, :, -2])
    apart = along - along.mean(axis=1, keepdims=True)
    slope = (apart * outer).sum(axis=1) / np.maximum((apart * apart).sum(axis=1), 1e-9)
    slope[outer.std(axis=1) > _UNEVEN] = 0.0  # whose stations have levels of their own
    ground = (slope[:, None] * apart)[..., None]
    return np.asarray((values - ground) / (1.0 - ground))


def _mixed_by_luma(levels: npt.NDArray[np.uint8], inside: Array, outside: Array) -> Array | None:
    """Share (…,) of the light inside in pixels (…,3), by their luma; None where the two have nearly the same luma.

    The luma of a mixture of two lights (3,) rises with the share of the brighter, though not in proportion.
    """
    light = outside + _SHARES[:, None] * (inside - outside)
    luma = _levels_of(light) @ _LUMA_BGR
    if luma[-1] < luma[0]:
        luma, shares = luma[::-1], _SHARES[::-1]
    else:
        shares = _SHARES
    if not (np.diff(luma).min() > 0.0 and luma[-1] - luma[0] > _LEAST_LUMA):
        return None
    return np.asarray(np.interp(levels @ _LUMA_BGR, luma, shares), float)
