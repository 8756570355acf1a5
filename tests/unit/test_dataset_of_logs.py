"""`shipland dataset` of logs: LeRobot's layout holds what the pilot was told; a picture's pose is the true one."""

import csv
import json
import sys
import zipfile
from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_up_flight import CAMERA, RIG, flight, write_log
from test_landings_dataset import HERE

import shipland
from shipland.errors import DataError, SystemLibraryError
from shipland.frames import rotation_from_quaternion
from shipland.record.channels import LogParameters
from shipland.record.reader import read_log
from shipland.report.dataset import write_dataset
from shipland.report.lerobot import write_lerobot
from shipland.vision.log_pictures import read_pictures

FILM = "observation.images.camera"


def made_up_log(path, seed=7, width_px=320, rate_hz=10.0, to_s=35.0, witnessed=True):
    path.parent.mkdir(parents=True, exist_ok=True)
    parameters = LogParameters(image_rate_hz=rate_hz, image_width_px=width_px)
    return write_log(path, flight(seed, 33.0, to_s, witnessed=witnessed), parameters=parameters)


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """A folder of two flights with pictures."""
    folder = tmp_path_factory.mktemp("flown")
    for seed in (1, 2):
        made_up_log(folder / str(seed) / "flight.mcap", seed, to_s=34.0 + 0.5 * seed)
    return folder


def lerobot_of(folder):
    """info.json, stats.json, and the rows and episodes as dicts of arrays."""
    parquet = pytest.importorskip("pyarrow.parquet", reason="LeRobot's layout wants the extra dataset")
    info, stats = (json.loads((folder / "meta" / f"{name}.json").read_text()) for name in ("info", "stats"))
    rows, episodes = (
        {name: np.array(values.to_pylist()) for name, values in zip(table.column_names, table.columns, strict=True)}
        for table in (
            parquet.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0)),
            parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet"),
        )
    )
    return info, stats, rows, episodes


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """LeRobot's layout of two geometric flights of a second."""
    folder = tmp_path_factory.mktemp("campaign")
    pytest.importorskip("pyarrow", reason="LeRobot's layout wants the extra dataset")
    options = {"settings": "time_limit_s=1", "runs": 2, "workers": 1, "progress": False, "oracle_motions": 0}
    shipland.campaign(scenario="near", out=folder / "flown", logs=True, **options)
    write_dataset(folder / "flown", folder / "set", HERE, lerobot=True)
    return folder / "set" / "lerobot"


def test_an_episode_is_a_flight(flown):
    info, stats, rows, episodes = lerobot_of(flown)
    assert (info["codebase_version"], info["fps"], info["video_path"]) == ("v3.0", 30, None)
    assert info["total_episodes"] == len(episodes["length"]) == 2
    assert info["total_frames"] == episodes["length"].sum() == len(rows["index"])
    assert set(rows) == set(info["features"])
    assert np.array_equal(rows["index"], np.arange(len(rows["index"])))
    for start, end in zip(episodes["dataset_from_index"], episodes["dataset_to_index"], strict=True):
        assert rows["next.done"][start:end].tolist() == [False] * (end - start - 1) + [True]
        assert np.allclose(rows["timestamp"][start:end], np.arange(end - start) / 30.0, atol=1e-6)
        late_s = rows["exposure_s"][start:end] - rows["exposure_s"][start] - rows["timestamp"][start:end]
        assert np.abs(late_s).max() < 0.5 / 30.0
    assert not rows["next.success"].any()
    assert [len(info["features"][name]["names"]) for name in ("observation.state", "action")] == [48, 4]
    assert np.allclose(stats["action"]["mean"], rows["action"].mean(0), atol=1e-9)
    assert stats["action"]["count"] == [len(rows["action"])]


def test_the_state_is_what_an_agent_sees(flown):
    gymnasium = pytest.importorskip("gymnasium", reason="the extra rl is not installed")
    env = gymnasium.make(
        "shipland.environments:shipland/Landing-v0",
        action="residual",
        observation="flat",
        overrides={"time_limit_s": 1.0},
    )
    _, _, rows, episodes = lerobot_of(flown)
    seen, _ = env.reset(seed=1)  # with zeros added the pilot flies its own flight
    for state in rows["observation.state"][: episodes["length"][0]]:
        assert np.array_equal(state.astype(np.float32), seen)
        seen, _, _, over, _ = env.step(np.zeros(4, np.float32))
        if over:
            break
    assert over


