"""The learning configuration: what is laid over it, and what is refused."""

import pytest

from shipland.errors import ConfigError
from shipland.learning.settings import train_parameters
from shipland.learning.shots import draw_scene
from shipland.learning.synth import synth_parameters
from shipland.vision.parameters import detector_parameters, learning_table


def test_a_users_file_is_laid_over_the_packaged_one(tmp_path):
    config = tmp_path / "mine.toml"
    config.write_text("[detector]\nlost_frames = 9\n[train.far]\nbatch = 3\n")
    assert detector_parameters(config).lost_frames == 9
    assert train_parameters("far", config).batch == 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[detectr]\nlost_frames = 9\n", r"unknown section \[detectr\]; did you mean \[detector\]"),
        ("[train.farr]\nbatch = 3\n", "unknown key 'farr'"),
        ("[train.far]\nbatsh = 3\n", "unknown key 'batsh'; did you mean 'batch'"),
    ],
)
def test_unknown_sections_and_keys_name_the_nearest(tmp_path, text, says):
    config = tmp_path / "mine.toml"
    config.write_text(text)
    with pytest.raises(ConfigError, match=says):
        train_parameters("far", config)


def test_every_reader_refuses_an_unknown_section(tmp_path):
    config = tmp_path / "mine.toml"
    config.write_text("[syntth]\ncount = 1\n")
    for read in (detector_parameters, lambda path: learning_table("evaluate", path)):
        with pytest.raises(ConfigError, match=r"\[synth\]"):
            read(config)


@pytest.mark.parametrize(
    "line",
    [
        "validation_pictures = 0",
        "calibration_pictures = -1",
        "clip_norm = 0.0",
        "average_decay = 1.0",
        "match_iou = 0.0",
    ],
)
def test_what_would_fail_in_the_middle_or_at_the_end_of_a_run_is_refused_before(tmp_path, line):
    config = tmp_path / "mine.toml"
    config.write_text(f"[train.far]\n{line}\n")
    with pytest.raises(ConfigError, match=line.split()[0]):
        train_parameters("far", config)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("vessels = -1.0", "vessels: expected 0 or more"),
        ("speed_mps = -1.0", "speed_mps: expected 0 or more"),
        ("sun_elevation_deg = [80.0, 3.0]", "sun_elevation_deg must be two numbers, the smaller first"),
        ("sensor.noise_max = 0.1", "noise_max: expected 0.5 or more"),
        ("sensor.gamma = [2.6, 1.8]", "gamma must be two numbers, the smaller first"),
        ("sensor.gamma = [-1.0, 1.8]", "gamma must be between 1 and 3"),
    ],
)
def test_ranges_that_cannot_be_drawn_from_are_refused(tmp_path, line, says):
    config = tmp_path / "mine.toml"
    config.write_text(f"[synth]\n{line}\n")
    with pytest.raises(ConfigError, match=says):
        synth_parameters(config)


@pytest.mark.parametrize("line", ["cloud_cover = [4.0, 5.0]", "wind_mps = [-5.0, -3.0]"])
def test_light_or_air_that_no_scene_has_is_one_line(tmp_path, line):
    config = tmp_path / "mine.toml"
    config.write_text(f"[synth]\n{line}\n")
    with pytest.raises(ConfigError, match="synth"):
        draw_scene(0, synth_parameters(config), 1)
