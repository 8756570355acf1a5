"""From light to display values: saturation, tone curve, sharpening. Everything before this averages light, linearly.

A picture of light is uint16: `FULL_SCALE` times the light that saturates the sensor is 65535, so that highlights keep
their energy through defocus, motion blur and supersampling, and are clipped only here.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from shipland.frames import Array
from shipland.sim.scene_parameters import Tone

FULL_SCALE = 8.0
"""Full scale of a uint16 picture of light, in units of the sensor's saturation; a step is 0.03 of a grey level."""

Light16 = npt.NDArray[np.uint16]
Image = npt.NDArray[np.uint8]


@lru_cache(maxsize=64)
def _table(tone: Tone) -> Image:
    light: Array = np.linspace(0.0, FULL_SCALE, 65536)
    return np.rint(tone.display(light)).astype(np.uint8)


def develop(light: Light16, tone: Tone) -> Image:
    """Display values (H,W,C) uint8 of a picture of light (H,W,C), before sharpening."""
    return np.asarray(cv2.LUT(light, _table(tone)), np.uint8)


def sharpen(image: Image, amount: float) -> Image:
    """An unsharp mask of one pixel's radius, on display values as cameras do it."""
    if amount <= 0.0:
        return image
    return np.asarray(
        cv2.addWeighted(image, 1.0 + amount, cv2.GaussianBlur(image, (0, 0), 1.0), -amount, 0.0), np.uint8
    )


def encoded(light: Array) -> Array:
    """A picture of light's values, not rounded, of light in units of the sensor's saturation."""
    return np.asarray(np.clip(light * (65535.0 / FULL_SCALE), 0.0, 65535.0))
