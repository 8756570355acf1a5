"""A MAVLink vehicle of ours before a stand-in autopilot in a process of its own."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ports import free_port
from shipland.camera import Camera
from shipland.config import build, packaged_toml
from shipland.messages import GimbalAttitude, TouchdownVerdict
from shipland.vehicles.camera_stream import StreamedPicture
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.mavlink.setup import Engagement, MavlinkSetup
from shipland.vehicles.mavlink.vehicle import MavlinkVehicle
from shipland.vehicles.touchdown import TouchdownParameters


class Blank:
    """A camera that gives 30 pictures a second, none in them unless it is given one, until told to stop."""

    def __init__(self) -> None:
        self.closed = self.frozen = False
        self.picture: npt.NDArray[np.uint8] | None = None

    def pictures(self) -> Iterator[StreamedPicture]:
        while not self.closed:
            now_s = time.monotonic()
            if not self.frozen:
                yield StreamedPicture(self.picture, now_s - 0.1, now_s, GimbalAttitude(0.0, -0.1))
            time.sleep(1.0 / 30.0)

    def close(self) -> None:
        self.closed = True

    def verdict(self) -> TouchdownVerdict | None:
        return None


class StandIn:
    """The process of the stand-in autopilot; a kind as `ardupilot-by-mavsdk` speaks MAVLink by MAVSDK's library."""

    def __init__(self, port: int, kind: str, key: bytes | None = None) -> None:
        autopilot, _, by = kind.partition("-by-")
        script = "standin_by_mavsdk.py" if by else "standin.py"
        command = [sys.executable, str(Path(__file__).with_name(script)), str(port), autopilot]
        command += [key.hex()] if key else []
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def say(self, words: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(words + "\n")
        self._process.stdin.flush()

    def report(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        self.say("report")
        return json.loads(self._process.stdout.readline())

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()


def setup_for(
    port: int, source: Blank, key: bytes | None, engagement: Engagement, overrides: dict[str, Any]
) -> MavlinkSetup:
    section = {"engage_timeout_s": 5.0, "video_timeout_s": 2.0} | overrides
    return MavlinkSetup(
        place=f"udp:127.0.0.1:{port}",
        vehicle=None,
        key=key,
        log=None,
        camera=Camera.from_fov(1280, 720, 69.0),
        source=source,
        brings_gimbal=True,
        latency_s=None,
        fixed_pitch_rad=None,
        open_timeout_s=5.0,
        engagement=engagement,
        parameters=build(MavlinkParameters, section, "mavlink"),
        touchdown=TouchdownParameters(),
        preflight=PreflightParameters(),
        response_table=packaged_toml("vehicles")["response"],
    )


_SAME = b"same"


@contextmanager
def bench(
    kind: str = "ardupilot",
    key: bytes | None = None,
    other_key: bytes | None = _SAME,
    engagement: Engagement | None = None,
    **overrides: Any,
) -> Iterator[tuple[MavlinkVehicle, StandIn, Blank]]:
    """The vehicle, not yet open, its autopilot (which signs with `other_key`), its camera; it asks for its mode."""
    port, source = free_port(socket.SOCK_DGRAM), Blank()
    autopilot = StandIn(port, kind, key if other_key is _SAME else other_key)
    vehicle = MavlinkVehicle(setup_for(port, source, key, engagement or Engagement(take=True), overrides))
    try:
        yield vehicle, autopilot, source
    finally:
        vehicle.close()
        autopilot.close()
