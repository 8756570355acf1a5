"""The quadrotor with somebody else's flight controller: servo pulses in, forces out."""

from __future__ import annotations

from collections.abc import Sequence

from shipland.sim.aircraft.aircraft import Quadrotor
from shipland.sim.aircraft.loops import Sticks
from shipland.sim.aircraft.parameters import AircraftParameters, Vector
from shipland.sim.aircraft.record import Sensed, at

_IDLE_US, _RANGE_US = 1000.0, 1000.0
_MOTOR_OF_ROTOR = (0, 2, 3, 1)
"""ArduPilot numbers a quadrotor in X: front right, rear left, front left, rear right; ours: FR, FL, RR, RL."""
THRUST_EXPO = 0.65
"""Exponent of a rotor's thrust over its signal: ArduPilot's MOT_THST_EXPO as delivered, which inverts it."""


class ServoQuadrotor(Quadrotor):
    """`Quadrotor` whose thrusts follow `set_pulses`; it makes no inner loop and begins level, motors stopped.

    The parameters of loop and settings have no meaning here.
    """

    def __init__(self, parameters: AircraftParameters, step_s: float) -> None:
        self._wanted_n = (0.0, 0.0, 0.0, 0.0)
        super().__init__(parameters, step_s)

    def trim(self, wind_in_ned_mps: Vector, heading_rad: float) -> tuple[float, float]:
        """Level, whatever the wind: it has not flown yet."""
        super().trim(wind_in_ned_mps, heading_rad)
        self.record.values[at("thrusts")] = 0.0
        return 0.0, 0.0

    def begin(self, sensed: Sensed) -> None:
        """See `Aircraft`; the flight controller is outside."""

    def set_pulses(self, pulses_us: Sequence[float]) -> None:
        """Take the first four servo outputs [µs], in ArduPilot's order for a quadrotor in X."""
        front_right, front_left, rear_right, rear_left = (
            self._parameters.airframe.top_thrust_n * thrust_share(pulses_us[motor]) for motor in _MOTOR_OF_ROTOR
        )
        self._wanted_n = (front_right, front_left, rear_right, rear_left)

    @property
    def wanted_thrust_n(self) -> float:
        """Total thrust commanded to the rotors."""
        return sum(self._wanted_n)

    @property
    def weight_n(self) -> float:
        """Take-off weight."""
        return 4.0 * self._parameters.airframe.hover_thrust_n

    def _asked(self, sensed: Sensed, sticks: Sticks) -> Sequence[float]:  # noqa: ARG002
        """See `Quadrotor`."""
        return self._wanted_n


def thrust_share(pulse_us: float) -> float:
    """A rotor's steady thrust over its largest, for a servo pulse [µs].

    >>> thrust_share(1000.0), thrust_share(2000.0)
    (0.0, 1.0)
    """
    signal = min(max((pulse_us - _IDLE_US) / _RANGE_US, 0.0), 1.0)
    return (1.0 - THRUST_EXPO) * signal + THRUST_EXPO * signal * signal