def test_the_film_shows_the_pictures_of_its_rows(flights, tmp_path):
    av = pytest.importorskip("av", reason="a film wants the extra film")
    pytest.importorskip("pyarrow", reason="LeRobot's layout wants the extra dataset")
    assert "lerobot" in write_dataset(flights, tmp_path / "set", HERE, lerobot=True)
    info, stats, rows, episodes = lerobot_of(tmp_path / "set" / "lerobot")
    assert (info["fps"], info["features"][FILM]["shape"]) == (10, [180, 320, 3])
    assert np.array(stats[FILM]["mean"]).shape == (3, 1, 1)
    assert stats[FILM]["count"][0] <= 4 * info["total_episodes"]  # in memory, of all flights at once
    assert rows["next.success"].sum() == 2
    for number in range(2):
        film = (
            tmp_path / "set" / "lerobot" / info["video_path"].format(video_key=FILM, chunk_index=0, file_index=number)
        )
        with av.open(str(film)) as container:
            frames = [(frame.time, frame.to_ndarray(format="bgr24")) for frame in container.decode(video=0)]
        own = rows["episode_index"] == number
        assert len(frames) == own.sum() == episodes["length"][number]
        pictures = dict(read_pictures(flights / str(number + 1) / "flight.mcap"))
        for (time_s, image), stamp_s, exposure_s in zip(
            frames, rows["timestamp"][own], rows["exposure_s"][own], strict=True
        ):
            assert abs(time_s - stamp_s) < 1e-4  # LeRobot's tolerance
            picture = pictures[round(1e9 * exposure_s)].astype(float)
            assert np.abs(image - picture).mean() < 3.0  # of 255: what H.264 loses


def test_a_layout_that_is_broken_off_leaves_nothing_and_can_be_written_again(flights, tmp_path, monkeypatch):
    pytest.importorskip("av", reason="a film wants the extra film")
    pytest.importorskip("pyarrow", reason="LeRobot's layout wants the extra dataset")

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("shipland.report.lerobot._write_tables", stop)
        with pytest.raises(KeyboardInterrupt):
            write_dataset(flights, tmp_path / "set", HERE, lerobot=True, pictures=True)
    assert not list((tmp_path / "set").iterdir())
    assert "lerobot" in write_dataset(flights, tmp_path / "set", HERE, lerobot=True)


def test_a_data_set_that_is_broken_off_leaves_the_files_of_before(flights, tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet", reason="a table for pandas wants the extra dataset")
    out = tmp_path / "set"
    write_dataset(flights, out, HERE, pictures=True)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    made_up_log(tmp_path / "flown" / "other.mcap", 3, to_s=33.5)

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    def stop_half_way(_, path):
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    for place, name, stopped, pictures in (
        (zipfile.ZipFile, "writestr", stop, False),
        (parquet, "write_table", stop_half_way, True),
    ):
        with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
            patched.setattr(place, name, stopped)
            write_dataset(tmp_path / "flown", out, HERE, pictures=pictures)
        for file in ("logs.zip", "pictures.parquet"):
            assert (out / file).read_bytes() == before[file]
    assert {path.name for path in out.iterdir()} == set(before)


def test_lerobot_reads_it(flights, tmp_path):
    datasets = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="the layout is checked by LeRobot itself")
    write_dataset(flights, tmp_path / "set", HERE, lerobot=True)
    found = datasets.LeRobotDataset("here/made-up", root=tmp_path / "set" / "lerobot", video_backend="pyav")
    assert found.num_episodes == 2
    assert found[3]["task"] == "land on the ship: made-up"
    assert found[3][FILM].shape == (3, 180, 320)


def test_a_picture_has_the_true_pose_of_its_camera(flights, tmp_path):
    write_dataset(flights, tmp_path / "set", HERE, pictures=True)
    with (tmp_path / "set" / "pictures.csv").open() as file:
        rows = list(csv.DictReader(file))
    camera = CAMERA.scaled(320, 180)
    logs = {f"{seed}/flight": read_log(flights / str(seed) / "flight.mcap").records for seed in (1, 2)}
    with zipfile.ZipFile(tmp_path / "set" / "pictures.zip") as packed:
        assert packed.namelist() == [row["picture"] for row in rows]
        for row in rows:
            value = {name: float(text) for name, text in row.items() if name not in ("picture", "flight")}
            rotation = rotation_from_quaternion(np.array([value[f"bar_from_camera_{part}"] for part in "wxyz"]))
            place_m = np.array([value[f"camera_in_bar_{part}_m"] for part in ("forward", "right", "down")])
            seen_px = camera.project((RIG.cue.points_in_bar_m - place_m) @ rotation)
            corners_px = np.array([[value[f"corner_{n}_{part}_px"] for part in ("column", "row")] for n in range(1, 9)])
            assert np.allclose(seen_px, corners_px, atol=0.01)  # pixels, of six decimals of the pose
            assert value["focal_px"] == pytest.approx(camera.focal_px, abs=1e-5)
            image = cv2.imdecode(np.frombuffer(packed.read(row["picture"]), np.uint8), cv2.IMREAD_COLOR)
            column, line = np.round(corners_px[:4].mean(0)).astype(int)
            assert image[line, column, 1] > 150 > image[line, column, 2]  # the rectangle's green
            record = min(logs[row["flight"]], key=lambda it: abs(it.frame.t_s - value["t_s"]))
            assert value["gimbal_pitch_rad"] == pytest.approx(record.frame.gimbal.pitch_rad, abs=1e-6)


