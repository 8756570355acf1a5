"""Every delay of the loop in one place (`[delays]` in TOML): video, processing, uplink, telemetry."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Literal

import numpy as np

from shipland.config import key, parameters
from shipland.messages import Observation, Telemetry
from shipland.sim.aircraft.sensors import Readings


@parameters
class PartParameters:
    """One value's schedule."""

    rate_hz: float = key(..., "readings a second; 0: never given", ge=0, le=250)
    latency_s: float = key(..., "from a reading to its arrival", ge=0)


@parameters
class ProfileParameters:
    """What one kind of link gives."""

    with_frames: bool = key(
        ...,
        "everything comes in the pictures' metadata: read at exposure, arriving with the picture. Parts with a "
        "rate of 0 are left out; other rates and latencies have no meaning then",
    )
    attitude: PartParameters = key(..., "when the attitude is sent")
    heading: PartParameters = key(..., "when the heading is sent")
    height: PartParameters = key(..., "when the height is sent")
    velocity: PartParameters = key(..., "when the velocity is sent")


def _profile(
    rate_hz: float, latency_s: float, *, with_frames: bool = False, height_hz: float | None = None
) -> ProfileParameters:
    """All parts alike, but for the height's rate."""
    part = PartParameters(rate_hz, latency_s)
    height = part if height_hz is None else PartParameters(height_hz, latency_s)
    return ProfileParameters(with_frames=with_frames, attitude=part, heading=part, height=height, velocity=part)


@parameters
class TelemetryParameters:
    """Profiles, and which is flown."""

    profile: Literal["anafi", "anafi_metadata", "mavlink", "none"] = key(
        "anafi", "name of one below", "anafi | anafi_metadata | mavlink | none"
    )
    anafi: ProfileParameters = key(_profile(5.0, 0.1), "events", "Olympe: 5 Hz, measured at about 0.1 s")
    anafi_metadata: ProfileParameters = key(
        _profile(30.0, 0.0, with_frames=True), "the video's metadata", "in every picture, with its latency"
    )
    mavlink: ProfileParameters = key(
        _profile(50.0, 0.03, height_hz=30.0),
        "streams of PX4 or ArduPilot",
        "MAV_CMD_SET_MESSAGE_INTERVAL; latency of a telemetry radio: chosen",
    )
    none: ProfileParameters = key(_profile(0.0, 0.0), "battery, link, whether it flies; nothing else")

    @property
    def chosen(self) -> ProfileParameters:
        """The profile that is flown."""
        profile: ProfileParameters = getattr(self, self.profile)
        return profile


_PARTS = ("attitude", "heading", "height", "velocity")
_NOTHING: dict[str, Any] = dict.fromkeys(("roll_rad", "pitch_rad", "heading_rad", "height_m", "velocity_in_level_mps"))


def _fields(part: str, readings: Readings) -> dict[str, Any]:
    """The fields of `Telemetry` that a part of the readings gives."""
    t_s, velocity_mps = readings.t_s, readings.velocity_in_level_mps
    if part == "attitude":
        return {"roll_rad": readings.roll_rad, "pitch_rad": readings.pitch_rad, "attitude_t_s": t_s}
    if part == "heading":
        return {"heading_rad": readings.heading_rad, "heading_t_s": t_s}
    if part == "height":
        return {"height_m": readings.height_m, "height_t_s": t_s}
    if velocity_mps is None:
        return {"velocity_in_level_mps": None, "velocity_t_s": None}
    return {"velocity_in_level_mps": np.array(velocity_mps), "velocity_t_s": t_s}


class TelemetryFeed:
    """Readings on their way from the vehicle to the loop.

    Readings are taken on a fixed schedule, whoever asks: a flight and its telemetry do not depend on how often it is
    asked for.
    """

    def __init__(self, parameters: ProfileParameters, start_s: float) -> None:
        self._parts: dict[str, PartParameters] = {
            name: part for name in _PARTS if (part := getattr(parameters, name)).rate_hz > 0.0
        }
        self._with_frames = parameters.with_frames
        self._start_s = start_s
        self._count = dict.fromkeys(self._parts, 0)
        self._waiting: dict[str, deque[tuple[float, Readings]]] = {name: deque() for name in self._parts}
        self._newest = _NOTHING
        self.next_s = self._next()
        """When the next reading is due [s]; infinite where readings come with the pictures or not at all."""

    def _next(self) -> float:
        return math.inf if self._with_frames else min(map(self._due_s, self._parts), default=math.inf)

    def take(self, readings: Readings, now_s: float) -> None:
        """Send off what is due at `now_s`."""
        for name, part in self._parts.items():
            if self._due_s(name) <= now_s + 1e-9:
                self._count[name] += 1
                self._waiting[name].append((now_s + part.latency_s, readings))
        self.next_s = self._next()

    def take_with_frame(self, readings: Readings, arrives_s: float) -> None:
        """Send off a picture's metadata."""
        if self._with_frames:
            for waiting in self._waiting.values():
                waiting.append((arrives_s, readings))

    def at(self, now_s: float, battery_percent: float | None, link_percent: float | None, flying: bool) -> Telemetry:
        """The newest of everything that has arrived.

        Args:
            now_s: now, on the clock of the loop and of the readings.
            battery_percent: comes at once.
            link_percent: likewise.
            flying: likewise.
        """
        for name, waiting in self._waiting.items():
            while waiting and waiting[0][0] <= now_s + 1e-9:
                self._newest = self._newest | _fields(name, waiting.popleft()[1])
        return Telemetry(
            now_s, battery_percent=battery_percent, link_percent=link_percent, flying=flying, **self._newest
        )

    def _due_s(self, name: str) -> float:
        return self._start_s + self._count[name] / self._parts[name].rate_hz


_LONGEST_MEASURED_S = 60.0
"""A processing that is measured to last longer was not: the clock has leapt."""


@parameters
class DelayParameters:
    """Video latency, processing time and uplink."""

    video_s: float = key(
        0.28, "from a picture's exposure to its arrival", "Parrot ANAFI streaming latency as advertised", ge=0
    )
    video_jitter_s: float = key(
        0.005, "added to that, always positive; pictures stay in order", "chosen: a quiet link close by", ge=0
    )
    video_loss_share: float = key(
        0.002, "part of the pictures that never arrive", "chosen: a frame in 17 s", ge=0, lt=1
    )
    video_clock_s: float = key(
        0.005, "error of the pictures' time stamps, constant in a flight", "chosen: after synchronising", ge=0
    )
    uplink_s: float = key(
        0.025, "from a command's being ready to its effect", "Olympe sends piloting commands every 25 ms", ge=0
    )
    processing: Literal["paper", "measured", "zero"] = key(
        "paper", "what a cycle's processing takes", "paper | measured | zero"
    )
    near_s: float = key(0.03, "the paper's cycle on corners", "[Lee2022]: cycle time on corners", ge=0)
    learned_s: float = key(
        0.5, "the paper's cycle on a learned detector", "[Lee2022]: cycle time on a learned detector", ge=0
    )
    telemetry: TelemetryParameters = key(TelemetryParameters(), "rate and latency of what the vehicle says of itself")

    def processing_s(self, observation: Observation, measured_s: float) -> float:
        """Time that a cycle's processing is taken to last [s]; a measured one may be that of a clock that leaps."""
        if self.processing == "measured":
            return min(max(0.0, measured_s), _LONGEST_MEASURED_S)
        if self.processing == "zero":
            return 0.0
        return self.learned_s if observation.learned else self.near_s
