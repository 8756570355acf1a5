"""Sub-pixel corners: lines fitted to the sides and intersected, or Förstner's operator."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array
from shipland.vision.near.bar import Image, Window
from shipland.vision.near.edge_fit import EdgeFloor, measure_sides
from shipland.vision.near.edge_pixels import contrast_direction
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.quads import edge_distances, reaches_edge
from shipland.vision.near.sides import Sides, distort, intersect_sides


@dataclass(frozen=True)
class Measured:
    """Corners at sub-pixel.

    Attributes:
        corners_px: (n,4,2) undistorted.
        whiten: (n,8,8) [1/px] what turns deviations of a quadrilateral's (column, row) × four corners into standard
            deviations.
        noise_px: standard deviation of a corner on either axis, about.
        common_px: (n,4,2) how the corners move when all sides err outward together, by one standard deviation; None
            when the method has no sides.
        blur_px: standard deviation of the picture's blur; None when the method does not measure it.
        held: a side lies along the picture's edge.
    """

    corners_px: Array
    whiten: Array
    noise_px: float
    common_px: Array | None = None
    blur_px: float | None = None
    held: bool = False


def measure_corners(
    image: Image, quads_px: Array, camera: Camera, parameters: VisionParameters, blur_px: float | None = None
) -> Measured | None:
    """Sub-pixel corners by the method of `parameters.corners`; None when one cannot be measured.

    Args:
        image: (H,W,3) BGR.
        quads_px: (n,4,2) corners to within two pixels, clockwise, undistorted.
        camera: its distortion is taken out.
        parameters: method and its sizes.
        blur_px: a guess of the picture's blur, as the last one's.
    """
    if parameters.corners == "forstner":
        return forstner_corners(image, quads_px, camera, parameters)
    return edge_corners(image, quads_px, camera, parameters, blur_px)


def forstner_corners(image: Image, quads_px: Array, camera: Camera, parameters: VisionParameters) -> Measured | None:
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
    return Measured(corners, np.broadcast_to(np.eye(8) / noise_px, (len(quads_px), 8, 8)), noise_px)


def edge_corners(
    image: Image, quads_px: Array, camera: Camera, parameters: VisionParameters, blur_px: float | None = None
) -> Measured | None:
    """Corners where the lines fitted to the sides meet, weighted by what is known of the lines.

    Lines are fitted in undistorted pixels, where sides are straight.
    """
    held = _held(image, quads_px, camera)
    sides = Sides.of(quads_px, parameters.edge_reach_px, held)
    floor = EdgeFloor(parameters.edge_floor_px, parameters.edge_clipped_px)
    fit = measure_sides(image, sides, camera, floor, blur_px)
    met = None if fit is None else intersect_sides(fit)
    if fit is None or met is None:
        return None
    common_px = parameters.edge_bias_px * met.growth
    return Measured(met.corners_px, met.whiten, met.noise_px, common_px, fit.blur_px, held is not None)


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


def _held(image: Image, quads_px: Array, camera: Camera) -> npt.NDArray[np.bool_] | None:
    """(4n,) sides that lie on the picture's edge, where `find_quads` has set them; None when none does."""
    raw_px = distort(quads_px.reshape(-1, 2), camera).reshape(-1, 4, 2)
    if not reaches_edge(raw_px, image.shape[1], image.shape[0]):
        return None
    on = edge_distances(raw_px, image.shape[1], image.shape[0]) < 0.5
    held = (on & on[:, [1, 2, 3, 0]]).any(axis=-1).reshape(-1)
    return held if held.any() else None
