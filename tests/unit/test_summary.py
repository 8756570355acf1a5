"""The figures of a flight, and the recorder that leaves everything in a folder."""

import dataclasses
import json
import math
import threading

import numpy as np
import pytest
from made_up_flight import CAMERA, INFO, RIG, TOUCHDOWN_S, VERDICT, flight, log_of, truth_at

from shipland.errors import DataError
from shipland.frames import euler_from_rotation
from shipland.messages import Estimate, Observation
from shipland.record.reader import read_log
from shipland.record.writer import LogWriter
from shipland.report.outputs import Recorder
from shipland.report.summary import kinds_of, summarise, write_json
from shipland.report.video import VideoParameters


@pytest.fixture(scope="module")
def whole():
    return log_of(flight(pictures=False))


def test_figures_of_the_made_up_flight(whole):
    summary = summarise(whole, "on the deck")
    flown = [summary[name] for name in ("scenario", "seed", "pilot", "end")]
    assert flown == ["made-up", 7, "paper", "on the deck"]
    assert summary["time_to_land_s"] == TOUCHDOWN_S
    assert summary["touchdown_error_m"] == pytest.approx(0.05)  # 4 cm ahead, 3 cm to port
    assert summary["touchdown"] is VERDICT
    assert summary["mode_changes"] == 5
    assert sum(summary["time_per_mode_s"].values()) == pytest.approx(summary["flight_time_s"])
    # 2 s, then 7 s, 4 s, 18.5 s and 2.5 s, as the made-up flight has it
    assert summary["time_per_mode_s"]["TRACK_SHIP"] == pytest.approx(7.0)
    assert summary["time_per_mode_s"]["LAND"] == pytest.approx(2.5, abs=0.04)
    assert summary["cycles"] == summary["cycles_with_pose"] + sum(summary["refusals"].values()) == len(whole.records)
    assert summary["cycles_with_bar_box"] == 8  # 4 s at 2 Hz
    assert summary["cycles_with_ship_box"] == 14
    assert summary["max_deck_roll_deg"] == pytest.approx(8.0, abs=0.01)
    assert summary["max_deck_pitch_deg"] == pytest.approx(3.0, abs=0.01)
    assert summary["max_deck_heave_m"] == pytest.approx(0.25, abs=0.001)
    assert summary["max_stick_percent"] == 50.0


def test_errors_against_truth_are_the_noise_that_was_put_in(whole):
    summary = summarise(whole)
    # 1 cm and 0.01 rad, 660 samples: the root mean square has a standard error of 1/√1320 = 2.8 %; four of them
    for error, count in ((summary["camera_error"], 660), (summary["aircraft_error"], 660)):
        assert error["count"] == count
        for rms_m in (error["rms_forward_m"], error["rms_right_m"], error["rms_down_m"]):
            assert rms_m == pytest.approx(0.01, rel=0.12)
        assert error["rms_yaw_deg"] == pytest.approx(math.degrees(0.01), rel=0.12)
        assert abs(error["mean_forward_m"]) < 4.0 * 0.01 / math.sqrt(count)
        assert 0.02 < error["max_distance_m"] < 0.06


def test_without_truth_there_is_no_error_and_the_estimate_stands_in(whole):
    blind = log_of(flight(pictures=False, witnessed=False), None)
    summary = summarise(blind)
    assert summary["camera_error"] is None
    assert summary["aircraft_error"] is None
    assert summary["time_to_land_s"] is None
    assert summary["max_deck_roll_deg"] is None
    # the estimate is the truth with 1 cm of noise
    assert summary["max_off_pad_m"] == pytest.approx(summarise(whole)["max_off_pad_m"], abs=0.05)
    assert summary["max_tilt_deg"] == pytest.approx(summarise(whole)["max_tilt_deg"], abs=1e-6)


def test_an_empty_flight_has_figures_too():
    summary = summarise(log_of([], None), "the vehicle gave no frame")
    assert summary["cycles"] == 0
    assert summary["time_per_mode_s"] == {}
    assert summary["max_tilt_deg"] is None


def test_like_refusals_count_together(whole):
    assert summarise(whole)["refusals"] == {"bar is … px high, at least … px wanted": 26}
    assert kinds_of("side −0.3 of 12,5 px") == kinds_of("side +4 of 9 px") == ["side … of … px"]
    assert kinds_of("ship: not confirmed (2 of 3 sightings; evidence 1.2 of 3)") == ["ship: not confirmed"]
    assert kinds_of("cut off; ship: not found; cut off") == ["cut off", "ship: not found"]
    silent = dataclasses.replace(whole.records[0], observation=Observation(0.0, whole.records[0].frame.gimbal))
    assert summarise(log_of([silent], None))["refusals"] == {"nothing seen": 1}


def test_json_is_plain_rounded_and_free_of_nan(tmp_path):
    path = tmp_path / "x.json"
    write_json(
        path, {"a": math.nan, "b": np.float64(0.12345678), "c": np.array([1.0, -0.0]), "d": np.int64(3), "e": True}
    )
    assert json.loads(path.read_text()) == {"a": None, "b": 0.123457, "c": [1.0, 0.0], "d": 3, "e": True}
    assert "-0.0" not in path.read_text()
    with pytest.raises(DataError, match="cannot be written"):
        write_json(path / "y.json", {})


# The recorder


@pytest.fixture(scope="module", autouse=True)
def short_films_and_plain_figures():
    """Nor are the figures arranged, as `unarranged` says."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("shipland.report.outputs.VideoParameters", lambda: VideoParameters(verdict_hold_s=0.1))
        patched.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)
        yield


def grey_chase(truth):
    return np.full((540, 640, 3), 90, np.uint8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the last two seconds of a flight leave."""
    path = tmp_path_factory.mktemp("flown") / "out"
    with Recorder(path, INFO, RIG, CAMERA, grey_chase) as recorder:
        for record in flight(from_s=33.0):
            recorder.append(record)
        recorder.finish(VERDICT, "on the deck", {"see": 0.25})
    assert recorder.problems == []
    return path


