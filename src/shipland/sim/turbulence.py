"""Turbulence: the Dryden filters or Kaimal's spectra, and their scales over land and over the open sea.

The turbulence is a frozen field that drifts with the mean wind, as the specification's spectra suppose: the filters
are driven by the distance flown through the air mass, so that a hovering aircraft meets it at the wind's speed and a
flying one at its airspeed. Discretisation is exact for any step.

Over land the scales are those of MIL-F-8785C §3.7 at low altitude. Over the sea the wind makes its own roughness: a
neutral surface layer with mean wind U(z) = (u*/κ) ln(z/z₀) and Charnock's roughness z₀ = α u*²/g (Charnock 1955).
Standard deviations are fixed multiples of u* (Panofsky and Dutton 1984), so that the intensity σu/U is
2.39 κ / ln(z/z₀), close to 1/ln(z/z₀).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, islice, repeat
from typing import NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters, require
from shipland.frames import GRAVITY_MPS2, Array

FOOT_M = 0.3048
_SQRT3 = math.sqrt(3.0)


@parameters
class TurbulenceParameters:
    """Section `[wind.turbulence]`.

    Source: MIL-F-8785C §3.7, low altitude.
    """

    enabled: bool = key(True, "the wind is turbulent")
    intensity: float = key(
        0.1, "over land, vertical deviation as a share of the wind at 20 ft", "MIL-F-8785C §3.7.3.4", ge=0, le=1
    )
    height_min_m: float = key(
        3.048, "lowest height of the specification, used below it", "MIL-F-8785C: 10-1000 ft", gt=0
    )
    height_max_m: float = key(304.8, "highest height of the specification, used above it", "MIL-F-8785C: 10-1000 ft")

    def __post_init__(self) -> None:
        require(self.height_min_m < self.height_max_m, "height_min_m must be below height_max_m")


class Scales(NamedTuple):
    """Turbulence at one height: lengths Lu = Lv and Lw, deviations σu along the mean wind, σv across, σw vertical."""

    length_horizontal_m: float
    length_vertical_m: float
    deviations_mps: tuple[float, float, float]


def land_scales(parameters: TurbulenceParameters, height_m: float, wind_at_20_ft_mps: float) -> Scales:
    """Scale lengths and deviations over land, MIL-F-8785C §3.7.3.4 (its formulas take feet)."""
    height_ft = min(max(height_m, parameters.height_min_m), parameters.height_max_m) / FOOT_M
    shape = 0.177 + 0.000823 * height_ft
    vertical = parameters.intensity * wind_at_20_ft_mps
    horizontal = vertical / shape**0.4
    return Scales(height_ft / shape**1.2 * FOOT_M, height_ft * FOOT_M, (horizontal, horizontal, vertical))


def normal_numbers(rng: np.random.Generator) -> Iterator[float]:
    """Standard normal numbers without end, drawn in blocks because one at a time is slow."""
    return chain.from_iterable(rng.standard_normal(1024).tolist() for _ in repeat(None))


class Dryden:
    """Turbulent velocities along the mean wind, across it, and vertical."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._normal = normal_numbers(rng)
        u, *normals = islice(self._normal, 5)
        first, second = normals[::2], normals[1::2]  # stationary: variances ¼ and ½, covariance ¼
        self._state: Array = np.array(
            [u, *(x for a, b in zip(first, second, strict=True) for x in (0.5 * a, 0.5 * a + 0.5 * b))]
        )
        """Along the wind; two across it and two vertical."""

    def step(self, distance_m: float, scales: Scales) -> tuple[float, float, float]:
        """Turbulence [m/s] along the wind, to its right, and downward, `distance_m` on through the air mass."""
        horizontal, vertical = distance_m / scales.length_horizontal_m, distance_m / scales.length_vertical_m
        return _turbulence(self._state, horizontal, vertical, tuple(islice(self._normal, 5)), scales.deviations_mps)


