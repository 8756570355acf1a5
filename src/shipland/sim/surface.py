"""What lies below the aircraft as its downward camera sees it: deck, platform, and land or water around them."""

from __future__ import annotations

import math

from shipland.rig import Rig, view_share
from shipland.sim.aircraft.parameters import SensorParameters, Vector
from shipland.sim.aircraft.sensors import Surface
from shipland.sim.contact.deck_drive import DeckState
from shipland.sim.ship.ship import ShipState

_FAR = 10.0
"""Platform lengths beyond which no part of the ship is in view."""


class Ground:
    """Velocities of what is in view, averaged over the view; a square of `flow_view_deg` straight down.

    Args:
        rig: the sizes of deck and platform.
        sensors: the view's width and the water's drift.
        water: the ship is at sea; else on land, which stands still.
    """

    def __init__(self, rig: Rig, sensors: SensorParameters, water: bool) -> None:
        self._water, self._drift_share = water, sensors.water_drift_share
        self._slope = math.tan(math.radians(0.5 * sensors.flow_view_deg))
        half_deck, half_width = 0.5 * rig.deck_size_m, 0.5 * rig.platform_width_m
        stern = -rig.deck_ahead_of_stern_m
        self._deck = (-half_deck, half_deck, -half_deck, half_deck)
        self._platform = (stern, stern + rig.platform_length_m, -half_width, half_width)
        self._far_m = _FAR * rig.platform_length_m

    def below(self, position_m: Vector, ship: ShipState, deck: DeckState, wind_mps: Vector) -> Surface:
        """The surface in view from `position_m` in `ned`."""
        drift = self._drift_share if self._water else 0.0
        north, east = drift * wind_mps[0], drift * wind_mps[1]
        x, y, z = (position_m[i] - deck.origin_m[i] for i in range(3))
        if max(abs(x), abs(y)) > self._far_m or z > 0.0:
            return Surface(north, east, float(self._water))
        m = deck.ned_from_deck
        ahead, right = m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z
        half_m = max(-z * self._slope, 0.02)
        deck_share = view_share(ahead, right, half_m, self._deck)
        hull_share = max(view_share(ahead, right, half_m, self._platform) - deck_share, 0.0)
        rest = 1.0 - deck_share - hull_share
        north, east = rest * north, rest * east
        r = deck.turn_rad_s[2]
        deck_n, deck_e = deck.velocity_mps[0] - r * y, deck.velocity_mps[1] + r * x
        if ship.full_ship:
            hull_n, hull_e = deck_n, deck_e
        else:
            w = ship.course.course_rate_rad_s
            ship_n, ship_e = ship.course.velocity_in_ned_mps.tolist()
            hull_n, hull_e = ship_n - w * y, ship_e + w * x
        return Surface(
            north + deck_share * deck_n + hull_share * hull_n,
            east + deck_share * deck_e + hull_share * hull_e,
            rest if self._water else 0.0,
        )
