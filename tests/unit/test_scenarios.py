"""Scenarios: by name, by file, with changes; what comes out is whole and reads back."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from shipland.config import packaged_names
from shipland.errors import ConfigError
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.scenario import load_scenario, scenario_table

EXAMPLES = Path(__file__).parents[2] / "examples"
THREE_QUADS = {
    "rig.polygon": [
        {"corners_m": [[x - 0.15, -0.12], [x + 0.15, -0.12], [x + 0.15, 0.12], [x - 0.15, 0.12]]}
        for x in (-0.7, -0.1, 0.65)
    ],
    "rig.manufacturing_tolerance": 0.001,
}


@pytest.mark.parametrize("name", packaged_names("scenarios"))
def test_packaged_scenarios_load_pickle_and_read_back(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert load_scenario(scenario.table()) == scenario
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_the_printed_examples_are_laid_over_a_scenario():
    ours = load_scenario("near")
    law, eyes = (
        load_scenario(scenario_table("near", EXAMPLES / f"{name}.toml"))
        for name in ("near_printed", "near_vision_printed")
    )
    assert (ours.guidance.approach.landing_rule, law.guidance.approach.landing_rule) == ("steady", "printed")
    assert law.guidance.near.derivative == "printed"
    assert all(getattr(law.guidance.near, axis).error_limit > 1e6 for axis in ("pitch", "roll", "heave", "yaw"))
    assert (ours.vision.quads, ours.vision.screen) == ("hull", "tolerant")
    assert (eyes.vision.quads, eyes.vision.screen) == ("bounding", "printed")
    assert eyes.vision.hue == ours.vision.hue


def test_an_own_scenario_needs_nothing_but_what_it_changes(tmp_path):
    path = tmp_path / "harbour.toml"
    path.write_text("[wind]\nmean_mps = 3.0\n")
    scenario = load_scenario(path)
    assert (scenario.name, scenario.wind.mean_mps) == ("harbour", 3.0)
    assert scenario.time_limit_s > 0.0


def test_overrides_nest_or_are_dotted():
    dotted = load_scenario("near", **{"wind.mean_mps": 5.0, "ship.motion": "sea"})
    assert dotted == load_scenario("near", wind={"mean_mps": 5.0}, ship={"motion": "sea"})
    assert dotted == load_scenario(scenario_table("near", None, ["wind.mean_mps=5", "ship.motion=sea"]))


def test_a_wrong_scenario_is_named():
    with pytest.raises(ConfigError, match=r"no scenario 'nea'; there are: .*near"):
        load_scenario("nea")


def test_an_own_cue_is_what_the_rig_shows():
    rig = load_scenario("near", **THREE_QUADS).rig
    assert rig.cue.count == 3
    assert rig.cue.manufacturing_tolerance == 0.001
    assert rig.board_size_m == pytest.approx((1.74, 0.30))  # the cue and 2 cm around it; as high as the board was


def test_own_factories_are_given_the_setup():
    scenario = load_scenario("near")
    vehicle = build_vehicle(scenario, 1, None)
    seen = []
    autonomy = build_autonomy(scenario, vehicle, lambda setup: seen.append(setup), lambda setup: seen.append(setup), 1)
    assert autonomy.pilot is None
    pilot, vision = seen
    assert pilot.rig is scenario.rig
    assert pilot.rng.random() != vision.near_rng.random()
    assert np.array_equal(pilot.camera.matrix, vision.camera.matrix)


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        ({"rig.deck_size_m": 5.0}, ("rig.deck_size_m", "rig.platform_width_m")),
        ({"rig.deck_size_m": 1.6}, ("rig.deck_size_m", "rig.deck_ahead_of_stern_m")),
        ({"rig.board_width_m": 2.8}, ("rig.board_width_m", "rig.platform_width_m")),
        ({"rig.bar_height_m": 1.7}, ("rig.bar_height_m", "rig.superstructure_height_m")),
        ({"rig.bar_ahead_of_stern_m": 3.2}, ("rig.bar_ahead_of_stern_m", "rig.platform_length_m")),
        ({"start.distance_m": 450.0}, ("start.distance_m", "safety.fence_distance_m")),
        ({"start.height_m": 70.0}, ("start.height_m", "safety.fence_height_m")),
        ({"safety.floor_m": 1.3}, ("guidance.approach.hover_height_m", "safety.floor_m")),
        ({"safety.bar_clearance_m": 2.5}, ("safety.bar_clearance_m", "rig.bar_ahead_of_stern_m")),
        ({"camera.horizontal_fov_deg": 30.0}, ("rig.rectangle_width_m", "camera.horizontal_fov_deg")),
        ({"camera.gimbal_min_rad": 0.0}, ("guidance.approach.hover_height_m", "camera.gimbal_min_rad")),
    ],
)
def test_contradictions_between_sections_name_both_keys(changes, keys):
    with pytest.raises(ConfigError) as caught:
        load_scenario("near", **changes)
    assert all(key in str(caught.value) for key in keys), caught.value
