"""Sun, sky and exposure: colours as linear RGB radiance, one unit the radiance of white paint in full sun."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.frames import Array
from shipland.sim.scene_parameters import SceneParameters

KOSCHMIEDER_CONTRAST = 0.05
"""What is left of a black object's contrast at the visibility: 5 %, WMO's meteorological optical range."""


_REFERENCE_BRIGHTNESS, _REFERENCE_EXPOSURE = 0.84, 1.25
"""Clear day, sun at 38°: what the exposure is set by."""
_DUSK_DEG, _NIGHT_DEG, _NIGHT = -8.0, -18.0, 3e-4
"""The sky's light falls to this share from the end of dusk to a night without a moon, which a camera sees as black."""
_DARKEST = 3.3e-3
"""Brightness below which the camera amplifies no further, after six stops at the default `auto_exposure`."""


@dataclass(frozen=True)
class Light:
    """The light of one scene, fixed over a flight.

    Attributes:
        sun_in_ned: (3,) unit vector towards the sun.
        sun_rgb: (3,) irradiance over pi on a plane that faces the sun.
        zenith_rgb, horizon_rgb, glow_rgb: (3,) radiance of the sky straight up, at the horizon, and what the sun's
            surroundings add.
        water_rgb: (3,) radiance out of the water.
        exposure: light in units of the sensor's saturation, of a unit of radiance.
        extinction_per_m: of the air.
        cloud_cover: 0 … 1.
        glare: strength of the sun's glitter on the sea; 1 is the physical one.
    """

    sun_in_ned: Array
    sun_rgb: Array
    zenith_rgb: Array
    horizon_rgb: Array
    glow_rgb: Array
    water_rgb: Array
    exposure: float
    extinction_per_m: float
    cloud_cover: float
    glare: float

    @property
    def gain(self) -> float:
        """Noise against a daylight picture's: shot noise grows with the root of the amplification."""
        return float(np.sqrt(max(self.exposure / _REFERENCE_EXPOSURE, 0.25)))

    @property
    def dimming(self) -> float:
        """What the bar's panel is dimmed to in less than daylight, so that it does not blind."""
        return min(1.0, _REFERENCE_EXPOSURE / self.exposure) if self.exposure > 0.0 else 1.0


def _smooth(low: float, high: float, value: float) -> float:
    share = float(np.clip((value - low) / (high - low), 0.0, 1.0))
    return share * share * (3.0 - 2.0 * share)


def rain_extinction_per_m(rain_mm_h: float) -> float:
    """Extinction of visible light by rain: 1.076 R^0.67 dB/km [ITU-R P.1814]."""
    return float(0.248e-3 * rain_mm_h**0.67)


def light(parameters: SceneParameters) -> Light:
    """The light for a sun position and weather.

    The beam is dimmed by the air's optical depth per colour (Rayleigh and haze) over Kasten & Young's (1989) air mass;
    the sky's colours are blended from day, low sun and dusk by elevation.
    """
    cloud_cover = parameters.cloud_cover
    extinction = -float(np.log(KOSCHMIEDER_CONTRAST)) / parameters.visibility_m
    extinction += rain_extinction_per_m(parameters.rain_mm_h)
    visibility_m = -float(np.log(KOSCHMIEDER_CONTRAST)) / extinction
    azimuth, elevation = np.radians(parameters.sun_azimuth_deg), np.radians(parameters.sun_elevation_deg)
    degrees = float(np.degrees(elevation))
    sun = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
    above = max(degrees, 0.0)
    air_mass = 1.0 / (np.sin(np.radians(above)) + 0.50572 * (above + 6.07995) ** -1.6364)
    fog = _smooth(3000.0, 300.0, visibility_m) if visibility_m < 3000.0 else 0.0
    overcast = max(_smooth(0.55, 1.0, cloud_cover), fog)
    beam = 1.25 * np.exp(-np.array([0.075, 0.125, 0.235]) * air_mass) * _smooth(-1.5, 1.5, degrees)

    day, low = _smooth(4.0, 30.0, degrees), _smooth(-9.0, 10.0, degrees)
    level = 0.035 + 0.965 * _smooth(-8.0, 22.0, degrees) ** 1.4
    if degrees < _DUSK_DEG:
        level *= _NIGHT ** min((_DUSK_DEG - degrees) / (_DUSK_DEG - _NIGHT_DEG), 1.0)
    zenith = day * np.array([0.042, 0.095, 0.215]) + (1.0 - day) * np.array([0.07, 0.11, 0.22])
    horizon = day * np.array([0.25, 0.33, 0.42]) + (1.0 - day) * (
        low * np.array([0.36, 0.32, 0.31]) + (1.0 - low) * np.array([0.21, 0.21, 0.28])
    )
    glow = day * np.array([0.32, 0.30, 0.26]) + (1.0 - day) * np.array([0.90, 0.40, 0.12])
    grey = np.array([0.23, 0.245, 0.26]) * (0.55 + 0.45 * day)
    zenith, horizon = (1 - overcast) * zenith + overcast * 0.85 * grey, (1 - overcast) * horizon + overcast * grey
    glow, beam = glow * (1.0 - 0.9 * overcast), beam * (1.0 - 0.93 * overcast)
    zenith, horizon, glow = level * zenith, level * horizon, level * glow
    downwelling = beam * max(float(np.sin(elevation)), 0.0) + 0.5 * (zenith + horizon)
    water = np.array([0.010, 0.045, 0.062]) * downwelling
    brightness = float(np.dot([0.25, 0.65, 0.10], downwelling))
    amplified = (_REFERENCE_BRIGHTNESS / max(brightness, _DARKEST)) ** parameters.auto_exposure
    exposure = _REFERENCE_EXPOSURE * amplified * 2.0**parameters.exposure_ev
    return Light(
        sun,
        beam,
        zenith,
        horizon,
        glow,
        water,
        exposure,
        extinction,
        cloud_cover,
        parameters.glare,
    )
