"""A Parrot ANAFI through Olympe, which pins old libraries and so runs in a process and environment of its own."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shipland.camera import Camera
from shipland.config import build, require
from shipland.errors import VehicleError
from shipland.frames import wrap_angle
from shipland.guidance.response import Response
from shipland.messages import Frame, GimbalAttitude, Intent, PilotCommand, Telemetry
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.camera_stream import ExposureClock, Shot
from shipland.vehicles.checks import Check, PreflightParameters
from shipland.vehicles.vehicle import LONGEST_WAIT_S, Vehicle

_FLYING = ("hovering", "flying", "takingoff", "landing", "motor_ramping", "usertakeoff")
_GIMBAL_S = 0.1
_LANDED_S = 1.0
"""Descent commanded and none seen for so long, while landing: it stands, and is told to land."""


@dataclass(frozen=True)
class AnafiParameters:
    """`[anafi]` of vehicles.toml.

    Attributes:
        max_tilt_deg, max_climb_mps, max_turn_deg_s: set on the aircraft and read back; what full sticks mean.
        connect_timeout_s: to the connection and to the first picture.
        engage_timeout_s: until somebody has taken off.
        video_timeout_s: without a picture for so long the flight is over.
        latency_s: from exposure to receipt of the quickest picture.
    """

    max_tilt_deg: float
    max_climb_mps: float
    max_turn_deg_s: float
    connect_timeout_s: float
    engage_timeout_s: float
    video_timeout_s: float
    latency_s: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require(value > 0.0, f"{name} must be positive, got {value}")


def anafi(setup: VehicleSetup) -> Vehicle:
    """`anafi://192.168.42.1?python=/path/of/olympe/bin/python&takeoff=1`."""
    setup.address.only("python", "takeoff")
    python = setup.address.options.get("python", sys.executable)
    parameters = build(AnafiParameters, setup.table["anafi"], "vehicles.anafi")
    preflight = build(PreflightParameters, setup.table["preflight"], "vehicles.preflight")
    lags = {"max_speed_mps": 0.0, "servo_per_s": 0.0, **setup.table["response"]["attitude"]}  # type: ignore[dict-item]
    response = build(
        Response,
        {
            **lags,
            "kind": "attitude",
            "max_tilt_rad": math.radians(parameters.max_tilt_deg),
            "max_climb_mps": parameters.max_climb_mps,
            "max_turn_rad_s": math.radians(parameters.max_turn_deg_s),
            "stick_step_percent": 1.0,
            "hold_below_percent": 1.0,
        },
        "response.attitude",
    )
    command = [python, str(Path(__file__).with_name("anafi_end.py")), setup.address.place]
    return AnafiVehicle(command, setup.camera, parameters, preflight, response, setup.address.flag("takeoff"))


class AnafiVehicle:
    """A `Vehicle` on `time.monotonic`.

    Args:
        command: starts the far end.
        camera: intrinsics.
        parameters: see there.
        preflight: what must be in order.
        response: what full sticks mean.
        take_off: whether it takes off by itself.
    """

    def __init__(
        self,
        command: list[str],
        camera: Camera,
        parameters: AnafiParameters,
        preflight: PreflightParameters,
        response: Response,
        take_off: bool,
    ) -> None:
        self._command, self._camera, self._parameters = command, camera, parameters
        self._preflight, self._response, self._take_off = preflight, response, take_off
        self._process: subprocess.Popen[bytes] | None = None
        self._changed = threading.Condition()
        self._telemetry = Telemetry(0.0, None, None, None, None, None, None, None, flying=False)
        self._gimbal = GimbalAttitude(0.0, 0.0)
        self._limits: dict[str, float | None] | None = None
        self._shot: Shot | None = None
        self._clock = ExposureClock(parameters.latency_s)
        self._given_s = self._pictured_s = self._gimbal_s = self._still_s = -math.inf
        self._connected = self._engaged = self._closed = self._asked_to_land = False
        self._end_reason = self._problem = ""
        self.refused = 0
        """Records that could not be used."""

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures."""
        return self._camera

    @property
    def end_reason(self) -> str:
        """Why the flight is over, in words; empty in flight."""
        return self._end_reason

    def response(self) -> Response:
        """What full sticks mean."""
        return self._response

    def connect(self) -> None:
        """Olympe, the aircraft, its limits, its stream; VehicleError when something does not answer."""
        if self._process is not None:
            return
        try:
            self._process = subprocess.Popen(  # noqa: S603 - the Python that the user named, and our own file
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
        except OSError as error:
            raise VehicleError(f"{self._command[0]} cannot be started: {error.strerror}") from None
        threading.Thread(target=self._listen, name="anafi", daemon=True).start()
        parameters = self._parameters
        try:
            self._wait(lambda: self._connected, "the ANAFI does not answer (is Olympe installed there?)")
            wanted = {
                "tilt_deg": parameters.max_tilt_deg,
                "climb_mps": parameters.max_climb_mps,
                "turn_deg_s": parameters.max_turn_deg_s,
            }
            self._say({"limits": wanted})
            self._wait(lambda: self._limits is not None, "the ANAFI does not tell its limits")
        except BaseException:
            self.close()
            raise

    def open(self) -> None:
        """Connect; take off where that was asked for, else wait until somebody has."""
        if self._closed:
            raise VehicleError("this flight is over; make a new vehicle for the next one")
        self.connect()
        self._wait(lambda: self._shot is not None, "no picture from the ANAFI")
        if self._take_off:
            self._say({"take_off": True})
        self._wait(lambda: self._telemetry.flying, "the ANAFI has not taken off", self._parameters.engage_timeout_s)
        self._pictured_s = time.monotonic()
        self._engaged = True

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """The newest picture not given, or none within `LONGEST_WAIT_S`; None when the flight is over."""
        if not self._engaged or self._closed or self._end_reason:
            return None
        with self._changed:
            self._changed.wait_for(self._has_news, LONGEST_WAIT_S)
            shot, over = self._shot, self._closed or bool(self._end_reason)
        now_s = time.monotonic()
        if over:
            return None
        if shot is None or shot.exposed_s <= self._given_s:
            if now_s - self._pictured_s <= self._parameters.video_timeout_s:
                return None, self.telemetry_at(now_s)
            words = self._problem or f"no picture for {self._parameters.video_timeout_s:g} s"
            self._end(f"video lost: {words}; the ANAFI holds")
            return None
        self._given_s, self._pictured_s = shot.exposed_s, now_s
        return Frame(shot.exposed_s, shot.image, shot.gimbal or self._gimbal), self.telemetry_at(now_s)

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""
        return replace(self._telemetry, t_s=t_s if math.isfinite(t_s) else time.monotonic())

    def send(self, command: PilotCommand) -> None:
        """Sticks, and the gimbal at most ten times a second."""
        if self._closed or self._end_reason or not self._engaged:
            return
        self._say({"sticks": sticks_of(command)})
        now_s = time.monotonic()
        if math.isfinite(command.gimbal_pitch_rad) and now_s - self._gimbal_s >= _GIMBAL_S:
            self._gimbal_s = now_s
            self._say({"gimbal_deg": math.degrees(command.gimbal_pitch_rad)})
        self._land_when_down(command, now_s)

    def close(self) -> None:
        """Release the sticks and let go; the ANAFI holds its place."""
        if self._closed:
            return
        self._closed = True
        process = self._process
        if process is not None and process.stdin is not None:
            try:
                process.stdin.close()
                process.wait(3.0)
            except (OSError, subprocess.TimeoutExpired):
                process.kill()
                process.wait()

    def checks(self) -> list[Check]:
        """What of it is fit to fly; once connected."""
        wanted, parameters = self._preflight, self._parameters
        asked = (parameters.max_tilt_deg, parameters.max_climb_mps, parameters.max_turn_deg_s)
        accepted = self._limits or {}
        read = tuple(accepted.get(key) for key in ("tilt_deg", "climb_mps", "turn_deg_s"))
        same = all(
            value is not None and abs(value - want) < 0.05 * want for value, want in zip(read, asked, strict=True)
        )
        battery = self._telemetry.battery_percent
        age_s = math.nan if self._shot is None else self._shot.arrived_s - self._shot.exposed_s
        return [
            Check("limits", same, f"asked for {asked}, read back {read}: tilt [°], climb [m/s], turn [°/s]"),
            Check("pictures", self._shot is not None, self._problem or f"{age_s:.3f} s old at receipt"),
            Check(
                "battery", battery is not None and battery >= wanted.battery_percent,
                "unknown" if battery is None else f"{battery:.0f} %, at least {wanted.battery_percent:g}",
            ),
            Check("geofence", True, "set it in FreeFlight: distance and height"),
        ]  # fmt: skip

    def _has_news(self) -> bool:
        news = self._shot is not None and self._shot.exposed_s > self._given_s
        return news or self._closed or bool(self._end_reason)

    def _land_when_down(self, command: PilotCommand, now_s: float) -> None:
        """While landing, no descent in spite of the sticks: it stands, and its own landing stops the motors."""
        velocity = self._telemetry.velocity_in_level_mps
        wanted_mps = -0.01 * command.heave_percent * self._response.max_climb_mps
        sinks = velocity is None or float(velocity[2]) > 0.4 * wanted_mps
        if command.intent is not Intent.LAND or wanted_mps < 0.1 or sinks:
            self._still_s = now_s
        elif now_s - self._still_s > _LANDED_S and not self._asked_to_land:
            self._asked_to_land = True
            self._say({"land": True})

    def _say(self, record: Mapping[str, Any]) -> None:
        process = self._process
        if process is None or process.stdin is None:
            return
        try:
            process.stdin.write(json.dumps(record).encode() + b"\n")
            process.stdin.flush()
        except (OSError, ValueError):
            self._end("the process that speaks to the ANAFI has ended")

    def _end(self, reason: str) -> None:
        with self._changed:
            self._end_reason = self._end_reason or reason
            self._changed.notify_all()

    def _wait(self, until: Any, otherwise: str, timeout_s: float | None = None) -> None:  # noqa: ANN401
        timeout_s = timeout_s or self._parameters.connect_timeout_s
        with self._changed:
            self._changed.wait_for(lambda: until() or self._problem or self._end_reason, timeout_s)
        if not until():
            raise VehicleError(self._problem or self._end_reason or f"{otherwise} within {timeout_s:g} s")

    def _listen(self) -> None:
        """Take in what the far end says, on a thread of its own."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        with process.stdout as stream:
            while line := stream.readline():
                try:
                    record = json.loads(line)
                    data = stream.read(int(record.get("bytes", 0)))
                    with self._changed:
                        self._take(record, data)
                        self._changed.notify_all()
                except (ValueError, KeyError, TypeError):
                    self.refused += 1
        if not self._closed:
            self._end("the process that speaks to the ANAFI has ended")

    def _take(self, record: Mapping[str, Any], data: bytes) -> None:
        kind, t_s, values = record["kind"], float(record["t_s"]), record.get("values", {})
        if kind == "connected":
            self._connected = True
        elif kind == "problem":
            self._problem = str(record["words"])
        elif kind == "limits":
            self._limits = dict(values)
        elif kind == "picture":
            self._take_picture(record, data)
        elif kind == "gimbal":
            angles = (values["roll_absolute"], values["pitch_absolute"])
            self._gimbal = GimbalAttitude(*(math.radians(_finite(angle)) for angle in angles))
        elif kind == "refused":
            self.refused += 1
        else:
            before = self._telemetry.flying
            self._telemetry = merged(self._telemetry, kind, values, t_s)
            if self._engaged and before and not self._telemetry.flying:
                self._end_reason = self._end_reason or "landed: the motors have stopped"

    def _take_picture(self, record: Mapping[str, Any], data: bytes) -> None:
        arrived_s, shape = time.monotonic(), tuple(record["shape"])
        wanted = (self._camera.height_px, self._camera.width_px, 3)
        if data and shape != wanted:
            self._problem = (
                f"pictures are of {shape[1]} × {shape[0]} px, the calibration is for {wanted[1]} × {wanted[0]}"
            )
            return
        image = np.frombuffer(data, np.uint8).reshape(wanted) if data else None
        self._shot = Shot(image, self._clock.exposed_s(float(record["stamp_s"]), arrived_s), arrived_s)


def sticks_of(command: PilotCommand) -> list[int]:
    """PCMD's roll, pitch, yaw and gaz in whole percent; all released for a hold or what is no number.

    >>> sticks_of(PilotCommand(0.0, 10.4, -20.0, 5.0, 200.0, 0.0))
    [-20, 10, 100, 5]
    """
    values = (command.roll_percent, command.pitch_percent, command.yaw_percent, command.heave_percent)
    if command.intent is Intent.HOLD or not all(map(math.isfinite, values)):
        return [0, 0, 0, 0]
    return [round(min(max(value, -100.0), 100.0)) for value in values]


def merged(before: Telemetry, kind: str, values: Mapping[str, Any], t_s: float) -> Telemetry:
    """Telemetry after one of the ANAFI's events.

    Args:
        before: what was known.
        kind: of the event.
        values: its arguments by name, as ARSDK has them.
        t_s: its receipt.

    Raises:
        ValueError: a value is not finite.
        KeyError: a value is missing.
    """
    if kind == "attitude":
        roll, pitch, yaw = (_finite(values[name]) for name in ("roll", "pitch", "yaw"))
        return replace(
            before, roll_rad=roll, pitch_rad=pitch, heading_rad=wrap_angle(yaw), attitude_t_s=t_s, heading_t_s=t_s
        )
    if kind == "altitude":
        return replace(before, height_m=_finite(values["altitude"]), height_t_s=t_s)
    if kind == "speed" and before.heading_rad is not None:
        north, east, down = (_finite(values[name]) for name in ("speedX", "speedY", "speedZ"))
        c, s = math.cos(before.heading_rad), math.sin(before.heading_rad)
        level = np.array([c * north + s * east, c * east - s * north, down])
        return replace(before, velocity_in_level_mps=level, velocity_t_s=t_s)
    if kind == "battery":
        return replace(before, battery_percent=min(100.0, max(0.0, _finite(values["percent"]))))
    if kind == "link":
        # the last four bits: 1 … 5 bars
        return replace(before, link_percent=min(100.0, 20.0 * (int(values["value"]) & 0x0F)))
    if kind == "flying":
        return replace(before, flying=values["state"] in _FLYING)
    return before


def _finite(value: Any) -> float:  # noqa: ANN401 - from JSON
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"not finite: {value}")
    return number
