"""Cues of narrow strokes, as an open hexagon of tape: found by their hull, measured as a whole.

Where a stroke is a few pixels wide its two edges run into each other, and no side can be measured by itself. The cue is
then looked for in enlarged cuts of the picture, and fitted as a whole: how the picture would show the cue's plane, for
a view of it, is compared with what it shows. A view is a homography of the cue's plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.cue import Hue
from shipland.frames import Array
from shipland.vision.near.edge_pixels import LIGHT, distort
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.regions import FLOOR, cue_light, find_regions
from shipland.vision.near.segment import Image, Window, quad_around

_ENLARGED = 3
"""Times that a cut of the picture is enlarged in which strokes are looked for."""

_MOST_CUTS, _MOST_CUT_PX = 6, 240
"""Cuts in one picture, those with most light, and their longest side; larger ones need no enlarging."""

_MARGIN_PX = 5
"""Around a cut, and around the cue where it is fitted."""

_FINE = 4
"""Pixels of a side into which a pixel is divided where the cue is drawn."""

_FRACTION_BITS = 4
"""Of OpenCV's coordinates where it is drawn."""

_POINTS = 8
"""Points of a side that are drawn: a lens bends it."""

_STEP_PX = 0.25
"""Half the step of a difference by a corner of the view."""

_STEPS = 6
"""Most Gauss–Newton steps."""

_SETTLED_PX = 0.02
"""Longest step after which there is none."""

_BLUR_PX = (0.3, 3.0)
"""Range of the blur."""

_LEAST_ALIKE = 0.9
"""Least correlation of picture and fit: a sensor's noise and compression leave more, another shape less."""

_LEAST_CONTRAST = 6.0
"""Least difference of light between cue and background [of 255]."""

_CORRELATED = 6.0
"""Pixels that err together, as a factor of the fit's variance: blocks of compression, interpolated colour, drawing."""

_MOST_NOISE = 0.02
"""Largest error of a corner, as a share of the cue's diagonal."""


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
    hulls = [hull for hull in (_Hull.of(polygon_m) for polygon_m in plane_m) if hull is not None]
    found = []
    for cut in _cuts(image, window, parameters, hue) if hulls else []:
        enlarged = np.asarray(
            cv2.resize(cut.of(image), None, fx=_ENLARGED, fy=_ENLARGED, interpolation=cv2.INTER_CUBIC), np.uint8
        )
        for region in find_regions(enlarged, Window.whole(enlarged), parameters, hue, len(plane_m)):
            quad = None if region.cut else quad_around(region, _ENLARGED * parameters.min_side_px)
            if quad is not None:
                quad_px = (quad + 0.5) / _ENLARGED - 0.5 + [cut.left, cut.top]
                found += [hull.polygon_px(quad_px) for hull in hulls]
    return found


def _cuts(image: Image, window: Window, parameters: VisionParameters, hue: Hue) -> list[Window]:
    """The boxes of small lit parts, brightest first."""
    lit = cv2.inRange(cue_light(window.of(image), hue), FLOOR, 254)
    joined = cv2.morphologyEx(lit, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    count, _, boxes, _ = cv2.connectedComponentsWithStats(joined)
    sides_px = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    small = (sides_px.max(axis=1) <= _MOST_CUT_PX) & (sides_px.min(axis=1) >= 2.0 * parameters.min_side_px)
    some = [index for index in range(1, count) if small[index]]
    some.sort(key=lambda index: -int(boxes[index, cv2.CC_STAT_AREA]))
    height_px, width_px = image.shape[:2]
    cuts = []
    for left, top, width, height, _ in boxes[some[:_MOST_CUTS]].tolist():
        corners = np.array([[left, top], [left + width - 1, top + height - 1]]) + np.array([window.left, window.top])
        cuts.append(Window.around(corners, _MARGIN_PX, width_px, height_px))
    return cuts


@dataclass(frozen=True)
class _Hull:
    """A polygon of the cue by its hull.

    Attributes:
        corners_m: (4,2) of its convex hull, clockwise.
        polygon_m: (k,2).
    """

    corners_m: Array
    polygon_m: Array

    @staticmethod
    def of(polygon_m: Array) -> _Hull | None:
        """None where the hull has another number of corners than four."""
        hull = cv2.convexHull(polygon_m.astype(np.float32), clockwise=False)[:, 0].astype(float)
        return _Hull(hull, polygon_m) if len(hull) == 4 else None

    def polygon_px(self, quad_px: Array) -> Array:
        """(k,2) the polygon whose hull is a quadrilateral (4,2) of the picture, upright as far as can be."""
        model = _directions(self.corners_m)
        turns = [np.roll(quad_px, -turn, axis=0) for turn in range(4)]
        best = max(turns, key=lambda turned: float((model * _directions(turned)).sum()))
        view = cv2.getPerspectiveTransform(self.corners_m.astype(np.float32), best.astype(np.float32))
        return np.asarray(cv2.perspectiveTransform(self.polygon_m[None], view)[0])


def _directions(corners: Array) -> Array:
    side = np.roll(corners, -1, axis=0) - corners
    return np.asarray(side / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9))


