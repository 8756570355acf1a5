"""At full scale: a frigate's flight deck, parts of scenarios, contacts anywhere on a large deck."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.commands.options import ship_and_camera_of
from shipland.errors import ConfigError, DataError
from shipland.frames import Pose
from shipland.guidance.horizon.estimator import Estimator
from shipland.learning.arguments import SynthArguments
from shipland.learning.dataset import read_dataset
from shipland.learning.shots import draw_scene, draw_shot
from shipland.learning.synth import synth, synth_parameters
from shipland.messages import Box, GimbalAttitude, Observation, PilotCommand, Telemetry
from shipland.report.chase import look_at
from shipland.rig import layout
from shipland.scenario.autonomy import build_world, drawn_ship, response_of
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.scene import frigate, mesh
from shipland.sim.scene.scene import Scene
from shipland.sim.ship.ship import build_ship
from shipland.sim.state import SceneState, target_box
from worlds import come_down

EXAMPLES = Path(__file__).parents[2] / "examples"
SEA5 = load_scenario("frigate-sea5")
QUIET = {"ship.motion": "still", "ship.course.kind": "still", "wind.mean_mps": 0.0}


def test_parts_lie_under_the_scenario_that_names_them(tmp_path):
    assert (SEA5.aircraft.airframe.mass_kg, SEA5.rig.platform_length_m, SEA5.wind.mean_mps) == (25.0, 136.0, 10.0)
    path = tmp_path / "tug.toml"
    path.write_text('parts = ["octo25"]\n[aircraft.settings]\nmax_speed_mps = 12.0\n')
    tug = load_scenario(path)
    assert (tug.aircraft.airframe.mass_kg, tug.aircraft.settings.max_speed_mps) == (25.0, 12.0)
    path.write_text('parts = ["octo24"]\n')
    with pytest.raises(ConfigError, match=r"parts/octo24.*frigate, octo25"):
        scenario_table(path)
    path.write_text('parts = "octo25"\n')
    with pytest.raises(ConfigError, match="parts must be a list"):
        scenario_table(path)


def test_the_deck_is_part_of_a_hull_that_floats():
    boxes = layout(SEA5.rig)
    assert boxes.hull.low_m[2] == pytest.approx(0.1)  # up to the underside of the deck
    assert boxes.hull.high_m[2] == SEA5.rig.deck_height_m  # down to the sea
    assert boxes.house.low_m[2] == -6.0
    assert boxes.house.low_m[0] > 0.5 * SEA5.rig.deck_size_m


def test_waves_move_the_deck_at_full_scale():
    """Sway and heave, significant single amplitudes, of docs/results/ship-motion.md for sea state 5 off the bow."""
    ships = [build_ship(SEA5.ship, SEA5.rig, np.random.default_rng(seed)) for seed in range(12)]
    rows = np.array([ship.at(float(t_s)).deck.displacement for ship in ships for t_s in range(0, 400, 2)])
    assert 2.0 * np.std(rows[:, 1:3], axis=0) == pytest.approx([1.19, 1.63], rel=0.12)
    assert float(ships[0].at(1.0).course.velocity_in_ned_mps[0]) == pytest.approx(5.14)


def test_a_touchdown_far_from_the_deck_centre_is_judged():
    start = {
        "start.distance_m": 5.0,
        "start.bearing_half_range_deg": 0.0,
        "start.height_m": 1.2,
        "start.height_half_range_m": 0,
    }
    changes = {**QUIET, **start, "start.bearing_deg": 50.0}
    world = build_world(load_scenario(scenario_table("frigate-sea3"), **changes), 1)
    come_down(world, percent=-20.0)
    verdict = world.verdict()
    assert verdict is not None
    assert verdict.landed, verdict.reason
    assert verdict.reason.startswith("landed outside the circle")
    assert math.hypot(*verdict.touchdown_in_deck_m) == pytest.approx(5.0, abs=0.3)


def test_octo25_answers_its_sticks_as_its_response_says():
    world, response = build_world(load_scenario(scenario_table("frigate-sea3"), **QUIET), 2), response_of(SEA5)
    assert response.kind == "velocity"
    speeds = []
    for _ in range(120):
        world.command(PilotCommand(world.t_s, 20.0, 0.0, 0.0, 0.0, 0.0))
        world.advance(world.t_s + 0.1)
        speeds.append(math.hypot(*world.truth().velocity_in_ned_mps[:2]))
    assert np.mean(speeds[-30:]) == pytest.approx(0.2 * response.max_speed_mps, abs=0.3)
    assert max(speeds) < 0.25 * response.max_speed_mps


def test_a_shorter_bar_is_a_file_laid_over_it():
    scenario = load_scenario(scenario_table("frigate-sea3", EXAMPLES / "short_bar.toml"))
    assert scenario.rig.board_size_m == (3.0, 0.65)
    assert scenario.geometric.max_range_m == 0.5 * SEA5.geometric.max_range_m
    for each in (SEA5, scenario):  # farther off the ship's heading would never be known
        assert each.guidance.horizon.path.stand_off_m < 0.7 * each.geometric.max_range_m


def test_from_the_quarter_a_ship_counts_as_no_wider_than_its_stern():
    """A frigate 15° off astern, 3 km away: 49 m of it show."""
    camera, rig, horizon = Camera.from_parameters(SEA5.camera), SEA5.rig, SEA5.guidance.horizon
    px_per_m = camera.focal_px / 3000.0
    box = Box((959.5, 545.0), (49.0 * px_per_m, 12.0 * px_per_m), 0.9)
    seen = Observation(0.0, GimbalAttitude(0.0, 0.0), None, None, box)
    for as_stern, expected_m in ((True, 3000.0), (False, 3000.0 * math.sqrt(14.0 / 49.0))):
        measured = replace(horizon.measured, ship_as_stern=as_stern)
        estimator = Estimator(replace(horizon, measured=measured), response_of(SEA5), rig, camera, np.zeros(3))
        estimator.take(seen, Telemetry(0.1, flying=True))
        estimate = estimator.estimate(0.1)
        assert estimate is not None
        assert math.hypot(*estimate.place_m) == pytest.approx(expected_m, rel=0.01)


def test_it_lands_on_the_frigate():
    near = load_scenario(
        scenario_table("frigate-sea4"),
        **{"start.distance_m": 35.0, "start.height_m": 12.0, "start.height_half_range_m": 1.0},
    )
    flown = fly_quietly(near, "horizon", "geometric", 3)
    assert flown.verdict is not None, flown.reason
    assert flown.verdict.landed, flown.reason
    assert flown.verdict.in_square, flown.reason


def test_the_frigate_is_drawn_outside_out_and_higher_than_its_boxes():
    parts = layout(SEA5.rig)
    hull, works = frigate.hull(parts), frigate.upperworks(SEA5.rig, parts)
    for made in (hull, works):
        corners = made[:, 0:3].reshape(-1, 3, 3).astype(float)
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.sum(facing * made[::3, 3:6], axis=1) > -1e-6).all()  # counter-clockwise, seen from outside
    around = mesh.bounds(hull)
    assert (around.low_m[0], around.high_m[0]) == pytest.approx((-14.0, 122.0))
    assert around.low_m[2] == pytest.approx(parts.hull.low_m[2] - 3.6)  # the stem
    assert mesh.bounds(works).low_m[2] < parts.house.low_m[2] - 10.0  # the mast
    middle = hull[np.abs(hull[:, 1]) < 0.5]
    assert middle[:, 0].max() > 121.0  # both sides meet at the stem


def test_a_ship_under_way_leaves_a_wake():
    place = SEA5.start.height_m
    camera = Camera.from_fov(640, 360, 69.0)
    ship = drawn_ship(SEA5, 1).at(3.0)
    eye_m = ship.ned_from_ship.apply(np.array([-160.0, 0.0, -place]))
    state = SceneState(
        t_s=3.0,
        ned_from_camera=look_at(eye_m, ship.ned_from_ship.apply(np.array([-60.0, 0.0, 0.0]))),
        ned_from_ship=ship.ned_from_hull,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_body=Pose(np.eye(3), eye_m),
        camera_velocity_in_ned_mps=np.zeros(3),
        camera_rate_in_camera_rad_s=np.zeros(3),
    )
    water = state.ned_from_camera.inverse().apply(ship.ned_from_ship.apply(np.array([[-40.0, 0.0, 6.0]])))
    column, row = np.rint(camera.project(water)[0]).astype(int)
    bright = []
    for strength in (0.0, 1.0):
        scene = Scene(SEA5.rig, replace(SEA5.scene, wake=strength), np.random.default_rng(1))
        bright.append(float(scene.render(state, camera)[row - 4 : row + 5, column - 4 : column + 5].mean()))
        scene.close()
    assert bright[1] > bright[0] + 40.0


def test_pictures_to_train_on_are_of_the_ship_asked_for(tmp_path):
    """The label is as wide as a frigate at its range in this camera, and one folder holds one ship."""
    config, drawn = EXAMPLES / "frigate_pictures.toml", ship_and_camera_of("frigate-sea5")
    arguments = SynthArguments(tmp_path / "set", "ship", count=4, seed=2, crop_px=352, config=config)
    samples = read_dataset(synth(arguments, drawn)).samples
    far = next(it for it in samples if len(it.boxes) and it.scene["range_m"] > 500.0)
    focal_px = Camera.from_parameters(drawn.camera).matrix[0, 0]
    turned_rad = math.radians(abs(far.scene["aspect_deg"]))
    across_m = 136.0 * abs(math.sin(turned_rad)) + 14.0 * abs(math.cos(turned_rad))
    on_axis_px = focal_px * across_m / far.scene["range_m"]
    assert 0.9 * on_axis_px < far.load()[1][0, 3] < 1.6 * on_axis_px  # 35° off the axis stretch by 1.5
    with pytest.raises(DataError, match="choose another folder"):
        synth(arguments)
    with pytest.raises(ConfigError, match="no scenario 'frigat'"):
        ship_and_camera_of("frigat")


def test_a_picture_without_the_ship_has_none_behind_it_however_far_it_was_drawn():
    drawn = ship_and_camera_of("frigate-sea5")
    camera = Camera.from_parameters(drawn.camera)
    parameters = replace(synth_parameters(EXAMPLES / "frigate_pictures.toml"), uniform_share=1.0, empty_share=1.0)
    light, _ = draw_scene(0, replace(parameters, visibility_m=(1e5, 2e5), hazy=0.0), 5)
    shots = [draw_shot(number, "ship", light, camera, drawn.rig, parameters, 5) for number in range(40)]
    assert max(shot.range_m for shot in shots) > 5000.0
    for shot in shots:
        assert target_box("ship", shot.at(0.0, drawn.rig), camera, drawn.rig, 0.001, 0.0) is None
