"""Inner loops: what an autopilot takes and gives, and the packaged ones, which say what a pitch or roll stick means.

Kind `attitude`: a tilt against the horizon, as an ANAFI flies a PCMD with its flag set, and nothing else: a gust pushes
the aircraft, and it drifts with the wind. Released sticks (PCMD's flag 0) brake and hold the place. Source: Parrot
staff, developer forum, thread 12864, "Understanding anafi inner loop control and PCMD commands".

Kind `velocity`: a velocity set-point, tracked inside, as PX4's OFFBOARD and ArduPilot's guided velocity: over the
velocity reference (`aircraft.loop.velocity_reference`), ground or the surface that the optical flow sees. Released
sticks brake and, below `HOLD_MPS`, hold the place.

Their laws are functions over the aircraft's record (`record`): they advance its references by one tick. Angles and
pushes are against the horizon; lift and push are accelerations [m/s²] that thrust must give, upward and (north, east).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from shipland.compiled import compiled
from shipland.frames import GRAVITY_MPS2 as G
from shipland.sim.aircraft.parameters import AircraftParameters, Vector
from shipland.sim.aircraft.record import Constants, Record, Records, Sensed, State, at


@compiled
def clip(value: float, low: float, high: float) -> float:
    """The nearest value in low … high."""
    return min(max(value, low), high)


@compiled
def lift_mps2(s: State, k: Constants) -> float:
    """Climb loop: the lift, gravity included.

    The climb reference follows the stick with a limited acceleration, rate = clip((stick - ref) / T, ±a). With the
    error e = ref - k_h (down_ref - down) + v_down, lift = g + rate + k_c e + k_i ∫ e; the integral stands still while
    the climb is at its limit of 0.6 g.
    """
    rate = clip((s.stick_heave * k.max_vertical_speed_mps - s.climb_ref) / k.climb_time_s, -k.climb_mps2, k.climb_mps2)
    s.climb_ref += rate * k.tick_s
    # The height reference runs with the climb reference but never far from the aircraft, so that a deck under the feet
    # or a saturated rotor does not wind it up.
    s.down_ref -= s.climb_ref * k.tick_s
    off = clip(s.down_ref - s.down, -0.25, 0.25)
    s.down_ref = s.down + off
    error = s.climb_ref - k.height_per_s * off + s.v_down
    climb = rate + k.climb_per_s * error + s.climb_integral
    if abs(climb) > 0.6 * G:
        climb = math.copysign(0.6 * G, climb)
    else:
        s.climb_integral = clip(s.climb_integral + k.climb_integral_per_s2 * error * k.tick_s, -0.4 * G, 0.4 * G)
    return float(G + climb)


@compiled
def heading_rate_rad_s(s: State, k: Constants) -> float:
    """Yaw loop: the rate of heading that holds or turns the heading reference.

    The rate reference follows the stick with a limited acceleration; the heading reference runs with it, never more
    than 0.3 rad away; rate = ref + k (heading_ref - heading).
    """
    most = k.yaw_rad_s2 * k.tick_s
    change = clip(s.stick_yaw * k.max_yaw_rate - s.yaw_rate_ref, -most, most)
    s.yaw_rate_ref += change
    s.yaw_ref = change / k.tick_s
    off = (s.heading_ref + s.yaw_rate_ref * k.tick_s - s.heading + math.pi) % (2.0 * math.pi) - math.pi
    off = clip(off, -0.3, 0.3)
    s.heading_ref = s.heading + off
    return float(s.yaw_rate_ref + k.heading_per_s * off)


@compiled
def demand_attitude(s: State, k: Constants, lift: float, roll_ref: float, pitch_ref: float) -> None:
    """Attitude and rate loops: thrust and moments that reach a roll and a pitch.

    Thrust = m lift / (cos roll cos pitch). Euler rates k_a (ref - angle), limited, and the heading's give the body
    rates (p, q, r) wanted; moment = inertia · k_r (wanted - sensed).
    """
    cr, sr, cp, sp = math.cos(s.roll), math.sin(s.roll), math.cos(s.pitch), math.sin(s.pitch)
    turn = heading_rate_rad_s(s, k)
    roll_rate = clip(k.attitude_per_s * (roll_ref - s.roll), -k.max_tilt_rate, k.max_tilt_rate)
    pitch_rate = clip(k.attitude_per_s * (pitch_ref - s.pitch), -k.max_tilt_rate, k.max_tilt_rate)
    p, q, r = roll_rate - turn * sp, pitch_rate * cr + turn * sr * cp, turn * cr * cp - pitch_rate * sr
    s.demand_n = k.mass_kg * lift / max(cr * cp, 0.5)
    s.demand_roll = k.inertia_x * k.rate_per_s * (p - s.roll_rate)
    s.demand_pitch = k.inertia_y * k.rate_per_s * (q - s.pitch_rate)
    s.demand_yaw = k.inertia_z * (k.yaw_rate_per_s * (r - s.yaw_rate) + s.yaw_ref)


@compiled
def tilt_of(push_n: float, push_e: float, lift: float, heading_rad: float) -> tuple[float, float]:
    """Roll and pitch [rad] that give a push beside a lift."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    pitch = -math.atan2(c * push_n + s * push_e, lift)
    return math.atan2((c * push_e - s * push_n) * math.cos(pitch), lift), pitch


