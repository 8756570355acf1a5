"""The near chain as published [Lee2022, §Classical Computer Vision Based Approach].

It differs from ours in three steps: the watershed runs on every region, Förstner's operator refines the corners, and
opposite sides are screened raw, as printed. `--vision published` flies it.
"""

from __future__ import annotations

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.rig import Target
from shipland.vision.near.edge_pixels import Sides, contrast_direction, distort
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.pipeline import NearVision, Steps
from shipland.vision.near.segment import Image, Region, Window, flooded_quad
from shipland.vision.near.validate import opposite_sides, ratio_is_within


def find_quads(image: Image, regions: list[Region], parameters: VisionParameters) -> list[Array]:
    """The quadrilaterals among whole regions, each with the watershed's boundary [Lee2022, §Image Filtering]."""
    quads = (flooded_quad(image, region, parameters) for region in regions)
    return [quad for quad in quads if quad is not None]


def measure_corners(
    image: Image, quads_px: Array, camera: Camera, parameters: VisionParameters, _: float | None = None
) -> MeasuredCorners | None:
    """Förstner's corners [Lee2022, §Contour and Corner Detection]; the window's side as in erratum 4."""
    direction = _direction(image, quads_px, camera)
    if direction is None:
        return None
    corners = np.empty(quads_px.shape)
    for index, quad in enumerate(quads_px):
        start_px = distort(quad, camera)
        sides = np.linalg.norm(np.roll(start_px, -1, axis=0) - start_px, axis=1)
        shorter = float(sides.min())
        window_px = min(max(parameters.forstner_fraction * shorter, parameters.forstner_min_px), 0.9 * shorter)
        half = max(1, round(0.5 * (window_px - 1.0)))
        window = Window.around(start_px, 2.0 * half + 4.0, image.shape[1], image.shape[0])
        offset = np.array([window.left, window.top], float)
        grey = cv2.transform(window.of(image).astype(np.float32), direction.astype(np.float32).reshape(1, 3))
        points = (start_px - offset).astype(np.float32).reshape(-1, 1, 2)
        if points.min() < 0.0 or np.any(points[:, 0] > np.array([grey.shape[1] - 1, grey.shape[0] - 1])):
            return None
        until = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 30, 0.002)
        refined = cv2.cornerSubPix(grey, points, (half, half), (-1, -1), until).reshape(-1, 2) + offset
        if np.max(np.abs(refined - start_px)) > max(2.0 * half, 3.0):
            return None
        corners[index] = camera.undistort(refined)
    noise_px = parameters.corner_noise_px
    return MeasuredCorners(corners, np.broadcast_to(np.eye(8) / noise_px, (len(quads_px), 8, 8)), noise_px)


def sides_agree(measured_px: Array, _: Array, noise_px: float, parameters: VisionParameters) -> bool:
    """Whether opposite sides agree within ±10 % in length and ±5 % in slope [Lee2022, §Detected Points Screening].

    The slope of a side is taken against the opposite side's direction, so that steep sides have one too.

    Args:
        measured_px: (k,4,2) corners, clockwise from the first.
        noise_px: standard deviation of a measured corner.
        parameters: tolerances.
    """
    return ratio_is_within(*opposite_sides(np.ascontiguousarray(measured_px)), noise_px, parameters)


def _direction(image: Image, quads_px: Array, camera: Camera) -> Array | None:
    """The colour direction of the contrast, from points well inside and just outside of the quadrilaterals."""
    centres = quads_px.mean(axis=1, keepdims=True)
    sides = Sides.of(quads_px, 3.0)
    inside = (centres[:, :, None] + np.linspace(0.0, 0.6, 4)[:, None] * (quads_px - centres)[:, :, None]).reshape(-1, 2)
    outside = sides.middle_px + 3.0 * sides.outward
    colours = []
    for points_px in (inside, outside):
        columns, rows = np.rint(distort(points_px, camera)).astype(np.intp).T
        columns, rows = np.clip(columns, 0, image.shape[1] - 1), np.clip(rows, 0, image.shape[0] - 1)
        colours.append(image[rows, columns].mean(axis=0))
    return contrast_direction(colours[0], colours[1])


STEPS = Steps(find_quads, measure_corners, sides_agree)
"""Of the published chain."""


def published_vision(cue: Target, camera: Camera, parameters: VisionParameters) -> NearVision:
    """Near vision by the published chain."""
    return NearVision(cue, camera, parameters, STEPS)