def test_the_card_tells_of_pictures_and_layout(flights, tmp_path):
    pytest.importorskip("pyarrow", reason="LeRobot's layout wants the extra dataset")
    write_dataset(flights, tmp_path / "set", HERE, lerobot=True, pictures=True)
    card = json.loads((tmp_path / "set" / "croissant.json").read_text())
    listed = {item["@id"] for item in card["distribution"]}
    assert {
        "pictures.zip",
        "logs.zip",
        "lerobot/meta/info.json",
        f"lerobot/videos/{FILM}/chunk-000/file-001.mp4",
    } <= listed
    fields = {field["name"]: field["description"] for field in card["recordSet"][0]["field"]}
    assert fields["pictures/corner_8_row_px"].endswith("where it is cut [px]")
    assert not [text for text in fields.values() if text.startswith("the cell's value")]


def test_without_the_truth_a_picture_has_its_gimbal_alone(tmp_path):
    made_up_log(tmp_path / "flown" / "flight.mcap", witnessed=False)
    write_dataset(tmp_path / "flown", tmp_path / "set", HERE, pictures=True)
    with (tmp_path / "set" / "pictures.csv").open() as file:
        row = next(csv.DictReader(file))
    assert "gimbal_pitch_rad" in row
    assert not [name for name in row if name.startswith(("camera_in", "corner"))]


def test_a_picture_tells_the_distortion_of_its_camera(tmp_path):
    bent = replace(CAMERA, distortion=np.array([-0.2, 0.05, 0.001, -0.001, 0.0]))
    parameters = LogParameters(image_width_px=320)
    (tmp_path / "flown").mkdir()
    write_log(tmp_path / "flown" / "flight.mcap", flight(1, 33.0, 33.5), parameters=parameters, camera=bent)
    write_dataset(tmp_path / "flown", tmp_path / "set", HERE, pictures=True)
    with (tmp_path / "set" / "pictures.csv").open() as file:
        row = next(csv.DictReader(file))
    assert [float(row[f"distortion_{number}"]) for number in range(1, 6)] == bent.distortion.tolist()


def test_cycles_of_telemetry_alone_repeat_an_exposure(tmp_path):
    """As of a real vehicle whose pictures come late: two cycles of three."""
    seen = list(flight(1, 33.0, 34.0, pictures=False))[:24]
    flown = [replace(each, frame=replace(each.frame, t_s=seen[at - at % 3].frame.t_s)) for at, each in enumerate(seen)]
    write_lerobot({"late": write_log(tmp_path / "late.mcap", flown)}, tmp_path / "set")
    info, _, rows, _ = lerobot_of(tmp_path / "set")
    assert info["fps"] == 10
    assert len(rows["index"]) == 8
    still = [replace(each, frame=seen[0].frame) for each in seen]
    with pytest.raises(DataError, match="two pictures' times"):
        write_lerobot({"still": write_log(tmp_path / "still.mcap", still)}, tmp_path / "other")


def test_a_row_that_is_stamped_far_ahead_makes_no_endless_film(tmp_path):
    flown = list(flight(1, 33.0, 33.5, pictures=False))
    last = flown[-1]
    flown[-1] = replace(last, frame=replace(last.frame, t_s=1e11))
    log = write_log(tmp_path / "far.mcap", flown)
    with pytest.raises(DataError, match=r"far\.mcap spans 1e\+11 s"):
        write_lerobot({"far": log}, tmp_path / "set")


def test_what_cannot_be_made_is_said(flights, tmp_path, monkeypatch):
    made_up_log(tmp_path / "blind" / "flight.mcap", rate_hz=0.0)
    with pytest.raises(DataError, match="no log keeps pictures"):
        write_dataset(tmp_path / "blind", tmp_path / "set", HERE, pictures=True)
    assert not list((tmp_path / "set").iterdir())
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "pyarrow", None)
        with pytest.raises(
            SystemLibraryError, match=r"needs pyarrow; install it with: pip install 'shipland\[dataset\]'$"
        ):
            write_dataset(flights, tmp_path / "set", HERE, lerobot=True)
    monkeypatch.setattr("shipland.report.lerobot.require", lambda *_: None)
    (tmp_path / "set" / "lerobot").mkdir()
    with pytest.raises(DataError, match=r"lerobot is there already: name another --out"):
        write_dataset(flights, tmp_path / "set", HERE, lerobot=True)
    logs = {"wide": flights / "1" / "flight.mcap", "narrow": made_up_log(tmp_path / "narrow.mcap", width_px=160)}
    with pytest.raises(DataError, match="of another size"):
        write_lerobot(logs, tmp_path / "other")
    with pytest.raises(DataError, match="two pictures' times"):
        write_lerobot({"short": made_up_log(tmp_path / "short.mcap", to_s=33.01)}, tmp_path / "other")
