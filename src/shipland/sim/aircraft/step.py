"""The aircraft's step: gimbal, senses, inner loop, rotors and air at each tick, the rigid body at each physics step.

Forces of the air, ground effect, mixer and rotors with a lag make the wrench of a demand; frames are `body`
forward-right-down and `ned`. Away from the deck `fly_free` flies it for many steps in one call. Near it `tick` is
called once a tick, and MuJoCo, whose step `step_body` repeats, moves the body among its contacts.
"""

from __future__ import annotations

import math

from shipland.compiled import compiled
from shipland.frames import GRAVITY_MPS2 as G
from shipland.frames import Array, Rows, rows_from_euler, rows_from_quaternion
from shipland.sim.aircraft.loops import clip, control, tilt_of
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.aircraft.record import Constants, Records, State
from shipland.sim.aircraft.sensors import sense, step_gimbal

rows_of_euler, rows_of_quaternion = compiled(rows_from_euler), compiled(rows_from_quaternion)


@compiled
def air_force_in_ned_n(
    k: Constants, ned_from_body: Rows, u: float, v: float, w: float, total_thrust_n: float
) -> Vector:
    """Drag and inflow loss [N] in `ned` at a velocity (u, v, w) through the air in `ned`; thrust itself is not in it.

    In-plane rotor drag grows with air speed and with rotor speed, hence with the root of thrust [Martin2010]
    (P. Martin, E. Salaün, "The true role of accelerometer feedback in quadrotor control", ICRA 2010, Eq. 6-9);
    inflow along the rotor axis takes thrust away; the fuselage's drag is quadratic.
    """
    m = ned_from_body
    axial = m[2] * u + m[5] * v + m[8] * w
    spin = math.sqrt(max(total_thrust_n, 0.0) / (4.0 * k.hover_n))
    plane = k.rotor_drag_per_s * spin
    along = (k.inflow_loss_per_s * spin - plane) * axial
    drag = plane + k.body_drag_per_m * math.sqrt(u * u + v * v + w * w)
    return (
        -k.mass_kg * (drag * u + along * m[2]),
        -k.mass_kg * (drag * v + along * m[5]),
        -k.mass_kg * (drag * w + along * m[8]),
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
    roll, pitch, thrust = 0.0, 0.0, k.mass_kg * G
    push_n, push_e, push_d = 0.0, 0.0, 0.0
    wind_n, wind_e, wind_d = wind_in_ned_mps
    for _ in range(40):
        rows = rows_of_euler(roll, pitch, heading_rad)
        north, east, down = air_force_in_ned_n(k, rows, -wind_n, -wind_e, -wind_d, thrust)
        push_n, push_e, push_d = -north / k.mass_kg, -east / k.mass_kg, -down / k.mass_kg
        lift = max(G - push_d, 0.2 * G)
        roll, pitch = tilt_of(push_n, push_e, lift, heading_rad)
        cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
        forward, right = cosine * push_n + sine * push_e, cosine * push_e - sine * push_n
        thrust = k.mass_kg * math.sqrt(forward * forward + right * right + lift * lift)
    return roll, pitch, thrust, (push_n, push_e, push_d)


@compiled
def drag_slope_per_s(constants: Records, wind_mps: float) -> float:
    """Deceleration for a metre per second more through the air, along a wind, about the hover in it."""
    k, half_mps = constants[0], 0.01
    _, pitch, thrust, _ = trim_hover(constants, (-wind_mps, 0.0, 0.0), 0.0)
    rows = rows_of_euler(0.0, pitch, 0.0)
    slower, _, _ = air_force_in_ned_n(k, rows, wind_mps - half_mps, 0.0, 0.0, thrust)
    faster, _, _ = air_force_in_ned_n(k, rows, wind_mps + half_mps, 0.0, 0.0, thrust)
    return float((slower - faster) / (2.0 * half_mps * k.mass_kg))


@compiled
def mix(states: Records, constants: Records) -> None:
    """Thrusts of the rotors; what exceeds their range goes first from yaw, then from roll and pitch."""
    s, k = states[0], constants[0]
    share = clip(0.25 * s.demand_n, 1.5 * k.low_n, 0.9 * k.top_n)
    room = min(share - k.low_n, k.top_n - share)
    roll, pitch = -0.25 * s.demand_roll / k.motor_right_m, 0.25 * s.demand_pitch / k.motor_forward_m
    tilt = abs(roll) + abs(pitch)
    if tilt > room:
        roll, pitch, tilt = roll * room / tilt, pitch * room / tilt, room
    yaw = clip(0.25 * s.demand_yaw / k.torque_per_thrust_m, tilt - room, room - tilt)
    s.asked_a = share + roll + pitch + yaw
    s.asked_b = share - roll + pitch - yaw
    s.asked_c = share + roll - pitch - yaw
    s.asked_d = share - roll - pitch + yaw


@compiled
def turn_rotors(states: Records, constants: Records) -> None:
    """The wrench until the next tick: thrusts that follow those asked, drag and inflow loss of the air.

    A rotor's thrust follows with a first-order lag; its mean over the tick acts, less what an unsound rotor loses. Lift
    has the ground effect's gain, torque has not.
    """
    s, k = states[0], constants[0]
    total = s.thrust_a + s.thrust_b + s.thrust_c + s.thrust_d
    a, s.thrust_a = _follow(s.thrust_a, s.asked_a, k)
    b, s.thrust_b = _follow(s.thrust_b, s.asked_b, k)
    c, s.thrust_c = _follow(s.thrust_c, s.asked_c, k)
    d, s.thrust_d = _follow(s.thrust_d, s.asked_d, k)
    a, b, c, d = s.sound_a * a, s.sound_b * b, s.sound_c * c, s.sound_d * d
    s.moment_z = k.torque_per_thrust_m * (a - b - c + d)
    a, b, c, d = a * s.gain_a, b * s.gain_b, c * s.gain_c, d * s.gain_d
    lift = a + b + c + d
    s.moment_x = k.motor_right_m * (b + d - a - c)
    s.moment_y = k.motor_forward_m * (a + b - c - d)
    m = rows_of_quaternion(s.qw, s.qx, s.qy, s.qz)
    north, east, down = air_force_in_ned_n(k, m, s.u - s.air_n, s.v - s.air_e, s.w - s.air_d, total)
    s.force_n, s.force_e, s.force_d = north - lift * m[2], east - lift * m[5], down - lift * m[8]


@compiled
def _follow(thrust: float, asked: float, k: Constants) -> tuple[float, float]:
    """A rotor's mean thrust over a tick, and its thrust at the end."""
    asked = clip(asked, 0.0, k.top_n)
    off = thrust - asked
    return asked + k.mean_share * off, thrust - k.settle_share * off


@compiled
def feel_ground(s: State, k: Constants) -> None:
    """Ground-effect gains of the rotors over the deck, which moves on by its velocity and acceleration."""
    s.gain_a, s.gain_b, s.gain_c, s.gain_d = 1.0, 1.0, 1.0, 1.0
    t, h = s.deck_s, 0.5 * s.deck_s * s.deck_s
    x = s.x - s.deck_x - t * s.deck_u - h * s.deck_au
    y = s.y - s.deck_y - t * s.deck_v - h * s.deck_av
    z = s.z - s.deck_z - t * s.deck_w - h * s.deck_aw
    if not k.ground_effect > 0.0 or x * x + y * y + z * z >= k.near_deck * k.near_deck:
        return
    roll, pitch = s.deck_roll + t * s.deck_p + h * s.deck_ap, s.deck_pitch + t * s.deck_q + h * s.deck_aq
    yaw = s.deck_yaw + t * s.deck_r + h * s.deck_ar
    body, deck = rows_of_quaternion(s.qw, s.qx, s.qy, s.qz), rows_of_euler(roll, pitch, yaw)
    forward, right = k.motor_forward_m, k.motor_right_m
    s.gain_a = _gain(k, body, deck, x, y, z, forward, right)
    s.gain_b = _gain(k, body, deck, x, y, z, forward, -right)
    s.gain_c = _gain(k, body, deck, x, y, z, -forward, right)
    s.gain_d = _gain(k, body, deck, x, y, z, -forward, -right)


@compiled
def _gain(k: Constants, body: Rows, deck: Rows, x: float, y: float, z: float, forward: float, right: float) -> float:
    """Gain of the rotor at (forward, right) of a body at (x, y, z) from the deck's centre, in `ned`."""
    a = x + body[0] * forward + body[1] * right - body[2] * k.motor_above_m
    b = y + body[3] * forward + body[4] * right - body[5] * k.motor_above_m
    c = z + body[6] * forward + body[7] * right - body[8] * k.motor_above_m
    above = -(deck[2] * a + deck[5] * b + deck[8] * c)
    ahead, beside = deck[0] * a + deck[3] * b + deck[6] * c, deck[1] * a + deck[4] * b + deck[7] * c
    if abs(ahead) < k.half_deck and abs(beside) < k.half_deck and above > 0.0:
        return ground_effect_gain(above, k.rotor_radius_m)
    return 1.0


@compiled
def tick(states: Records, constants: Records, noise: Array, motors_run: bool) -> None:
    """One tick of the packaged aircraft; afterwards its wrench stands in the record.

    `noise` (2,) are standard normal numbers of the gimbal; without `motors_run` no rotor is commanded.
    """
    s, k = states[0], constants[0]
    step_gimbal(states, constants, noise)
    sense(states, constants)
    if motors_run:
        control(states, constants)
        mix(states, constants)
    else:
        s.asked_a, s.asked_b, s.asked_c, s.asked_d = 0.0, 0.0, 0.0, 0.0
    feel_ground(s, k)
    turn_rotors(states, constants)


SAFE_UPRIGHT = 0.5
"""Cosine of the tilt beyond which the flight is not free: MuJoCo flies it."""


@compiled
def fly_free(states: Records, constants: Records, noise: Array, phase: int, every: int, count: int) -> int:
    """Step `count` physics steps, fewer when it gets too low or too tilted; how many were stepped.

    A tick is `every` physics steps, and the last one began `phase` steps ago; `noise` are standard normal numbers of
    the gimbal, two for each tick.
    """
    s, k = states[0], constants[0]
    used = 0
    for step in range(count):
        if (phase + step) % every == 0:
            upright = 1.0 - 2.0 * (s.qx * s.qx + s.qy * s.qy)
            if s.z > k.lowest_z or upright < SAFE_UPRIGHT:
                return step
            tick(states, constants, noise[used : used + 2], True)
            used += 2
        step_body(s, k)
        s.deck_s += k.step_s
    return count


@compiled
def step_body(s: State, k: Constants) -> None:
    """MuJoCo's `implicitfast`: velocities first, gyroscopic moment implicit; then places by new velocities."""
    dt = k.step_s
    s.u += dt * s.force_n / k.mass_kg
    s.v += dt * s.force_e / k.mass_kg
    s.w += dt * (s.force_d / k.mass_kg + G)
    # Of the rates: (1 + dt dg/dw) change = dt (moment/inertia - g), g = w x (inertia w) / inertia.
    p, q, r = s.p, s.q, s.r
    a = dt * (k.inertia_z - k.inertia_y) / k.inertia_x
    b = dt * (k.inertia_x - k.inertia_z) / k.inertia_y
    c = dt * (k.inertia_y - k.inertia_x) / k.inertia_z
    d = dt * s.moment_x / k.inertia_x - a * q * r
    e = dt * s.moment_y / k.inertia_y - b * r * p
    f = dt * s.moment_z / k.inertia_z - c * p * q
    xy, xz, yx, yz, zx, zy = a * r, a * q, b * r, b * p, c * q, c * p
    whole = 1.0 + xy * yz * zx + xz * yx * zy - xz * zx - yz * zy - xy * yx
    s.p += (d * (1.0 - yz * zy) + e * (xz * zy - xy) + f * (xy * yz - xz)) / whole
    s.q += (d * (yz * zx - yx) + e * (1.0 - xz * zx) + f * (xz * yx - yz)) / whole
    s.r += (d * (yx * zy - zx) + e * (xy * zx - zy) + f * (1.0 - xy * yx)) / whole
    s.x += dt * s.u
    s.y += dt * s.v
    s.z += dt * s.w
    rate = math.sqrt(s.p * s.p + s.q * s.q + s.r * s.r)
    if rate > 0.0:
        c, d = math.cos(0.5 * rate * dt), math.sin(0.5 * rate * dt) / rate
        a, b, e = d * s.p, d * s.q, d * s.r
        w, x, y, z = s.qw, s.qx, s.qy, s.qz
        w, x, y, z = (
            c * w - a * x - b * y - e * z,
            c * x + a * w + e * y - b * z,
            c * y + b * w + a * z - e * x,
            c * z + e * w + b * x - a * y,
        )
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        s.qw, s.qx, s.qy, s.qz = w / norm, x / norm, y / norm, z / norm
