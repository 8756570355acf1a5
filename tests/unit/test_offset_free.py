"""Near control of ours: on a plant with its delay, wind and ship's way it leaves no steady error."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.config import build
from shipland.frames import rotation_from_euler
from shipland.guidance.estimate import Measured, measure
from shipland.guidance.offset_free import OffsetFreeNear, OffsetFreeParameters
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import BarPose
from shipland.rig import packaged_table

PARAMETERS = build(OffsetFreeParameters, packaged_table("guidance")["offset_free"])
RESPONSE = replace(ANAFI_LIKE, drag_per_s=1.0 / 2.9)
STEP_S = 1.0 / 30.0
VIDEO_S, PROCESSING_S = 0.28, 0.03


def fly(seconds, start_m, wind_mps2=0.0, ship_mps=0.0, noise_m=0.0, rng=None):
    """Forward error over time of a point mass with the response's own lag; frames and sticks arrive late."""
    control = OffsetFreeNear(PARAMETERS, RESPONSE)
    error_m, speed_mps = start_m, 0.0
    inner_s = 0.005
    history, commands, errors = [], [], []
    for index in range(round(seconds / STEP_S)):
        now_s = index * STEP_S
        for part in range(round(STEP_S / inner_s)):
            t_s = now_s + part * inner_s
            stick = 0.0
            for effect_s, given in commands:
                if effect_s <= t_s:
                    stick = given
            push = 9.81 * math.tan(stick / 100.0 * RESPONSE.max_tilt_rad) + wind_mps2
            speed_mps += (push - speed_mps / RESPONSE.speed_time_s) * inner_s
            error_m += (ship_mps - speed_mps) * inner_s
            history.append((t_s, error_m))
        exposed_s = now_s - VIDEO_S
        if exposed_s < 0.0:
            continue
        seen_m = min(history, key=lambda item: abs(item[0] - exposed_s))[1]
        if rng is not None:
            seen_m += rng.normal(0.0, noise_m)
        errors_m = np.array([seen_m, 0.0, 0.0])
        ready_s = now_s + PROCESSING_S
        control.observe(Measured(exposed_s, errors_m, np.full(3, 1e-4), 0.0, 1e-4, 0.0), ready_s)
        sticks = control.sticks()
        control.sent(ready_s, sticks)
        commands.append((ready_s + RESPONSE.uplink_s + PARAMETERS.lag_s, sticks.pitch))
        commands = commands[-60:]
        errors.append(error_m)
    return np.array(errors)


@pytest.mark.parametrize(("wind_mps2", "ship_mps"), [(0.0, 0.0), (-0.6, 0.0), (0.0, 1.5), (0.4, 2.0)])
def test_neither_wind_nor_the_ships_way_leaves_an_error(wind_mps2, ship_mps):
    errors = fly(40.0, 6.0, wind_mps2, ship_mps)
    assert np.all(np.abs(errors[-150:]) < 0.02)  # m; the square's half side is 0.175


def test_no_overshoot_in_still_air():
    assert fly(30.0, 8.0).min() > -0.10  # m past the reference point, of 8 m flown


def test_noise_is_not_passed_on():
    errors = fly(40.0, 2.0, noise_m=0.02, rng=np.random.default_rng(1))
    assert np.std(errors[-300:]) < 0.02  # m: no more than the measurement's own


def test_errors_of_a_pose_by_hand():
    """2 m astern and 0.5 m left of the reference point, nose 90° right of the bar: the place is to the left, behind."""
    wanted_in_bar_m = np.array([-2.0, 0.0, -0.5])
    camera_in_body_m = np.array([0.1, 0.0, 0.0])
    yaw_rad = math.pi / 2
    aircraft_in_bar_m = np.array([-4.0, -0.5, 0.0])
    camera_in_bar_m = aircraft_in_bar_m + rotation_from_euler(0.0, 0.0, yaw_rad) @ camera_in_body_m
    pose = BarPose(camera_in_bar_m, yaw_rad, np.eye(4) * 1e-4, 0.1, np.zeros((8, 2)))
    measured = measure(1.0, pose, wanted_in_bar_m, camera_in_body_m)
    np.testing.assert_allclose(measured.error_in_level_m, [0.5, -2.0, 0.5], atol=1e-12)


