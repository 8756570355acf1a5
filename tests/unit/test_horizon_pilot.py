"""The chain of the pilot `horizon`: gaps in what it hears."""

import math
import warnings

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.guidance.horizon.pilot import HorizonPilot
from shipland.guidance.parameters import GuidanceParameters
from shipland.guidance.pilot import PilotSetup
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import BarPose, GimbalAttitude, Mode, Observation, Telemetry
from shipland.rig import Rig

GUIDANCE = GuidanceParameters()
LEVEL = GimbalAttitude(0.0, 0.0)


@pytest.fixture
def pilot():
    camera = Camera.from_fov(1280, 720, 69.0)
    setup = PilotSetup(GUIDANCE, Rig(), camera, np.zeros(3), ANAFI_LIKE, np.random.default_rng(1))
    return HorizonPilot(setup)


def telemetry(t_s):
    return Telemetry(t_s, 0.0, 0.0, None, 3.0, None, 90.0, 90.0, True)


def test_a_vehicle_that_was_never_heard_is_no_gap(pilot):
    never = np.float64(-math.inf)
    silent = Telemetry(0.0, None, None, None, None, None, None, None, True, never, never, never, never)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(2):
            decision = pilot.decide(Observation(never, LEVEL), silent)
    assert decision.mode is Mode.SEARCH
    assert "nothing heard" not in decision.reason


def test_after_a_gap_the_position_is_found_anew(pilot):
    pose = BarPose(np.array([-8.0, 0.0, 0.0]), 0.0, np.eye(4) * 1e-6, 0.1, np.zeros((8, 2)))
    for index in range(60):
        t_s = index / 30.0
        decision = pilot.decide(Observation(t_s, LEVEL, pose), telemetry(t_s + 0.1))
    assert decision.estimate is not None
    decision = pilot.decide(Observation(5.0, LEVEL, pose), telemetry(5.1))
    assert decision.estimate is None
