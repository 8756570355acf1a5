"""Rotations and poses: round trips, group laws, and one pose worked out by hand for each frame of the table."""

import math
import re

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from shipland import frames
from shipland.camera import camera_pose, level_from_camera
from shipland.frames import (
    CAMERA_FROM_MOUNT,
    ENU_FROM_NED,
    FLU_FROM_FRD,
    MUJOCO_FROM_NED,
    Pose,
    all_finite,
    euler_from_quaternion,
    euler_from_rotation,
    quaternion_from_euler,
    quaternion_from_rotation,
    rotation_from_euler,
    rotation_from_quaternion,
    rows_from_euler,
    rows_from_quaternion,
    wrap_angle,
)
from shipland.messages import GimbalAttitude

EXACT_RAD = 1e-9
"""Rounding of a dozen float64 products; six orders below anything a gimbal can tell."""
EXACT_M = 1e-9
"""The same, at kilometres: a micrometre would already be a wrong formula, not rounding."""

angles = st.floats(-np.pi, np.pi)
pitches = st.floats(-0.5 * np.pi + 1e-4, 0.5 * np.pi - 1e-4)
metres = st.floats(-1000.0, 1000.0)
rotations = st.builds(rotation_from_euler, angles, angles, angles)
poses = st.builds(Pose.from_euler, st.tuples(metres, metres, metres), angles, angles, angles)
DEGREES_90 = 0.5 * np.pi


def assert_same_pose(one: Pose, other: Pose) -> None:
    np.testing.assert_allclose(one.rotation, other.rotation, atol=EXACT_RAD)
    np.testing.assert_allclose(one.translation_m, other.translation_m, atol=EXACT_M)


class TestRotations:
    @given(angles, angles, angles)
    def test_is_a_rotation(self, roll_rad, pitch_rad, yaw_rad):
        rotation = rotation_from_euler(roll_rad, pitch_rad, yaw_rad)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)

    @given(angles, pitches, angles)
    def test_euler_round_trip(self, roll_rad, pitch_rad, yaw_rad):
        got = euler_from_rotation(rotation_from_euler(roll_rad, pitch_rad, yaw_rad))
        for angle_rad, want_rad in zip(got, (roll_rad, pitch_rad, yaw_rad), strict=True):
            assert abs(wrap_angle(angle_rad - want_rad)) < EXACT_RAD

    @given(angles, st.sampled_from([-DEGREES_90, DEGREES_90]), angles)
    def test_straight_up_and_down_the_rotation_survives_with_roll_zero(self, roll_rad, pitch_rad, yaw_rad):
        rotation = rotation_from_euler(roll_rad, pitch_rad, yaw_rad)
        got = euler_from_rotation(rotation)
        assert got[0] == 0.0
        np.testing.assert_allclose(rotation_from_euler(*got), rotation, atol=EXACT_RAD)

    @given(angles, angles, angles)
    def test_is_yaw_then_pitch_then_roll_about_moving_axes(self, roll_rad, pitch_rad, yaw_rad):
        yawed = rotation_from_euler(0.0, 0.0, yaw_rad)
        pitched = rotation_from_euler(0.0, pitch_rad, 0.0)
        rolled = rotation_from_euler(roll_rad, 0.0, 0.0)
        np.testing.assert_allclose(
            rotation_from_euler(roll_rad, pitch_rad, yaw_rad), yawed @ pitched @ rolled, atol=EXACT_RAD
        )

    @given(st.floats(-50.0, 50.0))
    def test_wrapped_angle_is_the_same_angle_between_minus_pi_and_pi(self, angle_rad):
        wrapped_rad = wrap_angle(angle_rad)
        assert -np.pi <= wrapped_rad < np.pi
        assert np.cos(wrapped_rad) == pytest.approx(np.cos(angle_rad), abs=EXACT_RAD)
        assert np.sin(wrapped_rad) == pytest.approx(np.sin(angle_rad), abs=EXACT_RAD)

    @pytest.mark.parametrize("angle_rad", [np.pi, -np.pi, np.nextafter(-np.pi, -4.0), 3 * np.pi, -3 * np.pi])
    def test_half_a_turn_wraps_to_minus_pi(self, angle_rad):
        assert wrap_angle(angle_rad) == pytest.approx(-np.pi, abs=1e-12)


