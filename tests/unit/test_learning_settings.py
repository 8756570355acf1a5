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


def far(config):
    return train_parameters("far", config)


def scene(config):
    return draw_scene(0, synth_parameters(config), 1)


SMALLER_FIRST = "must be two numbers, the smaller first"


@pytest.mark.parametrize(
    ("read", "section", "line", "says"),
    [
        (far, "detectr", "lost_frames = 9", r"unknown section \[detectr\]; did you mean \[detector\]"),
        (far, "train.farr", "batch = 3", "unknown key 'farr'"),
        (far, "train.far", "batsh = 3", "unknown key 'batsh'; did you mean 'batch'"),
        (detector_parameters, "syntth", "count = 1", r"\[synth\]"),
        (lambda config: learning_table("evaluate", config), "syntth", "count = 1", r"\[synth\]"),
        # What would fail in the middle or at the end of a run.
        (far, "train.far", "validation_pictures = 0", "validation_pictures"),
        (far, "train.far", "calibration_pictures = -1", "calibration_pictures"),
        (far, "train.far", "clip_norm = 0.0", "clip_norm"),
        (far, "train.far", "average_decay = 1.0", "average_decay"),
        (far, "train.far", "match_iou = 0.0", "match_iou"),
        # Ranges that cannot be drawn from, light and air that no scene has.
        (synth_parameters, "synth", "vessels = -1.0", "vessels: expected 0 or more"),
        (synth_parameters, "synth", "speed_mps = -1.0", "speed_mps: expected 0 or more"),
        (synth_parameters, "synth", "sun_elevation_deg = [80.0, 3.0]", f"sun_elevation_deg {SMALLER_FIRST}"),
        (synth_parameters, "synth", "sensor.noise_max = 0.1", "noise_max: expected 0.5 or more"),
        (synth_parameters, "synth", "sensor.gamma = [2.6, 1.8]", f"gamma {SMALLER_FIRST}"),
        (synth_parameters, "synth", "sensor.gamma = [-1.0, 1.8]", "gamma must be between 1 and 3"),
        (scene, "synth", "cloud_cover = [4.0, 5.0]", "synth"),
        (scene, "synth", "wind_mps = [-5.0, -3.0]", "synth"),
    ],
)
def test_what_no_run_can_use_is_refused_before_it_by_name(read, section, line, says, tmp_path):
    config = tmp_path / "mine.toml"
    config.write_text(f"[{section}]\n{line}\n")
    with pytest.raises(ConfigError, match=says):
        read(config)
