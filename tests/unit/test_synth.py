"""Pictures from the scene: reproducible, resumable, and labelled where the target is."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shipland.errors import ConfigError, DataError
from shipland.learning.arguments import SynthArguments
from shipland.learning.dataset import read_dataset
from shipland.learning.sensor import degrade, motion_kernel
from shipland.learning.shots import draw_scene, draw_shot
from shipland.learning.synth import crop_camera, synth, synth_parameters
from shipland.sim.scene.scene import Scene
from shipland.sim.state import target_box


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("synth") / "set"
    return synth(SynthArguments(out, "ship", count=6, seed=3, crop_px=96, coco=True))


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_set_is_whole(made):
    dataset = read_dataset(made)
    assert dataset.classes == ("ship",)
    assert len(dataset.samples) == 6
    assert all(sample.load()[0].shape == (96, 96, 3) for sample in dataset.samples)
    assert [sample.scene["kind"] for sample in dataset.samples] == ["ship"] * 6
    assert all(
        (sample.scene["empty"] and not len(sample.boxes)) or not sample.scene["empty"] for sample in dataset.samples
    )
    assert len(json.loads((made / "coco.json").read_text())["images"]) == 6


def test_cut_off_run_goes_on_to_the_same_set(made):
    """Whatever is missing is made again, bit for bit; the same seed elsewhere gives the same set."""
    before = files(made)
    for name in ("labels/ship-3-000002.txt", "images/ship-3-000002.jpg", "labels/ship-3-000005.txt", "scenes.jsonl"):
        (made / name).unlink()
    synth(SynthArguments(made, "ship", count=6, seed=3, crop_px=96, coco=True))
    assert files(made) == before


def test_other_arguments_are_refused(made, tmp_path):
    with pytest.raises(DataError, match="choose another folder"):
        synth(SynthArguments(made, "ship", count=6, seed=4, crop_px=96))
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(DataError, match="is not empty"):
        synth(SynthArguments(tmp_path, "bar", count=1))


def test_a_smaller_count_takes_nothing_away(made):
    before = files(made)
    synth(SynthArguments(made, "ship", count=2, seed=3, crop_px=96))
    assert files(made) == before


def test_another_configuration_is_refused_in_the_same_folder(made, tmp_path):
    config = tmp_path / "mine.toml"
    config.write_text("[synth]\nbirds = 3.0\n")
    with pytest.raises(DataError, match="choose another folder"):
        synth(SynthArguments(made, "ship", count=6, seed=3, crop_px=96, config=config))


def test_a_set_without_a_picture_is_told_as_one(tmp_path):
    """As one whose time was spent before the first."""
    synth(SynthArguments(tmp_path / "none", "ship", count=3, minutes=1e-9))
    with pytest.raises(DataError, match="holds no picture"):
        read_dataset(tmp_path / "none")


def test_a_window_larger_than_the_picture_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"--crop-px must be 1280 or less"):
        synth(SynthArguments(tmp_path / "set", "ship", count=1, crop_px=40_000))


@pytest.mark.parametrize("kind", ["ship", "bar"])
def test_box_agrees_with_what_is_drawn(kind, rig, camera):
    """The peer is the scene's own identity pass, drawn with up to eight samples a pixel."""
    parameters = synth_parameters(None)
    light, waves = draw_scene(0, parameters, 1)
    scene = Scene(rig, light, np.random.default_rng(waves))
    compared = 0
    try:
        for number in range(25):
            shot = draw_shot(number, kind, light, camera, rig, parameters, 1)
            # The label is the platform's, whatever the deck swings out of it.
            state = replace(shot, deck_amplitude=np.zeros(6)).at(0.0, rig)
            box = None if shot.empty else target_box(kind, state, camera, rig, 0.999, parameters.least_facing)
            if box is None:
                continue
            drawn = getattr(scene.labels(state, camera), kind)
            if kind == "bar" and drawn.visible < 0.999:
                continue  # behind the superstructure's edge
            edges = np.array([drawn.left_px, drawn.top_px, drawn.right_px, drawn.bottom_px]) + 0.5
            # An eighth of a pixel of sampling on either side, and at most 2 % where the peer's picture is reduced.
            slack = 0.5 + 0.02 * max(box[2] - box[0], box[3] - box[1])
            np.testing.assert_allclose(edges, box, atol=slack)
            compared += 1
    finally:
        scene.close()
    assert compared >= 8