class TestPoses:
    @given(poses, poses, poses)
    def test_composition_is_associative(self, a_from_b, b_from_c, c_from_d):
        assert_same_pose((a_from_b @ b_from_c) @ c_from_d, a_from_b @ (b_from_c @ c_from_d))

    @given(poses)
    def test_identity_and_inverse(self, a_from_b):
        assert_same_pose(a_from_b @ Pose.identity(), a_from_b)
        assert_same_pose(Pose.identity() @ a_from_b, a_from_b)
        assert_same_pose(a_from_b @ a_from_b.inverse(), Pose.identity())
        assert_same_pose(a_from_b.inverse() @ a_from_b, Pose.identity())

    @given(poses, poses, st.tuples(metres, metres, metres))
    def test_applying_a_composition_is_applying_one_after_the_other(self, a_from_b, b_from_c, point_in_c_m):
        point = np.array(point_in_c_m)
        np.testing.assert_allclose(
            (a_from_b @ b_from_c).apply(point), a_from_b.apply(b_from_c.apply(point)), atol=EXACT_M
        )

    @given(poses, st.tuples(metres, metres, metres))
    def test_matrix_does_what_apply_does(self, a_from_b, point_in_b_m):
        homogeneous = a_from_b.matrix() @ np.array([*point_in_b_m, 1.0])
        np.testing.assert_allclose(homogeneous[:3], a_from_b.apply(np.array(point_in_b_m)), atol=EXACT_M)
        assert homogeneous[3] == 1.0

    def test_apply_takes_one_point_or_any_stack_of_them(self):
        parent_from_child = Pose.from_euler((1.0, 2.0, 3.0), 0.1, 0.2, 0.3)
        points = np.arange(24.0).reshape(2, 4, 3)
        moved = parent_from_child.apply(points)
        assert moved.shape == (2, 4, 3)
        np.testing.assert_allclose(moved[1, 2], parent_from_child.apply(points[1, 2]), atol=EXACT_M)

    @pytest.mark.parametrize(
        ("rotation", "translation_m", "got"),
        [(np.eye(2), np.zeros(3), r"\(2, 2\)"), (np.eye(3), np.zeros((3, 1)), r"\(3, 1\)"), (np.eye(3), 0.0, r"\(\)")],
    )
    def test_wrong_shapes_are_refused_with_what_they_are(self, rotation, translation_m, got):
        with pytest.raises(ValueError, match=rf"wants rotation \(3, 3\) and translation \(3,\).*{got}"):
            Pose(rotation, translation_m)


