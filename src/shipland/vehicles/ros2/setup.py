"""What a ROS 2 vehicle is made from, and how an address says it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from shipland.camera import Camera
from shipland.config import build, key, parameters
from shipland.errors import ConfigError
from shipland.guidance.response import Response
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.camera_stream import StreamParameters
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.frame_link import FrameSource
from shipland.vehicles.parameters import SetpointParameters, measured
from shipland.vehicles.ros2.dds import domain_id, only_this_machine

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
_NAME = re.compile(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_OPTIONS = ("kind", "domain", "local", "wait", "take", "mount_deg", "latency_s", "camera")


def vehicle_topics(namespace: str, renamed: Mapping[str, str]) -> dict[str, str]:
    """Full names of the vehicle's topics: `/NAMESPACE/odom`, or what an option says, from the root.

    Raises:
        ConfigError: one is no name of a ROS 2 topic, which nobody else could publish.
    """
    topics = {
        name: renamed.get(name, f"{namespace.strip('/')}/{topic}").strip("/") for name, topic in VEHICLE_TOPICS.items()
    }
    for topic in topics.values():
        if not _NAME.fullmatch(topic):
            raise ConfigError(
                f"/{topic} is no ROS 2 topic: expected letters, digits and _ between single slashes, no digit after one"
            )
    return topics


@parameters
class Ros2Parameters(SetpointParameters):
    """`[ros2]`."""

    kind: Literal["attitude", "velocity"] = key(
        "velocity", "what set-points mean", "velocity: TwistStamped, REP-147's | attitude: AttitudeTarget, mavros's"
    )
    setpoint_hz: float = key(30.0, "set-points a second", "chosen: one a picture", ge=5, le=200)


@dataclass(frozen=True)
class Ros2Setup:
    """What a ROS 2 vehicle is made from.

    Attributes:
        topics: the vehicle's, by their name in `VEHICLE_TOPICS`.
        domain: ROS domain.
        local: loopback alone.
        wait: fly only once `/shipland/land` has said so.
        take: a vehicle that obeys set-points already is taken as it is.
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
    take: bool
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
        parameters = build(Ros2Parameters, setup.section("ros2"), "vehicles.ros2")
        kind = parameters.kind
        sticks = measured(kind, table["response"]) | parameters.full_sticks(kind, speed_mps=parameters.max_speed_mps)
        stream = build(StreamParameters, table["camera"], "vehicles.camera")
        latency_s = address.known_number("latency_s")
        if latency_s is not None and not 0.0 <= latency_s <= 3.0:
            raise ConfigError(f"ros2://…?latency_s={latency_s:g}: expected 0 to 3 s")
        url = address.options.get("camera")
        return Ros2Setup(
            topics=vehicle_topics(address.place, address.options),
            domain=domain_id(address.known_number("domain")),
            local=address.flag("local") or only_this_machine(),
            wait=address.flag("wait"),
            take=address.flag("take"),
            camera=setup.camera if setup.calibrated else None,
            frames=None if url is None else FrameSource.at(url, setup.camera),
            fixed_pitch_rad=setup.fixed_pitch_rad,
            latency_s=latency_s,
            open_timeout_s=stream.open_timeout_s,
            response=build(Response, sticks, f"response.{kind}"),
            parameters=parameters,
            preflight=build(PreflightParameters, table["preflight"], "vehicles.preflight"),
        )
