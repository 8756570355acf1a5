"""What a vision is shown before a flight."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pictures import Look, bar_picture, camera_from_bar
from shipland.camera import Camera
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.rig import Rig
from shipland.scenario.real_vehicle import rehearse_vision
from shipland.scenario.scenario import load_scenario
from shipland.vision.near.pipeline import NearVision
from shipland.vision.parameters import VisionParameters
from shipland.vision.rehearsal import rehearse

CAMERA = Camera.from_fov(1280, 720, 69.0)


class Watched:
    """A vision whose reasons are kept; None for a pose."""

    def __init__(self, vision):
        self.vision, self.seen = vision, []

    def see(self, frame):
        observation = self.vision.see(frame)
        self.seen.append(None if observation.bar_pose else observation.reason)
        return observation


@pytest.mark.parametrize("hue", [None, (75, 105), (170, 10), "white"])
def test_poses_and_refusals_of_several_kinds_whatever_the_light(hue):
    cue = replace(Rig().cue, hue=hue)
    watched = Watched(NearVision(cue, CAMERA, VisionParameters()))
    rehearse(watched, cue, CAMERA)
    assert watched.seen.count(None) >= 8
    assert len(set(watched.seen)) >= 3


def test_a_flight_after_it_sees_what_it_would_have_seen(rng):
    where = np.array([-4.0, 0.3, 0.0])
    picture = bar_picture(Rig().cue, CAMERA, camera_from_bar(where, 0.0), rng, Look(0.5, 1.0))
    fresh, rehearsed = (NearVision(Rig().cue, CAMERA, VisionParameters()) for _ in range(2))
    rehearse(rehearsed, Rig().cue, CAMERA)
    one, other = (vision.see(Frame(0.0, picture, GimbalAttitude(0.0, 0.0))).bar_pose for vision in (fresh, rehearsed))
    assert np.array_equal(one.position_in_bar_m, other.position_in_bar_m)
    assert np.array_equal(one.covariance, other.covariance)


def test_only_a_vision_that_takes_pictures_is_rehearsed():
    seen = []

    def own(setup):
        return Watched(SimpleNamespace(see=lambda frame: seen.append(frame.image) or Observation(0.0, frame.gimbal)))

    rehearse_vision(load_scenario("near"), own, None)
    assert len(seen) >= 20
    assert all(picture.shape == (720, 1280, 3) for picture in seen)
    rehearse_vision(load_scenario("near"), "geometric", None)  # which would ask the vehicle for the truth
