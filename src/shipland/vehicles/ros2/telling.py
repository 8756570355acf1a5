"""What we publish: the cue's pose, boxes, mode and reason, TF, and how it ended; live, or into a bag."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from shipland.frames import Array, Pose
from shipland.messages import Decision, Observation
from shipland.vehicles.ros2.conversions import CUE, DECK, flu, transform
from shipland.vehicles.ros2.sight_messages import cue_pose, detections, optical_from_cue, status
from shipland.vehicles.ros2.types import Message, message

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
