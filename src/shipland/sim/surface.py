"""The aircraft over the ship, by its record: how far it is from touching, and what its downward camera sees."""

from __future__ import annotations

import math

from shipland.compiled import compiled
from shipland.rig import Rig, view_share
from shipland.sim.aircraft.parameters import SensorParameters
from shipland.sim.aircraft.record import Constants, Record, Records, State

_FAR = 10.0
"""Platform lengths beyond which no part of the ship is in view."""

_share = compiled(view_share)


def set_surface(record: Record, rig: Rig, sensors: SensorParameters, water: bool, full_ship: bool) -> None:
    """Set the constants of the ship and its surroundings.

    Args:
        record: the aircraft's.
        rig: the sizes of deck and platform.
        sensors: the width of the downward camera's view, a square straight down, and the water's drift.
        water: the ship is at sea; else on land, which stands still.
        full_ship: the platform has the deck's motions.
    """
    record.set(
        flow_slope=math.tan(math.radians(0.5 * sensors.flow_view_deg)),
        water=float(water),
        water_drift=sensors.water_drift_share if water else 0.0,
        stern=-rig.deck_ahead_of_stern_m,
        bow=rig.platform_length_m - rig.deck_ahead_of_stern_m,
        half_width=0.5 * rig.platform_width_m,
        half_deck=0.5 * rig.deck_size_m,
        far=_FAR * rig.platform_length_m,
        full_ship=float(full_ship),
        deck_height=rig.deck_height_m,
        front=float(rig.bar_in_ship_m[0]),
    )


@compiled
def reach_m(states: Records) -> float:
    """Distance from the deck's centre."""
    s = states[0]
    x, y, z = s.x - s.deck_x, s.y - s.deck_y, s.z - s.deck_z
    return float(math.sqrt(x * x + y * y + z * z))


@compiled
def clearance_m(states: Records, constants: Records) -> float:
    """From the aircraft down to the highest that the deck reaches, or on to what stands ahead; at least."""
    s, k = states[0], constants[0]
    tilt = math.sin(min(abs(s.deck_roll) + abs(s.deck_pitch), 1.5))
    top = max(1.5 * k.half_deck * tilt - s.deck_z, k.deck_height)
    ahead = math.cos(s.course) * (s.x - s.ship_n) + math.sin(s.course) * (s.y - s.ship_e)
    front = k.front - ahead - (abs(s.deck_x - s.ship_n) if k.full_ship > 0.0 else 0.0)
    upright = 1.0 - 2.0 * (s.qx * s.qx + s.qy * s.qy)
    below = k.foot_below + k.radius * math.sqrt(max(1.0 - upright * upright, 0.0))
    return float(min(-s.z - top - below, front - k.radius))


@compiled
def surface_below(s: State, k: Constants) -> tuple[float, float, float]:
    """Velocity north and east of what is in view, averaged over the view; part of the view that is water."""
    north, east = k.water_drift * s.air_n, k.water_drift * s.air_e
    x, y, z = s.x - s.deck_x, s.y - s.deck_y, s.z - s.deck_z
    if max(abs(x), abs(y)) > k.far or z > 0.0:
        return north, east, k.water
    ahead, right = s.deck_fn * x + s.deck_fe * y + s.deck_fd * z, s.deck_rn * x + s.deck_re * y + s.deck_rd * z
    half = max(-z * k.flow_slope, 0.02)
    deck_share = _share(ahead, right, half, (-k.half_deck, k.half_deck, -k.half_deck, k.half_deck))
    hull_share = max(_share(ahead, right, half, (k.stern, k.bow, -k.half_width, k.half_width)) - deck_share, 0.0)
    rest = 1.0 - deck_share - hull_share
    deck_n, deck_e = s.deck_u - s.deck_turn_d * y, s.deck_v + s.deck_turn_d * x
    hull_n, hull_e = deck_n, deck_e
    if k.full_ship == 0.0:
        hull_n, hull_e = s.ship_u - s.course_rate * y, s.ship_v + s.course_rate * x
    return (
        rest * north + deck_share * deck_n + hull_share * hull_n,
        rest * east + deck_share * deck_e + hull_share * hull_e,
        rest if k.water > 0.0 else 0.0,
    )
