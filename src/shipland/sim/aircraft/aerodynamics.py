"""Forces of the air on the aircraft, ground effect and hover trim; frames `body` forward-right-down and `ned`."""

from __future__ import annotations

import math

from shipland.compiled import compiled
from shipland.frames import GRAVITY_MPS2 as G
from shipland.frames import Rows
from shipland.sim.aircraft.loop_laws import tilt_of
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.aircraft.record import Constants, Records
from shipland.sim.rotations import rows_of_euler


@compiled
def air_force_in_ned_n(
    k: Constants, ned_from_body: Rows, u: float, v: float, w: float, total_thrust_n: float
) -> Vector:
    """Drag and inflow loss [N] in `ned`; thrust itself is not in it.

    In-plane rotor drag grows with air speed and with rotor speed, hence with the root of thrust [Martin2010]
    (P. Martin, E. Salaün, "The true role of accelerometer feedback in quadrotor control", ICRA 2010, Eq. 6-9);
    inflow along the rotor axis takes thrust away; the fuselage's drag is quadratic.

    Args:
        k: coefficients.
        ned_from_body: attitude, row by row.
        u: the aircraft's velocity through the air, north.
        v: east.
        w: down.
        total_thrust_n: of the four rotors.
    """
    m = ned_from_body
    axial = m[2] * u + m[5] * v + m[8] * w
    spin = math.sqrt(max(total_thrust_n, 0.0) / (4.0 * k.hover_n))
    plane = k.rotor_drag * spin
    along = (k.inflow_loss * spin - plane) * axial
    drag = plane + k.body_drag * math.sqrt(u * u + v * v + w * w)
    return (
        -k.mass * (drag * u + along * m[2]),
        -k.mass * (drag * v + along * m[5]),
        -k.mass * (drag * w + along * m[8]),
    )


@compiled
def ground_effect_gain(height_m: float, rotor_radius_m: float) -> float:
    """Thrust over thrust far from ground of a rotor `height_m` over a surface, 1 … 1.33.

    Cheeseman and Bennett 1955 (ARC R&M 3021): T/T∞ = 1 / (1 - (R/4z)²); held at z = R/2 below that.
    """
    ratio = rotor_radius_m / (4.0 * max(height_m, 0.5 * rotor_radius_m))
    return 1.0 / (1.0 - ratio * ratio)


@compiled
def trim_hover(constants: Records, wind_in_ned_mps: Vector, heading_rad: float) -> tuple[float, float, float, Vector]:
    """The attitude and thrust that stand still over ground in a steady wind, by fixed-point iteration.

    Returns:
        Roll and pitch [rad]; total thrust [N]; acceleration in `ned` that thrust must give against drag [m/s²].
    """
    k = constants[0]
    roll, pitch, thrust = 0.0, 0.0, k.mass * G
    push_n, push_e, push_d = 0.0, 0.0, 0.0
    wind_n, wind_e, wind_d = wind_in_ned_mps
    for _ in range(40):
        rows = rows_of_euler(roll, pitch, heading_rad)
        north, east, down = air_force_in_ned_n(k, rows, -wind_n, -wind_e, -wind_d, thrust)
        push_n, push_e, push_d = -north / k.mass, -east / k.mass, -down / k.mass
        lift = max(G - push_d, 0.2 * G)
        roll, pitch = tilt_of(push_n, push_e, lift, heading_rad)
        cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
        forward, right = cosine * push_n + sine * push_e, cosine * push_e - sine * push_n
        thrust = k.mass * math.sqrt(forward * forward + right * right + lift * lift)
    return roll, pitch, thrust, (push_n, push_e, push_d)


@compiled
def drag_slope_per_s(constants: Records, wind_mps: float) -> float:
    """Deceleration for a metre per second more through the air, along a wind, about the hover in it."""
    k, half_mps = constants[0], 0.01
    _, pitch, thrust, _ = trim_hover(constants, (-wind_mps, 0.0, 0.0), 0.0)
    rows = rows_of_euler(0.0, pitch, 0.0)
    slower, _, _ = air_force_in_ned_n(k, rows, wind_mps - half_mps, 0.0, 0.0, thrust)
    faster, _, _ = air_force_in_ned_n(k, rows, wind_mps + half_mps, 0.0, 0.0, thrust)
    return float((slower - faster) / (2.0 * half_mps * k.mass))
