"""What crosses to ROS 2: axes, units, what is not known, and bytes."""

import math

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

pytest.importorskip("rosbags", reason="the extra ros2")

from shipland import extras
from shipland.camera import Camera, level_from_camera
from shipland.config import packaged_toml
from shipland.errors import ConfigError, DataError, VehicleError
from shipland.frames import Pose, rotation_from_euler
from shipland.messages import BarPose, Box, GimbalAttitude, Observation, Telemetry
from shipland.vehicles.address import Address, VehicleSetup
from shipland.vehicles.ros2 import conversions as ros
from shipland.vehicles.ros2 import image_messages as images
from shipland.vehicles.ros2 import telling as sights
from shipland.vehicles.ros2.dds import domain_id, settings
from shipland.vehicles.ros2.setup import vehicle_topics
from shipland.vehicles.ros2.types import cdr_of, message, message_of, store, type_hash
from shipland.vehicles.ros2.vehicle import ros2
from shipland.vehicles.wanted import Wanted

NOTHING = Telemetry(0.0)
POSE = BarPose(np.array([-3.0, 0.5, -0.2]), 0.1, np.diag([0.04, 0.01, 0.02, 0.003]), 0.2, np.zeros((8, 2)))
angles = st.floats(-1.4, 1.4)
speeds = st.floats(-20.0, 20.0)


def test_a_nose_to_the_east_is_zero_yaw_and_a_pitch_up_is_negative() -> None:
    told = Telemetry(0.0, 0.0, 0.2, 0.5 * math.pi, 7.0, None, None, None, flying=True)
    turned = ros.odometry_of(told, 10.0).pose.pose.orientation
    assert [turned.w, turned.x, turned.y, turned.z] == pytest.approx([math.cos(0.1), 0.0, -math.sin(0.1), 0.0])


@given(angles, angles, st.floats(-3.1, 3.1), st.floats(-50.0, 50.0), st.tuples(speeds, speeds, speeds))
def test_telemetry_comes_back_from_its_odometry(roll, pitch, heading, height, velocity) -> None:
    told = Telemetry(0.0, roll, pitch, heading, height, np.array(velocity), None, None, flying=True)
    back = ros.with_odometry(NOTHING, message_of(cdr_of(ros.odometry_of(told, 5.5)), "nav_msgs/msg/Odometry"), 3.0)
    assert [back.roll_rad, back.pitch_rad, back.height_m] == pytest.approx([roll, pitch, height], abs=1e-6)
    assert math.cos(back.heading_rad - heading) == pytest.approx(1.0)
    assert back.velocity_in_level_mps == pytest.approx(np.array(velocity), abs=1e-6)
    assert back.velocity_t_s == back.attitude_t_s == 3.0


def test_what_is_not_known_stays_unknown() -> None:
    back = ros.with_odometry(NOTHING, ros.odometry_of(NOTHING, 5.0), 3.0)
    assert back == NOTHING
    unturned = message("nav_msgs/msg/Odometry")  # a quaternion of zeros
    assert ros.with_odometry(NOTHING, unturned, 3.0).roll_rad is None


@pytest.mark.parametrize(("frame", "child"), [("odom_ned", "base_link"), ("odom", "base_link_frd")])
def test_odometry_that_says_it_is_of_other_axes_is_refused(frame: str, child: str) -> None:
    """REP-103's suffixes: taken for ROS's axes, pitch, heading and height would be mirrored."""
    told = ros.odometry_of(Telemetry(0.0, 0.1, 0.2, 0.3, 10.0, np.zeros(3), None, None, flying=True), 0.0)
    told.header.frame_id, told.child_frame_id = frame, child
    with pytest.raises(DataError, match=f"{frame}, {child}"):
        ros.with_odometry(NOTHING, told, 1.0)


def test_odometry_whose_twist_is_not_the_bodys_is_refused() -> None:
    """The twist is of child_frame_id, by the message's definition; turned by the heading it would be flown away."""
    told = ros.odometry_of(Telemetry(0.0, 0.1, 0.2, 0.3, 10.0, np.zeros(3), None, None, flying=True), 0.0)
    told.child_frame_id = told.header.frame_id
    with pytest.raises(DataError, match="child_frame_id is odom"):
        ros.with_odometry(NOTHING, told, 1.0)


