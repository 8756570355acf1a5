"""Between what crosses our stages and ROS 2's messages: REP-103 axes and units, REP-105 and REP-147 names.

ROS's world is `enu`, its bodies are forward-left-up, its optical frames right-down-forward as ours. What is not known
is NaN in both directions, and what is not finite counts as not known. Times are the system's (`time.time`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shipland.errors import DataError
from shipland.frames import (
    ENU_FROM_NED,
    FLU_FROM_FRD,
    Array,
    Pose,
    all_finite,
    euler_from_quaternion,
    euler_from_rotation,
    quaternion_from_rotation,
    rotation_from_euler,
    rotation_from_quaternion,
)
from shipland.messages import GimbalAttitude, Telemetry
from shipland.vehicles.ros2.types import Message, message
from shipland.vehicles.wanted import Wanted, thrust_of

ODOM, BASE_LINK, BASE_LEVEL, CUE, DECK = "odom", "base_link", "base_level", "cue", "deck"
"""Frame ids: REP-105's two; `level`, `bar` and `deck` with ROS's axes."""

_UNKNOWN = 1e6
"""Variance of what is not measured."""

_EVERYTHING_COUNTS = 0
"""AttitudeTarget.type_mask: ArduPilot stops at a target with some of its three body rates ignored."""


# Headers and geometry


def stamp(t_s: float) -> Message:
    """A time since the epoch [s]."""
    whole_s = math.floor(t_s)
    nanoseconds = min(round(1e9 * (t_s - whole_s)), 999_999_999)
    return message("builtin_interfaces/msg/Time", sec=int(whole_s), nanosec=nanoseconds)


def seconds(stamped: Message) -> float:
    """The inverse of `stamp` [s]."""
    return float(stamped.sec) + 1e-9 * float(stamped.nanosec)


def header(t_s: float, frame: str) -> Message:
    """std_msgs/Header."""
    return message("std_msgs/msg/Header", stamp=stamp(t_s), frame_id=frame)


def _vector(kind: str, values: Array) -> Message:
    x, y, z = (float(value) for value in values)
    return message(kind, x=x, y=y, z=z)


def _quaternion(rotation: Array) -> Message:
    w, x, y, z = quaternion_from_rotation(rotation)
    return message("geometry_msgs/msg/Quaternion", w=w, x=x, y=y, z=z)


def _rotation(quaternion: Message) -> Array | None:
    """None where it is not finite or has no length."""
    values = np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z], dtype=float)
    if not all_finite(values) or not 0.5 < float(values @ values) < 2.0:
        return None
    return rotation_from_quaternion(values)


def pose_message(pose: Pose) -> Message:
    """geometry_msgs/Pose of a pose in ROS's axes."""
    return message(
        "geometry_msgs/msg/Pose",
        position=_vector("geometry_msgs/msg/Point", pose.translation_m),
        orientation=_quaternion(pose.rotation),
    )


def transform(t_s: float, parent: str, child: str, parent_from_child: Pose) -> Message:
    """geometry_msgs/TransformStamped, both frames in ROS's axes."""
    return message(
        "geometry_msgs/msg/TransformStamped",
        header=header(t_s, parent),
        child_frame_id=child,
        transform=message(
            "geometry_msgs/msg/Transform",
            translation=_vector("geometry_msgs/msg/Vector3", parent_from_child.translation_m),
            rotation=_quaternion(parent_from_child.rotation),
        ),
    )


def flu(pose: Pose) -> Pose:
    """A pose between two forward-right-down frames as one between the same in forward-left-up."""
    return Pose(FLU_FROM_FRD @ pose.rotation @ FLU_FROM_FRD, FLU_FROM_FRD @ pose.translation_m)


def _refuse_other_axes(what: str, *frames: str) -> None:
    """DataError where frame ids have REP-103's suffixes of other axes, in which signs are mirrored."""
    if any(frame.endswith(("_ned", "_frd")) for frame in frames):
        raise DataError(f"{what} is in {', '.join(frames)}; expected east-north-up and forward-left-up")


# Telemetry


def odometry_of(telemetry: Telemetry, t_s: float) -> Message:
    """nav_msgs/Odometry of a vehicle without a position: attitude, height, velocity; `t_s` is since the epoch."""
    roll, pitch, heading = (
        math.nan if value is None else value
        for value in (telemetry.roll_rad, telemetry.pitch_rad, telemetry.heading_rad)
    )
    ned_from_body = rotation_from_euler(roll, pitch, heading)
    height_m = math.nan if telemetry.height_m is None else telemetry.height_m
    velocity_mps = np.full(3, math.nan)
    if telemetry.velocity_in_level_mps is not None:
        velocity_mps = rotation_from_euler(roll, pitch, 0.0).T @ telemetry.velocity_in_level_mps
    unknown = np.zeros((6, 6))
    unknown[0, 0] = unknown[1, 1] = _UNKNOWN
    return message(
        "nav_msgs/msg/Odometry",
        header=header(t_s, ODOM),
        child_frame_id=BASE_LINK,
        pose=message(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=pose_message(Pose(ENU_FROM_NED @ ned_from_body @ FLU_FROM_FRD, np.array([0.0, 0.0, height_m]))),
            covariance=unknown.ravel(),
        ),
        twist=message(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=message(
                "geometry_msgs/msg/Twist",
                linear=_vector("geometry_msgs/msg/Vector3", FLU_FROM_FRD @ velocity_mps),
            ),
        ),
    )


