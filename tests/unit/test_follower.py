"""The deck follower: its sticks ask for the deck's own tilt, and only while landing low."""

import math

import numpy as np
import pytest

from shipland.frames import Pose
from shipland.messages import Decision, GimbalAttitude, GroundTruth, Mode, Observation, PilotCommand, Telemetry
from shipland.scenario.follower import DeckFollower
from shipland.scenario.scenario import FollowParameters

MAX_TILT_RAD = math.radians(15.0)
STILL = Pose.identity()


class GroundTruthSource:
    def __init__(self, roll_deg, pitch_deg, height_m, heading_deg=0.0):
        deck = Pose.from_euler((0.0, 0.0, 0.0), math.radians(roll_deg), math.radians(pitch_deg), 0.0)
        body = Pose.from_euler((0.0, 0.0, -height_m), 0.0, 0.0, math.radians(heading_deg))
        self.truth = GroundTruth(0.0, body, np.zeros(3), STILL, deck, STILL, STILL, np.zeros(3))

    def truth_at(self, t_s):
        return self.truth

    def verdict(self):
        return None


class Lands:
    mode = Mode.LAND

    def decide(self, observation, telemetry, sent):
        return Decision(PilotCommand(telemetry.t_s, 0.0, 0.0, -50.0, 0.0, 0.0), self.mode, "")


def sticks(truth_source, pilot=None):
    follower = DeckFollower(pilot or Lands(), truth_source, MAX_TILT_RAD, FollowParameters(True, 0.5))
    telemetry = Telemetry(0.0, 0.0, 0.0, None, None, None, None, None, True)
    command = follower.decide(Observation(0.0, GimbalAttitude(0.0, 0.0)), telemetry, None).command
    return command.pitch_percent, command.roll_percent


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "heading_deg", "tilt_deg"),
    [
        (6.0, 0.0, 0.0, (0.0, 6.0)),  # starboard down asks for starboard down
        (0.0, 3.0, 0.0, (-3.0, 0.0)),  # bow up for nose up
        (6.0, 0.0, 90.0, (6.0, 0.0)),  # turned, the low side is ahead of it
    ],
)
def test_the_decks_tilt_is_asked_for_in_the_aircrafts_own_axes(roll_deg, pitch_deg, heading_deg, tilt_deg):
    asked = sticks(GroundTruthSource(roll_deg, pitch_deg, 0.3, heading_deg))
    assert asked == pytest.approx([100.0 * each / 15.0 for each in tilt_deg], abs=0.5)


def test_not_from_high_up_and_not_in_another_mode():
    assert sticks(GroundTruthSource(6.0, 3.0, 0.9)) == (0.0, 0.0)
    approaching = Lands()
    approaching.mode = Mode.APPROACH
    assert sticks(GroundTruthSource(6.0, 3.0, 0.3), approaching) == (0.0, 0.0)


def test_no_truth_no_following():
    truth_source = GroundTruthSource(6.0, 3.0, 0.3)
    truth_source.truth = None
    assert sticks(truth_source) == (0.0, 0.0)