def measure_strokes(
    image: Image, polygons_px: Array, plane_m: Array, camera: Camera, blur_px: float | None
) -> MeasuredCorners | None:
    """Corners of the view of a cue with which the picture agrees best; None when it does not agree.

    Picture = ground + slopes + contrast × (cue ⊗ blur): the first three are linear, the view and the blur are found by
    Gauss–Newton.

    Args:
        image: (H,W,3) BGR.
        polygons_px: (n,k,2) corners to within a few pixels, undistorted.
        plane_m: (n,k,2) the cue's.
        camera: its distortion is taken out.
        blur_px: a guess of the picture's blur, or None.
    """
    fit = _Fit.of(image, polygons_px, plane_m, camera)
    if fit is None:
        return None
    view_px, blur = fit.start_px, min(max(blur_px or 0.7, _BLUR_PX[0]), _BLUR_PX[1])
    for _ in range(_STEPS):
        residual, jacobian, _ = fit.linearised(view_px, blur)
        step, *_ = np.linalg.lstsq(jacobian, -residual, rcond=1e-6)
        step = np.clip(step, -1.0, 1.0)
        view_px = view_px + step[:8].reshape(4, 2)
        blur = min(max(blur + 0.5 * float(step[8]), _BLUR_PX[0]), _BLUR_PX[1])
        if not np.isfinite(view_px).all() or np.abs(view_px - fit.start_px).max() > fit.reach_px:
            return None
        if np.abs(step[:8]).max() < _SETTLED_PX:
            break
    residual, jacobian, contrast = fit.linearised(view_px, blur)
    if contrast < _LEAST_CONTRAST or fit.alike(residual) < _LEAST_ALIKE:
        return None
    return fit.corners(view_px, blur, residual, jacobian)


