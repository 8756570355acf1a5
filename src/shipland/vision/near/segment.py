"""The first stage: coloured regions of a picture (gate, opening, closing, contours) and their quadrilaterals."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from shipland.compiled import compiled
from shipland.cue import Hue
from shipland.frames import Array
from shipland.vision.near.outline import polygon_in_outline, support
from shipland.vision.parameters import VisionParameters

Image = npt.NDArray[np.uint8]
Contour = npt.NDArray[np.int32]
"""(n,1,2) an outline through pixel centres, as OpenCV has it."""


@compiled
def extent_px(points_px: Array) -> tuple[float, float, float, float]:
    """The box around points (n,2): left, top, right, bottom."""
    left, top, right, bottom = math.inf, math.inf, -math.inf, -math.inf
    for point in range(len(points_px)):
        column, row = points_px[point, 0], points_px[point, 1]
        left, top, right, bottom = min(left, column), min(top, row), max(right, column), max(bottom, row)
    return left, top, right, bottom


@dataclass(frozen=True)
class Window:
    """A part of the picture: columns left … right − 1, rows top … bottom − 1 [px]."""

    left: int
    top: int
    right: int
    bottom: int

    @staticmethod
    def around(
        points_px: Array, margin_px: float | Array | tuple[float, float], width_px: int, height_px: int
    ) -> Window:
        """The box of points (n,2) grown by a margin, one or (2,), and cut to the picture; empty when outside of it."""
        left, top, right, bottom = extent_px(points_px)
        beside_px, above_px = (margin_px, margin_px) if isinstance(margin_px, float) else margin_px
        return Window(
            min(max(math.floor(left - beside_px), 0), width_px),
            min(max(math.floor(top - above_px), 0), height_px),
            min(max(math.ceil(right + beside_px) + 1, 0), width_px),
            min(max(math.ceil(bottom + above_px) + 1, 0), height_px),
        )

    @staticmethod
    def whole(image: Image) -> Window:
        """All of a picture."""
        return Window(0, 0, image.shape[1], image.shape[0])

    @property
    def empty(self) -> bool:
        """Whether no pixel lies in it."""
        return self.right <= self.left or self.bottom <= self.top

    def of(self, image: Image) -> Image:
        """The part of the picture, not copied."""
        return image[self.top : self.bottom, self.left : self.right]


@dataclass(frozen=True)
class Region:
    """One connected coloured region.

    Attributes:
        contour_px: (n,2) int32 outer boundary through pixel centres, in the whole picture.
        area_px2: enclosed by it, holes included.
        cut: reaches the picture's edge.
    """

    contour_px: npt.NDArray[np.int32]
    area_px2: float
    cut: bool


def opened_and_closed(mask: cv2.typing.MatLike, kernel_px: int) -> Image:
    """A mask without specks, then without voids [Lee2022, §Image Filtering]."""
    kernel = np.ones((kernel_px, kernel_px), np.uint8)
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, kernel)
    # A border of 0, or closing would join a region to the picture's edge; what opening left at the edge is kept.
    closed = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(cv2.bitwise_or(closed, opened), np.uint8)


def outlines(
    mask: cv2.typing.MatLike, offset: tuple[int, int], parameters: VisionParameters, step: int = 1
) -> list[Contour]:
    """The largest outlines in a mask that are not too small, largest first.

    Args:
        mask: above 0 inside.
        offset: where in the picture its first pixel is.
        parameters: least size and greatest number.
        step: pixels of the picture from one of the mask to the next.
    """
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE, offset=offset)
    # A contour through the centres of the outermost pixels is one pixel short on each axis.
    least_px2 = max(parameters.min_side_px / step - 1.0, 1.0) ** 2
    sized = [(cv2.contourArea(contour), contour) for contour in contours if len(contour) >= 4]
    sized = sorted((item for item in sized if item[0] >= least_px2), key=lambda item: -item[0])
    return [np.asarray(contour, np.int32) for _, contour in sized[: parameters.max_candidates]]


def region_of(contour: Contour, image: Image, parameters: VisionParameters) -> Region | None:
    """The region of an outline in the picture; None when it is too narrow."""
    left, top, width, height = cv2.boundingRect(contour)
    if min(width, height) < parameters.min_side_px:
        return None
    height_px, width_px = image.shape[:2]
    cut = left <= 0 or top <= 0 or left + width >= width_px or top + height >= height_px
    return Region(np.asarray(contour[:, 0], np.int32), float(cv2.contourArea(contour)), cut)


_LEAST_SOLIDITY = 0.85
"""Area of a region over that of its convex hull; foliage stays below, a rectangle 8 px high above."""

_LEAST_PLAINNESS = 0.12
"""4π area / perimeter²: 1 for a circle, 0.6 for the rig's rectangles, 0.25 for a frame's three sides."""

_FILLED = 0.06
"""Difference of a region's area from that of its hull's quadrilateral, over the hull's, up to which nothing of it is
hidden."""

_LEAST_DOUBTFUL_PX2 = 80.0
"""Area from which a region's outline shows lines."""

