"""A parametric ship airwake: the recirculation and the shear layer in the lee of the superstructure.

The superstructure is a box. In its lee, seen down the relative wind, the air is slowed, reversed close to the face,
pulled down over the deck, and made turbulent, mostly in the shear layer. Shapes are those of the flow behind a
backward-facing step, which flight decks resemble; sizes are parameters. It is no CFD: places, lengths and magnitudes
are plausible, and nothing finer is in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.config import key, parameters
from shipland.rig import Rig
from shipland.sim.air.turbulence import normal_numbers

Vector = tuple[float, float, float]


@parameters
class AirwakeParameters:
    """Section `[wind.airwake]`; H is the superstructure's height over the deck, U the relative wind.

    In heights H of the superstructure over the deck, and shares of the relative wind: docs/explanation/wind.md.
    """

    enabled: bool = key(True, "the superstructure disturbs the air")
    reattachment_heights: float = key(
        2.5, "length of the recirculation zone in H", "chosen; a long step: 6 ± 1 (Eaton and Johnston 1981)", gt=0
    )
    reverse_share: float = key(
        0.2, "reverse flow in the zone, in U", "Eaton and Johnston (1981): up to a fifth", ge=0, le=1
    )
    recovery_heights: float = key(4.0, "length in H over which the wake fades beyond the zone", gt=0)
    downwash_share: float = key(0.15, "largest downward velocity behind the superstructure, in U", ge=0, le=1)
    layer_share: float = key(
        0.1, "the shear layer's half thickness at the edge, in H", "chosen: a tenth of the step", gt=0
    )
    layer_growth: float = key(
        0.1, "its growth a metre downwind", "chosen: about a plane mixing layer's, on its slow side at rest", ge=0, le=1
    )
    turbulence_share: float = key(
        0.2, "largest horizontal turbulence of the wake, in U", "Eaton and Johnston (1981)", ge=0, le=1
    )
    vertical_turbulence_share: float = key(
        0.12, "largest vertical turbulence of the wake, in U", "chosen: 0.6 of the horizontal", ge=0, le=1
    )
    eddy_heights: float = key(1.0, "length scale of that turbulence in H", "chosen: eddies of the step's size", gt=0)


@dataclass(frozen=True)
class WakePlace:
    """The wake at one place, in shares of the relative wind.

    Attributes:
        deficit: what the flow along the relative wind loses; above 1 it is reversed.
        downwash: downward velocity.
        turbulence: standard deviation of each component, as a share of the largest.
    """

    deficit: float
    downwash: float
    turbulence: float


NO_WAKE = WakePlace(0.0, 0.0, 0.0)


class Airwake:
    """The superstructure's wake over one flight.

    Args:
        parameters: sizes of the wake.
        rig: place and size of the superstructure: from the bar's plane to the bow, as wide as the platform.
        rng: draws the turbulence.
    """

    def __init__(self, parameters: AirwakeParameters, rig: Rig, rng: np.random.Generator) -> None:
        self._parameters = parameters
        self._aft_m = rig.bar_ahead_of_stern_m - rig.deck_ahead_of_stern_m
        self._fore_m = rig.platform_length_m - rig.deck_ahead_of_stern_m
        self._half_width_m = 0.5 * rig.platform_width_m
        self._height_m = rig.superstructure_height_m - rig.deck_height_m
        self._normal = normal_numbers(rng)
        self._eddy = [next(self._normal) for _ in range(3)]

    def place(self, position_in_ship_m: Vector, towards_rad: float) -> WakePlace:
        """The wake at a place.

        Args:
            position_in_ship_m: forward, starboard, down of the deck's centre.
            towards_rad: direction that the relative wind blows to, clockwise from the bow.
        """
        p, size_m = self._parameters, self._height_m
        along_f, along_s = math.cos(towards_rad), math.sin(towards_rad)
        forward_m, starboard_m, down_m = position_in_ship_m
        corners = [
            (x * along_f + y * along_s, y * along_f - x * along_s)
            for x in (self._aft_m, self._fore_m)
            for y in (-self._half_width_m, self._half_width_m)
        ]
        across_m = starboard_m * along_f - forward_m * along_s
        left_m, right_m = min(c[1] for c in corners), max(c[1] for c in corners)
        behind_m = (
            forward_m * along_f
            + starboard_m * along_s
            - self._lee_face_m(min(max(across_m, left_m), right_m), along_f, along_s)
        )
        if behind_m <= 0.0:
            return NO_WAKE
        layer_m = p.layer_share * size_m + p.layer_growth * behind_m
        above = (-down_m - size_m) / layer_m
        outside = max(left_m - across_m, across_m - right_m) / layer_m
        if above > 6.0 or outside > 6.0:
            return NO_WAKE
        lee = 0.25 * (1.0 - math.tanh(above)) * (1.0 - math.tanh(outside)) * math.tanh(behind_m / layer_m)
        zone_m = p.reattachment_heights * size_m
        beyond = max(behind_m - zone_m, 0.0) / (p.recovery_heights * size_m)
        inside = 0.5 * (1.0 + math.cos(math.pi * min(behind_m / zone_m, 1.0)))  # 1 at the face, 0 at reattachment
        fade = math.exp(-beyond)
        share = behind_m / zone_m
        return WakePlace(
            lee * (1.0 + p.reverse_share) * fade * (0.5 + 0.5 * inside),
            lee * p.downwash_share * share * math.exp(1.0 - share),
            fade * max(lee * 0.5, 4.0 * lee * (1.0 - lee)) * min(4.0 * share, 1.0),
        )

    def disturbance(self, place: WakePlace, speed_mps: float, towards_rad: float, step_s: float) -> Vector:
        """Velocity that the wake adds to the air, along the ship's forward, starboard, down [m/s].

        Args:
            place: where.
            speed_mps: relative wind.
            towards_rad: direction that it blows to, clockwise from the bow.
            step_s: time since the last call; the turbulence advances by it.
        """
        keep = math.exp(-step_s * speed_mps / (self._parameters.eddy_heights * self._height_m))
        std = math.sqrt(1.0 - keep * keep)
        self._eddy = [keep * value + std * next(self._normal) for value in self._eddy]
        along = -place.deficit * speed_mps
        swirl = self._parameters.turbulence_share * place.turbulence * speed_mps
        vertical = self._parameters.vertical_turbulence_share * place.turbulence * speed_mps
        return (
            along * math.cos(towards_rad) + swirl * self._eddy[0],
            along * math.sin(towards_rad) + swirl * self._eddy[1],
            place.downwash * speed_mps + vertical * self._eddy[2],
        )

    def _lee_face_m(self, across_m: float, along_f: float, along_s: float) -> float:
        """Where a line down the wind, `across_m` to its right, leaves the box."""
        leaves = math.inf
        for low_m, high_m, along, offset in (
            (self._aft_m, self._fore_m, along_f, -across_m * along_s),
            (-self._half_width_m, self._half_width_m, along_s, across_m * along_f),
        ):
            if abs(along) > 1e-9:
                leaves = min(leaves, ((high_m if along > 0.0 else low_m) - offset) / along)
        return leaves
