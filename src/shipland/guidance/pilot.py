"""The protocol of a pilot, and the arguments of its factory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.guidance.parameters import GuidanceParameters
from shipland.guidance.response import Response
from shipland.messages import Decision, Observation, PilotCommand, Telemetry
from shipland.rig import Rig


class Pilot(Protocol):
    """Observation and telemetry in, decision out. Time comes with the data and may start anywhere."""

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """One cycle, decided at the telemetry's time; never raises.

        Args:
            observation: of the newest frame.
            telemetry: when the command is decided; also "now".
            sent: the command of the cycle before as it left the safety; None in the first cycle.
        """


@dataclass(frozen=True)
class PilotSetup:
    """Arguments of a pilot's factory.

    Attributes:
        guidance: the sections of `[guidance]`.
        rig: dimensions of ship, deck and bar.
        camera: intrinsics of the pictures.
        camera_in_body_m: (3,) the camera's optical centre.
        response: what the sticks do on this vehicle.
        rng: for pilots that draw.
    """

    guidance: GuidanceParameters
    rig: Rig
    camera: Camera
    camera_in_body_m: Array
    response: Response
    rng: np.random.Generator
