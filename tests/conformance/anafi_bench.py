"""An ANAFI of ours before Parrot's own device end, in Olympe's environment; skips where there is none."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.vehicles.address import Address, VehicleSetup, vehicle_table
from shipland.vehicles.anafi.vehicle import AnafiVehicle, anafi

ROOT = Path(__file__).parents[2]
CAMERA = Camera.from_fov(640, 352, 69.0)
GREEN_BGR = (40, 200, 30)


def olympe_python() -> str:
    """The Python that has Olympe: `SHIPLAND_OLYMPE_PYTHON`, or what `make olympe` makes."""
    made = ROOT / ".venv-olympe/bin/python"
    named = os.environ.get("SHIPLAND_OLYMPE_PYTHON", str(made) if made.exists() else "")
    if not named:
        pytest.skip("no Olympe: `make olympe` makes it an environment, or SHIPLAND_OLYMPE_PYTHON names its Python")
    return named


class Device:
    """The process of the device end."""

    def __init__(self, python: str) -> None:
        with tempfile.NamedTemporaryFile(suffix=".h264", delete=False) as stored:
            stored.write(film())
        command = [python, str(Path(__file__).with_name("olympe_device.py")), stored.name]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        begun = self.ask("begin")
        Path(stored.name).unlink()
        self.ask("end")
        self.stream = f"rtsp://127.0.0.1:{begun['video_port']}/live"

    def say(self, words: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(words + "\n")
        self.process.stdin.flush()

    def ask(self, words: str) -> dict[str, Any]:
        assert self.process.stdout is not None
        self.say(words)
        answer = self.process.stdout.readline()
        assert answer, "the device end has died"
        return json.loads(answer)

    def report(self) -> dict[str, Any]:
        return self.ask("report")


@cache
def film() -> bytes:
    """A second of H.264: a green rectangle on grey, in the middle."""
    import av

    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = CAMERA.width_px, CAMERA.height_px, "yuv420p"
    encoder.time_base = Fraction(1, 30)
    encoder.options = {
        "preset": "ultrafast", "tune": "zerolatency", "profile": "baseline",
        "x264-params": "aud=1:repeat-headers=1:keyint=15",
    }  # fmt: skip
    image = np.full((CAMERA.height_px, CAMERA.width_px, 3), 90, np.uint8)
    image[120:232, 200:440] = GREEN_BGR
    packets = []
    for index in range(30):
        shown = image.copy()
        shown[8 * index : 8 * index + 8, :16] = 0  # no two pictures are alike
        picture = av.VideoFrame.from_ndarray(shown, format="bgr24")
        picture.pts = index
        packets += encoder.encode(picture)
    return b"".join(map(bytes, [*packets, *encoder.encode(None)]))


@contextmanager
def bench(log: Path | None = None, **changes: float) -> Iterator[tuple[AnafiVehicle, Device]]:
    """The vehicle, not yet open, and its aircraft; `changes` of `[anafi]`."""
    with device() as (aircraft, stream):
        own = {"connect_timeout_s": 60.0, "engage_timeout_s": 5.0, "video_timeout_s": 2.0} | changes
        table = {**vehicle_table(None), "anafi": own}
        options = {"python": olympe_python(), "stream": stream, "takeoff": "1"}
        made = anafi(VehicleSetup(Address("anafi", "127.0.0.1", options), CAMERA, table, log))
        assert isinstance(made, AnafiVehicle)
        try:
            yield made, aircraft
        finally:
            made.close()


@contextmanager
def device() -> Iterator[tuple[Device, str]]:
    """A new aircraft and its video's address; one at a time on this machine, for its ports cannot be chosen."""
    python = olympe_python()
    with _LOCK.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not _processes or _processes[-1].process.poll() is not None:
            _processes.append(Device(python))
        aircraft = _processes[-1]
        assert aircraft.ask("begin")["listens"], "the device end's ports are taken"
        try:
            yield aircraft, aircraft.stream
        finally:
            if aircraft.process.poll() is None:
                aircraft.ask("end")


_LOCK = Path(tempfile.gettempdir()) / f"shipland-olympe-{os.getuid()}.lock"
_processes: list[Device] = []
"""Of these tests; the last one serves aircraft after aircraft, and ends with its standard input."""
