"""Pose from corners: round trips, both planar solutions, errors against the Cramér–Rao bound, the gimbal's share."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pictures import camera_from_bar, project_plane, rectangles
from shipland.camera import Camera, level_from_camera
from shipland.frames import CAMERA_FROM_MOUNT, Pose, rotation_from_euler
from shipland.messages import GimbalAttitude
from shipland.rig import Rig
from shipland.vision.near.covariance import bar_pose_of, covariance_in_bar, covariance_over_tilts, position_and_yaw
from shipland.vision.near.planar_pose import Corners, LevelPrior, bound, ordered, solve

CAMERA = Camera.from_fov(1280, 720, 69.0)
BAR = Rig().cue
PLANE = BAR.plane_m


def corners_at(pose, target=BAR, noise_px=0.05, error_px=0.0, camera=CAMERA):
    plane = target.plane_m
    pixels = project_plane(plane.reshape(-1, 2), camera, pose).reshape(-1, 4, 2)
    return Corners(pixels + error_px, np.tile(np.eye(8) / noise_px, (len(plane), 1, 1)), plane)


def from_plane(camera_from_bar_pose):
    """camera_from_plane of camera_from_bar."""
    return camera_from_bar_pose @ Pose(CAMERA_FROM_MOUNT.T, np.zeros(3))


def prior_at(pitch_rad, noise_rad=0.001, roll_rad=0.0):
    return LevelPrior(level_from_camera(GimbalAttitude(roll_rad, pitch_rad))[2], noise_rad)


@given(
    range_m=st.floats(1.5, 20.0),
    azimuth_deg=st.floats(-40.0, 40.0),
    down=st.floats(-0.3, 0.3),
    yaw_off_deg=st.floats(-10.0, 10.0),
    pitch_deg=st.floats(-20.0, 20.0),
    roll_deg=st.floats(-15.0, 15.0),
)
def test_round_trip(range_m, azimuth_deg, down, yaw_off_deg, pitch_deg, roll_deg):
    azimuth = np.radians(azimuth_deg)
    place = range_m * np.array([-np.cos(azimuth), -np.sin(azimuth), down])
    yaw = azimuth + np.radians(yaw_off_deg)
    pose = camera_from_bar(place, yaw, np.radians(pitch_deg), np.radians(roll_deg))
    position_in_bar_m, yaw_rad = position_and_yaw(solve(corners_at(pose), CAMERA)[0].camera_from_plane)
    # Exact pixels: what is left is where the refinement stops, within 0.2 standard deviations of 0.05 px corners.
    spread = np.sqrt(np.diag(covariance_in_bar(bound(from_plane(pose), corners_at(pose), CAMERA))))
    assert np.all(np.abs(np.append(position_in_bar_m - place, yaw_rad - yaw)) < 0.2 * spread + 1e-6)


def test_one_pose_by_hand():
    # 10 m astern of the bar's centre, 1 m to its right and 0.5 m below, looking along the bar's forward axis.
    focal, (u0, v0) = CAMERA.focal_px, CAMERA.matrix[:2, 2]
    pixels = np.array(
        [[[u0 + focal * (x - 1.0) / 10.0, v0 + focal * (y - 0.5) / 10.0] for x, y in quad] for quad in PLANE]
    )
    solution = solve(Corners(pixels, np.tile(np.eye(8), (2, 1, 1)), PLANE), CAMERA)[0]
    position_in_bar_m, yaw_rad = position_and_yaw(solution.camera_from_plane)
    np.testing.assert_allclose(position_in_bar_m, [-10.0, 1.0, 0.5], atol=1e-6)
    assert abs(yaw_rad) < 1e-7


def test_yaw_is_the_heading_of_the_camera_clockwise():
    for roll, pitch in ((0.0, 0.0), (0.1, -0.3), (-0.2, 0.33)):
        rotation = rotation_from_euler(roll, pitch, 0.2) @ CAMERA_FROM_MOUNT.T
        camera_from_plane = from_plane(Pose(rotation, np.array([-5.0, 0.0, 0.0])).inverse())
        assert position_and_yaw(camera_from_plane)[1] == pytest.approx(0.2, abs=1e-12)


def test_both_planar_solutions_are_kept_and_continuity_chooses():
    # 14° to either side look nearly the same to corners known to a pixel only.
    truth, mirror = (camera_from_bar([-12.0 * np.cos(a), -12.0 * np.sin(a), 0.0], a) for a in (0.25, -0.25))
    solutions = solve(corners_at(truth, noise_px=1.0), CAMERA, prior_at(0.0))
    assert len(solutions) == 2
    yaws = [position_and_yaw(solution.camera_from_plane)[1] for solution in solutions]
    assert yaws[0] == pytest.approx(0.25, abs=0.01)
    assert yaws[1] < -0.03
    assert solutions[0].chi2 <= solutions[1].chi2
    chosen = ordered(solutions, from_plane(mirror))
    assert position_and_yaw(chosen[0].camera_from_plane)[1] == yaws[1]
    # Who cannot tell the two apart says so: the other one lies within three standard deviations.
    spread = bar_pose_of(chosen, np.zeros((2, 4, 2))).covariance[3, 3]
    assert abs(yaws[0] - yaws[1]) < 3.0 * np.sqrt(spread)


def test_where_the_fit_is_clear_continuity_is_not_asked():
    truth, mirror = (camera_from_bar([-4.0 * np.cos(a), -4.0 * np.sin(a), 0.0], a) for a in (0.3, -0.3))
    solutions = ordered(solve(corners_at(truth), CAMERA), from_plane(mirror))
    assert position_and_yaw(solutions[0].camera_from_plane)[1] == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize(
    ("range_m", "azimuth"), [(2.0, 0.0), (5.0, 0.3), (10.0, 0.3), (15.0, 0.3)], ids=["2 m", "5 m", "10 m", "15 m"]
)
@pytest.mark.parametrize("with_gimbal", [False, True])
def test_errors_reach_the_cramer_rao_bound_and_covariance_is_true(range_m, azimuth, with_gimbal):
    rng = np.random.default_rng(17)
    noise_px, gimbal_noise = 0.05, 0.001
    place = np.array([-range_m * np.cos(azimuth), -range_m * np.sin(azimuth), 0.1 * range_m])
    pose = camera_from_bar(place, azimuth, 0.1)
    least = covariance_in_bar(
        bound(from_plane(pose), corners_at(pose), CAMERA, prior_at(0.1, gimbal_noise) if with_gimbal else None)
    )
    errors, nees = [], []
    for _ in range(150):
        prior = None
        if with_gimbal:
            prior = prior_at(0.1 + rng.normal(0.0, gimbal_noise), gimbal_noise, rng.normal(0.0, gimbal_noise))
        corners = corners_at(pose, noise_px=noise_px, error_px=rng.normal(0.0, noise_px, (2, 4, 2)))
        found = bar_pose_of(solve(corners, CAMERA, prior), corners.undistorted_px)
        error = np.append(found.position_in_bar_m - place, found.yaw_rad - azimuth)
        errors.append(error)
        nees.append(error @ np.linalg.solve(found.covariance, error))
    rms, bound_rms = np.sqrt(np.mean(np.square(errors), axis=0)), np.sqrt(np.diag(least))
    # 150 trials know a standard deviation to 6 %.
    assert np.all(rms < 1.2 * bound_rms)
    # Four degrees of freedom, known to 0.23. From afar the tilt's sensitivity hangs on the tilt itself: the linear
    # covariance is half as good with the gimbal, and no Gaussian's without.
    if with_gimbal or range_m <= 5.0:
        assert 2.9 < np.mean(nees) < (4.8 if range_m <= 10.0 else 8.0)


@pytest.mark.parametrize("azimuth", [0.02, 0.06])
def test_from_afar_the_covariance_is_true_where_the_jacobian_is_not(azimuth):
    """14 m away, nearly square on: the cosine of the angle about the bar's vertical is all that tells it."""
    place_m = 14.0 * np.array([-np.cos(azimuth), -np.sin(azimuth), 0.01])
    pose, rng, with_spread, without = camera_from_bar(place_m, azimuth), np.random.default_rng(5), [], []
    for _ in range(150):
        prior = prior_at(rng.normal(0.0, 0.001), roll_rad=rng.normal(0.0, 0.001))
        corners = corners_at(pose, noise_px=0.12, error_px=0.12 * rng.standard_normal(PLANE.shape))
        solutions = solve(corners, CAMERA, prior, from_plane(pose))
        spread = covariance_over_tilts(solutions[0], corners, CAMERA, prior)
        assert spread is not None
        for nees, covariance in ((with_spread, spread), (without, None)):
            found = bar_pose_of(solutions, corners.undistorted_px, covariance)
            error = np.append(found.position_in_bar_m - place_m, found.yaw_rad - azimuth)
            nees.append(error @ np.linalg.solve(found.covariance, error) / 4.0)
    assert 0.7 < np.mean(with_spread) < 1.3
    assert np.mean(without) > 1.5
    assert np.mean(np.array(with_spread) > 25.0 / 4.0) < 0.02


