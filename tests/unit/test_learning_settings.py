"""The learning configuration: what is laid over it, and what is refused."""

import pytest

from shipland.errors import ConfigError
from shipland.learning.settings import train_parameters
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