@compiled
def velocity_push(s: State, k: Constants, off_n: float, off_e: float, most: float) -> tuple[float, float]:
    """Velocity tracker: the push, at most `most`, that follows the velocity reference v.

    push = dv/dt + drag(v) + k_v e + k_i ∫ e with e = v + k_p · off - v_sensed, and the nominal drag of still air. The
    integral is the push that the wind asks for; it stands still while the push is at its limit. `off` is reference
    place minus sensed place [m]; (0, 0) holds no place.
    """
    drag = k.rotor_drag_per_s + k.body_drag_per_m * math.hypot(s.ref_n, s.ref_e)
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
def advance_reference(s: State, k: Constants) -> None:
    """Velocity and place references by their rates over one tick: v += dv/dt · T, place += v · T."""
    s.ref_n += s.rate_n * k.tick_s
    s.ref_e += s.rate_e * k.tick_s
    s.place_n += s.ref_n * k.tick_s
    s.place_e += s.ref_e * k.tick_s


@compiled
def hold_push(s: State, k: Constants, most: float) -> tuple[float, float]:
    """Released sticks: brake from the present velocity and hold the place where the brake ends.

    dv/dt = -min(1/T, a/|v|) v, smoothed as the tilt follows; the place reference runs with v.
    """
    if s.held == 0.0:
        s.held = 1.0
        s.place_n, s.place_e = s.north, s.east
        s.ref_n, s.ref_e = s.v_north, s.v_east
        s.rate_n, s.rate_e = 0.0, 0.0
    brake = min(1.0 / k.brake_time_s, k.brake_mps2 / max(math.hypot(s.ref_n, s.ref_e), 1e-9))
    s.rate_n -= k.tilt_settle * (brake * s.ref_n + s.rate_n)
    s.rate_e -= k.tilt_settle * (brake * s.ref_e + s.rate_e)
    advance_reference(s, k)
    return velocity_push(s, k, s.place_n - s.north, s.place_e - s.east, most)


class Sticks(NamedTuple):
    """Stick positions, -1 … 1: forward, right, up, clockwise positive."""

    pitch: float
    roll: float
    heave: float
    yaw: float


CENTRED = Sticks(0.0, 0.0, 0.0, 0.0)


class Demand(NamedTuple):
    """Total thrust along body up [N] and moments about body forward, right and down [Nm]."""

    thrust_n: float
    roll_nm: float
    pitch_nm: float
    yaw_nm: float


@dataclass(frozen=True)
class LoopSetup:
    """What an inner loop is built from.

    Attributes:
        parameters: the aircraft.
        step_s: time between updates [s].
        sensed: where it starts, hovering.
        push_in_ned_mps2: acceleration that thrust gives against the wind's drag there.
        record: the aircraft's, in which the packaged loops keep their state.
    """

    parameters: AircraftParameters
    step_s: float
    sensed: Sensed
    push_in_ned_mps2: Vector
    record: Record


class InnerLoop(Protocol):
    """The autopilot's law; a factory of the group `loops` makes it from a `LoopSetup`."""

    def update(self, sensed: Sensed, sticks: Sticks) -> Demand:
        """Advance by one step."""


HOLD_MPS = 0.2
"""Kind `velocity`: reference speed under which released sticks hold the place."""


@compiled
def control(states: Records, constants: Records) -> None:
    """One tick of the inner loop: from what is sensed and the sticks to thrust and moments."""
    s, k = states[0], constants[0]
    lift = lift_mps2(s, k)
    released = 100.0 * max(abs(s.stick_pitch), abs(s.stick_roll)) < k.hold_below_percent
    if k.velocity_kind > 0.0:
        push_n, push_e = _velocity_stick(s, k, lift, released)
        roll_ref, pitch_ref = tilt_of(push_n, push_e, lift, s.heading)
    else:
        roll_ref, pitch_ref = _tilt_stick(s, k, lift, released)
    demand_attitude(s, k, lift, roll_ref, pitch_ref)