def test_near_by_the_jacobian_tells_all():
    corners = corners_at(camera_from_bar(np.array([-4.0, -0.5, 0.1]), 0.1))
    prior = prior_at(0.0)
    assert covariance_over_tilts(solve(corners, CAMERA, prior)[0], corners, CAMERA, prior) is None


def test_a_covariance_never_loses_the_angle(monkeypatch):
    """When no pose beside the solution fits, the Jacobian's covariance stays."""
    corners, prior = corners_at(camera_from_bar(np.array([-14.0, -0.5, 0.1]), 0.04), noise_px=0.12), prior_at(0.0)
    solution = solve(corners, CAMERA, prior)[0]
    assert covariance_over_tilts(solution, corners, CAMERA, prior) is not None
    monkeypatch.setattr("shipland.vision.near.covariance._carry_over_tilts", lambda *_: False)
    assert covariance_over_tilts(solution, corners, CAMERA, prior) is None


def test_gimbal_makes_the_height_known():
    pose = from_plane(camera_from_bar([-10.0, 0.0, 0.5], 0.1))
    alone, held = (
        covariance_in_bar(bound(pose, corners_at(pose @ Pose(CAMERA_FROM_MOUNT, np.zeros(3))), CAMERA, p))
        for p in (None, prior_at(0.0))
    )
    assert np.sqrt(alone[2, 2]) > 0.2  # m: the tilt of a bar 14 px high is all there is
    assert np.sqrt(held[2, 2]) < 0.02  # m


