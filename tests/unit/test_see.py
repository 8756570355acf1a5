"""Pictures, folders and videos through the near vision; and real photographs, where they are at hand."""

import csv
import json
import math
import os
import struct
import sys
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

import shipland
from pictures import Look, bar_picture, camera_from_bar, write_film
from shipland import compiled
from shipland.calibration_file import read_calibration, write_calibration
from shipland.camera import Camera
from shipland.commands.see import See
from shipland.cue import Cue
from shipland.errors import ConfigError, DataError
from shipland.messages import Decision, FlightRecord, Frame, GimbalAttitude, Observation, PilotCommand, Telemetry
from shipland.record.channels import LogParameters
from shipland.record.info import FlightInfo
from shipland.record.writer import LogWriter
from shipland.rig import Rig
from shipland.vision.attitude import AttitudeTrack
from shipland.vision.near import files
from shipland.vision.near.files import COLUMNS, default_camera, see_paths
from shipland.vision.pictures import FilePicture, pictures_of, read_picture, read_video

KEYS = [
    "file", "t_s", "found", "reason", "distance_m", "position_in_bar_m", "yaw_deg", "covariance", "reprojection_px",
    "corners_px", "waves_off",
]  # fmt: skip


@pytest.fixture(scope="module")
def bar_image(rig, camera):
    pose = camera_from_bar([-6.0, 0.4, 0.2], 0.05)
    return bar_picture(rig.cue, camera, pose, np.random.default_rng(1), Look(0.4, 0.0), colour=(40.0, 240.0, 60.0))


def write(path, image):
    assert cv2.imwrite(str(path), image)
    return path


def see(*paths, cue=None, camera=None):
    cue = Rig().cue if cue is None else Cue.from_file(cue)
    return list(see_paths(paths, cue, default_camera() if camera is None else read_calibration(camera)))


def assert_found(result, tolerance_m=0.01):
    json_line = result.to_json()
    assert list(json_line) == KEYS
    assert result.found
    assert json_line["reason"] == ""
    assert json_line["distance_m"] == pytest.approx(np.linalg.norm([6.0, 0.4, 0.2]), abs=tolerance_m)
    assert json_line["yaw_deg"] == pytest.approx(np.degrees(0.05), abs=1.5)  # JPEG among them
    assert np.shape(json_line["corners_px"]) == (8, 2)
    assert np.linalg.eigvalsh(json_line["covariance"]).min() > 0.0
    json.dumps(json_line, allow_nan=False)
    assert " m away" in result.to_line()


def test_one_picture_in_python_is_the_commands_line(tmp_path, bar_image):
    path = write(tmp_path / "bar.png", bar_image)
    (result,) = see(path)
    found = shipland.see(path)
    assert found.to_json() == result.to_json()
    assert repr(found) == f"<{result.to_line()}>"
    of_array = shipland.see(bar_image, cue=Rig().cue, camera=default_camera())
    assert of_array.to_json() == result.to_json() | {"file": "picture"}
    write_calibration(default_camera(), tmp_path / "camera.yaml")
    assert shipland.see(bar_image, camera=tmp_path / "camera.yaml").to_json() == of_array.to_json()
    plates = Path(__file__).parents[2] / "examples" / "own_cue.toml"
    assert not shipland.see(bar_image, cue=plates).found
    with pytest.raises(DataError, match=r"\(H,W,3\) uint8 BGR, got \(720, 1280\) uint8"):
        shipland.see(bar_image[..., 0])
    with pytest.raises(DataError, match=r"\(H,W,3\) uint8 BGR, got \(0, 1280, 3\)"):
        shipland.see(bar_image[:0])
    with pytest.raises(DataError, match="same aspect"):
        shipland.see(bar_image[:300])


def test_one_without_the_cue(tmp_path):
    (result,) = see(write(tmp_path / "grey.png", np.full((720, 1280, 3), 128, np.uint8)))
    json_line = result.to_json()
    assert list(json_line) == KEYS
    assert not json_line["found"]
    assert json_line["reason"] == "nothing in the picture passes the colour gate"
    assert [json_line[key] for key in KEYS[4:]] == [None] * 6 + [False]
    assert result.to_line().endswith("not found: nothing in the picture passes the colour gate")