@compiled
def _tilt_stick(s: State, k: Constants, lift: float, released: bool) -> tuple[float, float]:
    """Kind `attitude`: the tilt of the stick, with a wind trim its push and the wind's; released, a place hold."""
    trim_n, trim_e = 0.0, 0.0
    if k.wind_trim_s > 0.0:
        trim_n, trim_e = _wind_trim(s, k)
    if released:
        push_n, push_e = hold_push(s, k, lift * k.max_slope)
        return tilt_of(push_n, push_e, lift, s.heading)
    s.held = 0.0
    if k.wind_trim_s <= 0.0:
        return s.stick_roll * k.max_tilt, -s.stick_pitch * k.max_tilt
    cosine, sine = math.cos(s.heading), math.sin(s.heading)
    forward, right = lift * math.tan(s.stick_pitch * k.max_tilt), lift * math.tan(s.stick_roll * k.max_tilt)
    push_n, push_e = cosine * forward - sine * right + trim_n, sine * forward + cosine * right + trim_e
    scale = min(1.0, lift * k.max_slope / max(math.hypot(push_n, push_e), 1e-9))
    return tilt_of(push_n * scale, push_e * scale, lift, s.heading)


@compiled
def _wind_trim(s: State, k: Constants) -> tuple[float, float]:
    """Slow estimate of the push that the wind asks for, from the aircraft's own tilt and velocity.

    With f = (thrust's horizontal push) - (still air's drag at the sensed velocity), f - dv/dt is the wind's share; a
    first-order low-pass of it needs no derivative: LP[f] - (v - LP[v]) / T.
    """
    cosine, sine = math.cos(s.heading), math.sin(s.heading)
    forward = -G * math.tan(s.pitch)
    right = G * math.tan(s.roll) / max(math.cos(s.pitch), 0.5)
    drag = k.rotor_drag_per_s + k.body_drag_per_m * math.hypot(s.v_north, s.v_east)
    s.trim_n += k.trim_share * (cosine * forward - sine * right - drag * s.v_north - s.trim_n)
    s.trim_e += k.trim_share * (sine * forward + cosine * right - drag * s.v_east - s.trim_e)
    s.slow_n += k.trim_share * (s.v_north - s.slow_n)
    s.slow_e += k.trim_share * (s.v_east - s.slow_e)
    return s.trim_n - (s.v_north - s.slow_n) / k.wind_trim_s, s.trim_e - (s.v_east - s.slow_e) / k.wind_trim_s


@compiled
def _velocity_stick(s: State, k: Constants, lift: float, released: bool) -> tuple[float, float]:
    """Kind `velocity`: the push that tracks the reference, which follows the set-point.

    dv/dt = min(1, a/|rise|) · rise with rise = (set-point - v) / T, smoothed as the tilt follows.
    """
    wanted_n, wanted_e = 0.0, 0.0
    if not released:
        cosine, sine = math.cos(s.heading), math.sin(s.heading)
        forward, right = s.stick_pitch * k.max_speed_mps, s.stick_roll * k.max_speed_mps
        wanted_n, wanted_e = cosine * forward - sine * right, sine * forward + cosine * right
    rise_n, rise_e = (wanted_n - s.ref_n) / k.velocity_time_s, (wanted_e - s.ref_e) / k.velocity_time_s
    scale = min(1.0, k.acceleration_mps2 / max(math.hypot(rise_n, rise_e), 1e-9))
    s.rate_n += k.tilt_settle * (scale * rise_n - s.rate_n)
    s.rate_e += k.tilt_settle * (scale * rise_e - s.rate_e)
    if s.held == 0.0:
        s.place_n, s.place_e = s.north, s.east
    advance_reference(s, k)
    s.held = 1.0 if released and (s.held > 0.0 or math.hypot(s.ref_n, s.ref_e) <= HOLD_MPS) else 0.0
    if s.held == 0.0:
        return velocity_push(s, k, 0.0, 0.0, lift * k.max_slope)
    return velocity_push(s, k, s.place_n - s.north, s.place_e - s.east, lift * k.max_slope)


class AttitudeLoop:
    """The inner loop of kind `attitude`, over the record of its aircraft."""

    _VELOCITY_KIND = 0.0

    def __init__(self, setup: LoopSetup) -> None:
        self._record = setup.record
        sensed, (push_n, push_e, push_d) = setup.sensed, setup.push_in_ned_mps2
        self._record.set(velocity_kind=self._VELOCITY_KIND)
        values = self._record.values
        values[at("climb")] = (0.0, sensed.down_m, -push_d)
        values[at("turn")] = (0.0, 0.0, sensed.heading_rad)
        values[at("wind_push")] = (push_n, push_e)
        values[at("reference")] = 0.0
        values[at("trim")] = (push_n, push_e, sensed.north_mps, sensed.east_mps)

    def update(self, sensed: Sensed, sticks: Sticks) -> Demand:
        """See `InnerLoop`."""
        record = self._record
        record.values[at("sensed")], record.values[at("sticks")] = sensed, sticks
        control(record.states, record.constants)
        return Demand(*record.values[at("demand")].tolist())


class VelocityLoop(AttitudeLoop):
    """The inner loop of kind `velocity`."""

    _VELOCITY_KIND = 1.0
