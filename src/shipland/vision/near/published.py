"""The near chain as published [Lee2022, §Classical Computer Vision Based Approach].

It differs from ours in four steps: one threshold holds for the whole picture, the watershed runs on every region,
Förstner's operator refines the corners, and opposite sides are screened raw. `--vision published` flies it. Where it
starts from a region's hull and screens after the pose, `quads = "bounding"` and `screen = "printed"` of `[vision]`
start from the bounding rectangle and screen before the pose, as printed: `examples/near_vision_printed.toml`.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.cue import Cue, Hue
from shipland.frames import Array
from shipland.vision.near.edge_pixels import Sides, contrast_direction, distort
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.gates import Refusal
from shipland.vision.near.pipeline import NearVision, Steps
from shipland.vision.near.pose import PoseCandidate
from shipland.vision.near.segment import (
    Image,
    Region,
    Window,
    opened_and_closed,
    outlines,
    quad_of_hull,
    region_of,
)
from shipland.vision.parameters import VisionParameters

_LENGTH_TOLERANCE = 0.10
"""Largest relative difference of opposite sides' lengths [Lee2022, §Detected Points Screening]."""

_SLOPE_TOLERANCE = 0.05
"""Largest difference of opposite sides' slopes [Lee2022, §Detected Points Screening]."""

_SCREENING_PX = 0.8
"""Least of both tolerances in pixels, for sides so short that the fractions are below the corners' errors; chosen."""

_SIDE_NOISE = 4.0
"""Standard deviations of a corner that the ends of a side may be off in addition."""

_BAND_ROWS = 128
"""Rows of a band of `coloured_window`; even."""

_NEXT = np.array([1, 2, 3, 0])


def gate(image: Image, parameters: VisionParameters) -> Image:
    """The colour gate [Lee2022, §Image Filtering]: (H,W) 0 or 255."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    bands = (parameters.hue, parameters.saturation, parameters.value)
    low, high = np.array([band[0] for band in bands]), np.array([band[1] for band in bands])
    return np.asarray(cv2.inRange(hsv, low, high), np.uint8)


def colour_mask(image: Image, parameters: VisionParameters) -> Image:
    """The gate, then opening, then closing [Lee2022, §Image Filtering]: (H,W) 0 or 255."""
    return opened_and_closed(gate(image, parameters), parameters.kernel_px)


def coloured_window(image: Image, parameters: VisionParameters) -> Window:
    """The part of a picture that holds all its coloured regions; empty when there are none.

    Every second pixel of every second row is enough: opening removes whatever has none of them. The picture is taken in
    bands, which stay in the processor's cache.
    """
    height, width = image.shape[:2]
    if width < 64 or height < 64:
        return Window.whole(image)
    boxes = []
    for top in range(0, height & ~1, _BAND_ROWS):
        band = image[top : min(top + _BAND_ROWS, height & ~1), : width & ~1]
        few = cv2.resize(band, (width // 2, len(band) // 2), interpolation=cv2.INTER_NEAREST)
        column, row, across, down = cv2.boundingRect(gate(np.asarray(few, np.uint8), parameters))
        if across:
            boxes.append((2 * column, top + 2 * row, 2 * (column + across), top + 2 * (row + down)))
    if not boxes:
        return Window(0, 0, 0, 0)
    lefts, tops, rights, bottoms = zip(*boxes, strict=True)
    margin = parameters.kernel_px + 2
    return Window(
        max(min(lefts) - margin, 0),
        max(min(tops) - margin, 0),
        min(max(rights) + margin, width),
        min(max(bottoms) + margin, height),
    )


def find_regions(image: Image, window: Window, parameters: VisionParameters, *_: Hue | int) -> list[Region]:
    """The largest coloured regions in a part of the picture, largest first; too small ones are left out."""
    if window == Window.whole(image):
        window = coloured_window(image, parameters)
    if window.empty:
        return []
    mask = colour_mask(window.of(image), parameters)
    contours = outlines(mask, (window.left, window.top), parameters)
    regions = (region_of(contour, image, parameters) for contour in contours)
    return [region for region in regions if region is not None]


def watershed_region(image: Image, region: Region, margin: float) -> Region | None:
    """The region with the boundary that the watershed finds [Lee2022, §Image Filtering].

    The region eroded and the background outside of the region dilated, both by `margin` of the region's longer
    side and at least one pixel, flood toward each other over the picture. None when nothing is left of it.
    """
    _, _, width, height = cv2.boundingRect(region.contour_px)
    reach = max(1, round(margin * max(width, height)))
    window = Window.around(region.contour_px.astype(float), reach + 2.0, image.shape[1], image.shape[0])
    offset = (-window.left, -window.top)
    filled = np.zeros((window.bottom - window.top, window.right - window.left), np.uint8)
    cv2.drawContours(filled, [region.contour_px.reshape(-1, 1, 2)], -1, 255, cv2.FILLED, offset=offset)
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    markers = np.zeros(filled.shape, np.int32)
    markers[cv2.dilate(filled, kernel) == 0] = 1
    markers[cv2.erode(filled, kernel) > 0] = 2
    cv2.watershed(np.ascontiguousarray(window.of(image)), markers)
    inside = np.asarray(markers == 2, np.uint8)
    contours, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE, offset=(window.left, window.top))
    if not contours:
        return None
    contour = max(contours, key=cv2.contourArea)
    return Region(np.asarray(contour[:, 0], np.int32), float(cv2.contourArea(contour)), region.cut)


def flooded_quad(image: Image, region: Region, parameters: VisionParameters) -> Array | None:
    """Four corners (4,2) [px] of a region with the boundary that the watershed finds; None when it has no four."""
    flooded = watershed_region(image, region, parameters.watershed_margin)
    return None if flooded is None else quad_of_hull(flooded, parameters.min_side_px)[0]


def bounding_quads(image: Image, regions: list[Region], parameters: VisionParameters, corners: int = 4) -> list[Array]:
    """The upright bounding rectangles (4,2) [px], clockwise, of flooded regions.

    [Lee2022, §Contour and Corner Detection]
    """
    quads = []
    for region in regions if corners == 4 else []:
        flooded = watershed_region(image, region, parameters.watershed_margin)
        if flooded is None:
            continue
        left, top, width, height = cv2.boundingRect(flooded.contour_px)
        if min(width, height) >= parameters.min_side_px:
            right, bottom = left + width - 1, top + height - 1
            quads.append(np.array([[left, top], [right, top], [right, bottom], [left, bottom]], dtype=float))
    return quads


def find_quads(image: Image, regions: list[Region], parameters: VisionParameters, corners: int = 4) -> list[Array]:
    """The quadrilaterals among whole regions, each with the watershed's boundary [Lee2022, §Image Filtering]."""
    quads = (flooded_quad(image, region, parameters) for region in regions if corners == 4)
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


