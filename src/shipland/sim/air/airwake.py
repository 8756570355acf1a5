"""A parametric ship airwake: the recirculation and the shear layer in the lee of the superstructure.

The superstructure is a box. In its lee, seen down the relative wind, the air is slowed, reversed close to the face,
pulled down over the deck, and made turbulent, mostly in the shear layer. Shapes are those of the flow behind a
backward-facing step, which flight decks resemble; sizes are parameters. It is no CFD: places, lengths and magnitudes
are plausible, and nothing finer is in it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.compiled import compiled
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


class WakePlace(NamedTuple):
    """The wake at one place, in shares of the relative wind.

    Attributes:
        deficit: what the flow along the relative wind loses; above 1 it is reversed.
        downwash: downward velocity.
        turbulence: standard deviation of each component, as a share of the largest.
    """

    deficit: float
    downwash: float
    turbulence: float


class Airwake:
    """The superstructure's wake over one flight.

    Args:
        parameters: sizes of the wake.
        rig: place and size of the superstructure: from the bar's plane to the bow, as wide as the platform.
        rng: draws the turbulence.
    """

    def __init__(self, parameters: AirwakeParameters, rig: Rig, rng: np.random.Generator) -> None:
        self._parameters = parameters
        aft_m, fore_m = (it - rig.deck_ahead_of_stern_m for it in (rig.bar_ahead_of_stern_m, rig.platform_length_m))
        self._height_m = rig.superstructure_height_m - rig.deck_height_m
        self._box_m = aft_m, fore_m, 0.5 * rig.platform_width_m, self._height_m
        self._shape = (
            *(parameters.reattachment_heights, parameters.reverse_share, parameters.recovery_heights),
            *(parameters.downwash_share, parameters.layer_share, parameters.layer_growth),
        )
        self._normal = normal_numbers(rng)
        self._eddy = [next(self._normal) for _ in range(3)]

    def place(self, position_in_ship_m: Vector, towards_rad: float) -> WakePlace:
        """The wake at a place.

        Args:
            position_in_ship_m: forward, starboard, down of the deck's centre.
            towards_rad: direction that the relative wind blows to, clockwise from the bow.
        """
        return WakePlace(*_wake(self._box_m, self._shape, position_in_ship_m, towards_rad))

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


@compiled
def _wake(
    box_m: tuple[float, float, float, float],
    shape: tuple[float, float, float, float, float, float],
    position_in_ship_m: Vector,
    towards_rad: float,
) -> Vector:
    """The values of a `WakePlace`.

    Args:
        box_m: the superstructure's after and fore end, half its width, its height over the deck.
        shape: parameters of the wake, in the order of `AirwakeParameters`.
        position_in_ship_m: as in `Airwake.place`.
        towards_rad: likewise.
    """
    (aft_m, fore_m, half_m, size_m), (zone, reverse_share, recovery, downwash_share, layer_share, growth) = box_m, shape
    along_f, along_s = math.cos(towards_rad), math.sin(towards_rad)
    forward_m, starboard_m, down_m = position_in_ship_m
    left_m, right_m = math.inf, -math.inf
    for x in (aft_m, fore_m):
        for y in (-half_m, half_m):
            corner_m = y * along_f - x * along_s
            left_m, right_m = min(left_m, corner_m), max(right_m, corner_m)
    across_m = starboard_m * along_f - forward_m * along_s
    within_m = min(max(across_m, left_m), right_m)
    face_m = math.inf  # where a line down the wind leaves the box
    if abs(along_f) > 1e-9:
        face_m = min(face_m, ((fore_m if along_f > 0.0 else aft_m) - -within_m * along_s) / along_f)
    if abs(along_s) > 1e-9:
        face_m = min(face_m, ((half_m if along_s > 0.0 else -half_m) - within_m * along_f) / along_s)
    behind_m = forward_m * along_f + starboard_m * along_s - face_m
    if behind_m <= 0.0:
        return 0.0, 0.0, 0.0
    layer_m = layer_share * size_m + growth * behind_m
    above = (-down_m - size_m) / layer_m
    outside = max(left_m - across_m, across_m - right_m) / layer_m
    if above > 6.0 or outside > 6.0:
        return 0.0, 0.0, 0.0
    lee = 0.25 * (1.0 - math.tanh(above)) * (1.0 - math.tanh(outside)) * math.tanh(behind_m / layer_m)
    zone_m = zone * size_m
    beyond = max(behind_m - zone_m, 0.0) / (recovery * size_m)
    inside = 0.5 * (1.0 + math.cos(math.pi * min(behind_m / zone_m, 1.0)))  # 1 at the face, 0 at reattachment
    fade = math.exp(-beyond)
    share = behind_m / zone_m
    return (
        lee * (1.0 + reverse_share) * fade * (0.5 + 0.5 * inside),
        lee * downwash_share * share * math.exp(1.0 - share),
        fade * max(lee * 0.5, 4.0 * lee * (1.0 - lee)) * min(4.0 * share, 1.0),
    )