class TestByHand:
    """One pose for each frame of the table, worked out on paper."""

    def test_every_frame_of_the_table_has_a_pose_here(self):
        in_table = set(re.findall(r"^\| `(\w+)`", frames.__doc__ or "", flags=re.MULTILINE))
        here = {name.removeprefix("test_frame_") for name in dir(self) if name.startswith("test_frame_")}
        assert in_table == here

    def test_frame_ned(self):
        # A ship that heads east, 100 m north of the origin; 10 m off its starboard side lies 10 m to the south of it.
        ned_from_ship = Pose.from_euler((100.0, 0.0, 0.0), 0.0, 0.0, DEGREES_90)
        np.testing.assert_allclose(ned_from_ship.apply(np.array([0.0, 10.0, 0.0])), [90.0, 0.0, 0.0], atol=EXACT_M)

    def test_frame_ship(self, rig):
        # The ship heads south; its origin is deck_height above the sea plane, so its ned z is -0.90. The stern is
        # 0.71 m behind the deck's centre: to the north of it.
        ned_from_ship = Pose.from_euler((0.0, 0.0, -rig.deck_height_m), 0.0, 0.0, np.pi)
        stern_in_ship_m = np.array([-rig.deck_ahead_of_stern_m, 0.0, 0.0])
        np.testing.assert_allclose(ned_from_ship.apply(stern_in_ship_m), [0.71, 0.0, -0.90], atol=EXACT_M)

    def test_frame_deck(self):
        # Rolled 90° to starboard about `ship` forward and heaved 0.5 m down: the starboard edge, 0.61 m out, hangs
        # straight below, so 0.5 + 0.61 = 1.11 m down; 1 m above the surface is 1 m to starboard.
        ship_from_deck = Pose.from_euler((0.0, 0.0, 0.5), DEGREES_90, 0.0, 0.0)
        np.testing.assert_allclose(ship_from_deck.apply(np.array([0.0, 0.61, 0.0])), [0.0, 0.0, 1.11], atol=EXACT_M)
        np.testing.assert_allclose(ship_from_deck.apply(np.array([0.0, 0.0, -1.0])), [0.0, 1.0, 0.5], atol=EXACT_M)

    def test_frame_bar(self, rig):
        # 2.80 - 0.71 = 2.09 m ahead of the deck's centre and 1.65 - 0.90 = 0.75 m above it (down is positive).
        np.testing.assert_allclose(
            rig.ship_from_bar.apply(np.array([-12.0, 0.0, 0.0])), [2.09 - 12.0, 0.0, -0.75], atol=EXACT_M
        )

    def test_frame_body(self):
        # Nose up 30° and heading north: 1 m ahead along the nose is cos 30° north and sin 30° up.
        ned_from_body = Pose.from_euler((0.0, 0.0, -10.0), 0.0, np.radians(30.0), 0.0)
        np.testing.assert_allclose(
            ned_from_body.apply(np.array([1.0, 0.0, 0.0])), [np.sqrt(0.75), 0.0, -10.5], atol=EXACT_M
        )

    def test_frame_level(self):
        # Heading west, rolled and pitched: in `level` only the heading is left, and right of west is north.
        ned_from_body = Pose.from_euler((5.0, 5.0, -2.0), 0.3, 0.2, -DEGREES_90)
        _, _, heading_rad = euler_from_rotation(ned_from_body.rotation)
        ned_from_level = Pose.from_euler(ned_from_body.translation_m, 0.0, 0.0, heading_rad)
        np.testing.assert_allclose(ned_from_level.apply(np.array([0.0, 2.0, 0.0])), [7.0, 5.0, -2.0], atol=EXACT_M)

    def test_frame_mount(self):
        # The gimbal looks 90° up: what lies 1 m along the optical axis is 1 m above the camera.
        level_from_mount = rotation_from_euler(0.0, DEGREES_90, 0.0)
        np.testing.assert_allclose(level_from_mount @ [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], atol=EXACT_RAD)

    def test_frame_camera(self):
        # OpenCV's axes: forward 3, right 1, down 2 of the mount are z 3, x 1, y 2 of the camera.
        np.testing.assert_array_equal(CAMERA_FROM_MOUNT @ [3.0, 1.0, 2.0], [1.0, 2.0, 3.0])
        # Heading east with a level gimbal, the camera 0.1 m ahead of the body: z is east, x is south, y is down.
        ned_from_body = Pose.from_euler((0.0, 0.0, -4.0), 0.0, 0.0, DEGREES_90)
        ned_from_camera = camera_pose(ned_from_body, DEGREES_90, GimbalAttitude(0.0, 0.0), np.array([0.1, 0.0, 0.0]))
        np.testing.assert_allclose(
            ned_from_camera.apply(np.array([1.0, 2.0, 5.0])), [-1.0, 5.1, -4.0 + 2.0], atol=EXACT_M
        )

    def test_frame_mujoco(self):
        # 1 m north, 2 m east, 3 m down is 1 m north, 2 m short of west, 3 m below; and the way back is the same.
        np.testing.assert_array_equal(MUJOCO_FROM_NED @ [1.0, 2.0, 3.0], [1.0, -2.0, -3.0])
        np.testing.assert_array_equal(MUJOCO_FROM_NED @ MUJOCO_FROM_NED, np.eye(3))

    def test_frame_enu(self):
        # 1 m north, 2 m east, 3 m down is 2 m east, 1 m north, 3 m below; and the way back is the same.
        np.testing.assert_array_equal(ENU_FROM_NED @ [1.0, 2.0, 3.0], [2.0, 1.0, -3.0])
        np.testing.assert_array_equal(ENU_FROM_NED @ ENU_FROM_NED, np.eye(3))

    def test_forward_right_down_is_forward_minus_left_minus_up(self):
        np.testing.assert_array_equal(FLU_FROM_FRD @ [1.0, 2.0, 3.0], [1.0, -2.0, -3.0])

    @given(rotations)
    def test_a_rotations_quaternion_is_that_rotation(self, rotation):
        back = rotation_from_quaternion(np.array(quaternion_from_rotation(rotation)))
        np.testing.assert_allclose(back, rotation, atol=1e-8)

    @pytest.mark.parametrize("constant", [CAMERA_FROM_MOUNT, MUJOCO_FROM_NED, ENU_FROM_NED, FLU_FROM_FRD])
    def test_constants_are_right_handed_and_cannot_be_written(self, constant):
        assert np.linalg.det(constant) == pytest.approx(1.0, abs=EXACT_RAD)
        with pytest.raises(ValueError, match="read-only"):
            constant[0, 0] = 5.0

    def test_a_tilted_body_carries_the_camera_but_does_not_turn_it(self):
        # The gimbal takes the body's roll and pitch out: only the optical centre moves.
        gimbal = GimbalAttitude(0.0, -0.2)
        camera_in_body_m = np.array([0.09, 0.0, 0.0])
        still = camera_pose(Pose.from_euler((0, 0, -3), 0.0, 0.0, 1.0), 1.0, gimbal, camera_in_body_m)
        tilted = camera_pose(Pose.from_euler((0, 0, -3), 0.3, 0.4, 1.0), 1.0, gimbal, camera_in_body_m)
        np.testing.assert_allclose(tilted.rotation, still.rotation, atol=EXACT_RAD)
        np.testing.assert_allclose(
            still.rotation, rotation_from_euler(0.0, 0.0, 1.0) @ level_from_camera(gimbal), atol=EXACT_RAD
        )
        assert tilted.translation_m[2] == pytest.approx(-3.0 - 0.09 * np.sin(0.4), abs=EXACT_M)


