"""A flight log as a ROS 2 bag: the topics of `ros2://`, as a node beside the flight would have recorded them."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipland.errors import ConfigError, DataError
from shipland.record.foxglove_scene import nanoseconds
from shipland.record.reader import FlightLog, read_log
from shipland.vehicles.ros2.conversions import gimbal_message, odometry_of
from shipland.vehicles.ros2.image_messages import camera_info, jpeg_message
from shipland.vehicles.ros2.setup import OUR_TOPICS, vehicle_topics
from shipland.vehicles.ros2.telling import Outlet, Telling
from shipland.vehicles.ros2.types import cdr_of, store
from shipland.vision.log_pictures import read_pictures

if TYPE_CHECKING:
    from rosbags.interfaces import Qos

_OPTICAL = "camera_optical"
_LATEST_S = 2.0**31 - 1.0
"""ROS counts seconds in 32 bits, with a sign."""
_NO_PICTURE = (2**63, None)
"""After a log's last picture."""


@dataclass
class _Bag:
    """`Outlets` into rosbags' writer; what is sent is written at `time_ns`."""

    writer: Any
    time_ns: int = 0

    def publisher(self, topic: str, kind: str, *, latched: bool = False) -> Outlet:
        offered = [_latched()] if latched else []
        connection = self.writer.add_connection(f"/{topic}", kind, typestore=store(), offered_qos_profiles=offered)
        return _Topic(self, connection)


@dataclass
class _Topic:
    bag: _Bag
    connection: Any

    def send(self, sent: Any, /) -> None:  # noqa: ANN401
        self.bag.writer.write(self.connection, self.bag.time_ns, cdr_of(sent))


def _latched() -> Qos:
    """As a player must offer what is kept for those who come later: tf2 hears no other /tf_static."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    unbounded = QosTime(0, 0)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL,
        deadline=unbounded,
        lifespan=unbounded,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=unbounded,
        avoid_ros_namespace_conventions=False,
    )


def write_bag(log_path: Path, folder: Path, namespace: str = "drone") -> dict[str, int]:
    """Write a flight log as a bag (rosbag2, version 8, storage MCAP) for `ros2 bag`; how many messages of each topic.

    DataError where the log cannot be read, ConfigError where the folder is there or the namespace is none, OSError
    where the folder cannot be made, VehicleError without the extra `ros2`.
    """
    store()
    from rosbags.rosbag2 import StoragePlugin, Writer

    log = read_log(log_path)
    if not log.records:
        raise DataError(f"{log_path} holds no cycle to write")
    if folder.exists():
        raise ConfigError(f"{folder} is there already: name another folder for the bag, or remove it")
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        with Writer(folder, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            return _write(log_path, log, _Bag(writer), namespace)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)  # half a bag is none
        raise


def _write(log_path: Path, log: FlightLog, bag: _Bag, namespace: str) -> dict[str, int]:
    topics = vehicle_topics(namespace, {})
    odom = bag.publisher(topics["odom"], "nav_msgs/msg/Odometry")
    mount = bag.publisher(topics["gimbal"], "geometry_msgs/msg/QuaternionStamped")
    image = bag.publisher(f"{topics['image']}/compressed", "sensor_msgs/msg/CompressedImage")
    info = bag.publisher(topics["camera_info"], "sensor_msgs/msg/CameraInfo")

    def stamped_s(t_s: float) -> float:  # the first exposure may precede the flight; ROS has no time below zero
        return min(max(t_s, 0.0), _LATEST_S)

    telling, pictures = Telling(bag, OUR_TOPICS, stamped_s), read_pictures(log_path)
    first_s = log.records[0].frame.t_s
    bag.time_ns = round(1e9 * stamped_s(first_s))
    telling.deck_lies(log.header.rig.deck_in_bar_m, first_s)
    time_ns, picture = next(pictures, _NO_PICTURE)
    for record in log.records:
        exposed_s, exposed_ns = stamped_s(record.frame.t_s), nanoseconds(record.frame.t_s)
        bag.time_ns = round(1e9 * stamped_s(record.telemetry.t_s))
        mount.send(gimbal_message(record.frame.gimbal, exposed_s))
        odom.send(odometry_of(record.telemetry, stamped_s(record.telemetry.newest_s)))
        while time_ns < exposed_ns:
            time_ns, picture = next(pictures, _NO_PICTURE)
        if picture is not None and time_ns == exposed_ns:
            height_px, width_px, _ = picture.shape
            info.send(camera_info(log.header.camera.scaled(width_px, height_px), exposed_s, _OPTICAL))
            image.send(jpeg_message(picture, exposed_s, _OPTICAL))
            time_ns, picture = next(pictures, _NO_PICTURE)
        telling.seen(record.observation, _OPTICAL)
        telling.decided(record.decision, record.telemetry.t_s)
    telling.ended(log.verdict.reason if log.verdict is not None else "no touchdown")
    return {connection.topic: bag.writer.counts[connection.id] for connection in bag.writer.connections}
