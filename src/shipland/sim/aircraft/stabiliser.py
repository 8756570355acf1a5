"""What every packaged loop flies: vertical speed, yaw rate, attitude and body rates."""

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
            roll_ref_rad: asked for.
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
