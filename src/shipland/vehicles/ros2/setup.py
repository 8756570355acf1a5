"""What a ROS 2 vehicle is made from, and how an address says it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from shipland.camera import Camera
from shipland.config import build, merge
from shipland.errors import ConfigError
from shipland.guidance.response import Response
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.camera_stream import StreamParameters
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.frame_link import FrameSource
from shipland.vehicles.ros2.dds import domain_id, only_this_machine
from shipland.vehicles.ros2.parameters import Ros2Parameters

VEHICLE_TOPICS: Mapping[str, str] = {
    "image": "camera/image_raw",
    "camera_info": "camera/camera_info",
    "gimbal": "camera/attitude",
    "odom": "odom",
    "battery": "battery_state",
    "state": "state",
    "command_velocity": "command_velocity",
    "command_attitude": "command_attitude",
    "command_gimbal": "camera/command_attitude",
    "landing": "landing",
}
"""Topics of the vehicle, below its namespace, by the option that renames one."""
OUR_TOPICS = {name: f"shipland/{name}" for name in ("cue_pose", "detections", "diagnostics", "result", "land")}
"""What we publish and listen to."""
_OPTIONS = ("kind", "domain", "local", "wait", "mount_deg", "latency_s", "camera")


def vehicle_topics(namespace: str, renamed: Mapping[str, str]) -> dict[str, str]:
    """Full names of the vehicle's topics: `/NAMESPACE/odom`, or what an option says, from the root."""
    return {name: renamed.get(name, f"{namespace}/{topic}").strip("/") for name, topic in VEHICLE_TOPICS.items()}


@dataclass(frozen=True)
class Ros2Setup:
    """What a ROS 2 vehicle is made from.

    Attributes:
        topics: the vehicle's, by their name in `VEHICLE_TOPICS`.
        domain: ROS domain.
        local: loopback alone.
        wait: fly only once `/shipland/land` has said so.
        camera: intrinsics; None to take those of `camera_info`.
        frames: pictures and truth from a simulator's socket instead of a topic, or None.
        fixed_pitch_rad: of a camera fixed to the body; None for a mount that tells its attitude.
        latency_s: stated, from exposure to receipt of the quickest picture; None where the stamps are of our clock.
        open_timeout_s: to the first picture.
        response: what full sticks mean.
        parameters, preflight: sections.
    """

    topics: Mapping[str, str]
    domain: int
    local: bool
    wait: bool
    camera: Camera | None
    frames: FrameSource | None
    fixed_pitch_rad: float | None
    latency_s: float | None
    open_timeout_s: float
    response: Response
    parameters: Ros2Parameters
    preflight: PreflightParameters

    @staticmethod
    def of(setup: VehicleSetup) -> Ros2Setup:
        """From an address and the vehicles' table; ConfigError when either is wrong."""
        address, table = setup.address, setup.table
        address.only(*_OPTIONS, *VEHICLE_TOPICS)
        section = dict(table["ros2"])
        if "kind" in address.options:
            section = merge(section, {"kind": address.options["kind"]})
        parameters = build(Ros2Parameters, section, "vehicles.ros2")
        stream = build(StreamParameters, table["camera"], "vehicles.camera")
        latency_s = address.number("latency_s", 0.0) if "latency_s" in address.options else None
        if latency_s is not None and not 0.0 <= latency_s <= 3.0:
            raise ConfigError(f"ros2://…?latency_s={latency_s:g}: expected 0 to 3 s")
        frames = None
        if "camera" in address.options:
            url = address.options["camera"]
            if not url.startswith("frames:"):
                raise ConfigError(f"ros2://…?camera={url}: expected frames:HOST:PORT; a topic is ?image=/TOPIC")
            frames = FrameSource.at(url.removeprefix("frames:"), setup.camera)
        return Ros2Setup(
            topics=vehicle_topics(address.place.strip("/"), address.options),
            domain=domain_id(address.number("domain", 0.0) if "domain" in address.options else None),
            local=address.flag("local") or only_this_machine(),
            wait=address.flag("wait"),
            camera=setup.camera if setup.calibrated else None,
            frames=frames,
            fixed_pitch_rad=math.radians(address.number("mount_deg", 0.0)) if "mount_deg" in address.options else None,
            latency_s=latency_s,
            open_timeout_s=stream.open_timeout_s,
            response=_response(parameters, table["response"]),
            parameters=parameters,
            preflight=build(PreflightParameters, table["preflight"], "vehicles.preflight"),
        )


def _response(parameters: Ros2Parameters, table: Mapping[str, object]) -> Response:
    """What full sticks mean: the configured limits, with the lags of `[response.KIND]`."""
    lags = table.get(parameters.kind, {})
    assert isinstance(lags, Mapping)
    speeds = {"max_speed_mps": 0.0, "servo_per_s": 0.0}
    if parameters.kind == "velocity":
        speeds = {"max_speed_mps": parameters.max_speed_mps}
    own = {
        "kind": parameters.kind,
        "max_tilt_rad": math.radians(parameters.max_tilt_deg),
        "max_climb_mps": parameters.max_climb_mps,
        "max_turn_rad_s": math.radians(parameters.max_turn_deg_s),
    }
    return build(Response, {**dict(lags), **speeds, **own}, f"response.{parameters.kind}")