def test_window_is_cut_out_of_the_frame(rig, camera):
    """The window's camera sees the target where the frame's does, less the window's corner."""
    parameters = synth_parameters(None)
    light, _ = draw_scene(0, parameters, 2)
    for number in range(20):
        shot = draw_shot(number, "ship", light, camera, rig, parameters, 2)
        state = shot.at(0.0, rig)
        small = crop_camera(shot, camera, rig, parameters, 352)
        corner = (camera.matrix - small.matrix)[:2, 2]
        assert np.array_equal(corner, np.round(corner))
        frame = target_box("ship", state, camera, rig, 0.999, 0.0)
        cut = target_box("ship", state, small, rig, 0.999, 0.0)
        if frame is not None and cut is not None:
            np.testing.assert_allclose(np.array(cut) + np.tile(corner, 2), frame, atol=1e-6)


def test_ranges_and_empty_share_are_as_asked(rig, camera):
    parameters = synth_parameters(None)
    light, _ = draw_scene(0, parameters, 4)
    shots = [draw_shot(number, "ship", light, camera, rig, parameters, 4) for number in range(300)]
    ranges = np.array([shot.range_m for shot in shots])
    low, high = parameters.ship_range_m
    assert low <= ranges.min() and ranges.max() <= high
    assert np.mean(ranges > 0.6 * high) > 0.15, "far targets are too rare"
    empty = np.mean([shot.empty for shot in shots])
    assert abs(empty - parameters.empty_share) < 4 * np.sqrt(parameters.empty_share / 300)  # four standard errors


def test_empty_scene_has_no_ship_in_sight(rig, camera):
    parameters = synth_parameters(None)
    light, _ = draw_scene(0, parameters, 5)
    shots = [draw_shot(number, "ship", light, camera, rig, parameters, 5) for number in range(120)]
    empties = [shot for shot in shots if shot.empty]
    assert len(empties) > 5
    for shot in empties:
        assert target_box("ship", shot.at(0.0, rig), camera, rig, 0.001, 0.0) is None


def test_an_edge_wider_than_the_picture_leaves_its_middle(rig, camera):
    parameters = replace(synth_parameters(None), edge_px=900.0)
    light, _ = draw_scene(0, parameters, 4)
    assert draw_shot(1, "ship", light, camera, rig, parameters, 4).range_m > 0.0


def test_sensor_repeats_itself_but_for_the_grain():
    parameters = synth_parameters(None).sensor
    light = np.full((64, 96, 3), 2000, np.uint16)
    made = [
        degrade(light, parameters, np.random.default_rng(1), np.random.default_rng(grain)).astype(float)
        for grain in (2, 2, 3)
    ]
    np.testing.assert_array_equal(made[0], made[1])
    assert 0.0 < np.abs(made[0] - made[2]).mean() < 4.0 * parameters.noise_max


@pytest.mark.parametrize("angle_rad", [0.0, 0.7, 1.6, 3.0])
def test_motion_kernel_keeps_brightness_and_place(angle_rad):
    kernel = motion_kernel(5.0, angle_rad)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-5)
    rows, columns = np.mgrid[: kernel.shape[0], : kernel.shape[1]] - kernel.shape[0] // 2
    assert abs((kernel * rows).sum()) < 0.1
    assert abs((kernel * columns).sum()) < 0.1


@pytest.mark.slow
def test_two_processes_make_the_same_set(tmp_path):
    one = SynthArguments(tmp_path / "one", "ship", count=3, seed=5, crop_px=96)
    synth(one)
    synth(replace(one, out=tmp_path / "two", workers=2))
    for file in sorted((tmp_path / "one").rglob("*.*")):
        assert file.read_bytes() == (tmp_path / "two" / file.relative_to(tmp_path / "one")).read_bytes()


def test_a_window_is_drawn_to_its_edge(rig, camera):
    """Sky and sea have a sample every three pixels; the last one must be drawn whatever the width."""
    parameters = synth_parameters(None)
    scene_parameters, waves = draw_scene(0, parameters, 11)
    shot = draw_shot(1, "ship", scene_parameters, camera, rig, parameters, 11)
    scene = Scene(rig, scene_parameters, np.random.default_rng(waves))
    for side in (96, 97, 98):
        picture = scene.render(shot.at(0.0, rig), crop_camera(shot, camera, rig, parameters, side)).astype(float)
        assert abs(picture[:, -1].mean() - picture[:, -4].mean()) < 4.0, side
    scene.close()
