"""A vehicle that is flown through ROS 2 topics, whoever stands behind them.

Set-points leave while the vehicle says that it is armed and obeys them; what we see and decide is published as well.
"""

from __future__ import annotations

import logging
import time

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.frames import Array
from shipland.guidance.response import Response
from shipland.messages import FlightRecord, GimbalAttitude, Intent, Observation, Telemetry
from shipland.rig import Rig
from shipland.stopping import sleep_or_stop
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.checks import Check
from shipland.vehicles.ros2.checks import ros2_checks
from shipland.vehicles.ros2.conversions import attitude_message, gimbal_message, velocity_message
from shipland.vehicles.ros2.dds import Node, require_dds
from shipland.vehicles.ros2.image_messages import camera_of, same_lens
from shipland.vehicles.ros2.pictures import TopicPictures, image_kind
from shipland.vehicles.ros2.setup import OUR_TOPICS, Ros2Parameters, Ros2Setup
from shipland.vehicles.ros2.state import Heard
from shipland.vehicles.ros2.telling import Telling
from shipland.vehicles.ros2.types import message
from shipland.vehicles.setpoint_vehicle import SetpointVehicle
from shipland.vehicles.vehicle import Vehicle
from shipland.vehicles.waiting import wait_until
from shipland.vehicles.wanted import HOLD, Wanted, wanted_of

_log = logging.getLogger(__name__)

_HOLDS, _HOLD_STEP_S = 3, 0.05
"""The last set-point, so often and so far apart: a listener may lose one, and two topics come in any order."""


