"""Near and far vision as one: who looks at a frame is decided by what was seen last."""

import numpy as np
import pytest

from shipland.messages import BarPose, Box, Frame, GimbalAttitude, Observation
from shipland.vision.vision import VisionSelector, VisionSelectorParameters

PARAMETERS = VisionSelectorParameters()
LEVEL = GimbalAttitude(0.0, 0.0)
POSE = BarPose(np.array([-5.0, 0.0, 0.0]), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))


class Told:
    """Vision that says what it was told to, and counts."""

    def __init__(self, **says):
        self.says, self.looks = says, 0

    def see(self, frame):
        self.looks += 1
        return Observation(frame.t_s, frame.gimbal, **self.says)


def box(width_px):
    return Box((640.0, 360.0), (width_px, 0.5 * width_px), 0.9)


def looks(near, far, times_s):
    eyes = VisionSelector(near, far, PARAMETERS)
    return [eyes.see(Frame(t_s, None, LEVEL)) for t_s in times_s]


def test_a_pose_is_enough():
    near, far = Told(bar_pose=POSE), Told(ship_box=box(100.0))
    (seen,) = looks(near, far, [0.0])
    assert seen.bar_pose is POSE
    assert not seen.learned
    assert far.looks == 0


def test_without_corners_the_detectors_look_in_the_same_cycle():
    near, far = Told(reason="no green"), Told(ship_box=box(100.0), reason="bar: not found")
    (seen,) = looks(near, far, [0.0])
    assert seen.learned
    assert seen.ship_box is not None
    assert seen.reason == "no green; bar: not found"


@pytest.mark.parametrize(
    ("boxes", "looked"),
    [
        ({"ship_box": box(PARAMETERS.corners_ship_px - 1.0)}, False),
        ({"ship_box": box(PARAMETERS.corners_ship_px + 1.0)}, True),
        ({"bar_box": box(PARAMETERS.corners_bar_px - 1.0)}, False),
        ({"bar_box": box(PARAMETERS.corners_bar_px + 1.0), "ship_box": box(20.0)}, True),
        ({}, True),
    ],
)
def test_corners_are_looked_for_where_the_boxes_say_they_are_large_enough(boxes, looked):
    near = Told(reason="no green")
    looks(near, Told(**boxes), [0.0, 0.5])
    assert near.looks == 1 + looked


def test_small_boxes_are_forgotten():
    near = Told(reason="no green")
    looks(near, Told(ship_box=box(10.0)), [0.0, 0.1 + PARAMETERS.memory_s])
    assert near.looks == 2


def test_a_few_frames_without_corners_are_no_reason_for_a_detector():
    near, far = Told(bar_pose=POSE), Told()
    eyes = VisionSelector(near, far, PARAMETERS)
    eyes.see(Frame(0.0, None, LEVEL))
    near.says = {"reason": "blurred"}
    soon = eyes.see(Frame(0.5 * PARAMETERS.patience_s, None, LEVEL))
    assert not soon.learned
    assert soon.reason == "blurred"
    assert eyes.see(Frame(1.1 * PARAMETERS.patience_s, None, LEVEL)).learned


def test_time_that_runs_back_forgets_rather_than_stalls():
    near, far = Told(bar_pose=POSE), Told()
    eyes = VisionSelector(near, far, PARAMETERS)
    eyes.see(Frame(10.0, None, LEVEL))
    near.says = {"reason": "no green"}
    assert eyes.see(Frame(1.0, None, LEVEL)).learned


def test_a_camera_that_looks_down_sees_the_deck_or_nothing():
    near, far, below = Told(bar_pose=POSE), Told(ship_box=box(100.0)), Told(reason="no deck")
    eyes = VisionSelector(near, far, PARAMETERS, below)
    steep = GimbalAttitude(0.0, -1.4)
    assert eyes.see(Frame(0.0, None, steep)).reason == "no deck"
    assert (near.looks, far.looks, below.looks) == (0, 0, 1)
    near.says = {"reason": "no green"}
    assert not eyes.see(Frame(0.1, None, LEVEL)).learned  # on its way up no detector takes half a second
    assert eyes.see(Frame(1.0, None, LEVEL)).learned
    assert VisionSelector(near, far, PARAMETERS).see(Frame(0.0, None, steep)).learned  # without such a vision
