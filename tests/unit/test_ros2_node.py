"""The simulated vehicle as a ROS 2 node: what it flies of what comes; and a flight's log as a bag."""

import math
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the extra ros2")

from made_up_flight import CAMERA, INFO, RIG, flight, write_log

from shipland.errors import ConfigError
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import GimbalAttitude, Intent
from shipland.record.channels import LogParameters
from shipland.record.writer import LogWriter
from shipland.report.ros2_bag import write_bag
from shipland.sitl.ros2_node import SetPoints, VehicleTopics
from shipland.vehicles.ros2 import conversions as ros
from shipland.vehicles.ros2 import image_messages as images
from shipland.vehicles.ros2.setup import vehicle_topics
from shipland.vehicles.ros2.types import message
from shipland.vehicles.wanted import HOLD, Wanted, wanted_of


def test_an_attitude_becomes_the_sticks_that_ask_for_it() -> None:
    orders = SetPoints(ANAFI_LIKE, 0.0)
    asked = Wanted(0.1, -0.05, 0.5, 0.2)
    orders.take_attitude(ros.attitude_message(asked, 1.0, ANAFI_LIKE.max_climb_mps, time.time()))
    orders.take_landing(message("std_msgs/msg/Bool", data=True))
    orders.take_gimbal(ros.gimbal_message(GimbalAttitude(0.0, -0.3), time.time()))
    command = orders.command(3.0)
    back = wanted_of(command, ANAFI_LIKE)
    assert [back.forward, back.right, back.climb_mps, back.turn_rad_s] == pytest.approx(
        [0.1, -0.05, 0.5, 0.2], abs=1e-6
    )
    assert command.intent is Intent.LAND
    assert command.gimbal_pitch_rad == pytest.approx(-0.3)
    assert command.t_s == 3.0


def test_velocities_to_an_aircraft_that_flies_tilts_are_a_hold_and_said_to_be() -> None:
    orders = SetPoints(ANAFI_LIKE, 0.0)
    assert not orders.begun
    orders.take_velocity(ros.velocity_message(HOLD, time.time()))
    assert orders.begun
    assert not orders.refused
    orders.take_velocity(ros.velocity_message(Wanted(1.0, 0.0, 0.0, 0.0), time.time()))
    assert orders.command(1.0).intent is Intent.HOLD
    assert "aircraft.loop.kind=velocity" in orders.refused


def test_a_set_point_that_is_no_number_leaves_the_one_before() -> None:
    orders = SetPoints(ANAFI_LIKE, 0.0)
    orders.take_attitude(ros.attitude_message(Wanted(0.1, 0.0, 0.0, 0.0), 0.0, 1.0, time.time()))
    orders.take_attitude(message("mavros_msgs/msg/AttitudeTarget", thrust=math.nan))
    assert orders.command(1.0).pitch_percent > 0.0


def test_of_two_topics_the_set_point_that_was_sent_later_is_flown() -> None:
    """A flight ends with a hold on another topic than its attitudes'; a clock set back is followed after a while."""
    orders, tilt = SetPoints(ANAFI_LIKE, 0.0), Wanted(0.1, 0.0, 0.0, 0.0)
    orders.take_velocity(ros.velocity_message(HOLD, 10.0))
    orders.take_attitude(ros.attitude_message(tilt, 0.0, 1.0, 9.97))
    assert orders.command(1.0).intent is Intent.HOLD
    assert orders._newest is not None
    hold, heard_s, stamp_s = orders._newest
    orders._newest = hold, heard_s - 2.0, stamp_s
    orders.take_attitude(ros.attitude_message(tilt, 0.0, 1.0, 9.97))
    assert orders.command(1.0).intent is Intent.FLY


def test_what_is_latched_in_flight_is_played_latched(tmp_path: Path) -> None:
    """By `ros2 bag play`; tf2 hears no /tf_static that is not."""
    from rosbags.interfaces import ConnectionExtRosbag2, QosDurability, QosReliability
    from rosbags.rosbag2 import Reader

    write_bag(write_log(tmp_path / "flight.mcap", flight(from_s=20.0, to_s=20.1)), tmp_path / "bag")
    latched = set()
    with Reader(tmp_path / "bag") as reader:
        for connection in reader.connections:
            assert isinstance(connection.ext, ConnectionExtRosbag2)
            for quality in connection.ext.offered_qos_profiles:
                assert quality.reliability is QosReliability.RELIABLE
                assert quality.durability is QosDurability.TRANSIENT_LOCAL
                latched.add(connection.topic)
    assert latched == {"/tf_static", "/shipland/result"}


