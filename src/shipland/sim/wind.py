"""Wind: the air's velocity in `ned` at a place and time, and how the ship disturbs it.

The airwake is parametric, the recirculation and the shear layer in the lee of the superstructure, a box. In its lee,
seen down the relative wind, the air is slowed, reversed close to the face, pulled down over the deck, and made
turbulent, mostly in the shear layer. Shapes are those of the flow behind a backward-facing step, which flight decks
resemble; sizes are parameters. It is no CFD: places, lengths and magnitudes are plausible, and nothing finer is in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, Protocol

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters
from shipland.frames import Array
from shipland.rig import Rig
from shipland.sim.turbulence import (
    Dryden,
    Kaimal,
    Scales,
    SeaSurfaceParameters,
    TurbulenceParameters,
    land_scales,
    normal_numbers,
    sea_roughness_m,
    surface_layer_deviations_mps,
    surface_layer_height_m,
)

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
        aft_m, fore_m = (it - rig.deck_ahead_of_stern_m for it in (rig.bar_ahead_of_stern_m, rig.platform_length_m))
        height_m, p = rig.superstructure_height_m - rig.deck_height_m, parameters
        self._sizes = (
            (aft_m, fore_m, 0.5 * rig.platform_width_m, height_m),
            (p.reattachment_heights, p.reverse_share, p.recovery_heights),
            (p.downwash_share, p.layer_share, p.layer_growth),
            (p.eddy_heights * height_m, p.turbulence_share, p.vertical_turbulence_share),
        )
        self._normal = normal_numbers(rng)
        self._eddy = np.array([next(self._normal) for _ in range(3)])

    def place(self, position_in_ship_m: Vector, towards_rad: float) -> WakePlace:
        """The wake at a place in `ship`, in a relative wind that blows to a direction, clockwise from the bow."""
        return WakePlace(*_wake(self._sizes, position_in_ship_m, towards_rad))

    def disturbance(self, position_in_ship_m: Vector, speed_mps: float, towards_rad: float, step_s: float) -> Vector:
        """Velocity that the wake adds to the air at a `place`, along the ship's forward, starboard, down [m/s].

        `speed_mps` is the relative wind's. The turbulence advances by `step_s`, the time since the last call.
        """
        sizes, normals = self._sizes, (next(self._normal), next(self._normal), next(self._normal))
        return _disturbance(sizes, position_in_ship_m, speed_mps, towards_rad, step_s, self._eddy, normals)


_Sizes = tuple[tuple[float, float, float, float], Vector, Vector, Vector]
"""The superstructure's after and fore end, half its width, its height over the deck; the parameters in the order of
`AirwakeParameters`, but the turbulence's, which come last: its length [m] and its horizontal and vertical shares."""


@compiled
def _wake(sizes: _Sizes, position_in_ship_m: Vector, towards_rad: float) -> Vector:
    """The values of a `WakePlace`; place and direction as in `Airwake.place`."""
    (aft_m, fore_m, half_m, size_m), (zone, reverse_share, recovery), others, _ = sizes
    downwash_share, layer_share, growth = others
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


@compiled
def _disturbance(
    sizes: _Sizes, place_m: Vector, speed_mps: float, towards_rad: float, step_s: float, eddy: Array, normals: Vector
) -> Vector:
    """`Airwake.disturbance`; standard normal numbers (3,) drive the turbulence `eddy` (3,)."""
    deficit, downwash, turbulence = _wake(sizes, place_m, towards_rad)
    length_m, share, vertical_share = sizes[3]
    keep = math.exp(-step_s * speed_mps / length_m)
    std = math.sqrt(1.0 - keep * keep)
    for index in range(3):
        eddy[index] = keep * eddy[index] + std * normals[index]
    along, swirl = -deficit * speed_mps, share * turbulence * speed_mps
    return (
        along * math.cos(towards_rad) + swirl * eddy[0],
        along * math.sin(towards_rad) + swirl * eddy[1],
        downwash * speed_mps + vertical_share * turbulence * speed_mps * eddy[2],
    )


MEAN_MPS = (0.0, 30.0)
"""Range of mean wind speeds."""

TWENTY_FEET_M = 6.096
_SHIP_SPEED_LAG_S = 0.2
"""Smoothing of the ship's velocity, which is taken from its successive poses."""


