"""What is seen and decided as ROS 2 messages: the cue's pose, boxes, mode and reason."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shipland.camera import level_from_camera
from shipland.frames import FLU_FROM_FRD, Pose, rotation_from_euler
from shipland.messages import BarPose, Box, GimbalAttitude, Observation
from shipland.vehicles.ros2.conversions import CUE, flu, header, pose_message
from shipland.vehicles.ros2.types import Message, message

_LEAST_STD_M, _LEAST_STD_RAD = 0.02, 0.01
"""Least standard deviations that are sent: an outlier that is believed costs more than a wait."""
_LEVEL_STD_RAD = 0.02
"""Standard deviation of roll and pitch, which are the gimbal's."""


def cue_pose(pose: BarPose, t_s: float) -> Message:
    """geometry_msgs/PoseWithCovarianceStamped: the camera's place in `cue`, and its heading; level."""
    level = Pose(rotation_from_euler(0.0, 0.0, pose.yaw_rad), pose.position_in_bar_m)
    covariance = np.where(np.isfinite(pose.covariance), pose.covariance, 0.0)
    full, axes = np.zeros((6, 6)), (0, 1, 2, 5)
    turned = np.diag([1.0, -1.0, -1.0, -1.0])  # forward, left, up, counterclockwise
    full[np.ix_(axes, axes)] = turned @ covariance @ turned
    full += np.diag([_LEAST_STD_M**2] * 3 + [_LEVEL_STD_RAD**2] * 2 + [_LEAST_STD_RAD**2])
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
