"""Laws that the packaged inner loops share: climb, heading, attitude and rates; horizontal velocity and place."""

from __future__ import annotations

import math

from shipland.frames import GRAVITY_MPS2
from shipland.sim.aircraft.autopilot import Demand, LoopSetup, Sensed, State


class Stabiliser:
    """Climb, heading, attitude and rate loops.

    Args:
        setup: the aircraft and where it starts.
    """

    def __init__(self, setup: LoopSetup) -> None:
        self._airframe, self._settings = setup.parameters.airframe, setup.parameters.settings
        self._loop, self._step_s = setup.parameters.loop, setup.step_s
        self._max_yaw_rate_rad_s = math.radians(self._settings.max_yaw_rate_deg_s)
        self._max_tilt_rate_rad_s = math.radians(self._settings.max_tilt_rate_deg_s)
        self._climb_ref_mps = 0.0
        self._down_ref_m = setup.sensed.down_m
        self._climb_integral_mps2 = -setup.push_in_ned_mps2[2]
        self._yaw_rate_ref_rad_s = self._yaw_ref_rad_s2 = 0.0
        self._heading_ref_rad = setup.sensed.heading_rad

    @property
    def state(self) -> State:
        """What it remembers between updates."""
        return (
            self._climb_ref_mps,
            self._down_ref_m,
            self._climb_integral_mps2,
            self._yaw_rate_ref_rad_s,
            self._yaw_ref_rad_s2,
            self._heading_ref_rad,
        )

    @state.setter
    def state(self, values: State) -> None:
        self._climb_ref_mps, self._down_ref_m, self._climb_integral_mps2, *turn = values
        self._yaw_rate_ref_rad_s, self._yaw_ref_rad_s2, self._heading_ref_rad = turn

    def lift_mps2(self, sensed: Sensed, heave: float) -> float:
        """Advance the climb loop; the upward acceleration that thrust must give, gravity included."""
        loop, dt = self._loop, self._step_s
        wanted = heave * self._settings.max_vertical_speed_mps
        rate = (wanted - self._climb_ref_mps) / loop.climb_time_s
        rate = min(max(rate, -loop.climb_mps2), loop.climb_mps2)
        self._climb_ref_mps += rate * dt
        # The height reference runs with the climb reference but never far from the aircraft, so that a deck under
        # the feet or a saturated rotor does not wind it up.
        self._down_ref_m -= self._climb_ref_mps * dt
        off_m = min(max(self._down_ref_m - sensed.down_m, -0.25), 0.25)
        self._down_ref_m = sensed.down_m + off_m
        error = self._climb_ref_mps - loop.height_per_s * off_m + sensed.down_mps
        climb = rate + loop.climb_per_s * error + self._climb_integral_mps2
        if abs(climb) > 0.6 * GRAVITY_MPS2:
            climb = math.copysign(0.6 * GRAVITY_MPS2, climb)
        else:
            integral = self._climb_integral_mps2 + loop.climb_integral_per_s2 * error * dt
            self._climb_integral_mps2 = min(max(integral, -0.4 * GRAVITY_MPS2), 0.4 * GRAVITY_MPS2)
        return GRAVITY_MPS2 + climb

    def demand(self, sensed: Sensed, lift_mps2: float, roll_ref_rad: float, pitch_ref_rad: float, yaw: float) -> Demand:
        """Advance the yaw loop; thrust and moments that reach an attitude.

        Args:
            sensed: what is known.
            lift_mps2: from `lift_mps2`.
            roll_ref_rad: reference angle.
            pitch_ref_rad: likewise.
            yaw: stick, -1 … 1.
        """
        cos_roll, sin_roll = math.cos(sensed.roll_rad), math.sin(sensed.roll_rad)
        cos_pitch, sin_pitch = math.cos(sensed.pitch_rad), math.sin(sensed.pitch_rad)
        thrust_n = self._airframe.mass_kg * lift_mps2 / max(cos_roll * cos_pitch, 0.5)
        loop, top = self._loop, self._max_tilt_rate_rad_s
        heading_rate = self._heading_rate_rad_s(sensed.heading_rad, yaw)
        roll_rate = min(max(loop.attitude_per_s * (roll_ref_rad - sensed.roll_rad), -top), top)
        pitch_rate = min(max(loop.attitude_per_s * (pitch_ref_rad - sensed.pitch_rad), -top), top)
        p = roll_rate - heading_rate * sin_pitch
        q = pitch_rate * cos_roll + heading_rate * sin_roll * cos_pitch
        r = heading_rate * cos_roll * cos_pitch - pitch_rate * sin_roll
        inertia = self._airframe.inertia_kgm2
        return Demand(
            thrust_n,
            inertia[0] * loop.rate_per_s * (p - sensed.roll_rate_rad_s),
            inertia[1] * loop.rate_per_s * (q - sensed.pitch_rate_rad_s),
            inertia[2] * (loop.yaw_rate_per_s * (r - sensed.yaw_rate_rad_s) + self._yaw_ref_rad_s2),
        )

    def _heading_rate_rad_s(self, heading_rad: float, yaw: float) -> float:
        loop, dt = self._loop, self._step_s
        step = loop.yaw_rad_s2 * dt
        change = min(max(yaw * self._max_yaw_rate_rad_s - self._yaw_rate_ref_rad_s, -step), step)
        self._yaw_rate_ref_rad_s += change
        self._yaw_ref_rad_s2 = change / dt
        off_rad = self._heading_ref_rad + self._yaw_rate_ref_rad_s * dt - heading_rad
        off_rad = (off_rad + math.pi) % (2.0 * math.pi) - math.pi
        off_rad = min(max(off_rad, -0.3), 0.3)
        self._heading_ref_rad = heading_rad + off_rad
        return self._yaw_rate_ref_rad_s + loop.heading_per_s * off_rad