def test_a_gimbal_that_is_plainly_wrong_is_left_out_and_told():
    pose = camera_from_bar([-3.0, 0.2, 0.7], 0.05, 0.25)
    for said in (0.0, 0.25):
        solution = solve(corners_at(pose, noise_px=0.02), CAMERA, prior_at(said))[0]
        np.testing.assert_allclose(position_and_yaw(solution.camera_from_plane)[0], [-3.0, 0.2, 0.7], atol=2e-3)
        assert solution.level_off_rad == pytest.approx(0.25 - said, abs=1e-3)


def test_a_gimbal_within_its_noise_contradicts_nothing():
    rng = np.random.default_rng(5)
    for range_m in (2.5, 4.0, 9.0):
        for _ in range(50):
            corners = corners_at(
                camera_from_bar([-range_m, 0.2, 0.3], 0.05), noise_px=0.03, error_px=rng.normal(0.0, 0.03, (2, 4, 2))
            )
            prior = prior_at(rng.normal(0.0, 0.001), roll_rad=rng.normal(0.0, 0.001))
            assert solve(corners, CAMERA, prior)[0].level_off_rad == 0.0


def test_another_cue_is_not_excused_by_a_wrong_gimbal():
    # Half as high as the bar: would be the bar, tilted by 60°.
    pose = camera_from_bar([-3.0, 0.0, 0.0])
    low = rectangles((-0.375, 0.0, 0.45, 0.075), (0.375, 0.0, 0.45, 0.075))
    corners = corners_at(pose, low, 0.02)
    solution = solve(Corners(corners.undistorted_px, corners.whiten, PLANE), CAMERA, prior_at(0.0))[0]
    assert solution.reprojection_px > 2.0


def test_refining_from_a_near_pose_gives_the_same():
    pose, near = camera_from_bar([-8.0, 0.4, 0.3], 0.1, 0.05), camera_from_bar([-8.3, 0.3, 0.2], 0.07, 0.03)
    corners = corners_at(pose, error_px=np.random.default_rng(2).normal(0.0, 0.05, (2, 4, 2)))
    first, second = (
        position_and_yaw(solve(corners, CAMERA, prior_at(0.05), start)[0].camera_from_plane)[0]
        for start in (None, from_plane(near))
    )
    np.testing.assert_allclose(first, second, atol=2e-3)  # m: a tenth of a standard deviation


def test_misfit_widens_the_covariance():
    pose = camera_from_bar([-6.0, 0.2, 0.1], 0.1)
    error_px = np.random.default_rng(4).normal(0.0, 0.3, (2, 4, 2))
    solution = solve(corners_at(pose, noise_px=0.05, error_px=error_px), CAMERA)[0]
    assert 12.0 < solution.excess < 80.0  # (0.3 / 0.05)² = 36, of ten degrees of freedom
    assert solve(corners_at(pose, noise_px=0.05, error_px=error_px / 6.0), CAMERA)[0].excess < 1.5


def test_a_common_error_costs_only_where_it_cannot_be_seen():
    pose = from_plane(camera_from_bar([-10.0, 0.0, 0.0]))
    bar_pose = pose @ Pose(CAMERA_FROM_MOUNT, np.zeros(3))
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

    def forward_m(target, common):
        plain = corners_at(bar_pose, target, 0.02)
        edge_bias = 0.1 * np.tile(signs, (target.count, 1, 1)) if common else None
        return np.sqrt(
            covariance_in_bar(
                bound(
                    pose, Corners(plain.undistorted_px, plain.whiten, plain.plane_m, edge_bias), CAMERA, prior_at(0.0)
                )
            )[0, 0]
        )

    assert forward_m(BAR, True) < 1.4 * forward_m(BAR, False)  # the gap between the rectangles tells
    single = rectangles((0.0, 0.0, 0.4, 0.4))
    assert forward_m(single, True) > 3.0 * forward_m(single, False)


def test_corners_that_are_not_finite_have_no_pose():
    corners = corners_at(camera_from_bar([-6.0, 0.0, 0.0]))
    corners.undistorted_px[0, 0, 0] = np.nan
    solutions = solve(corners, CAMERA)
    assert not solutions