def test_variance_of_the_error_matches_drawn_poses():
    rng = np.random.default_rng(5)
    wanted_in_bar_m, camera_in_body_m = np.array([-2.1, 0.0, -0.45]), np.array([0.09, 0.0, 0.0])
    mean = np.array([-9.0, 1.0, -0.4, 0.15])
    mix = np.array([[0.02, 0, 0, 0], [0.01, 0.12, 0, 0], [0, 0, 0.05, 0], [0, 0.012, 0, 0.004]])
    covariance = mix @ mix.T
    drawn = [
        measure(0.0, BarPose(x[:3], x[3], covariance, 0.1, np.zeros((8, 2))), wanted_in_bar_m, camera_in_body_m)
        for x in rng.multivariate_normal(mean, covariance, 4000)
    ]
    spread = np.var([each.error_in_level_m for each in drawn], axis=0)
    told = measure(
        0.0, BarPose(mean[:3], mean[3], covariance, 0.1, np.zeros((8, 2))), wanted_in_bar_m, camera_in_body_m
    )
    np.testing.assert_allclose(told.variance_in_level_m2, spread, rtol=0.1)  # 4,000 draws know a variance to 2 %


def test_a_turning_nose_is_not_taken_for_a_speed():
    """From 18 m astern and 9 m aside, nose 27° off the bar: turning to it, the place believed stays the true one."""
    control = OffsetFreeNear(PARAMETERS, RESPONSE)
    error_m, velocity_mps, yaw_rad = np.array([18.0, 9.0]), np.zeros(2), math.radians(-27.0)
    sticks, history, off_m, pushes = [], [], [], []
    for index in range(round(12.0 / STEP_S)):
        now_s = index * STEP_S
        for part in range(7):
            t_s = now_s + part * STEP_S / 7.0
            given = max((item for item in sticks if item[0] <= t_s), default=(0.0, (0.0,) * 4))[1]
            axes = rotation_from_euler(0.0, 0.0, yaw_rad)[:2, :2]
            push = 9.81 * np.tan(0.01 * np.array(given[:2]) * RESPONSE.max_tilt_rad)
            velocity_mps += (axes @ push - velocity_mps / RESPONSE.speed_time_s) * STEP_S / 7.0
            error_m = error_m - velocity_mps * STEP_S / 7.0
            yaw_rad += 0.01 * given[3] * RESPONSE.max_turn_rad_s * STEP_S / 7.0
            history.append((t_s, error_m, yaw_rad))
        seen = min(history, key=lambda item: abs(item[0] - (now_s - VIDEO_S)))
        level_m = rotation_from_euler(0.0, 0.0, seen[2])[:2, :2].T @ seen[1]
        ready_s = now_s + PROCESSING_S
        measured = Measured(seen[0], np.append(level_m, 0.0), np.full(3, 1e-4), seen[2], 1e-6, 0.0)
        estimate = control.observe(measured, ready_s)
        given = control.sticks()
        control.sent(ready_s, given)
        sticks.append((ready_s + RESPONSE.uplink_s + PARAMETERS.lag_s, given))
        sticks = sticks[-40:]
        off_m.append(np.linalg.norm(estimate.aircraft_in_bar_m(np.zeros(3))[:2] + error_m))
        pushes.append(given.pitch)
    ahead_m = PARAMETERS.max_speed_mps * (PROCESSING_S + RESPONSE.uplink_s + PARAMETERS.lag_s) * math.sqrt(2.0)
    assert max(off_m[30:]) < ahead_m + 0.1  # m; the estimate is of the time when the sticks act
    assert np.count_nonzero(np.diff(np.sign(pushes))) < 6


def test_a_heading_that_goes_round_is_told_within_half_a_turn():
    control = OffsetFreeNear(PARAMETERS, RESPONSE)
    for index in range(200):
        yaw_rad = math.remainder(index * math.radians(3.0), 2.0 * math.pi)
        measured = Measured(index * STEP_S, np.zeros(3), np.full(3, 1e-4), yaw_rad, 1e-4, 0.0)
        estimate = control.observe(measured, index * STEP_S)
        assert abs(estimate.yaw_rad) <= math.pi
        assert abs(control.sticks().yaw) <= 100.0
