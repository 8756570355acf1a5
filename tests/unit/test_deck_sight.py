"""A sight of the deck, as pilots that look down fly on: what safety and border make of it."""

import math

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.messages import BarPose, DeckSight, Frame, GimbalAttitude, Observation, Telemetry
from shipland.rig import Rig
from shipland.safety.estimate import SafetyEstimator
from shipland.safety.input_gate import InputGate

DOWN = GimbalAttitude(0.0, -1.48)
SIGHT = DeckSight(np.array([-0.1, 0.2, 0.7]), np.full(3, 0.004))


def test_the_safety_takes_a_sight_of_the_deck_for_a_place():
    rig = Rig()
    estimator = SafetyEstimator(rig, Camera.from_fov(1280, 720, 69.0), np.array([0.09, 0.0, 0.0]))
    telemetry = Telemetry(1.0, 0.0, 0.0, 0.0, 2.0, None, 80.0, 80.0, True)
    seen = Observation(0.8, DOWN, deck=SIGHT)
    blind = estimator.updated(seen, telemetry)
    assert blind.place_in_bar_m is None  # whoever never saw the bar does not know where it is
    pose = BarPose(np.array([-3.0, 0.0, 0.0]), 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2)))
    estimator.updated(Observation(0.7, DOWN, bar_pose=pose), telemetry)
    after = estimator.updated(seen, telemetry)
    assert after.pose_s == 0.8
    assert after.place_in_bar_m == pytest.approx(rig.deck_in_bar_m - [-0.01, 0.2, 0.7])
    assert after.over_deck_at(1.0, 1.5) == pytest.approx(0.7)


@pytest.mark.parametrize(
    "sight",
    [
        DeckSight(np.array([math.nan, 0.0, 1.0]), np.ones(3)),
        DeckSight(np.zeros(3), np.array([0.01, math.inf, 0.01])),
        DeckSight(np.zeros(3), np.array([0.01, -0.01, 0.01])),
    ],
)
def test_the_border_refuses_what_is_no_sight(sight):
    camera, frame = Camera.from_fov(1280, 720, 69.0), Frame(1.0, None, DOWN)
    admitted = InputGate().observation(Observation(1.0, DOWN, deck=sight), frame, camera)
    assert admitted.deck is None
    assert "sight of the deck refused" in admitted.reason
    good = Observation(1.0, DOWN, deck=SIGHT)
    assert InputGate().observation(good, frame, camera) is good
