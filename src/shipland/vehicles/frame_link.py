"""Pictures of a simulated world over a loopback socket, with their truth: the camera of `shipland serve-physics`.

A record is a line of JSON (`bytes` of picture follow it), its `kind` one of:
`frame`: exposure and sending on the world's clock, gimbal, truth, and the picture's shape; `verdict`: the touchdown.
Truth and verdict are rows, as the flight log has them.
"""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from shipland.camera import Camera
from shipland.errors import ConfigError, DataError, VehicleError
from shipland.messages import GimbalAttitude, GroundTruth, TouchdownVerdict
from shipland.rows import from_row, to_row
from shipland.vehicles.camera_stream import StreamedPicture


class FrameSource:
    """A `PictureSource` at the end of the socket.

    A frame's age is taken from the world's clock, its receipt from ours: exposure is receipt minus age.
    """

    def __init__(self, host: str, port: int, camera: Camera) -> None:
        self._place, self._camera = (host, port), camera
        self._socket: socket.socket | None = None
        self._closed = False
        self._verdict: TouchdownVerdict | None = None

    @staticmethod
    def at(url: str, camera: Camera) -> FrameSource:
        """From `frames:HOST:PORT`; a host left out is loopback. ConfigError when it is none."""
        kind, _, place = url.partition(":")
        host, _, port = place.rpartition(":")
        if kind != "frames" or not port.isdecimal() or not 0 < int(port) < 65536:
            raise ConfigError(f"camera {url}: expected frames:HOST:PORT")
        return FrameSource(host or "127.0.0.1", int(port), camera)

    def pictures(self) -> Iterator[StreamedPicture]:
        """See `PictureSource`; once the verdict has come there will be no more."""
        words = "the stream has ended"
        try:
            self._socket = socket.create_connection(self._place, 5.0)
            self._socket.settimeout(None)
            with self._socket, self._socket.makefile("rb") as stream:
                while not self._closed and (line := stream.readline()):
                    record = json.loads(line)
                    if record["kind"] == "verdict":
                        self._verdict = from_row(TouchdownVerdict, record["verdict"])
                    else:
                        yield self._shot(record, stream.read(record["bytes"]))
        except (DataError, OSError, ValueError, KeyError) as error:
            words = str(error)
        if self._verdict is None and not self._closed:
            raise VehicleError(f"frames from {self._place[0]}:{self._place[1]}: {words}")

    def close(self) -> None:
        """See `PictureSource`."""
        self._closed = True
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
            self._socket.close()

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, once the world has sent it."""
        return self._verdict

    def _shot(self, record: Mapping[str, Any], data: bytes) -> StreamedPicture:
        arrived_s, image = time.monotonic(), None
        if data:
            shape = self._camera.height_px, self._camera.width_px, 3
            image = np.frombuffer(data, np.uint8).reshape(shape)
        return StreamedPicture(
            image=image,
            exposed_s=arrived_s - float(record["age_s"]),
            arrived_s=arrived_s,
            gimbal=GimbalAttitude(*record["gimbal"]),
            truth=from_row(GroundTruth, record["truth"]),
        )


def frame_record(age_s: float, gimbal: GimbalAttitude, truth: GroundTruth, picture: bytes) -> bytes:
    """A frame as it goes over the socket."""
    head = {
        "kind": "frame",
        "age_s": age_s,
        "gimbal": [gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad],
        "truth": to_row(truth),
        "bytes": len(picture),
    }
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + picture


def verdict_record(verdict: TouchdownVerdict) -> bytes:
    """The touchdown as it goes over the socket."""
    return json.dumps({"kind": "verdict", "verdict": to_row(verdict)}, separators=(",", ":")).encode() + b"\n"