def test_a_folder_by_name_and_nothing_but_pictures(tmp_path, bar_image):
    for name in ("b.png", "a.jpg", "C.PNG"):
        write(tmp_path / name, bar_image)
    (tmp_path / "notes.txt").write_text("no picture")
    results = see(tmp_path)
    assert [Path(result.picture.name).name for result in results] == ["C.PNG", "a.jpg", "b.png"]
    for result in results:
        assert_found(result)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("16 bits.png", lambda image: image.astype(np.uint16) * 257),
        ("16 bits.tiff", lambda image: image.astype(np.uint16) * 257),
        ("transparent.png", lambda image: cv2.cvtColor(image, cv2.COLOR_BGR2BGRA)),
        ("half.png", lambda image: cv2.resize(image, (640, 360), interpolation=cv2.INTER_AREA)),
        ("lossy.webp", lambda image: image),
    ],
)
def test_kinds_of_pictures(name, change, tmp_path, bar_image):
    (result,) = see(write(tmp_path / name, change(bar_image)))
    assert_found(result, 0.03)


@pytest.mark.parametrize("size", [(1, 1), (1280, 720)])
def test_one_channel_and_tiny_ones_are_looked_at(size, tmp_path):
    (result,) = see(write(tmp_path / "grey.png", np.full(size[::-1], 200, np.uint8)))
    assert not result.found


def test_a_video(tmp_path, bar_image):
    path = write_film(tmp_path / "approach.mp4", [np.roll(bar_image, 3 * index, axis=1) for index in range(4)])
    results = see(path)
    assert [result.picture.name for result in results] == [f"{path}#{index:06d}" for index in range(4)]
    assert [result.observation.reason for result in results] == [""] * 4
    assert [result.to_json()["t_s"] for result in results] == pytest.approx([0.0, 1 / 30, 2 / 30, 0.1], abs=1e-4)
    (row,) = results[3].to_rows()
    assert set(row) == set(COLUMNS)
    assert row["forward_m"] == pytest.approx(-6.0, abs=0.1)
    assert 0.0 < row["right_sd_m"] < 0.1


def test_a_picture_of_51_million_pixels_is_refused_at_once(tmp_path):
    path = tmp_path / "huge.png"
    Image.new("1", (8000, 6400)).save(path)
    with pytest.raises(DataError, match="8000 × 6400 px; expected at most 50 million"):
        see(path)


def test_a_larger_one_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    path = tmp_path / "bomb.bmp"
    head = struct.pack("<2sIHHIIiiHHIIiiII", b"BM", 54, 0, 0, 54, 40, 30_000, 30_000, 1, 24, 0, 0, 0, 0, 0, 0)
    path.write_bytes(head + bytes(100))
    monkeypatch.setattr("shipland.vision.pictures.cv2.imdecode", None)
    with pytest.raises(DataError, match="hundreds of millions of pixels; expected at most 50 million"):
        see(path)


def test_a_flight_log_is_seen_with_its_times_and_camera(tmp_path, bar_image, capsys):
    path = log_of(tmp_path, [bar_image, bar_image])
    out = tmp_path / "drawn"
    assert See((path,), csv=tmp_path / "poses.csv", out=out).run() == 0
    said = capsys.readouterr()
    assert f"as {path} has it" in said.err
    with (tmp_path / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["t_s"]) for row in rows] == pytest.approx([5.0, 5.1])
    assert [row["found"] for row in rows] == ["True", "True"]
    assert float(rows[0]["distance_m"]) == pytest.approx(6.02, abs=0.03)
    ((_, drawn), _) = read_video(out / "log.mp4")
    assert drawn.shape == (720, 1280, 3)
    with pytest.raises(DataError, match="keeps no pictures"):
        list(pictures_of([log_of(tmp_path, [None])]))


