"""Vision and pilot over a recording again: the same give the same, others differ and it is said by how much."""

import json
import math
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_up_flight import INFO, flight, write_log

from pictures import write_film
from shipland.camera import Camera
from shipland.commands.replay import Replay
from shipland.errors import ConfigError, DataError
from shipland.evaluation.job import FlightJob, land_once
from shipland.evaluation.replays import differences, recorded_film, recorded_flight, replay
from shipland.report.viewer import Viewer
from shipland.scenario.scenario import load_scenario, scenario_table

CONFIGURATION = json.dumps(scenario_table("near"))


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "flight.mcap"
    land_once(FlightJob(load_scenario("rig-natops", time_limit_s=6.0), "horizon", "geometric", 4, path))
    return path


def test_the_same_crew_sees_and_decides_the_same(log):
    recording = recorded_flight(log)
    replayed = replay(recording)
    assert len(replayed) == len(recording.records) > 80
    assert sum(pair.after.observation.bar_pose is not None for pair in replayed) > 10
    assert np.nanmax([pair.pose_m for pair in replayed]) < 1e-9
    assert max(pair.stick_percent for pair in replayed) < 1e-9
    assert "modes differ in 0 cycles" in list(differences(replayed))


def test_another_pilot_and_other_settings_differ(log):
    other = replay(recorded_flight(log, "paper"))
    assert max(pair.stick_percent for pair in other) > 5.0
    assert not any("more than 5 % in 0 cycles" in line for line in differences(other))
    blind = replay(recorded_flight(log, changes=("geometric.max_range_m=1.0",)))
    assert all(pair.after.observation.bar_pose is None for pair in blind)
    (line,) = [line for line in differences(blind) if "in one of the two only" in line]
    assert int(line.rpartition(" ")[2]) > 10


def test_a_vision_that_wants_pictures_says_that_there_are_none(log):
    with pytest.raises(DataError, match="try --vision geometric"):
        replay(recorded_flight(log, vision="rendered"))


@pytest.mark.parametrize("option", [{"calibration": Path("camera.yaml")}, {"pitch_deg": -5.0}])
def test_what_only_a_video_wants_is_refused_for_a_log(log, option):
    with pytest.raises(ConfigError, match="are of a video"):
        Replay(log, **option).run()


def test_a_recording_is_not_written_over(log):
    before = log.read_bytes()
    for option in ("out", "viewer_file"):
        with pytest.raises(ConfigError, match=r"flight\.mcap is read here: name another file"):
            Replay(recording=log, **{option: log}).run()
    assert log.read_bytes() == before


def test_a_film_is_seen_and_decided_on(tmp_path):
    path = tmp_path / "film.mp4"
    write_film(path, (np.full((180, 320, 3), 20 * shade, np.uint8) for shade in range(5)), rate=10)
    rows = []
    scenario = load_scenario("near", delays={"processing": "zero"})
    replayed = replay(recorded_film(path, scenario, "paper", "rendered", -5.0), rows.append)
    assert list(differences(replayed)) == ["5 cycles; the bar's pose found in 0"]
    assert len(rows) == 5
    assert rows[0].frame.image is not None
    assert replayed[0].after.frame.image is None  # a film is not kept in memory


def test_a_pitch_that_is_no_number_is_one_line(tmp_path):
    with pytest.raises(ConfigError, match=r"^--pitch-deg must be -90 to 90, got nan$"):
        Replay(recording=tmp_path / "film.mp4", pitch_deg=math.nan).run()


@pytest.mark.parametrize(("size", "words"), [((640, 360), ""), ((640, 480), "give its own with --calibration")])
def test_a_film_of_another_size_has_its_camera_scaled_or_is_told_how_to_get_one(size, words, tmp_path):
    path = tmp_path / "film.avi"
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, size)
    film.write(np.full((size[1], size[0], 3), 90, np.uint8))
    film.release()
    scenario = load_scenario("near")
    with pytest.raises(DataError, match=words) if words else nullcontext():
        recording = recorded_film(path, scenario, "paper", "rendered", -5.0)
        assert recording.vehicle.camera.width_px == size[0]
    own = Camera.from_fov(*size, 60.0)
    assert recorded_film(path, scenario, "paper", "rendered", -5.0, own).vehicle.camera == own


def test_the_viewer_writes_what_was_replayed(log, tmp_path):
    pytest.importorskip("rerun", reason="wants rerun: pip install 'shipland[viewer]'")
    recording = recorded_flight(log)
    path = tmp_path / "flight.rrd"
    viewer = Viewer(recording.scenario.rig, path)
    replay(recording, viewer.show)
    viewer.close()
    assert path.stat().st_size > 10_000


def test_without_rerun_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ConfigError, match=r"shipland\[viewer\]"):
        Viewer(load_scenario("near").rig, Path("nowhere.rrd"))


@pytest.fixture
def own_code(tmp_path, monkeypatch):
    """A folder with a module that leaves a mark when it is imported, and whether it was."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    lines = ["from pathlib import Path", "from shipland.guidance.pilot import paper as pilot"]
    lines += ["from shipland.scenario.visions import geometric as vision", "Path('imported').touch()"]
    (tmp_path / "left_by_someone.py").write_text("\n".join(lines))
    yield lambda: (tmp_path / "imported").exists()
    sys.modules.pop("left_by_someone", None)


def log_of(path, pilot="paper", vision="geometric", configuration=CONFIGURATION):
    """A log of three cycles with this in its header."""
    info = replace(INFO, pilot=pilot, vision=vision, configuration=configuration)
    return write_log(path, flight(from_s=20.0, to_s=20.09, pictures=False), None, info=info)


@pytest.mark.parametrize("option", ["pilot", "vision"])
def test_code_that_a_log_names_runs_only_when_the_user_names_it(own_code, tmp_path, option):
    name = f"left_by_someone:{option}"
    log = log_of(tmp_path / "flight.mcap", **{option: name})
    with pytest.raises(ConfigError, match=rf"names code as its {option}.*give --{option} {name} to run it"):
        recorded_flight(log)
    assert not own_code()
    assert len(replay(recorded_flight(log, **{option: name}))) == 3
    assert own_code()


def test_code_that_a_logs_configuration_names_is_not_run(own_code, tmp_path):
    table = json.loads(CONFIGURATION)
    table["aircraft"]["kind"] = table["aircraft"]["loop"]["kind"] = "left_by_someone:pilot"
    replay(recorded_flight(log_of(tmp_path / "flight.mcap", configuration=json.dumps(table))))
    assert not own_code()


@pytest.mark.parametrize("text", ["{", "[1]", '{"a": ' * 500 + "1" + "}" * 500, '{"a": ' + "1" * 5000 + "}"])
def test_a_log_whose_configuration_is_broken_is_one_line(tmp_path, text):
    with pytest.raises(DataError, match="the log's configuration cannot be read"):
        recorded_flight(log_of(tmp_path / "flight.mcap", configuration=text))


def test_a_log_of_another_version_says_so_where_its_configuration_is_none_today(log, monkeypatch):
    changes = ("geometric.max_rnge_m=1.0",)
    with pytest.raises(ConfigError, match=r"^configuration.geometric: unknown key 'max_rnge_m'"):
        recorded_flight(log, changes=changes)
    monkeypatch.setattr("shipland.evaluation.replays.code_version", lambda: "9.9")
    with pytest.raises(ConfigError, match=r"was flown by version .*, this is 9\.9: configuration.geometric: unknown"):
        recorded_flight(log, changes=changes)
