"""An airframe with its autopilot: what is sensed and the sticks in, forces out."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

from shipland.factories import resolve
from shipland.frames import Quaternion, rows_from_quaternion
from shipland.sim.aircraft.aerodynamics import air_force_in_ned_n, ground_effect_gain, trim_hover
from shipland.sim.aircraft.autopilot import Demand, InnerLoop, LoopSetup, Sensed, Sticks
from shipland.sim.aircraft.parameters import AircraftParameters, Shape, Vector

SPINS = (1.0, -1.0, -1.0, 1.0)
"""Sign of the reaction torque about body down of the rotors front right, front left, rear right, rear left."""


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


Clearance = Callable[[Vector], float]
"""Height [m] of a point of `body` over the deck; infinite beside or below it."""


class Aircraft(Protocol):
    """What flies; a factory of the group `aircraft` makes it from `AircraftParameters` and the step [s]."""

    @property
    def shape(self) -> Shape:
        """Mass and what can touch the deck."""

    def trim(self, wind_in_ned_mps: Vector, heading_rad: float) -> tuple[float, float]:
        """Roll and pitch [rad] in which it hovers in a wind; the flight begins so."""

    def begin(self, sensed: Sensed) -> None:
        """Start the autopilot in the last trim."""

    def step(
        self,
        motion: RigidBodyState,
        sensed: Sensed,
        sticks: Sticks | None,
        wind_in_ned_mps: Vector,
        deck: Clearance | None,
    ) -> Wrench:
        """Advance by one step; the forces until the next.

        Args:
            motion: true, for the forces of the air.
            sensed: what the autopilot believes.
            sticks: as piloted; None once the motors are stopped.
            wind_in_ned_mps: the air's velocity here.
            deck: clearances over the deck when it is near.
        """


class Quadrotor:
    """Four rotors with a lag, an inner loop, drag and ground effect.

    Args:
        parameters: the aircraft.
        step_s: time between steps [s].

    Raises:
        ConfigError: there is no inner loop of the name `loop.kind`.
    """

    def __init__(self, parameters: AircraftParameters, step_s: float) -> None:
        self._parameters, self._airframe, self._step_s = parameters, parameters.airframe, step_s
        self._make_loop = resolve("loops", parameters.loop.kind)
        airframe = self._airframe
        self.shape = airframe.shape
        """See `Aircraft`."""
        self._top_n = airframe.top_thrust_n
        self._low_n = airframe.idle_thrust * airframe.hover_thrust_n
        share = -math.expm1(-step_s / airframe.motor_time_s)
        self._settle = share
        self._mean = airframe.motor_time_s / step_s * share
        self._ground_effect = airframe.ground_effect
        self.trim((0.0, 0.0, 0.0), 0.0)

    @property
    def torque_per_thrust_m(self) -> float:
        """Reaction torque of a rotor over its thrust."""
        return self._airframe.torque_per_thrust_m

    def trim(self, wind_in_ned_mps: Vector, heading_rad: float) -> tuple[float, float]:
        """See `Aircraft`."""
        self._trim = trim_hover(self._airframe, wind_in_ned_mps, heading_rad)
        self.thrusts_n = (0.25 * self._trim.thrust_n,) * 4
        return self._trim.roll_rad, self._trim.pitch_rad

    def begin(self, sensed: Sensed) -> None:
        """See `Aircraft`."""
        setup = LoopSetup(self._parameters, self._step_s, sensed, self._trim.push_in_ned_mps2)
        self.loop: InnerLoop = self._make_loop(setup)

    def step(
        self,
        motion: RigidBodyState,
        sensed: Sensed,
        sticks: Sticks | None,
        wind_in_ned_mps: Vector,
        deck: Clearance | None,
    ) -> Wrench:
        """See `Aircraft`."""
        rows = rows_from_quaternion(*motion.quaternion)
        asked = (0.0, 0.0, 0.0, 0.0) if sticks is None else self._asked(sensed, sticks)
        (u, v, w), (a, b, c) = motion.velocity_mps, wind_in_ned_mps
        north, east, down = air_force_in_ned_n(self._airframe, rows, (u - a, v - b, w - c), sum(self.thrusts_n))
        thrusts = self._turn_rotors(asked)
        if deck is not None and self._ground_effect:
            radius_m = self._airframe.rotor_radius_m
            gains = (ground_effect_gain(deck(rotor), radius_m) for rotor in self.shape.rotors_m)
            lifts = [thrust * gain for thrust, gain in zip(thrusts, gains, strict=True)]
        else:
            lifts = thrusts
        fr, fl, rr, rl = lifts
        lift = fr + fl + rr + rl
        x, y = self._airframe.motor_forward_m, self._airframe.motor_right_m
        spin = thrusts[0] - thrusts[1] - thrusts[2] + thrusts[3]
        return Wrench(
            (north - lift * rows[2], east - lift * rows[5], down - lift * rows[8]),
            (y * (fl + rl - fr - rr), x * (fr + fl - rr - rl), self._airframe.torque_per_thrust_m * spin),
        )

    def _asked(self, sensed: Sensed, sticks: Sticks) -> tuple[float, float, float, float]:
        """Thrusts that the autopilot asks of the rotors."""
        return self._mix(self.loop.update(sensed, sticks))

    def _turn_rotors(self, asked_n: tuple[float, float, float, float]) -> list[float]:
        """Let the thrusts follow for one step; their means over it [N]."""
        settle, mean, top = self._settle, self._mean, self._top_n
        (a, b, c, d), (w, x, y, z) = self.thrusts_n, asked_n
        w, x, y, z = min(max(w, 0.0), top), min(max(x, 0.0), top), min(max(y, 0.0), top), min(max(z, 0.0), top)
        p, q, r, s = a - w, b - x, c - y, d - z
        self.thrusts_n = (a - settle * p, b - settle * q, c - settle * r, d - settle * s)
        return [w + mean * p, x + mean * q, y + mean * r, z + mean * s]

    def _mix(self, demand: Demand) -> tuple[float, float, float, float]:
        """Thrusts of the rotors; what exceeds their range goes first from yaw, then from roll and pitch."""
        airframe = self._airframe
        low, top = self._low_n, self._top_n
        share = min(max(0.25 * demand.thrust_n, 1.5 * low), 0.9 * top)
        room = min(share - low, top - share)
        roll = -0.25 * demand.roll_nm / airframe.motor_right_m
        pitch = 0.25 * demand.pitch_nm / airframe.motor_forward_m
        tilt = abs(roll) + abs(pitch)
        if tilt > room:
            roll, pitch, tilt = roll * room / tilt, pitch * room / tilt, room
        yaw = 0.25 * demand.yaw_nm / airframe.torque_per_thrust_m
        yaw = min(max(yaw, tilt - room), room - tilt)
        return (
            share + roll + pitch + yaw,
            share - roll + pitch - yaw,
            share + roll - pitch - yaw,
            share - roll - pitch + yaw,
        )


class WeakRotor:
    """An `Aircraft`: a sound one less a share of one rotor's thrust and torque; its autopilot does not know.

    Args:
        sound: the aircraft, in flight.
        rotor: 0…3, front right, front left, rear right, rear left.
        missing: share of that rotor's thrust.
    """

    def __init__(self, sound: Quadrotor, rotor: int, missing: float) -> None:
        self.sound = sound
        self._rotor, self._missing = rotor, missing

    @property
    def shape(self) -> Shape:
        """See `Aircraft`."""
        return self.sound.shape

    def trim(self, wind_in_ned_mps: Vector, heading_rad: float) -> tuple[float, float]:
        """See `Aircraft`."""
        return self.sound.trim(wind_in_ned_mps, heading_rad)

    def begin(self, sensed: Sensed) -> None:
        """See `Aircraft`."""
        self.sound.begin(sensed)

    def step(
        self,
        motion: RigidBodyState,
        sensed: Sensed,
        sticks: Sticks | None,
        wind_in_ned_mps: Vector,
        deck: Clearance | None,
    ) -> Wrench:
        """See `Aircraft`."""
        (north, east, down), (roll, pitch, yaw) = self.sound.step(motion, sensed, sticks, wind_in_ned_mps, deck)
        lost_n = self._missing * self.sound.thrusts_n[self._rotor]
        forward_m, right_m, _ = self.shape.rotors_m[self._rotor]
        rows = rows_from_quaternion(*motion.quaternion)
        spin_nm = self.sound.torque_per_thrust_m * SPINS[self._rotor] * lost_n
        return Wrench(
            (north + lost_n * rows[2], east + lost_n * rows[5], down + lost_n * rows[8]),
            (roll + right_m * lost_n, pitch - forward_m * lost_n, yaw - spin_nm),
        )


def build_aircraft(parameters: AircraftParameters, step_s: float) -> Aircraft:
    """The aircraft of `aircraft.kind` at its start; it makes its own inner loop.

    Args:
        parameters: section `[aircraft]`.
        step_s: time between control steps [s].

    Raises:
        ConfigError: there is no such aircraft or inner loop.
    """
    aircraft: Aircraft = resolve("aircraft", parameters.kind)(parameters, step_s)
    return aircraft
