"""Polygons of known count of corners in a region's outline: lines on which most of it lies, and where they meet."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from shipland.frames import Array

_FINE = (0.25, 0.12)
"""How far a polygon may lie off the outline before it is simplified, as fractions of the region's width."""

_MOST_MORE = 10
"""Vertices that an outline may have beyond the polygon's; with more it is no polygon."""

_LINE_PX = 2.0
"""Distance up to which a point of the outline belongs to a side."""

_SETTLED = 2
"""How often the sides are laid through their points anew."""

_SUPPORTED, _ALL_SUPPORTED = 0.25, 0.6
"""Least share of every side that lies on the outline, and of all sides together."""

_WELL_SUPPORTED = 0.85
"""Share of all sides from which a finer polygon is not tried."""

_AREA_RATIO = (0.75, 1.6)
"""Area of the polygon over that of the region; a part of the polygon may be hidden."""

_PARALLEL = 0.15
"""Sine of the angle up to which two lines are taken for parallel."""


def polygon_in_outline(contour_px: npt.NDArray[np.int32], area_px2: float, count: int) -> Array | None:
    """Corners (count,2) [px], clockwise, of the polygon on which a region's outline mostly lies; None for none.

    A bite out of a side, a corner that something hides, something small that touches the region: the sides are then
    those of the rest.
    """
    points_px, width_px = _points(contour_px), 2.0 * area_px2 / cv2.arcLength(contour_px, True)
    best, most = None, _ALL_SUPPORTED
    for fine in _FINE:
        if most >= _WELL_SUPPORTED:
            break
        corners = _polygon(contour_px, max(1.0, fine * width_px), points_px, count)
        if corners is None:
            continue
        share = _support(corners, points_px)
        larger = cv2.contourArea(corners.astype(np.float32), oriented=True) / area_px2
        if share.min() >= _SUPPORTED and share.mean() > most and _AREA_RATIO[0] <= larger <= _AREA_RATIO[1]:
            best, most = corners, float(share.mean())
    return best


def _polygon(contour_px: npt.NDArray[np.int32], fine_px: float, points_px: Array, count: int) -> Array | None:
    """Corners (count,2) of an outline whose details up to `fine_px` are left out; None when it has too few or many."""
    vertices = cv2.approxPolyDP(contour_px, fine_px, True)[:, 0].astype(float)
    if not count <= len(vertices) <= count + _MOST_MORE:
        return None
    if cv2.contourArea(vertices.astype(np.float32), oriented=True) < 0.0:
        vertices = vertices[::-1]
    corners = _simplified(vertices, count)
    for _ in range(_SETTLED):
        if corners is not None:
            corners = _settled(corners, points_px)
    return corners


def _simplified(vertices: Array, count: int) -> Array | None:
    """A polygon (count,2) with vertices or sides left out, each time what changes its area least."""
    polygon = vertices
    while len(polygon) > count:
        index = np.arange(len(polygon))
        before, after, second = polygon[index - 1], polygon[index + 1 - len(polygon)], polygon[index + 2 - len(polygon)]
        without_vertex = np.abs(_cross(polygon - before, after - before))
        meets = _meeting(before, polygon - before, second, after - second)
        without_side = np.abs(_cross(after - polygon, meets - polygon))
        # Sides that meet only beyond their own far ends would turn the polygon over.
        forward = ((meets - polygon) * (polygon - before)).sum(axis=1) >= 0.0
        forward &= ((meets - after) * (after - second)).sum(axis=1) >= 0.0
        without_side = np.where(forward, without_side, np.inf)
        vertex, side = int(without_vertex.argmin()), int(without_side.argmin())
        if without_side[side] < without_vertex[vertex]:
            polygon[side] = meets[side]
            polygon = np.delete(polygon, (side + 1) % len(polygon), axis=0)
        else:
            polygon = np.delete(polygon, vertex, axis=0)
    return polygon


def _points(contour_px: npt.NDArray[np.int32]) -> Array:
    """(m,2) points of a region's outline, about a pixel apart."""
    closed = np.concatenate([contour_px, contour_px[:1]]).astype(float)
    length_px = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    places = np.linspace(0.0, length_px[-1], min(max(int(length_px[-1]), 8), 600), endpoint=False)
    return np.column_stack([np.interp(places, length_px, closed[:, axis]) for axis in (0, 1)])


def _of_sides(corners: Array, points_px: Array) -> tuple[Array, Array, Array]:
    """(n,2) unit directions of the sides, (n,) their lengths, (n,m) whether a point lies on a side."""
    side = corners[_following(len(corners))] - corners
    length_px = np.maximum(np.hypot(*side.T), 1e-9)
    along = side / length_px[:, None]
    apart = points_px[None] - corners[:, None]
    forward = np.einsum("nmk,nk->nm", apart, along)
    across = np.abs(_cross(along[:, None], apart))
    return along, length_px, (across <= _LINE_PX) & (forward >= 0.0) & (forward <= length_px[:, None])


def _settled(corners: Array, points_px: Array) -> Array | None:
    """Corners (n,2) where the sides meet that are laid through the points beside them; None when two are parallel."""
    along, _, on = _of_sides(corners, points_px)
    share = on / np.maximum(on.sum(axis=1, keepdims=True), 1)
    middle = share @ points_px
    x, y = points_px.T
    xx, yy, xy = (share @ np.column_stack([x * x, y * y, x * y])).T
    mx, my = middle.T
    angle = 0.5 * np.arctan2(2.0 * (xy - mx * my), xx - yy - mx * mx + my * my)
    line = np.column_stack([np.cos(angle), np.sin(angle)])
    line *= np.sign((line * along).sum(axis=1))[:, None]
    laid = (np.count_nonzero(on, axis=1) >= 3) & (np.abs(_cross(line, along)) < _PARALLEL)
    foot = np.where(laid[:, None], middle, 0.5 * (corners + corners[_following(len(corners))]))
    direction = np.where(laid[:, None], line, along)
    preceding = np.arange(-1, len(corners) - 1)
    before = direction[preceding]
    if np.abs(_cross(before, direction)).min() < _PARALLEL:
        return None
    return _meeting(foot[preceding], before, foot, direction)


def _following(count: int) -> npt.NDArray[np.intp]:
    """Of every corner, the next one's index."""
    return np.arange(1, count + 1) % count


def support(corners: Array, contour_px: npt.NDArray[np.int32]) -> float:
    """Share of the sides (n,2) that lies on an outline."""
    return float(_support(corners, _points(contour_px)).mean())


def _support(corners: Array, points_px: Array) -> Array:
    """(n,) share of each side that lies on the outline."""
    _, length_px, on = _of_sides(corners, points_px)
    spacing_px = float(np.hypot(*(points_px[1] - points_px[0])))
    return np.asarray(np.minimum(np.count_nonzero(on, axis=1) * spacing_px / length_px, 1.0))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _meeting(start: Array, direction: Array, other: Array, other_direction: Array) -> Array:
    """(…,2) where lines meet; far away where they are parallel."""
    turn = _cross(direction, other_direction)
    reach = _cross(other - start, other_direction) / np.where(turn == 0.0, 1e-9, turn)
    return np.asarray(start + reach[..., None] * direction)
