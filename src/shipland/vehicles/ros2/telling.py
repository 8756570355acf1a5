"""What we publish: the cue's pose, boxes, mode and reason, TF, and how it ended; live, or into a bag."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from shipland.camera import level_from_camera
from shipland.frames import FLU_FROM_FRD, Array, Pose, rotation_from_euler
from shipland.messages import BarPose, Box, Decision, GimbalAttitude, Observation
from shipland.vehicles.ros2.conversions import CUE, DECK, flu, header, pose_message, transform
from shipland.vehicles.ros2.types import Message, message
from shipland.vehicles.told import LEAST_STD_M, LEAST_STD_RAD, LEVEL_STD_RAD, told_covariance

_STATUS_S = 0.5
"""Longest time from one status to the next, changed or not."""


class Outlet(Protocol):
    """Where the messages of one topic go."""

    def send(self, sent: Message, /) -> None:
        """A message."""


class Outlets(Protocol):
    """A node, or a bag."""

    def publisher(self, topic: str, kind: str, *, latched: bool = False) -> Outlet:
        """Of one topic; `latched` keeps the newest for those who come later."""


def now_epoch_s(t_s: float) -> float:
    """A time of `time.monotonic` as one since the epoch [s]."""
    return time.time() - (time.monotonic() - t_s)


class Telling:
    """Publishes what is seen and decided.

    Args:
        outlets: where to.
        topics: full names, by those of `OUR_TOPICS`.
        epoch_s: the loop's time as one since the epoch [s].
    """

    def __init__(
        self, outlets: Outlets, topics: Mapping[str, str], epoch_s: Callable[[float], float] = now_epoch_s
    ) -> None:
        self._epoch_s = epoch_s
        self._pose = outlets.publisher(topics["cue_pose"], "geometry_msgs/msg/PoseWithCovarianceStamped")
        self._boxes = outlets.publisher(topics["detections"], "vision_msgs/msg/Detection2DArray")
        self._status = outlets.publisher(topics["diagnostics"], "diagnostic_msgs/msg/DiagnosticArray")
        self._result = outlets.publisher(topics["result"], "std_msgs/msg/String", latched=True)
        self._tf = outlets.publisher("tf", "tf2_msgs/msg/TFMessage")
        self._fixed = outlets.publisher("tf_static", "tf2_msgs/msg/TFMessage", latched=True)
        self._said, self._said_s = "", -math.inf

    def deck_lies(self, deck_in_bar_m: Array, t_s: float) -> None:
        """Publish where the deck's centre at rest lies from the cue (3,) [m]."""
        deck = transform(self._epoch_s(t_s), CUE, DECK, flu(Pose(np.eye(3), deck_in_bar_m)))
        self._fixed.send(message("tf2_msgs/msg/TFMessage", transforms=[deck]))

    def seen(self, observation: Observation, frame_id: str) -> None:
        """Publish an observation with its exposure's stamp; `frame_id` is the picture's optical frame."""
        exposed_s = self._epoch_s(observation.t_s)
        self._boxes.send(detections(observation, exposed_s, frame_id))
        pose = observation.bar_pose
        if pose is None:
            return
        self._pose.send(cue_pose(pose, exposed_s))
        placed = transform(exposed_s, frame_id, CUE, optical_from_cue(pose, observation.gimbal))
        self._tf.send(message("tf2_msgs/msg/TFMessage", transforms=[placed]))

    def decided(self, decision: Decision, t_s: float) -> None:
        """Publish mode and reason when they change, and every half second."""
        mode = "" if decision.mode is None else decision.mode.name
        values = {"intent": decision.command.intent.value}
        if decision.estimate is not None:
            values["distance_m"] = f"{math.hypot(*decision.estimate.aircraft_in_bar_m):.2f}"
        if decision.landing_probability is not None:
            values["landing_probability"] = f"{decision.landing_probability:.3f}"
        self.state(mode, decision.reason, t_s, values)

    def state(self, mode: str, reason: str, t_s: float, values: Mapping[str, str] | None = None) -> None:
        """Publish a status when it changes, and every half second."""
        said = f"{mode}: {reason}"
        if said != self._said or t_s - self._said_s >= _STATUS_S:
            self._said, self._said_s = said, t_s
            self._status.send(status(mode, reason, values or {}, self._epoch_s(t_s)))

    def ended(self, reason: str) -> None:
        """Publish how it ended, for those too who come later."""
        self._result.send(message("std_msgs/msg/String", data=reason))


def cue_pose(pose: BarPose, t_s: float) -> Message:
    """geometry_msgs/PoseWithCovarianceStamped: the camera's place in `cue`, and its heading; level."""
    level = Pose(rotation_from_euler(0.0, 0.0, pose.yaw_rad), pose.position_in_bar_m)
    full, axes = np.zeros((6, 6)), (0, 1, 2, 5)
    turned = np.diag([1.0, -1.0, -1.0, -1.0])  # forward, left, up, counterclockwise
    full[np.ix_(axes, axes)] = turned @ told_covariance(pose.covariance) @ turned
    full += np.diag([LEAST_STD_M**2] * 3 + [LEVEL_STD_RAD**2] * 2 + [LEAST_STD_RAD**2])
    return message(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        header=header(t_s, CUE),
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose_message(flu(level)), covariance=full.ravel()),
    )


def optical_from_cue(pose: BarPose, gimbal: GimbalAttitude) -> Pose:
    """The cue (forward-left-up) in the camera's optical frame, for TF."""
    bar_from_camera = Pose(
        rotation_from_euler(0.0, 0.0, pose.yaw_rad - gimbal.yaw_rad) @ level_from_camera(gimbal), pose.position_in_bar_m
    )
    camera_from_bar = bar_from_camera.inverse()
    return Pose(camera_from_bar.rotation @ FLU_FROM_FRD, camera_from_bar.translation_m)


def detections(observation: Observation, t_s: float, frame: str) -> Message:
    """vision_msgs/Detection2DArray of the boxes, class ids `ship` and `bar`; empty where neither is seen."""
    seen = (("ship", observation.ship_box), ("bar", observation.bar_box))
    return message(
        "vision_msgs/msg/Detection2DArray",
        header=header(t_s, frame),
        detections=[_detection(name, box, t_s, frame) for name, box in seen if box is not None],
    )


def _detection(name: str, box: Box, t_s: float, frame: str) -> Message:
    centre = message("vision_msgs/msg/Point2D", x=float(box.centre_px[0]), y=float(box.centre_px[1]))
    hypothesis = message("vision_msgs/msg/ObjectHypothesis", class_id=name, score=float(box.confidence))
    return message(
        "vision_msgs/msg/Detection2D",
        header=header(t_s, frame),
        results=[message("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis)],
        bbox=message(
            "vision_msgs/msg/BoundingBox2D",
            center=message("vision_msgs/msg/Pose2D", position=centre),
            size_x=float(box.size_px[0]),
            size_y=float(box.size_px[1]),
        ),
    )


def status(mode: str, reason: str, values: Mapping[str, str], t_s: float) -> Message:
    """diagnostic_msgs/DiagnosticArray with one line: the mode, and why in words; a warning where there is no mode."""
    known = "diagnostic_msgs/msg"
    line = message(
        f"{known}/DiagnosticStatus",
        level=0 if mode else 1,
        name="shipland",
        message=f"{mode}: {reason}" if mode else reason,
        hardware_id="",
        values=[message(f"{known}/KeyValue", key=key, value=value) for key, value in values.items()],
    )
    return message(f"{known}/DiagnosticArray", header=header(t_s, ""), status=[line])