def test_a_logs_pictures_have_its_attitude_where_a_detector_took_longer_than_half_a_second(tmp_path, bar_image):
    path = log_of(tmp_path, [bar_image] * 3, apart_s=0.6)
    assert See((path,), csv=tmp_path / "poses.csv").run() == 0
    with (tmp_path / "poses.csv").open() as file:
        deviations = [float(row["down_sd_m"]) for row in csv.DictReader(file)]
    assert max(deviations) < 0.1  # without attitude half a metre


def log_of(folder, images, apart_s=0.1):
    """A log of cycles so far apart, from 5 s on."""
    parameters = LogParameters(image_rate_hz=30.0, image_width_px=1280, image_quality=95)
    info = FlightInfo("near", 1, "paper", "0", "0", 0.3)
    with LogWriter(folder / "log.mcap", info, Rig(), default_camera(), parameters) as log:
        for index, image in enumerate(images):
            t_s = 5.0 + apart_s * index
            frame = Frame(t_s, image, GimbalAttitude(0.0, 0.0))
            telemetry = Telemetry(t_s, 0.0, 0.0, 0.0, 3.0, np.zeros(3), 90.0, 90.0, True)
            command = PilotCommand(t_s, 0.0, 0.0, 0.0, 0.0, 0.0)
            seen = Observation(t_s, frame.gimbal)
            log.append(FlightRecord(frame, telemetry, seen, Decision(command, None, "", None), None))
        log.finish(None)
    return folder / "log.mcap"


