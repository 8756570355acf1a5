"""The geometric camera's pose is the solver's: the same errors, and a covariance that says how large they are."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shipland.camera import Camera, camera_pose, level_from_camera
from shipland.frames import CAMERA_FROM_MOUNT, Pose
from shipland.geometric import (
    CornerMeasurement,
    GeometricParameters,
    GeometricVision,
    _down_in_camera,
    inside,
    pose_from_truth,
    projected,
    relative_pose,
)
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.vision.near.covariance import bar_pose_of
from shipland.vision.near.gates import Refusal
from shipland.vision.near.planar_pose import Corners, LevelPrior, Solution, solve
from shipland.vision.parameters import VisionParameters

CAMERA = Camera.from_fov(1280, 720, 69.0)
RIG, VISION = Rig(), VisionParameters()
PLANE_M = np.ascontiguousarray(RIG.cue.points_in_bar_m[:, 1:])
PITCH_RAD, LEVEL_RAD = 0.03, 1e-3


def true_pose(range_m, bearing_deg, yaw_deg, gimbal):
    """The camera against the bar, and the same as the truth has it."""
    bearing_rad = math.radians(bearing_deg)
    place_m = np.array([-range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad), -0.3])
    body = Pose.from_euler(place_m, 0.0, 0.0, math.radians(yaw_deg))
    return camera_pose(body, math.radians(yaw_deg), gimbal, np.zeros(3))


def test_relative_pose_and_projection_are_the_frame_tables(rng):
    seen = true_pose(6.0, 12.0, -15.0, GimbalAttitude(0.01, 0.05))
    bar = Pose.from_euler(rng.normal(size=3), 0.0, 0.0, 0.4)
    camera = bar @ seen
    rotation, sight_m = relative_pose(camera.rotation, camera.translation_m, bar.rotation, bar.translation_m)
    camera_from_bar = seen.inverse()
    np.testing.assert_allclose(rotation, camera_from_bar.rotation @ CAMERA_FROM_MOUNT.T, atol=1e-12)
    np.testing.assert_allclose(sight_m, camera_from_bar.translation_m, atol=1e-12)
    pixels = projected(rotation, sight_m, PLANE_M, CAMERA.matrix)
    np.testing.assert_allclose(pixels, CAMERA.project(camera_from_bar.apply(RIG.cue.points_in_bar_m)), atol=1e-9)
    behind = projected(rotation, -sight_m, PLANE_M, CAMERA.matrix)
    assert np.isnan(behind).all()


class _Still:
    """A world that does not move, the camera where it is put."""

    def __init__(self, bar_from_camera):
        self._camera = bar_from_camera

    def truth_at(self, _):
        return SimpleNamespace(ned_from_camera=self._camera, ned_from_bar=Pose.from_euler(np.zeros(3), 0.0, 0.0, 0.0))


def eyes_on(world, **changes):
    parameters = replace(GeometricParameters(), **changes)
    return GeometricVision(world, RIG.cue, CAMERA, parameters, VISION, np.random.default_rng(1))


@pytest.mark.parametrize(("off_deg", "seen"), [(0.0, True), (45.0, True), (55.0, False), (80.0, False), (180.0, False)])
def test_the_cue_is_seen_as_obliquely_as_near_vision_sees_it_and_never_from_behind(off_deg, seen):
    off_rad, gimbal = math.radians(off_deg), GimbalAttitude(0.0, 0.0)
    place_m = np.array([-6.0 * math.cos(off_rad), 6.0 * math.sin(off_rad), 0.0])
    facing = Pose.from_euler(place_m, 0.0, 0.0, -off_rad)
    world = _Still(camera_pose(facing, -off_rad, gimbal, np.zeros(3)))
    observation = eyes_on(world).see(Frame(0.0, np.zeros((1, 1, 3), np.uint8), gimbal))
    assert (observation.bar_pose is not None) == seen
    assert seen or observation.reason == Refusal.OUT_OF_REACH.value


@pytest.mark.parametrize("range_m", [2.5, 4.0, 8.0, 12.0, 18.0])
@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(1, 0), (3, 0), (10, 0), (25, 0), (0, 3), (0, 10)])
def test_a_wrong_gimbal_reading_moves_the_pose_as_it_moves_the_solvers(range_m, pitch_deg, roll_deg):
    """The very same corners: both take the reading in, or both see that it contradicts the corners."""
    parameters = GeometricParameters()
    seen = true_pose(range_m, 10.0, -8.0, GimbalAttitude(0.0, PITCH_RAD))
    reading = GimbalAttitude(math.radians(roll_deg), PITCH_RAD + math.radians(pitch_deg))
    observation = eyes_on(_Still(seen)).see(Frame(0.0, None, reading))
    pose = observation.bar_pose
    if pose is None:
        assert observation.reason.startswith((Refusal.GIMBAL_OFF.value, Refusal.REPROJECTION.value))
        assert max(pitch_deg, roll_deg) > 2
        return
    sigma_px = parameters.corner_noise_px + parameters.corner_noise_px_per_m * range_m
    corners_px = pose.corners_px.reshape(-1, 4, 2)
    corners = Corners(corners_px, np.tile(np.eye(8) / sigma_px, (2, 1, 1)), PLANE_M.reshape(-1, 4, 2))
    solved = bar_pose_of(
        solve(corners, CAMERA, LevelPrior(_down_in_camera(reading), VISION.gimbal_noise_rad)), corners_px
    )
    # Of errors of metres; where both iterate, each stops near the minimum.
    np.testing.assert_allclose(pose.position_in_bar_m, solved.position_in_bar_m, atol=0.02)
    assert pose.yaw_rad == pytest.approx(solved.yaw_rad, abs=0.003)
    if range_m == 8.0 and pitch_deg == 3:
        height_m = pose.position_in_bar_m[2] - seen.translation_m[2]
        assert height_m == pytest.approx(8.0 * math.radians(3.0), abs=0.05)  # taken in
    assert range_m > 4.0 or max(pitch_deg, roll_deg) < 3  # near, what is wrong is seen


def test_a_pose_that_leaps_in_height_is_refused_as_near_vision_refuses_it():
    gimbal = GimbalAttitude(0.0, 0.0)
    world = _Still(true_pose(6.0, 0.0, 0.0, gimbal))
    eyes = eyes_on(world)
    assert eyes.see(Frame(0.0, None, gimbal)).bar_pose is not None
    world._camera = true_pose(6.0, 0.0, 0.0, gimbal)
    world._camera.translation_m[2] -= 1.0
    assert eyes.see(Frame(0.03, None, gimbal)).reason == Refusal.JUMP.value
    assert eyes.see(Frame(2.0, None, gimbal)).bar_pose is not None  # long enough ago


@pytest.mark.parametrize(
    ("range_m", "off_deg", "reason"),
    [
        (4.0, 10.0, "gimbal"),
        (4.0, -3.0, "gimbal"),
        (9.0, 10.0, "gimbal"),
        (4.0, 50.0, Refusal.REPROJECTION.value),  # another cue, it may be
        (4.0, 0.05, ""),
        (12.0, 0.05, ""),
    ],
)
def test_a_gimbal_that_contradicts_the_corners_is_refused_as_near_vision_refuses_it(range_m, off_deg, reason):
    gimbal = GimbalAttitude(0.0, PITCH_RAD)
    world = _Still(true_pose(range_m, 0.0, 0.0, gimbal))
    eyes = eyes_on(world, miss_rate=0.0)
    told = GimbalAttitude(0.0, PITCH_RAD + math.radians(off_deg))
    seen = [eyes.see(Frame(0.0, None, told)) for _ in range(50)]
    assert {it.bar_pose is None for it in seen} == {reason != ""}
    off = [it.reason.rpartition(" ")[2] for it in seen]
    if reason == "gimbal":
        assert all(it.reason.startswith(Refusal.GIMBAL_OFF.value) for it in seen)
        assert max(abs(float(it.rstrip("°")) - abs(off_deg)) for it in off) <= 3.0  # what corners at 9 m tell
    else:
        assert {it.reason for it in seen} == {reason}


def test_the_vertical_is_the_gimbals():
    gimbal = GimbalAttitude(0.1, -0.2)
    np.testing.assert_allclose(_down_in_camera(gimbal), level_from_camera(gimbal).T[:, 2], atol=1e-15)


@pytest.mark.parametrize(("bearing_deg", "yaw_deg"), [(0.0, 0.0), (25.0, -20.0)])
@pytest.mark.parametrize(
    ("range_m", "level_rad"),
    [(2.5, LEVEL_RAD), (6.0, LEVEL_RAD), (12.0, LEVEL_RAD), (20.0, LEVEL_RAD), (2.5, 0.0)],
)
def test_errors_and_covariance_are_the_solvers(range_m, bearing_deg, yaw_deg, level_rad, rng):
    """The same 400 noises for both. Without a level prior only from near by: farther, the second solution comes in."""
    sigma_px = 0.005 + 0.0008 * range_m
    errors, normalised = {"solved": [], "drawn": []}, {"solved": [], "drawn": []}
    misfit = {"solved": [], "drawn": []}
    for _ in range(400):
        gimbal = GimbalAttitude(*(np.array([0.0, PITCH_RAD]) + level_rad * rng.normal(size=2)))
        seen = true_pose(range_m, bearing_deg, yaw_deg, gimbal)
        identity = Pose.identity()
        arrays = (seen.rotation, seen.translation_m, identity.rotation, identity.translation_m)
        rotation, sight_m = relative_pose(*arrays)
        noise = rng.normal(size=PLANE_M.shape)
        corners_px = (projected(rotation, sight_m, PLANE_M, CAMERA.matrix) + sigma_px * noise).reshape(-1, 4, 2)
        down = _down_in_camera(GimbalAttitude(0.0, PITCH_RAD))
        measured = CornerMeasurement(PLANE_M, CAMERA.matrix, corners_px.reshape(-1, 2), sigma_px, down, level_rad)
        settled, turn, shift_m, chi2, covariance, residual_px = pose_from_truth(rotation, sight_m, measured)
        assert settled
        freedom = 16 - 6 + (2 if level_rad else 0)
        drawn = Solution(Pose(turn, shift_m), chi2, covariance, 0.0, residual_px.reshape(-1, 4, 2), freedom)
        corners = Corners(corners_px, np.tile(np.eye(8) / sigma_px, (2, 1, 1)), PLANE_M.reshape(-1, 4, 2))
        prior = LevelPrior(down, level_rad) if level_rad else None
        solved = solve(corners, CAMERA, prior, Pose(rotation, sight_m))[0]
        misfit["solved"].append(solved.chi2)
        misfit["drawn"].append(drawn.chi2)
        for name, solution in (("solved", solved), ("drawn", drawn)):
            pose = bar_pose_of([solution], corners_px)
            error = np.append(pose.position_in_bar_m - seen.translation_m, pose.yaw_rad - math.radians(yaw_deg))
            errors[name].append(error)
            normalised[name].append(error @ np.linalg.solve(pose.covariance, error))
    solved, drawn = (np.array(errors[name]) for name in ("solved", "drawn"))
    spread = solved.std(axis=0)
    # The solver stops once another step would gain less than 0.03 of χ².
    np.testing.assert_array_less(np.sqrt(np.mean((drawn - solved) ** 2, axis=0)), 0.1 * spread)
    np.testing.assert_array_less(np.abs(drawn.mean(axis=0) - solved.mean(axis=0)), 0.02 * spread)
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(solved.T), atol=0.05 * float(spread.max()) ** 2)
    assert np.mean(misfit["drawn"]) == pytest.approx(np.mean(misfit["solved"]), rel=0.05)
    # 4 degrees of freedom, 400 draws: 4 ± 4 · 0.14; the covariance is held up by `excess`, hence the
    # lower bound; straight from astern at 20 m the errors lie along an arc, hence the upper one.
    assert 3.0 < np.mean(normalised["drawn"]) < 4.9
    assert np.mean(normalised["drawn"]) == pytest.approx(np.mean(normalised["solved"]), rel=0.05)


@pytest.mark.parametrize(
    ("corner_px", "lies_inside"), [((5.0, 700.0), True), ((4.9, 50.0), False), ((math.nan,) * 2, False)]
)
def test_corners_inside_the_picture(corner_px, lies_inside):
    corners_px = np.array([[100.0, 100.0], corner_px, [1274.0, 714.0]])
    assert inside(corners_px, 5.0, np.array([1274.0, 714.0])) is lies_inside
    assert not inside(corners_px, 5.0, np.array([1273.0, 714.0]))
