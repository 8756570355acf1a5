"""What crosses a stage: wrong shapes are refused with what they are and what was wanted; derived values by hand."""

import dataclasses
import inspect
import re

import numpy as np
import pytest

from shipland import frames, messages
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

BAR_POSE = BarPose(np.array([-12.0, 0.0, 0.0]), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))
TELEMETRY = Telemetry(0.0, 0.0, 0.0, None, None, None, None, None, True)
VERDICT = TouchdownVerdict(0.0, True, True, np.zeros(2), np.zeros(2), np.zeros(3), 0.0, 0.0, 0.0, "")
ESTIMATE = Estimate(0.0, np.zeros(3), 0.0)
HERE = Pose.identity()
TRUTH = GroundTruth(0.0, HERE, np.zeros(3), HERE, HERE, HERE, HERE, np.zeros(3))
FRAME = Frame(0.0, None, GimbalAttitude(0.0, 0.0))


@pytest.mark.parametrize(
    ("message", "field", "value", "wanted", "got"),
    [
        (BAR_POSE, "position_in_bar_m", np.zeros(2), "(3,)", "(2,)"),
        (BAR_POSE, "position_in_bar_m", np.zeros((3, 1)), "(3,)", "(3, 1)"),
        (BAR_POSE, "covariance", np.eye(3), "(4, 4)", "(3, 3)"),
        (BAR_POSE, "corners_px", np.zeros((2, 8)), "(n, 2)", "(2, 8)"),
        (BAR_POSE, "corners_px", np.zeros((8, 1, 2)), "(n, 2)", "(8, 1, 2)"),
        (TELEMETRY, "velocity_in_level_mps", np.zeros(4), "(3,)", "(4,)"),
        (VERDICT, "touchdown_in_deck_m", np.zeros(3), "(2,)", "(3,)"),
        (VERDICT, "rest_in_deck_m", np.zeros(3), "(2,)", "(3,)"),
        (VERDICT, "relative_velocity_in_deck_mps", np.zeros(2), "(3,)", "(2,)"),
        (ESTIMATE, "aircraft_in_bar_m", np.zeros((1, 3)), "(3,)", "(1, 3)"),
        (ESTIMATE, "velocity_in_bar_mps", np.zeros(2), "(3,)", "(2,)"),
        (ESTIMATE, "covariance", np.eye(3), "(4, 4)", "(3, 3)"),
        (TRUTH, "velocity_in_ned_mps", np.zeros(2), "(3,)", "(2,)"),
        (TRUTH, "wind_in_ned_mps", np.zeros(2), "(3,)", "(2,)"),
    ],
)
def test_a_wrong_shape_is_refused_with_what_it_is_and_what_was_wanted(message, field, value, wanted, got):
    with pytest.raises(ValueError, match=re.escape(f".{field} wants shape {wanted}, got {got}")):
        dataclasses.replace(message, **{field: value})


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
        dataclasses.replace(FRAME, image=image)


def test_right_shapes_are_taken():
    dataclasses.replace(BAR_POSE, corners_px=np.zeros((4, 2)))  # a target of one quadrilateral
    dataclasses.replace(TELEMETRY, velocity_in_level_mps=np.zeros(3))
    dataclasses.replace(ESTIMATE, velocity_in_bar_mps=np.zeros(3), covariance=np.eye(4))
    dataclasses.replace(FRAME, image=np.zeros((720, 1280, 3), np.uint8))


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
    seen = dataclasses.replace(
        TRUTH,
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


def test_what_a_message_holds_is_named_by_its_type():
    """From NumPy 2.5 on `NDArray[...]` is an alias, which no value can be checked against."""
    holders = [cls for cls in vars(messages).values() if dataclasses.is_dataclass(cls)]
    assert not [cls for cls in holders if "NDArray" in str(inspect.get_annotations(cls))]
    assert not re.search(r"^Array = .*NDArray", inspect.getsource(frames), re.MULTILINE)
