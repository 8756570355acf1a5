"""The configuration in words: complete, in the right words, and TOML that gives the same scenario again."""

import tomllib

import pytest

from shipland.commands.config import Config
from shipland.config import packaged_names
from shipland.errors import ConfigError
from shipland.report.configuration import as_toml, scenario_settings
from shipland.scenario.scenario import load_scenario


@pytest.mark.parametrize("name", packaged_names("scenarios"))
def test_what_is_printed_is_the_scenario_again(name, tmp_path):
    settings = scenario_settings(name)
    path = tmp_path / f"{name}.toml"
    path.write_text(as_toml(settings), encoding="utf-8")
    assert load_scenario(path) == load_scenario(name)


def test_every_key_has_a_meaning_and_says_where_its_value_comes_from(tmp_path):
    config = tmp_path / "slow.toml"
    config.write_text("[delays]\nvideo_s = 0.5 # measured\n", encoding="utf-8")
    settings = {setting.key: setting for setting in scenario_settings("frigate-sea6", config, ["wind.from_deg=20"])}
    video = settings["delays.video_s"]
    assert (video.value, video.file, video.source, video.unit) == (0.5, str(config), "", "s")
    assert video.default == 0.28 and video.meaning == "from a picture's exposure to its arrival"
    assert settings["delays.near_s"].source == "[Lee2022]: cycle time on corners" and video.bounds == "0 or more"
    assert settings["wind.from_deg"].file == "--set" and settings["wind.from_deg"].value == 20.0
    assert settings["wind.mean_mps"].file == "scenarios/frigate-sea6.toml"
    assert settings["rig.platform_length_m"].file == "parts/frigate.toml"
    assert settings["wind.profile"].file == "parts/frigate.toml"
    assert settings["detector.max_iou"].file == "default" and not settings["detector.max_iou"].differs
    # Gains of the paper's laws are letters of its equations; the class says so of all of them.
    unsaid = {key for key, setting in settings.items() if not setting.meaning}
    assert all(key.startswith(("guidance.ship.", "guidance.bar.", "guidance.far_")) for key in unsaid)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("guidance.horizon.path.near_brake_mps2", "m/s²"),
        ("aircraft.settings.max_yaw_rate_deg_s", "°/s"),
        ("aircraft.sensors.height_drift_m_per_sqrt_s", "m/√s"),
        ("geometric.corner_noise_px_per_m", "px/m"),
        ("safety.slew_percent_per_s", "%/s"),
        ("aircraft.loop.velocity_per_s", "1/s"),
        ("aircraft.airframe.body_drag_per_m", "1/m"),
        ("aircraft.airframe.mass_kg", "kg"),
        ("wind.turbulence.intensity", ""),
    ],
)
def test_the_unit_is_the_end_of_the_name(name, unit):
    (setting,) = [setting for setting in scenario_settings("near") if setting.key == name]
    assert setting.unit == unit


def test_the_command_prints_a_part_or_what_is_changed(capsys):
    assert Config(key="wind.sea").run() == 0
    printed = tomllib.loads(capsys.readouterr().out)
    assert set(printed) == {"wind"} and set(printed["wind"]) == {"sea"}
    assert Config(changes=("wind.mean_mps=5",), changed=True).run() == 0
    changed = tomllib.loads(capsys.readouterr().out)
    assert changed["wind"]["mean_mps"] == 5.0 and "from_deg" not in changed["wind"]
    with pytest.raises(ConfigError, match=r"no key begins with 'widn'; did you mean 'wind\.gust'"):
        Config(key="widn").run()
