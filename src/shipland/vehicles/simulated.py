"""The simulator as one more vehicle: frames with their latency, commands with theirs."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.messages import Frame, GroundTruth, PilotCommand, Telemetry, TouchdownVerdict
from shipland.sim.snapshot import Snapshot
from shipland.sim.state import SceneState
from shipland.sim.world import World
from shipland.vehicles.delays import DelayParameters

if TYPE_CHECKING:
    from shipland.sim.scene.scene import Scene

_REMEMBERED = 64
"""Given frames whose truth and scene are kept."""


class SimulatedVehicle:
    """A `Vehicle` and `Witness` over a `World`. Time is the world's; it passes while `read` waits.

    The camera exposes every 1/`world.frame_rate_hz` (on the world's time grid); a frame arrives `video_s` later. After
    `send` the pipeline is free at the command's time and the command takes effect `uplink_s` later. `read` gives the
    newest frame that has arrived by then and was not given, else it waits for the next one; the telemetry's time is
    that moment. Only frames that are given are rendered.

    Args:
        world: what is flown, at its start.
        camera: intrinsics of the pictures.
        delays: video and uplink latency.
        scene: renders the pictures; None gives frames without one.
        rng: the picture's sensor noise; None leaves it out.
    """

    def __init__(
        self,
        world: World,
        camera: Camera,
        delays: DelayParameters,
        scene: Scene | None,
        rng: np.random.Generator | None,
    ) -> None:
        self.world = world
        self._camera, self._delays, self._scene, self._rng = camera, delays, scene, rng
        self._period_s = 1.0 / world.frame_rate_hz
        self._exposed = 0
        self._waiting: deque[Snapshot] = deque()
        self._given: deque[Snapshot] = deque(maxlen=_REMEMBERED)
        self._on_the_way: deque[tuple[float, PilotCommand]] = deque()
        self._now_s = 0.0
        self._is_open = False

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures."""
        return self._camera

    def open(self) -> None:
        """Make ready; raises VehicleError when this flight was already flown."""
        if self._exposed:
            raise VehicleError("a simulated flight can be flown once; build a new World for the next one")
        self._is_open = True

    def read(self) -> tuple[Frame, Telemetry] | None:
        """The newest arrived frame not given before, and the telemetry at its receipt; None once the flight is over."""
        if not self._is_open or self.world.over():
            return None
        self._pass_time(self._now_s)
        if not self._arrived():
            while not self._waiting:
                self._expose()
            self._now_s = max(self._now_s, self._waiting[0].t_s + self._delays.video_s)
            self._pass_time(self._now_s)
        snapshot = self._waiting.popleft()
        while self._arrived():
            snapshot = self._waiting.popleft()
        if self.world.over():
            return None
        self._given.append(snapshot)
        image = None
        if self._scene is not None:
            image = self._scene.render(self.world.scene_state(snapshot), self._camera, rng=self._rng)
        frame = Frame(snapshot.t_s, image, snapshot.reported_gimbal)
        return frame, dataclasses.replace(self.world.telemetry(), t_s=self._now_s)

    def telemetry_at(self, t_s: float) -> Telemetry:
        """Let time pass until `t_s` and tell the state then; a time gone by counts as now."""
        if self._is_open and math.isfinite(t_s):
            self._now_s = max(self._now_s, t_s)
            self._pass_time(self._now_s)
        return dataclasses.replace(self.world.telemetry(), t_s=self._now_s)

    def send(self, command: PilotCommand) -> None:
        """Give the sticks at the command's time; earlier than the last frame's receipt counts as then."""
        if not self._is_open:
            return
        if math.isfinite(command.t_s):
            self._now_s = max(self._now_s, command.t_s)
        self._on_the_way.append((self._now_s + self._delays.uplink_s, command))

    def close(self) -> None:
        """End the flight; the scene is the caller's to close."""
        self._is_open = False

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth at an exposure time that `read` gave [s]; None for times too long ago."""
        snapshot = self._remembered(t_s)
        return None if snapshot is None else self.world.truth(snapshot)

    def scene_at(self, t_s: float) -> SceneState | None:
        """The scene at an exposure time that `read` gave [s]: for chase views and labels."""
        snapshot = self._remembered(t_s)
        return None if snapshot is None else self.world.scene_state(snapshot)

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, once there was one."""
        return self.world.verdict()

    def _remembered(self, t_s: float) -> Snapshot | None:
        return next((item for item in reversed(self._given) if abs(item.t_s - t_s) < 1e-9), None)

    def _arrived(self) -> bool:
        return bool(self._waiting) and self._waiting[0].t_s + self._delays.video_s <= self._now_s + 1e-9

    def _next_exposure_s(self) -> float:
        """The grid instant at or after the camera's next exposure."""
        step_s = self.world.step_s
        return math.ceil(self._exposed * self._period_s / step_s - 1e-6) * step_s

    def _expose(self) -> None:
        """Go to the next exposure and keep what it sees."""
        self._fly_to(self._next_exposure_s())
        self._waiting.append(self.world.snapshot())
        self._exposed += 1

    def _pass_time(self, to_t_s: float) -> None:
        """Fly to a time, exposing on the way."""
        while self._next_exposure_s() <= to_t_s + 1e-9:
            self._expose()
        self._fly_to(to_t_s)

    def _fly_to(self, t_s: float) -> None:
        """Advance the world, letting commands take effect when they are due."""
        while self._on_the_way and self._on_the_way[0][0] <= t_s + 1e-9:
            due_s, command = self._on_the_way.popleft()
            self.world.advance(due_s)
            self.world.command(command)
        self.world.advance(t_s)