class ShipPlace(NamedTuple):
    """Where `ship` is in `ned`: its origin and course."""

    north_m: float
    east_m: float
    down_m: float
    course_rad: float


class Wind(Protocol):
    """Air in motion."""

    def velocity_at(self, t_s: float, position_in_ned_m: Vector, ship: ShipPlace) -> Vector:
        """Velocity of the air in `ned` [m/s] at a point of `ned`; `t_s` never decreases between calls."""


class SteadyWind:
    """The same wind everywhere and always."""

    def __init__(self, velocity_in_ned_mps: Vector) -> None:
        self._velocity = velocity_in_ned_mps

    def velocity_at(self, t_s: float, position_in_ned_m: Vector, ship: ShipPlace) -> Vector:  # noqa: ARG002
        """See `Wind`."""
        return self._velocity


@parameters
class GustParameters:
    """One 1-cosine gust: velocity · ½ (1 − cos 2πs), s the share of its duration that has passed."""

    start_s: float = key(..., "begin", ge=0)
    duration_s: float = key(..., "from calm to calm", gt=0)
    velocity_mps: tuple[float, float, float] = key(
        ..., "(3,) at its height, along the mean wind, to its right, downward"
    )

    def strength(self, t_s: float) -> float:
        """Share of its height at `t_s`, 0…1."""
        share = (t_s - self.start_s) / self.duration_s
        return 0.5 * (1.0 - math.cos(2.0 * math.pi * share)) if 0.0 < share < 1.0 else 0.0


@dataclass(frozen=True)
class WindReadings:
    """One wind as it is measured in several ways.

    Attributes:
        mean_mps: at the height asked for.
        mean_10m_mps: at 10 m over the same surface, as meteorologists say it (WMO-No. 8), by the logarithmic profile.
        gust_mps: strongest mean of three seconds within ten minutes, at the height asked for.
    """

    mean_mps: float
    mean_10m_mps: float
    gust_mps: float


WMO_HEIGHT_M = 10.0
GUST_PEAK = 3.1
"""Standard deviations of the turbulence that the gust exceeds the mean by: the highest of about 200 three-second means
(Davenport 1964)."""


@parameters
class WindParameters:
    """What the configuration says of the wind in section `[wind]`."""

    mean_mps: float = key(
        0.0, "mean wind, at `reference_height_m` in a profile", "[Lee2022] flew in up to 9 m/s", ge=0, le=30
    )
    from_deg: float = key(0.0, "compass direction that the wind comes from")
    mean_half_range_mps: float = key(
        0.0, "drawn evenly within this much either side, once a flight; never below 0 m/s", ge=0
    )
    from_half_range_deg: float = key(0.0, "drawn evenly within this much either side, once a flight", ge=0, le=180)
    profile: Literal["uniform", "log"] = key("uniform", "the same at every height, or logarithmic", "uniform | log")
    reference_height_m: float = key(6.096, "of `mean_mps` in a logarithmic profile", "20 ft, as MIL-F-8785C", ge=1)
    surface: Literal["land", "sea", "land_kaimal", "sea_kaimal"] = key(
        "land",
        "what the wind blows over",
        "land: MIL-F-8785C's deviations | sea: a neutral marine surface layer, [wind.sea] | …_kaimal: a surface layer "
        "over either, with Kaimal's spectra instead of Dryden's",
    )
    roughness_m: float = key(
        0.01, "of the land; Charnock's relation gives the sea's", "mown grass (Stull 1988, fig. 9.6)", gt=0, lt=0.1
    )
    gust: tuple[GustParameters, ...] = key(
        (), "1-cosine gusts", "e.g. [{ start_s = 20.0, duration_s = 3.0, velocity_mps = [4.0, 0.0, 0.0] }]"
    )
    turbulence: TurbulenceParameters = key(TurbulenceParameters(), "Dryden turbulence, and its strength over land")
    sea: SeaSurfaceParameters = key(SeaSurfaceParameters(), "its strength over the sea")
    airwake: AirwakeParameters = key(AirwakeParameters(), "the superstructure's wake")

    @property
    def at_sea(self) -> bool:
        """It blows over the sea."""
        return self.surface.startswith("sea")

    @cached_property
    def surface_roughness_m(self) -> float:
        """Roughness length [m] of the surface that the wind blows over."""
        if not self.at_sea:
            return self.roughness_m
        return sea_roughness_m(self.sea.charnock, self.mean_mps, self.reference_height_m)

    @cached_property
    def wind_at_20_ft_mps(self) -> float:
        """Mean wind speed [m/s] at 20 ft, of which MIL-F-8785C takes its shares."""
        return self.mean_at(TWENTY_FEET_M)

    def mean_at(self, height_m: float) -> float:
        """Mean wind speed [m/s] at a height above the surface."""
        if self.profile == "uniform":
            return self.mean_mps
        rough_m = self.surface_roughness_m
        height_m = max(height_m, 10.0 * rough_m)
        return self.mean_mps * math.log(height_m / rough_m) / math.log(self.reference_height_m / rough_m)

    def turbulence_at(self, height_m: float) -> Scales:
        """Scale lengths and standard deviations of the turbulence at a height above the surface."""
        scales = land_scales(self.turbulence, height_m, self.wind_at_20_ft_mps)
        if self.surface == "land":
            return scales
        layer, kaimal = self.sea, self.surface.endswith("_kaimal")
        deviations_mps = surface_layer_deviations_mps(
            layer, self.surface_roughness_m, self.mean_at(height_m), height_m, kaimal
        )
        if kaimal:
            within_m = surface_layer_height_m(layer, height_m)
            return Scales(within_m, within_m, deviations_mps)
        return Scales(scales.length_horizontal_m, scales.length_vertical_m, deviations_mps)

    def readings_at(self, height_m: float) -> WindReadings:
        """What anemometers would read of the wind that is flown at a height, without the ship."""
        rough_m = self.surface_roughness_m
        above_m = max(height_m, 10.0 * rough_m)
        mean_mps, deviation_mps = self.mean_at(height_m), 0.0
        if self.turbulence.enabled and mean_mps > 0.0:
            deviation_mps = self.turbulence_at(height_m).deviations_mps[0]
        return WindReadings(
            mean_mps,
            mean_mps * math.log(WMO_HEIGHT_M / rough_m) / math.log(above_m / rough_m),
            mean_mps + GUST_PEAK * deviation_mps,
        )


