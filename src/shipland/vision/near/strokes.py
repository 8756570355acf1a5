"""Cues of narrow strokes, as an open hexagon of tape: found by their hull, measured as a whole.

Where a stroke is a few pixels wide its two edges run into each other, and no side can be measured by itself. The cue is
then looked for in enlarged cuts of the picture, and fitted as a whole: how the picture would show the cue's plane, for
a view of it, is compared with what it shows. A view is a homography of the cue's plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.cue import Hue
from shipland.frames import Array
from shipland.vision.near.edge_pixels import LIGHT, distort
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.regions import FLOOR, cue_light, find_regions
from shipland.vision.near.segment import Image, Window, outlines, quad_around, region_of
from shipland.vision.parameters import VisionParameters

_ENLARGED = 3
"""Times that a cut of the picture is enlarged in which strokes are looked for."""

_MOST_CUTS, _MOST_CUT_PX = 4, 160
"""Cuts in one picture, those with most light, and their longest side; larger ones need no enlarging."""

_SPARSE_PX2 = 400_000
"""Least size of a picture in which lit parts are looked for on every second pixel of every second row."""

_MARGIN_PX = 5.0
"""Around a cut, and around the cue where it is fitted."""

_FINE = 2
"""Pixels of a side into which a pixel is divided where the cue is drawn."""

_POINTS = 8
"""Points of a side that are drawn: a lens bends it."""

_STEP_PX = 0.25
"""Of differences by a view's corners, and by the blur."""

_STEPS = 6
"""Most Gauss–Newton steps."""

_SETTLED_PX = 0.02
"""Longest step after which there is none."""

_BLUR_PX = (0.3, 3.0)
"""Range of the blur."""

_FIRST_BLUR_PX = 0.7
"""Where the fit starts."""

_REACH = 0.15
"""How far a view may go from where it starts, as a share of the cue's extent."""

_LEAST_ALIKE_AT_FIRST = 0.5
"""Least correlation of picture and rough corners."""

_LEAST_ALIKE = 0.9
"""Least correlation of picture and fit: a sensor's noise and compression leave more, another shape less."""

_LEAST_CONTRAST = 6.0
"""Least difference of light between cue and background [of 255]."""

_CORRELATED = 6.0
"""Pixels that err together, as a factor of the fit's variance: blocks of compression, interpolated colour, drawing."""

_MOST_NOISE = 0.02
"""Largest error of a corner, as a share of the cue's diagonal."""

_NO_VARIANCE = 1e-9
"""Variance, against the largest, in directions that a view does not have."""


def stroke_polygons(
    image: Image, window: Window, parameters: VisionParameters, hue: Hue, plane_m: Array
) -> list[Array]:
    """Polygons (k,2) [px] of the cue's, as the hulls of lit regions may have them.

    Args:
        image: (H,W,3) BGR.
        window: where to look; not empty.
        parameters: kernel, least size and greatest number.
        hue: of the cue.
        plane_m: (n,k,2) the cue's polygons.
    """
    hulls_m = [cv2.convexHull(it.astype(np.float32), clockwise=False)[:, 0].astype(float) for it in plane_m]
    known = [(polygon_m, hull_m) for polygon_m, hull_m in zip(plane_m, hulls_m, strict=True) if len(hull_m) == 4]
    found = []
    for cut in _cuts(image, window, parameters, hue) if known else []:
        enlarged = np.asarray(
            cv2.resize(cut.of(image), None, fx=_ENLARGED, fy=_ENLARGED, interpolation=cv2.INTER_CUBIC), np.uint8
        )
        whole = Window.whole(enlarged)
        lit = outlines(cv2.inRange(cue_light(enlarged, whole, hue), FLOOR, 254), (0, 0), parameters)[: len(plane_m)]
        regions = find_regions(enlarged, whole, parameters, hue, len(plane_m))
        for region in (*regions, *(region_of(contour, enlarged, parameters) for contour in lit)):
            quad = None if region is None or region.cut else quad_around(region, _ENLARGED * parameters.min_side_px)
            if quad is not None:
                quad_px = (quad + 0.5) / _ENLARGED - 0.5 + [cut.left, cut.top]
                found += [_polygon_px(polygon_m, hull_m, quad_px) for polygon_m, hull_m in known]
    return found


