"""The aircraft as a record: what evolves (`state`) and what does not (`constants`), as named floats [SI, rad].

Every stage of its step is a function over the two, written once: `sensors`, `loops`, `step`.
Compiled, it flies; run without the compiler (`NUMBA_DISABLE_JIT=1`), it is its own reference, and a test runs both.
Rotors are a, b, c, d: front right, front left, rear right, rear left. Suffixes n, e, d are axes of `ned`; x, y, z of
`body`, forward-right-down.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from shipland.frames import Array, Quaternion
from shipland.sim.aircraft.parameters import AircraftParameters, Vector

State: TypeAlias = Any
"""One record of `STATE_TYPE`."""
Constants: TypeAlias = Any
"""One record of `_constants`."""
Records: TypeAlias = Any
"""(1,) array of either, as Python hands it to compiled code that is called often."""


class RigidBodyState(NamedTuple):
    """Position and velocity of the centre of mass in `ned`, attitude (w, x, y, z) of `body` in `ned`, body rates."""

    position_m: Vector
    quaternion: Quaternion
    velocity_mps: Vector
    rates_rad_s: Vector


class Wrench(NamedTuple):
    """Force [N] in `ned` and moment [Nm] in `body`, about the centre of mass; gravity is not in it."""

    force_in_ned_n: Vector
    moment_in_body_nm: Vector


class Sensed(NamedTuple):
    """What the autopilot believes of itself; never the truth.

    Position and velocity in `ned` over the velocity reference (ground, or the surface that the optical flow sees),
    down from the barometer, Euler angles with the compass's heading, body rates.
    """

    north_m: float
    east_m: float
    down_m: float
    north_mps: float
    east_mps: float
    down_mps: float
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    roll_rate_rad_s: float
    pitch_rate_rad_s: float
    yaw_rate_rad_s: float


_GROUPS = {
    # rigid body: position and velocity of the centre of mass in `ned`, attitude of `body` in it, body rates
    "motion": ("x", "y", "z", "qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r"),
    # held until the next tick: force in `ned` without gravity, moment in `body`
    "wrench": ("force_n", "force_e", "force_d", "moment_x", "moment_y", "moment_z"),
    "thrusts": ("thrust_a", "thrust_b", "thrust_c", "thrust_d"),
    # share of its thrust and torque that a rotor gives; 1 is sound
    "soundness": ("sound_a", "sound_b", "sound_c", "sound_d"),
    "ground_gains": ("gain_a", "gain_b", "gain_c", "gain_d"),
    # the gimbal: pitch as it believes, its rate; residual motion and bias, which it does not know
    "gimbal": ("gimbal_pitch", "gimbal_rate"),
    "gimbal_noise": ("gimbal_roll_noise", "gimbal_pitch_noise"),
    "gimbal_bias": ("gimbal_roll_bias", "gimbal_pitch_bias"),
    # what the autopilot believes of itself
    "sensed": (
        *("north", "east", "down", "v_north", "v_east", "v_down"),
        *("roll", "pitch", "heading", "roll_rate", "pitch_rate", "yaw_rate"),
    ),
    "w_at_tick": ("w_at_tick",),
    # errors of velocity, what its integral has strayed by, the barometer's drift, biases
    "errors": ("error_n", "error_e", "error_d", "stray_n", "stray_e", "drift"),
    "biases": ("roll_bias", "pitch_bias", "heading_bias"),
    # the first-order noises behind them; the surface's velocity as the flow follows it
    "noises": ("noise_n", "noise_e", "noise_d", "flow_n", "flow_e", "wave_n", "wave_e"),
    "seen": ("seen_n", "seen_e", "seeing", "flow_lost"),
    # inner loop: climb and heading references; the push against the wind; place and velocity reference; wind trim
    "climb": ("climb_ref", "down_ref", "climb_integral"),
    "turn": ("yaw_rate_ref", "yaw_ref", "heading_ref"),
    "wind_push": ("wind_n", "wind_e"),
    "reference": ("held", "place_n", "place_e", "ref_n", "ref_e", "rate_n", "rate_e"),
    "trim": ("trim_n", "trim_e", "slow_n", "slow_e"),
    # total thrust and moments that the loop asks for, and the rotors' thrusts that make them
    "demand": ("demand_n", "demand_roll", "demand_pitch", "demand_yaw"),
    "asked": ("asked_a", "asked_b", "asked_c", "asked_d"),
    # what comes from outside: sticks, gimbal pitch commanded, the air's velocity
    "sticks": ("stick_pitch", "stick_roll", "stick_heave", "stick_yaw"),
    "gimbal_wanted": ("gimbal_wanted",),
    "air": ("air_n", "air_e", "air_d"),
    # the deck as it was `deck_s` ago: centre, velocity, acceleration; angles, rates, accelerations; its rotation row by
    # row, its angular velocity (`contact.deck_values`); the ship under it
    "deck": (
        *("deck_x", "deck_y", "deck_z", "deck_u", "deck_v", "deck_w", "deck_au", "deck_av", "deck_aw"),
        *("deck_roll", "deck_pitch", "deck_yaw", "deck_p", "deck_q", "deck_r", "deck_ap", "deck_aq", "deck_ar"),
        *("deck_fn", "deck_rn", "deck_dn", "deck_fe", "deck_re", "deck_de", "deck_fd", "deck_rd", "deck_dd"),
        *("deck_turn_n", "deck_turn_e", "deck_turn_d"),
    ),
    "ship": ("ship_n", "ship_e", "ship_u", "ship_v", "ship_au", "ship_av", "course", "course_rate", "course_bend"),
    "deck_s": ("deck_s",),
}
_NAMES = [name for names in _GROUPS.values() for name in names]


@cache
def _type_of(names: tuple[str, ...]) -> np.dtype[np.void]:
    """The type of a record; one object for the same names, or compiled calls compare it field by field every time."""
    return np.dtype((np.record, [(name, float) for name in names]))


STATE_TYPE = _type_of(tuple(_NAMES))


@cache
def at(group: str) -> slice:
    """Where a group of the state's fields lies in `Record.values`."""
    start = _NAMES.index(_GROUPS[group][0])
    return slice(start, start + len(_GROUPS[group]))