def test_a_flight_leaves_its_folder(folder):
    names = {"flight.mcap", "flight.mp4", "foxglove-layout.json", "plots.png", "summary.json", "timing.json"}
    assert {path.name for path in folder.iterdir()} == names
    told = json.loads((folder / "summary.json").read_text())
    assert told["touchdown"]["reason"] == VERDICT.reason
    assert told["cycles"] == 60
    timing = json.loads((folder / "timing.json").read_text())
    assert timing["stages"]["see"] == {"total_s": 0.25, "per_cycle_ms": pytest.approx(250.0 / 60.0, abs=1e-4)}
    assert {"log", "video", "chase"} <= set(timing["stages"])


def test_the_figures_follow_from_the_log_alone_and_are_the_same_twice(folder, tmp_path):
    with Recorder(tmp_path / "out", INFO, RIG, CAMERA, video=False) as recorder:
        for record in flight(from_s=33.0):
            recorder.append(record)
        recorder.finish(VERDICT, "on the deck")
    for name in ("flight.mcap", "plots.png", "summary.json"):
        assert (tmp_path / "out" / name).read_bytes() == (folder / name).read_bytes(), name
    log = read_log(folder / "flight.mcap")
    write_json(tmp_path / "again.json", summarise(log, "on the deck"), configuration=log.header.info.table())
    assert (tmp_path / "again.json").read_bytes() == (folder / "summary.json").read_bytes()


def test_ctrl_c_leaves_everything_of_what_was_flown(tmp_path):
    with pytest.raises(KeyboardInterrupt), Recorder(tmp_path, INFO, RIG, CAMERA) as recorder:
        for count, record in enumerate(flight(from_s=20.0)):
            if count == 20:
                raise KeyboardInterrupt
            recorder.append(record)
    log = read_log(tmp_path / "flight.mcap")
    assert log.complete
    assert len(log.records) == 20
    assert json.loads((tmp_path / "summary.json").read_text())["end"] == "broken off: KeyboardInterrupt"
    assert (tmp_path / "flight.mp4").stat().st_size > 1000
    assert (tmp_path / "plots.png").exists()


def test_an_output_that_fails_is_given_up_and_the_flight_goes_on(without_plots, tmp_path):
    def broken(truth):
        raise RuntimeError("no OpenGL")

    with Recorder(tmp_path, INFO, RIG, CAMERA, broken) as recorder:
        for record in flight(from_s=33.5, to_s=34.0, pictures=False):
            recorder.append(record)
        recorder.finish(None)
    assert recorder.problems == ["video given up: no OpenGL"]
    log = read_log(tmp_path / "flight.mcap")
    assert (len(log.records), log.complete) == (15, True)


def test_a_real_flight_does_not_wait_for_its_disk_and_what_that_costs_is_said(without_plots, tmp_path, monkeypatch):
    monkeypatch.setattr("shipland.report.outputs._MOST_ROWS", 20)
    monkeypatch.setattr("shipland.report.outputs._MOST_PICTURES", 3)
    disk, pictures = threading.Event(), []
    write = LogWriter.append

    def slowly(log, record):
        disk.wait()
        pictures.append(record.frame.image is not None)
        write(log, record)

    monkeypatch.setattr(LogWriter, "append", slowly)
    with Recorder(tmp_path, INFO, RIG, CAMERA, video=False, aside=True) as recorder:
        for record in flight(from_s=33.0, to_s=34.0):
            recorder.append(record)  # the disk stands still: this comes back all the same
        disk.set()
        recorder.finish(None)
    log = read_log(tmp_path / "flight.mcap")
    assert log.complete
    assert 20 <= len(log.records) <= 21
    assert recorder.problems == [f"{30 - len(log.records)} cycles left out: the disk was too slow"]
    assert sum(pictures) in (3, 4)


def test_a_flight_without_a_cycle_leaves_no_picture(tmp_path):
    with Recorder(tmp_path, INFO, RIG, CAMERA) as recorder:
        recorder.finish(None, "the vehicle gave no frame")
    assert recorder.problems == []
    assert json.loads((tmp_path / "summary.json").read_text())["cycles"] == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        "flight.mcap", "foxglove-layout.json", "summary.json", "timing.json",
    }  # fmt: skip


def test_a_folder_that_cannot_be_written_is_said_before_the_flight(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        Recorder(tmp_path / "file", INFO, RIG, CAMERA)


def test_a_prediction_is_compared_with_the_truth_of_its_own_time(whole):
    ahead_s = 0.3

    def predicted(record):
        truth = truth_at(record.frame.t_s + ahead_s)
        yaw_rad = euler_from_rotation((truth.ned_from_bar.inverse() @ truth.ned_from_body).rotation)[2]
        estimate = Estimate(truth.t_s, truth.aircraft_in_bar_m, yaw_rad)
        return dataclasses.replace(record, decision=dataclasses.replace(record.decision, estimate=estimate))

    flown = [predicted(record) for record in whole.records if 13.0 < record.frame.t_s < 20.0]
    error = summarise(dataclasses.replace(whole, records=tuple(flown)))["aircraft_error"]
    assert error["count"] > 150
    # exact but for the line between exposures a thirtieth of a second apart; 0.3 s are up to 1 m of this approach
    assert error["max_distance_m"] < 0.002
    assert error["rms_yaw_deg"] < 0.05
