"""A Parrot ANAFI as a vehicle."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.guidance.response import Response
from shipland.messages import Frame, Intent, PilotCommand, Telemetry
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.anafi.checks import Limits, age_check, fence_check, limits_check
from shipland.vehicles.anafi.process import AnafiProcess
from shipland.vehicles.anafi.records import finite, gimbal_of, merged, sticks_of, with_metadata
from shipland.vehicles.anafi.setup import AnafiSetup
from shipland.vehicles.camera_stream import ExposureClock, StreamedPicture, wrong_size
from shipland.vehicles.checks import Check, battery_check, rate_hz, telemetry_check
from shipland.vehicles.gimbal import Reading, gimbal_at
from shipland.vehicles.link_vehicle import LinkVehicle
from shipland.vehicles.touchdown import MOTORS_STOPPED, motors_stopped
from shipland.vehicles.vehicle import LONGEST_WAIT_S, Vehicle, unless_late
from shipland.vehicles.waiting import wait_until

_GIMBAL_S = 0.1
_LANDED_S = 1.0
"""Descent commanded and none seen for so long, while landing at contact height: it stands, and is commanded to land."""
_OLD_VELOCITY_S = 1.0
"""A velocity older than this does not show that it stands."""
_AIRBORNE = ("hovering", "flying")
_HOMING = ("inProgress", "in_progress", "pending")
"""States of a flight home, as the older and the newer event name them."""
_READINGS = 64
"""Readings of the gimbal that are kept: a dozen seconds of events."""
_PLANES = {"I420": cv2.COLOR_YUV2BGR_I420, "NV12": cv2.COLOR_YUV2BGR_NV12}


class AnafiVehicle(LinkVehicle):
    """An ANAFI through the process that speaks to it."""

    def __init__(self, setup: AnafiSetup) -> None:
        super().__init__()
        self._setup, self._parameters = setup, setup.parameters
        self._process: AnafiProcess | None = None
        self._changed = threading.Condition()
        self._telemetry = Telemetry(0.0)
        self._gimbals: deque[Reading] = deque(maxlen=_READINGS)
        self._limits: Limits | None = None
        self._shot: StreamedPicture | None = None
        self._clock = ExposureClock(self._parameters.latency_s)
        self._pictures: deque[float] = deque(maxlen=300)
        self._late: deque[float] = deque(maxlen=300)
        self._attitudes: deque[float] = deque(maxlen=300)
        self._state = ""
        self._home: dict[str, str] = {}
        """What each of the events that tell of a flight home said last."""
        self._heard_s = self._given_s = self._pictured_s = self._gimbal_s = self._still_s = self._asked_s = -math.inf
        self._answers = self._watched = self._yielded = False
        self._landing = self._at_contact_height = False
        self._problem, self._shown = "", b""
        self._in_command = "somebody else (not given to us yet)"
        self._refused = 0

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures."""
        return self._setup.camera

    @property
    def in_command(self) -> str:
        """Who flies it, in words: "shipland", or another and what that one does."""
        return self._in_command

    @property
    def refused(self) -> int:
        """Records and requests that could not be used."""
        return self._refused + (0 if self._process is None else self._process.refused)

    def response(self) -> Response:
        """What full sticks mean."""
        return self._setup.response

    def _connect(self) -> None:
        parameters = self._parameters
        process = self._process = AnafiProcess(self._setup.command, self._on_record, self._on_gone, self._setup.log)
        self._stack.callback(process.close)
        self._wait(lambda: self._answers, "the ANAFI does not answer (is Olympe installed there?)")
        wanted = {
            "tilt_deg": parameters.max_tilt_deg,
            "climb_mps": parameters.max_climb_mps,
            "turn_deg_s": parameters.max_turn_deg_s,
        }
        process.say({"limits": wanted})
        self._wait(lambda: self._limits is not None, "the ANAFI does not tell its limits")

    def _engage(self) -> None:
        """Take off if configured, else wait until the operator has."""
        assert self._process is not None  # connected
        self._wait(lambda: self._shot is not None, "no picture from the ANAFI")
        with self._changed:  # no event between seeing that it flies and watching who lands it
            landed = self._state in ("", "landed")  # elsewhere a take-off would undo a landing
            if self._setup.take_off and landed and not self._flies_home():
                self._refuse_if_suspended()
                self._watched, self._in_command = True, "shipland"
                self._process.say({"take_off": True})
            timeout_s = self._parameters.engage_timeout_s
            self._wait(lambda: self._state in _AIRBORNE and not self._flies_home(), self._not_ours, timeout_s)
            self._pictured_s = self._still_s = time.monotonic()
            self._watched = self._engaged = True
            self._in_command = "shipland"

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """The newest picture not given, or none within `LONGEST_WAIT_S`; None when the flight is over."""
        if not self._engaged or self._closed or self._end_reason:
            return None
        with self._changed:
            self._changed.wait_for(self._has_news, LONGEST_WAIT_S)
            shot, over = self._shot, self._closed or bool(self._end_reason)
        if over or self._is_silent():
            return None
        now_s = time.monotonic()
        if shot is None or shot.exposed_s <= self._given_s:
            if now_s - self._pictured_s <= self._parameters.video_timeout_s:
                return None, self.telemetry_at(now_s)
            words = self._problem or f"no picture for {self._parameters.video_timeout_s:g} s"
            self._end(f"video lost: {words}; the ANAFI holds", "the ANAFI itself (holds)")
            return None
        self._given_s, self._pictured_s = shot.exposed_s, now_s
        gimbal, age_s = (shot.gimbal, 0.0) if shot.gimbal else gimbal_at(shot.exposed_s, [], list(self._gimbals), None)
        return Frame(shot.exposed_s, shot.image, gimbal, gimbal_age_s=age_s), self.telemetry_at(now_s)

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""
        return replace(self._telemetry, t_s=t_s if math.isfinite(t_s) else time.monotonic())

    def send(self, command: PilotCommand) -> None:
        """Sticks, and the gimbal at most ten times a second."""
        with self._changed:  # whoever ends the flight on the other thread has the last word
            if self._closed or self._end_reason or not self._engaged or self._process is None or self._has_slept():
                return
            now_s = time.monotonic()
            command = unless_late(command, now_s)
            self._landing, self._at_contact_height = command.intent is Intent.LAND, command.at_contact_height
            by_itself = self._landing and "landing" in self._state  # its own landing wants no sticks
            self._process.say({"sticks": [0, 0, 0, 0] if by_itself else sticks_of(command)})
            if math.isfinite(command.gimbal_pitch_rad) and now_s - self._gimbal_s >= _GIMBAL_S:
                self._gimbal_s = now_s
                self._process.say({"gimbal_deg": math.degrees(command.gimbal_pitch_rad)})
            self._land_when_down(command, now_s)

    def _leave(self) -> None:
        """The closed process releases the sticks, and the ANAFI holds its place."""
        if self._in_command == "shipland":
            self._in_command = "the ANAFI itself (holds)"

    def checks(self) -> list[Check]:
        """What of it is fit to fly; once connected."""
        limits, wanted = self._limits or {}, self._setup.preflight
        late_s, picture_hz = sorted(self._late) or [math.nan], rate_hz(list(self._pictures))
        pictures = self._problem or f"{picture_hz:.0f} Hz, at least {wanted.picture_hz:g}"
        return [
            limits_check(limits, self._parameters),
            telemetry_check(rate_hz(list(self._attitudes)), wanted.telemetry_hz),
            Check("pictures", not self._problem and picture_hz >= wanted.picture_hz, pictures),
            age_check(self._parameters.latency_s, late_s[int(0.95 * (len(late_s) - 1))], wanted.picture_age_s),
            fence_check(limits),
            battery_check(self._telemetry.battery_percent, wanted.battery_percent),
        ]

    def _has_news(self) -> bool:
        news = self._shot is not None and self._shot.exposed_s > self._given_s
        return news or self._closed or bool(self._end_reason)

    def _is_silent(self) -> bool:
        """No event of the aircraft for too long ends the flight; pictures come another way and say nothing of it.

        So does a machine that was suspended.
        """
        if self._has_slept():
            return True
        timeout_s = self._parameters.link_timeout_s
        if time.monotonic() - self._heard_s <= timeout_s:
            return False
        self._end(f"link lost: the ANAFI says nothing for {timeout_s:g} s", "nobody: link lost")
        return True

    def _has_slept(self) -> bool:
        """Whether the machine was suspended, which ends the flight; who flies it by now is not known, and keeps it."""
        if words := self._suspended:
            self._end(f"{words}; the vehicle holds", "the ANAFI itself (holds)", yielded=True)
        return bool(words)

    def _flies_home(self) -> bool:
        return any(state in _HOMING for state in self._home.values())

    def _not_ours(self) -> str:
        """Why it cannot be taken yet, in words."""
        return "the ANAFI flies home by itself: not over" if self._flies_home() else "the ANAFI has not taken off"

    def _land_when_down(self, command: PilotCommand, now_s: float) -> None:
        """At contact height, no descent in spite of the sticks: it stands, and its own landing stops the motors."""
        wanted_mps = -0.01 * sticks_of(command)[3] * self._setup.response.max_climb_mps
        if command.intent is not Intent.LAND or wanted_mps < 0.1 or self._sinks(0.4 * wanted_mps, now_s):
            self._still_s = now_s
        elif not command.at_contact_height or "landing" in self._state:
            self._still_s = now_s  # what holds it up in the air is no deck
        elif now_s - max(self._still_s, self._asked_s) > _LANDED_S:
            self._asked_s = now_s
            assert self._process is not None
            self._process.say({"land": True})

    def _sinks(self, least_mps: float, now_s: float) -> bool:
        """Whether it descends at this rate or faster, or its rate is unknown."""
        velocity, true_s = self._telemetry.velocity_in_level_mps, self._telemetry.velocity_t_s
        if velocity is None or true_s is None or now_s - true_s > _OLD_VELOCITY_S:
            return True
        return float(velocity[2]) > least_mps

    def _end(self, reason: str, in_command: str, *, yielded: bool = False) -> None:
        """No more frames; the first reason stands. Sticks are released, or, to another pilot, not sent any more.

        Whoever takes it after an end of ours is told of as well, and is sent no released sticks either.
        """
        with self._changed:
            if not self._end_reason or (yielded and not self._yielded):
                self._end_reason = f"{self._end_reason}; then {reason}" if self._end_reason else reason
                self._in_command, self._yielded = in_command, yielded
                if self._process is not None:
                    self._process.say({"stop": True} if yielded else {"sticks": [0, 0, 0, 0]})
            self._changed.notify_all()

    def _wait(
        self, until: Callable[[], bool], otherwise: str | Callable[[], str], timeout_s: float | None = None
    ) -> None:
        words = otherwise if callable(otherwise) else lambda: otherwise
        timeout_s = timeout_s or self._parameters.connect_timeout_s
        with self._changed:
            wait_until(lambda: until() or self._problem or self._end_reason, timeout_s, words, self._changed.wait)
            if not until():
                raise VehicleError(self._problem or self._end_reason)

    # What the far end says, on the process's thread

    def _on_gone(self) -> None:
        if not self._closed:
            self._end("the process that speaks to the ANAFI has ended", "nobody: link lost")

    def _on_record(self, record: Mapping[str, Any], data: bytes) -> None:
        with self._changed:
            self._take(record, data)
            self._changed.notify_all()

    def _take(self, record: Mapping[str, Any], data: bytes) -> None:
        kind, t_s, values = record["kind"], min(finite(record["t_s"]), time.monotonic()), record.get("values", {})
        if kind == "connected":
            self._answers = True
        elif kind == "problem":
            self._problem = str(record["words"])
        elif kind == "refused":
            self._refused += 1
        elif kind == "limits":
            self._limits = {str(name): None if value is None else finite(value) for name, value in values.items()}
        elif kind == "picture":
            self._take_picture(record, data)
        elif kind == "lost":
            self._end("link lost: the ANAFI has gone", "nobody: link lost")
        else:
            self._heard_s = t_s
            self._take_event(kind, values, t_s - self._parameters.event_latency_s)

    def _take_event(self, kind: str, values: Mapping[str, Any], true_s: float) -> None:
        if kind == "gimbal":
            gimbal = gimbal_of(values)
            self._gimbals.append((true_s, gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad))
            return
        before, was = self._telemetry, self._state
        self._telemetry = merged(before, kind, values, true_s)
        if kind == "attitude":
            self._attitudes.append(true_s)
        elif kind == "flying":
            self._state = str(values["state"])
        elif kind in ("home", "rth"):
            self._home[kind] = str(values["state"])
        if self._watched:
            self._judge(kind, values, was, flew=before.flying)

    def _judge(self, kind: str, values: Mapping[str, Any], was: str, *, flew: bool) -> None:
        """End the flight when the aircraft is down, or does what we did not command; from our own take-off on."""
        asked = time.monotonic() - self._asked_s <= _LANDED_S
        ours = "landing" in was or asked or (self._landing and self._at_contact_height)
        if kind in ("home", "rth") and values["state"] in _HOMING:
            reason = f"the ANAFI flies home by itself: {values.get('reason', '')}"
            self._end(reason, "the ANAFI itself (returns home)", yielded=True)
        elif kind != "flying":
            return
        elif flew and not self._telemetry.flying:
            self._end(motors_stopped(ours or self._landing), f"nobody: {MOTORS_STOPPED}", yielded=True)
        elif "landing" in self._state and not ours:  # high over the deck, our sticks begin no landing of its own
            self._end(f"somebody else lands the ANAFI: {self._state}", "somebody else (landing)", yielded=True)

    def _take_picture(self, record: Mapping[str, Any], data: bytes) -> None:
        arrived_s, (width_px, height_px) = time.monotonic(), map(int, record["size_px"])
        if wrong := wrong_size("pictures are", (width_px, height_px), (self.camera.width_px, self.camera.height_px)):
            self._problem = wrong
            return
        before, self._shown = self._shown, data
        if data == before:  # no two of a camera have the same noise: the stream stands still
            self._refused += 1
            return
        image = _bgr(data, record["planes"], width_px, height_px)
        exposed_s = self._clock.exposed_s(float(record["stamp_s"]), arrived_s)
        if exposed_s is None:
            self._refused += 1
            return
        gimbal = None
        if record.get("metadata"):
            try:
                self._telemetry, gimbal = with_metadata(self._telemetry, record["metadata"], exposed_s)
            except (KeyError, ValueError, TypeError, OverflowError):
                self._refused += 1
            else:
                self._attitudes.append(arrived_s)
        self._pictures.append(arrived_s)
        self._late.append(arrived_s - exposed_s - self._parameters.latency_s)
        self._shot, self._problem = StreamedPicture(image, exposed_s, arrived_s, gimbal), ""


def _bgr(data: bytes, planes: str, width_px: int, height_px: int) -> npt.NDArray[np.uint8]:
    yuv = np.frombuffer(data, np.uint8).reshape(height_px * 3 // 2, width_px)
    return np.asarray(cv2.cvtColor(yuv, _PLANES[planes]), np.uint8)


def anafi(setup: VehicleSetup) -> Vehicle:
    """`anafi://192.168.42.1?python=/path/of/olympe/bin/python&stream=rtsp://192.168.42.1/live&takeoff=1`."""
    return AnafiVehicle(AnafiSetup.of(setup))