def _constants(parameters: AircraftParameters, tick_s: float) -> dict[str, float]:
    """The numbers of airframe, settings and loop by their names, what follows from them, and, not yet, the world's."""
    frame, settings, gains = parameters.airframe, parameters.settings, parameters.loop
    stated = {**vars(frame), **vars(settings), **vars(gains)}
    settle = -math.expm1(-tick_s / frame.motor_time_s)
    inertia_x, inertia_y, inertia_z = frame.inertia_kgm2
    world = (
        *("step_s", "lowest_z", "near_deck", "half_deck", "gimbal_min", "gimbal_max", "gimbal_most"),
        *("gimbal_keep", "gimbal_add", "noise_keep", "noise_add", "flow_keep", "flow_add", "wave_keep", "wave_add"),
        *("drift_add", "flow_settle", "lose_share", "back_share", "over_ground"),
        *("flow_slope", "water", "water_drift", "stern", "bow", "half_width", "far", "full_ship"),
        *("deck_height", "front", "radius", "foot_below"),
    )
    return (
        dict.fromkeys(world, math.nan)
        | {name: value for name, value in stated.items() if isinstance(value, int | float)}
        | {
            "tick_s": tick_s,
            "inertia_x": inertia_x,
            "inertia_y": inertia_y,
            "inertia_z": inertia_z,
            "settle_share": settle,
            "mean_share": frame.motor_time_s / tick_s * settle,
            "low_n": frame.idle_thrust * frame.hover_thrust_n,
            "hover_n": frame.hover_thrust_n,
            "top_n": frame.top_thrust_n,
            "max_tilt": math.radians(settings.max_tilt_deg),
            "max_yaw_rate": math.radians(settings.max_yaw_rate_deg_s),
            "max_tilt_rate": math.radians(settings.max_tilt_rate_deg_s),
            "velocity_kind": 0.0,
            "trim_share": -math.expm1(-tick_s / gains.wind_trim_s) if gains.wind_trim_s > 0.0 else 0.0,
            "max_slope": math.tan(math.radians(gains.tilt_limit_deg)),
            "tilt_settle": min(1.0, tick_s / gains.tilt_time_s),
        }
    )


class Record:
    """State and constants of one aircraft, whose inner loop has `tick_s` between its ticks."""

    def __init__(self, parameters: AircraftParameters, tick_s: float) -> None:
        constants = _constants(parameters, tick_s)
        self.states: Records = np.zeros(1, STATE_TYPE)
        self.constants: Records = np.array([tuple(constants.values())], _type_of(tuple(constants)))
        self.values: Array = self.states.view(float)
        """The state's fields in their order; `at` says where."""
        for group in ("soundness", "ground_gains"):
            self.values[at(group)] = 1.0

    def set(self, **constants: float) -> None:
        """Set constants by name."""
        for name, value in constants.items():
            self.constants[name] = value

    @property
    def motion(self) -> RigidBodyState:
        """Where it is and how it moves."""
        x, y, z, qw, qx, qy, qz, u, v, w, p, q, r = self.values[_MOTION].tolist()
        return RigidBodyState((x, y, z), (qw, qx, qy, qz), (u, v, w), (p, q, r))

    @property
    def sensed(self) -> Sensed:
        """What the autopilot believed at the last tick."""
        return Sensed(*self.values[_SENSED].tolist())

    @property
    def wrench(self) -> Wrench:
        """Held until the next tick."""
        a, b, c, d, e, f = self.values[_WRENCH].tolist()
        return Wrench((a, b, c), (d, e, f))


_MOTION, _SENSED, _WRENCH = at("motion"), at("sensed"), at("wrench")
