"""The score of an oracle: zero error to the bar-defined point, level, down at a given instant.

The pilot knows the deck only through the bar: it lands at the point where a deck at rest would have its centre. Where
the deck is at that instant is the ship's doing. The share of instants at which that point lies in the landing square is
the most that a pilot can reach who neither watches the deck nor chooses the instant; its control errors may be lucky.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipland.config import require
from shipland.frames import Array
from shipland.rig import Rig
from shipland.sim.aircraft.parameters import AirframeParameters
from shipland.sim.ship.ship import ShipParameters, ShipState, build_ship
from shipland.statistics import Interval, mean_interval

LENGTH_S = 120.0
"""Of each motion that is drawn for an oracle rate."""
STEP_S = 0.2
"""Between its instants."""


class Touchdown(NamedTuple):
    """A touchdown taken apart; all horizontal.

    Attributes:
        control_error_in_bar_m: (2,) the aircraft from the bar-defined point, forward and starboard in `bar`.
        deck_in_bar_m: (2,) the deck's centre from the same point.
        oracle_in_deck_m: (2,) where an aircraft without control error would have touched the deck.
        oracle_in_square: that lies in the landing square.
        control_in_square: the control error alone, with the deck at rest, lies in the landing square.
    """

    control_error_in_bar_m: Array
    deck_in_bar_m: Array
    oracle_in_deck_m: Array
    oracle_in_square: bool
    control_in_square: bool


def height_at_contact_m(ship: ShipState, airframe: AirframeParameters) -> float:
    """Height of a level aircraft's centre over the deck, along the deck's normal, when its first foot touches."""
    forward, right, down = (float(value) for value in ship.ned_from_deck.rotation[2])
    return (
        abs(forward) * airframe.foot_forward_m
        + abs(right) * airframe.foot_right_m
        + down * (airframe.foot_below_m - airframe.foot_radius_m)
        + airframe.foot_radius_m
    )


def oracle_in_deck_m(ship: ShipState, airframe: AirframeParameters) -> Array:
    """(2,) forward, starboard in `deck`: where an aircraft straight over the bar-defined point touches the deck."""
    height_m = height_at_contact_m(ship, airframe)
    return _in_deck_m(ship, ship.ned_from_bar.apply(ship.rig.deck_in_bar_m), height_m)


def _in_deck_m(ship: ShipState, point_in_ned_m: Array, height_m: float) -> Array:
    """(2,) in `deck` of the point on the vertical through `point_in_ned_m` that is `height_m` over the deck's plane."""
    from_deck_m = point_in_ned_m - ship.ned_from_deck.translation_m
    normal = ship.ned_from_deck.rotation[:, 2]
    from_deck_m[2] = -(height_m + normal[0] * from_deck_m[0] + normal[1] * from_deck_m[1]) / normal[2]
    return np.asarray(ship.ned_from_deck.rotation[:, :2].T @ from_deck_m)


def take_apart(ship: ShipState, airframe: AirframeParameters, touchdown_in_deck_m: Array) -> Touchdown:
    """The aircraft's and the deck's part in a touchdown.

    Args:
        ship: at first contact.
        airframe: of the aircraft.
        touchdown_in_deck_m: (2,) its centre at first contact.
    """
    height_m = height_at_contact_m(ship, airframe)
    forward_m, starboard_m = touchdown_in_deck_m.tolist()
    aircraft_in_ned_m = ship.ned_from_deck.apply(np.array([forward_m, starboard_m, -height_m]))
    bar_from_ned = ship.ned_from_bar.inverse()
    point_in_bar_m = ship.rig.deck_in_bar_m
    own_m = (bar_from_ned.apply(aircraft_in_ned_m) - point_in_bar_m)[:2]
    deck_m = (bar_from_ned.apply(ship.ned_from_deck.translation_m) - point_in_bar_m)[:2]
    oracle_m = _in_deck_m(ship, ship.ned_from_bar.apply(point_in_bar_m), height_m)
    inside, own_inside = (ship.rig.in_landing_area(*point_m.tolist()) for point_m in (oracle_m, own_m))
    return Touchdown(own_m, deck_m, oracle_m, inside, own_inside)


@dataclass(frozen=True)
class OracleRate:
    """The score of an oracle over many motions.

    Attributes:
        share: of instants at which it lands in the square.
        interval: of the share, from the scatter between motions.
        deviation_m: (2,) root mean square of the oracle's touchdown point from the square's centre, forward, starboard.
        sway_m: root mean square of the deck's sway in `ship`.
        motions: how many were drawn.
    """

    share: float
    interval: Interval
    deviation_m: tuple[float, float]
    sway_m: float
    motions: int


def oracle_rate(
    ship: ShipParameters, rig: Rig, airframe: AirframeParameters, motions: int, rng: np.random.Generator
) -> OracleRate:
    """Draw motions and count the instants at which an oracle lands in the square.

    Args:
        ship: what moves, and how.
        rig: dimensions.
        airframe: of the aircraft.
        motions: how many to draw, each independent of the others.
        rng: draws them.

    Raises:
        ConfigError: fewer than two motions.
        DataError: the recorded motion cannot be used.
    """
    require(motions >= 2, f"an oracle rate needs at least 2 motions, got {motions}")
    shares, squared_m, sway_m2 = [], [], []
    for motion_rng in rng.spawn(motions):
        drawn = build_ship(ship, rig, motion_rng)
        states = [drawn.at(float(t_s)) for t_s in np.arange(0.0, LENGTH_S, STEP_S)]
        points_m = np.array([oracle_in_deck_m(state, airframe) for state in states])
        shares.append(float(np.mean([rig.in_landing_area(*point_m) for point_m in points_m.tolist()])))
        squared_m.append(np.mean(points_m**2, axis=0))
        sway_m2.append(float(np.mean([state.deck.displacement[1] ** 2 for state in states])))
    forward_m, starboard_m = np.sqrt(np.mean(squared_m, axis=0)).tolist()
    interval = mean_interval(shares)
    return OracleRate(
        float(np.mean(shares)), interval, (forward_m, starboard_m), math.sqrt(float(np.mean(sway_m2))), motions
    )
