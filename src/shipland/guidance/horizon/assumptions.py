"""What the motion models of the estimate assume: vehicle, gusts, waves and the ship's axis, each by what is seen."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

from shipland.estimation.heading import Headings
from shipland.estimation.relative_state import AxisModel, Disturbances, Model
from shipland.estimation.waves import WaveMotion, WaveShares
from shipland.frames import Array, wrap_angle
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.response import Response

_AXIS_STEP_RAD = 0.2
"""Step of the ship's axis from model to model."""
_VIEW_STEP, _VIEW_OFF = 0.125, 0.0875
"""Step of the share of ship in view from model to model, and how far it may be off, which counts by the ship's speed:
less than a step, so that no last digit decides about 1."""
_GUST_STEPS, _LULL_STEPS = 0.6, 2.5
"""Levels by which the wind must exceed, or fall short of, that in use: a lull is no calm."""
_SLOWEST_SHIP_MPS = 0.75
"""A ship that seems slower lies still: the vehicle's own velocity errs by as much."""
_FLOW_SLOPE = math.tan(math.radians(30.0))
"""Half the view of an optical-flow camera, as a slope."""
_CLIMB_ACTUATOR_LAG_S = 0.05
"""Of the vertical acceleration; what lags is the climb rate."""


def motion_of(response: Response) -> AxisModel:
    """The horizontal motion of a vehicle, nothing in view."""
    return AxisModel(
        response.lag_s,
        response.drag_per_s,
        response.servo_per_s,
        integral_per_s2=response.integral_per_s2,
        approach_per_s=response.approach_per_s,
        smoothing_s=response.smoothing_s,
    )


@dataclass(frozen=True)
class Assumptions:
    """Assumptions of the motion models.

    Attributes:
        motion: horizontal, of the vehicle.
        wave: wave motion of deck and bar.
        gust_mps2: standard deviation of the acceleration by gusts; one of `gust_levels_mps2`.
        axis_rad: direction of the ship's axis in the axes of the flight; None while it is not known.
        ship_mps: speed of a ship whose heading is not seen, and which may turn; a power of two, or 0.
    """

    motion: AxisModel
    wave: WaveMotion
    gust_mps2: float
    axis_rad: float | None = None
    ship_mps: float = 0.0

    def across_model(self, parameters: HorizonParameters, gain: float) -> Model:
        """The horizontal model, for a gain of the sticks."""
        servo = self.motion.servo_per_s > 0.0
        disturbances = parameters.horizontal_servo_at if servo else parameters.horizontal_at
        noise = disturbances(self.gust_mps2)
        if self.ship_mps > 0.0:
            longer = math.sqrt(noise.velocity_bias_time_s / parameters.course_time_s)
            noise = replace(noise, velocity_bias_mps=self.ship_mps * longer)
        shares = None  # a ship's sway is larger than its surge, and goes with its heave
        if self.wave.bar_moves and self.axis_rad is not None:
            shares = replace(parameters.wave.spread, along_rad=self.axis_rad)
        return _model(2, replace(self.motion, gain=gain), noise, self.wave, shares)

    def down_model(self, parameters: HorizonParameters, response: Response) -> Model:
        """The vertical model."""
        climb = AxisModel(_CLIMB_ACTUATOR_LAG_S, 0.0, 1.0 / response.climb_lag_s)
        heaves = replace(self.wave, deck_shares=parameters.wave.deck_heave_shares)
        return _model(1, climb, parameters.vertical_at(self.gust_mps2), heaves)

    def with_axis(self, headings: Headings) -> Assumptions:
        """With the directions of surge and sway turned with the ship."""
        if not headings.bar_known:
            return self
        if self.axis_rad is not None and abs(wrap_angle(headings.bar_rad - self.axis_rad)) <= _AXIS_STEP_RAD:
            return self
        return replace(self, axis_rad=_AXIS_STEP_RAD * round(headings.bar_rad / _AXIS_STEP_RAD))

    def with_gusts(self, held_mps2: Array, parameters: HorizonParameters) -> Assumptions:
        """With gusts by the mean wind: turbulence grows with it, and the tilt that holds the position shows it.

        Args:
            held_mps2: (2,) acceleration against the wind.
            parameters: of the pilot.
        """
        levels = parameters.gust_levels_mps2
        gust_mps2 = max(self._gust_share(parameters) * math.hypot(*held_mps2.tolist()), 1e-3)
        steps = math.log(gust_mps2 / self.gust_mps2) / math.log(levels[1] / levels[0])
        if -_LULL_STEPS <= steps <= _GUST_STEPS:
            return self
        return replace(self, gust_mps2=min(levels, key=lambda level: abs(math.log(level / gust_mps2))))

    def wind_mps2(self, parameters: HorizonParameters) -> float:
        """Acceleration by the mean wind that gusts of this level go with."""
        return self.gust_mps2 / self._gust_share(parameters)

    def _gust_share(self, parameters: HorizonParameters) -> float:
        return parameters.gust_share_at_sea if self.wave.bar_moves else parameters.gust_share

    def with_ship(self, ship_mps: float) -> Assumptions:
        """With the speed of a ship whose heading is not seen; 0 where it is, or the ship lies still."""
        if 0.5 * self.ship_mps < ship_mps < 2.0 * self.ship_mps:
            return self
        level_mps = 2.0 ** round(math.log2(ship_mps)) if ship_mps >= _SLOWEST_SHIP_MPS else 0.0
        return self if level_mps == self.ship_mps else replace(self, ship_mps=level_mps)

    def with_view(self, over_ship: float, settle_s: float) -> Assumptions:
        """With the share of ship in view: a servo on optical flow follows the motion of the ship below it."""
        if abs(over_ship - self.motion.over_ship) <= _VIEW_OFF:
            return self
        over_ship = _VIEW_STEP * round(over_ship / _VIEW_STEP)
        return replace(self, motion=replace(self.motion, over_ship=over_ship, settle_s=settle_s))


def ship_in_view(aircraft_in_bar_m: Array, over_deck_m: float, hull_m: tuple[float, float, float]) -> float:
    """Share of ship in the view of a downward optical-flow camera: the platform against a square below the aircraft.

    Args:
        aircraft_in_bar_m: (2,) or more: forward, starboard.
        over_deck_m: height over the deck.
        hull_m: stern and bow forward of the bar, and half the width.
    """
    ahead_m, right_m = aircraft_in_bar_m[:2].tolist()
    half_m = max(over_deck_m, 0.05) * _FLOW_SLOPE
    stern_m, bow_m, side_m = hull_m
    along_m = min(ahead_m + half_m, bow_m) - max(ahead_m - half_m, stern_m)
    aside_m = min(right_m + half_m, side_m) - max(right_m - half_m, -side_m)
    return float(max(along_m, 0.0) * max(aside_m, 0.0) / (2.0 * half_m) ** 2)


@lru_cache(maxsize=16)  # what alternates in a flight; a worker that flies many would grow without end
def _model(
    axes: int, motion: AxisModel, noise: Disturbances, wave: WaveMotion, shares: WaveShares | None = None
) -> Model:
    return Model(axes, motion, noise, wave, shares)
