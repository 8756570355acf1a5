"""The air of a batch of flights: mean wind, Dryden turbulence and the superstructure's wake (`sim.air`)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import torch
from torch import Tensor

from shipland.learning.policy.setup import PhaseSetup, Randomisation
from shipland.sim.air.turbulence import Scales
from shipland.sim.air.wind import WindParameters

_SQRT3 = math.sqrt(3.0)
_HEIGHT_M = 1.5
"""At which the turbulence is taken; the Dryden filter of the simulator uses heights down to 3 m."""


@dataclass(frozen=True)
class Air:
    """The air of a batch of B flights.

    Attributes:
        mean_mps: (B,) speed of the mean wind.
        towards: (B, 2) unit vector that it blows along, forward and starboard.
        turbulence_mps: (B, 3) standard deviations along it, across, downward.
        lengths_m: (B, 2) horizontal and vertical.
        wake: 1 with the superstructure's wake, 0 without.
    """

    mean_mps: Tensor
    towards: Tensor
    turbulence_mps: Tensor
    lengths_m: Tensor
    wake: float

    @property
    def mean_in_bar_mps(self) -> Tensor:
        """(B, 3) the mean wind, forward, starboard, down."""
        return torch.cat([self.mean_mps[:, None] * self.towards, torch.zeros_like(self.mean_mps)[:, None]], 1)


def draw_air(setup: PhaseSetup, random: Randomisation, batch: int, generator: torch.Generator) -> Air:
    """Draw a batch's mean winds, evenly over speed and direction."""
    low, high = random.wind_mps
    mean = low + (high - low) * torch.rand(batch, generator=generator)
    angle = 2.0 * math.pi * torch.rand(batch, generator=generator)
    return air_of(setup, mean, torch.stack([angle.cos(), angle.sin()], 1), random.wake)


def air_of(setup: PhaseSetup, mean_mps: Tensor, towards: Tensor, wake: bool) -> Air:
    """The air of given mean winds (B,) that blow along (B, 2)."""
    height_m = setup.rig.deck_height_m + _HEIGHT_M
    scales = [_scales(setup.wind, height_m, round(float(speed), 1)) for speed in mean_mps]
    on = float(setup.wind.turbulence.enabled)
    deviations = on * torch.tensor([item.deviations_mps for item in scales])
    lengths = torch.tensor([(item.length_horizontal_m, item.length_vertical_m) for item in scales])
    return Air(mean_mps, towards, deviations, lengths, float(wake and setup.wind.airwake.enabled))


@lru_cache(maxsize=1024)
def _scales(wind: WindParameters, height_m: float, mean_mps: float) -> Scales:
    return replace(wind, mean_mps=mean_mps).turbulence_at(height_m)


def first_gust(air: Air, generator: torch.Generator) -> Tensor:
    """(B, 8) a draw of the filters' stationary states and the wake's eddies."""
    normal = torch.randn(len(air.mean_mps), 8, generator=generator)
    along, v1, v2, w1, w2, *eddies = normal.unbind(1)
    return torch.stack([along, 0.5 * v1, 0.5 * (v1 + v2), 0.5 * w1, 0.5 * (w1 + w2), *eddies], 1)


def next_gust(air: Air, gust: Tensor, step_s: float, eddy_m: float, normal: Tensor) -> Tensor:
    """(B, 8) the states a step later, discretised exactly as in `sim.air.turbulence`; `normal` (B, 8) drives them."""
    flown_m = air.mean_mps * step_s
    along, down = flown_m / air.lengths_m[:, 0], flown_m / air.lengths_m[:, 1]
    keep = (-along).exp()
    first = keep * gust[:, 0] + (-torch.expm1(-2.0 * along)).clamp_min(0.0).sqrt() * normal[:, 0]
    across = _advanced(gust[:, 1], gust[:, 2], along, normal[:, 1], normal[:, 2])
    vertical = _advanced(gust[:, 3], gust[:, 4], down, normal[:, 3], normal[:, 4])
    eddy_keep = (-flown_m / eddy_m).exp()[:, None]
    eddies = eddy_keep * gust[:, 5:] + (1.0 - eddy_keep**2).sqrt() * normal[:, 5:]
    return torch.cat([torch.stack([first, *across, *vertical], 1), eddies], 1)


