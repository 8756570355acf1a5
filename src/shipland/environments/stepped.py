"""One simulated flight that waits for each command: the loop of `flight.cycles`, its decisions taken by the caller."""

from __future__ import annotations

import time
from contextlib import ExitStack, closing
from dataclasses import replace

from shipland import factories
from shipland.camera import Camera
from shipland.factories import Factory
from shipland.flight import Cycle, cycles, decide_or_degrade
from shipland.messages import (
    Decision,
    Frame,
    GroundTruth,
    Observation,
    PilotCommand,
    Telemetry,
    TouchdownVerdict,
)
from shipland.safety.assurance import Safety
from shipland.scenario.autonomy import build_autonomy, build_scene, build_vehicle
from shipland.scenario.faults import with_faults
from shipland.scenario.scenario import Scenario
from shipland.scenario.visions import needs_pictures
from shipland.vehicles.vehicle import Vehicle


class SteppedFlight:
    """The flight that `shipland fly` flies, stopped before each decision.

    `advance` reads and sees until a command is due, without time passing afterwards; `decide` then asks the pilot, lets
    the safety check its command and sends it. So whoever sets the pilot's action in between sees what the pilot sees,
    at the same instant.

    Args:
        scenario: what is flown.
        pilot: function from `PilotSetup` to a pilot.
        vision: name or factory, as `factories.resolve` takes it.
        seed: of the flight.

    Raises:
        ShiplandError: a wrong name, or no off-screen OpenGL where pictures are drawn.
    """

    def __init__(self, scenario: Scenario, pilot: Factory, vision: str | Factory, seed: int) -> None:
        with ExitStack() as stack:
            scene = None
            if needs_pictures(factories.resolve("visions", vision)):
                scene = build_scene(scenario, seed)
                stack.callback(scene.close)
            self._simulated = build_vehicle(scenario, seed, scene)
            autonomy = build_autonomy(scenario, self._simulated, pilot, vision, seed)
            self._vehicle, self._autonomy = with_faults(scenario, self._simulated, autonomy, seed)
            undecided = replace(self._autonomy, pilot=_Undecided(), safety=_Unchecked(self._autonomy.safety))
            self._unsent = _Unsent(self._vehicle)
            flight = cycles(self._unsent, undecided, time.perf_counter)
            self._cycles = stack.enter_context(closing(flight))
            self._stack = stack.pop_all()
        self.sent: PilotCommand | None = None
        """The command sent last."""

    def advance(self) -> Cycle | None:
        """The next cycle up to its decision, which is a placeholder; None once the flight is over."""
        return next(self._cycles, None)

    def decide(self, cycle: Cycle) -> Decision:
        """The pilot's decision on the cycle that `advance` gave last, its command checked by the safety and sent."""
        decision = decide_or_degrade(self._autonomy, cycle.observation, cycle.telemetry, self.sent)
        decision = self._autonomy.safety.check(decision, cycle.observation, cycle.telemetry)
        self.sent = decision.command
        ahead_s = self._unsent.due_s - cycle.telemetry.t_s  # what the vehicle's clock has leapt
        self._vehicle.send(replace(self.sent, t_s=self.sent.t_s + ahead_s))
        return decision

    def truth(self) -> GroundTruth:
        """The truth of now."""
        return self._simulated.world.truth()

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, once there was one."""
        return self._simulated.verdict()

    def close(self) -> None:
        """End the flight; again does nothing."""
        self._stack.close()


class _Unsent:
    """A vehicle whose commands are sent by another: `send` tells only when one is due, by the vehicle's clock."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle, self.due_s = vehicle, 0.0

    @property
    def camera(self) -> Camera:
        return self._vehicle.camera

    def open(self) -> None:
        self._vehicle.open()

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        return self._vehicle.read()

    def telemetry_at(self, t_s: float) -> Telemetry:
        return self._vehicle.telemetry_at(t_s)

    def send(self, command: PilotCommand) -> None:
        self.due_s = command.t_s

    def close(self) -> None:
        self._vehicle.close()


class _Undecided:
    """A pilot in whose place the caller decides."""

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:  # noqa: ARG002
        return Decision(PilotCommand.hold(telemetry.t_s, 0.0), None, "")


class _Unchecked(Safety):
    """Lets placeholders pass; the flight's own safety admits what is seen and checks what is sent."""

    def __init__(self, safety: Safety) -> None:  # without a state of its own
        self._safety = safety

    def admitted(self, observation: Observation, telemetry: Telemetry) -> Observation:
        return self._safety.admitted(observation, telemetry)

    def check(self, decision: Decision, *_: object) -> Decision:
        return decision
