"""Whole flights: they land, they repeat bit for bit, and the geometric camera stands for the rendered one."""

import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from shipland.api import fly
from shipland.config import merge
from shipland.geometric import GeometricVision
from shipland.messages import Mode, PilotCommand
from shipland.record.reader import read_log
from shipland.scenario.autonomy import build_scene, build_vehicle
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.vision.near.pipeline import NearVision


def near(**overlay):
    return load_scenario(merge(scenario_table("near"), overlay))


@pytest.mark.parametrize(("pilot", "kind"), [("paper", "velocity"), ("horizon", "attitude")])
def test_near_landing_is_inside_the_square(pilot, kind):
    """The published gains do not balance a wind with a tilt: they land where a stick is a velocity."""
    rows = []
    flown = fly_quietly(near(aircraft={"loop": {"kind": kind}}), pilot, "geometric", 3, rows.append)
    assert flown.success, flown.reason
    modes = [row.decision.mode for row in rows]
    assert [mode for mode in Mode if mode in modes] == [Mode.SEARCH, Mode.APPROACH, Mode.LAND, Mode.DONE]
    said = {row.decision.reason for row in rows if row.decision.reason.startswith("final descent at odds of")}
    assert len(said) == (pilot == "horizon"), said


_DIGEST = """
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario
scenario = load_scenario("ship-sea6", **{"aircraft.loop.kind": "%s", "wind.mean_mps": 9.0})
rows = []
fly_quietly(scenario, "horizon", "geometric", 2, rows.append)
print([[round(stick, 3) for stick in row.decision.command.sticks_percent] for row in rows])
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="names kernels of x86 processors")
@pytest.mark.parametrize("kind", ["attitude", "velocity"])
def test_a_flight_is_the_same_with_the_linear_algebra_of_another_processor(kind):
    """Gains and models differ in their last digits between processors; no flight may hang on one."""
    sticks = [
        subprocess.run(
            [sys.executable, "-c", _DIGEST % kind],
            env={**os.environ, "OPENBLAS_CORETYPE": core},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for core in ("Haswell", "Sandybridge")
    ]
    assert sticks[0] == sticks[1]


def test_pictures_alone_are_enough():
    """No velocity, attitude, height or compass: 5 m/s of wind swing the nose; only the bar tells where it points."""
    overlay = {"aircraft": {"loop": {"kind": "attitude"}}, "wind": {"mean_mps": 5.0}}
    overlay["delays"] = {"telemetry": {"profile": "none"}}
    flown = fly_quietly(load_scenario("rig-natops", **overlay), "horizon", "geometric", 10)
    assert flown.success, flown.reason


@pytest.mark.parametrize("pilot", ["p", "pid", "velocity_matching"])
def test_linear_pilots_land_in_still_air_where_a_stick_is_a_velocity(pilot):
    still = {"aircraft.loop.kind": "velocity", "wind.mean_mps": 0.0}
    scenario = load_scenario("rig-natops", start={"distance_m": 6.0, "distance_half_range_m": 0.0}, **still)
    flown = fly_quietly(scenario, pilot, "geometric", 1)
    assert flown.success, flown.reason


def test_wind_of_the_near_scenario_spreads():
    speeds = [np.linalg.norm(build_vehicle(near(), seed, None).world.truth().wind_in_ned_mps) for seed in range(1, 13)]
    assert 0.0 <= min(speeds) < 1.5 < 3.5 < max(speeds) <= 5.0


def test_the_same_seed_draws_the_same_log(without_plots, tmp_path):
    """Of a geometric camera: test_again."""
    config = tmp_path / "short.toml"
    config.write_text("time_limit_s = 0.5\nstart.distance_m = 5.0\n")  # within the reach of corners: detectors are dear
    for name in ("one", "two"):
        fly(config, vision="rendered", seed=5, out=tmp_path / name, video=False)
    assert (tmp_path / "one/flight.mcap").read_bytes() == (tmp_path / "two/flight.mcap").read_bytes()
    assert len(read_log(tmp_path / "one/flight.mcap").records) > 5


def test_geometric_camera_errs_as_the_rendered_one():
    """Both look at the same moments of hovers: both find the bar, with errors of like size."""
    hovers = [
        near(start={"distance_m": distance_m, "distance_half_range_m": 0.5, "heading_error_half_range_deg": 3.0})
        for distance_m in (3.0, 8.0)
    ]
    errors = {(scenario, name): [] for scenario in range(2) for name in ("rendered", "geometric")}
    scene = build_scene(hovers[0], 1)  # its sea and light do not depend on the start
    for number, scenario in enumerate(hovers):
        vehicle = build_vehicle(scenario, 1, scene)
        target, camera = scenario.rig.cue, vehicle.camera
        rng = np.random.default_rng(1)
        eyes = {
            "rendered": NearVision(target, camera, scenario.vision),
            "geometric": GeometricVision(vehicle, target, camera, scenario.geometric, scenario.vision, rng),
        }
        vehicle.open()
        try:
            for _ in range(6):
                frame, telemetry = vehicle.read()
                truth = vehicle.truth_at(frame.t_s)
                camera_in_bar_m = truth.ned_from_bar.inverse().apply(truth.ned_from_camera.translation_m)
                for name, each in eyes.items():
                    pose = each.see(frame).bar_pose
                    assert pose is not None, (name, number)
                    errors[number, name].append(pose.position_in_bar_m - camera_in_bar_m)
                vehicle.send(PilotCommand.hold(telemetry.t_s + 0.2, 0.0))
        finally:
            vehicle.close()
    scene.close()
    for number in range(2):
        rendered, geometric = (np.sqrt(np.mean(np.square(errors[number, name]))) for name in ("rendered", "geometric"))
        # At 3 m the rendered camera's error is a bias of 5 mm in range, left over from the edges' growth: not modelled.
        assert 0.4 < geometric / rendered < 2.0, (number, rendered, geometric)