def test_another_calibration_and_another_target(tmp_path, bar_image, camera, rig):
    longer = Camera(1280, 720, camera.matrix * [[1.1], [1.1], [1.0]] + [[0, 0, -64.0], [0, 0, -36.0], [0, 0, 0]])
    write_calibration(longer, tmp_path / "longer.yaml")
    cue = tmp_path / "double.toml"
    cue.write_text(
        "".join(f"[[rig.polygon]]\ncorners_m = {(2.0 * np.array(it.corners_m)).tolist()}\n" for it in rig.cue.polygon)
    )
    path = write(tmp_path / "bar.png", bar_image)
    plain, zoomed, doubled = (
        see(path, **given)[0].to_json()["distance_m"]
        for given in ({}, {"camera": tmp_path / "longer.yaml"}, {"cue": cue})
    )
    assert zoomed == pytest.approx(1.1 * plain, rel=0.01)
    assert doubled == pytest.approx(2.0 * plain, rel=0.01)
    assert see(path)[0].to_json()["distance_m"] == plain  # nothing is kept from one call to the next


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("missing.png", None, "picture .*missing.png does not exist"),
        ("missing.mp4", None, "video .*missing.mp4 does not exist"),
        ("empty.jpg", b"", "is not a whole picture"),
        ("text.png", b"no picture at all", "is not a whole picture"),
        ("empty.mp4", b"", "is not a video that can be read"),
        ("text.mkv", b"no video at all", "is not a video that can be read"),
    ],
)
def test_missing_and_broken_files(name, content, words, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=words) as caught:
        see(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_picture_that_breaks_off(suffix, tmp_path, bar_image, capfd):
    path = write(tmp_path / f"whole{suffix}", bar_image)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(DataError, match="is not a whole picture"):
        read_picture(path)
    assert capfd.readouterr().err == ""


def test_what_follows_a_jpegs_end_does_no_harm(tmp_path, bar_image):
    path = write(tmp_path / "whole.jpg", bar_image)
    image = read_picture(path)
    path.write_bytes(path.read_bytes() + bytes(200_000))
    assert np.array_equal(read_picture(path), image)


def test_a_preview_in_a_jpegs_header_is_not_its_end(tmp_path, bar_image):
    path = write(tmp_path / "half.jpg", bar_image)
    whole, preview = path.read_bytes(), cv2.imencode(".jpg", bar_image[::16, ::16])[1].tobytes()
    header = b"\xff\xe1" + (2 + len(preview)).to_bytes(2, "big") + preview
    path.write_bytes(whole[:2] + header + whole[2 : len(whole) // 2])
    with pytest.raises(DataError, match="is not a whole picture"):
        read_picture(path)


def test_a_video_that_breaks_off(tmp_path, bar_image):
    path = write_film(tmp_path / "whole.mp4", [bar_image] * 5)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(DataError, match=r"whole\.mp4"):
        see(path)


def test_a_video_that_ends_too_early_says_how_much_was_read(tmp_path, bar_image, capsys):
    import av

    path = write_film(tmp_path / "whole.mp4", [bar_image] * 12)
    cut = tmp_path / "cut.mp4"
    with av.open(str(path)) as whole, av.open(str(cut), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream_from_template(whole.streams.video[0])
        for packet in whole.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                container.mux(packet)
    cut.write_bytes(cut.read_bytes()[:-200])
    assert See((cut,)).run() == 1
    assert "cut.mp4 breaks off after picture" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".mkv", ".mp4"])
@pytest.mark.parametrize(
    ("stamps_ms", "sound_s"),
    [
        ([0, 30, 60, 400, 430, 1000, 1300, 1330, 2000, 2400, 2900, 3000], 3.3),
        ([5000 + 33 * index for index in range(10)], 0.0),
        ([33 * index for index in range(20)], 1.5),
    ],
    ids=["variable rate", "begins later", "longer sound"],
)
def test_a_whole_film_of_any_rate_start_and_sound_does_not_break_off(stamps_ms, sound_s, suffix, tmp_path):
    path = tmp_path / f"film{suffix}"
    write_timed_film(path, stamps_ms, sound_s)
    since_first_ms = np.subtract(stamps_ms, stamps_ms[0])
    assert [round(1e3 * t_s) for t_s, _ in read_video(path)] == pytest.approx(since_first_ms, abs=1)
    if suffix == ".mkv":
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
        with pytest.raises(DataError, match=r"film\.mkv breaks off after picture \d+: [\d.]+ of [\d.]+ s"):
            list(read_video(path))


@pytest.mark.parametrize("suffix", [".avi", ".mkv"])
def test_a_silent_film_of_a_steady_rate_that_was_cut_breaks_off(suffix, tmp_path):
    rng = np.random.default_rng(1)
    images = [rng.integers(0, 255, (64, 64, 3)).astype(np.uint8) for _ in range(30)]
    path = write_film(tmp_path / f"film{suffix}", images)
    assert len(list(read_video(path))) == 30
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 8 // 10])
    with pytest.raises(DataError, match="breaks off after picture"):
        list(read_video(path))


def write_timed_film(path, stamps_ms, sound_s):
    """A film of noise, a picture at each stamp, with so much silence beside it."""
    import av

    rng = np.random.default_rng(1)
    with av.open(str(path), "w") as container:
        video = container.add_stream("libx264", rate=30)
        video.width, video.height, video.pix_fmt = 64, 64, "yuv420p"
        video.codec_context.time_base = Fraction(1, 1000)
        sound = container.add_stream("aac", rate=48000) if sound_s else None
        packets = []
        for stamp_ms in stamps_ms:
            picture = av.VideoFrame.from_ndarray(rng.integers(0, 255, (64, 64, 3)).astype(np.uint8), format="bgr24")
            picture.pts, picture.time_base = stamp_ms, Fraction(1, 1000)
            packets += video.encode(picture)
        packets += video.encode()
        if sound is not None:
            for start in range(0, round(48000 * sound_s), 1024):
                silence = av.AudioFrame.from_ndarray(np.zeros((1, 2048), np.int16), format="s16", layout="stereo")
                silence.sample_rate, silence.pts, silence.time_base = 48000, start, Fraction(1, 48000)
                packets += sound.encode(silence)
            packets += sound.encode()
        for packet in sorted(packets, key=lambda packet: packet.dts * packet.time_base):
            container.mux(packet)


def test_a_film_that_was_taken_upright_is_turned_as_a_player_shows_it(tmp_path):
    upper = np.zeros((48, 64, 3), np.uint8)
    upper[:24] = 200
    path = write_film(tmp_path / "upright.mp4", [upper] * 2)
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 44
    quarter = struct.pack(">9i", 0, 1 << 16, 0, -1 << 16, 0, 0, 0, 0, 1 << 30)  # to the right
    data[matrix : matrix + len(quarter)] = quarter
    path.write_bytes(data)
    _, turned = next(read_video(path))
    assert turned.shape == (64, 48, 3)
    assert turned[:, 30:].min() > 150 > 50 > turned[:, :18].max()


def test_a_film_that_changes_its_size_does_not_go_on_from_the_film_before(tmp_path, monkeypatch):
    """The film before ended with the bar elsewhere, at the size that this one changes to."""

    def picture(name, t_s, down_m, shrunk, follows):
        pose = camera_from_bar([-6.0, 0.2, down_m])
        image = bar_picture(Rig().cue, default_camera(), pose, np.random.default_rng(1), Look(0.4, 0.0))
        image = cv2.resize(image, (640, 360), interpolation=cv2.INTER_AREA) if shrunk else image
        return FilePicture(f"{name}#", Path(name), image, t_s, follows)

    first, second = tmp_path / "a.ts", tmp_path / "b.ts"
    films = {
        first: [picture(first, 0.0, 0.75, True, False)],
        second: [picture(second, 0.0, -0.75, False, False), picture(second, 0.1, -0.75, True, True)],
    }
    monkeypatch.setattr(files, "pictures_of", lambda paths, _: iter(films[paths[0]]))
    track = AttitudeTrack.of([(0.0, 0.0, 0.0)], 0.01, "level")
    results = list(see_paths([first, second], Rig().cue, default_camera(), attitude_of=lambda _: track))
    assert [result.observation.reason for result in results] == ["", "", ""]


def test_a_film_whose_name_has_a_colon_is_no_protocol(tmp_path, monkeypatch):
    write_film(tmp_path / "film.mp4", [np.zeros((48, 64, 3), np.uint8)] * 3).rename(tmp_path / "2026-05-01T10:30.mp4")
    monkeypatch.chdir(tmp_path)
    assert [picture.of for picture in pictures_of([Path("2026-05-01T10:30.mp4")])] == [3] * 3


def test_nothing_to_look_at(tmp_path):
    with pytest.raises(DataError, match="nothing to look at"):
        see()
    with pytest.raises(DataError, match="holds no pictures"):
        see(tmp_path)


def test_wrong_target_and_calibration(tmp_path, bar_image):
    path = write(tmp_path / "bar.png", bar_image)
    (tmp_path / "cue.toml").write_text("[[rig.polygon]]\ncorners = [[0, 0]]\n")
    with pytest.raises(ConfigError, match="corners_m"):
        see(path, cue=tmp_path / "cue.toml")
    with pytest.raises(DataError, match="does not exist"):
        see(path, camera=tmp_path / "camera.yaml")


# Real photographs stand beside the checkout on some machines only; they are no part of this project.
PHOTOGRAPHS = Path(__file__).parents[3] / "shared" / "data" / "green_tape"
INCH_M = 0.0254


@pytest.fixture(scope="module")
def taped(tmp_path_factory):
    if not PHOTOGRAPHS.is_dir():
        pytest.skip("the real photographs of green tape are not at hand: ../shared/data/green_tape is missing")
    folder = tmp_path_factory.mktemp("tape")
    for name, intrinsics in json.loads((PHOTOGRAPHS / "intrinsics.json").read_text()).items():
        lens = Camera(
            intrinsics["width"], intrinsics["height"], np.array(intrinsics["K"]), np.array(intrinsics["dist"])
        )
        write_calibration(lens, folder / f"{name}.yaml")
    targets = json.loads((PHOTOGRAPHS / "targets.json").read_text())
    for name in ("tape2019", "loading2020_outer", "peg2017"):
        quads = (INCH_M * np.array(targets[name])).reshape(-1, 4, 2).tolist()
        (folder / f"{name}.toml").write_text("".join(f"[[rig.polygon]]\ncorners_m = {quad}\n" for quad in quads))

    def look(photograph, cue, calibration):
        (result,) = see(PHOTOGRAPHS / photograph, cue=folder / f"{cue}.toml", camera=folder / f"{calibration}.yaml")
        return result

    return look


@pytest.mark.parametrize(
    ("photograph", "inches"),
    [("030in-Down", 30), ("048in-Down", 48), ("060in", 60), ("084in", 84), ("108in", 108)],
)
def test_photographs_of_a_whole_tape(taped, photograph, inches):
    result = taped(f"RedLoading-{photograph}.jpg", "loading2020_outer", "lifecam_640x480")
    assert result.found, result.observation.reason
    forward_m, right_m, _ = result.observation.bar_pose.position_in_bar_m
    # The distance in the name is the horizontal one.
    assert np.hypot(forward_m, right_m) / INCH_M == pytest.approx(inches, rel=0.04)


@pytest.mark.parametrize("photograph", ["016in-Down", "048in"])
def test_photographs_of_a_tape_cut_by_the_edge(taped, photograph):
    result = taped(f"RedLoading-{photograph}.jpg", "loading2020_outer", "lifecam_640x480")
    assert result.observation.reason == "the cue is cut by the picture's edge"


def test_photographs_of_two_leaning_strips(taped):
    # The names count from another point of the camera: only the slope is true. From 72 inches on the neighbouring
    # target is whole in the picture too.
    named, measured = [], []
    for name, inches in (("24in", 24), ("48in", 48), ("72in", 72), ("72in_HighRes", 72), ("90in", 90)):
        result = taped(f"CargoStraightDark{name}.jpg", "tape2019", "lifecam_320x240")
        assert result.found, (name, result.observation.reason)
        named.append(inches)
        measured.append(np.hypot(*result.observation.bar_pose.position_in_bar_m[:2]) / INCH_M)
    assert np.polyfit(named, measured, 1)[0] == pytest.approx(1.0, abs=0.03)
    cut = taped("CargoStraightDark19in.jpg", "tape2019", "lifecam_320x240")
    assert cut.observation.reason == "the cue is cut by the picture's edge"


@pytest.mark.parametrize("feet", [2, 4, 6])
def test_photographs_of_cyan_tape_are_refused(taped, feet):
    # Hue 90: outside the published gate.
    result = taped(f"peg_1ftH{feet}ftD0.jpg", "peg2017", "lifecam_640x480")
    assert not result.found
    assert result.observation.reason


def test_it_says_that_it_compiles_once_there_is_a_picture(tmp_path, bar_image, monkeypatch, caplog):
    monkeypatch.setattr(compiled, "cache_folder", lambda _: tmp_path)
    monkeypatch.setattr(compiled._SETTINGS, "DISABLE_JIT", 0)
    assert See((tmp_path / "missing.png",)).run() == 2
    assert caplog.messages == []
    assert See((write(tmp_path / "bar.png", bar_image),)).run() == 0
    assert caplog.messages == ["compiling for this processor, once; takes about a minute"]


def test_a_film_that_is_missing_is_named_before_the_extra_that_reads_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "av", None)
    assert See((tmp_path / "missing.mp4",)).run() == 2
    assert "missing.mp4 does not exist" in capsys.readouterr().err


def test_a_table_of_before_stays_where_nothing_can_be_looked_at(tmp_path):
    table = tmp_path / "poses.csv"
    table.write_text("of before")
    assert See((tmp_path / "missing.png",), csv=table).run() == 2
    assert table.read_text() == "of before"


@pytest.mark.parametrize(
    "wrong",
    [
        {"attitude_std_deg": -1.0},
        {"attitude_std_deg": math.nan},
        {"mount_pitch_deg": math.nan},
        {"attitude_start_s": math.inf},
        {"attitude_start_s": 1.7e15},  # microseconds
    ],
)
def test_numbers_of_the_attitude_outside_their_ranges_are_one_line(wrong, tmp_path):
    option = f"--{next(iter(wrong)).replace('_', '-')}"
    with pytest.raises(ConfigError, match=rf"^{option} must be .*, got \S+$"):
        See((tmp_path / "film.mp4",), **wrong).run()


@pytest.mark.parametrize("option", ["cue", "calibration", "attitude", "paths"])
def test_the_table_is_written_over_nothing_that_is_read(option, tmp_path):
    read = tmp_path / "read"
    read.write_text("t_s")
    given = {"paths": (tmp_path / "film.mp4",)} | {option: (read,) if option == "paths" else read}
    with pytest.raises(ConfigError, match="read is read here: name another file"):
        See(**given, csv=tmp_path / "read").run()
    assert read.read_text() == "t_s"


def test_what_cannot_be_looked_at_does_not_end_the_rest(tmp_path, bar_image, capsys):
    good, tall = write(tmp_path / "good.png", bar_image), write(tmp_path / "tall.png", bar_image[:, :600])
    (tmp_path / "torn.png").write_bytes(b"no picture")
    options = See((tmp_path / "torn.png", tall, good), json=True)
    assert options.run() == 1
    out, err = capsys.readouterr()
    assert [json.loads(line)["file"] for line in out.splitlines()] == [str(good)]
    assert "camera: 1280 × 720 px" in err
    assert "torn.png is not a whole picture" in err
    assert "tall.png is 600 × 720 px, the calibration is for 1280 × 720 px" in err
    assert "found in" not in err  # of one picture its own line says it
    assert See((tmp_path / "torn.png", tall)).run() == 2


def test_an_empty_folder_or_a_broken_log_does_not_end_the_rest(tmp_path, bar_image, capsys):
    good, empty, log = write(tmp_path / "good.png", bar_image), tmp_path / "empty", tmp_path / "torn.mcap"
    empty.mkdir()
    log.write_bytes(b"no log")
    assert See((empty, log, good)).run() == 1
    out, err = capsys.readouterr()
    assert out.startswith(f"{good}: 6.0")
    assert f"folder {empty} holds no pictures" in err
    assert f"{log} is not an MCAP file" in err
    assert See((log, empty)).run() == 2
    assert See((log,)).run() == 2
    assert "nothing to look at" not in capsys.readouterr().err


def test_logs_of_different_cameras_are_not_looked_at_with_the_first_ones(tmp_path, bar_image, monkeypatch):
    wide, narrow = tmp_path / "wide", tmp_path / "narrow"
    wide.mkdir()
    narrow.mkdir()
    first = log_of(wide, [bar_image])
    monkeypatch.setattr(sys.modules[__name__], "default_camera", lambda: Camera.from_fov(1280, 720, 40.0))
    other = log_of(narrow, [bar_image])
    with pytest.raises(DataError, match=f"{other} has another camera than {first}: look at them one by one"):
        See((first, other)).run()
    calibration = tmp_path / "camera.yaml"
    write_calibration(default_camera(), calibration)
    assert See((first, other), calibration=calibration).run() == 0


def test_a_name_that_is_no_utf_8_stands_in_the_table_as_it_is(tmp_path, bar_image):
    write(tmp_path / "a.png", bar_image).rename(tmp_path / os.fsdecode(b"b\xe4r.png"))
    table = tmp_path / "poses.csv"
    assert See((tmp_path,), csv=table).run() == 0
    assert b"b\xe4r.png," in table.read_bytes()


def test_the_end_says_how_much_was_found_and_what_was_written(tmp_path, bar_image, capsys):
    write(tmp_path / "a.png", bar_image)
    write(tmp_path / "b.png", np.zeros_like(bar_image))
    table = tmp_path / "new folder" / "poses.csv"
    assert See((tmp_path,), csv=table).run() == 0
    assert capsys.readouterr().err.splitlines()[-1] == f"found in 1 of 2 pictures; written: {table}"
    assert len(list(csv.DictReader(table.read_text().splitlines()))) == 2