class TestPlainFloats:
    """The conversions in plain floats and by quaternions are those of the rotation."""

    @given(angles, pitches, angles, st.floats(0.1, 10.0))
    def test_quaternion_rows_and_angles_are_the_same_turn(self, roll_rad, pitch_rad, yaw_rad, length):
        rotation = rotation_from_euler(roll_rad, pitch_rad, yaw_rad)
        quaternion = quaternion_from_euler(roll_rad, pitch_rad, yaw_rad)
        np.testing.assert_allclose(rotation_from_quaternion(length * np.array(quaternion)), rotation, atol=EXACT_RAD)
        np.testing.assert_allclose(rows_from_euler(roll_rad, pitch_rad, yaw_rad), rotation.ravel(), atol=1e-12)
        np.testing.assert_allclose(rows_from_quaternion(*quaternion), rotation.ravel(), atol=1e-12)
        for got_rad, want_rad in zip(euler_from_quaternion(quaternion), (roll_rad, pitch_rad, yaw_rad), strict=True):
            assert abs(wrap_angle(got_rad - want_rad)) < 1e-5  # near ±90° the arcsine has half the digits

    def test_quaternion_by_hand(self):
        # Half of a quarter turn to the right, about down: w and z are cos 45°.
        half = np.sqrt(0.5)
        np.testing.assert_allclose(quaternion_from_euler(0.0, 0.0, DEGREES_90), [half, 0.0, 0.0, half], atol=1e-15)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_finite_is_every_number(wrong):
    values = np.arange(6.0).reshape(2, 3)
    assert all_finite(values)
    values[1, 2] = wrong
    assert not all_finite(values)