def _cuts(image: Image, window: Window, parameters: VisionParameters, hue: Hue) -> list[Window]:
    """The boxes of small lit parts, the largest first."""
    step = 2 if (window.bottom - window.top) * (window.right - window.left) >= _SPARSE_PX2 else 1
    lit = cv2.inRange(cue_light(image, window, hue, step), FLOOR, 254)
    joined = cv2.morphologyEx(lit, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    count, _, boxes, _ = cv2.connectedComponentsWithStats(joined)
    sides_px = step * boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    small = (sides_px.max(axis=1) <= _MOST_CUT_PX) & (sides_px.min(axis=1) >= 2.0 * parameters.min_side_px)
    some = [index for index in range(1, count) if small[index]]
    some.sort(key=lambda index: -int(boxes[index, cv2.CC_STAT_AREA]))
    height_px, width_px = image.shape[:2]
    cuts = []
    for left, top, width, height, _ in boxes[some[:_MOST_CUTS]].tolist():
        corners = step * np.array([[left, top], [left + width - 1, top + height - 1]])
        cuts.append(Window.around(corners + np.array([window.left, window.top]), _MARGIN_PX, width_px, height_px))
    return cuts


def _polygon_px(polygon_m: Array, hull_m: Array, quad_px: Array) -> Array:
    """(k,2) a polygon (k,2) whose hull (4,2) is a quadrilateral (4,2) of the picture, upright as far as can be."""
    model = _directions(hull_m)
    turns = [np.roll(quad_px, -turn, axis=0) for turn in range(4)]
    best = max(turns, key=lambda turned: float((model * _directions(turned)).sum()))
    view = cv2.getPerspectiveTransform(hull_m.astype(np.float32), best.astype(np.float32))
    return np.asarray(cv2.perspectiveTransform(polygon_m[None], view)[0])


def _directions(corners: Array) -> Array:
    side = np.roll(corners, -1, axis=0) - corners
    return np.asarray(side / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9))


def measure_strokes(image: Image, polygons_px: Array, plane_m: Array, camera: Camera) -> MeasuredCorners | None:
    """Corners of the view of a cue with which the picture agrees best; None when it does not agree.

    Picture = ground + slopes + contrast × (cue ⊗ blur): the first three are linear, the view and the blur are found by
    Gauss–Newton.

    Args:
        image: (H,W,3) BGR.
        polygons_px: (n,k,2) corners to within a few pixels, undistorted.
        plane_m: (n,k,2) the cue's.
        camera: its distortion is taken out.
    """
    seen = _Seen.of(image, polygons_px, plane_m, camera)
    if seen is None or seen.alike(seen.fit(seen.start)) < _LEAST_ALIKE_AT_FIRST:
        return None
    state = seen.start
    for _ in range(_STEPS):
        fit = seen.fit(state)
        step = np.clip(np.linalg.lstsq(seen.jacobian(state, fit), -fit.residual, rcond=1e-6)[0], -1.0, 1.0)
        state = state + step
        state[8] = min(max(float(state[8]), _BLUR_PX[0]), _BLUR_PX[1])
        if not np.abs(state - seen.start).max() <= seen.reach_px:
            return None
        if np.abs(step[:8]).max() < _SETTLED_PX:
            break
    fit = seen.fit(state)
    if fit.contrast < _LEAST_CONTRAST or seen.alike(fit) < _LEAST_ALIKE:
        return None
    return seen.corners(state, fit)


@dataclass(frozen=True)
class _LinearFit:
    """What is linear, fitted to the picture.

    Attributes:
        residual: (m,) what the fit lacks of the picture.
        basis: (m,4) orthonormal, of ground, slopes and cue.
        contrast: of the cue.
        cover: (m,) how much of each pixel the cue covers.
    """

    residual: Array
    basis: Array
    contrast: float
    cover: Array


