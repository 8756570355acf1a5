"""What a camera makes of rendered light: blur, glare, exposure, colour cast, vignetting, tone, noise, sharpening."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from shipland.config import key, parameters, require
from shipland.sim.scene.tone import Light16, develop, encoded, sharpen
from shipland.sim.scene_parameters import Tone
from shipland.vision.pictures import Picture

Span = tuple[float, float]


def require_spans(of: object) -> None:
    """ValueError where a pair of numbers that are drawn between has the larger one first."""
    for name, value in vars(of).items():
        require(not isinstance(value, tuple) or value[0] <= value[1], f"{name} must be two numbers, the smaller first")


@parameters
class ImageSensorParameters:
    """Ranges that are drawn from (`[synth.sensor]`)."""

    defocus_max_px: float = key(0.9, "standard deviation of a Gaussian blur", ge=0)
    motion: float = key(0.2, "chance of motion blur", ge=0, le=1)
    motion_max_px: float = key(5.0, "its largest length")
    glare: float = key(0.2, "chance of veiling glare", ge=0, le=1)
    glare_max: float = key(0.25, "its most light, in units of the sensor's saturation", ge=0)
    exposure_ev: float = key(0.35, "half-width of a uniform change of exposure, in powers of two", ge=0)
    cast: float = key(0.06, "half-width of a uniform factor on each colour", ge=0, lt=1)
    gamma: Span = key((1.8, 2.6), "range, see `Tone`", "cameras' curves differ by more than their makers say")
    contrast: Span = key((0.0, 0.6), "range, see `Tone`")
    shoulder: Span = key((0.0, 0.5), "range, see `Tone`")
    sharpened: float = key(0.6, "chance of sharpening", ge=0, le=1)
    sharpening_max: float = key(1.2, "its largest strength, of an unsharp mask", ge=0)
    noise_max: float = key(5.0, "grey levels, standard deviation; the least is 0.5", ge=0.5)
    vignette_max: float = key(0.25, "loss of light in the corners", ge=0, le=1)
    quality_min: int = key(35, "of JPEG compression", "a video link of a few Mbit/s", ge=1)
    quality_max: int = key(95, "of JPEG compression", le=100)

    def __post_init__(self) -> None:
        require(self.quality_min <= self.quality_max, "quality_min must be at most quality_max")
        require_spans(self)
        for end in (0, 1):
            Tone(self.gamma[end], self.contrast[end], self.shoulder[end], self.sharpening_max)  # checks them


def degrade(
    light: Light16, parameters: ImageSensorParameters, rng: np.random.Generator, grain: np.random.Generator
) -> Picture:
    """The picture (h,w,3) BGR that a camera makes of the light on it, before compression.

    Defocus, motion, veiling glare and vignetting act on light; tone curve, grain and sharpening follow in this order.
    `rng` draws what stays over a scene's frames: blur, exposure, glare, tone; `grain` the noise.
    """
    height, width = light.shape[:2]
    sigma = rng.uniform(0.0, parameters.defocus_max_px)
    moves, length = rng.random() < parameters.motion, rng.uniform(1.5, max(1.5, parameters.motion_max_px))
    angle = rng.uniform(0, np.pi)
    veils, veil = rng.random() < parameters.glare, rng.uniform(0.0, parameters.glare_max)
    source = rng.uniform(-0.3, 1.3, 2) * [width, height]
    reach = rng.uniform(0.3, 1.2) * width
    gain = 2.0 ** rng.uniform(-parameters.exposure_ev, parameters.exposure_ev)
    cast = 1.0 + rng.uniform(-parameters.cast, parameters.cast, 3)
    noise, vignette = rng.uniform(0.5, parameters.noise_max), rng.uniform(0.0, parameters.vignette_max)
    sharpens, sharpening = rng.random() < parameters.sharpened, rng.uniform(0.0, parameters.sharpening_max)
    tone = Tone(
        gamma=float(rng.uniform(*parameters.gamma)),
        contrast=float(rng.uniform(*parameters.contrast)),
        shoulder=float(rng.uniform(*parameters.shoulder)),
        sharpening=float(sharpening) if sharpens else 0.0,
    )

    if sigma > 0.25:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), sigma), np.uint16)
    if moves:
        light = np.asarray(cv2.filter2D(light, -1, motion_kernel(float(length), float(angle))), np.uint16)
    values = light.astype(np.float32)
    values *= (gain * cast).astype(np.float32)
    if veils or vignette > 0.02:
        rows, columns = np.mgrid[0:height:8, 0:width:8].astype(np.float32)
        far = ((columns - width / 2) ** 2 + (rows - height / 2) ** 2) / (0.25 * (width**2 + height**2))
        cv2.multiply(values, _spread(1.0 - vignette * far, width, height), values)
        if veils:
            spot = veil * np.exp(-((columns - source[0]) ** 2 + (rows - source[1]) ** 2) / reach**2)
            cv2.add(values, _spread(encoded(spot), width, height), values)
    seen = develop(np.clip(values + np.float32(0.5), 0.0, 65535.0).astype(np.uint16), tone)
    grained = cv2.add(seen, _grain(seen.shape, float(noise), grain), dtype=cv2.CV_8U)
    return sharpen(np.asarray(grained, np.uint8), tone.sharpening)


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