def _advanced(x1: Tensor, x2: Tensor, length: Tensor, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    """One step of (p + 1)² x₁ = noise, x₂ = (p + 1) x₁, over `length` scale lengths.

    The covariance is that of short steps (`sim.air.turbulence.step_covariance`): below a tenth of a length.
    """
    keep = (-length).exp()
    c11 = length**3 / 3.0 - length**4 / 2.0
    c12 = length**2 / 2.0 - 2.0 * length**3 / 3.0
    c22 = length - length**2 + 2.0 * length**3 / 3.0
    std = c22.clamp_min(1e-12).sqrt()
    shared = c12 / std
    own = (c11 - shared**2).clamp_min(0.0).sqrt()
    return keep * (x1 + length * x2) + shared * first + own * second, keep * x2 + std * first


def wind_at(setup: PhaseSetup, air: Air, gust: Tensor, position_m: Tensor) -> Tensor:
    """(B, 3) the air's velocity, forward, starboard, down, at places (B, 3) from the neutral deck's centre."""
    along = air.turbulence_mps[:, 0] * gust[:, 0]
    across = air.turbulence_mps[:, 1] * (gust[:, 1] + _SQRT3 * (gust[:, 2] - gust[:, 1]))
    down = air.turbulence_mps[:, 2] * (gust[:, 3] + _SQRT3 * (gust[:, 4] - gust[:, 3]))
    cos, sin = air.towards.unbind(1)
    speed = air.mean_mps + along
    wind = torch.stack([speed * cos - across * sin, speed * sin + across * cos, down], 1)
    return wind + _wake(setup, air, gust, position_m) if air.wake else wind


def _wake(setup: PhaseSetup, air: Air, gust: Tensor, position_m: Tensor) -> Tensor:
    """(B, 3) what the wake adds: `sim.air.airwake.Airwake`, batched."""
    p, rig = setup.wind.airwake, setup.rig
    aft_m, fore_m = (edge - rig.deck_ahead_of_stern_m for edge in (rig.bar_ahead_of_stern_m, rig.platform_length_m))
    half_m, size_m = 0.5 * rig.platform_width_m, rig.superstructure_height_m - rig.deck_height_m
    cos, sin = air.towards.unbind(1)
    forward_m, starboard_m, down_m = position_m.unbind(1)
    sides = torch.stack([y * cos - x * sin for x in (aft_m, fore_m) for y in (-half_m, half_m)])
    left_m, right_m = sides.amin(0), sides.amax(0)
    across_m = starboard_m * cos - forward_m * sin
    shadow_m = across_m.clamp(left_m, right_m)
    face_m = torch.minimum(
        _leaves(aft_m, fore_m, cos, -shadow_m * sin),
        _leaves(-half_m, half_m, sin, shadow_m * cos),
    )
    behind_m = forward_m * cos + starboard_m * sin - face_m
    inside = behind_m > 0.0
    behind_m = behind_m.clamp_min(1e-3)
    layer_m = p.layer_share * size_m + p.layer_growth * behind_m
    above = ((-down_m - size_m) / layer_m).clamp(-20.0, 20.0)
    outside = (torch.maximum(left_m - across_m, across_m - right_m) / layer_m).clamp(-20.0, 20.0)
    inside = inside & (above <= 6.0) & (outside <= 6.0)
    lee = 0.25 * (1.0 - above.tanh()) * (1.0 - outside.tanh()) * (behind_m / layer_m).tanh() * inside
    zone_m = p.reattachment_heights * size_m
    share = behind_m / zone_m
    fade = (-(behind_m - zone_m).clamp_min(0.0) / (p.recovery_heights * size_m)).exp()
    at_face = 0.5 * (1.0 + (math.pi * share.clamp_max(1.0)).cos())
    deficit = lee * (1.0 + p.reverse_share) * fade * (0.5 + 0.5 * at_face)
    downwash = lee * p.downwash_share * share * (1.0 - share).exp()
    rough = fade * torch.maximum(0.5 * lee, 4.0 * lee * (1.0 - lee)) * (4.0 * share).clamp_max(1.0)
    speed = air.mean_mps
    swirl, vertical = p.turbulence_share * rough * speed, p.vertical_turbulence_share * rough * speed
    return torch.stack(
        [
            -deficit * speed * cos + swirl * gust[:, 5],
            -deficit * speed * sin + swirl * gust[:, 6],
            downwash * speed + vertical * gust[:, 7],
        ],
        1,
    )


def _leaves(low_m: float, high_m: float, along: Tensor, offset_m: Tensor) -> Tensor:
    """Where a line leaves a slab low … high of one axis; far away where it runs along it."""
    slow = along.abs() < 1e-6
    safe = torch.where(slow, torch.ones_like(along), along)
    leaves = torch.maximum((low_m - offset_m) / safe, (high_m - offset_m) / safe)
    return torch.where(slow, torch.full_like(along, 1e3), leaves)