@dataclass(frozen=True)
class _Seen:
    """What the picture shows around a cue. A state (9,) is the view, as four corners (column, row), and the blur [px].

    Attributes:
        window: of the picture.
        shown: (m,) light of its pixels, in the direction of the cue's contrast.
        ground: (m,3) what is linear beside the contrast.
        plane_m, camera: of the cue and of the picture.
        frame_m: (4,2) corners of the cue's box, which the view places.
        start: (9,) the first state.
        reach_px: how far from it a view may go.
    """

    window: Window
    shown: Array
    ground: Array
    plane_m: Array
    camera: Camera
    frame_m: Array
    start: Array
    reach_px: float

    @staticmethod
    def of(image: Image, polygons_px: Array, plane_m: Array, camera: Camera) -> _Seen | None:
        """Around rough corners; None where there is no view of the cue, or one too large for narrow strokes."""
        points_m, points_px = plane_m.reshape(-1, 2), polygons_px.reshape(-1, 2)
        view = np.asarray(cv2.findHomography(points_m, points_px)[0])
        window = Window.around(distort(points_px, camera), _MARGIN_PX, image.shape[1], image.shape[0])
        size_px = (window.right - window.left, window.bottom - window.top)
        if view.shape != (3, 3) or window.empty or max(size_px) > _MOST_CUT_PX + 4 * _MARGIN_PX:
            return None
        (left, top), (right, bottom) = points_m.min(axis=0), points_m.max(axis=0)
        frame_m = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        start = np.append(cv2.perspectiveTransform(frame_m[None], view), _FIRST_BLUR_PX)
        columns, rows = np.meshgrid(np.linspace(-1.0, 1.0, size_px[0]), np.linspace(-1.0, 1.0, size_px[1]))
        ground = np.column_stack([np.ones(rows.size), columns.ravel(), rows.ravel()])
        light = LIGHT[window.of(image)].reshape(-1, 3).astype(float)
        reach_px = _MARGIN_PX + _REACH * float(max(size_px))
        seen = _Seen(window, light[:, 1], ground, plane_m, camera, frame_m, start, reach_px)
        cover = seen.drawn(start)
        inside, outside = cover >= 0.5 * cover.max(), cover < 0.05 * cover.max()
        if not (cover.max() > 0.0 and outside.any()):
            return None
        towards = light[inside].mean(axis=0) - light[outside].mean(axis=0)
        return replace(seen, shown=light @ (towards / max(float(np.abs(towards).sum()), 1e-9)))

    def points_px(self, state: Array, points_m: Array) -> Array:
        """(…,2) undistorted places of points of the plane (…,2)."""
        corners_px = state[:8].reshape(4, 2).astype(np.float32)
        view = cv2.getPerspectiveTransform(self.frame_m.astype(np.float32), corners_px)
        return np.asarray(cv2.perspectiveTransform(points_m.reshape(1, -1, 2), view)[0]).reshape(points_m.shape)

    def drawn(self, state: Array) -> Array:
        """(m,) how much of each pixel the cue covers, blurred."""
        share = (np.arange(_POINTS) / _POINTS)[:, None]
        after_m = np.roll(self.plane_m, -1, axis=1)
        outline_m = self.plane_m[:, :, None] * (1.0 - share) + after_m[:, :, None] * share
        outline_px = self.points_px(state, outline_m.reshape(len(self.plane_m), -1, 2))
        shown_px = distort(outline_px.reshape(-1, 2), self.camera).reshape(outline_px.shape)
        width, height = self.window.right - self.window.left, self.window.bottom - self.window.top
        fine_px = np.array([width, height]) * _FINE
        outlines = (shown_px - np.array([self.window.left - 0.5, self.window.top - 0.5])) * _FINE
        rises = np.zeros(fine_px[::-1])
        for outline in np.clip(outlines, -fine_px, 2 * fine_px):
            _add_rises(outline, rises)
        blurred = cv2.GaussianBlur(rises.cumsum(axis=1).astype(np.float32), (0, 0), _FINE * float(state[8]))
        return np.asarray(cv2.resize(blurred, (width, height), interpolation=cv2.INTER_AREA), float).ravel()

    def fit(self, state: Array) -> _LinearFit:
        """Ground, slopes and contrast that fit best."""
        cover = self.drawn(state)
        basis, triangle = np.linalg.qr(np.column_stack([self.ground, cover]))
        amounts = basis.T @ self.shown
        contrast = float(amounts[3] / triangle[3, 3]) if abs(triangle[3, 3]) > 1e-9 else 0.0
        return _LinearFit(self.shown - basis @ amounts, basis, contrast, cover)

    def jacobian(self, state: Array, fit: _LinearFit) -> Array:
        """(m,9) how the residual changes with a state, beside what the linear part makes up."""
        by_state = np.empty((len(self.shown), 9))
        for index in range(9):
            moved = state.copy()
            moved[index] += _STEP_PX
            by_state[:, index] = (self.drawn(moved) - fit.cover) * (-fit.contrast / _STEP_PX)
        return np.asarray(by_state - fit.basis @ (fit.basis.T @ by_state))

    def alike(self, fit: _LinearFit) -> float:
        """Correlation of picture and fit, the ground apart."""
        ground, _ = np.linalg.qr(self.ground)
        above = self.shown - ground @ (ground.T @ self.shown)
        return math.sqrt(max(1.0 - float(fit.residual @ fit.residual) / max(float(above @ above), 1e-9), 0.0))

    def corners(self, state: Array, fit: _LinearFit) -> MeasuredCorners | None:
        """The cue's corners, with the covariance that the misfit leaves; None where that is too large."""
        noise2 = _CORRELATED * float(fit.residual @ fit.residual) / max(len(fit.residual) - len(state), 1)
        jacobian = self.jacobian(state, fit)
        try:
            of_view = noise2 * np.linalg.inv(jacobian.T @ jacobian)[:8, :8]
        except np.linalg.LinAlgError:
            return None
        corners_px = self.points_px(state, self.plane_m)
        moves = np.empty((corners_px.size, 8))
        for index in range(8):
            moved = state.copy()
            moved[index] += _STEP_PX
            moves[:, index] = (self.points_px(moved, self.plane_m) - corners_px).ravel() / _STEP_PX
        covariance = moves @ of_view @ moves.T
        noise_px = math.sqrt(max(float(np.trace(covariance)) / len(covariance), 0.0))
        if not noise_px <= _MOST_NOISE * math.hypot(*np.ptp(corners_px.reshape(-1, 2), axis=0)):
            return None
        # The polygons' corners err together: each has as much of the view's information as one of so many.
        count, wide = len(corners_px), 2 * corners_px.shape[1]
        blocks = count * covariance.reshape(count, wide, count, wide)
        whiten = np.stack([_whitening(blocks[index, :, index]) for index in range(count)])
        return MeasuredCorners(corners_px, whiten, noise_px, blur_px=float(state[8]), coded=True)


