"""Training windows from labelled pictures: crop at native size, scale, mirror, mosaic, colour, blur, noise."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from shipland.learning.dataset import IGNORED, Targets
from shipland.learning.settings import AugmentParameters
from shipland.vision.pictures import Picture

Loader = Callable[[np.random.Generator], tuple[Picture, Targets]]
"""Draws a labelled picture."""
HARD_JITTER = 0.35
"""How far from a window's middle a hard place may lie, in sides."""


def training_window(
    draw: Loader,
    side_px: int,
    parameters: AugmentParameters,
    rng: np.random.Generator,
    hard: tuple[Picture, Targets, tuple[float, float]] | None = None,
) -> tuple[Picture, Targets]:
    """One window (side_px, side_px, 3) and its targets [px].

    `hard` is a picture, its targets and a place (column, row) [px] that the window is laid over; else one is drawn.
    """
    if hard is not None:
        picture, targets = window(*hard[:2], (side_px, side_px), parameters, rng, hard[2])
    elif rng.random() < parameters.mosaic:
        picture, targets = _mosaic(draw, side_px, parameters, rng)
    else:
        picture, targets = window(*draw(rng), (side_px, side_px), parameters, rng)
    if rng.random() < parameters.mirror:
        picture = picture[:, ::-1]
        targets[:, 1] = side_px - targets[:, 1]
    return colour(np.ascontiguousarray(picture), parameters, rng), targets


def window(
    picture: Picture,
    targets: Targets,
    size_px: tuple[int, int],
    parameters: AugmentParameters,
    rng: np.random.Generator,
    over_px: tuple[float, float] | None = None,
) -> tuple[Picture, Targets]:
    """A window of `size_px` (width, height) out of a picture, zoomed, and the targets in it.

    It lies over the place `over_px` of the picture, over a target, or anywhere.
    """
    height, width = picture.shape[:2]
    scale = float(np.exp(rng.uniform(np.log(parameters.scale_min), np.log(parameters.scale_max))))
    if parameters.fit:
        scale *= min(size_px[0] / width, size_px[1] / height)
    size = np.array(size_px, dtype=float)
    room = scale * np.array([width, height]) - size
    wanted = targets[targets[:, 0] >= 0.0]
    if over_px is not None:
        corner = scale * np.array(over_px) - size * rng.uniform(0.5 - HARD_JITTER, 0.5 + HARD_JITTER, 2)
    elif len(wanted) and rng.random() < parameters.on_target:
        _, x, y, w, h = wanted[rng.integers(len(wanted))]
        margin = 0.5 * scale * np.array([w, h])
        low, high = np.minimum(margin, 0.5 * size), np.maximum(size - margin, 0.5 * size)
        corner = scale * np.array([x, y]) - rng.uniform(low, high)
    else:
        corner = rng.uniform(np.minimum(room, 0.0), np.maximum(room, 0.0))
    # Stay inside where the picture is large enough; else let it lie anywhere in the window.
    corner = np.clip(corner, np.minimum(room, 0.0), np.maximum(room, 0.0))
    if scale == 1.0:
        corner = np.round(corner)
    moved = targets.copy()
    moved[:, 1:3] = scale * targets[:, 1:3] - corner
    moved[:, 3:5] = scale * targets[:, 3:5]
    # Pixel edges sit at whole numbers in `targets`, pixel centres in the affine map.
    shift = 0.5 * scale - 0.5 - corner
    matrix = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
    cut = cv2.warpAffine(picture, matrix, size_px, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cut, dtype=np.uint8), clip_targets(moved, size_px, parameters)


def clip_targets(targets: Targets, size_px: tuple[int, int], parameters: AugmentParameters) -> Targets:
    """Targets cut to a window; those too small or too little inside become IGNORED, those outside go."""
    if not len(targets):
        return targets
    size = np.array(size_px, np.float32)
    low = np.clip(targets[:, 1:3] - 0.5 * targets[:, 3:5], 0.0, size)
    high = np.clip(targets[:, 1:3] + 0.5 * targets[:, 3:5], 0.0, size)
    visible = np.prod(high - low, axis=1) / np.maximum(np.prod(targets[:, 3:5], axis=1), 1e-9)
    kinds = targets[:, 0].copy()
    hopeless = (visible < parameters.min_visible) | (targets[:, 3:5].max(axis=1) < parameters.min_side_px)
    kinds[hopeless] = IGNORED
    clipped = np.column_stack([kinds, 0.5 * (low + high), high - low]).astype(np.float32)
    return np.asarray(clipped[visible > 0.0], dtype=np.float32)


def _mosaic(
    draw: Loader, side_px: int, parameters: AugmentParameters, rng: np.random.Generator
) -> tuple[Picture, Targets]:
    """Four windows around a random point."""
    column, row = (int(value) for value in rng.uniform(0.3, 0.7, 2) * side_px)
    picture = np.empty((side_px, side_px, 3), np.uint8)
    parts = []
    for left, right in ((0, column), (column, side_px)):
        for top, bottom in ((0, row), (row, side_px)):
            part, targets = window(*draw(rng), (right - left, bottom - top), parameters, rng)
            picture[top:bottom, left:right] = part
            targets[:, 1:3] += (left, top)
            parts.append(targets)
    return picture, np.concatenate(parts)


def colour(picture: Picture, parameters: AugmentParameters, rng: np.random.Generator) -> Picture:
    """The same picture through another lens, light and sensor."""
    levels = np.arange(256) / 255.0
    gamma = 1.0 + rng.uniform(-parameters.gamma, parameters.gamma)
    gain = 1.0 + rng.uniform(-parameters.contrast, parameters.contrast)
    offset = rng.uniform(-parameters.brightness, parameters.brightness)
    curve = np.clip((levels**gamma - 0.5) * gain + 0.5 + offset / 255.0, 0.0, 1.0)
    bend = rng.uniform(-parameters.tone, parameters.tone)
    curve = 255.0 * (curve + 2.0 * bend * (2.0 * curve - 1.0) * curve * (1.0 - curve))
    picture = cv2.LUT(picture, np.clip(curve, 0, 255).astype(np.uint8)).astype(np.uint8)
    turn, stretch = rng.uniform(-1.0, 1.0, 2)
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    hue = np.round(np.arange(256) + 0.5 * turn * parameters.hue_deg) % 180
    saturation = np.clip(np.arange(256) * (1.0 + stretch * parameters.saturation), 0, 255)
    table = np.stack([hue, saturation, np.arange(256)], axis=1).astype(np.uint8)[None]
    picture = cv2.cvtColor(cv2.LUT(hsv, table), cv2.COLOR_HSV2BGR).astype(np.uint8)
    if rng.random() < parameters.blur:
        picture = cv2.GaussianBlur(picture, (0, 0), max(0.2, rng.uniform(0.0, parameters.blur_max_px))).astype(np.uint8)
    elif rng.random() < parameters.sharpen:
        near = cv2.GaussianBlur(picture, (0, 0), max(0.2, rng.uniform(0.0, parameters.blur_max_px)))
        strength = rng.uniform(0.0, parameters.sharpen_max)
        picture = np.asarray(cv2.addWeighted(picture, 1.0 + strength, near, -strength, 0.0), np.uint8)
    if rng.random() < parameters.noise:
        grain = rng.standard_normal(picture.shape, dtype=np.float32) * rng.uniform(0.0, parameters.noise_max)
        picture = np.clip(picture + grain, 0, 255).astype(np.uint8)
    return picture
