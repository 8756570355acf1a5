"""Pictures of a simulated world over a loopback socket, with their truth: the camera of `shipland serve-physics`.

A record is a line of JSON (`bytes` of picture follow it), its `kind` one of:
`frame`: exposure and sending on the world's clock, gimbal, truth, and the picture's shape; `verdict`: the touchdown.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from shipland.camera import Camera
from shipland.errors import ConfigError, VehicleError
from shipland.frames import Array, Pose
from shipland.messages import GimbalAttitude, GroundTruth, TouchdownVerdict
from shipland.vehicles.camera_stream import StreamedPicture

_POSES = ("ned_from_body", "ned_from_ship", "ned_from_deck", "ned_from_bar", "ned_from_camera")
_VECTORS = ("velocity_in_ned_mps", "wind_in_ned_mps")


def truth_table(truth: GroundTruth) -> dict[str, Any]:
    """A truth as plain JSON values."""
    table: dict[str, Any] = {"t_s": truth.t_s}
    for name in _POSES:
        table[name] = getattr(truth, name).matrix().tolist()
    for name in _VECTORS:
        table[name] = getattr(truth, name).tolist()
    return table


def truth_of_table(table: Mapping[str, Any]) -> GroundTruth:
    """The inverse of `truth_table`."""
    values: dict[str, Any] = {"t_s": float(table["t_s"])}
    for name in _POSES:
        matrix = np.array(table[name], dtype=float).reshape(4, 4)
        values[name] = Pose(matrix[:3, :3], matrix[:3, 3])
    for name in _VECTORS:
        values[name] = np.array(table[name], dtype=float)
    return GroundTruth(**values)


def verdict_table(verdict: TouchdownVerdict) -> dict[str, Any]:
    """A verdict as plain JSON values; NaN stands as null."""
    table = {}
    for name, value in vars(verdict).items():
        plain = value.tolist() if isinstance(value, np.ndarray) else value
        table[name] = [_null(item) for item in plain] if isinstance(plain, list) else _null(plain)
    return table


def verdict_of_table(table: Mapping[str, Any]) -> TouchdownVerdict:
    """The inverse of `verdict_table`."""
    values: dict[str, Any] = {
        name: _array(value) if isinstance(value, list) else math.nan if value is None else value
        for name, value in table.items()
    }
    return TouchdownVerdict(**values)


def _null(value: Any) -> Any:  # noqa: ANN401 - any JSON type
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _array(values: list[float | None]) -> Array:
    return np.array([math.nan if value is None else value for value in values], dtype=float)


class FrameSource:
    """A `PictureSource` at the end of the socket.

    A frame's age is taken from the world's clock, its receipt from ours: exposure is receipt minus age.

    Args:
        host, port: where the world serves.
        camera: intrinsics that the pictures must fit.
    """

    def __init__(self, host: str, port: int, camera: Camera) -> None:
        self._place, self._camera = (host, port), camera
        self._socket: socket.socket | None = None
        self._closed = False
        self._verdict: TouchdownVerdict | None = None

    @staticmethod
    def at(place: str, camera: Camera) -> FrameSource:
        """From `HOST:PORT`; a host left out is loopback. ConfigError when it is none."""
        host, _, port = place.rpartition(":")
        if not port.isdecimal() or not 0 < int(port) < 65536:
            raise ConfigError(f"camera frames:{place}: expected frames:HOST:PORT")
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
                        self._verdict = verdict_of_table(record["verdict"])
                    else:
                        yield self._shot(record, stream.read(record["bytes"]))
        except (OSError, ValueError, KeyError) as error:
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
            truth=truth_of_table(record["truth"]),
        )


def frame_record(age_s: float, gimbal: GimbalAttitude, truth: GroundTruth, picture: bytes) -> bytes:
    """A frame as it goes over the socket."""
    head = {
        "kind": "frame",
        "age_s": age_s,
        "gimbal": [gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad],
        "truth": truth_table(truth),
        "bytes": len(picture),
    }
    return json.dumps(head, separators=(",", ":")).encode() + b"\n" + picture


def verdict_record(verdict: TouchdownVerdict) -> bytes:
    """The touchdown as it goes over the socket."""
    return json.dumps({"kind": "verdict", "verdict": verdict_table(verdict)}, separators=(",", ":")).encode() + b"\n"
