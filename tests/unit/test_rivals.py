"""The rivals' laws: each against what its source says it must do, on plants of a line or two."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.frames import rotation_from_euler
from shipland.guidance.near import MeasuredError
from shipland.guidance.parameters import ImageServoingParameters, SpectralMpcParameters
from shipland.guidance.response import ANAFI_LIKE, HOLD
from shipland.guidance.rivals.image_servoing import ImageServoing, _interaction
from shipland.guidance.rivals.spectral_mpc import STEP_S, Waves
from shipland.messages import GimbalAttitude
from shipland.rig import Rig
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario

SPEED_STICKS = replace(ANAFI_LIKE, kind="velocity", max_speed_mps=5.0, servo_per_s=1.8)
RIG = Rig()
CAMERA = Camera.from_parameters(CameraParameters())
AT_NOSE_M = np.array([0.09, 0.0, 0.0])
LOOK = GimbalAttitude(0.0, -0.15)
HOVER_M = np.array([-2.09, 0.0, -0.45])


def seen(place_m, yaw_rad, gimbal=LOOK, t_s=0.0):
    """What a picture from a place in `bar` [m] gives the law: true corners, a pose's errors of no account."""
    level_from_bar = rotation_from_euler(0.0, 0.0, yaw_rad).T
    in_level_m = (RIG.cue.points_in_bar_m - place_m) @ level_from_bar.T - AT_NOSE_M
    corners_px = CAMERA.project(in_level_m @ level_from_camera(gimbal))
    error_m = (level_from_bar @ (HOVER_M - place_m)) * np.array([1.0, 1.0, -1.0])
    return MeasuredError(
        t_s, 0.0, error_m, yaw_rad, 0.0, np.zeros(3), wanted_in_bar_m=HOVER_M, corners_px=corners_px, gimbal=gimbal
    )


def servoing():
    return ImageServoing(ImageServoingParameters(), SPEED_STICKS, RIG.cue, CAMERA, AT_NOSE_M)


def test_the_interaction_matrix_is_the_derivative_of_the_image():
    points_m, step = np.array([[4.0, 0.5, -0.2], [5.0, -0.7, 0.3]]), 1e-6
    slopes = points_m[:, 1:] / points_m[:, :1]
    for axis in range(4):
        moved_m = points_m - step * np.eye(3)[axis] if axis < 3 else points_m @ rotation_from_euler(0.0, 0.0, step)
        rate = ((moved_m[:, 1:] / moved_m[:, :1] - slopes) / step).ravel()
        np.testing.assert_allclose(_interaction(slopes, points_m[:, 0])[:, axis], rate, atol=1e-5)


def test_at_the_goal_image_servoing_asks_for_nothing_whatever_the_gimbal():
    for gimbal in (GimbalAttitude(0.0, -0.2), GimbalAttitude(0.05, -0.1)):
        law = servoing()
        law.observe(seen(HOVER_M, 0.0, gimbal))
        np.testing.assert_allclose(law.sticks(0.0), 0.0, atol=1e-6)


def test_image_servoing_flies_to_the_goal_from_any_side_by_corners_alone():
    """The pose's errors are not read: they are taken away from what it sees."""
    for start_m, yaw_rad in (([-9.0, 2.0, -1.5], 0.2), ([-6.0, -1.5, 0.3], -0.2), ([-3.0, 0.5, -0.4], 0.1)):
        law, place_m = servoing(), np.array(start_m)
        for step in range(600):
            law.observe(replace(seen(place_m, yaw_rad, t_s=step / 30.0), error_in_level_m=np.zeros(3)))
            sticks = law.sticks(0.0)
            forward_mps, right_mps = SPEED_STICKS.input_of(sticks.pitch), SPEED_STICKS.input_of(sticks.roll)
            down_mps = -0.01 * sticks.heave * SPEED_STICKS.max_climb_mps
            place_m = place_m + rotation_from_euler(0.0, 0.0, yaw_rad) @ [forward_mps, right_mps, down_mps] / 30.0
            yaw_rad += 0.01 * sticks.yaw * SPEED_STICKS.max_turn_rad_s / 30.0
        # What the integral took up on the way it gives back within 20 s.
        np.testing.assert_allclose([*place_m, yaw_rad], [*HOVER_M, 0.0], atol=0.03)


def test_image_servoing_holds_where_there_are_no_corners_of_the_cue():
    law = servoing()
    assert law.sticks(0.0) == HOLD
    law.observe(replace(seen(HOVER_M, 0.0), corners_px=np.zeros((4, 2))))
    assert law.sticks(0.0) == HOLD