@dataclass(frozen=True)
class _Fit:
    """What the picture shows around a cue.

    Attributes:
        window: of the picture.
        shown: (m,) light of its pixels, in the direction of the cue's contrast.
        ground: (m,3) what is linear beside the contrast.
        plane_m, camera: of the cue and of the picture.
        frame_m: (4,2) corners of the cue's box, which the view moves.
        start_px: (4,2) where they are at first.
        reach_px: how far they may go.
    """

    window: Window
    shown: Array
    ground: Array
    plane_m: Array
    camera: Camera
    frame_m: Array
    start_px: Array
    reach_px: float

    @staticmethod
    def of(image: Image, polygons_px: Array, plane_m: Array, camera: Camera) -> _Fit | None:
        points_m, points_px = plane_m.reshape(-1, 2), polygons_px.reshape(-1, 2)
        view, _ = cv2.findHomography(points_m, points_px)
        if view is None:
            return None
        (left, top), (right, bottom) = points_m.min(axis=0), points_m.max(axis=0)
        frame_m = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        start_px = cv2.perspectiveTransform(frame_m[None], view)[0]
        height_px, width_px = image.shape[:2]
        window = Window.around(distort(points_px, camera), _MARGIN_PX, width_px, height_px)
        if window.empty or max(window.right - window.left, window.bottom - window.top) > 2 * _MOST_CUT_PX:
            return None
        light = LIGHT[window.of(image)].reshape(-1, 3).astype(float)
        rows, columns = np.mgrid[
            -1.0 : 1.0 : 1j * (window.bottom - window.top), -1.0 : 1.0 : 1j * (window.right - window.left)
        ]
        ground = np.column_stack([np.ones(rows.size), columns.ravel(), rows.ravel()])
        fit = _Fit(
            window,
            light[:, 1],
            ground,
            plane_m,
            camera,
            frame_m,
            start_px,
            0.15 * float(np.ptp(points_px, axis=0).max()) + 2.0,
        )
        cover = fit.drawn(start_px, 0.7)
        if cover is None or cover.max() <= 0.0:
            return None
        inside = cover >= 0.5 * cover.max()
        towards = light[inside].mean(axis=0) - light[cover < 0.05 * cover.max()].mean(axis=0)
        towards /= max(float(np.abs(towards).sum()), 1e-9)
        return _Fit(window, light @ towards, ground, plane_m, camera, frame_m, start_px, fit.reach_px)

    def points_px(self, view_px: Array, points_m: Array) -> Array:
        """(…,2) undistorted places of points of the plane in a view."""
        view = cv2.getPerspectiveTransform(self.frame_m.astype(np.float32), view_px.astype(np.float32))
        return np.asarray(cv2.perspectiveTransform(points_m.reshape(1, -1, 2), view)[0]).reshape(points_m.shape)

    def drawn(self, view_px: Array, blur_px: float) -> Array:
        """(m,) how much of each pixel the cue covers in a view, blurred."""
        share = (np.arange(_POINTS) / _POINTS)[:, None]
        after_m = np.roll(self.plane_m, -1, axis=1)
        outline_m = self.plane_m[:, :, None] * (1.0 - share) + after_m[:, :, None] * share
        outline_px = self.points_px(view_px, outline_m.reshape(len(self.plane_m), -1, 2))
        shown_px = distort(outline_px.reshape(-1, 2), self.camera).reshape(outline_px.shape)
        fine = (shown_px - [self.window.left - 0.5, self.window.top - 0.5]) * _FINE - 0.5
        height, width = self.window.bottom - self.window.top, self.window.right - self.window.left
        canvas = np.zeros((height * _FINE, width * _FINE), np.uint8)
        corners = np.round(fine * 2**_FRACTION_BITS).astype(np.int32)
        cv2.fillPoly(canvas, list(corners), 255, shift=_FRACTION_BITS)
        small = cv2.resize(canvas.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.GaussianBlur(small, (0, 0), blur_px), float).ravel() / 255.0

    def linearised(self, view_px: Array, blur_px: float) -> tuple[Array, Array, float]:
        """(m,) what the best fit lacks of the picture, (m,9) how that changes with view and blur, and the contrast.

        What the linear part can make up is taken out of both.
        """
        basis = np.column_stack([self.ground, self.drawn(view_px, blur_px)])
        orthogonal, triangle = np.linalg.qr(basis)
        amount = orthogonal.T @ self.shown
        contrast = float(amount[3] / triangle[3, 3]) if triangle[3, 3] != 0.0 else 0.0
        residual = self.shown - orthogonal @ amount
        columns = []
        for index in range(8):
            moved = np.zeros(8)
            moved[index] = _STEP_PX
            ahead, behind = (self.drawn(view_px + sign * moved.reshape(4, 2), blur_px) for sign in (1.0, -1.0))
            columns.append((ahead - behind) * (-contrast / (2.0 * _STEP_PX)))
        more = 0.1
        columns.append((self.drawn(view_px, blur_px + more) - self.drawn(view_px, blur_px)) * (-contrast / more))
        jacobian = np.column_stack(columns)
        return residual, jacobian - orthogonal @ (orthogonal.T @ jacobian), contrast

    def alike(self, residual: Array) -> float:
        """Correlation of picture and fit, the ground apart."""
        ground, _ = np.linalg.qr(self.ground)
        above = self.shown - ground @ (ground.T @ self.shown)
        return math.sqrt(max(1.0 - float(residual @ residual) / max(float(above @ above), 1e-9), 0.0))

    def corners(self, view_px: Array, blur_px: float, residual: Array, jacobian: Array) -> MeasuredCorners | None:
        """The cue's corners in a view, with the covariance that the misfit leaves."""
        noise2 = _CORRELATED * float(residual @ residual) / max(len(residual) - 13, 1)
        information = jacobian.T @ jacobian / noise2
        try:
            covariance = np.linalg.inv(information)[:8, :8]
        except np.linalg.LinAlgError:
            return None
        corners_px = self.points_px(view_px, self.plane_m)
        moves = np.empty((corners_px.size, 8))
        for index in range(8):
            moved = np.zeros(8)
            moved[index] = _STEP_PX
            moves[:, index] = (
                self.points_px(view_px + moved.reshape(4, 2), self.plane_m) - corners_px
            ).ravel() / _STEP_PX
        of_corners = moves @ covariance @ moves.T
        noise_px = math.sqrt(float(np.trace(of_corners)) / len(of_corners))
        if not noise_px <= _MOST_NOISE * math.hypot(*np.ptp(corners_px.reshape(-1, 2), axis=0)):
            return None
        wide = 2 * corners_px.shape[1]
        blocks = of_corners.reshape(len(corners_px), wide, len(corners_px), wide)
        whiten = np.stack([_whitening(len(corners_px) * blocks[i, :, i]) for i in range(len(corners_px))])
        return MeasuredCorners(corners_px, whiten, noise_px, blur_px=blur_px, whole=True)


def _whitening(covariance: Array) -> Array:
    """(w,w) what turns deviations into standard deviations; 0 in directions that a view does not have."""
    variance, axes = np.linalg.eigh(covariance)
    weight = np.where(variance > 1e-9 * variance[-1], 1.0 / np.sqrt(np.maximum(variance, 1e-12)), 0.0)
    return np.asarray(weight[:, None] * axes.T)
