"""A rolling shutter in the near chain: rows exposed one after the other, over drawn pictures whose truth is exact."""

from dataclasses import replace

import numpy as np
import pytest

from pictures import GREEN, GREY, Look, bar_picture, camera_from_bar, finish, paint, plain_canvas, project_plane
from shipland.calibration_file import read_calibration, write_calibration
from shipland.camera import Camera, CameraParameters
from shipland.errors import DataError
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.vision.near.pipeline import NearVision
from shipland.vision.near.pose import Followed, row_motion
from shipland.vision.parameters import VisionParameters

PARAMETERS = VisionParameters()
GLOBAL = Camera.from_parameters(CameraParameters())
ROLLING = replace(GLOBAL, row_time_s=4.2e-5)  # 30 ms a picture
BAR = Rig().cue
LEVEL = GimbalAttitude(0.0, 0.0)
STEP_S = 1.0 / 30.0
MOTION_PX_S = np.array([-140.0, 120.0])
"""Of the cue in the picture: a yaw of 9°/s, and a climb of 1 m/s at 8 m."""


def as_rolled(points_px, motion_px_s, t_s=0.0):
    """Where a rolling shutter shows points (n,2) that pass `points_px` at t = 0: row = row₀ + v · (its own time)."""
    middle = 0.5 * (ROLLING.height_px - 1)
    column, row = (points_px + motion_px_s * t_s).T
    seen_row = (row - motion_px_s[1] * ROLLING.row_time_s * middle) / (1.0 - motion_px_s[1] * ROLLING.row_time_s)
    seen_column = column + motion_px_s[0] * ROLLING.row_time_s * (seen_row - middle)
    return np.stack([seen_column, seen_row], axis=1)


def rolled_picture(pose, t_s, rng, motion_px_s=MOTION_PX_S):
    """The bar on its board at a time, as a rolling shutter has it; its middle row is exposed then."""
    canvas, plane_m = plain_canvas(ROLLING), BAR.points_in_bar_m[:, 1:]
    low, high = plane_m.min(axis=0) - 0.075, plane_m.max(axis=0) + 0.075
    board = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    for corners_m, colour in [(board, GREY), *((quad.corners_m, GREEN) for quad in BAR.polygon)]:
        corners_px = as_rolled(project_plane(corners_m, ROLLING, pose), motion_px_s, t_s)
        paint(canvas, corners_px, colour, 4, Look().blur_px)
    return finish(canvas, rng, Look())


def error_of(seen, place_m, yaw_rad):
    """Error (4,) and what its covariance makes of it, squared, over 4."""
    error = np.append(seen.bar_pose.position_in_bar_m - place_m, seen.bar_pose.yaw_rad - yaw_rad)
    return error, float(error @ np.linalg.solve(seen.bar_pose.covariance, error)) / 4.0


@pytest.mark.parametrize("place_m", [(-4.0, -1.2, 0.9), (-8.0, -2.0, 1.6), (-12.0, 3.0, 2.4)])
def test_a_followed_cue_is_freed_of_what_its_own_motion_leans(place_m):
    rng, yaw_rad = np.random.default_rng(3), -np.arctan2(place_m[1], -place_m[0])
    pose = camera_from_bar(place_m, yaw_rad)
    pictures = [(t_s, rolled_picture(pose, t_s, rng)) for t_s in (-STEP_S, 0.0)]
    told, not_told = NearVision(BAR, ROLLING, PARAMETERS), NearVision(BAR, GLOBAL, PARAMETERS)
    for t_s, picture in pictures:
        seen = told.see(Frame(1.0 + t_s, picture, LEVEL))
        tilted = not_told.see(Frame(1.0 + t_s, picture, LEVEL))
    error, squared = error_of(seen, place_m, yaw_rad)
    assert squared < 3.0  # 95 % of four degrees of freedom lie below 2.4
    leaned_error, leaned_squared = error_of(tilted, place_m, yaw_rad)
    assert leaned_squared > 4.0 * max(squared, 1.0)
    assert np.linalg.norm(error[:3]) < np.linalg.norm(leaned_error[:3])


def test_alone_a_picture_is_solved_with_the_motion_as_an_unknown():
    place_m, yaw_rad, pitch_rad, rng = (-8.0, -2.0, 0.0), np.arctan2(2.0, 8.0), -0.12, np.random.default_rng(4)
    picture = rolled_picture(camera_from_bar(place_m, yaw_rad, pitch_rad), 0.0, rng)
    frame = Frame(0.0, picture, GimbalAttitude(0.0, pitch_rad))
    told, not_told = (NearVision(BAR, camera, PARAMETERS).see(frame) for camera in (ROLLING, GLOBAL))
    assert error_of(told, place_m, yaw_rad)[1] < 3.0
    assert error_of(not_told, place_m, yaw_rad)[1] > 20.0


def test_motion_linear_in_the_cue_is_taken_out_whole():
    plane_m = BAR.plane_m
    corners_px = project_plane(plane_m.reshape(-1, 2), ROLLING, camera_from_bar((-3.0, 0.3, 0.4)))
    motion_px_s = MOTION_PX_S + plane_m.reshape(-1, 2) @ [[60.0, 5.0], [-8.0, 55.0]]  # it grows and turns a little
    seen = [
        np.concatenate([as_rolled(point[None], way, t_s) for point, way in zip(corners_px, motion_px_s, strict=True)])
        for t_s in (-STEP_S, 0.0)
    ]
    last, now = (points.reshape(plane_m.shape) for points in seen)
    moved = row_motion(now, now[..., 1], plane_m, ROLLING, PARAMETERS, Followed(last, STEP_S))
    assert np.abs((now - moved.moved_px).reshape(-1, 2) - corners_px).max() < 1e-3  # px
    alone = row_motion(now, now[..., 1], plane_m, ROLLING, PARAMETERS, None)
    assert not alone.moved_px.any()
    ratio = PARAMETERS.row_motion_px_s / PARAMETERS.row_shake_px_s
    np.testing.assert_allclose(alone.unsure_px, ratio * moved.unsure_px)


@pytest.mark.parametrize("step_s", [1e-3, 1e-5])
def test_pictures_a_moment_apart_tell_no_motion(step_s):
    """A recorder that stamps a repeated picture anew: the corners' noise, over so little time, is no motion."""
    place_m, rng, told = (-6.0, 0.3, 1.0), np.random.default_rng(4), NearVision(BAR, ROLLING, PARAMETERS)
    pose = camera_from_bar(place_m, 0.02)
    for index in range(3):
        seen = told.see(Frame(index * step_s, bar_picture(BAR, ROLLING, pose, rng, Look(0.5, 2.0)), LEVEL))
        assert error_of(seen, place_m, 0.02)[1] < 3.0


def test_row_time_is_kept_by_files_and_goes_with_the_size(tmp_path):
    path = tmp_path / "camera.yaml"
    write_calibration(ROLLING, path)
    assert read_calibration(path).row_time_s == pytest.approx(ROLLING.row_time_s, rel=1e-6)
    assert ROLLING.scaled(640, 360).row_time_s == pytest.approx(2.0 * ROLLING.row_time_s)  # the same time a picture
    write_calibration(GLOBAL, path)
    assert read_calibration(path).row_time_s == 0.0


def test_a_row_time_in_microseconds_is_refused(tmp_path):
    path = tmp_path / "camera.yaml"
    write_calibration(ROLLING, path)
    path.write_text(path.read_text().replace("row_time_s: ", "row_time_s: 42. # "))
    with pytest.raises(DataError, match="row_time_s"):
        read_calibration(path)
