"""The examples run as they stand, and an own cue flies to a landing."""

import importlib
from pathlib import Path

import numpy as np
import pytest

import shipland
from pictures import Look, bar_picture, camera_from_bar
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.scenario.autonomy import build_scene, build_vehicle
from shipland.vision.near.pipeline import NearVision

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def in_the_examples(monkeypatch):
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.syspath_prepend(EXAMPLES)


def test_own_pilot_lands():
    flight = shipland.fly("near", pilot="own_pilot:patient", seed=3)
    assert flight.success, flight.reason


def test_own_rival_lands():
    scenario = shipland.load_scenario("near", **{"aircraft.loop.kind": "velocity"})
    flight = shipland.fly(scenario, pilot="own_rival:proportional", seed=3)
    assert flight.success, flight.reason


def test_own_vision_sees():
    scenario = shipland.load_scenario("near", time_limit_s=0.5)
    flight = shipland.fly(scenario, vision="own_vision:green_box", seed=3)
    assert any(record.observation.bar_pose is not None for record in flight.records)


def test_own_vision_gives_a_box_where_corners_are_too_small(rig, camera, rng):
    own_vision = importlib.import_module("own_vision")

    image = bar_picture(rig.cue, camera, camera_from_bar((-6.0, 0.3, 0.0), 0.0), rng, Look(0.4, 1.0))

    class NoCorners:
        def see(self, frame):
            return Observation(frame.t_s, frame.gimbal, reason="no corners")

    box = own_vision.GreenBox(NoCorners()).see(Frame(0.0, image, GimbalAttitude(0.0, 0.0))).bar_box
    assert box is not None
    assert 10.0 < box.size_px[0] < 400.0


def test_own_cue_flies_to_a_landing():
    flight = shipland.fly("own_cue.toml", pilot="horizon", seed=2)
    assert flight.scenario.rig.cue.count == 3
    assert flight.success, flight.reason


def test_own_cue_is_drawn_and_seen():
    # From 5 m, where the cue settles the whole pose.
    near = {"distance_m": 5.0, "distance_half_range_m": 0.0, "heading_error_half_range_deg": 0.0}
    scenario = shipland.load_scenario("own_cue.toml", start=near)
    scene = build_scene(scenario, 1)
    vehicle = build_vehicle(scenario, 1, scene)
    vehicle.open()
    frame, _ = vehicle.read()
    truth = vehicle.truth_at(frame.t_s)
    pose = NearVision(scenario.rig.cue, vehicle.camera, scenario.vision).see(frame).bar_pose
    scene.close()
    assert pose is not None
    true_m = (truth.ned_from_bar.inverse() @ truth.ned_from_camera).translation_m
    off_m = pose.position_in_bar_m - true_m
    assert off_m @ np.linalg.solve(pose.covariance[:3, :3], off_m) < 21.1  # 99.99 % of χ² with three degrees
    assert np.linalg.norm(off_m) < 0.2  # m, at 7 m
    assert len(pose.corners_px) == 12


def test_campaign_in_python():
    done = importlib.import_module("campaign").main(seeds=2, time_limit_s=1.0)
    assert all(len(each.landings) == 2 for each in done.values())