@compiled
def _turbulence(
    state: Array,
    horizontal: float,
    vertical: float,
    normals: tuple[float, ...],
    deviations_mps: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Advance the filters by scale lengths; their outputs."""
    state[0] = math.exp(-horizontal) * state[0] + math.sqrt(-math.expm1(-2.0 * horizontal)) * normals[0]
    _advance(state[1:3], horizontal, normals[1], normals[2])
    _advance(state[3:5], vertical, normals[3], normals[4])
    along, across, down = deviations_mps
    return along * state[0], across * _output(state[1:3]), down * _output(state[3:5])


@compiled
def _advance(state: Array, length: float, first: float, second: float) -> None:
    """One exact step of (p + 1)² x₁ = noise, x₂ = (p + 1) x₁, over `length` scale lengths."""
    keep = math.exp(-length)
    noise = step_covariance(length)
    std = math.sqrt(noise[2])
    shared = noise[1] / std if std > 0.0 else 0.0
    own = math.sqrt(max(noise[0] - shared * shared, 0.0))
    state[0] = keep * (state[0] + length * state[1]) + shared * first + own * second
    state[1] = keep * state[1] + std * first


@compiled
def step_covariance(length: float) -> tuple[float, float, float]:
    """Covariance (x₁x₁, x₁x₂, x₂x₂) that white noise adds over a step of `length` scale lengths."""
    if length < 1e-3:  # the closed form loses its digits; the first terms left out are below 1e-6 of the result
        return (
            length**3 / 3.0 - length**4 / 2.0,
            length**2 / 2.0 - 2.0 * length**3 / 3.0,
            length - length**2 + 2.0 * length**3 / 3.0,
        )
    fade = math.exp(-2.0 * length)
    return (
        0.25 - fade * (0.5 * length * length + 0.5 * length + 0.25),
        0.25 - fade * (0.5 * length + 0.25),
        0.5 * (1.0 - fade),
    )


@compiled
def _output(state: Array) -> float:
    """(1 + √3 p) x₁: unit variance."""
    return float(state[0] + _SQRT3 * (state[1] - state[0]))


class Kaimal:
    """Turbulence with the spectra of a neutral surface layer, in the place of `Dryden`: eddies as large as the height.

    With f = n z/U, n S/u*² is 105 f/(1 + 33 f)^(5/3) along the wind, 17 f/(1 + 9.5 f)^(5/3) across it and
    2.1 f/(1 + 5.3 f^(5/3)) vertically (Kaimal et al. 1972). Each is a sum of first-order processes, within 3 % along
    and across and 13 % vertically for f from 0.002 to 10.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._state: Array = rng.standard_normal(_KAIMAL_SHARES.shape)

    def step(self, distance_m: float, scales: Scales) -> tuple[float, float, float]:
        """See `Dryden.step`; of the scales both lengths are the height."""
        kept = np.exp(-2.0 * math.pi * _KAIMAL_CORNERS * distance_m / scales.length_vertical_m)
        self._state = kept * self._state + np.sqrt(1.0 - kept**2) * self._rng.standard_normal(self._state.shape)
        along, across, down = (_KAIMAL_SHARES * self._state).sum(axis=1).tolist()
        return along * scales.deviations_mps[0], across * scales.deviations_mps[1], down * scales.deviations_mps[2]


_KAIMAL_CORNERS = np.array([0.0063, 0.0302, 0.1445, 0.6918, 3.311, 15.85])
"""f of the first-order processes."""
_KAIMAL_VARIANCES = np.array(
    [
        [0.392, 2.460, 1.416, 0.320, 0.118, 0.041],
        [0.010, 0.394, 1.477, 0.576, 0.144, 0.061],
        [0.000, 0.000, 0.253, 1.126, 0.006, 0.132],
    ]
)
"""(3, n) their variances over u*²: fitted."""
KAIMAL_DEVIATIONS = tuple(np.sqrt(_KAIMAL_VARIANCES.sum(axis=1)).tolist())
"""σu, σv, σw over u*."""
_KAIMAL_SHARES = np.sqrt(_KAIMAL_VARIANCES / _KAIMAL_VARIANCES.sum(axis=1, keepdims=True))

KARMAN = 0.4
"""Von Kármán's constant."""

_ROUNDS = 30
"""Fixed-point iterations for the roughness length; each gains about one digit."""
_LEAST_ROUGHNESS_M = 1e-7
"""Least roughness length, for winds in which Charnock's relation gives almost none."""


@parameters
class SeaSurfaceParameters:
    """Section `[wind.sea]`.

    Scale lengths are those of MIL-F-8785C over land and sea.
    """

    charnock: float = key(
        0.011, "α of z₀ = α u*²/g", "Smith (1988); COARE 3.0 for winds below 10 m/s (Fairall et al. 2003)", gt=0, lt=0.1
    )
    deviations: tuple[float, float, float] = key(
        (2.39, 1.92, 1.25), "σu, σv, σw over the friction velocity u*", "neutral: Panofsky and Dutton (1984), ch. 7"
    )
    height_min_m: float = key(
        0.5, "lowest height of the surface layer, used below it", "chosen: lower, waves disturb the profile", ge=0.1
    )
    height_max_m: float = key(
        100.0, "highest height of the surface layer, used above it", "chosen: the surface layer's usual depth"
    )

    def __post_init__(self) -> None:
        require(min(self.deviations) >= 0.0, f"deviations must not be negative, got {self.deviations}")
        require(self.height_min_m < self.height_max_m, "height_min_m must be below height_max_m")


def sea_roughness_m(charnock: float, mean_mps: float, height_m: float) -> float:
    """Charnock's roughness length [m] where the mean wind is `mean_mps` at `height_m`."""
    roughness_m = 1e-4
    for _ in range(_ROUNDS):
        friction_mps = KARMAN * mean_mps / math.log(height_m / roughness_m)
        roughness_m = max(charnock * friction_mps**2 / GRAVITY_MPS2, _LEAST_ROUGHNESS_M)
    return roughness_m


def surface_layer_deviations_mps(
    parameters: SeaSurfaceParameters, roughness_m: float, mean_mps: float, height_m: float, kaimal: bool = False
) -> tuple[float, float, float]:
    """σu, σv, σw [m/s] where the mean wind is `mean_mps` at `height_m` over a surface of this roughness."""
    height_m = surface_layer_height_m(parameters, height_m)
    friction_mps = KARMAN * mean_mps / math.log(height_m / roughness_m)
    along, across, vertical = KAIMAL_DEVIATIONS if kaimal else parameters.deviations
    return along * friction_mps, across * friction_mps, vertical * friction_mps


def surface_layer_height_m(parameters: SeaSurfaceParameters, height_m: float) -> float:
    """The height within the surface layer."""
    return min(max(height_m, parameters.height_min_m), parameters.height_max_m)
