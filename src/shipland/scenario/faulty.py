"""A vehicle, a vision and a pilot that fail on schedule; the physics of the flight is undisturbed."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections import deque
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.guidance.pilot import Pilot
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    Frame,
    GimbalAttitude,
    GroundTruth,
    Observation,
    PilotCommand,
    Telemetry,
    TouchdownVerdict,
)
from shipland.scenario.faults import Fault, FaultKind
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vehicles.vehicle import LONGEST_WAIT_S
from shipland.vision.vision import Vision

T = TypeVar("T")
_NUMBERS = (float("nan"), float("inf"), float("-inf"), 1e12, -1e12, 1e6, -1e6)
_OLD_SHARE = 0.1
"""Share of spoiled messages that are replaced by an earlier one as a whole."""


_NOT_SPOILED = {"stamp_s", "gimbal_age_s", "alerts", "waves_off"}
"""Skipped without a draw, so that a flight's spoiled values stay what they were."""


def _spoil(value: Any, share: float, rng: np.random.Generator) -> Any:  # noqa: ANN401 - messages of any type
    """A message with some of its fields spoiled, its arrays keeping their shape."""
    hints = typing.get_type_hints(type(value))
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(value):
        if field.name in _NOT_SPOILED:
            continue
        before = getattr(value, field.name)
        optional = type(None) in typing.get_args(hints[field.name])
        if dataclasses.is_dataclass(before):
            changes[field.name] = _spoil(before, share, rng)
        if rng.random() >= share:
            continue
        number = float(rng.choice(_NUMBERS))
        if before is not None and optional and rng.random() < 0.3:
            changes[field.name] = None
        elif isinstance(before, float):
            changes[field.name] = number
        elif isinstance(before, tuple) and before:
            index = int(rng.integers(len(before)))
            changes[field.name] = (*before[:index], number, *before[index + 1 :])
        elif isinstance(before, np.ndarray) and before.dtype == float and before.size:
            spoiled = before.copy()
            spoiled.flat[int(rng.integers(before.size))] = number
            changes[field.name] = spoiled
    return replace(value, **changes) if changes else value


_LONGEST_ASKED_S = 1.0
"""Longest time that one call may let pass: a spoiled clock can ask for hours."""
_HELD = 100
"""Pictures kept for late and frozen ones: three seconds."""
_BLOCK_PX = 32
_REVERSED = {
    FaultKind.REVERSED_PITCH: "pitch_percent",
    FaultKind.REVERSED_ROLL: "roll_percent",
    FaultKind.REVERSED_HEAVE: "heave_percent",
    FaultKind.REVERSED_YAW: "yaw_percent",
}


