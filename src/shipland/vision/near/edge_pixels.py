"""The pixels around the sides of quadrilaterals, and how far each is from outside to inside.

Arrays are (side, station, across): stations along a side, pixels across it from inside to outside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array
from shipland.vision.near.bar import Image
from shipland.vision.near.sides import MOST_ACROSS, Sides, distort

_AXES = np.array([[0, 1, 2, 3, 4, 5], [1, 0, 3, 2, 5, 4]])
"""Order of three (column, row) pairs as (main axis, other axis), for flat sides and for steep ones."""

_STATIONS = np.arange(20.0)
"""Most columns (rows, for steep sides) of pixels that one side is fitted to."""

_LUMA_BGR = np.array([0.114, 0.587, 0.299])
"""ITU-R BT.601, the luma of JPEG and of most video."""

_LEAST_CONTRAST = 12.0
"""Smallest difference of colour between inside and outside, in grey levels, that is measured."""

_CLIPPED = 254.0
"""Mean grey level from which a colour is taken to be clipped at 255."""

_LEAST_SIDE_CONTRAST = 0.15
"""The same for a single side, against the cue's."""


@dataclass(frozen=True)
class EdgePixels:
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
    colours = image.reshape(-1, 3).take(index.astype(np.intp), axis=0).astype(np.float32)
    along_px *= (1.0 / half_px)[:, None, None]
    return EdgePixels(colours, out_px, along_px, within.astype(float), count[:, 0])


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


def contrast_direction(inside: Array, outside: Array, *, by_light: bool = False) -> Array | None:
    """The colour direction (3,) along which two mean colours (3,) differ by 1; None without contrast."""
    difference = np.asarray(inside - outside, dtype=float)
    weights = _LUMA_BGR if by_light else difference
    size = float(difference @ weights)
    if not abs(size) > _LEAST_CONTRAST * math.sqrt(float(weights @ weights)):
        return None
    return weights / size


def contrasts(
    pixels: EdgePixels, held: npt.NDArray[np.bool_] | None, *, by_light: bool
) -> tuple[Array, bool] | tuple[None, bool]:
    """Pixels (s,station,across) from 0 outside to 1 inside, by the outermost two; None without contrast.

    And whether the inside is brighter than the picture can tell, which moves the edge outward.

    Args:
        pixels: from inside to outside.
        held: (s,) sides that are not to be measured.
        by_light: take the pixels' luma, which coded pictures keep at full resolution, instead of the colour that
            differs most.
    """
    sides, stations, across, _ = pixels.colours.shape
    sums = np.ones(stations, np.float32) @ pixels.colours.reshape(sides, stations, across * 3)
    sums = sums.reshape(sides, across, 3)
    ends = (sums if held is None else sums[~held])[:, [0, 1, -2, -1]].sum(axis=0)
    ends *= 0.5 / max(stations * (sides if held is None else int(np.count_nonzero(~held))), 1)
    direction = contrast_direction(ends[0] + ends[1], ends[2] + ends[3], by_light=by_light)
    if direction is None:
        return None, False
    light = direction.astype(np.float32)
    profile = (pixels.colours.reshape(-1, 3) @ light).reshape(sides, stations, across)
    means = sums @ (light / np.float32(stations))
    ground = 0.5 * (means[:, -1] + means[:, -2])
    span = 0.5 * (means[:, 0] + means[:, 1]) - ground
    if held is not None:
        span[held] = 1.0
    if not span.min() >= _LEAST_SIDE_CONTRAST:
        return None, False
    values = np.asarray(profile, float)
    values -= ground[:, None, None]
    values *= (1.0 / span)[:, None, None]
    return values, float((ends[0] + ends[1]).max()) >= _CLIPPED
