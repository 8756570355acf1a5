"""A quadrotor one of whose rotors gives less than it is asked for."""

from __future__ import annotations

from shipland.frames import rows_from_quaternion
from shipland.sim.aircraft.aircraft import SPINS, Clearance, Quadrotor, RigidBodyState, Wrench
from shipland.sim.aircraft.autopilot import Sensed, Sticks
from shipland.sim.aircraft.parameters import Shape, Vector


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