class Ros2Vehicle(SetpointVehicle):
    """Whoever takes set-points from topics and publishes its state on others."""

    _parameters: Ros2Parameters

    def __init__(self, setup: Ros2Setup) -> None:
        super().__init__(setup.parameters)
        self._setup = setup
        self._node: Node | None = None
        self._heard = Heard(self._parameters.kind)
        self._camera = setup.camera
        self._camera_problem, self._camera_changed = "", False
        self._topic = TopicPictures(self._calibrated, setup.latency_s)

    # What the loop sees

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures; of `camera_info` once connected, where no calibration was given."""
        if self._camera is None:
            raise VehicleError("connect to the vehicle first: its camera_info says what its pictures are")
        return self._camera

    @property
    def end_reason(self) -> str:
        """Why the flight is over, in words; empty in flight."""
        return self._end_reason or self._heard.over or self._heard.lost

    @property
    def in_command(self) -> str:
        """Who flies: `shipland`, the pilot with the vehicle's mode, or nobody and why."""
        if self._heard.ours and not self._end_reason:
            return "shipland"
        return f"nobody: {self.end_reason}" if self.end_reason else f"the pilot ({self._heard.mode})"

    def response(self) -> Response:
        """What full sticks mean."""
        return self._setup.response

    def _connect(self) -> None:
        setup, heard, topics = self._setup, self._heard, self._setup.topics
        node = self._node = Node(setup.domain, setup.local)
        self._stack.callback(node.close)
        self._velocity = node.publisher(topics["command_velocity"], "geometry_msgs/msg/TwistStamped")
        self._attitude = node.publisher(topics["command_attitude"], "mavros_msgs/msg/AttitudeTarget")
        self._mount = node.publisher(topics["command_gimbal"], "geometry_msgs/msg/QuaternionStamped")
        self._landing = node.publisher(topics["landing"], "std_msgs/msg/Bool")
        self._telling = Telling(node, OUR_TOPICS)
        node.subscribe(topics["odom"], "nav_msgs/msg/Odometry", heard.take_odometry)
        node.subscribe(topics["state"], "mavros_msgs/msg/State", heard.take_state)
        node.subscribe(topics["battery"], "sensor_msgs/msg/BatteryState", heard.take_battery)
        node.subscribe(topics["gimbal"], "geometry_msgs/msg/QuaternionStamped", heard.take_gimbal)
        node.subscribe(OUR_TOPICS["land"], "std_msgs/msg/Bool", heard.take_land, reliable=True)
        if setup.camera is None:
            node.subscribe(topics["camera_info"], "sensor_msgs/msg/CameraInfo", self._take_camera, latched=True)
        if setup.frames is None:
            node.subscribe(topics["image"], image_kind(topics["image"]), self._topic.take)
        self._start_stream(setup.frames or self._topic)
        wait_until(
            lambda: self._camera is not None,
            self._parameters.connect_timeout_s,
            lambda: self._camera_problem or f"/{topics['camera_info']} has not come",
        )
        silent = f"/{topics['image']} has not come; `ros2 topic list` shows what there is"
        self._await_picture(setup.open_timeout_s, silent)

    def _engage(self) -> None:
        """Wait for `/shipland/land` if that was asked for, and until the vehicle was handed over and is armed."""
        heard, waits = self._heard, self._setup.wait
        while not heard.begin(waits):
            while waits and not heard.land:
                self._telling.state("", "waiting for /shipland/land", time.monotonic())
                sleep_or_stop(0.02)
            heard.expect(waits or self._setup.take)
            if not heard.given:
                _log.warning(heard.hand_over_words)
                self._telling.state("", heard.hand_over_words, time.monotonic())
            wait_until(
                lambda: heard.given or (waits and not heard.land),
                self._parameters.engage_timeout_s,
                lambda: f"the vehicle was not given to us ({heard.hand_over_words})",
            )
        self._begin()
        self._start_set_points("ros2-set-points")

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""
        return self._heard.telemetry_at(t_s)

    def _leave(self) -> None:
        if self._pace is not None:
            self._pace.stop()
        if self._engaged:
            self._let_motors_stop(False)
            if self._heard.ours:  # also after an end of its own: its hold may not have left yet
                self._end("the flight was ended here; the vehicle holds")
                self._hold()
        called = self._setup.wait and self._heard.land  # who called waits for an answer
        if self._engaged or called:
            words = self.end_reason or self._failure or "the vehicle was not given to us"
            self._telling.state("", words, time.monotonic())
            self._telling.ended(words)

    def checks(self) -> list[Check]:
        """What of topics and camera is fit to fly; once connected."""
        assert self._stream is not None and self._node is not None  # connected
        commands = (self._setup.topics[name] for name in ("command_velocity", "command_attitude"))
        others = [topic for topic in commands if self._node.is_published_by_another(topic)]
        return ros2_checks(self._heard, self._stream, self._setup, others)

    # What others are told

    def inform(self, record: FlightRecord) -> None:
        """Publish what was seen and decided in a cycle."""
        self.tell(record.observation)
        self._telling.decided(record.decision, record.telemetry.t_s)

    def tell(self, observation: Observation) -> None:
        """Publish an observation, and while nothing is flown why there is no pose."""
        self._telling.seen(observation, self._topic.frame_id)
        if not self._engaged:
            words = observation.reason or "the cue's pose is known"
            self._telling.state("SEE", words, time.monotonic())

    def inform_of(self, rig: Rig, camera_in_body_m: Array) -> None:  # noqa: ARG002 - poses are of the camera
        """Publish where the deck lies from the cue; once connected."""
        if self._connected:
            self._telling.deck_lies(rig.deck_in_bar_m, time.monotonic())

    # Within

    def _take_camera(self, info: object) -> None:
        try:
            told = camera_of(info, self._setup.topics["image"])
        except Exception as error:
            self._camera_problem = str(error)
            raise
        self._camera = self._camera or told
        self._camera_changed = not same_lens(self._camera, told)

    def _calibrated(self) -> Camera | None:
        """Intrinsics of the topic's pictures, once known; VehicleError while camera_info says others."""
        if self._camera_changed:
            words = "is not what it was when the vehicle was connected: zoom and mode of the camera must stay"
            raise VehicleError(f"/{self._setup.topics['camera_info']} {words}")
        return self._camera

    def _gimbal_at(self, t_s: float) -> tuple[GimbalAttitude, float]:
        return self._heard.gimbal_at(t_s, self._setup.fixed_pitch_rad)

    def _tick(self, step_s: float) -> None:
        """One set-point, from the thread of the set-points."""
        heard, now_s = self._heard, time.monotonic()
        heard.watch_silence(self._parameters.link_timeout_s)
        if heard.over:
            self._end(heard.over)
        if not heard.ours:
            self._let_motors_stop(False)
            return
        newest = self._newest(now_s)
        wanted = HOLD if newest is None else wanted_of(newest, self._setup.response)
        heard.landing = newest is not None and newest.intent is Intent.LAND
        self._let_motors_stop(newest is not None and heard.landing and newest.at_contact_height)
        self._set_point(wanted, step_s)
        self._aim(newest, now_s)

    def _turn_camera(self, pitch_rad: float) -> None:
        self._mount.send(gimbal_message(GimbalAttitude(0.0, pitch_rad), time.time()))

    def _hold(self) -> None:
        """To end with, while nobody else flies."""
        for _ in range(_HOLDS):
            if self._heard.ours:
                self._velocity.send(velocity_message(HOLD, time.time()))
                time.sleep(_HOLD_STEP_S)

    def _let_motors_stop(self, at_contact: bool) -> None:
        """Told at every turn, and when control has gone: whoever flies then must not lose the motors to our landing."""
        self._landing.send(message("std_msgs/msg/Bool", data=at_contact))

    def _set_point(self, wanted: Wanted, step_s: float) -> None:
        """A hold is a velocity of zero for either kind: a level attitude drifts with the wind."""
        response, heading_rad = self._setup.response, self._heard.telemetry_at(0.0).heading_rad
        if response.kind == "velocity" or wanted.hold or heading_rad is None:
            self._heading.rest()
            level = wanted if response.kind == "velocity" else HOLD
            self._velocity.send(velocity_message(level, time.time()))
            return
        to_rad = self._heading.next_rad(wanted.turn_rad_s, heading_rad, step_s)
        self._attitude.send(attitude_message(wanted, to_rad, response.max_climb_mps, time.time()))


def ros2(setup: VehicleSetup) -> Vehicle:
    """`ros2://drone?image=/camera/image_raw`: the vehicle's topics below `/drone`; options: see `ros2.setup`."""
    require_dds()
    return Ros2Vehicle(Ros2Setup.of(setup))