class NaturalWind:
    """Mean wind, gusts, turbulence, and the airwake of a ship in the relative wind; `rng` draws the turbulence."""

    def __init__(self, parameters: WindParameters, rig: Rig, rng: np.random.Generator) -> None:
        turbulence_rng, wake_rng = rng.spawn(2)
        self._parameters = parameters
        towards_rad = math.radians(parameters.from_deg) + math.pi
        self._cos, self._sin = math.cos(towards_rad), math.sin(towards_rad)
        self._turbulence: Dryden | Kaimal | None = None
        if parameters.turbulence.enabled and parameters.mean_mps > 0.0:
            made = Kaimal if parameters.surface.endswith("_kaimal") else Dryden
            self._turbulence = made(turbulence_rng)
        self._airwake = Airwake(parameters.airwake, rig, wake_rng) if parameters.airwake.enabled else None
        self._mean_at_deck_mps = parameters.mean_at(rig.deck_height_m)
        self._last: tuple[float, Vector] | None = None
        self._ship_last: tuple[float, float] | None = None
        self._ship_velocity: tuple[float, float] | None = None

    def velocity_at(self, t_s: float, position_in_ned_m: Vector, ship: ShipPlace) -> Vector:
        """See `Wind`."""
        height_m = -position_in_ned_m[2]
        mean_mps = self._parameters.mean_at(height_m)
        step_s = t_s - self._last[0] if self._last is not None else 0.0
        along, right, sinking = self._free_stream(t_s, mean_mps)
        if self._turbulence is not None:
            distance_m = self._distance(position_in_ned_m, step_s, mean_mps)
            gust = self._turbulence.step(distance_m, self._parameters.turbulence_at(height_m))
            along, right, sinking = along + gust[0], right + gust[1], sinking + gust[2]
        north, east = along * self._cos - right * self._sin, along * self._sin + right * self._cos
        if self._airwake is not None:
            wake = self._wake(t_s, step_s, position_in_ned_m, ship)
            north, east, sinking = north + wake[0], east + wake[1], sinking + wake[2]
        self._last = (t_s, position_in_ned_m)
        return north, east, sinking

    def _free_stream(self, t_s: float, mean_mps: float) -> Vector:
        """Mean wind and gusts, along the wind, to its right, downward."""
        along, right, down = mean_mps, 0.0, 0.0
        for gust in self._parameters.gust:
            strength = gust.strength(t_s)
            if strength > 0.0:
                a, r, d = gust.velocity_mps
                along, right, down = along + strength * a, right + strength * r, down + strength * d
        return along, right, down

    def _distance(self, position: Vector, step_s: float, mean_mps: float) -> float:
        """Distance flown through the air mass, which drifts with the mean wind, since the last call [m]."""
        if self._last is None:
            return 0.0
        north, east, down = position
        last_north, last_east, last_down = self._last[1]
        drift = mean_mps * step_s
        north, east = north - last_north - drift * self._cos, east - last_east - drift * self._sin
        return math.hypot(north, east, down - last_down)

    def _wake(self, t_s: float, step_s: float, position: Vector, ship: ShipPlace) -> Vector:
        """Velocity in `ned` that the superstructure's wake adds."""
        assert self._airwake is not None
        ship_north, ship_east, ship_down, course_rad = ship
        c, s = math.cos(course_rad), math.sin(course_rad)
        ship_n_mps, ship_e_mps = self._ship_speed((ship_north, ship_east), step_s)
        along, right, _ = self._free_stream(t_s, self._mean_at_deck_mps)
        blow_north = along * self._cos - right * self._sin - ship_n_mps
        blow_east = along * self._sin + right * self._cos - ship_e_mps
        speed_mps = math.hypot(blow_north, blow_east)
        if speed_mps < 1e-6:
            return 0.0, 0.0, 0.0
        towards_rad = math.atan2(blow_east * c - blow_north * s, blow_north * c + blow_east * s)
        north, east, down = position[0] - ship_north, position[1] - ship_east, position[2] - ship_down
        place_m = north * c + east * s, east * c - north * s, down
        forward, starboard, sinking = self._airwake.disturbance(place_m, speed_mps, towards_rad, step_s)
        return forward * c - starboard * s, forward * s + starboard * c, sinking

    def _ship_speed(self, place: tuple[float, float], step_s: float) -> tuple[float, float]:
        """The ship's velocity (north, east) from its successive places, smoothed."""
        last, share = self._ship_last, -math.expm1(-step_s / _SHIP_SPEED_LAG_S)
        if last is None or step_s > 0.0:
            self._ship_last = place
        if last is not None and step_s > 0.0:
            raw = (place[0] - last[0]) / step_s, (place[1] - last[1]) / step_s
            old = self._ship_velocity or raw
            self._ship_velocity = old[0] + share * (raw[0] - old[0]), old[1] + share * (raw[1] - old[1])
        return self._ship_velocity or (0.0, 0.0)


