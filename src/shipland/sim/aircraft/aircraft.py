"""An airframe with its autopilot: what is sensed and the sticks in, forces out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from shipland.factories import resolve
from shipland.sim.aircraft.loops import AttitudeLoop, InnerLoop, LoopSetup, Sticks, VelocityLoop
from shipland.sim.aircraft.parameters import AircraftParameters, Shape, Vector
from shipland.sim.aircraft.record import Record, RigidBodyState, Sensed, Wrench, at
from shipland.sim.aircraft.step import ground_effect_gain, mix, trim_hover, turn_rotors

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
    """Four rotors with a lag, an inner loop, drag and ground effect; all that evolves is in its record.

    Raises:
        ConfigError: there is no inner loop of the name `loop.kind`.
    """

    def __init__(self, parameters: AircraftParameters, step_s: float) -> None:
        self._parameters, self._step_s = parameters, step_s
        self._make_loop = resolve("loops", parameters.loop.kind)
        self.record = Record(parameters, step_s)
        """Its state, and that of its sensors and gimbal."""
        self.shape = parameters.airframe.shape
        """See `Aircraft`."""
        self.trim((0.0, 0.0, 0.0), 0.0)

    @property
    def is_packaged(self) -> bool:
        """Whether all of its step is the packaged one, loop included: `step.fly_free` and `step.tick` fly it."""
        return type(self) is Quadrotor and type(self.loop) in (AttitudeLoop, VelocityLoop)

    def trim(self, wind_in_ned_mps: Vector, heading_rad: float) -> tuple[float, float]:
        """See `Aircraft`."""
        roll_rad, pitch_rad, thrust_n, self._push = trim_hover(self.record.constants, wind_in_ned_mps, heading_rad)
        self.record.values[at("thrusts")] = 0.25 * thrust_n
        return roll_rad, pitch_rad

    def begin(self, sensed: Sensed) -> None:
        """See `Aircraft`."""
        self.loop: InnerLoop = self._make_loop(
            LoopSetup(self._parameters, self._step_s, sensed, self._push, self.record)
        )

    def weaken(self, rotor: int, missing: float) -> None:
        """Take a share of the thrust and torque of a rotor, 0…3: front right, front left, rear right, rear left."""
        self.record.values[at("soundness").start + rotor] = 1.0 - missing

    def step(
        self,
        motion: RigidBodyState,
        sensed: Sensed,
        sticks: Sticks | None,
        wind_in_ned_mps: Vector,
        deck: Clearance | None,
    ) -> Wrench:
        """See `Aircraft`."""
        record, radius_m = self.record, self.shape.rotor_radius_m
        values = record.values
        values[at("motion")] = (*motion.position_m, *motion.quaternion, *motion.velocity_mps, *motion.rates_rad_s)
        values[at("air")] = wind_in_ned_mps
        values[at("ground_gains")] = 1.0
        if deck is not None and self._parameters.airframe.ground_effect:
            values[at("ground_gains")] = [ground_effect_gain(deck(rotor), radius_m) for rotor in self.shape.rotors_m]
        values[at("asked")] = (0.0, 0.0, 0.0, 0.0) if sticks is None else self._asked(sensed, sticks)
        turn_rotors(record.states, record.constants)
        return record.wrench

    def _asked(self, sensed: Sensed, sticks: Sticks) -> Sequence[float]:
        """Thrusts that the autopilot asks of the rotors."""
        record = self.record
        record.values[at("demand")] = self.loop.update(sensed, sticks)
        mix(record.states, record.constants)
        asked_n: list[float] = record.values[at("asked")].tolist()
        return asked_n
