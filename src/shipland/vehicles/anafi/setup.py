"""What an ANAFI is flown with, and how an address says it."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from shipland.camera import Camera
from shipland.config import build, key, parameters
from shipland.guidance.response import Response
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.parameters import LinkParameters, measured

END = Path(__file__).with_name("end.py")


@parameters
class AnafiParameters(LinkParameters):
    """`[anafi]`; full sticks are set on the aircraft and read back."""

    latency_s: float = key(
        0.28, "from exposure to receipt of the quickest picture", "Parrot's streaming latency as advertised", ge=0, le=3
    )
    event_latency_s: float = key(
        0.1, "from an event's being true to its receipt", "as [delays.telemetry.anafi]", ge=0, le=3
    )


@dataclass(frozen=True)
class AnafiSetup:
    """What an ANAFI is flown with.

    Attributes:
        command: starts the far end, `end.py`.
        camera: intrinsics.
        parameters: see there.
        preflight: what must be in order.
        response: what full sticks mean.
        take_off: whether it takes off by itself.
        log: file for the records of both directions, or None.
    """

    command: list[str]
    camera: Camera
    parameters: AnafiParameters
    preflight: PreflightParameters
    response: Response
    take_off: bool
    log: Path | None

    @staticmethod
    def of(setup: VehicleSetup) -> AnafiSetup:
        """From an address and the vehicles' table; ConfigError when either is wrong."""
        address = setup.address
        address.only("python", "stream", "takeoff")
        parameters = build(AnafiParameters, setup.table["anafi"], "vehicles.anafi")
        # what `shipland identify` has measured goes before what was set
        sticks = parameters.full_sticks("attitude") | measured("attitude", setup.table["response"])
        pcmd = {"stick_step_percent": 1.0, "hold_below_percent": 1.0}
        stream = address.options.get("stream", f"rtsp://{address.place}/live")
        return AnafiSetup(
            command=[address.options.get("python", sys.executable), str(END), address.place, stream],
            camera=setup.camera,
            parameters=parameters,
            preflight=build(PreflightParameters, setup.table["preflight"], "vehicles.preflight"),
            response=build(Response, sticks | pcmd, "response.attitude"),
            take_off=address.flag("takeoff"),
            log=None if setup.log is None else setup.log.with_suffix(".jsonl"),
        )
