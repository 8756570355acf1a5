"""What the picture looks like: section `[scene]` of the configuration. Flights that draw nothing import this alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.config import require
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


@dataclass(frozen=True)
class SceneParameters:
    """What the picture looks like (`[scene]` in TOML); a strength of zero costs nothing.

    Attributes:
        sun_azimuth_deg, sun_elevation_deg: towards the sun, clockwise from north and above the horizon.
        visibility_m: distance at which 5 % of contrast is left (meteorological optical range).
        rain_mm_h: rainfall: streaks, and its own loss of contrast.
        cloud_cover: 0 … 1.
        significant_wave_height_m: of the sea that is drawn; the rig does not move with it.
        wave_direction_deg: towards which the waves run, clockwise from north.
        wind_speed_mps: sets the small waves' slope and the whitecaps.
        exposure_ev: brighter by a power of two.
        gamma, contrast, shoulder, sharpening: of the camera's rendering to display values, see `Tone`.
        auto_exposure: 0 (fixed) … 1 (the camera makes up for the light).
        glare: the sun's veil and ghosts in the lens, and its glitter on the sea; 1 is the physical glitter.
        shutter_s: exposure time, for motion blur.
        sensor_noise: standard deviation of a display value 0 … 255 in daylight; grows as light is amplified.
        spray: of waves along the hull, 0 … 1.
        lens_drops: water on the lens, 0 … 1; 1 is some forty drops.
        wake: bow wave and wake of a ship under way, 0 … 1; the water around the rig's platform has neither.
        lamp: luminous green of the bar, in radiance of sunlit white; dimmed as the light goes.
    """

    sun_azimuth_deg: float
    sun_elevation_deg: float
    visibility_m: float
    rain_mm_h: float
    cloud_cover: float
    significant_wave_height_m: float
    wave_direction_deg: float
    wind_speed_mps: float
    exposure_ev: float
    auto_exposure: float
    gamma: float
    contrast: float
    shoulder: float
    sharpening: float
    glare: float
    shutter_s: float
    sensor_noise: float
    spray: float
    lens_drops: float
    lamp: float
    wake: float = 0.0

    @property
    def tone(self) -> Tone:
        """The camera's rendering."""
        return Tone(self.gamma, self.contrast, self.shoulder, self.sharpening)

    def __post_init__(self) -> None:
        _ = self.tone  # checks its numbers
        require(-12.0 <= self.sun_elevation_deg <= 90.0, "sun_elevation_deg must be between -12 and 90")
        require(self.visibility_m >= 5.0, "visibility_m must be at least 5")
        for name in ("cloud_cover", "auto_exposure", "spray", "lens_drops", "wake"):
            require(0.0 <= getattr(self, name) <= 1.0, f"{name} must be between 0 and 1")
        strengths = ("rain_mm_h", "significant_wave_height_m", "wind_speed_mps", "glare", "sensor_noise", "lamp")
        for name in (*strengths, "shutter_s"):
            require(getattr(self, name) >= 0.0, f"{name} must not be negative")
