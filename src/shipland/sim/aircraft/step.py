"""The aircraft's step: gimbal, senses, inner loop, rotors and air at each tick, the rigid body at each physics step.

Away from the deck `fly_free` flies it for many steps in one call. Near it `tick` is called once a tick, and MuJoCo,
whose step `step_body` repeats, moves the body among its contacts.
"""

from __future__ import annotations

import math

from shipland.compiled import compiled
from shipland.frames import GRAVITY_MPS2 as G
from shipland.frames import Array
from shipland.sim.aircraft.loops import control
from shipland.sim.aircraft.record import Constants, Records, State
from shipland.sim.aircraft.rotors import feel_ground, mix, stop, turn_rotors
from shipland.sim.aircraft.sensors import sense, step_gimbal

SAFE_UPRIGHT = 0.5
"""Cosine of the tilt beyond which the flight is not free: MuJoCo flies it."""


@compiled
def fly_free(states: Records, constants: Records, noise: Array, phase: int, every: int, count: int) -> int:
    """Step `count` physics steps, fewer when it gets too low or too tilted; how many were stepped.

    Args:
        states: of the aircraft.
        constants: likewise.
        noise: standard normal numbers of the gimbal, two for each tick.
        phase: physics steps since the last tick.
        every: physics steps of a tick.
        count: physics steps.
    """
    s, k = states[0], constants[0]
    used = 0
    for step in range(count):
        if (phase + step) % every == 0:
            upright = 1.0 - 2.0 * (s.qx * s.qx + s.qy * s.qy)
            if s.z > k.lowest_z or upright < SAFE_UPRIGHT:
                return step
            step_gimbal(s, k, noise[used], noise[used + 1])
            used += 2
            sense(s, k)
            control(s, k)
            mix(s, k)
            feel_ground(s, k)
            turn_rotors(s, k)
        step_body(s, k)
        s.deck_s += k.step_s
    return count


@compiled
def tick(states: Records, constants: Records, noise: Array, motors_run: bool) -> None:
    """One tick of the packaged aircraft; afterwards its wrench stands in the record.

    Args:
        states: of the aircraft.
        constants: likewise.
        noise: (2,) standard normal numbers of the gimbal.
        motors_run: whether the inner loop still has rotors to command.
    """
    s, k = states[0], constants[0]
    step_gimbal(s, k, noise[0], noise[1])
    sense(s, k)
    if motors_run:
        control(s, k)
        mix(s, k)
    else:
        stop(s)
    feel_ground(s, k)
    turn_rotors(s, k)


@compiled
def tick_senses(states: Records, constants: Records, noise: Array) -> None:
    """The part of `tick` that an aircraft of one's own does not do itself: gimbal and senses."""
    step_gimbal(states[0], constants[0], noise[0], noise[1])
    sense(states[0], constants[0])


@compiled
def sense_once(states: Records, constants: Records) -> None:
    """`sense` of the first of the records, for a caller in Python."""
    sense(states[0], constants[0])


@compiled
def step_body(s: State, k: Constants) -> None:
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
