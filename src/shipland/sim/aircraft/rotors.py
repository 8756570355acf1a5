"""Mixer, rotors with a lag, the air, ground effect: from a demand to the wrench, over the aircraft's record."""

from __future__ import annotations

from shipland.compiled import compiled
from shipland.frames import Rows
from shipland.sim.aircraft.aerodynamics import air_force_in_ned_n, ground_effect_gain
from shipland.sim.aircraft.loop_laws import clip
from shipland.sim.aircraft.record import Constants, Records, State
from shipland.sim.rotations import rows_of_euler, rows_of_quaternion


@compiled
def mix(s: State, k: Constants) -> None:
    """Thrusts of the rotors; what exceeds their range goes first from yaw, then from roll and pitch."""
    share = clip(0.25 * s.demand_n, 1.5 * k.low_n, 0.9 * k.top_n)
    room = min(share - k.low_n, k.top_n - share)
    roll, pitch = -0.25 * s.demand_roll / k.motor_right, 0.25 * s.demand_pitch / k.motor_forward
    tilt = abs(roll) + abs(pitch)
    if tilt > room:
        roll, pitch, tilt = roll * room / tilt, pitch * room / tilt, room
    yaw = clip(0.25 * s.demand_yaw / k.torque_per_thrust, tilt - room, room - tilt)
    s.asked_a = share + roll + pitch + yaw
    s.asked_b = share - roll + pitch - yaw
    s.asked_c = share + roll - pitch - yaw
    s.asked_d = share - roll - pitch + yaw


@compiled
def stop(s: State) -> None:
    """Motors off."""
    s.asked_a, s.asked_b, s.asked_c, s.asked_d = 0.0, 0.0, 0.0, 0.0


@compiled
def turn_rotors(s: State, k: Constants) -> None:
    """The wrench until the next tick: thrusts that follow those asked, drag and inflow loss of the air.

    A rotor's thrust follows with a first-order lag; its mean over the tick acts, less what an unsound rotor loses. Lift
    has the ground effect's gain, torque has not.
    """
    total = s.thrust_a + s.thrust_b + s.thrust_c + s.thrust_d
    a, s.thrust_a = _follow(s.thrust_a, s.asked_a, k)
    b, s.thrust_b = _follow(s.thrust_b, s.asked_b, k)
    c, s.thrust_c = _follow(s.thrust_c, s.asked_c, k)
    d, s.thrust_d = _follow(s.thrust_d, s.asked_d, k)
    a, b, c, d = s.sound_a * a, s.sound_b * b, s.sound_c * c, s.sound_d * d
    s.moment_z = k.torque_per_thrust * (a - b - c + d)
    a, b, c, d = a * s.gain_a, b * s.gain_b, c * s.gain_c, d * s.gain_d
    lift = a + b + c + d
    s.moment_x = k.motor_right * (b + d - a - c)
    s.moment_y = k.motor_forward * (a + b - c - d)
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
    forward, right = k.motor_forward, k.motor_right
    s.gain_a = _gain(k, body, deck, x, y, z, forward, right)
    s.gain_b = _gain(k, body, deck, x, y, z, forward, -right)
    s.gain_c = _gain(k, body, deck, x, y, z, -forward, right)
    s.gain_d = _gain(k, body, deck, x, y, z, -forward, -right)


@compiled
def _gain(k: Constants, body: Rows, deck: Rows, x: float, y: float, z: float, forward: float, right: float) -> float:
    """Gain of the rotor at (forward, right) of a body at (x, y, z) from the deck's centre, in `ned`."""
    a = x + body[0] * forward + body[1] * right - body[2] * k.motor_above
    b = y + body[3] * forward + body[4] * right - body[5] * k.motor_above
    c = z + body[6] * forward + body[7] * right - body[8] * k.motor_above
    above = -(deck[2] * a + deck[5] * b + deck[8] * c)
    ahead, beside = deck[0] * a + deck[3] * b + deck[6] * c, deck[1] * a + deck[4] * b + deck[7] * c
    if abs(ahead) < k.half_deck and abs(beside) < k.half_deck and above > 0.0:
        return ground_effect_gain(above, k.rotor_radius)
    return 1.0


@compiled
def mix_once(states: Records, constants: Records) -> None:
    """`mix` of the first of the records, for a caller in Python."""
    mix(states[0], constants[0])


@compiled
def turn_once(states: Records, constants: Records) -> None:
    """`turn_rotors` of the first of the records, for a caller in Python."""
    turn_rotors(states[0], constants[0])
