"""What crosses a stage: wrong shapes are refused with what they are and what was wanted; derived values by hand."""

import dataclasses
import inspect
import re

import numpy as np
import pytest

from shipland import messages
from shipland.frames import Pose
from shipland.messages import (
    BarPose,
    Box,
    Estimate,
    Frame,
    GimbalAttitude,
    GroundTruth,
    Intent,
    PilotCommand,
    Telemetry,
    TouchdownVerdict,
)

GIMBAL = GimbalAttitude(0.0, 0.0)


def bar_pose(**changes):
    parts = {
        "position_in_bar_m": np.array([-12.0, 0.0, 0.0]),
        "yaw_rad": 0.0,
        "covariance": np.eye(4),
        "reprojection_px": 0.1,
        "corners_px": np.zeros((8, 2)),
    }
    return BarPose(**parts | changes)


def telemetry(**changes):
    parts = {
        "t_s": 0.0,
        "roll_rad": 0.0,
        "pitch_rad": 0.0,
        "heading_rad": None,
        "height_m": None,
        "velocity_in_level_mps": None,
        "battery_percent": None,
        "link_percent": None,
        "flying": True,
    }
    return Telemetry(**parts | changes)


def verdict(**changes):
    parts = {
        "t_s": 0.0,
        "landed": True,
        "in_square": True,
        "touchdown_in_deck_m": np.zeros(2),
        "rest_in_deck_m": np.zeros(2),
        "relative_velocity_in_deck_mps": np.zeros(3),
        "tilt_rad": 0.0,
        "slip_m": 0.0,
        "peak_contact_force_n": 0.0,
        "reason": "",
    }
    return TouchdownVerdict(**parts | changes)


def estimate(**changes):
    return Estimate(**{"t_s": 0.0, "aircraft_in_bar_m": np.zeros(3), "yaw_rad": 0.0} | changes)


def truth(**changes):
    here = Pose.identity()
    parts = {
        "t_s": 0.0,
        "ned_from_body": here,
        "velocity_in_ned_mps": np.zeros(3),
        "ned_from_ship": here,
        "ned_from_deck": here,
        "ned_from_bar": here,
        "ned_from_camera": here,
        "wind_in_ned_mps": np.zeros(3),
    }
    return GroundTruth(**parts | changes)


def frame(image):
    return Frame(0.0, image, GIMBAL)


@pytest.mark.parametrize(
    ("make", "field", "value", "wanted", "got"),
    [
        (bar_pose, "position_in_bar_m", np.zeros(2), "(3,)", "(2,)"),
        (bar_pose, "position_in_bar_m", np.zeros((3, 1)), "(3,)", "(3, 1)"),
        (bar_pose, "covariance", np.eye(3), "(4, 4)", "(3, 3)"),
        (bar_pose, "corners_px", np.zeros((2, 8)), "(n, 2)", "(2, 8)"),
        (bar_pose, "corners_px", np.zeros((8, 1, 2)), "(n, 2)", "(8, 1, 2)"),
        (telemetry, "velocity_in_level_mps", np.zeros(4), "(3,)", "(4,)"),
        (verdict, "touchdown_in_deck_m", np.zeros(3), "(2,)", "(3,)"),
        (verdict, "rest_in_deck_m", np.zeros(3), "(2,)", "(3,)"),
        (verdict, "relative_velocity_in_deck_mps", np.zeros(2), "(3,)", "(2,)"),
        (estimate, "aircraft_in_bar_m", np.zeros((1, 3)), "(3,)", "(1, 3)"),
        (estimate, "velocity_in_bar_mps", np.zeros(2), "(3,)", "(2,)"),
        (estimate, "covariance", np.eye(3), "(4, 4)", "(3, 3)"),
        (truth, "velocity_in_ned_mps", np.zeros(2), "(3,)", "(2,)"),
        (truth, "wind_in_ned_mps", np.zeros(2), "(3,)", "(2,)"),
    ],
)
def test_a_wrong_shape_is_refused_with_what_it_is_and_what_was_wanted(make, field, value, wanted, got):
    with pytest.raises(ValueError, match=re.escape(f".{field} wants shape {wanted}, got {got}")):
        make(**{field: value})


@pytest.mark.parametrize(
    ("image", "fault"),
    [
        (np.zeros((720, 1280), np.uint8), r"Frame\.image wants shape \(n, n, 3\), got \(720, 1280\)"),
        (np.zeros((720, 1280, 4), np.uint8), r"got \(720, 1280, 4\)"),
        (np.zeros((720, 1280, 3), np.float32), r"Frame\.image wants uint8, got float32"),
    ],
)
def test_a_picture_is_three_channels_of_uint8(image, fault):
    with pytest.raises(ValueError, match=fault):
        frame(image)


def test_right_shapes_are_taken():
    bar_pose()
    bar_pose(corners_px=np.zeros((4, 2)))  # a target of one quadrilateral
    telemetry(velocity_in_level_mps=np.zeros(3))
    telemetry()
    verdict()
    estimate()
    estimate(velocity_in_bar_mps=np.zeros(3), covariance=np.eye(4))
    frame(np.zeros((720, 1280, 3), np.uint8))
    frame(None)


@pytest.mark.parametrize(
    "message",
    [
        item
        for _, item in inspect.getmembers(messages, dataclasses.is_dataclass)
        if item.__module__ == messages.__name__
    ],
)
def test_every_message_is_frozen_and_documented(message):
    assert message.__dataclass_params__.frozen
    assert message.__doc__
    assert not message.__doc__.startswith(f"{message.__name__}(")  # what dataclass writes when there is none


def test_box_area():
    assert Box((640.0, 360.0), (100.0, 34.0), 0.9).area_px2 == 3400.0


def test_hold_is_every_stick_at_zero():
    command = PilotCommand.hold(3.0, -0.2)
    sticks = command.sticks_percent
    assert sticks == (0.0, 0.0, 0.0, 0.0)
    assert (command.t_s, command.gimbal_pitch_rad, command.intent) == (3.0, -0.2, Intent.HOLD)


def test_truth_gives_the_aircraft_in_deck_and_bar_by_hand():
    # The ship heads east at (100, 50); the deck's surface is 0.9 m up; the bar 2.09 m ahead and 0.75 m higher.
    # The aircraft is 3 m west of the deck's centre (astern), 1 m to the south (starboard), 4.9 m above the sea.
    east_rad = 0.5 * np.pi
    seen = truth(
        ned_from_body=Pose.from_euler((99.0, 47.0, -4.9), 0.1, 0.1, 1.0),
        ned_from_ship=Pose.from_euler((100.0, 50.0, -0.9), 0.0, 0.0, east_rad),
        ned_from_deck=Pose.from_euler((100.0, 50.0, -0.9), 0.0, 0.0, east_rad),
        ned_from_bar=Pose.from_euler((100.0, 52.09, -1.65), 0.0, 0.0, east_rad),
    )
    np.testing.assert_allclose(seen.aircraft_in_deck_m, [-3.0, 1.0, -4.0], atol=1e-9)
    np.testing.assert_allclose(seen.aircraft_in_bar_m, [-5.09, 1.0, -3.25], atol=1e-9)


def test_the_newest_value_of_telemetry_is_as_old_as_it_says():
    at = Telemetry(10.0, 0.0, 0.0, 0.0, 1.0, None, 90.0, 90.0, True)
    assert at.newest_s == 10.0
    assert dataclasses.replace(at, attitude_t_s=9.2, height_t_s=9.7).newest_s == 9.7
