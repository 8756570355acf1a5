"""What an autopilot takes and gives: sticks and its own estimates in, thrust and moments out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from shipland.sim.aircraft.parameters import AircraftParameters, Vector
from shipland.sim.aircraft.record import Record, Sensed

__all__ = ["CENTRED", "Demand", "InnerLoop", "LoopSetup", "Sensed", "Sticks"]


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