def test_a_cameras_attitude_of_other_axes_is_refused() -> None:
    told = ros.gimbal_message(GimbalAttitude(0.0, -0.3), 1.0)
    told.header.frame_id = "base_level_frd"
    with pytest.raises(DataError, match="attitude is in base_level_frd"):
        ros.gimbal_of(told)


def test_a_missing_extra_is_said_where_the_address_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the rehearsal, not after it."""
    there = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "cyclonedds" else there(name))
    with pytest.raises(VehicleError, match=r"needs cyclonedds; install it with: pip install 'shipland\[ros2\]'"):
        ros2(VehicleSetup(Address.parse("ros2://drone"), Camera.from_fov(64, 36, 69.0), packaged_toml("vehicles")))


@given(angles, angles, angles)
def test_the_cameras_attitude_comes_back(roll, pitch, yaw) -> None:
    back = ros.gimbal_of(ros.gimbal_message(GimbalAttitude(roll, pitch, yaw), 1.0))
    assert back is not None
    assert [back.roll_rad, back.pitch_rad, back.yaw_rad] == pytest.approx([roll, pitch, yaw], abs=1e-9)


def test_a_camera_that_looks_down_turns_about_ross_left_axis() -> None:
    turned = ros.gimbal_message(GimbalAttitude(0.0, -0.4), 1.0).quaternion
    assert [turned.w, turned.x, turned.y, turned.z] == pytest.approx([math.cos(0.2), 0.0, math.sin(0.2), 0.0])


def test_forward_right_and_clockwise_are_forward_minus_left_and_minus_yaw() -> None:
    twist = ros.velocity_message(Wanted(1.0, 2.0, 3.0, 0.4), 1.0).twist
    assert [twist.linear.x, twist.linear.y, twist.linear.z] == [1.0, -2.0, 3.0]
    assert twist.angular.z == -0.4


@given(speeds, speeds, speeds, angles)
def test_velocities_come_back(forward, right, climb, turn) -> None:
    back = ros.wanted_velocity(ros.velocity_message(Wanted(forward, right, climb, turn), 1.0))
    assert back is not None
    assert [back.forward, back.right, back.climb_mps, back.turn_rad_s] == [forward, right, climb, turn]


@given(angles, angles, st.floats(-1.0, 1.0), angles, st.floats(-3.1, 3.1))
def test_attitudes_come_back(forward, right, climb, turn, heading) -> None:
    sent = ros.attitude_message(Wanted(forward, right, climb, turn), heading, 2.0, 1.0)
    assert sent.type_mask == 0  # ArduPilot stops where some body rates count and others do not
    back = ros.wanted_attitude(message_of(cdr_of(sent), "mavros_msgs/msg/AttitudeTarget"), 2.0)
    assert back is not None
    got = [back.forward, back.right, back.climb_mps, back.turn_rad_s]
    assert got == pytest.approx([forward, right, climb, turn], abs=1e-6)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_set_points_that_are_no_numbers_are_none(value: float) -> None:
    twist = ros.velocity_message(Wanted(value, 0.0, 0.0, 0.0), 1.0)
    assert ros.wanted_velocity(twist) is None
    target = message("mavros_msgs/msg/AttitudeTarget", thrust=value)
    target.orientation.w = 1.0
    assert ros.wanted_attitude(target, 1.0) is None


def test_the_cues_pose_is_the_cameras_in_the_cue_and_left_of_it_is_plus() -> None:
    sent = sights.cue_pose(POSE, 1.0)
    at = sent.pose.pose.position
    assert sent.header.frame_id == "cue"
    assert [at.x, at.y, at.z] == [-3.0, -0.5, 0.2]
    assert sent.pose.pose.orientation.z == pytest.approx(-math.sin(0.05))  # to the right
    covariance = sent.pose.covariance.reshape(6, 6)
    assert np.diag(covariance) == pytest.approx([0.0404, 0.0104, 0.0204, 0.0004, 0.0004, 0.0031])


def test_correlations_change_their_sign_with_the_axes() -> None:
    full = np.array([[4.0, 1.0, 2.0, 0.5], [1.0, 4.0, 1.5, 0.6], [2.0, 1.5, 4.0, 0.7], [0.5, 0.6, 0.7, 1.0]])
    sent = sights.cue_pose(BarPose(POSE.position_in_bar_m, 0.1, full, 0.2, np.zeros((8, 2))), 1.0)
    covariance = sent.pose.covariance.reshape(6, 6)
    assert covariance[0, 1] == -1.0  # forward with left
    assert covariance[1, 2] == 1.5  # left with up
    assert covariance[0, 5] == -0.5  # forward with counterclockwise
    assert (covariance == covariance.T).all()


def test_tf_places_the_cue_where_the_camera_sees_it() -> None:
    gimbal = GimbalAttitude(0.02, -0.3)
    cue = sights.optical_from_cue(POSE, gimbal)
    in_cue_m = np.array([0.2, -0.6, 0.1])  # forward, left, up
    bar_from_camera = Pose(
        rotation_from_euler(0.0, 0.0, POSE.yaw_rad) @ level_from_camera(gimbal), POSE.position_in_bar_m
    )
    assert bar_from_camera.apply(cue.apply(in_cue_m)) == pytest.approx(np.array([0.2, 0.6, -0.1]))


def test_what_is_not_known_of_a_pose_is_sent_as_a_huge_variance() -> None:
    sent = sights.cue_pose(BarPose(POSE.position_in_bar_m, 0.1, np.full((4, 4), math.nan), 0.2, np.zeros((8, 2))), 1.0)
    covariance = sent.pose.covariance.reshape(6, 6)
    assert (np.diag(covariance)[[0, 1, 2, 5]] > 1e5).all()
    assert np.isfinite(covariance).all()


def test_boxes_carry_their_names() -> None:
    box = Box((640.0, 360.0), (40.0, 20.0), 0.9)
    seen = Observation(1.0, GimbalAttitude(0.0, 0.0), ship_box=box)
    sent = message_of(cdr_of(sights.detections(seen, 1.0, "camera")), "vision_msgs/msg/Detection2DArray")
    (found,) = sent.detections
    assert found.results[0].hypothesis.class_id == "ship"
    assert [found.bbox.center.position.x, found.bbox.size_x, found.bbox.size_y] == [640.0, 40.0, 20.0]
    assert not sights.detections(Observation(1.0, GimbalAttitude(0.0, 0.0)), 1.0, "camera").detections


PICTURE = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)


@pytest.mark.parametrize(
    ("encoding", "channels", "order"),
    [("bgr8", 3, [0, 1, 2]), ("rgb8", 3, [2, 1, 0]), ("mono8", 1, None), ("bgra8", 4, [0, 1, 2])],
)
def test_pictures_of_any_common_encoding_and_step(encoding, channels, order) -> None:
    raw = np.arange(2 * (4 * channels + 5), dtype=np.uint8).reshape(2, -1)  # five bytes of padding a row
    picture = message(
        "sensor_msgs/msg/Image", height=2, width=4, encoding=encoding, step=raw.shape[1], data=raw.ravel()
    )
    pixels = raw[:, : 4 * channels].reshape(2, 4, channels)
    wanted = pixels.repeat(3, axis=2) if order is None else pixels[:, :, order]
    assert (images.image_of(picture) == wanted).all()


def test_pictures_that_cannot_be_read_say_why() -> None:
    whole = images.image_message(PICTURE, 1.0, "camera")
    assert (images.image_of(whole) == PICTURE).all()
    with pytest.raises(DataError, match="expected one of bgr8"):
        images.image_of(message("sensor_msgs/msg/Image", encoding="16UC1"))
    whole.data = whole.data[:-1]
    with pytest.raises(DataError, match="23 bytes"):
        images.image_of(whole)
    with pytest.raises(DataError, match="cannot be decoded"):
        images.image_of(message("sensor_msgs/msg/CompressedImage", format="jpeg", data=np.ones(9, np.uint8)))
    with pytest.raises(DataError, match="cannot be decoded"):
        images.image_of(message("sensor_msgs/msg/CompressedImage", format="jpeg"))
    with pytest.raises(DataError, match="0 × 0 px"):
        images.image_of(message("sensor_msgs/msg/Image", encoding="rgb8"))


@pytest.mark.parametrize("distortion", [np.zeros(5), np.array([-0.1, 0.02, 1e-3, 0.0]), np.arange(8) * 1e-3])
def test_intrinsics_come_back(distortion: np.ndarray) -> None:
    camera = Camera(640, 360, np.array([[500.0, 0.0, 320.0], [0.0, 501.0, 180.0], [0.0, 0.0, 1.0]]), distortion)
    sent = message_of(cdr_of(images.camera_info(camera, 1.0, "camera")), "sensor_msgs/msg/CameraInfo")
    back = images.camera_of(sent)
    rays = np.array([[100.0, 50.0], [600.0, 300.0]])
    assert back.back_project(rays) == pytest.approx(camera.back_project(rays), abs=1e-9)


@pytest.mark.parametrize("topic", ["cam/image_rect", "cam/image_rect_color/compressed"])
def test_rectified_pictures_are_not_undistorted_again(topic: str) -> None:
    camera = Camera(640, 360, np.array([[500.0, 0.0, 320.0], [0.0, 501.0, 180.0], [0.0, 0.0, 1.0]]), np.full(5, 0.1))
    info = images.camera_info(camera, 1.0, "camera")
    info.p = np.array([480.0, 0.0, 310.0, 0.0, 0.0, 481.0, 170.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    info.distortion_model = "equidistant"
    rectified = images.camera_of(info, topic)
    assert not rectified.distortion.any()
    assert rectified.matrix[0].tolist() == [480.0, 0.0, 310.0]


def test_intrinsics_that_are_none_say_so() -> None:
    with pytest.raises(DataError, match="K is zero"):
        images.camera_of(message("sensor_msgs/msg/CameraInfo", width=640, height=360))
    with pytest.raises(DataError, match="equidistant"):
        images.camera_of(message("sensor_msgs/msg/CameraInfo", distortion_model="equidistant"))


@given(st.floats(0.0, 2e9))
def test_times_come_back_to_a_microsecond(t_s: float) -> None:
    stamped = ros.stamp(t_s)
    assert 0 <= stamped.nanosec < 1_000_000_000
    assert ros.seconds(stamped) == pytest.approx(t_s, abs=1e-6)


def test_hashes_are_ros_2s_own() -> None:
    """As rclpy of ROS 2 Kilted gives them (`get_publishers_info_by_topic`)."""
    known = "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e"
    assert type_hash("geometry_msgs/msg/PoseWithCovarianceStamped") == known


def test_an_unknown_field_is_named() -> None:
    with pytest.raises(TypeError, match="no field datum; there are: data"):
        message("std_msgs/msg/String", datum="x")


def test_every_message_has_a_zero_that_goes_over_the_wire() -> None:
    own = [kind for kind in store().fielddefs if kind.startswith(("vision_msgs/", "mavros_msgs/"))]
    for kind in [*own, "nav_msgs/msg/Odometry", "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"]:
        assert cdr_of(message_of(cdr_of(message(kind)), kind)) == cdr_of(message(kind))


def test_topics_lie_below_the_vehicle_unless_they_are_renamed() -> None:
    topics = vehicle_topics("drone", {"image": "/camera/image_raw"})
    assert topics["image"] == "camera/image_raw"
    assert topics["odom"] == "drone/odom"


@pytest.mark.parametrize(
    ("namespace", "renamed"), [("my-drone", {}), ("my drone", {}), ("a//b", {}), ("1st", {}), ("drone", {"odom": ""})]
)
def test_a_topic_that_ros_2_could_not_have_is_said(namespace: str, renamed: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match="is no ROS 2 topic"):
        vehicle_topics(namespace, renamed)
    assert vehicle_topics("/fleet/drone_1/", {})["state"] == "fleet/drone_1/state"


def test_the_domain_is_ros_2s_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert domain_id(None) == 7
    assert domain_id(3.0) == 3
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    assert domain_id(None) == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", "seven")
    with pytest.raises(ConfigError, match="0 to 232"):
        domain_id(None)


def test_what_cyclone_is_told_by_its_own_variable_goes_over_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<Tracing/>")
    assert settings(local=True).endswith(",<Tracing/>")
    assert 'name="lo"' in settings(local=True)
    assert 'name="lo"' not in settings(local=False)