def with_odometry(before: Telemetry, odometry: Message, t_s: float) -> Telemetry:
    """Telemetry with what an Odometry says; its x and y are not read: there is no position.

    Args:
        before: what was known.
        odometry: pose in an east-north-up frame, twist in the body's, forward-left-up.
        t_s: when it was true, on the loop's clock.

    Raises:
        DataError: its frames say that it is of other axes, or the twist of the world's.
    """
    world, body = odometry.header.frame_id, odometry.child_frame_id
    _refuse_other_axes("odometry", world, body)
    if world and world == body:
        raise DataError(f"odometry's child_frame_id is {body}, the pose's own frame; expected the body's, of the twist")
    enu_from_flu, height_m = _rotation(odometry.pose.pose.orientation), float(odometry.pose.pose.position.z)
    linear = odometry.twist.twist.linear
    velocity_mps = FLU_FROM_FRD @ np.array([linear.x, linear.y, linear.z], dtype=float)
    if enu_from_flu is not None:
        roll, pitch, heading = euler_from_rotation(ENU_FROM_NED @ enu_from_flu @ FLU_FROM_FRD)
        before = replace(before, roll_rad=roll, pitch_rad=pitch, heading_rad=heading)
        before = replace(before, attitude_t_s=t_s, heading_t_s=t_s)
        if all_finite(velocity_mps):
            in_level = rotation_from_euler(roll, pitch, 0.0) @ velocity_mps
            before = replace(before, velocity_in_level_mps=in_level, velocity_t_s=t_s)
    if math.isfinite(height_m):
        before = replace(before, height_m=height_m, height_t_s=t_s)
    return before


def gimbal_message(gimbal: GimbalAttitude, t_s: float) -> Message:
    """geometry_msgs/QuaternionStamped: the camera's body (forward-left-up, not optical) in `base_level`."""
    level_from_mount = rotation_from_euler(gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad)
    return message(
        "geometry_msgs/msg/QuaternionStamped",
        header=header(t_s, BASE_LEVEL),
        quaternion=_quaternion(FLU_FROM_FRD @ level_from_mount @ FLU_FROM_FRD),
    )


def gimbal_of(attitude: Message) -> GimbalAttitude | None:
    """The inverse of `gimbal_message`; None where it is not finite, DataError where its frame is of other axes."""
    _refuse_other_axes("the camera's attitude", attitude.header.frame_id)
    rotation = _rotation(attitude.quaternion)
    if rotation is None:
        return None
    return GimbalAttitude(*euler_from_rotation(FLU_FROM_FRD @ rotation @ FLU_FROM_FRD))


# Set-points


def velocity_message(wanted: Wanted, t_s: float) -> Message:
    """geometry_msgs/TwistStamped, REP-147's `command_velocity`: speeds in `base_level`, and a turn; a hold is zero."""
    twist = message("geometry_msgs/msg/Twist")
    if not wanted.hold:
        speeds = np.array([wanted.forward, -wanted.right, wanted.climb_mps])
        turn = np.array([0.0, 0.0, -wanted.turn_rad_s])
        twist = message(
            "geometry_msgs/msg/Twist",
            linear=_vector("geometry_msgs/msg/Vector3", speeds),
            angular=_vector("geometry_msgs/msg/Vector3", turn),
        )
    return message("geometry_msgs/msg/TwistStamped", header=header(t_s, BASE_LEVEL), twist=twist)


def wanted_velocity(command: Message) -> Wanted | None:
    """The inverse of `velocity_message`; None where a number is not finite."""
    linear, angular = command.twist.linear, command.twist.angular
    forward, right, climb, turn = float(linear.x), -float(linear.y), float(linear.z), -float(angular.z)
    if not all(map(math.isfinite, (forward, right, climb, turn))):
        return None
    return Wanted(forward, right, climb, turn, hold=not any((forward, right, climb, turn)))


def attitude_message(wanted: Wanted, heading_rad: float, max_climb_mps: float, t_s: float) -> Message:
    """mavros_msgs/AttitudeTarget: attitude against `enu`, body rates, and a climb as thrust: 0.5 holds the height.

    Args:
        wanted: tilts, climb and turn.
        heading_rad: to turn to.
        max_climb_mps: that thrust 1 and 0 stand for.
        t_s: since the epoch.
    """
    ned_from_body = rotation_from_euler(wanted.right, -wanted.forward, heading_rad)
    return message(
        "mavros_msgs/msg/AttitudeTarget",
        header=header(t_s, BASE_LINK),
        type_mask=_EVERYTHING_COUNTS,
        orientation=_quaternion(ENU_FROM_NED @ ned_from_body @ FLU_FROM_FRD),
        body_rate=message("geometry_msgs/msg/Vector3", z=-wanted.turn_rad_s),
        thrust=thrust_of(wanted.climb_mps, max_climb_mps, max_climb_mps),
    )


def wanted_attitude(command: Message, max_climb_mps: float) -> Wanted | None:
    """The inverse of `attitude_message`, without the heading; None where a number is not finite."""
    turn_rad_s, thrust = -float(command.body_rate.z), float(command.thrust)
    rotation = _rotation(command.orientation)
    if rotation is None or not math.isfinite(turn_rad_s) or not math.isfinite(thrust):
        return None
    roll, pitch, _ = euler_from_quaternion(quaternion_from_rotation(ENU_FROM_NED @ rotation @ FLU_FROM_FRD))
    return Wanted(-pitch, roll, (2.0 * thrust - 1.0) * max_climb_mps, turn_rad_s)
