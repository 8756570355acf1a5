"""The fifth stage: the tests that a pose must pass before it is believed, each with its reason."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np

from shipland.compiled import compiled
from shipland.frames import Array, Pose
from shipland.vision.near.gates import Refusal, largest_reprojection_px, within_reach
from shipland.vision.near.hidden import may_be_hidden, seen_error_px
from shipland.vision.near.segment import Region, edge_distances
from shipland.vision.parameters import VisionParameters

if TYPE_CHECKING:
    from shipland.vision.near.edges import MeasuredCorners
    from shipland.vision.near.pose import PoseCandidate, Setup

_MOST_COMMON = 3.0
"""Standard deviations of the corners' common errors; a larger one would excuse rectangles of other dimensions."""

_EDGE_PX = 1.0
"""How far beyond the picture's edge a side that seems to lie on it may be."""

_WHOLE = 0.98
"""Share of a predicted quadrilateral in the picture from which it should have been found whole."""

_COVERED = 0.6
"""Least share of a predicted quadrilateral's visible part, and of a cut region, that the two must have in common."""


Screen = Callable[["PoseCandidate"], bool]
"""A further test of a pose's sides."""


def corners_are_sharp(measured: MeasuredCorners, parameters: VisionParameters) -> bool:
    """Whether blur and noise are small against the cue's shortest side."""
    shortest_px = _shortest_px(measured.corners_px)
    blurred = measured.blur_px is not None and measured.blur_px > parameters.max_blur * shortest_px
    return not (blurred or measured.noise_px > parameters.max_noise * shortest_px)


def validate(candidate: PoseCandidate, screen: Screen) -> Refusal | None:
    """Why a pose is refused; None when it passes reprojection gate, screening and reach."""
    taken, measured = candidate.solutions[0], candidate.measured
    parameters, corners_px = candidate.setup.parameters, candidate.freed_px
    tolerance = candidate.setup.manufacturing_tolerance
    if not seen_error_px(candidate) <= largest_reprojection_px(corners_px, measured.noise_px, tolerance, parameters):
        return Refusal.REPROJECTION
    if taken.common.size and not np.abs(taken.common).max() <= _MOST_COMMON:
        return Refusal.BLOOM
    if measured.held is not None and measured.hidden is None and _beyond_edge(candidate):
        return Refusal.CUT_BY_FRAME
    if not may_be_hidden(candidate):
        return Refusal.REPROJECTION
    if not screen(candidate):
        return Refusal.SIDES_UNEQUAL
    return None if within_reach(taken.camera_from_plane, parameters) else Refusal.OUT_OF_REACH


def explains_absence(setup: Setup, camera_from_plane: Pose, model: Sequence[int], cut: Sequence[Region]) -> bool:
    """Whether the picture's edge explains the quadrilaterals that a pose lacks.

    None of them may be one that should be there whole; and unless at least two quadrilaterals are whole, one that the
    edge cuts must be found where the pose predicts it.

    Args:
        setup: cue and camera.
        camera_from_plane: the pose.
        model: the cue's quadrilaterals that it rests on.
        cut: regions that the picture's edge cuts.
    """
    predicted_px = setup.projected_px(camera_from_plane)
    if not np.isfinite(predicted_px).all():
        return False
    size_px = (setup.camera.width_px, setup.camera.height_px)
    proven = len(model) > 1
    for index, quad_px in enumerate(predicted_px):
        if index in model:
            continue
        visible_px2 = _clipped_area(quad_px, size_px)
        if visible_px2 >= _WHOLE * abs(cv2.contourArea(quad_px.astype(np.float32))):
            return False
        proven |= visible_px2 > 0.0 and any(_same_place(quad_px, region, size_px) for region in cut)
    return proven


def _beyond_edge(candidate: PoseCandidate) -> bool:
    """Whether a corner that was set on the picture's edge lies more than a pixel off it by the pose."""
    camera, residual_px = candidate.setup.camera, candidate.solutions[0].residual_px
    held = edge_distances(candidate.corners_px, camera.width_px, camera.height_px) < 0.5
    off_px = np.abs(residual_px[..., [0, 1, 0, 1]])
    return bool(np.any(held & (off_px > _EDGE_PX)))


@compiled
def _shortest_px(quads_px: Array) -> float:
    """The shortest side of quadrilaterals (n,4,2)."""
    shortest_px, corners = math.inf, quads_px.shape[1]
    for quad in range(len(quads_px)):
        for corner in range(corners):
            side_px = quads_px[quad, (corner + 1) % corners] - quads_px[quad, corner]
            shortest_px = min(shortest_px, math.hypot(side_px[0], side_px[1]))
    return shortest_px


def _picture_corners(size_px: tuple[int, int]) -> Array:
    width, height = size_px
    return np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])


def _clipped_area(quad_px: Array, size_px: tuple[int, int]) -> float:
    """Area [px²] of the part of a convex quadrilateral that lies in the picture."""
    area, _ = cv2.intersectConvexConvex(
        cv2.convexHull(quad_px.astype(np.float32)), _picture_corners(size_px).astype(np.float32)
    )
    return float(area)


def _same_place(quad_px: Array, region: Region, size_px: tuple[int, int]) -> bool:
    """Whether a cut region fills what the picture shows of a predicted quadrilateral, and no more."""
    hull = cv2.convexHull(region.contour_px).astype(np.float32)
    hull_px2 = cv2.contourArea(hull)
    visible_px2 = _clipped_area(quad_px, size_px)
    common_px2, _ = cv2.intersectConvexConvex(cv2.convexHull(quad_px.astype(np.float32)), hull)
    return common_px2 >= _COVERED * visible_px2 and common_px2 >= _COVERED * hull_px2 and hull_px2 > 0.0
