"""The one loop: read, see, decide, send. It flies the simulator and the real drone alike, and owns no clock."""

from __future__ import annotations

import enum
import logging
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from shipland.guidance.pilot import Pilot
from shipland.messages import (
    Decision,
    FlightRecord,
    Frame,
    GroundTruth,
    Intent,
    Observation,
    Override,
    PilotCommand,
    Telemetry,
    copied,
)
from shipland.safety.assurance import Safety, by_hand
from shipland.safety.input_gate import InputGate, without_repeated
from shipland.soundness import ENDS_THE_PROCESS, log_failure, sound_decision, words_of
from shipland.stopping import uninterrupted
from shipland.vehicles.delays import DelayParameters
from shipland.vehicles.vehicle import Commanded, Ending, GroundTruthSource, Vehicle
from shipland.vision.vision import Vision, see_or_degrade

_log = logging.getLogger(__name__)

_LOW = (Intent.LAND, Intent.GO_AROUND)
_LOW_S = 30.0
"""For a landing or a go-around beyond the time limit: a hold low over a deck that heaves would be struck by it."""


class Stage(enum.StrEnum):
    """What a cycle's time is spent on."""

    READ = "read"
    SEE = "see"
    DECIDE = "decide"
    RECORD = "record"


def no_override() -> Override | None:
    """The override of a flight without keys: none."""
    return None


@dataclass(frozen=True)
class Autonomy:
    """Who flies: vision, pilot, the safety that stands after every pilot, and the person whose keys stand over both."""

    vision: Vision
    pilot: Pilot
    safety: Safety
    delays: DelayParameters
    override: Callable[[], Override | None] = no_override


class Cycle(NamedTuple):
    """One cycle of the loop, after its command was sent.

    Its times are the flight's: the vehicle's until its clock leaps, and then they go on as before.

    Attributes:
        frame: the picture, and when it was exposed; without an image and at the last exposure where none came.
        telemetry: when the command was decided.
        observation: what the vision made of the frame.
        decision: the pilot's, its command as it left the safety.
        truth: at the exposure; None where it is unknown.
        cost_s: time spent reading, seeing and deciding, by the clock that was passed in [s].
    """

    frame: Frame
    telemetry: Telemetry
    observation: Observation
    decision: Decision
    truth: GroundTruth | None
    cost_s: Mapping[Stage, float]

    @property
    def record(self) -> FlightRecord:
        """The row of the flight log."""
        return FlightRecord(self.frame, self.telemetry, self.observation, self.decision, self.truth)


@dataclass
class FlightResult:
    """How the loop ended.

    Attributes:
        reason: why it ended, in words.
        cycles: how many were flown.
        t_s: time of the flight at the end [s].
        cost_s: time spent in each stage, by the clock that was passed in [s].
    """

    reason: str = "the flight is over"
    cycles: int = 0
    t_s: float = 0.0
    cost_s: dict[Stage, float] = field(default_factory=lambda: dict.fromkeys(Stage, 0.0))


def decide_or_degrade(
    autonomy: Autonomy,
    observation: Observation,
    telemetry: Telemetry,
    sent: PilotCommand | None,
    known: set[type[BaseException]] | None = None,
) -> Decision:
    """What the pilot decides; where it raises or gives what is no decision, the safety's own.

    The pilot is given copies: one that writes into them changes nothing that safety, vision and log are told.

    Args:
        autonomy: pilot and safety.
        observation: see `Pilot.decide`, as the next two.
        telemetry: likewise.
        sent: likewise.
        known: kinds of its errors whose traceback the log of this flight holds already; a new one is added.
    """
    try:
        return sound_decision(autonomy.pilot.decide(copied(observation), copied(telemetry), sent))
    except ENDS_THE_PROCESS:
        raise
    except BaseException as error:  # whatever a foreign pilot raises
        log_failure(_log, f"pilot failed at {telemetry.t_s:.3f} s", error, known)
        return autonomy.safety.without_pilot(f"pilot failed: {words_of(error)}", telemetry, sent)


def check_or_hold(
    autonomy: Autonomy,
    decision: Decision,
    observation: Observation,
    telemetry: Telemetry,
    known: set[type[BaseException]] | None = None,
) -> Decision:
    """What safety and person make of a decision.

    Should the safety fail, the person's key without its bounds, else a hold; and the traceback in the log, of each kind
    of error one, as `decide_or_degrade` does.
    """
    override = None
    try:
        override = autonomy.override()
        return autonomy.safety.check(decision, observation, telemetry, override)
    except Exception as error:  # the last one who could raise in flight
        log_failure(_log, f"safety failed at {telemetry.t_s:.3f} s", error, known)
        failed = f"safety failed: {words_of(error)}"
        if isinstance(override, Override):
            decision = by_hand(decision, override, telemetry.t_s)
            return replace(decision, reason=f"{decision.reason}; {failed}")
        return Decision(PilotCommand.hold(telemetry.t_s, 0.0), None, f"{failed}: hold")


