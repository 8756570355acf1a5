"""Forces of the air on the aircraft, ground effect and hover trim.

Frames: `body` forward-right-down and `ned`; everything is plain float arithmetic, because a tick of a few
microseconds is what lets a campaign fly thousands of landings.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shipland.frames import GRAVITY_MPS2, Rows, rows_from_euler
from shipland.sim.aircraft.parameters import AirframeParameters, Vector


def air_force_in_ned_n(
    airframe: AirframeParameters, ned_from_body: Rows, air_velocity_in_ned_mps: Vector, total_thrust_n: float
) -> Vector:
    """Drag and inflow loss [N] in `ned`; thrust itself is not in it.

    In-plane rotor drag grows with air speed and with rotor speed, hence with the root of thrust [Martin2010]
    (P. Martin, E. Salaün, "The true role of accelerometer feedback in quadrotor control", ICRA 2010, Eq. 6-9);
    inflow along the rotor axis takes thrust away; the fuselage's drag is quadratic.

    Args:
        airframe: coefficients.
        ned_from_body: attitude, row by row.
        air_velocity_in_ned_mps: the aircraft's velocity through the air.
        total_thrust_n: of the four rotors.
    """
    u, v, w = air_velocity_in_ned_mps
    r = ned_from_body
    axial = r[2] * u + r[5] * v + r[8] * w
    spin = math.sqrt(max(total_thrust_n, 0.0) / (4.0 * airframe.hover_thrust_n))
    square = airframe.body_drag_per_m * math.sqrt(u * u + v * v + w * w)
    plane = airframe.rotor_drag_per_s * spin
    along = (airframe.inflow_loss_per_s * spin - plane) * axial
    scale = -airframe.mass_kg
    all_axes = plane + square
    return (
        scale * (all_axes * u + along * r[2]),
        scale * (all_axes * v + along * r[5]),
        scale * (all_axes * w + along * r[8]),
    )


def ground_effect_gain(height_m: float, rotor_radius_m: float) -> float:
    """Thrust over thrust far from ground of a rotor `height_m` over a surface, 1 … 1.33.

    Cheeseman and Bennett 1955 (ARC R&M 3021): T/T∞ = 1 / (1 - (R/4z)²); held at z = R/2 below that.
    """
    ratio = rotor_radius_m / (4.0 * max(height_m, 0.5 * rotor_radius_m))
    return 1.0 / (1.0 - ratio * ratio)


class Trim(NamedTuple):
    """Steady hover over ground in a wind.

    Attributes:
        roll_rad, pitch_rad: attitude.
        thrust_n: total thrust.
        push_in_ned_mps2: acceleration that thrust must give against drag.
    """

    roll_rad: float
    pitch_rad: float
    thrust_n: float
    push_in_ned_mps2: Vector


def trim_hover(airframe: AirframeParameters, wind_in_ned_mps: Vector, heading_rad: float) -> Trim:
    """The attitude and thrust that stand still over ground in a steady wind, by fixed-point iteration."""
    roll, pitch, thrust = 0.0, 0.0, airframe.mass_kg * GRAVITY_MPS2
    air = (-wind_in_ned_mps[0], -wind_in_ned_mps[1], -wind_in_ned_mps[2])
    cy, sy = math.cos(heading_rad), math.sin(heading_rad)
    push = (0.0, 0.0, 0.0)
    for _ in range(40):
        force = air_force_in_ned_n(airframe, rows_from_euler(roll, pitch, heading_rad), air, thrust)
        push = (-force[0] / airframe.mass_kg, -force[1] / airframe.mass_kg, -force[2] / airframe.mass_kg)
        lift = max(GRAVITY_MPS2 - push[2], 0.2 * GRAVITY_MPS2)
        forward, right = cy * push[0] + sy * push[1], cy * push[1] - sy * push[0]
        pitch = -math.atan2(forward, lift)
        roll = math.atan2(right * math.cos(pitch), lift)
        thrust = airframe.mass_kg * math.sqrt(forward * forward + right * right + lift * lift)
    return Trim(roll, pitch, thrust, push)