def sides_agree(candidate: PoseCandidate) -> bool:
    """Whether opposite sides agree within ±10 % in length and ±5 % in slope [Lee2022, §Detected Points Screening].

    The slope of a side is taken against the opposite side's direction, so that steep sides have one too. Corners of a
    small rectangle are too uncertain for fractions: a few pixels are always allowed.
    """
    ratio, shorter_px = opposite_sides(np.ascontiguousarray(candidate.freed_px))
    unsure = (_SCREENING_PX + _SIDE_NOISE * candidate.measured.noise_px) / np.minimum(shorter_px, 1e6)
    length = np.abs(ratio)
    tolerance = 1.0 + np.maximum(_LENGTH_TOLERANCE, unsure)
    steepest = np.maximum(_SLOPE_TOLERANCE, unsure)
    agree = (length <= tolerance) & (length * tolerance >= 1.0)
    agree &= np.abs(ratio.imag) <= steepest * np.maximum(ratio.real, 1e-9)
    return bool(agree.all())


def screened_as_printed(quads_px: Array) -> Refusal | None:
    """`SCREENED` when opposite sides (…,4,2) [px] differ by more than the printed tolerances, however short they are.

    ±10 % in length, ±5 % in slope [Lee2022, §Detected Points Screening].
    """
    ratio, _ = opposite_sides(np.ascontiguousarray(quads_px, dtype=float))
    length = np.abs(ratio)
    agree = (length <= 1.0 + _LENGTH_TOLERANCE) & (length * (1.0 + _LENGTH_TOLERANCE) >= 1.0)
    agree &= np.abs(ratio.imag) <= _SLOPE_TOLERANCE * np.maximum(ratio.real, 1e-9)
    return None if agree.all() else Refusal.SCREENED


def opposite_sides(quads_px: Array) -> tuple[npt.NDArray[np.complex128], Array]:
    """(…,2) ratio of opposite sides, top to bottom and right to left, as complex numbers; (…,2) the shorter's length.

    The magnitude is the ratio of the lengths, the angle's tangent the difference of the slopes.
    """
    corners = quads_px.view(np.complex128)[..., 0]
    sides = corners[..., _NEXT] - corners
    lengths = np.abs(sides)
    with np.errstate(divide="ignore", invalid="ignore"):
        return sides[..., :2] / -sides[..., 2:], np.minimum(lengths[..., :2], lengths[..., 2:])


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


def published_steps(parameters: VisionParameters) -> Steps:
    """Of the published chain."""
    quads_of = bounding_quads if parameters.quads == "bounding" else find_quads
    if parameters.screen == "printed":
        return Steps(find_regions, quads_of, measure_corners, screen_corners=screened_as_printed, parts=False)
    return Steps(find_regions, quads_of, measure_corners, sides_agree)


def published_vision(cue: Cue, camera: Camera, parameters: VisionParameters) -> NearVision:
    """Near vision by the published chain."""
    return NearVision(cue, camera, parameters, published_steps(parameters))
