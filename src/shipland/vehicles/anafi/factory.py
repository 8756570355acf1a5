"""`anafi://`: the factory of the group `vehicles`."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path

from shipland.config import build
from shipland.guidance.response import Response
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.anafi.parameters import AnafiParameters
from shipland.vehicles.anafi.vehicle import AnafiSetup, AnafiVehicle
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.vehicle import Vehicle

END = Path(__file__).with_name("end.py")


def anafi(setup: VehicleSetup) -> Vehicle:
    """`anafi://192.168.42.1?python=/path/of/olympe/bin/python&stream=rtsp://192.168.42.1/live&takeoff=1`."""
    address = setup.address
    address.only("python", "stream", "takeoff")
    parameters = build(AnafiParameters, setup.table["anafi"], "vehicles.anafi")
    assumed = {
        "kind": "attitude",
        "max_tilt_rad": math.radians(parameters.max_tilt_deg),
        "max_climb_mps": parameters.max_climb_mps,
        "max_turn_rad_s": math.radians(parameters.max_turn_deg_s),
        "max_speed_mps": 0.0,
        "servo_per_s": 0.0,
    }
    found = setup.table["response"]["attitude"]  # what `shipland identify` has measured goes before what was set
    assert isinstance(found, Mapping)
    pcmd = {"stick_step_percent": 1.0, "hold_below_percent": 1.0}
    response = build(Response, {**assumed, **found, **pcmd}, "response.attitude")
    stream = address.options.get("stream", f"rtsp://{address.place}/live")
    return AnafiVehicle(
        AnafiSetup(
            command=[address.options.get("python", sys.executable), str(END), address.place, stream],
            camera=setup.camera,
            parameters=parameters,
            preflight=build(PreflightParameters, setup.table["preflight"], "vehicles.preflight"),
            response=response,
            take_off=address.flag("takeoff"),
            log=None if setup.log is None else setup.log.with_suffix(".jsonl"),
        )
    )
