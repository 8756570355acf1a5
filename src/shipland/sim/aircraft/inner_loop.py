"""The aircraft's own autopilot: sticks in percent to four rotor thrusts, as an ANAFI's PCMD is flown.

Horizontal: a stick asks for a tilt, a first-order model of the aircraft in still air turns tilt into a velocity
reference, and that reference is tracked over ground with feed-forward, proportional and integral action; released
sticks brake the reference to zero and hold the place. Vertical speed and yaw rate likewise. Plain float arithmetic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shipland.sim.aircraft.aerodynamics import Trim
from shipland.sim.aircraft.parameters import GRAVITY_MPS2, AircraftParameters

Thrusts = tuple[float, float, float, float]
"""Of the rotors front right, front left, rear right, rear left [N]."""

SPINS = (1.0, -1.0, -1.0, 1.0)
"""Sign of each rotor's reaction torque about body down."""


class Sticks(NamedTuple):
    """Stick positions, -1 … 1: forward, right, up, clockwise positive."""

    pitch: float
    roll: float
    heave: float
    yaw: float


CENTRED = Sticks(0.0, 0.0, 0.0, 0.0)


class Sensed(NamedTuple):
    """What the autopilot believes: position and velocity over ground in `ned`, Euler angles, body rates."""

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


class InnerLoop:
    """State and law of the autopilot.

    Args:
        parameters: the aircraft.
        step_s: time between updates [s].
        sensed: where it starts.
        trim: hover trim that the integrators start from.
    """

    def __init__(self, parameters: AircraftParameters, step_s: float, sensed: Sensed, trim: Trim) -> None:
        self._airframe = parameters.airframe
        self._settings = parameters.settings
        self._loop = parameters.loop
        self._step_s = step_s
        settings, airframe = parameters.settings, parameters.airframe
        self._max_tilt_rad = math.radians(settings.max_tilt_deg)
        self._max_yaw_rate_rad_s = math.radians(settings.max_yaw_rate_deg_s)
        self._max_tilt_rate_rad_s = math.radians(settings.max_tilt_rate_deg_s)
        self._max_slope = math.tan(math.radians(self._loop.tilt_limit_deg))
        top_speed = airframe.level_speed_mps(self._max_tilt_rad)
        self.speed_time_s = top_speed / (GRAVITY_MPS2 * math.tan(self._max_tilt_rad))
        """Time constant of the velocity reference [s]: full stick settles where nominal drag balances full tilt."""
        self._velocity_ref = [0.0, 0.0]
        self._rate_ref = [0.0, 0.0]
        self._place_ref = [sensed.north_m, sensed.east_m]
        self._integral = [trim.push_in_ned_mps2[0], trim.push_in_ned_mps2[1]]
        self._climb_ref_mps = 0.0
        self._down_ref_m = sensed.down_m
        self._climb_integral_mps2 = -trim.push_in_ned_mps2[2]
        self._yaw_rate_ref_rad_s = self._yaw_ref_rad_s2 = 0.0
        self._heading_ref_rad = sensed.heading_rad

    @property
    def climb_command_mps(self) -> float:
        """The vertical speed that the loop currently asks for, upward [m/s]."""
        return self._climb_ref_mps

    def update(self, sensed: Sensed, sticks: Sticks) -> Thrusts:
        """Advance by one step; the thrust asked of each rotor [N]."""
        cos_heading, sin_heading = math.cos(sensed.heading_rad), math.sin(sensed.heading_rad)
        lift = max(GRAVITY_MPS2 + self._vertical(sensed, sticks), 0.3 * GRAVITY_MPS2)
        push_n, push_e = self._horizontal(sensed, sticks, cos_heading, sin_heading, lift * self._max_slope)
        forward = cos_heading * push_n + sin_heading * push_e
        right = cos_heading * push_e - sin_heading * push_n
        pitch_ref = -math.atan2(forward, lift)
        roll_ref = math.atan2(right * math.cos(pitch_ref), lift)
        upright = max(math.cos(sensed.roll_rad) * math.cos(sensed.pitch_rad), 0.5)
        thrust = self._airframe.mass_kg * lift / upright
        return self._mix(thrust, *self._torques(sensed, roll_ref, pitch_ref, self._yaw(sensed, sticks)))

    def _horizontal(
        self, sensed: Sensed, sticks: Sticks, cos_heading: float, sin_heading: float, max_push_mps2: float
    ) -> tuple[float, float]:
        loop, dt = self._loop, self._step_s
        hold = max(0.0, 1.0 - 100.0 * math.hypot(sticks.pitch, sticks.roll) / loop.hold_below_percent)
        ahead = GRAVITY_MPS2 * math.tan(sticks.pitch * self._max_tilt_rad)
        aside = GRAVITY_MPS2 * math.tan(sticks.roll * self._max_tilt_rad)
        ref_n, ref_e = self._velocity_ref
        speed = math.hypot(ref_n, ref_e)
        drag_per_s = self._airframe.rotor_drag_per_s + self._airframe.body_drag_per_m * speed
        brake_per_s = hold * min(1.0 / loop.brake_time_s, loop.brake_mps2 / max(speed, 1e-9))
        slowing_per_s = 1.0 / self.speed_time_s + brake_per_s
        rate_n, rate_e = self._rate_ref
        settle = min(1.0, dt / loop.tilt_time_s)
        rate_n += settle * (cos_heading * ahead - sin_heading * aside - slowing_per_s * ref_n - rate_n)
        rate_e += settle * (sin_heading * ahead + cos_heading * aside - slowing_per_s * ref_e - rate_e)
        self._rate_ref = [rate_n, rate_e]
        ref_n += rate_n * dt
        ref_e += rate_e * dt
        self._velocity_ref = [ref_n, ref_e]

        place, integral = self._place_ref, self._integral
        follow = 1.0 if hold <= 0.0 else min(1.0, (1.0 - hold) * dt / 0.2)
        place[0] += ref_n * dt + follow * (sensed.north_m - place[0])
        place[1] += ref_e * dt + follow * (sensed.east_m - place[1])
        gain = hold * loop.position_per_s
        error_n = ref_n + gain * (place[0] - sensed.north_m) - sensed.north_mps
        error_e = ref_e + gain * (place[1] - sensed.east_m) - sensed.east_mps
        push_n = rate_n + drag_per_s * ref_n + loop.velocity_per_s * error_n + integral[0]
        push_e = rate_e + drag_per_s * ref_e + loop.velocity_per_s * error_e + integral[1]
        push = math.hypot(push_n, push_e)
        if push > max_push_mps2:
            scale = max_push_mps2 / push
            return push_n * scale, push_e * scale
        integral[0] += loop.velocity_integral_per_s2 * error_n * dt
        integral[1] += loop.velocity_integral_per_s2 * error_e * dt
        return push_n, push_e

    def _vertical(self, sensed: Sensed, sticks: Sticks) -> float:
        loop, dt = self._loop, self._step_s
        wanted = sticks.heave * self._settings.max_vertical_speed_mps
        rate = (wanted - self._climb_ref_mps) / loop.climb_time_s
        rate = min(max(rate, -loop.climb_mps2), loop.climb_mps2)
        self._climb_ref_mps += rate * dt
        # The height reference runs with the climb reference but never far from the aircraft, so that a deck under
        # the feet or a saturated rotor does not wind it up.
        self._down_ref_m -= self._climb_ref_mps * dt
        off_m = min(max(self._down_ref_m - sensed.down_m, -0.25), 0.25)
        self._down_ref_m = sensed.down_m + off_m
        error = self._climb_ref_mps - loop.height_per_s * off_m + sensed.down_mps
        lift = rate + loop.climb_per_s * error + self._climb_integral_mps2
        if abs(lift) > 0.6 * GRAVITY_MPS2:
            return math.copysign(0.6 * GRAVITY_MPS2, lift)
        integral = self._climb_integral_mps2 + loop.climb_integral_per_s2 * error * dt
        self._climb_integral_mps2 = min(max(integral, -0.4 * GRAVITY_MPS2), 0.4 * GRAVITY_MPS2)
        return lift

    def _yaw(self, sensed: Sensed, sticks: Sticks) -> float:
        loop, dt = self._loop, self._step_s
        step = loop.yaw_rad_s2 * dt
        change = sticks.yaw * self._max_yaw_rate_rad_s - self._yaw_rate_ref_rad_s
        change = min(max(change, -step), step)
        self._yaw_rate_ref_rad_s += change
        self._yaw_ref_rad_s2 = change / dt
        ahead = self._heading_ref_rad + self._yaw_rate_ref_rad_s * dt - sensed.heading_rad
        ahead = (ahead + math.pi) % (2.0 * math.pi) - math.pi
        ahead = min(max(ahead, -0.3), 0.3)
        self._heading_ref_rad = sensed.heading_rad + ahead
        return self._yaw_rate_ref_rad_s + loop.heading_per_s * ahead

    def _torques(
        self, sensed: Sensed, roll_ref_rad: float, pitch_ref_rad: float, heading_rate_rad_s: float
    ) -> tuple[float, float, float]:
        loop, top = self._loop, self._max_tilt_rate_rad_s
        roll_rate = min(max(loop.attitude_per_s * (roll_ref_rad - sensed.roll_rad), -top), top)
        pitch_rate = min(max(loop.attitude_per_s * (pitch_ref_rad - sensed.pitch_rad), -top), top)
        cos_roll, sin_roll = math.cos(sensed.roll_rad), math.sin(sensed.roll_rad)
        cos_pitch, sin_pitch = math.cos(sensed.pitch_rad), math.sin(sensed.pitch_rad)
        p = roll_rate - heading_rate_rad_s * sin_pitch
        q = pitch_rate * cos_roll + heading_rate_rad_s * sin_roll * cos_pitch
        r = heading_rate_rad_s * cos_roll * cos_pitch - pitch_rate * sin_roll
        inertia = self._airframe.inertia_kgm2
        return (
            inertia[0] * loop.rate_per_s * (p - sensed.roll_rate_rad_s),
            inertia[1] * loop.rate_per_s * (q - sensed.pitch_rate_rad_s),
            inertia[2] * (loop.yaw_rate_per_s * (r - sensed.yaw_rate_rad_s) + self._yaw_ref_rad_s2),
        )

    def _mix(self, thrust_n: float, roll_nm: float, pitch_nm: float, yaw_nm: float) -> Thrusts:
        airframe = self._airframe
        low, top = airframe.idle_thrust * airframe.hover_thrust_n, airframe.top_thrust_n
        share = min(max(0.25 * thrust_n, 1.5 * low), 0.9 * top)
        room = min(share - low, top - share)
        roll = -0.25 * roll_nm / airframe.motor_right_m
        pitch = 0.25 * pitch_nm / airframe.motor_forward_m
        tilt = abs(roll) + abs(pitch)
        if tilt > room:
            roll, pitch, tilt = roll * room / tilt, pitch * room / tilt, room
        yaw = 0.25 * yaw_nm / airframe.torque_per_thrust_m
        yaw = min(max(yaw, tilt - room), room - tilt)
        return (
            share + roll + pitch + yaw,
            share - roll + pitch - yaw,
            share + roll - pitch - yaw,
            share - roll - pitch + yaw,
        )
