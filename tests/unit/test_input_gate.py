"""The border: what is not finite or cannot be is refused and named, the rest goes through untouched."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.messages import BarPose, Box, Frame, GimbalAttitude, Observation, Telemetry
from shipland.safety.input_gate import InputGate, without_repeated

CAMERA = Camera.from_fov(1280, 720, 69.0)
LEVEL = GimbalAttitude(0.0, -0.1)
FRAME = Frame(9.8, None, LEVEL)
POSE = BarPose(np.array([-9.0, 0.5, -0.4]), 0.1, np.eye(4) * 1e-4, 0.1, np.full((8, 2), 300.0))
BOX = Box((640.0, 300.0), (40.0, 30.0), 0.9)
SEEN = Observation(9.8, LEVEL, POSE, BOX, BOX)
TELEMETRY = Telemetry(10.0, 0.01, 0.02, 1.0, 5.0, np.array([1.0, 0.0, 0.0]), 90.0, 80.0, True)
AT_10_S = InputGate(now_s=10.0, exposure_s=9.7, gimbal=LEVEL)
BAD = (math.nan, math.inf, -math.inf, 1e9, -1e9)


def test_good_data_goes_through_untouched():
    assert AT_10_S.observation(SEEN, FRAME, CAMERA) is SEEN
    assert AT_10_S.telemetry(TELEMETRY) == (TELEMETRY, "")
    border, frame, refused = AT_10_S.frame(FRAME)
    assert (frame, refused, border.exposure_s) == (FRAME, "", 9.8)


@pytest.mark.parametrize("value", BAD)
def test_a_pose_that_cannot_be_is_refused_and_the_boxes_stay(value):
    for name in ("position_in_bar_m", "covariance", "corners_px"):
        spoiled = getattr(POSE, name).copy()
        spoiled.flat[1] = value
        seen = AT_10_S.observation(replace(SEEN, bar_pose=replace(POSE, **{name: spoiled})), FRAME, CAMERA)
        assert seen.bar_pose is None
        assert "pose refused" in seen.reason
        assert seen.bar_box is BOX
    assert AT_10_S.observation(replace(SEEN, bar_pose=replace(POSE, yaw_rad=value)), FRAME, CAMERA).bar_pose is None


@pytest.mark.parametrize("value", BAD)
def test_boxes_times_and_gimbals_that_cannot_be_are_refused(value):
    for box in (replace(BOX, centre_px=(640.0, value)), replace(BOX, size_px=(value, 30.0))):
        seen = AT_10_S.observation(replace(SEEN, ship_box=box), FRAME, CAMERA)
        assert seen.ship_box is None
        assert seen.bar_pose is POSE
    late = AT_10_S.observation(replace(SEEN, t_s=value), FRAME, CAMERA)
    assert (late.t_s, late.bar_pose, late.bar_box) == (9.8, None, None)
    tilted = AT_10_S.observation(replace(SEEN, gimbal=GimbalAttitude(0.0, value)), FRAME, CAMERA)
    assert (tilted.gimbal, tilted.bar_pose) == (LEVEL, None)
    _, frame, refused = AT_10_S.frame(replace(FRAME, gimbal=GimbalAttitude(value, 0.0)))
    assert "gimbal" in refused
    assert frame.gimbal == LEVEL


@pytest.mark.parametrize("value", BAD)
def test_telemetry_that_cannot_be_becomes_none_and_is_named(value):
    for name, word in (("heading_rad", "heading"), ("height_m", "height"), ("roll_rad", "roll")):
        told, refused = AT_10_S.telemetry(replace(TELEMETRY, **{name: value}))
        assert getattr(told, name) is None
        assert refused == f"telemetry refused: {word}"
        assert told.battery_percent == 90.0
    told, refused = AT_10_S.telemetry(replace(TELEMETRY, velocity_in_level_mps=np.array([0.0, value, 0.0])))
    assert told.velocity_in_level_mps is None
    told, refused = AT_10_S.telemetry(replace(TELEMETRY, heading_t_s=value))
    assert (told.heading_rad, told.heading_t_s) == (None, None)
    told, _ = AT_10_S.telemetry(replace(TELEMETRY, t_s=value))
    assert told.t_s == 10.0


@pytest.mark.parametrize("value", [*BAD, 2.0])
def test_a_time_that_leaps_alone_is_refused_and_a_clock_that_goes_on_from_there_is_believed(value):
    once = AT_10_S.at_receipt(FRAME, value)
    assert once.now_s == 10.0
    assert once.at_receipt(FRAME, 10.1).now_s == 10.1
    assert once.at_receipt(FRAME, value).now_s == 10.0  # the same number twice is no clock
    if math.isfinite(value):
        moved = once.at_receipt(replace(FRAME, t_s=value - 0.2), value + 0.1)
        assert moved.vehicle_s(moved.now_s) == pytest.approx(value + 0.1)
        moved, frame, refused = moved.frame(replace(FRAME, t_s=value + 0.1))
        assert (frame.t_s, refused) == (pytest.approx(moved.now_s), "")


@pytest.mark.parametrize("leap_s", [-9.0, 1e5, 1.7e9])
def test_a_leap_takes_no_time_of_the_flight_and_a_clock_that_comes_back_is_believed(leap_s):
    border = AT_10_S
    for t_s in (10.1, 10.2, 10.3):
        border = border.at_receipt(replace(FRAME, t_s=t_s + leap_s - 0.1), t_s + leap_s)
    assert border.now_s == pytest.approx(10.2)  # of the first, refused, nobody knew yet
    told, refused = border.telemetry(replace(TELEMETRY, t_s=10.3 + leap_s, heading_t_s=10.25 + leap_s))
    assert (told.t_s, told.heading_t_s, refused) == (border.now_s, pytest.approx(10.15), "")
    seen = border.frame(replace(FRAME, t_s=10.2 + leap_s))[1]
    assert (seen.t_s, seen.stamp_s) == (pytest.approx(10.1), 10.2 + leap_s)
    for t_s in (10.4, 10.5):
        border = border.at_receipt(replace(FRAME, t_s=t_s - 0.1), t_s)
    assert (border.now_s, border.leapt_s) == (10.5, 0.0)


def test_a_vehicle_that_was_silent_has_flown_on():
    border = AT_10_S.at_receipt(replace(FRAME, t_s=29.9), 30.0).at_receipt(replace(FRAME, t_s=30.0), 30.1)
    assert (border.now_s, border.leapt_s) == (30.1, 0.0)


def test_a_picture_from_the_past_or_the_future_is_not_looked_at():
    for t_s, words in ((9.5, "older than the last"), (12.0, "time refused"), (math.nan, "time refused")):
        border, frame, refused = AT_10_S.frame(replace(FRAME, t_s=t_s))
        assert words in refused
        assert frame.t_s == border.exposure_s == 9.7


@pytest.mark.parametrize(
    ("age_s", "words"),
    [(3.0, "gimbal attitude 3.0 s old"), (0.21, "0.2 s old"), (math.inf, "no gimbal attitude"), (math.nan, "unknown")],
)
def test_a_picture_whose_gimbal_reading_is_old_is_not_looked_at(age_s, words):
    border, frame, refused = AT_10_S.frame(replace(FRAME, gimbal=GimbalAttitude(0.0, 0.3), gimbal_age_s=age_s))
    assert words in refused
    assert (frame.gimbal, border) == (LEVEL, AT_10_S)
    assert AT_10_S.frame(replace(FRAME, gimbal_age_s=0.2))[2] == ""


def test_a_picture_that_comes_again_is_refused_and_its_twin_with_other_noise_is_not():
    again = without_repeated(SEEN, SEEN)
    assert again.bar_pose is None
    assert again.reason == "picture repeated: the stream stands still"
    other = replace(SEEN, bar_pose=replace(POSE, corners_px=POSE.corners_px + 1e-9))
    assert without_repeated(other, SEEN) is other
    assert without_repeated(SEEN, None) is SEEN
    assert without_repeated(replace(SEEN, bar_pose=None), SEEN).reason == SEEN.reason
