"""The one loop: read, see, decide, send, record. It flies the simulator and the real drone alike, and owns no clock."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field

from shipland.guidance.pilot import Pilot
from shipland.guidance.safety import Safety
from shipland.messages import FlightRecord
from shipland.vehicles.delays import DelayParameters
from shipland.vehicles.vehicle import Vehicle, Witness
from shipland.vision.vision import Vision, see_or_degrade


class Stage(enum.Enum):
    """What a cycle's time is spent on."""

    READ = "read"
    SEE = "see"
    DECIDE = "decide"
    RECORD = "record"


@dataclass(frozen=True)
class Crew:
    """Who flies: eyes, pilot, and the safety that stands after every pilot."""

    vision: Vision
    pilot: Pilot
    safety: Safety
    delays: DelayParameters


@dataclass
class FlightResult:
    """How the loop ended.

    Attributes:
        reason: why it ended, in words.
        cycles: frames seen.
        t_s: vehicle time at the end [s].
        cost_s: time spent in each stage, by the clock that was passed in [s].
    """

    reason: str = "the vehicle gave no frame"
    cycles: int = 0
    t_s: float = 0.0
    cost_s: dict[Stage, float] = field(default_factory=lambda: dict.fromkeys(Stage, 0.0))


def fly(
    vehicle: Vehicle,
    crew: Crew,
    time_limit_s: float,
    clock: Callable[[], float],
    on_cycle: Callable[[FlightRecord], None],
) -> FlightResult:
    """Fly until the vehicle gives no more frames or the time is up.

    Args:
        vehicle: opened and closed here, also when interrupted.
        crew: eyes, pilot, safety.
        time_limit_s: of vehicle time [s].
        clock: for the cost of the stages and, where the delays say `measured`, for the processing time [s].
        on_cycle: takes each row of the log.

    Returns:
        How it ended.
    """
    result = FlightResult()
    witness = vehicle if isinstance(vehicle, Witness) else None
    vehicle.open()
    try:
        started_s = clock()
        while (pair := vehicle.read()) is not None:
            frame, telemetry = pair
            read_s = clock()
            observation = see_or_degrade(crew.vision, frame)
            seen_s = clock()
            ready_s = telemetry.t_s + crew.delays.processing_s(observation, seen_s - read_s)
            telemetry = vehicle.telemetry_at(ready_s)
            decision = crew.pilot.decide(observation, telemetry)
            decision = crew.safety.check(decision, observation, telemetry)
            vehicle.send(decision.command)
            decided_s = clock()
            truth = witness.truth_at(frame.t_s) if witness is not None else None
            on_cycle(FlightRecord(frame, telemetry, observation, decision, truth))
            result.cycles += 1
            result.t_s = telemetry.t_s
            ended_s = clock()
            spent = (read_s - started_s, seen_s - read_s, decided_s - seen_s, ended_s - decided_s)
            for stage, cost_s in zip(Stage, spent, strict=True):
                result.cost_s[stage] += cost_s
            started_s = ended_s
            if telemetry.t_s >= time_limit_s:
                result.reason = f"time limit of {time_limit_s:g} s"
                break
        else:
            result.reason = "the flight is over"
    finally:
        vehicle.close()
    return result
