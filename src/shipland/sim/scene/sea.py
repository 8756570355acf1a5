"""Wave tiles for the drawn sea: slopes of a random sea, periodic, with squared slopes for the mipmaps.

The long tile is evolved by the dispersion relation every frame; the short one drifts. Texel: slope north, slope east,
squared slope, crest; the first three in units of a gain, the fourth of the height.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft
from scipy.special import ndtri

from shipland.frames import GRAVITY_MPS2, Array

LONG_SIZE, SHORT_SIZE = 128, 256
_CREST_DEVIATION = 0.149  # of `crest` in waves.glsl
Texels = npt.NDArray[np.uint8]


def cox_munk_variance(wind_speed_mps: float) -> float:
    """Mean squared slope of a clean sea, both directions together [Cox & Munk 1954]."""
    return 0.003 + 0.00512 * wind_speed_mps


def whitecap_cover(wind_speed_mps: float) -> float:
    """Share of the sea under whitecaps [Monahan & O'Muircheartaigh 1980]."""
    return float(3.84e-6 * wind_speed_mps**3.41)


def peak_wavelength_m(significant_height_m: float) -> float:
    """Peak wavelength of a fully grown sea [m]: Tp = 5.0 √Hs (Pierson–Moskowitz), a steepness of 1/39."""
    return float(GRAVITY_MPS2 / (2.0 * np.pi) * 25.0 * significant_height_m)


def _wave_numbers(size: int, tile_m: float) -> tuple[Array, Array, Array]:
    step = 2.0 * np.pi / tile_m
    index = np.fft.fftfreq(size, 1.0 / size)
    north, east = np.meshgrid(step * index, step * index, indexing="xy")
    return north, east, np.hypot(north, east)


def _encode(slopes: npt.NDArray[np.complex64], crest: npt.NDArray[np.float32], gain: float) -> Texels:
    texels = np.empty((*slopes.shape, 4), np.float32)
    texels[..., 0], texels[..., 1] = slopes.real / gain + 0.5, slopes.imag / gain + 0.5
    texels[..., 2] = (slopes.real**2 + slopes.imag**2) / gain**2
    texels[..., 3] = crest
    np.clip(texels, 0.0, 1.0, out=texels)
    texels *= 255.0
    texels += 0.5
    return texels.astype(np.uint8)


class WaveTiles:
    """The two tiles.

    Attributes:
        long_tile_m, short_tile_m: side of a tile [m].
        long_gain, short_gain: slope of a texture unit.
        residual_variance: squared slope that no tile carries.
        short_texels: (256,256,4).
    """

    def __init__(
        self,
        significant_height_m: float,
        wind_speed_mps: float,
        wave_direction_rad: float,
        rng: np.random.Generator,
    ) -> None:
        height_m = max(significant_height_m, 0.02)
        self.wind_speed_mps, self._direction_rad = wind_speed_mps, wave_direction_rad
        peak_m = max(float(peak_wavelength_m(height_m)), 2.0)
        self.long_tile_m = 4.0 * peak_m
        long_variance = self._make_long(height_m, peak_m, wave_direction_rad, rng)
        self.height_deviation_m = 0.25 * height_m
        wanted = max(cox_munk_variance(wind_speed_mps), 0.0035)
        short_variance = max(0.85 * wanted - 2.0 * long_variance, 0.25 * wanted)
        self.long_gain = float(10.0 * np.sqrt(0.5 * long_variance))
        self.short_tile_m = max(0.12 * peak_m, 1.6)
        self.short_gain = float(9.0 * np.sqrt(0.5 * short_variance))
        self.residual_variance = 0.15 * wanted
        self.slope_variance = 2.0 * long_variance + short_variance + self.residual_variance
        self.short_texels = self._make_short(short_variance, wave_direction_rad, rng)

    def _make_long(self, height_m: float, peak_m: float, direction_rad: float, rng: np.random.Generator) -> float:
        """Make the long tile's spectrum; its squared slope."""
        north, east, number = _wave_numbers(LONG_SIZE, self.long_tile_m)
        safe = np.maximum(number, 1e-9)
        peak = 2.0 * np.pi / peak_m
        along = (north * np.cos(direction_rad) + east * np.sin(direction_rad)) / safe
        directional = np.maximum(along, 0.0) ** 2 + 0.04
        # Pierson–Moskowitz over wave number, k^-4 in the plane, cut where the grid ends.
        density = np.where(number > 0.0, safe**-4.0 * np.exp(-1.25 * (peak / safe) ** 2), 0.0) * directional
        density *= np.exp(-((number / (0.8 * number.max() / np.sqrt(2.0))) ** 4))
        amplitude = np.sqrt(density) * np.exp(2j * np.pi * rng.random(number.shape))
        amplitude *= rng.rayleigh(1.0, number.shape)
        heights = np.fft.ifft2(amplitude).real
        # Two turned copies of the tile are laid over each other: each carries half the variance.
        amplitude *= 0.25 * height_m / np.sqrt(2.0) / heights.std()
        self._heights, self._rate_rad_s = (
            amplitude.astype(np.complex64),
            np.sqrt(GRAVITY_MPS2 * number).astype(np.float32),
        )
        self._north, self._east = north.astype(np.float32), east.astype(np.float32)
        return float(np.mean(np.abs(self._slopes(amplitude, north, east)) ** 2))

    @staticmethod
    def _mirror(spectrum: npt.NDArray[np.complexfloating]) -> npt.NDArray[np.complexfloating]:
        return np.roll(spectrum[::-1, ::-1], (1, 1), axis=(0, 1))

    def _slopes(
        self, amplitude: npt.NDArray[np.complexfloating], north: Array, east: Array
    ) -> npt.NDArray[np.complexfloating]:
        """Slopes -grad(height) as one complex field, north + i east."""
        # The real field of `amplitude` has the Hermitian half-sum as spectrum.
        hermitian = 0.5 * (amplitude + np.conj(self._mirror(amplitude)))
        return scipy.fft.ifft2(-1j * (north + 1j * east) * hermitian)

    def long_texels(self, t_s: float) -> Texels:
        """(128,128,4) the long tile at a time [s]; row is east, column is north."""
        turned = self._heights * np.exp(-1j * self._rate_rad_s * t_s)
        hermitian = (0.5 * (turned + np.conj(self._mirror(turned)))).astype(np.complex64)
        slopes = scipy.fft.ifft2((self._east - 1j * self._north) * hermitian)
        height = scipy.fft.ifft2(hermitian).real
        crest = 0.5 + height * np.float32(1.0 / self.height_of_unit_m)
        return _encode(slopes, crest.astype(np.float32), self.long_gain)

    @property
    def height_of_unit_m(self) -> float:
        """Height of a texture unit of the long tile's crest [m]."""
        return float(8.0 * self.height_deviation_m / np.sqrt(2.0))

    @property
    def foam_threshold(self) -> float:
        """Crest above which the sea is white, so that Monahan's share of it is (crests are about normal)."""
        return float(_CREST_DEVIATION * -ndtri(max(whitecap_cover(self.wind_speed_mps), 1e-7)))

    def short_drift_m(self, t_s: float) -> Array:
        """(2,) how far the short waves have run [m] at a time [s]: at half the phase speed of their tile's length."""
        speed = 0.5 * np.sqrt(GRAVITY_MPS2 * self.short_tile_m / (2.0 * np.pi)) / 2.0
        return np.asarray(speed * t_s * np.array([np.cos(self._direction_rad), np.sin(self._direction_rad)]))

    def _make_short(self, variance: float, direction_rad: float, rng: np.random.Generator) -> Texels:
        north, east, number = _wave_numbers(SHORT_SIZE, self.short_tile_m)
        safe = np.maximum(number, 1e-9)
        along = (north * np.cos(direction_rad) + east * np.sin(direction_rad)) / safe
        first = 2.0 * np.pi / self.short_tile_m
        shape = np.where(number > 2.5 * first, safe**-2.1, 0.0) * (0.35 + np.abs(along))
        shape *= np.exp(-((number / (0.5 * number.max())) ** 2))
        amplitude = shape * np.exp(2j * np.pi * rng.random(number.shape)) * rng.rayleigh(1.0, number.shape)
        slopes = self._slopes(amplitude, north, east)
        slopes *= np.sqrt(variance / np.mean(np.abs(slopes) ** 2))
        height = np.fft.ifft2(amplitude).real
        crest = 0.5 + height / (8.0 * height.std())
        return _encode(slopes.astype(np.complex64), crest.astype(np.float32), self.short_gain)
