"""The one place where a vision that raises becomes an observation, and that nothing else hides a fault."""

import logging

import numpy as np
import pytest

from shipland import factories
from shipland.camera import Camera
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.rig import Rig
from shipland.scenario.scenario import load_scenario
from shipland.scenario.visions import VisionSetup, needs_pictures
from shipland.vision.near.pipeline import NearVision
from shipland.vision.parameters import VisionParameters
from shipland.vision.vision import VisionSelector, VisionSelectorParameters, see_or_degrade

FRAME = Frame(1.5, None, GimbalAttitude(0.0, -0.2))


class Broken:
    """A vision with a programming error."""

    def see(self, frame):
        return [][1]


class Sound:
    """A vision without one."""

    def see(self, frame):
        return Observation(frame.t_s, frame.gimbal, reason="nothing")


@pytest.mark.vision_fails
def test_in_flight_a_vision_that_raises_costs_its_frame_and_is_logged(caplog):
    with caplog.at_level(logging.ERROR):
        seen = see_or_degrade(Broken(), FRAME)
    assert seen.bar_pose is None
    assert seen.t_s == FRAME.t_s
    assert seen.reason == "vision failed: IndexError: list index out of range"
    assert "Traceback" in caplog.text
    assert see_or_degrade(Sound(), FRAME).reason == "nothing"


@pytest.mark.parametrize(("near", "far"), [(Broken(), Sound()), (Sound(), Broken())])
def test_the_selector_hides_no_fault(near, far):
    with pytest.raises(IndexError):
        VisionSelector(near, far, VisionSelectorParameters()).see(FRAME)


def test_the_published_vision_is_the_rendered_one_with_the_published_steps(monkeypatch):
    monkeypatch.setattr("shipland.vision.far.far.FarVision.load", lambda *_: Sound())
    made, rng = [], np.random.default_rng(1)
    for module, name in (("pipeline", "NearVision"), ("published", "published_vision")):
        monkeypatch.setattr(f"shipland.vision.near.{module}.{name}", lambda *given, name=name: made.append(name))
    scenario = load_scenario("near")
    for vision in ("published", "rendered"):
        factory = factories.resolve("visions", vision)
        assert needs_pictures(factory)
        factory(VisionSetup(scenario, Camera.from_parameters(scenario.camera), None, rng, rng))
    assert made == ["published_vision", "NearVision"]


def test_near_vision_hides_no_fault(monkeypatch):
    eyes = NearVision(Rig().cue, Camera.from_fov(96, 64, 30.0), VisionParameters())
    monkeypatch.setattr("shipland.vision.near.pipeline.NearVision._look", lambda *_, **__: [][1])
    with pytest.raises(IndexError):
        eyes.see(Frame(0.0, np.zeros((64, 96, 3), np.uint8), GimbalAttitude(0.0, 0.0)))
