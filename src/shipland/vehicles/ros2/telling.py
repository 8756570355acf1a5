"""What we publish: the cue's pose, boxes, mode and reason, TF, and how it ended."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np

from shipland.frames import Array, Pose
from shipland.messages import Decision, Observation
from shipland.vehicles.ros2.conversions import (
    CUE,
    DECK,
    cue_pose,
    detections,
    flu,
    optical_from_cue,
    status,
    transform,
)
from shipland.vehicles.ros2.dds import Node
from shipland.vehicles.ros2.types import message

_STATUS_S = 0.5
"""Longest time from one status to the next, changed or not."""


class Telling:
    """Publishes what is seen and decided on a node.

    Args:
        node: see there.
        topics: full names, by those of `OUR_TOPICS`.
    """

    def __init__(self, node: Node, topics: Mapping[str, str]) -> None:
        self._pose = node.publisher(topics["cue_pose"], "geometry_msgs/msg/PoseWithCovarianceStamped")
        self._boxes = node.publisher(topics["detections"], "vision_msgs/msg/Detection2DArray")
        self._status = node.publisher(topics["diagnostics"], "diagnostic_msgs/msg/DiagnosticArray")
        self._result = node.publisher(topics["result"], "std_msgs/msg/String", latched=True)
        self._tf = node.publisher("tf", "tf2_msgs/msg/TFMessage")
        self._said, self._said_s = "", -math.inf
        self._fixed = node.publisher("tf_static", "tf2_msgs/msg/TFMessage", latched=True)

    def deck_lies(self, deck_in_bar_m: Array) -> None:
        """Publish where the deck's centre at rest lies from the cue (3,) [m]."""
        deck = transform(time.time(), CUE, DECK, flu(Pose(np.eye(3), deck_in_bar_m)))
        self._fixed.send(message("tf2_msgs/msg/TFMessage", transforms=[deck]))

    def seen(self, observation: Observation, frame_id: str) -> None:
        """Publish an observation with its exposure's stamp.

        Args:
            observation: exposure on `time.monotonic`.
            frame_id: optical frame of the picture.
        """
        exposed_s = time.time() - (time.monotonic() - observation.t_s)
        self._boxes.send(detections(observation, exposed_s, frame_id))
        pose = observation.bar_pose
        if pose is None:
            return
        self._pose.send(cue_pose(pose, exposed_s))
        placed = transform(exposed_s, frame_id, CUE, optical_from_cue(pose, observation.gimbal))
        self._tf.send(message("tf2_msgs/msg/TFMessage", transforms=[placed]))

    def decided(self, decision: Decision) -> None:
        """Publish mode and reason when they change, and every half second."""
        mode = "" if decision.mode is None else decision.mode.name
        values = {"intent": decision.command.intent.value}
        if decision.estimate is not None:
            values["distance_m"] = f"{math.hypot(*decision.estimate.aircraft_in_bar_m):.2f}"
        self.state(mode, decision.reason, values)

    def state(self, mode: str, reason: str, values: dict[str, str]) -> None:
        """Publish a status when it changes, and every half second."""
        said, now_s = f"{mode}: {reason}", time.monotonic()
        if said != self._said or now_s - self._said_s >= _STATUS_S:
            self._said, self._said_s = said, now_s
            self._status.send(status(mode, reason, values, time.time()))

    def ended(self, reason: str) -> None:
        """Publish how it ended, for those too who come later."""
        self._result.send(message("std_msgs/msg/String", data=reason))
