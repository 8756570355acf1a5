"""Quadrilaterals from the contours of coloured regions; they need not be upright."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from shipland.frames import Array
from shipland.vision.bar import Image, Region, watershed_region
from shipland.vision.parameters import VisionParameters

_LEAST_SOLIDITY = 0.85
"""Area of a region over that of its convex hull; foliage stays below, a rectangle 8 px high above."""

_AREA_RATIO = (0.82, 1.18)
"""Area of the four-cornered approximation over that of the hull."""


def quad_from_region(region: Region, min_side_px: float) -> Array | None:
    """Four corners (4,2) [px], clockwise in the picture, of a region that is one quadrilateral; else None.

    The corners lie on the region's outer boundary, half a pixel outside the centres of its outermost pixels.
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
    return _grown(corners.tolist(), 0.5, min_side_px)


def find_quads(
    image: Image, regions: list[Region], parameters: VisionParameters
) -> tuple[list[Array], list[Region], list[Region]]:
    """Quadrilaterals of whole regions, their regions, and the regions cut by the picture's edge."""
    quads: list[Array] = []
    whole: list[Region] = []
    cut: list[Region] = []
    for region in regions:
        if region.cut:
            cut.append(region)
            continue
        found: Region | None = region
        quad = None
        if parameters.watershed != "always":
            quad = quad_from_region(region, parameters.min_side_px)
        if parameters.watershed == "always" or (parameters.watershed == "where_needed" and quad is None):
            found = watershed_region(image, region, parameters.watershed_margin)
            quad = None if found is None else quad_from_region(found, parameters.min_side_px)
        if quad is not None and found is not None:
            quads.append(quad)
            whole.append(found)
    return quads, whole, cut


def _four_corners(hull: npt.NDArray[np.int32]) -> Array | None:
    """The hull simplified until four vertices are left, clockwise; None when it jumps past four."""
    perimeter = cv2.arcLength(hull, True)
    for fraction in (0.02, 0.035, 0.05, 0.07, 0.09):
        polygon = cv2.approxPolyDP(hull, fraction * perimeter, True)
        if len(polygon) == 4:
            corners = polygon[:, 0].astype(float)
            return corners if cv2.contourArea(polygon, oriented=True) > 0.0 else corners[::-1]
        if len(polygon) < 4:
            return None
    return None


def _grown(corners: list[list[float]], distance_px: float, min_side_px: float) -> Array | None:
    """The clockwise quadrilateral with every side moved outward; None when it is not convex or a side is too short.

    Plain numbers: four corners are too few for arrays to pay.
    """
    lines = []
    for (x, y), (next_x, next_y) in zip(corners, corners[1:] + corners[:1], strict=True):
        along_x, along_y = next_x - x, next_y - y
        length = math.hypot(along_x, along_y)
        if length + 2.0 * distance_px < min_side_px:
            return None
        normal_x, normal_y = along_y / length, -along_x / length
        lines.append((normal_x, normal_y, normal_x * x + normal_y * y + distance_px))
    grown = []
    for (ax, ay, a), (bx, by, b) in zip(lines[-1:] + lines[:-1], lines, strict=True):
        turn = ax * by - ay * bx
        if turn < 0.1:
            return None
        grown.append(((a * by - b * ay) / turn, (b * ax - a * bx) / turn))
    return np.array(grown)
