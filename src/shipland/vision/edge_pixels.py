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
from shipland.vision.bar import Image
from shipland.vision.sides import MOST_ACROSS, Sides, distort

_AXES = np.array([[0, 1, 2, 3, 4, 5], [1, 0, 3, 2, 5, 4]])
"""Order of three (column, row) pairs as (main axis, other axis), for flat sides and for steep ones."""

_STATIONS = np.arange(24.0)
"""Most columns (rows, for steep sides) of pixels that one side is fitted to."""

_LUMA_BGR = np.array([0.114, 0.587, 0.299])
"""ITU-R BT.601, the luma of JPEG and of most video."""

_LEAST_CONTRAST = 12.0
"""Smallest difference of colour between inside and outside, in grey levels, that is measured."""

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
    across = np.arange(-(reach := min(math.ceil(float(sides.reach_px.max())), MOST_ACROSS)), reach + 1.0)
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
    size_main: Array = np.where(steep, float(height), float(width))[:, None]
    size_other: Array = np.where(steep, float(width), float(height))[:, None, None]
    if np.any(station < 0.0) or np.any(station >= size_main) or np.any(other < 0.0) or np.any(other >= size_other):
        use *= ((station >= 0.0) & (station < size_main))[..., None] & (other >= 0.0) & (other < size_other)
        station, other = np.clip(station, 0.0, size_main - 1.0), np.clip(other, 0.0, size_other - 1.0)
    index = other * np.where(steep, 1.0, width)[:, None, None]
    index += (station * np.where(steep, width, 1.0)[:, None])[..., None]
    colours = image.reshape(-1, 3).take(index.astype(np.intp), axis=0).astype(np.float32)
    along_px *= (1.0 / half_px)[:, None, None]
    return EdgePixels(colours, out_px, along_px, use, count[:, 0])


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


def contrasts(pixels: EdgePixels, held: npt.NDArray[np.bool_] | None, *, by_light: bool) -> Array | None:
    """Pixels (s,station,across) from 0 outside to 1 inside, by the outermost two; None without contrast.

    Args:
        pixels: from inside to outside.
        held: (s,) sides that are not to be measured.
        by_light: take the pixels' luma, which coded pictures keep at full resolution, instead of the colour that
            differs most.
    """
    colours = pixels.colours if held is None else pixels.colours[~held]
    mean = colours.sum(axis=(0, 1)) / max(colours.shape[0] * colours.shape[1], 1)
    direction = contrast_direction(0.5 * (mean[0] + mean[1]), 0.5 * (mean[-1] + mean[-2]), by_light=by_light)
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