def draw_mean(parameters: WindParameters, rng: np.random.Generator) -> WindParameters:
    """`parameters` with the mean wind's speed and direction drawn within their half-ranges."""
    mean_mps = parameters.mean_mps + parameters.mean_half_range_mps * rng.uniform(-1.0, 1.0)
    from_deg = parameters.from_deg + parameters.from_half_range_deg * rng.uniform(-1.0, 1.0)
    return replace(
        parameters,
        mean_mps=float(np.clip(mean_mps, *MEAN_MPS)),
        from_deg=from_deg,
        mean_half_range_mps=0.0,
        from_half_range_deg=0.0,
    )


def drawn_wind(parameters: WindParameters, rng: np.random.Generator) -> WindParameters:
    """The mean wind that `build_wind` flies with a generator in the same state."""
    return draw_mean(parameters, rng.spawn(2)[0])


def build_wind(parameters: WindParameters, rig: Rig, rng: np.random.Generator) -> Wind:
    """The wind that `parameters` describe; `rng` draws its mean and its turbulence."""
    mean_rng, air_rng = rng.spawn(2)
    p = draw_mean(parameters, mean_rng)
    turbulent = p.turbulence.enabled and p.mean_mps > 0.0
    if not turbulent and not p.airwake.enabled and not p.gust and (p.profile == "uniform" or p.mean_mps == 0.0):
        towards_rad = math.radians(p.from_deg) + math.pi
        return SteadyWind((p.mean_mps * math.cos(towards_rad), p.mean_mps * math.sin(towards_rad), 0.0))
    return NaturalWind(p, rig, air_rng)
