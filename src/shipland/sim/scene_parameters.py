"""What the picture looks like: section `[scene]` of the configuration. Flights that draw nothing import this alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.config import key, parameters, require
from shipland.frames import Array

_TOE = 0.004
"""Light added before the power law, for a finite slope at black, as in Rec. 709 and sRGB."""


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


@parameters
class SceneParameters:
    """What the picture looks like (`[scene]` in TOML); a strength of zero costs nothing."""

    sun_azimuth_deg: float = key(215.0, "towards the sun, clockwise from north", "behind the approach and to its left")
    sun_elevation_deg: float = key(38.0, "of the sun above the horizon; from -18 down it is night", ge=-90, le=90)
    visibility_m: float = key(
        40000.0, "distance at which 5 % of contrast is left (meteorological optical range)", "clear day", ge=5
    )
    rain_mm_h: float = key(0.0, "rainfall: streaks, and its own loss of contrast", ge=0)
    cloud_cover: float = key(0.45, "0 … 1", ge=0, le=1)
    significant_wave_height_m: float = key(
        0.5, "of the sea that is drawn; the rig does not move with it", "sea state 6's at 1/8.33", ge=0
    )
    wave_direction_deg: float = key(60.0, "towards which the waves run, clockwise from north")
    wind_speed_mps: float = key(6.0, "sets the small waves' slope and the whitecaps", ge=0)
    exposure_ev: float = key(0.0, "brighter by a power of two")
    auto_exposure: float = key(0.75, "0 (fixed) … 1 (the camera makes up for the light)", ge=0, le=1)
    gamma: float = key(
        2.2, "of the camera's rendering to display values: `Tone`", "chosen: about sRGB, a plain video camera"
    )
    contrast: float = key(0.25, "see `Tone`", "chosen: a plain video camera")
    shoulder: float = key(0.2, "see `Tone`", "chosen: of the range is compressed: a stop and a half over white")
    sharpening: float = key(0.0, "see `Tone`", "chosen: of an unsharp mask")
    glare: float = key(
        1.0, "of the sun in the lens, and its glitter on the sea", "1: physical glitter [Cox & Munk 1954]", ge=0
    )
    shutter_s: float = key(0.002, "exposure time, for motion blur", "chosen: 1/500 s, a bright day", ge=0)
    sensor_noise: float = key(1.5, "standard deviation of a display value 0 … 255 in daylight", ge=0)
    spray: float = key(0.0, "of waves along the hull, 0 … 1", ge=0, le=1)
    lens_drops: float = key(0.0, "water on the lens, 0 … 1; 1 is some forty drops", ge=0, le=1)
    lamp: float = key(
        1.0, "green of the bar, in radiance of sunlit white", "chosen: 30 kcd/m², a signal panel in full sun", ge=0
    )
    wake: float = key(0.0, "bow wave and wake of a ship under way", "none around the rig's platform", ge=0, le=1)

    @property
    def tone(self) -> Tone:
        """The camera's rendering."""
        return Tone(self.gamma, self.contrast, self.shoulder, self.sharpening)

    def __post_init__(self) -> None:
        _ = self.tone  # checks its numbers