@compiled
def _add_rises(outline: Array, rises: Array) -> None:
    """Add by how much more of each pixel (h,w) an outline (k,2) covers than of the pixel before it in its row.

    Exact, unlike OpenCV's filled polygons, which are half a pixel larger on every side. The outline is clockwise, pixel
    edges are at whole numbers.
    """
    height, width = rises.shape
    for corner in range(len(outline)):
        (x, y), (end_x, end_y) = outline[corner], outline[(corner + 1) % len(outline)]
        if y == end_y:
            continue
        slope = (end_x - x) / (end_y - y)
        for row in range(max(math.floor(min(y, end_y)), 0), min(math.ceil(max(y, end_y)), height)):
            start, end = min(max(y, row), row + 1.0), min(max(end_y, row), row + 1.0)
            one, other = x + slope * (start - y), x + slope * (end - y)
            left, right = min(one, other), max(one, other)
            for column in range(math.floor(left), math.floor(right) + 1):
                first, last = max(left, column), min(right, column + 1.0)
                part = (start - end) * ((last - first) / (right - left) if right > left else 1.0)
                beyond = 0.5 * (first + last) - column if column >= 0 else 0.0
                if column < width:
                    rises[row, max(column, 0)] += part * (1.0 - beyond)
                if column + 1 < width:
                    rises[row, max(column + 1, 0)] += part * beyond


def _whitening(covariance: Array) -> Array:
    """(w,w) what turns deviations into standard deviations; 0 in directions that a view does not have."""
    variance, axes = np.linalg.eigh(covariance)
    weight = np.where(variance > _NO_VARIANCE * variance[-1], 1.0 / np.sqrt(np.maximum(variance, 1e-12)), 0.0)
    return np.asarray(weight[:, None] * axes.T)