Pair = tuple[float, float]
"""North and east."""


class VelocityTracker:
    """Feed-forward, proportional and integral law from a velocity reference to a horizontal push.

    push = dv/dt + drag(v) + k_v (v + k_p Δp - v_sensed) + k_i ∫ (…), with the nominal drag of still air; the integral
    is the push that the wind asks for. It stands still while the push is at its limit.
    """

    def __init__(self, setup: LoopSetup) -> None:
        self._loop, self._airframe = setup.parameters.loop, setup.parameters.airframe
        self._step_s = setup.step_s
        self.wind_push_mps2: Pair = (setup.push_in_ned_mps2[0], setup.push_in_ned_mps2[1])
        """The integral."""

    def push(self, sensed: Sensed, velocity: Pair, rate: Pair, off_m: Pair, most_mps2: float) -> Pair:
        """Acceleration (north, east) [m/s²] that thrust must give.

        Args:
            sensed: what is known.
            velocity: reference [m/s].
            rate: its derivative [m/s²].
            off_m: reference place minus sensed place; (0, 0) holds no place.
            most_mps2: largest push.
        """
        loop = self._loop
        drag_per_s = self._airframe.rotor_drag_per_s + self._airframe.body_drag_per_m * math.hypot(*velocity)
        error_n = velocity[0] + loop.position_per_s * off_m[0] - sensed.north_mps
        error_e = velocity[1] + loop.position_per_s * off_m[1] - sensed.east_mps
        wind_n, wind_e = self.wind_push_mps2
        push_n = rate[0] + drag_per_s * velocity[0] + loop.velocity_per_s * error_n + wind_n
        push_e = rate[1] + drag_per_s * velocity[1] + loop.velocity_per_s * error_e + wind_e
        push = math.hypot(push_n, push_e)
        if push > most_mps2:
            scale = most_mps2 / push
            return push_n * scale, push_e * scale
        gain = loop.velocity_integral_per_s2 * self._step_s
        self.wind_push_mps2 = (wind_n + gain * error_n, wind_e + gain * error_e)
        return push_n, push_e


class PlaceHold:
    """Released sticks: brake from the present velocity and hold the place where the brake ends."""

    def __init__(self, setup: LoopSetup) -> None:
        self._loop, self._step_s = setup.parameters.loop, setup.step_s
        self.tracker = VelocityTracker(setup)
        self._holding = False
        self._place = self._velocity = self._rate = (0.0, 0.0)

    @property
    def state(self) -> State:
        """What it remembers between updates, its tracker's first."""
        return *self.tracker.wind_push_mps2, float(self._holding), *self._place, *self._velocity, *self._rate

    @state.setter
    def state(self, values: State) -> None:
        wind_n, wind_e, holding, *rest = values
        self.tracker.wind_push_mps2, self._holding = (wind_n, wind_e), holding > 0.0
        self._place, self._velocity, self._rate = (rest[0], rest[1]), (rest[2], rest[3]), (rest[4], rest[5])

    def release(self) -> None:
        """The sticks are deflected: the next `push` begins a new brake."""
        self._holding = False

    def push(self, sensed: Sensed, most_mps2: float) -> Pair:
        """Acceleration (north, east) [m/s²] that thrust must give; at most `most_mps2`."""
        loop, dt = self._loop, self._step_s
        if not self._holding:
            self._holding = True
            self._place = (sensed.north_m, sensed.east_m)
            self._velocity = (sensed.north_mps, sensed.east_mps)
            self._rate = (0.0, 0.0)
        (ref_n, ref_e), (rate_n, rate_e) = self._velocity, self._rate
        brake_per_s = min(1.0 / loop.brake_time_s, loop.brake_mps2 / max(math.hypot(ref_n, ref_e), 1e-9))
        settle = min(1.0, dt / loop.tilt_time_s)
        rate_n -= settle * (brake_per_s * ref_n + rate_n)
        rate_e -= settle * (brake_per_s * ref_e + rate_e)
        ref_n += rate_n * dt
        ref_e += rate_e * dt
        self._velocity, self._rate = (ref_n, ref_e), (rate_n, rate_e)
        place_n, place_e = self._place[0] + ref_n * dt, self._place[1] + ref_e * dt
        self._place = (place_n, place_e)
        off_m = (place_n - sensed.north_m, place_e - sensed.east_m)
        return self.tracker.push(sensed, self._velocity, self._rate, off_m, most_mps2)


def released(pitch: float, roll: float, hold_below_percent: float) -> bool:
    """Whether both pitch and roll sticks are below the smallest stick."""
    return 100.0 * max(abs(pitch), abs(roll)) < hold_below_percent