class FaultyVehicle:
    """A `Vehicle` and `GroundTruthSource` over a simulated one whose frames, telemetry, link and motors fail."""

    def __init__(self, vehicle: SimulatedVehicle, faults: tuple[Fault, ...], rng: np.random.Generator) -> None:
        self._vehicle, self._faults, self.rng = vehicle, faults, rng
        self.now_s = self._reported_s = 0.0
        """The vehicle's time, not spoiled [s]."""
        self._good: dict[type, Any] = {}
        """The last message of each type that was not spoiled."""
        self._held: deque[Frame] = deque(maxlen=_HELD)
        self._given_s = -math.inf
        self._last_image: npt.NDArray[np.uint8] | None = None
        self._last: Telemetry | None = None
        self._last_gimbal: tuple[float, GimbalAttitude] | None = None
        self._last_height: tuple[float | None, float] | None = None
        self._served: set[int] = set()
        self._rotor = int(rng.integers(4))
        self._weak: Fault | None = None
        bearing_rad = float(rng.uniform(-math.pi, math.pi))
        self._direction = np.array([math.cos(bearing_rad), math.sin(bearing_rad), 0.0])

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the simulated vehicle has
        return getattr(self._vehicle, name)

    @property
    def camera(self) -> Camera:
        """See `Vehicle`."""
        return self._vehicle.camera

    def open(self) -> None:
        """See `Vehicle`."""
        self._vehicle.open()

    def close(self) -> None:
        """See `Vehicle`."""
        self._vehicle.close()

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """See `GroundTruthSource`."""
        return self._vehicle.truth_at(t_s)

    def verdict(self) -> TouchdownVerdict | None:
        """See `GroundTruthSource`."""
        return self._vehicle.verdict()

    def now(self, kind: FaultKind) -> Fault | None:
        """The fault of this kind that is on."""
        return next((fault for fault in self._faults if fault.kind is kind and fault.covers(self.now_s)), None)

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """See `Vehicle`; pictures that are lost on the way are waited for as on a link."""
        begun_s = self.now_s
        while (pair := self._vehicle.read()) is not None:
            self.now_s = pair[1].t_s
            self._weaken()
            frame = self._delivered(pair[0])
            if frame is not None:
                return self.spoiled(self._with_gimbal(self._spoiled_image(frame))), self._telemetry(pair[1])
            if self.now_s - begun_s >= LONGEST_WAIT_S:
                return None, self._telemetry(pair[1])
        return None

    def telemetry_at(self, t_s: float) -> Telemetry:
        """See `Vehicle`; a process that stands still asks later."""
        telemetry = self._vehicle.telemetry_at(self._own_time(t_s) + self._stall_s(FaultKind.PROCESS_STALL))
        self.now_s = telemetry.t_s
        self._weaken()
        return self._telemetry(telemetry)

    def send(self, command: PilotCommand) -> None:
        """See `Vehicle`."""
        stall_s, decided_s = self._stall_s(FaultKind.PILOT_STALLS), self._own_time(command.t_s)
        if stall_s > 0.0:
            self.now_s = self._vehicle.telemetry_at(self.now_s + stall_s).t_s
        reversed_percent = {
            stick: -getattr(command, stick) for kind, stick in _REVERSED.items() if self.now(kind) is not None
        }
        if self.now(FaultKind.LINK_LOSS) is None:
            self._vehicle.send(replace(command, t_s=decided_s, **reversed_percent))

    def _own_time(self, t_s: float) -> float:
        """A time of the loop, which knows the vehicle's clock from spoiled telemetry, by that clock as it is."""
        passed_s = t_s - self._reported_s
        if passed_s <= _LONGEST_ASKED_S and self._reported_s == self.now_s:
            return t_s
        return self.now_s + passed_s if 0.0 <= passed_s <= _LONGEST_ASKED_S else self.now_s

    def spoiled(self, value: T) -> T:
        """A message of any type as it is, or with a share of its fields spoiled."""
        fault = self.now(FaultKind.SPOILED_VALUES)
        if fault is None:
            self._good[type(value)] = value
            return value
        if self.rng.random() < _OLD_SHARE * fault.amount and type(value) in self._good:
            return typing.cast(T, self._good[type(value)])
        return typing.cast(T, _spoil(value, fault.amount, self.rng))

    def _stall_s(self, kind: FaultKind) -> float:
        fault = self.now(kind)
        if fault is None or id(fault) in self._served:
            return 0.0
        self._served.add(id(fault))
        return fault.duration_s

    def _delivered(self, frame: Frame) -> Frame | None:
        """The frame that comes through now, or None."""
        self._held.append(frame)
        dropped = self.now(FaultKind.DROPPED_FRAMES)
        if self.now(FaultKind.LINK_LOSS) is not None or (dropped and self.rng.random() < dropped.amount):
            return None
        late = self.now(FaultKind.LATENCY_JUMP)
        if late is not None:
            old = [held for held in self._held if self._given_s < held.t_s <= frame.t_s - late.amount]
            if not old:
                return None
            frame = old[-1]
        self._given_s = frame.t_s
        aged = self.now(FaultKind.OLD_PICTURES)
        if aged is not None:
            shown_s = frame.t_s - aged.amount
            shown = next((held for held in reversed(self._held) if held.t_s <= shown_s), self._held[0])
            # Whoever looks up what the picture shows finds it by `stamp_s`.
            frame = replace(frame, image=shown.image, stamp_s=shown.t_s)
        return frame

    def _with_gimbal(self, frame: Frame) -> Frame:
        """The frame with the camera's attitude as it is read."""
        stale = self.now(FaultKind.STALE_GIMBAL) is not None
        if self._last_gimbal is not None and (stale or self.now(FaultKind.FROZEN_GIMBAL) is not None):
            read_s, gimbal = self._last_gimbal
            return replace(frame, gimbal=gimbal, gimbal_age_s=frame.t_s - read_s if stale else frame.gimbal_age_s)
        self._last_gimbal = frame.t_s, frame.gimbal
        return frame

    def _spoiled_image(self, frame: Frame) -> Frame:
        image = frame.image
        if image is None:
            return frame
        if self.now(FaultKind.FROZEN_FRAMES) is not None and self._last_image is not None:
            return replace(frame, image=self._last_image)
        self._last_image = image
        if self.now(FaultKind.WRONG_SIZE_FRAMES) is not None:
            return replace(frame, image=np.ascontiguousarray(image[::2, ::2]))
        height_px, width_px = image.shape[:2]
        corrupt, glare = self.now(FaultKind.CORRUPT_FRAMES), self.now(FaultKind.GLARE)
        if corrupt is not None:
            image = image.copy()
            for top in range(0, height_px, _BLOCK_PX):
                for left in range(0, width_px, _BLOCK_PX):
                    if self.rng.random() < corrupt.amount:
                        block = image[top : top + _BLOCK_PX, left : left + _BLOCK_PX]
                        block[:] = self.rng.integers(0, 256, block.shape, dtype=np.uint8)
        if glare is not None and self.rng.random() < glare.amount:
            image = np.maximum(image, np.uint8(235))
        if self.now(FaultKind.OCCLUSION) is not None:
            image = image.copy()
            image[height_px // 5 : 4 * height_px // 5, width_px // 5 : 4 * width_px // 5] = 90
        return replace(frame, image=image)

    def _telemetry(self, telemetry: Telemetry) -> Telemetry:
        given = self._altered(telemetry)
        self._reported_s = given.t_s
        return given

    def _altered(self, telemetry: Telemetry) -> Telemetry:
        last = self._last
        if last is not None and (self.now(FaultKind.STALE_TELEMETRY) or self.now(FaultKind.LINK_LOSS)):
            return replace(last, t_s=telemetry.t_s)
        self._last = replace(
            telemetry,
            attitude_t_s=_time(telemetry.attitude_t_s, telemetry),
            heading_t_s=_time(telemetry.heading_t_s, telemetry),
            height_t_s=_time(telemetry.height_t_s, telemetry),
            velocity_t_s=_time(telemetry.velocity_t_s, telemetry),
        )
        battery, compass = self.now(FaultKind.LOW_BATTERY), self.now(FaultKind.COMPASS_BIAS)
        flow, velocity_mps = self.now(FaultKind.FLOW_BIAS), telemetry.velocity_in_level_mps
        if battery is not None:
            telemetry = replace(telemetry, battery_percent=battery.amount)
        if compass is not None and telemetry.heading_rad is not None:
            telemetry = replace(telemetry, heading_rad=telemetry.heading_rad + math.radians(compass.amount))
        if flow is not None and velocity_mps is not None:
            direction = self._direction if flow.direction_in_level is None else np.array(flow.direction_in_level)
            telemetry = replace(telemetry, velocity_in_level_mps=velocity_mps + flow.amount * direction)
        telemetry = self._with_height(telemetry)
        if self.now(FaultKind.NAN_TELEMETRY) is not None:
            nan = math.nan
            telemetry = Telemetry(telemetry.t_s, nan, nan, nan, nan, np.full(3, nan), nan, nan, telemetry.flying)
        return self.spoiled(telemetry)

    def _with_height(self, telemetry: Telemetry) -> Telemetry:
        """The telemetry with the height as the barometer says it."""
        stale = self.now(FaultKind.STALE_BAROMETER) is not None
        if self._last_height is not None and (stale or self.now(FaultKind.FROZEN_BAROMETER) is not None):
            height_m, read_s = self._last_height
            return replace(telemetry, height_m=height_m, height_t_s=read_s if stale else telemetry.height_t_s)
        self._last_height = telemetry.height_m, _time(telemetry.height_t_s, telemetry)
        return telemetry

    def _weaken(self) -> None:
        weak = self.now(FaultKind.WEAK_MOTOR)
        if weak is not self._weak:
            self._weak = weak
            self._vehicle.world.weaken_rotor(self._rotor, 0.0 if weak is None else weak.amount)


def _time(t_s: float | None, telemetry: Telemetry) -> float:
    return telemetry.t_s if t_s is None else t_s


class FaultyVision:
    """Over any vision; what a picture would suffer, one that looks at no picture suffers here."""

    def __init__(self, vision: Vision, vehicle: FaultyVehicle) -> None:
        self._vision, self._vehicle = vision, vehicle
        self._before: Observation | None = None

    def see(self, frame: Frame) -> Observation:
        """See `Vision`."""
        now, rng = self._vehicle.now, self._vehicle.rng
        if now(FaultKind.VISION_RAISES) is not None:
            raise RuntimeError("made to fail")
        seen = self._vision.see(frame)
        if frame.image is None:
            seen = self._without_picture(frame, seen)
        misstated = now(FaultKind.MISSTATED_CUE)
        if seen.bar_pose is not None and misstated is not None:
            seen = replace(seen, bar_pose=_scaled(seen.bar_pose, 1.0 + misstated.amount))
        pose, decoy, mirror = seen.bar_pose, now(FaultKind.FALSE_POSE), now(FaultKind.REFLECTION)
        if pose is not None and decoy is not None:
            offset_m = np.array([0.0, decoy.amount, 0.0])
            seen = replace(seen, bar_pose=replace(pose, position_in_bar_m=pose.position_in_bar_m + offset_m))
        elif pose is not None and mirror is not None:
            # The mirror image hangs twice that height below the bar, upside down, which a bar alike both ways hides.
            over_image_m = pose.position_in_bar_m - np.array([0.0, 0.0, 2.0 * mirror.amount])
            seen = replace(seen, bar_pose=replace(pose, position_in_bar_m=over_image_m))
        if now(FaultKind.FALSE_BOX) is not None:
            camera = self._vehicle.camera
            centre = rng.uniform(0.1, 0.9, 2) * [camera.width_px, camera.height_px]
            box = Box((float(centre[0]), float(centre[1])), (60.0, 30.0), 0.95)
            seen = replace(seen, bar_pose=None, bar_box=box, ship_box=box, reason="decoy")
        return self._vehicle.spoiled(seen)

    def _without_picture(self, frame: Frame, seen: Observation) -> Observation:
        now, rng = self._vehicle.now, self._vehicle.rng
        if now(FaultKind.FROZEN_FRAMES) is not None and self._before is not None:
            return replace(self._before, t_s=frame.t_s, gimbal=frame.gimbal)
        self._before = seen
        corrupt, glare = now(FaultKind.CORRUPT_FRAMES), now(FaultKind.GLARE)
        if now(FaultKind.WRONG_SIZE_FRAMES) is not None:
            reason = "picture of another size"
        elif now(FaultKind.OCCLUSION) is not None:
            reason = "occluded"
        elif corrupt is not None and rng.random() < corrupt.amount:
            reason = "picture corrupt"
        elif glare is not None and rng.random() < glare.amount:
            reason = "glare"
        else:
            return seen
        return Observation(frame.t_s, frame.gimbal, reason=reason, learned=seen.learned)


def _scaled(pose: BarPose, scale: float) -> BarPose:
    """The pose that the same corners give of a cue so many times as large: as far away in cue's sizes, turned alike."""
    stretch = np.array([scale, scale, scale, 1.0])
    covariance = pose.covariance * np.outer(stretch, stretch)
    return replace(pose, position_in_bar_m=scale * pose.position_in_bar_m, covariance=covariance)


class FaultyPilot:
    """Over any pilot."""

    def __init__(self, pilot: Pilot, vehicle: FaultyVehicle) -> None:
        self._pilot, self._vehicle = pilot, vehicle

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """See `Pilot`."""
        if self._vehicle.now(FaultKind.PILOT_RAISES) is not None:
            raise RuntimeError("made to fail")
        return self._pilot.decide(observation, telemetry, sent)
