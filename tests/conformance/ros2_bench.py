"""A ROS 2 vehicle of ours before a stand-in drone: a second node in this process, over loopback."""

from __future__ import annotations

import fcntl
import itertools
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from shipland.camera import Camera
from shipland.config import packaged_toml
from shipland.frames import wrap_angle
from shipland.messages import GimbalAttitude, Telemetry
from shipland.vehicles.address import Address, VehicleSetup
from shipland.vehicles.ros2 import conversions as ros
from shipland.vehicles.ros2 import image_messages as images
from shipland.vehicles.ros2.dds import Node
from shipland.vehicles.ros2.setup import Ros2Setup, vehicle_topics
from shipland.vehicles.ros2.types import message
from shipland.vehicles.ros2.vehicle import Ros2Vehicle
from shipland.vehicles.wanted import HOLD, Wanted

CAMERA = Camera.from_fov(64, 36, 69.0)
_STEP_S = 0.01
_LAG_S = 0.1


@cache
def _own_domains() -> tuple[Iterator[int], TextIO]:
    """Eight domains in turn that no other process of this machine's tests has, and the lock that says so."""
    for block in range(11):
        lock = (Path(tempfile.gettempdir()) / f"shipland-test-domains-{os.getuid()}-{block}").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        return itertools.cycle(range(10 + 8 * block, 18 + 8 * block)), lock
    raise RuntimeError("eleven processes test ROS 2 here already")


def own_domain() -> int:
    """A domain for one test."""
    return next(_own_domains()[0])


class Drone:
    """Flies speeds or tilts with a first-order lag, a hundred times a second, and tells so; its pictures are grey."""

    def __init__(self, domain: int, stamp_off_s: float = 0.0) -> None:
        self.domain = domain
        self.node = Node(domain, local=True)
        self.topics = vehicle_topics("drone", {})
        self.armed = self.guided = self.connected = True
        self.mode = "GUIDED"
        self.silent = self.frozen = False
        self.stamp_off_s = stamp_off_s
        self.camera = CAMERA
        self.wanted = HOLD
        self.tilts = self.landing = False
        self.stamp_s, self.holds_s = 0.0, list[float]()
        self.mount: Any = None
        self._noise = np.random.default_rng(1)
        self._velocity_mps, self._heading_rad, self._height_m = np.zeros(3), 0.3, 5.0
        out, topics = self.node.publisher, self.topics
        self._odom = out(topics["odom"], "nav_msgs/msg/Odometry")
        self._state = out(topics["state"], "mavros_msgs/msg/State")
        self._image = out(topics["image"], "sensor_msgs/msg/Image")
        self._info = out(topics["camera_info"], "sensor_msgs/msg/CameraInfo")
        self._gimbal = out(topics["gimbal"], "geometry_msgs/msg/QuaternionStamped")
        self._battery = out(topics["battery"], "sensor_msgs/msg/BatteryState")
        hear = self.node.subscribe
        hear(topics["command_velocity"], "geometry_msgs/msg/TwistStamped", self._take_velocity)
        hear(topics["command_attitude"], "mavros_msgs/msg/AttitudeTarget", self._take_attitude)
        hear(topics["landing"], "std_msgs/msg/Bool", lambda told: setattr(self, "landing", bool(told.data)))
        hear(topics["command_gimbal"], "geometry_msgs/msg/QuaternionStamped", lambda told: setattr(self, "mount", told))
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def arrived(self) -> list[float]:
        """Forward, right, up that it flies by now."""
        return [self.wanted.forward, self.wanted.right, self.wanted.climb_mps]

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self.node.close()

    def _take_velocity(self, command: Any) -> None:
        self._take(command, ros.wanted_velocity(command), False)

    def _take_attitude(self, command: Any) -> None:
        self._take(command, ros.wanted_attitude(command, 1.0), True)

    def _take(self, command: Any, wanted: Wanted | None, tilts: bool) -> None:
        """Of two topics in their senders' order."""
        if (stamp_s := ros.seconds(command.header.stamp)) >= self.stamp_s:
            self.wanted, self.tilts, self.stamp_s = wanted or HOLD, tilts, stamp_s
        if wanted is not None and wanted.hold:
            self.holds_s.append(stamp_s)

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._over.is_set():
            self._step(self.wanted)
            if not self.silent:
                self._tell()
            due_s = max(due_s + _STEP_S, time.monotonic() - 5 * _STEP_S)
            self._over.wait(max(0.0, due_s - time.monotonic()))

    def _step(self, wanted: Wanted) -> None:
        gain = 5.0 if self.tilts else 1.0  # speed in the end, for a tilt [m/s per rad]
        aim = np.array([gain * wanted.forward, gain * wanted.right, -wanted.climb_mps])
        self._velocity_mps = self._velocity_mps + _STEP_S / _LAG_S * (aim - self._velocity_mps)
        self._heading_rad = wrap_angle(self._heading_rad + _STEP_S * wanted.turn_rad_s)
        self._height_m -= _STEP_S * self._velocity_mps[2]

    def _tell(self) -> None:
        now_s = time.time() + self.stamp_off_s
        told = Telemetry(
            0.0, 0.02, -0.01, self._heading_rad, self._height_m, self._velocity_mps, None, None, flying=self.armed
        )
        self._odom.send(ros.odometry_of(told, now_s))
        self._state.send(
            message(
                "mavros_msgs/msg/State",
                armed=self.armed,
                guided=self.guided,
                connected=self.connected,
                mode=self.mode,
            )
        )
        self._gimbal.send(ros.gimbal_message(GimbalAttitude(0.0, -0.1), now_s))
        self._battery.send(message("sensor_msgs/msg/BatteryState", percentage=0.8))
        self._info.send(images.camera_info(self.camera, now_s, "camera_optical"))
        if not self.frozen:
            picture = self._noise.integers(80, 100, (CAMERA.height_px, CAMERA.width_px, 3), np.uint8)
            self._image.send(images.image_message(picture, now_s - 0.02, "camera_optical"))


@contextmanager
def bench(
    options: str = "", stamp_off_s: float = 0.0, take: bool = True, **section: Any
) -> Iterator[tuple[Ros2Vehicle, Drone]]:
    """The vehicle, not yet open, and its drone, which obeys already, in a domain of their own."""
    domain = own_domain()
    drone = Drone(domain, stamp_off_s)
    address = Address.parse(f"ros2://drone?local=1&domain={domain}&take={take:d}{options}")
    table = {name: {} for name in ("camera", "preflight")} | packaged_toml("vehicles")
    table["ros2"] = {"engage_timeout_s": 5.0, "video_timeout_s": 2.0, "connect_timeout_s": 10.0} | section
    vehicle = Ros2Vehicle(Ros2Setup.of(VehicleSetup(address, CAMERA, table)))
    try:
        yield vehicle, drone
    finally:
        vehicle.close()
        drone.close()
