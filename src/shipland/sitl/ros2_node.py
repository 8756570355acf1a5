"""The simulated vehicle as a ROS 2 node: its topics out, set-points in, in real time."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np

from shipland.camera import level_from_camera
from shipland.frames import ENU_FROM_NED, FLU_FROM_FRD, Pose, rotation_from_euler
from shipland.guidance.response import Response
from shipland.messages import Frame, Intent, PilotCommand, Telemetry, TouchdownVerdict
from shipland.scenario.autonomy import build_scene, build_vehicle, response_of
from shipland.scenario.scenario import Scenario
from shipland.sitl.frame_server import FrameServer
from shipland.sitl.physics import RealTimeFactor
from shipland.vehicles.ros2.conversions import (
    BASE_LINK,
    ODOM,
    gimbal_message,
    gimbal_of,
    header,
    odometry_of,
    seconds,
    transform,
    wanted_attitude,
    wanted_velocity,
)
from shipland.vehicles.ros2.dds import Node, domain_id, only_this_machine
from shipland.vehicles.ros2.image_messages import camera_info, image_message, jpeg_message
from shipland.vehicles.ros2.setup import vehicle_topics
from shipland.vehicles.ros2.types import Message, message
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vehicles.wanted import HOLD, Wanted, percents_of

_STALE_S = 1.0
"""Without a set-point for so long it holds."""
_LINGER_S = 2.0
"""For which the stopped motors are told of after the flight."""
_OPTICAL = "camera_optical"


class SetPoints:
    """The newest set-point, taken on the node's thread.

    Args:
        response: of the vehicle that flies them.
        gimbal_rad: pitch of its camera before anybody has turned it.
    """

    def __init__(self, response: Response, gimbal_rad: float) -> None:
        self._response, self._gimbal_rad = response, gimbal_rad
        self._newest: tuple[Wanted, float, float] | None = None
        """With its receipt, and its sender's stamp [s]."""
        self._landing = False
        self.heard_s: list[float] = []
        """When each came [s]."""
        self.refused = ""
        """Why the last could not be flown, in words."""

    def take_velocity(self, command: Message) -> None:
        """geometry_msgs/TwistStamped; only a hold is flown by an aircraft that flies tilts."""
        refusal = "velocities come, and this aircraft flies tilts: --set aircraft.loop.kind=velocity"
        self._take(command, wanted_velocity(command), "velocity", refusal)

    def take_attitude(self, command: Message) -> None:
        """mavros_msgs/AttitudeTarget."""
        refusal = "attitudes come, and this aircraft flies velocities: ros2://…?kind=velocity"
        self._take(command, wanted_attitude(command, self._response.max_climb_mps), "attitude", refusal)

    def take_gimbal(self, command: Message) -> None:
        """geometry_msgs/QuaternionStamped."""
        gimbal = gimbal_of(command)
        if gimbal is not None:
            self._gimbal_rad = gimbal.pitch_rad

    def take_landing(self, landing: Message) -> None:
        """std_msgs/Bool: in a landing, low enough to touch: the motors may be stopped at contact."""
        self._landing = bool(landing.data)

    @property
    def begun(self) -> bool:
        """Whether any has come."""
        return self._newest is not None

    def command(self, t_s: float) -> PilotCommand:
        """What is to be flown now, on the vehicle's clock."""
        newest = self._fresh(time.monotonic())
        wanted = HOLD if newest is None else newest[0]
        if wanted.hold:
            return PilotCommand.hold(t_s, self._gimbal_rad)
        intent = Intent.LAND if self._landing else Intent.FLY
        return PilotCommand(t_s, *percents_of(wanted, self._response), self._gimbal_rad, intent)

    def _fresh(self, now_s: float) -> tuple[Wanted, float, float] | None:
        newest = self._newest
        return newest if newest is not None and now_s - newest[1] <= _STALE_S else None

    def _take(self, command: Message, wanted: Wanted | None, kind: str, refusal: str) -> None:
        """Of two topics in their sender's order."""
        now_s, stamp_s = time.monotonic(), seconds(command.header.stamp)
        fresh = self._fresh(now_s)
        if wanted is None or (fresh is not None and stamp_s < fresh[2]):
            return
        if kind != self._response.kind and not wanted.hold:
            self.refused, wanted = refusal, HOLD
        self.heard_s.append(now_s)
        self._newest = wanted, now_s, stamp_s