_LEAST_BITTEN = 0.6
"""Area of a region with a bite out of it over that of its convex hull."""

_MOST_DOUBTFUL = 2
"""Regions in one picture whose outline is searched for lines, the largest; bounds the time that foliage takes."""

_MOST_OUTLINES = 10
"""The same where the cue's polygons are no quadrilaterals."""

_MOST_JOINED = 12
"""Quadrilaterals of a picture up to which pairs of them are looked at; with more, it is not the cue that is cut."""

_LEAST_JOINED = 0.6
"""Least share of the hull of two quadrilaterals that these fill, where they are parts of one."""

_MORE_SUPPORT = 0.05
"""Share of its sides by which more of a quadrilateral must lie on the outline than of that of the hull."""

_LEAST_TURN = 0.3
"""Sine of the least turn from one side to the next."""

_FLUSH_PX = 2.0
"""Distance from the picture's edge within which a corner lies on it: regions end at pixels, sides may be oblique."""

_CUT_SIDE_PX = 8.0
"""Least side of a cut region that can be a part of the cue."""

_SUBPIXEL = 16
"""Scale of the hull for OpenCV's simplification, which rounds corners to whole numbers."""

_AREA_RATIO = (0.82, 1.18)
"""Area of the four-cornered approximation over that of the hull."""


def quad_of_hull(region: Region, min_side_px: float) -> tuple[Array | None, bool]:
    """Four corners (4,2) [px], clockwise in the picture, of a region's hull, or None; whether its outline has others.

    The sides run through the centres of the region's outermost pixels: within half a pixel of the true edge.
    """
    hull = cv2.convexHull(region.contour_px)
    hull_px2 = cv2.contourArea(hull)
    if hull_px2 <= 0.0:
        return None, False
    quad = _quad_of_hull(hull, hull_px2, min_side_px) if region.area_px2 >= _LEAST_SOLIDITY * hull_px2 else None
    fills = quad is not None and abs(cv2.contourArea(quad.astype(np.float32)) - region.area_px2) <= _FILLED * hull_px2
    bitten = region.area_px2 >= max(_LEAST_DOUBTFUL_PX2, _LEAST_BITTEN * hull_px2)
    return quad, not fills and bitten and _is_plain(region)


def quad_around(region: Region, min_side_px: float) -> Array | None:
    """Four corners (4,2) [px], clockwise, of a region's hull, however little of it the region fills; None for none."""
    hull = cv2.convexHull(region.contour_px)
    return _quad_of_hull(hull, max(cv2.contourArea(hull), 1e-9), min_side_px)


def quad_in_outline(region: Region, quad: Array | None, min_side_px: float) -> Array | None:
    """Four corners (4,2) [px] in a region's outline, where that supports them better than those of its hull."""
    lines = polygon_in_outline(region.contour_px, region.area_px2, 4)
    if lines is None or not _is_proper(lines.tolist(), min_side_px):
        return quad
    better = quad is None or support(lines, region.contour_px) > support(quad, region.contour_px) + _MORE_SUPPORT
    return lines if better else quad


def _quad_of_hull(hull: cv2.typing.MatLike, hull_px2: float, min_side_px: float) -> Array | None:
    """Four corners (4,2) [px] that fill as much as a convex hull of that area does; None when no four do."""
    corners = _four_corners(hull)
    if corners is None:
        return None
    area_px2 = cv2.contourArea(corners.astype(np.float32))
    if not _AREA_RATIO[0] * hull_px2 <= area_px2 <= _AREA_RATIO[1] * hull_px2:
        return None
    return corners if _is_proper(corners.tolist(), min_side_px) else None


