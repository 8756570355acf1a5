"""Free flight compiled: gimbal, sensors, packaged inner loops, rotors, air and rigid body, many steps in one call.

The readable classes are the reference: `Gimbal`, `Senses`, `Stabiliser`, `PlaceHold`, `AttitudeLoop`, `VelocityLoop`,
`Quadrotor`, and MuJoCo for the rigid body, whose step this repeats. Names are theirs; a test flies
both. `FreeFlight` in `sim.free` carries their state in and out. Records hold plain floats [SI, rad], frames as there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shipland.compiled import compiled
from shipland.frames import GRAVITY_MPS2 as G
from shipland.frames import rows_from_quaternion

SAFE_UPRIGHT = 0.5
"""Cosine of the tilt beyond which `World` steps in Python instead of compiled code."""

MOTION = ("x", "y", "z", "qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r")
WRENCH = ("force_n", "force_e", "force_d", "moment_x", "moment_y", "moment_z")
THRUSTS = ("thrust_a", "thrust_b", "thrust_c", "thrust_d")
GIMBAL = ("gimbal_pitch", "gimbal_rate", "gimbal_roll_noise", "gimbal_pitch_noise")
SENSES = ("error_n", "error_e", "error_d", "stray_n", "stray_e", "drift", "roll_bias", "pitch_bias", "heading_bias")
SENSED = (
    *("north", "east", "down", "v_north", "v_east", "v_down"),
    *("roll", "pitch", "heading", "roll_rate", "pitch_rate", "yaw_rate"),
)
STABILISER = ("climb_ref", "down_ref", "climb_integral", "yaw_rate_ref", "yaw_ref", "heading_ref")
TRACKER = ("wind_n", "wind_e")
REFERENCE = ("held", "place_n", "place_e", "ref_n", "ref_e", "rate_n", "rate_e")
"""Place and velocity reference: of `PlaceHold`, or of `VelocityLoop`."""
TRIM = ("trim_n", "trim_e", "slow_n", "slow_e")
LOOP = (*STABILISER, *TRACKER, *REFERENCE, *TRIM)
INPUTS = ("stick_pitch", "stick_roll", "stick_heave", "stick_yaw", "gimbal_wanted", "air_n", "air_e", "air_d")
DECK = (
    *("deck_x", "deck_y", "deck_z", "deck_u", "deck_v", "deck_w", "deck_au", "deck_av", "deck_aw"),
    *("deck_roll", "deck_pitch", "deck_yaw", "deck_p", "deck_q", "deck_r", "deck_ap", "deck_aq", "deck_ar", "deck_s"),
)
"""Origin, velocity, acceleration, angles, rates, accelerations, and how long ago that was."""

STATE = (*MOTION, *WRENCH, *THRUSTS, *GIMBAL, *SENSES, *SENSED, *LOOP)
STATE_TYPE = np.dtype([(name, float) for name in (*STATE, *INPUTS, *DECK)])


@compiled
def fly_free(states: Any, constants: Any, noise: Any, phase: int, count: int) -> int:  # noqa: ANN401 - records
    """Step `count` physics steps, fewer when it gets too low or too tilted; how many were stepped.

    Args:
        states: (1,) of `STATE_TYPE`.
        constants: (1,) record of `sim.free`.
        noise: standard normal numbers of the gimbal, two for each control tick.
        phase: physics steps since the last control tick.
        count: physics steps.
    """
    s, k = states[0], constants[0]
    used = 0
    for step in range(count):
        if (phase + step) % 2 == 0:
            upright = 1.0 - 2.0 * (s.qx * s.qx + s.qy * s.qy)
            if s.z > k.lowest_z or upright < SAFE_UPRIGHT:
                return step
            _step_gimbal(s, k, noise[used], noise[used + 1])
            used += 2
            _sense(s, k)
            _control(s, k)
        _step_body(s, k)
        s.deck_s += k.step_s
    return count


@compiled
def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@compiled
def _step_gimbal(s: Any, k: Any, first: float, second: float) -> None:  # noqa: ANN401
    wanted = _clip(s.gimbal_wanted, k.gimbal_min, k.gimbal_max)
    change = _clip(wanted - s.gimbal_pitch, -k.gimbal_most, k.gimbal_most)
    s.gimbal_pitch += change
    s.gimbal_rate = change / k.tick_s
    s.gimbal_roll_noise = k.gimbal_keep * s.gimbal_roll_noise + k.gimbal_add * first
    s.gimbal_pitch_noise = k.gimbal_keep * s.gimbal_pitch_noise + k.gimbal_add * second


@compiled
def _sense(s: Any, k: Any) -> None:  # noqa: ANN401
    s.stray_n += s.error_n * k.tick_s
    s.stray_e += s.error_e * k.tick_s
    sine = _clip(2.0 * (s.qw * s.qy - s.qz * s.qx), -1.0, 1.0)
    s.north, s.east, s.down = s.x + s.stray_n, s.y + s.stray_e, s.z - s.drift
    s.v_north, s.v_east, s.v_down = s.u + s.error_n, s.v + s.error_e, s.w + s.error_d
    s.roll = s.roll_bias + math.atan2(2.0 * (s.qw * s.qx + s.qy * s.qz), 1.0 - 2.0 * (s.qx * s.qx + s.qy * s.qy))
    s.pitch = s.pitch_bias + math.asin(sine)
    s.heading = s.heading_bias + math.atan2(2.0 * (s.qw * s.qz + s.qx * s.qy), 1.0 - 2.0 * (s.qy * s.qy + s.qz * s.qz))
    s.roll_rate, s.pitch_rate, s.yaw_rate = s.p, s.q, s.r


@compiled
def _control(s: Any, k: Any) -> None:  # noqa: ANN401
    lift = _lift(s, k)
    released = 100.0 * max(abs(s.stick_pitch), abs(s.stick_roll)) < k.hold_below
    if k.velocity_kind > 0.0:
        push_n, push_e = _velocity_push(s, k, lift, released)
        roll_ref, pitch_ref = _tilt(push_n, push_e, lift, s.heading)
    else:
        trim_n, trim_e = 0.0, 0.0
        if k.trim_s > 0.0:
            trim_n, trim_e = _wind_trim(s, k)
        if released:
            push_n, push_e = _hold_push(s, k, lift)
            roll_ref, pitch_ref = _tilt(push_n, push_e, lift, s.heading)
        else:
            s.held = 0.0
            roll_ref, pitch_ref = s.stick_roll * k.max_tilt, -s.stick_pitch * k.max_tilt
            if k.trim_s > 0.0:
                c, d = math.cos(s.heading), math.sin(s.heading)
                forward, right = lift * math.tan(s.stick_pitch * k.max_tilt), lift * math.tan(s.stick_roll * k.max_tilt)
                push_n, push_e = c * forward - d * right + trim_n, d * forward + c * right + trim_e
                scale = min(1.0, lift * k.max_slope / max(math.hypot(push_n, push_e), 1e-9))
                roll_ref, pitch_ref = _tilt(push_n * scale, push_e * scale, lift, s.heading)
    _turn_rotors(s, k, lift, roll_ref, pitch_ref)


@compiled
def _lift(s: Any, k: Any) -> float:  # noqa: ANN401
    rate = _clip((s.stick_heave * k.max_climb - s.climb_ref) / k.climb_time_s, -k.climb_mps2, k.climb_mps2)
    s.climb_ref += rate * k.tick_s
    s.down_ref -= s.climb_ref * k.tick_s
    off = _clip(s.down_ref - s.down, -0.25, 0.25)
    s.down_ref = s.down + off
    error = s.climb_ref - k.height_per_s * off + s.v_down
    climb = rate + k.climb_per_s * error + s.climb_integral
    if abs(climb) > 0.6 * G:
        climb = math.copysign(0.6 * G, climb)
    else:
        s.climb_integral = _clip(s.climb_integral + k.climb_integral_per_s2 * error * k.tick_s, -0.4 * G, 0.4 * G)
    return float(G + climb)


@compiled
def _tilt(push_n: float, push_e: float, lift: float, heading: float) -> tuple[float, float]:
    c, d = math.cos(heading), math.sin(heading)
    pitch = -math.atan2(c * push_n + d * push_e, lift)
    return math.atan2((c * push_e - d * push_n) * math.cos(pitch), lift), pitch


@compiled
def _track(s: Any, k: Any, off_n: float, off_e: float, most: float) -> tuple[float, float]:  # noqa: ANN401
    drag = k.rotor_drag + k.body_drag * math.hypot(s.ref_n, s.ref_e)
    error_n = s.ref_n + k.position_per_s * off_n - s.v_north
    error_e = s.ref_e + k.position_per_s * off_e - s.v_east
    push_n = s.rate_n + drag * s.ref_n + k.velocity_per_s * error_n + s.wind_n
    push_e = s.rate_e + drag * s.ref_e + k.velocity_per_s * error_e + s.wind_e
    push = math.hypot(push_n, push_e)
    if push > most:
        return push_n * most / push, push_e * most / push
    gain = k.velocity_integral_per_s2 * k.tick_s
    s.wind_n += gain * error_n
    s.wind_e += gain * error_e
    return push_n, push_e


@compiled
def _hold_push(s: Any, k: Any, lift: float) -> tuple[float, float]:  # noqa: ANN401
    if s.held == 0.0:
        s.held = 1.0
        s.place_n, s.place_e = s.north, s.east
        s.ref_n, s.ref_e = s.v_north, s.v_east
        s.rate_n, s.rate_e = 0.0, 0.0
    brake = min(1.0 / k.brake_time_s, k.brake_mps2 / max(math.hypot(s.ref_n, s.ref_e), 1e-9))
    s.rate_n -= k.tilt_settle * (brake * s.ref_n + s.rate_n)
    s.rate_e -= k.tilt_settle * (brake * s.ref_e + s.rate_e)
    s.ref_n += s.rate_n * k.tick_s
    s.ref_e += s.rate_e * k.tick_s
    s.place_n += s.ref_n * k.tick_s
    s.place_e += s.ref_e * k.tick_s
    return _track(s, k, s.place_n - s.north, s.place_e - s.east, lift * k.max_slope)


@compiled
def _velocity_push(s: Any, k: Any, lift: float, released: bool) -> tuple[float, float]:  # noqa: ANN401
    wanted_n, wanted_e = 0.0, 0.0
    if not released:
        c, d = math.cos(s.heading), math.sin(s.heading)
        forward, right = s.stick_pitch * k.max_speed, s.stick_roll * k.max_speed
        wanted_n, wanted_e = c * forward - d * right, d * forward + c * right
    rise_n, rise_e = (wanted_n - s.ref_n) / k.velocity_time_s, (wanted_e - s.ref_e) / k.velocity_time_s
    scale = min(1.0, k.acceleration_mps2 / max(math.hypot(rise_n, rise_e), 1e-9))
    s.rate_n += k.tilt_settle * (scale * rise_n - s.rate_n)
    s.rate_e += k.tilt_settle * (scale * rise_e - s.rate_e)
    s.ref_n += s.rate_n * k.tick_s
    s.ref_e += s.rate_e * k.tick_s
    off_n, off_e = 0.0, 0.0
    if not released or (s.held == 0.0 and math.hypot(s.ref_n, s.ref_e) > k.hold_mps):
        s.held = 0.0
    else:
        if s.held == 0.0:
            s.held, s.place_n, s.place_e = 1.0, s.north, s.east
        s.place_n += s.ref_n * k.tick_s
        s.place_e += s.ref_e * k.tick_s
        off_n, off_e = s.place_n - s.north, s.place_e - s.east
    return _track(s, k, off_n, off_e, lift * k.max_slope)


@compiled
def _wind_trim(s: Any, k: Any) -> tuple[float, float]:  # noqa: ANN401
    c, d = math.cos(s.heading), math.sin(s.heading)
    forward = -G * math.tan(s.pitch)
    right = G * math.tan(s.roll) / max(math.cos(s.pitch), 0.5)
    drag = k.rotor_drag + k.body_drag * math.hypot(s.v_north, s.v_east)
    s.trim_n += k.trim_share * (c * forward - d * right - drag * s.v_north - s.trim_n)
    s.trim_e += k.trim_share * (d * forward + c * right - drag * s.v_east - s.trim_e)
    s.slow_n += k.trim_share * (s.v_north - s.slow_n)
    s.slow_e += k.trim_share * (s.v_east - s.slow_e)
    return s.trim_n - (s.v_north - s.slow_n) / k.trim_s, s.trim_e - (s.v_east - s.slow_e) / k.trim_s


@compiled
def _heading_rate(s: Any, k: Any) -> float:  # noqa: ANN401
    most = k.yaw_rad_s2 * k.tick_s
    change = _clip(s.stick_yaw * k.max_yaw_rate - s.yaw_rate_ref, -most, most)
    s.yaw_rate_ref += change
    s.yaw_ref = change / k.tick_s
    off = (s.heading_ref + s.yaw_rate_ref * k.tick_s - s.heading + math.pi) % (2.0 * math.pi) - math.pi
    off = _clip(off, -0.3, 0.3)
    s.heading_ref = s.heading + off
    return float(s.yaw_rate_ref + k.heading_per_s * off)


@compiled
def _turn_rotors(s: Any, k: Any, lift: float, roll_ref: float, pitch_ref: float) -> None:  # noqa: ANN401
    """Attitude and rate loops, mixer, rotors, air and ground effect: the wrench until the next tick."""
    cr, sr, cp, sp = math.cos(s.roll), math.sin(s.roll), math.cos(s.pitch), math.sin(s.pitch)
    thrust = k.mass * lift / max(cr * cp, 0.5)
    turn = _heading_rate(s, k)
    roll_rate = _clip(k.attitude_per_s * (roll_ref - s.roll), -k.max_tilt_rate, k.max_tilt_rate)
    pitch_rate = _clip(k.attitude_per_s * (pitch_ref - s.pitch), -k.max_tilt_rate, k.max_tilt_rate)
    roll_nm = k.inertia_x * k.rate_per_s * (roll_rate - turn * sp - s.roll_rate)
    pitch_nm = k.inertia_y * k.rate_per_s * (pitch_rate * cr + turn * sr * cp - s.pitch_rate)
    yaw_nm = k.inertia_z * (k.yaw_rate_per_s * (turn * cr * cp - pitch_rate * sr - s.yaw_rate) + s.yaw_ref)

    share = _clip(0.25 * thrust, 1.5 * k.low_n, 0.9 * k.top_n)
    room = min(share - k.low_n, k.top_n - share)
    roll, pitch = -0.25 * roll_nm / k.motor_right, 0.25 * pitch_nm / k.motor_forward
    tilt = abs(roll) + abs(pitch)
    if tilt > room:
        roll, pitch, tilt = roll * room / tilt, pitch * room / tilt, room
    yaw = _clip(0.25 * yaw_nm / k.torque_per_thrust, tilt - room, room - tilt)
    a, e = _clip(share + roll + pitch + yaw, 0.0, k.top_n), s.thrust_a
    b, f = _clip(share - roll + pitch - yaw, 0.0, k.top_n), s.thrust_b
    c, g = _clip(share + roll - pitch - yaw, 0.0, k.top_n), s.thrust_c
    d, h = _clip(share - roll - pitch + yaw, 0.0, k.top_n), s.thrust_d
    total = e + f + g + h
    s.thrust_a, s.thrust_b = e - k.settle * (e - a), f - k.settle * (f - b)
    s.thrust_c, s.thrust_d = g - k.settle * (g - c), h - k.settle * (h - d)
    a, b, c, d = a + k.mean * (e - a), b + k.mean * (f - b), c + k.mean * (g - c), d + k.mean * (h - d)
    s.moment_z = k.torque_per_thrust * (a - b - c + d)

    m = _rows(s.qw, s.qx, s.qy, s.qz)
    u, v, w = s.u - s.air_n, s.v - s.air_e, s.w - s.air_d
    axial = m[2] * u + m[5] * v + m[8] * w
    plane = k.rotor_drag * math.sqrt(max(total, 0.0) / (4.0 * k.hover_n))
    along = (k.inflow_loss * math.sqrt(max(total, 0.0) / (4.0 * k.hover_n)) - plane) * axial
    drag = plane + k.body_drag * math.sqrt(u * u + v * v + w * w)
    if k.ground_effect > 0.0:
        gain_a, gain_b, gain_c, gain_d = _ground_gains(s, k, m)
        a, b, c, d = a * gain_a, b * gain_b, c * gain_c, d * gain_d
    lifting = a + b + c + d
    s.moment_x = k.motor_right * (b + d - a - c)
    s.moment_y = k.motor_forward * (a + b - c - d)
    s.force_n = -k.mass * (drag * u + along * m[2]) - lifting * m[2]
    s.force_e = -k.mass * (drag * v + along * m[5]) - lifting * m[5]
    s.force_d = -k.mass * (drag * w + along * m[8]) - lifting * m[8]


_rows = compiled(rows_from_quaternion)


@compiled
def _ground_gains(s: Any, k: Any, m: Any) -> tuple[float, float, float, float]:  # noqa: ANN401
    """Ground-effect gains of the four rotors over the deck, extrapolated by its velocity and acceleration."""
    t, h = s.deck_s, 0.5 * s.deck_s * s.deck_s
    x = s.x - s.deck_x - t * s.deck_u - h * s.deck_au
    y = s.y - s.deck_y - t * s.deck_v - h * s.deck_av
    z = s.z - s.deck_z - t * s.deck_w - h * s.deck_aw
    if x * x + y * y + z * z >= k.near_deck * k.near_deck:
        return 1.0, 1.0, 1.0, 1.0
    roll, pitch = s.deck_roll + t * s.deck_p + h * s.deck_ap, s.deck_pitch + t * s.deck_q + h * s.deck_aq
    yaw = s.deck_yaw + t * s.deck_r + h * s.deck_ar
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    fx, fy, fz = cy * cp, sy * cp, -sp
    rx, ry, rz = cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr
    dx, dy, dz = cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr
    gains = np.ones(4)
    for i in range(4):
        forward = k.motor_forward if i < 2 else -k.motor_forward
        right = k.motor_right if i % 2 == 0 else -k.motor_right
        a = x + m[0] * forward + m[1] * right - m[2] * k.motor_above
        b = y + m[3] * forward + m[4] * right - m[5] * k.motor_above
        c = z + m[6] * forward + m[7] * right - m[8] * k.motor_above
        below = -(dx * a + dy * b + dz * c)
        inside = abs(fx * a + fy * b + fz * c) < k.half_deck and abs(rx * a + ry * b + rz * c) < k.half_deck
        if inside and below > 0.0:
            ratio = k.rotor_radius / (4.0 * max(below, 0.5 * k.rotor_radius))
            gains[i] = 1.0 / (1.0 - ratio * ratio)
    return gains[0], gains[1], gains[2], gains[3]


@compiled
def _step_body(s: Any, k: Any) -> None:  # noqa: ANN401
    """MuJoCo's `implicitfast`: velocities first, gyroscopic moment implicit; then places by new velocities."""
    dt = k.step_s
    s.u += dt * s.force_n / k.mass
    s.v += dt * s.force_e / k.mass
    s.w += dt * (s.force_d / k.mass + G)
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