class VehicleTopics:
    """What a vehicle tells, as topics."""

    def __init__(self, node: Node, topics: dict[str, str], vehicle: SimulatedVehicle) -> None:
        self._camera = vehicle.camera
        self._image = node.publisher(topics["image"], "sensor_msgs/msg/Image")
        self._jpeg = node.publisher(f"{topics['image']}/compressed", "sensor_msgs/msg/CompressedImage")
        self._info = node.publisher(topics["camera_info"], "sensor_msgs/msg/CameraInfo")
        self._mount = node.publisher(topics["gimbal"], "geometry_msgs/msg/QuaternionStamped")
        self._odom = node.publisher(topics["odom"], "nav_msgs/msg/Odometry")
        self._battery = node.publisher(topics["battery"], "sensor_msgs/msg/BatteryState")
        self._state = node.publisher(topics["state"], "mavros_msgs/msg/State")
        self._tf = node.publisher("tf", "tf2_msgs/msg/TFMessage")

    def tell(self, frame: Frame, telemetry: Telemetry, exposed_s: float, now_s: float) -> None:
        """One cycle, its times since the epoch [s]; pictures only where somebody listens."""
        true_s = now_s - (telemetry.t_s - telemetry.newest_s)
        self._odom.send(odometry_of(telemetry, true_s))
        self._mount.send(gimbal_message(frame.gimbal, exposed_s))
        self.state(telemetry.flying, now_s)
        battery = -1.0 if telemetry.battery_percent is None else 0.01 * telemetry.battery_percent
        self._battery.send(message("sensor_msgs/msg/BatteryState", header=header(now_s, ""), percentage=battery))
        self._send_tf(frame, telemetry, true_s)
        self._info.send(camera_info(self._camera, exposed_s, _OPTICAL))
        if frame.image is None:
            return
        if self._image.heard:
            self._image.send(image_message(frame.image, exposed_s, _OPTICAL))
        if self._jpeg.heard:
            self._jpeg.send(jpeg_message(frame.image, exposed_s, _OPTICAL))

    def state(self, armed: bool, now_s: float) -> None:
        """Armed and obeying, or its motors stand."""
        self._state.send(
            message(
                "mavros_msgs/msg/State", header=header(now_s, ""), connected=True, armed=armed, guided=armed,
                mode="GUIDED" if armed else "STANDBY",
            )
        )  # fmt: skip

    def _send_tf(self, frame: Frame, telemetry: Telemetry, true_s: float) -> None:
        roll, pitch, heading = telemetry.roll_rad or 0.0, telemetry.pitch_rad or 0.0, telemetry.heading_rad or 0.0
        turned = ENU_FROM_NED @ rotation_from_euler(roll, pitch, heading) @ FLU_FROM_FRD
        body = Pose(turned, np.array([0.0, 0.0, telemetry.height_m or 0.0]))
        optical = FLU_FROM_FRD @ rotation_from_euler(roll, pitch, 0.0).T @ level_from_camera(frame.gimbal)
        edges = [(ODOM, BASE_LINK, body), (BASE_LINK, _OPTICAL, Pose(optical, np.zeros(3)))]
        placed = [transform(true_s, parent, child, pose) for parent, child, pose in edges]
        self._tf.send(message("tf2_msgs/msg/TFMessage", transforms=placed))


def serve_ros2(
    scenario: Scenario, seed: int, namespace: str, pictures: bool, frames: FrameServer, say: Callable[[str], None]
) -> TouchdownVerdict | None:
    """Fly one flight of the simulated vehicle by the set-points that come; the world waits for the first.

    The frames carry the truth as well, for vision without pictures and for the verdict.

    Returns:
        The verdict; None where the flight was interrupted.
    """
    with ExitStack() as stack:
        scene = build_scene(scenario, seed) if pictures else None
        if scene is not None:
            stack.callback(scene.close)
        vehicle = build_vehicle(scenario, seed, scene)
        node = Node(domain_id(None), only_this_machine())
        stack.callback(node.close)
        topics, response = vehicle_topics(namespace, {}), response_of(scenario)
        orders = SetPoints(response, 0.0)
        node.subscribe(topics["command_velocity"], "geometry_msgs/msg/TwistStamped", orders.take_velocity)
        node.subscribe(topics["command_attitude"], "mavros_msgs/msg/AttitudeTarget", orders.take_attitude)
        node.subscribe(topics["command_gimbal"], "geometry_msgs/msg/QuaternionStamped", orders.take_gimbal)
        node.subscribe(topics["landing"], "std_msgs/msg/Bool", orders.take_landing)
        told = VehicleTopics(node, topics, vehicle)
        say(f"waiting for set-points on /{topics['command_velocity']} or /{topics['command_attitude']}")
        _fly(vehicle, orders, told, frames, say)
        verdict = vehicle.verdict()
        if verdict is not None:
            frames.end(verdict)
        until_s = time.monotonic() + _LINGER_S
        while time.monotonic() < until_s:
            told.state(armed=False, now_s=time.time())
            time.sleep(0.05)
        gaps_s = np.diff(orders.heard_s) if len(orders.heard_s) > 1 else np.zeros(1)
        say(
            f"{len(orders.heard_s)} set-points, {1e3 * np.median(gaps_s):.1f} ms apart, 99 % within "
            f"{1e3 * np.percentile(gaps_s, 99):.1f} ms, at most {1e3 * gaps_s.max():.1f}"
        )
        return verdict


def _fly(
    vehicle: SimulatedVehicle, orders: SetPoints, told: VehicleTopics, frames: FrameServer, say: Callable[[str], None]
) -> None:
    vehicle.open()
    pair = vehicle.read()
    period_s = 1.0 / vehicle.world.frame_rate_hz
    while pair is not None and not orders.begun:  # the world stands still; what it shows is new each time
        frame, telemetry = pair
        age_s = telemetry.t_s - frame.t_s
        told.tell(frame, telemetry, time.time() - age_s, time.time())
        frames.show(time.monotonic(), vehicle.world.snapshot())
        time.sleep(period_s)
    say("it flies")
    factor, refused = RealTimeFactor(), ""
    begun_s = time.monotonic() - (0.0 if pair is None else pair[1].t_s)
    epoch_s = time.time() - (time.monotonic() - begun_s)
    while pair is not None:
        frame, telemetry = pair
        time.sleep(max(0.0, begun_s + telemetry.t_s - time.monotonic()))
        factor.note(telemetry.t_s, time.monotonic())
        told.tell(frame, telemetry, epoch_s + frame.t_s, epoch_s + telemetry.t_s)
        frames.show(begun_s + vehicle.world.t_s, vehicle.world.snapshot())
        if orders.refused != refused:
            refused = orders.refused
            say(refused)
        vehicle.send(orders.command(max(telemetry.t_s, time.monotonic() - begun_s)))
        pair = vehicle.read()
    say(factor.words())
