"""The simulator as one more vehicle: frames with their latency, commands with theirs."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.messages import Frame, GroundTruth, PilotCommand, Telemetry, TouchdownVerdict
from shipland.sim.state import SceneState, Snapshot
from shipland.sim.world import World
from shipland.vehicles.delays import DelayParameters, TelemetryFeed
from shipland.vehicles.vehicle import unless_late

if TYPE_CHECKING:
    from shipland.sim.scene.scene import Scene

_REMEMBERED = 100
"""Given frames whose truth and scene are kept."""


class _Exposure(NamedTuple):
    """A picture on its way: its stamp, when it arrives, and what it shows."""

    stamp_s: float
    arrives_s: float
    snapshot: Snapshot


class SimulatedVehicle:
    """A `Vehicle` and `GroundTruthSource` over a `World`. Time is the world's; it passes while `read` waits.

    The camera exposes every 1/`world.frame_rate_hz` (on the world's time grid); a frame arrives `video_s` and some
    jitter later, or is lost; its time stamp is off by the clocks' difference, constant in a flight. After `send` the
    pipeline is free at the command's time and the command takes effect `uplink_s` later. `read` gives the newest frame
    that has arrived by then and was not given, else it waits for the next one; the telemetry is what has arrived by
    that moment. Only frames that are given are rendered.

    Args:
        world: what is flown, at its start.
        camera: intrinsics of the pictures.
        delays: video, uplink and telemetry.
        scene: renders the pictures; None gives frames without one.
        rng: the picture's sensor noise, jitter, losses and the clocks' difference; None leaves them out.
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
        self._camera, self._delays, self._scene = camera, delays, scene
        self._picture_rng: np.random.Generator | None = None
        self._video_rng: np.random.Generator | None = None
        if rng is not None:
            self._picture_rng, self._video_rng = rng.spawn(2)
        self._clock_s = 0.0 if self._video_rng is None else delays.video_clock_s * self._video_rng.standard_normal()
        self._feed = TelemetryFeed(delays.telemetry.chosen, world.t_s)
        self._with_frames = delays.telemetry.chosen.with_frames
        self._last_arrival_s = -math.inf
        self._last_truth: tuple[float, GroundTruth] | None = None
        self._period_s = 1.0 / world.frame_rate_hz
        self._exposed, self._next_exposure_s = 0, 0.0
        self._waiting: deque[_Exposure] = deque()
        self._given: deque[_Exposure] = deque(maxlen=_REMEMBERED)
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
            while not self._waiting and not self.world.over():
                self._expose()
            if not self._waiting:
                return None
            self._now_s = max(self._now_s, self._waiting[0].arrives_s)
            self._pass_time(self._now_s)
        exposure = self._waiting.popleft()
        while self._arrived():
            exposure = self._waiting.popleft()
        if self.world.over():
            return None
        self._given.append(exposure)
        image = None
        if self._scene is not None:
            state = self.world.scene_state(exposure.snapshot)
            image = self._scene.render(state, self._camera, rng=self._picture_rng)
        return Frame(exposure.stamp_s, image, exposure.snapshot.reported_gimbal), self._telemetry()

    def telemetry_at(self, t_s: float) -> Telemetry:
        """Let time pass until `t_s` and give what has arrived by then; a time gone by counts as now."""
        if self._is_open and math.isfinite(t_s):
            self._now_s = max(self._now_s, t_s)
            self._pass_time(self._now_s)
        return self._telemetry()

    def _telemetry(self) -> Telemetry:
        world, now_s = self.world, self._now_s
        return self._feed.at(now_s, world.battery_percent, world.link_percent, world.motors_run)

    def send(self, command: PilotCommand) -> None:
        """Give the sticks at the command's time; a little earlier than the last frame's receipt counts as then."""
        if not self._is_open:
            return
        if math.isfinite(command.t_s):
            self._now_s = max(self._now_s, command.t_s)
        self._on_the_way.append((self._now_s + self._delays.uplink_s, unless_late(command, self._now_s)))

    def close(self) -> None:
        """End the flight; the scene is the caller's to close."""
        self._is_open = False

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth at the exposure of a frame that `read` gave, by its time stamp [s]; None for times too long ago."""
        if self._last_truth is None or abs(self._last_truth[0] - t_s) > 1e-9:
            exposure = self._remembered(t_s)
            if exposure is None:
                return None
            self._last_truth = (exposure.stamp_s, self.world.truth(exposure.snapshot))
        return self._last_truth[1]

    def scene_at(self, t_s: float) -> SceneState | None:
        """The scene at the exposure of a frame that `read` gave, by its time stamp [s]: for chase views and labels."""
        exposure = self._remembered(t_s)
        return None if exposure is None else self.world.scene_state(exposure.snapshot)

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, once there was one."""
        return self.world.verdict()

    def _remembered(self, t_s: float) -> _Exposure | None:
        return next((item for item in reversed(self._given) if abs(item.stamp_s - t_s) < 1e-9), None)

    def _arrived(self) -> bool:
        return bool(self._waiting) and self._waiting[0].arrives_s <= self._now_s + 1e-9

    def _expose(self) -> None:
        """Go to the next exposure and keep what it sees, unless it is lost on its way."""
        self._fly_to(self._next_exposure_s)
        self._exposed += 1
        step_s = self.world.step_s
        self._next_exposure_s = math.ceil(self._exposed * self._period_s / step_s - 1e-6) * step_s
        snapshot = self.world.snapshot()
        arrives_s, lost = snapshot.t_s + self._delays.video_s, False
        if self._video_rng is not None:
            arrives_s += self._delays.video_jitter_s * abs(self._video_rng.standard_normal())
            lost = self._video_rng.random() < self._delays.video_loss_share
        if lost:
            return
        self._last_arrival_s = max(self._last_arrival_s, arrives_s)
        self._waiting.append(_Exposure(snapshot.t_s + self._clock_s, self._last_arrival_s, snapshot))
        if self._with_frames:
            self._feed.take_with_frame(self.world.readings(), self._last_arrival_s)

    def _pass_time(self, to_t_s: float) -> None:
        """Fly to a time, exposing on the way."""
        while self._next_exposure_s <= to_t_s + 1e-9:
            self._expose()
        self._fly_to(to_t_s)

    def _fly_to(self, t_s: float) -> None:
        """Advance the world, taking readings and letting commands take effect when they are due."""
        while True:
            command_s = self._on_the_way[0][0] if self._on_the_way else math.inf
            due_s = min(command_s, self._feed.next_s)
            if due_s > t_s + 1e-9:
                break
            self.world.advance(due_s)
            if command_s <= due_s:
                self.world.command(self._on_the_way.popleft()[1])
            else:
                self._feed.take(self.world.readings(), due_s)
        self.world.advance(t_s)