def cycles(vehicle: Vehicle, autonomy: Autonomy, clock: Callable[[], float]) -> Generator[Cycle]:
    """Fly cycle by cycle until the vehicle gives no more.

    The vehicle is opened at the first step and closed at the end, whether it is the vehicle's, an error's or the
    caller's: closing the generator closes the vehicle, and no signal cuts that short. A pilot or a vision that fails
    costs its cycle; whatever else raises ends the flight, with the vehicle left holding. Where the vehicle says who is
    in command, a change stands in the reason of the cycle that it falls into.

    Args:
        vehicle: what is flown; its clock may start anywhere.
        autonomy: vision, pilot, safety.
        clock: for the cost of the stages and, where the delays say `measured`, for the processing time [s].

    Yields:
        Each cycle, its command on the way.
    """
    truth_source = vehicle if isinstance(vehicle, GroundTruthSource) else None
    sent: PilotCommand | None = None
    before: Observation | None = None
    gate, commander = InputGate(), ""
    of_vision, of_pilot, of_safety = (set[type[BaseException]]() for _ in range(3))
    try:
        vehicle.open()
        commanded = vehicle if isinstance(vehicle, Commanded) else None
        started_s = clock()
        while (pair := vehicle.read()) is not None:
            gate = gate.at_receipt(pair[0], pair[1].t_s)
            if gate.now_s is None:
                continue  # no time yet to fly by
            now_s = gate.now_s
            gate, frame, refused = gate.frame(pair[0])
            read_s = clock()
            if refused:
                observation = Observation(frame.t_s, frame.gimbal, reason=refused)
            else:
                frame = Frame(frame.t_s, frame.image, frame.gimbal, pair[1].height_m, frame.stamp_s, frame.gimbal_age_s)
                seen = see_or_degrade(autonomy.vision, frame, of_vision)
                observation = gate.observation(without_repeated(seen, before), frame, vehicle.camera)
                before = seen
            seen_s = clock()
            ready_s = now_s + autonomy.delays.processing_s(observation, seen_s - read_s)
            telemetry = vehicle.telemetry_at(gate.vehicle_s(ready_s))
            gate = gate.at_decision(telemetry.t_s, ready_s)
            telemetry, refused = gate.telemetry(telemetry)
            observation = autonomy.safety.admitted(observation, telemetry)
            decision = decide_or_degrade(autonomy, observation, telemetry, sent, of_pilot)
            decision = check_or_hold(autonomy, decision, observation, telemetry, of_safety)
            if refused:
                decision = replace(decision, reason=f"{decision.reason}; {refused}")
            if commanded is not None and commanded.in_command != commander:
                commander = commanded.in_command
                decision = replace(decision, reason=f"{decision.reason}; in command: {commander}")
            sent = decision.command
            vehicle.send(replace(sent, t_s=gate.vehicle_s(sent.t_s)) if gate.leapt_s else sent)
            truth = truth_source.truth_at(gate.vehicle_s(frame.t_s)) if truth_source is not None else None
            decided_s = clock()
            cost_s = {Stage.READ: read_s - started_s, Stage.SEE: seen_s - read_s, Stage.DECIDE: decided_s - seen_s}
            yield Cycle(frame, telemetry, observation, decision, truth, cost_s)
            started_s = clock()
    finally:
        with uninterrupted():
            vehicle.close()


def fly(
    vehicle: Vehicle,
    autonomy: Autonomy,
    time_limit_s: float,
    clock: Callable[[], float],
    on_cycle: Callable[[FlightRecord], None],
) -> FlightResult:
    """Fly until the vehicle gives no more or the time is up; a landing or a go-around then has half a minute more.

    Args:
        vehicle: opened and closed here, also when interrupted.
        autonomy: vision, pilot, safety.
        time_limit_s: of vehicle time, from the first exposure [s].
        clock: see `cycles`.
        on_cycle: takes each row of the log.

    Returns:
        How it ended.
    """
    result, first_s = FlightResult(), None
    with closing(cycles(vehicle, autonomy, clock)) as flight:
        for cycle in flight:
            decided_s = clock()
            on_cycle(cycle.record)
            first_s = cycle.frame.t_s if first_s is None else first_s
            result.cycles += 1
            result.t_s = cycle.telemetry.t_s
            for stage, cost_s in cycle.cost_s.items():
                result.cost_s[stage] += cost_s
            result.cost_s[Stage.RECORD] += clock() - decided_s
            low = cycle.decision.command.intent in _LOW
            if result.t_s - first_s >= time_limit_s + (_LOW_S if low else 0.0):
                result.reason = f"time limit of {time_limit_s:g} s"
                return result
    if isinstance(vehicle, Ending) and vehicle.end_reason:
        result.reason = vehicle.end_reason
    return result
