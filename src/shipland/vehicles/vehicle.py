"""The protocol of everything that is flown, and what only some vehicles offer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from shipland.camera import Camera
from shipland.frames import Array
from shipland.messages import FlightRecord, Frame, GroundTruth, PilotCommand, Telemetry, TouchdownVerdict

if TYPE_CHECKING:
    from shipland.guidance.response import Response
    from shipland.rig import Rig
    from shipland.vehicles.checks import Check

LONGEST_WAIT_S = 0.2
"""How long `read` waits for a picture before it gives telemetry alone: two periods of the slowest camera allowed."""

LATE_S = 1.0
"""A command is not flown when it was decided this long ago; twice the longest cycle of [Lee2022]."""


def unless_late(command: PilotCommand, now_s: float) -> PilotCommand:
    """The command, or a hold where its pilot stood still meanwhile: it was for another place."""
    if not now_s - command.t_s > LATE_S:  # a time that is not finite tells nothing
        return command
    return PilotCommand.hold(now_s, command.gimbal_pitch_rad)


class Vehicle(Protocol):
    """A camera-carrying aircraft.

    `read` waits for the next frame: a link waits, the simulator steps, a replay reads on.
    """

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures that `read` gives."""

    def open(self) -> None:
        """Connect and make ready; raises VehicleError when that fails."""

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """The newest frame that the loop has not had, and the telemetry at its receipt; None at the end.

        Where no picture comes within `LONGEST_WAIT_S` of the vehicle's time the frame is None: the loop goes on
        deciding.
        """

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest telemetry at `t_s`, when this cycle's command is decided [s].

        The compass does not wait for the vision. A simulator lets time pass until then; a link gives the newest that
        has come, stamped with `t_s`: the command's time, whatever the values' age.
        """

    def send(self, command: PilotCommand) -> None:
        """Give the sticks; those `unless_late`."""

    def close(self) -> None:
        """Leave the vehicle safe and let go of it."""


@runtime_checkable
class GroundTruthSource(Protocol):
    """Who knows the truth of a flight: the simulator. Truth goes to the record, never to the pilot."""

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth at an exposure time that `read` gave [s]."""

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, once there was one."""


@runtime_checkable
class Real(Protocol):
    """A vehicle outside: it is connected and checked before it is flown, and says what full sticks mean."""

    def response(self) -> Response:
        """What full sticks mean; once connected."""

    def connect(self) -> None:
        """Link and camera, without taking control; VehicleError when something does not answer."""

    def checks(self) -> Sequence[Check]:
        """What of it is fit to fly; once connected."""


@runtime_checkable
class Ending(Protocol):
    """A vehicle that says why its flight is over."""

    @property
    def end_reason(self) -> str:
        """In words; empty in flight."""


@runtime_checkable
class Commanded(Protocol):
    """A vehicle that says whose commands it obeys."""

    @property
    def in_command(self) -> str:
        """Who flies it now, in words, as soon as that is known; empty before."""


@runtime_checkable
class Informed(Protocol):
    """A vehicle that passes on what is seen and decided, to whoever listens beside it."""

    def inform_of(self, rig: Rig, camera_in_body_m: Array) -> None:
        """What is landed on, and the (3,) place of the camera, once before the flight."""

    def inform(self, record: FlightRecord) -> None:
        """A cycle; never waits. What it raises is logged, and the flight goes on."""
