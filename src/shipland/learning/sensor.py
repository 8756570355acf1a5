"""What a camera adds to a rendered picture: blur, veiling glare, exposure, colour cast, noise, vignetting."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from shipland.config import require

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class SensorParameters:
    """Ranges that are drawn from (`[synth.sensor]`).

    Attributes:
        defocus_max_px: standard deviation of a Gaussian blur.
        motion: chance of motion blur; motion_max_px its length.
        glare: chance of veiling glare; glare_max its strength, 0 … 1 of white.
        exposure_ev: half-width of a uniform change of exposure, in powers of two.
        cast: half-width of a uniform factor on each colour.
        noise_max: grey levels, standard deviation.
        vignette_max: loss of light in the corners, 0 … 1.
        quality_min, quality_max: of JPEG compression.
    """

    defocus_max_px: float
    motion: float
    motion_max_px: float
    glare: float
    glare_max: float
    exposure_ev: float
    cast: float
    noise_max: float
    vignette_max: float
    quality_min: int
    quality_max: int

    def __post_init__(self) -> None:
        require(0.0 <= self.motion <= 1.0 and 0.0 <= self.glare <= 1.0, "motion and glare are chances, 0 … 1")
        require(1 <= self.quality_min <= self.quality_max <= 100, "qualities must lie in 1 … 100, min ≤ max")


def degrade(
    picture: Picture, parameters: SensorParameters, rng: np.random.Generator, grain: np.random.Generator
) -> Picture:
    """The picture (h,w,3) BGR as a camera would deliver it, before compression.

    Args:
        picture: rendered.
        parameters: ranges.
        rng: of what stays over a scene's frames: blur, exposure, glare.
        grain: of what does not: noise.
    """
    height, width = picture.shape[:2]
    sigma = rng.uniform(0.0, parameters.defocus_max_px) ** 1.0
    moves, length, angle = (
        rng.random() < parameters.motion,
        rng.uniform(1.5, max(1.5, parameters.motion_max_px)),
        rng.uniform(0, np.pi),
    )
    veils, veil = rng.random() < parameters.glare, rng.uniform(0.0, parameters.glare_max)
    source = rng.uniform(-0.3, 1.3, 2) * [width, height]
    reach = rng.uniform(0.3, 1.2) * width
    gain = 2.0 ** rng.uniform(-parameters.exposure_ev, parameters.exposure_ev)
    cast = 1.0 + rng.uniform(-parameters.cast, parameters.cast, 3)
    noise, vignette = rng.uniform(0.5, parameters.noise_max), rng.uniform(0.0, parameters.vignette_max)

    if sigma > 0.25:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma), np.uint8)
    if moves:
        picture = np.asarray(cv2.filter2D(picture, -1, motion_kernel(float(length), float(angle))), np.uint8)
    # Exposure acts on light, not on grey levels; a power of 2.2 stands for the camera's curve.
    curves = [
        255.0 * np.clip((np.arange(256) / 255.0) ** 2.2 * gain * factor, 0.0, 1.0) ** (1.0 / 2.2) for factor in cast
    ]
    values = np.asarray(cv2.LUT(picture, np.stack(curves, axis=1).astype(np.float32)[None]), np.float32)
    if veils or vignette > 0.02:
        rows, columns = np.mgrid[0:height:8, 0:width:8].astype(np.float32)
        far = ((columns - width / 2) ** 2 + (rows - height / 2) ** 2) / (0.25 * (width**2 + height**2))
        kept, added = 1.0 - vignette * far, np.zeros_like(far)
        if veils:
            spot = veil * np.exp(-((columns - source[0]) ** 2 + (rows - source[1]) ** 2) / reach**2)
            kept, added = kept * (1.0 - spot), 255.0 * spot
        cv2.multiply(values, _spread(kept, width, height), values)
        cv2.add(values, _spread(added, width, height), values)
    return np.asarray(cv2.add(values, _grain(values.shape, float(noise), grain), dtype=cv2.CV_8U), np.uint8)


def _spread(coarse: npt.NDArray[np.floating[Any]], width: int, height: int) -> npt.NDArray[np.float32]:
    """A coarse field (h/8,w/8) over a picture's three channels (h,w,3)."""
    three = np.repeat(coarse[..., None], 3, axis=2).astype(np.float32)
    return np.asarray(cv2.resize(three, (width, height)), np.float32)


@lru_cache(maxsize=1)
def _normal_numbers() -> npt.NDArray[np.float32]:
    return np.random.default_rng(0).standard_normal(1 << 21, dtype=np.float32)


def _grain(shape: tuple[int, ...], sigma: float, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """White noise (h,w,3): every row is a stretch of one long table, from a place of its own."""
    height, width, channels = shape
    table = _normal_numbers()
    starts = rng.integers(0, len(table) - width * channels, height)
    rows = np.lib.stride_tricks.sliding_window_view(table, width * channels)[starts]
    return np.asarray(np.float32(sigma) * rows, np.float32).reshape(height, width, channels)


def motion_kernel(length_px: float, angle_rad: float) -> npt.NDArray[np.float32]:
    """A line of this length and direction, antialiased, of sum one."""
    side = 2 * int(np.ceil(length_px / 2)) + 3
    kernel = np.zeros((side, side), np.uint8)
    middle = np.array([side // 2, side // 2])
    half = 0.5 * length_px * np.array([np.cos(angle_rad), np.sin(angle_rad)])
    ends = [tuple(int(value) for value in np.round(256 * (middle + sign * half))) for sign in (-1.0, 1.0)]
    cv2.line(kernel, ends[0], ends[1], 255, 1, cv2.LINE_AA, 8)
    return np.asarray(kernel / kernel.sum(), np.float32)