def test_a_log_becomes_a_bag_that_rosbags_reads(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    parameters = LogParameters(image_rate_hz=2.0)
    log = write_log(tmp_path / "flight.mcap", flight(from_s=20.0, to_s=21.0), parameters=parameters)
    counts = write_bag(log, tmp_path / "bag")
    heard: dict[str, list[object]] = {}
    with AnyReader([tmp_path / "bag"]) as reader:
        for connection, time_ns, data in reader.messages():
            assert 19.5 < 1e-9 * time_ns < 21.5
            heard.setdefault(connection.topic, []).append(reader.deserialize(data, connection.msgtype))
    assert {topic: len(told) for topic, told in heard.items()} == {t: n for t, n in counts.items() if n}
    assert counts["/drone/odom"] == len(heard["/drone/camera/attitude"])
    assert heard["/drone/camera/image_raw/compressed"]
    assert heard["/shipland/cue_pose"]
    assert heard["/shipland/diagnostics"][0].status[0].name == "shipland"  # type: ignore[attr-defined]
    with pytest.raises(ConfigError, match="is there already"):
        write_bag(log, tmp_path / "bag")


def test_a_picture_that_several_cycles_saw_is_in_the_bag_once(tmp_path: Path) -> None:
    cycles = list(flight(from_s=20.0, to_s=20.5))
    log = write_log(tmp_path / "flight.mcap", [replace(cycle, frame=cycles[0].frame) for cycle in cycles])
    assert write_bag(log, tmp_path / "bag")["/drone/camera/image_raw/compressed"] == 1


def test_half_a_bag_is_not_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = write_log(tmp_path / "flight.mcap", flight(from_s=20.0, to_s=20.1))

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr("shipland.report.ros2_bag.odometry_of", stopped)
        write_bag(log, tmp_path / "bag")
    assert write_bag(log, tmp_path / "bag")["/drone/odom"] > 0


def test_a_bag_has_no_time_beyond_what_ros_holds(tmp_path: Path) -> None:
    cycles = list(flight(from_s=20.0, to_s=20.2))
    far = replace(cycles[-1], frame=replace(cycles[-1].frame, t_s=1e11))
    far = replace(far, telemetry=replace(far.telemetry, t_s=1e11))
    counts = write_bag(write_log(tmp_path / "flight.mcap", [*cycles[:-1], far]), tmp_path / "bag")
    assert counts["/drone/odom"] == len(cycles)


def test_a_bag_has_no_time_below_zero_where_the_first_exposure_precedes_the_flight(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    log = tmp_path / "flight.mcap"
    with LogWriter(log, INFO, RIG, CAMERA, LogParameters()) as writer:
        for record in flight(from_s=20.0, to_s=20.1):
            early_s = record.frame.t_s - 20.009
            writer.append(replace(record, frame=replace(record.frame, t_s=early_s)))
    assert early_s > 0.0
    assert write_bag(log, tmp_path / "bag")["/drone/camera/image_raw/compressed"] > 0
    with AnyReader([tmp_path / "bag"]) as reader:
        stamps = [
            reader.deserialize(data, connection.msgtype).header.stamp.sec  # type: ignore[attr-defined]
            for connection, _, data in reader.messages()
            if connection.topic.startswith("/drone/camera")
        ]
    assert min(stamps) == 0


class Kept:
    """Outlets that keep what is sent."""

    def __init__(self) -> None:
        self.sent: dict[str, list[Any]] = {}

    def publisher(self, topic: str, kind: str, *, latched: bool = False) -> SimpleNamespace:
        return SimpleNamespace(heard=True, send=self.sent.setdefault(topic, []).append)


def test_what_the_simulated_vehicle_tells_is_stamped_with_when_it_was_true() -> None:
    kept, topics = Kept(), vehicle_topics("drone", {})
    told = VehicleTopics(kept, topics, SimpleNamespace(camera=CAMERA))
    (record,) = list(flight(from_s=20.0, to_s=20.03))[:1]
    late = replace(record.telemetry, attitude_t_s=record.telemetry.t_s - 0.19)
    told.tell(record.frame, late, exposed_s=999.7, now_s=1000.0)
    (odometry,) = kept.sent["drone/odom"]
    assert ros.seconds(odometry.header.stamp) == pytest.approx(999.81, abs=1e-6)
    (picture,) = kept.sent["drone/camera/image_raw"]
    assert ros.seconds(picture.header.stamp) == pytest.approx(999.7, abs=1e-6)
    assert (images.image_of(picture) == record.frame.image).all()
    assert images.image_of(kept.sent["drone/camera/image_raw/compressed"][0]).shape == record.frame.image.shape
