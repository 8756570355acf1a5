"""The wind over open sea: a neutral surface layer whose roughness the wind makes itself.

Mean wind U(z) = (u*/κ) ln(z/z₀) with Charnock's roughness z₀ = α u*²/g (Charnock 1955); standard deviations are fixed
multiples of u* (Panofsky and Dutton 1984), so that the intensity σu/U is 2.39 κ / ln(z/z₀), close to 1/ln(z/z₀).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.config import require
from shipland.frames import GRAVITY_MPS2
from shipland.sim.air.dryden import Scales

KARMAN = 0.4
"""Von Kármán's constant."""

_ROUNDS = 30
"""Of the fixed-point iteration for the roughness; each gains about one digit."""
_LEAST_ROUGHNESS_M = 1e-7
"""In a wind so light that Charnock's relation gives next to nothing."""


@dataclass(frozen=True)
class SeaSurfaceParameters:
    """Section `[wind.sea]`.

    Attributes:
        charnock: α of z₀ = α u*²/g.
        deviations: σu, σv, σw over the friction velocity u*.
        height_min_m, height_max_m: the surface layer's range of heights; outside, its nearest height is used.
    """

    charnock: float
    deviations: tuple[float, float, float]
    height_min_m: float
    height_max_m: float

    def __post_init__(self) -> None:
        require(0.0 < self.charnock < 0.1, f"charnock must be between 0 and 0.1, got {self.charnock}")
        require(min(self.deviations) >= 0.0, f"deviations must not be negative, got {self.deviations}")
        require(0.1 <= self.height_min_m < self.height_max_m, "height_min_m must be at least 0.1 m, below height_max_m")


def sea_roughness_m(charnock: float, mean_mps: float, height_m: float) -> float:
    """Charnock's roughness length [m] where the mean wind is `mean_mps` at `height_m`."""
    roughness_m = 1e-4
    for _ in range(_ROUNDS):
        friction_mps = KARMAN * mean_mps / math.log(height_m / roughness_m)
        roughness_m = max(charnock * friction_mps**2 / GRAVITY_MPS2, _LEAST_ROUGHNESS_M)
    return roughness_m


def sea_deviations_mps(
    parameters: SeaSurfaceParameters, roughness_m: float, mean_mps: float, height_m: float
) -> tuple[float, float, float]:
    """σu, σv, σw [m/s] where the mean wind is `mean_mps` at `height_m` over a sea of this roughness."""
    height_m = min(max(height_m, parameters.height_min_m), parameters.height_max_m)
    friction_mps = KARMAN * mean_mps / math.log(height_m / roughness_m)
    along, across, vertical = parameters.deviations
    return along * friction_mps, across * friction_mps, vertical * friction_mps


def sea_scales(
    parameters: SeaSurfaceParameters, lengths: Scales, roughness_m: float, mean_mps: float, height_m: float
) -> Scales:
    """Deviations over the sea, with the scale lengths of `lengths`."""
    deviations_mps = sea_deviations_mps(parameters, roughness_m, mean_mps, height_m)
    return Scales(lengths.length_horizontal_m, lengths.length_vertical_m, deviations_mps)