@dataclass(frozen=True)
class Segments:
    """The coloured regions of a picture as quadrilaterals.

    Attributes:
        quads: (4,2) corners [px] each, of regions that are whole.
        flush: the same of regions with one side along the picture's edge: whole if the edge happens to be that side.
        cut: regions of plain outline that reach the picture's edge, those of `flush` among them.
    """

    quads: list[Array]
    flush: list[Array]
    cut: list[Region]


RegionsOf = Callable[[Image, Window, VisionParameters, Hue, int], list[Region]]
"""Finds the regions of a hue in a part of a picture, largest first, for a cue of so many polygons."""

QuadsOf = Callable[[Image, list[Region], VisionParameters, int], list[Array]]
"""Finds the polygons (n,2) [px] of so many corners among regions that are whole."""


def segment(
    image: Image, regions: list[Region], parameters: VisionParameters, corners: int, quads_of: QuadsOf
) -> Segments:
    """The polygons of so many corners among the regions of a picture."""
    cut = [region for region in regions if region.cut and _is_plain(region)] if corners == 4 else []
    cut_quads = (quad_of_hull(region, parameters.min_side_px)[0] for region in cut)
    flush = (_snapped(quad, image.shape[1], image.shape[0]) for quad in cut_quads if quad is not None)
    whole = [region for region in regions if not region.cut]
    return Segments(quads_of(image, whole, parameters, corners), [quad for quad in flush if quad is not None], cut)


def find_quads(_: Image, regions: list[Region], parameters: VisionParameters, corners: int = 4) -> list[Array]:
    """The polygons of so many corners among whole regions."""
    if corners != 4:
        some = (polygon_in_outline(region.contour_px, region.area_px2, corners) for region in regions[:_MOST_OUTLINES])
        return [polygon for polygon in some if polygon is not None]
    quads = []
    doubtful = 0
    for region in regions:
        quad, doubt = quad_of_hull(region, parameters.min_side_px)
        if doubt and doubtful < _MOST_DOUBTFUL:
            doubtful += 1
            quad = quad_in_outline(region, quad, parameters.min_side_px)
        if quad is not None:
            quads.append(quad)
    return quads


def joined_quads(quads: list[Array], min_side_px: float) -> list[Array]:
    """Quadrilaterals around two of those found, as where something crosses one of the cue's and cuts it in two.

    Both ends of one continue those of the other: together they fill most of their hull.
    """
    joined: list[Array] = []
    if len(quads) > _MOST_JOINED:
        return joined
    areas_px2 = [cv2.contourArea(quad.astype(np.float32)) for quad in quads]
    for (one, one_px2), (other, other_px2) in itertools.combinations(zip(quads, areas_px2, strict=True), 2):
        hull = cv2.convexHull(np.round(_SUBPIXEL * np.concatenate([one, other])).astype(np.int32)[:, None])
        hull_px2 = cv2.contourArea(hull) / _SUBPIXEL**2
        if not _LEAST_JOINED * hull_px2 <= one_px2 + other_px2 <= hull_px2:
            continue
        quad = _quad_of_hull(np.round(hull / _SUBPIXEL).astype(np.int32), hull_px2, min_side_px)
        if quad is not None:
            joined.append(quad)
    return joined


def is_cut_quad(region: Region) -> bool:
    """Whether a region that the picture's edge cuts is still four-cornered, and not a speck, as a cue's part is.

    Its hull is: a frame that the edge cuts is open there, and its region a U.
    """
    return quad_around(region, _CUT_SIDE_PX) is not None


def _is_plain(region: Region) -> bool:
    """Whether the region's outline is short for its area, as a rectangle's or a frame's, not foliage's."""
    perimeter_px = cv2.arcLength(region.contour_px, True)
    return bool(4.0 * math.pi * region.area_px2 >= _LEAST_PLAINNESS * perimeter_px**2)


def edge_distances(quad_px: Array, width_px: int, height_px: int) -> Array:
    """(…,4) distances [px] of corners (…,2) from the picture's left, top, right and lower edge."""
    column, row = quad_px[..., 0], quad_px[..., 1]
    return np.stack([column + 0.5, row + 0.5, width_px - 0.5 - column, height_px - 0.5 - row], axis=-1)


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
    if len(hull) < 4:
        return None
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
