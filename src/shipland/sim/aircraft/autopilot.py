"""What an autopilot takes and gives: sticks and its own estimates in, thrust and moments out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from shipland.sim.aircraft.parameters import AircraftParameters, Vector


class Sticks(NamedTuple):
    """Stick positions, -1 … 1: forward, right, up, clockwise positive."""

    pitch: float
    roll: float
    heave: float
    yaw: float


CENTRED = Sticks(0.0, 0.0, 0.0, 0.0)


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


class Demand(NamedTuple):
    """Total thrust along body up [N] and moments about body forward, right and down [Nm]."""

    thrust_n: float
    roll_nm: float
    pitch_nm: float
    yaw_nm: float


State = tuple[float, ...]
"""What a packaged law remembers between updates, in the order of `free_flight.STATE`."""


@dataclass(frozen=True)
class LoopSetup:
    """What an inner loop is built from.

    Attributes:
        parameters: the aircraft.
        step_s: time between updates [s].
        sensed: where it starts, hovering.
        push_in_ned_mps2: acceleration that thrust gives against the wind's drag there.
    """

    parameters: AircraftParameters
    step_s: float
    sensed: Sensed
    push_in_ned_mps2: Vector


class InnerLoop(Protocol):
    """The autopilot's law; a factory of the group `loops` makes it from a `LoopSetup`."""

    def update(self, sensed: Sensed, sticks: Sticks) -> Demand:
        """Advance by one step."""
