"""Quadrilaterals from the contours of coloured regions; they need not be upright."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from shipland.frames import Array
from shipland.vision.near.bar import Image, Region, watershed_region
from shipland.vision.near.parameters import VisionParameters

_LEAST_SOLIDITY = 0.85
"""Area of a region over that of its convex hull; foliage stays below, a rectangle 8 px high above."""

_LEAST_PLAINNESS = 0.12
"""4π area / perimeter²: 1 for a circle, 0.6 for the rig's rectangles, 0.25 for a frame's three sides."""

_MOST_FLOODS = 8
"""Regions in one picture that the watershed is tried on where it is not asked for; bounds the time foliage takes."""

_LEAST_TURN = 0.3
"""Sine of the least turn from one side to the next."""

_FLUSH_PX = 2.0
"""A corner this near to the picture's edge lies on it: regions end at pixels, and a side may lean a little."""

_SUBPIXEL = 16
"""OpenCV's simplification rounds its corners to whole numbers: it gets the hull in sixteenths of a pixel."""

_AREA_RATIO = (0.82, 1.18)
"""Area of the four-cornered approximation over that of the hull."""


def quad_from_region(region: Region, min_side_px: float) -> Array | None:
    """Four corners (4,2) [px], clockwise in the picture, of a region that is one quadrilateral; else None.

    The sides run around the centres of the region's outermost pixels, which is within half a pixel of where the colour
    changes by half.
    """
    hull = cv2.convexHull(region.contour_px)
    hull_px2 = cv2.contourArea(hull)
    if hull_px2 <= 0.0 or region.area_px2 < _LEAST_SOLIDITY * hull_px2:
        return None
    corners = _four_corners(hull)
    if corners is None:
        return None
    area_px2 = cv2.contourArea(corners.astype(np.float32))
    if not _AREA_RATIO[0] * hull_px2 <= area_px2 <= _AREA_RATIO[1] * hull_px2:
        return None
    return corners if _is_proper(corners.tolist(), min_side_px) else None


@dataclass(frozen=True)
class Found:
    """What the coloured regions of a picture amount to.

    Attributes:
        quads: (4,2) corners [px] each, of regions that are whole.
        flush: the same of regions with one side along the picture's edge: whole if the edge happens to be that side.
        cut: regions of plain outline that reach the picture's edge, those of `flush` among them.
    """

    quads: list[Array]
    flush: list[Array]
    cut: list[Region]


def find_quads(image: Image, regions: list[Region], parameters: VisionParameters) -> Found:
    """Quadrilaterals of regions, with the watershed where the parameters want it."""
    found = Found([], [], [])
    floods = 0
    for region in regions:
        plain = _is_plain(region)
        if region.cut:
            if not plain:
                continue
            found.cut.append(region)
            quad = quad_from_region(region, parameters.min_side_px)
            snapped = None if quad is None else _snapped(quad, image.shape[1], image.shape[0])
            if snapped is not None:
                found.flush.append(snapped)
            continue
        quad = None
        if parameters.watershed != "always":
            quad = quad_from_region(region, parameters.min_side_px)
        if parameters.watershed == "always" or (
            parameters.watershed == "where_needed" and quad is None and plain and floods < _MOST_FLOODS
        ):
            floods += 1
            flooded = watershed_region(image, region, parameters.watershed_margin)
            quad = None if flooded is None else quad_from_region(flooded, parameters.min_side_px)
        if quad is not None:
            found.quads.append(quad)
    return found


def _is_plain(region: Region) -> bool:
    """Whether the region's outline is short for its area, as a rectangle's or a frame's, not foliage's."""
    perimeter_px = cv2.arcLength(region.contour_px, True)
    return bool(4.0 * math.pi * region.area_px2 >= _LEAST_PLAINNESS * perimeter_px**2)


def edge_distances(quad_px: Array, width_px: int, height_px: int) -> Array:
    """(…,4) distances [px] of corners (…,2) from the picture's left, top, right and lower edge."""
    column, row = quad_px[..., 0], quad_px[..., 1]
    return np.stack([column + 0.5, row + 0.5, width_px - 0.5 - column, height_px - 0.5 - row], axis=-1)


def reaches_edge(quads_px: Array, width_px: int, height_px: int) -> bool:
    """Whether a corner (…,2) lies on the picture's edge or beyond, to within half a pixel."""
    (left, top), (right, bottom) = (f(quads_px.reshape(-1, 2), axis=0).tolist() for f in (np.min, np.max))
    return bool(left < 0.0 or top < 0.0 or right > width_px - 1.0 or bottom > height_px - 1.0)


def _snapped(quad: Array, width_px: int, height_px: int) -> Array | None:
    """The quadrilateral with its one side along the picture's edge set on it; None when it is not just one."""
    near = edge_distances(quad, width_px, height_px) < _FLUSH_PX
    if near.sum() != 2 or near.sum(axis=0).max() != 2:
        return None
    edge = int(near.sum(axis=0).argmax())
    snapped = quad.copy()
    snapped[near[:, edge], edge % 2] = (-0.5, -0.5, width_px - 0.5, height_px - 0.5)[edge]
    return snapped


def _four_corners(hull: cv2.typing.MatLike) -> Array | None:
    """The hull with its least sides left out, their neighbours prolonged, until four are left; clockwise."""
    polygon = cv2.approxPolyN(hull * _SUBPIXEL, 4, ensure_convex=True).reshape(-1, 2)
    if len(polygon) != 4:
        return None
    corners = np.asarray(polygon, dtype=float) / _SUBPIXEL
    return corners if cv2.contourArea(polygon, oriented=True) > 0.0 else corners[::-1]


def _is_proper(corners: list[list[float]], min_side_px: float) -> bool:
    """Whether clockwise corners make a convex quadrilateral without short sides or flat corners.

    Plain numbers: four corners are too few for arrays to pay.
    """
    sides = [(bx - ax, by - ay) for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)]
    lengths = [math.hypot(x, y) for x, y in sides]
    if min(lengths) < min_side_px:
        return False
    turns = (
        (ax * by - ay * bx) / (a * b)
        for (ax, ay), (bx, by), a, b in zip(
            sides, sides[1:] + sides[:1], lengths, lengths[1:] + lengths[:1], strict=True
        )
    )
    return min(turns) > _LEAST_TURN
