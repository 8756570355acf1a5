"""From light to display values: saturation, tone curve, sharpening. Everything before this averages light, linearly.

A picture of light is uint16: `FULL_SCALE` times the light that saturates the sensor is 65535, so that highlights keep
their energy through defocus, motion blur and supersampling, and are clipped only here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from shipland.config import require
from shipland.frames import Array

FULL_SCALE = 8.0
"""Of a uint16 picture of light, in units of the light that saturates the sensor; the step is 0.03 of a grey level."""
_TOE = 0.004
"""Light added before the power law, for a finite slope at black, as in Rec. 709 and sRGB."""

Light16 = npt.NDArray[np.uint16]
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Tone:
    """A camera's rendering of light to display values.

    Attributes:
        gamma: of the power law; 2.2 is about sRGB.
        contrast: 0 the power law alone … 1 a full S-curve.
        shoulder: share of the sensor's range, from the top, that is compressed to hold highlights; 0 clips hard.
        sharpening: of an unsharp mask, 0 none.
    """

    gamma: float
    contrast: float
    shoulder: float
    sharpening: float

    def __post_init__(self) -> None:
        require(1.0 <= self.gamma <= 3.0, "gamma must be between 1 and 3")
        require(0.0 <= self.contrast <= 1.0, "contrast must be between 0 and 1")
        require(0.0 <= self.shoulder <= 0.9, "shoulder must be between 0 and 0.9")
        require(0.0 <= self.sharpening <= 3.0, "sharpening must be between 0 and 3")

    def display(self, light: Array) -> Array:
        """Display value 0 … 255, not rounded, of light in units of the sensor's saturation."""
        knee = 1.0 - self.shoulder
        value = np.clip(light, 0.0, 1.0)
        if self.shoulder > 0.0:
            over = np.maximum(light - knee, 0.0) / self.shoulder
            value = np.where(light > knee, knee + self.shoulder * -np.expm1(-over), np.maximum(light, 0.0))
        power = 1.0 / self.gamma
        value = ((value + _TOE) ** power - _TOE**power) / ((1.0 + _TOE) ** power - _TOE**power)
        curved = value * value * (3.0 - 2.0 * value)
        return np.asarray(255.0 * ((1.0 - self.contrast) * value + self.contrast * curved))

    def light(self, display_value: Array) -> Array:
        """Inverse of `display`, up to the sensor's saturation."""
        grid: Array = np.linspace(0.0, 1.0 + 6.0 * self.shoulder, 20001)
        return np.asarray(np.interp(display_value, self.display(grid), grid))


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