def test_waves_are_found_again_and_continued():
    times_s = STEP_S * np.arange(201.0)

    def place_m(t_s):
        roll = 0.4 * np.sin(2.0 * np.pi * t_s / 5.3 + 0.4) + 0.15 * np.sin(2.0 * np.pi * t_s / 3.1)
        return np.column_stack([0.3 * t_s, roll, 0.5 * np.cos(2.0 * np.pi * t_s / 5.3)])

    waves = Waves(SpectralMpcParameters(), place_m(times_s), np.full(201, 0.02), float(times_s[-1]))
    ahead_s = times_s[-1] + np.arange(0.2, 1.01, 0.2)
    places_m, speeds_mps = waves.at(ahead_s)
    # A period is read from a spectrum of 20 s to some hundredths: a second ahead that is 6 cm of half a metre.
    np.testing.assert_allclose(places_m, place_m(ahead_s), atol=0.06)
    np.testing.assert_allclose(speeds_mps, (place_m(ahead_s + 1e-4) - place_m(ahead_s - 1e-4)) / 2e-4, atol=0.12)


def test_a_short_motion_is_continued_as_a_line():
    times_s = STEP_S * np.arange(20.0)
    waves = Waves(SpectralMpcParameters(), np.column_stack([0.5 * times_s]), np.full(20, 0.02), float(times_s[-1]))
    places_m, speeds_mps = waves.at(times_s[-1] + np.array([1.0]))
    assert places_m[0, 0] == pytest.approx(0.5 * (times_s[-1] + 1.0))
    assert speeds_mps[0, 0] == pytest.approx(0.5)


def test_a_programme_keeps_its_limits_and_without_numbers_has_no_answer():
    pytest.importorskip("osqp")
    from shipland.guidance.rivals.spectral_mpc import STEPS, Axis

    parameters, target = SpectralMpcParameters(), np.zeros((STEPS, 2))
    axis, state, given, speeds_mps = Axis(0.0, 0.16, 0.3, 2.6, parameters), np.array([-12.0, 0.0, 0.0]), 0.0, []
    for _ in range(300):
        given = axis.input(state, 0.0, target, given)
        assert abs(given) <= 2.6
        state = axis.after(state, 0.0, given, 0.1)
        speeds_mps.append(state[1])
    assert max(speeds_mps) < 2.0 * parameters.most_mps
    assert abs(state[0]) < 0.05  # m
    assert axis.input(np.array([math.nan, 0.0, 0.0]), 0.0, target, 0.0) is None


def test_without_osqp_one_line_says_what_to_install(monkeypatch):
    from shipland import extras
    from shipland.errors import SystemLibraryError
    from shipland.guidance.rivals.spectral_mpc import SpectralMpc

    monkeypatch.setattr(extras, "find_spec", lambda _: None)
    with pytest.raises(
        SystemLibraryError, match=r"spectral_mpc needs osqp; install it with: pip install 'shipland\[mpc"
    ):
        SpectralMpc(SpectralMpcParameters(), ANAFI_LIKE)


def close_by(stick, **changes):
    """Still air, 6 m astern."""
    start = {"distance_m": 6.0, "distance_half_range_m": 0.0}
    still = {"aircraft.loop.kind": stick, "wind.mean_mps": 0.0}
    return load_scenario("rig-natops", start=start, **still, **changes)


@pytest.mark.parametrize("stick", [pytest.param("attitude", marks=pytest.mark.slow), "velocity"])
@pytest.mark.parametrize("pilot", ["image_servoing", "spectral_mpc", "deck_following"])
def test_a_rival_lands_in_still_air_and_begins_the_same_way_twice(pilot, stick):
    if pilot == "spectral_mpc":
        pytest.importorskip("osqp")
    rows, again = [], []
    flown = fly_quietly(close_by(stick), pilot, "geometric", 1001, rows.append)
    assert flown.success, flown.reason
    fly_quietly(close_by(stick, time_limit_s=1.5), pilot, "geometric", 1001, again.append)
    assert len(again) > 20
    assert [row.decision.command for row in again] == [row.decision.command for row in rows[: len(again)]]


def test_the_deck_is_followed_by_the_tag_alone():
    """Once the camera looks down no pose of the bar is seen, to contact."""
    rows = []
    assert fly_quietly(close_by("velocity"), "deck_following", "geometric", 1002, rows.append).success
    landing = [row.observation for row in rows if row.decision.mode is not None and row.decision.mode.name == "LAND"]
    assert sum(observation.deck is not None for observation in landing) > 20
    assert all(observation.bar_pose is None for observation in landing)
