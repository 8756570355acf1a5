"""A film's attitude: from a table, ArduPilot's and PX4's logs and our own; and what `see` makes of it."""

import csv
import gc
import math
import re
import struct

import numpy as np
import pytest
from test_see import log_of

from pictures import Look, bar_picture, camera_from_bar, write_film
from shipland.commands.see import See
from shipland.errors import ConfigError, DataError
from shipland.frames import euler_from_rotation, quaternion_from_euler, rotation_from_euler
from shipland.vision.attitude import AttitudeTrack, read_attitude

ROLL_DEG, PITCH_DEG = 2.0, -7.0


def table(path, rows, names=("t_s", "roll_deg", "pitch_deg")):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([names, *rows])
    return path


def as_dataflash(path, name, rows):
    """ArduPilot's log of `name` messages with TimeUS [µs], Roll and Pitch [°], and a mount's number where rows do."""
    mounts = bool(rows) and len(rows[0]) == 4

    def described(kind, length, what, layout, columns):
        return struct.pack("<BBBBB4s16s64s", 0xA3, 0x95, 128, kind, length, what.encode(), layout, columns)

    data = described(128, 89, "FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    kinds, columns = (b"QffB", b"TimeUS,Roll,Pitch,I") if mounts else (b"Qff", b"TimeUS,Roll,Pitch")
    data += described(1, 3 + 16 + mounts, name, kinds, columns)
    for t_s, roll_deg, pitch_deg, *mount in rows:
        data += struct.pack("<BBBQff", 0xA3, 0x95, 1, round(1e6 * t_s), roll_deg, pitch_deg) + bytes(mount)
    path.write_bytes(data)
    return path


def as_tlog(path, rows):
    """A ground station's log of the gimbal's messages."""
    mavlink = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=154)
    data = b""
    for t_s, roll_deg, pitch_deg in rows:
        quaternion = quaternion_from_euler(math.radians(roll_deg), math.radians(pitch_deg), 0.3)
        message = mavlink.MAVLink_gimbal_device_attitude_status_message(
            0, 0, round(1e3 * t_s), 12, quaternion, 0.0, 0.0, 0.0, 0
        )
        data += struct.pack(">Q", round(1e6 * (t_s + 1.7e9))) + message.pack(codec)
    path.write_bytes(data)
    return path


def as_ulog(path, rows):
    """PX4's log of the body's attitude."""

    def record(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + record("B", bytes(40))
    data += record("F", b"vehicle_attitude:uint64_t timestamp;float[4] q;")
    data += record("A", struct.pack("<BH", 0, 7) + b"vehicle_attitude")
    for t_s, roll_deg, pitch_deg in rows:
        quaternion = quaternion_from_euler(math.radians(roll_deg), math.radians(pitch_deg), -1.0)
        data += record("D", struct.pack("<HQ4f", 7, round(1e6 * t_s), *quaternion))
    path.write_bytes(data)
    return path


def rows_from(start_s):
    return [(start_s + 0.1 * index, ROLL_DEG, PITCH_DEG + index) for index in range(5)]


@pytest.mark.parametrize(
    ("make", "start_s", "mount_deg"),
    [
        (lambda folder: table(folder / "a.csv", rows_from(0.0)), None, None),
        (lambda folder: as_dataflash(folder / "a.bin", "MNT", rows_from(80.0)), 80.0, None),
        (lambda folder: as_dataflash(folder / "a.BIN", "ATT", rows_from(80.0)), 80.0, 0.0),
        (lambda folder: as_tlog(folder / "a.tlog", rows_from(80.0)), 80.0, None),
        (lambda folder: as_ulog(folder / "a.ulg", rows_from(80.0)), 80.0, 0.0),
    ],
    ids=["csv", "bin, gimbal", "bin, body", "tlog", "ulg"],
)
def test_every_kind_of_file_gives_the_same(make, start_s, mount_deg, tmp_path):
    path = make(tmp_path)
    if path.suffix.lower() != ".csv":
        pytest.importorskip("pymavlink")
    if path.suffix == ".ulg":
        pytest.importorskip("pyulog")
    track = read_attitude(path, 0.01, start_s, None if mount_deg is None else math.radians(mount_deg))
    for t_s in (0.0, 0.25, 0.4):
        gimbal = track.at(t_s)
        assert np.degrees([gimbal.roll_rad, gimbal.pitch_rad]) == pytest.approx(
            [ROLL_DEG, PITCH_DEG + 10.0 * t_s], abs=2e-3
        )


def test_of_two_mounts_the_first_is_read(tmp_path):
    pytest.importorskip("pymavlink")
    rows = [(t_s, roll_deg, pitch_deg, 0) for t_s, roll_deg, pitch_deg in rows_from(80.0)]
    rows += [(t_s + 0.05, 30.0, 60.0, 1) for t_s, *_ in rows]
    track = read_attitude(as_dataflash(tmp_path / "a.bin", "MNT", sorted(rows)), 0.01, 80.0, None)
    assert len(track.t_s) == 5
    assert math.degrees(track.at(0.05).pitch_rad) == pytest.approx(PITCH_DEG + 0.5, abs=2e-3)


def test_a_camera_fixed_to_the_body_rolls_and_pitches_with_it():
    roll, pitch, mount = 0.2, 0.1, -0.6
    track = AttitudeTrack.of([(0.0, roll, pitch)], 0.01, "body").on_body(mount)  # one reading holds for all of it
    camera = rotation_from_euler(roll, pitch, 0.0) @ rotation_from_euler(0.0, mount, 0.0)
    assert (track.at(0.3).roll_rad, track.at(0.3).pitch_rad) == pytest.approx(euler_from_rotation(camera)[:2])


def test_beyond_the_readings_and_between_distant_ones_nothing_is_known():
    track = AttitudeTrack.of([(1.0, 0.0, 0.1), (0.0, 0.0, 0.1), (3.0, 0.0, 0.1), (4.0, math.nan, 0.1)], 0.01, "x")
    known = [t_s for t_s in (-1.0, -0.3, 0.5, 0.9, 1.0, 2.0, 3.2, 4.0) if math.isfinite(track.at(t_s).pitch_rad)]
    assert known == [-0.3, 1.0, 3.2]
    dense = AttitudeTrack.of([(0.1 * i, math.radians(179.0 + i), 0.0) for i in range(3)], 0.01, "x")
    assert math.degrees(dense.at(0.15).roll_rad) == pytest.approx(180.5)  # not by way of 0°


@pytest.mark.parametrize(
    ("make", "start_s", "mount_deg", "words"),
    [
        (lambda folder: folder / "none.csv", None, None, "does not exist"),
        (lambda folder: table(folder / "a.txt", []), None, None, r"expected \.csv, \.bin, \.tlog, \.ulg or a flight"),
        (lambda folder: table(folder / "a.csv", [], ("t_s", "roll")), None, None, "lacks roll_deg, pitch_deg; exp"),
        (lambda folder: table(folder / "a.csv", [("0", "x", "1")]), None, None, "line 2 has no number"),
        (lambda folder: table(folder / "a.csv", [(0, 180, -180), (1, 400, 1)]), None, None, "line 3 has an angle"),
        (lambda folder: table(folder / "a.csv", []), None, None, "holds no reading"),
        (lambda folder: as_dataflash(folder / "a.bin", "ATT", rows_from(8.0)), 8.0, None, "give --mount-pitch-deg"),
        (
            lambda folder: as_dataflash(folder / "a.bin", "ATT", rows_from(8.0)), None, 0.0,
            r"5 readings from 8\.00 to 8\.40 s: give --attitude-start-s",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_used_says_what_to_do(make, start_s, mount_deg, words, tmp_path):
    path = make(tmp_path)
    if path.suffix == ".bin":
        pytest.importorskip("pymavlink")
    with pytest.raises(DataError, match=words) as caught:
        read_attitude(path, 0.01, start_s, mount_deg)
    assert "\n" not in str(caught.value)


def as_body_tlog(path, rows):
    """A ground station's log of (t_s, pitch [rad], system) of bodies."""
    mavlink = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    data = b""
    for index, (t_s, pitch_rad, system) in enumerate(rows):
        message = mavlink.MAVLink_attitude_message(round(1e3 * t_s), 0.0, pitch_rad, 0.0, 0.0, 0.0, 0.0)
        packed = message.pack(mavlink.MAVLink(None, srcSystem=system, srcComponent=1))
        data += struct.pack(">Q", round(1e6 * (1.7e9 + 0.1 * index))) + packed
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([(5.0, 0.1, 1), (5.05, -0.3, 2), (5.1, 0.1, 1), (5.15, -0.3, 2)], r"several senders .*1/1, 2/1"),
        ([(5.0, 0.1, 1), (5.1, 0.1, 1), (0.2, -0.3, 1), (5.05, -0.3, 1)], r"begins again after 5\.10 s"),
    ],
    ids=["two vehicles", "restarted"],
)
def test_a_log_of_two_clocks_is_not_mixed(rows, words, tmp_path):
    with pytest.raises(DataError, match=f"ATTITUDE .*{words}"):
        read_attitude(as_body_tlog(tmp_path / "a.tlog", rows), 0.01, 0.0, 0.0)
    in_another_order = [(5.1, 0.1, 1), (5.0, 0.1, 1), (5.2, 0.1, 1)]
    track = read_attitude(as_body_tlog(tmp_path / "b.tlog", in_another_order), 0.01, 0.0, 0.0)
    assert track.at(5.05).pitch_rad == pytest.approx(0.1)


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_a_damaged_log_is_one_line_or_what_is_left_of_it_and_nothing_on_standard_output(tmp_path, capsys):
    pytest.importorskip("pymavlink")
    pytest.importorskip("pyulog")
    columns = as_dataflash(tmp_path / "a.bin", "ATT", rows_from(8.0))
    columns.write_bytes(columns.read_bytes().replace(b"TimeUS", b"TimeXX"))
    layout = as_dataflash(tmp_path / "b.bin", "ATT", rows_from(8.0))
    layout.write_bytes(layout.read_bytes().replace(b"Qff", b"Q\\f"))
    stamp = as_ulog(tmp_path / "c.ulg", rows_from(8.0))
    stamp.write_bytes(stamp.read_bytes().replace(b"timestamp", b"timestomp"))
    for path in (columns, layout, stamp):
        with pytest.raises(DataError, match="cannot be read as"):
            read_attitude(path, 0.01, 8.0, 0.0)
    gc.collect()  # pymavlink leaves a file that it cannot read open until then
    torn = as_ulog(tmp_path / "d.ulg", rows_from(8.0))
    torn.write_bytes(torn.read_bytes() + bytes(range(90)))
    assert len(read_attitude(torn, 0.01, 8.0, 0.0).t_s) == 5
    assert capsys.readouterr().out == ""


@pytest.fixture(scope="module")
def film(tmp_path_factory, rig, camera):
    """Two pictures from 6 m square on, where no picture tells the tilt, by a camera that looks up by 3°."""
    pose = camera_from_bar([-6.0, 0.0, 0.3], 0.0, math.radians(3.0))
    image = bar_picture(rig.cue, camera, pose, np.random.default_rng(1), Look(0.4, 1.0), colour=(40.0, 240.0, 60.0))
    return write_film(tmp_path_factory.mktemp("film") / "film.mp4", [image] * 2)


def seen(film, tmp_path, **options):
    out = tmp_path / "poses.csv"
    code = See((film,), csv=out, **options).run()
    with out.open() as file:
        return code, list(csv.DictReader(file))


def test_an_attitude_narrows_a_films_poses(film, tmp_path, capsys):
    code, alone = seen(film, tmp_path)
    assert code == 0
    assert "attitude: none, a pose's tilt may have either sign" in capsys.readouterr().err
    rows = table(tmp_path / "attitude.csv", [(0.0, 0.0, 3.0), (0.2, 0.0, 3.0)])
    code, known = seen(film, tmp_path, attitude=rows, attitude_std_deg=0.1)
    assert code == 0
    assert "attitude.csv, 2 readings from 0.00 to 0.20 s" in capsys.readouterr().err
    for row in known:
        assert float(row["down_m"]) == pytest.approx(0.3, abs=0.05)
        assert float(row["down_sd_m"]) < 0.03 < 0.2 * float(alone[0]["down_sd_m"])
    assert abs(float(alone[0]["down_m"]) - 0.3) < 3.0 * float(alone[0]["down_sd_m"])


def test_the_start_of_an_attitude_that_is_not_given_is_refused(film):
    with pytest.raises(ConfigError, match="--attitude-start-s is of --attitude, which is not given"):
        See((film,), attitude_start_s=5.0).run()


def test_readings_too_far_apart_are_not_said_to_end_before_the_film(film, tmp_path, capsys):
    rows = table(tmp_path / "attitude.csv", [(-1.0, 0.0, 3.0), (1.0, 0.0, 3.0)])
    code, _ = seen(film, tmp_path, attitude=rows)
    assert code == 1
    words = capsys.readouterr().err
    assert "2 of 2 pictures are without attitude; expected readings at most 0.5 s apart along the film" in words
    assert "outside" not in words


def test_pictures_outside_of_the_attitude_are_named(film, tmp_path, capsys):
    rows = table(tmp_path / "attitude.csv", [(50.0, 0.0, 3.0), (50.2, 0.0, 3.0)])
    code, found = seen(film, tmp_path, attitude=rows)
    assert code == 1
    words = r"2 of 2 pictures are without attitude; .* got .* from 50\.00 to 50\.20 s"
    assert re.search(words, capsys.readouterr().err)
    assert len(found) == 2
    code, _ = seen(film, tmp_path, attitude=rows, attitude_start_s=50.0)
    assert code == 0


def test_a_flight_log_has_its_own_attitude(tmp_path, rig, camera, capsys):
    pose = camera_from_bar([-6.0, 0.0, 0.3], 0.0)
    image = bar_picture(rig.cue, camera, pose, np.random.default_rng(1), Look(0.4, 1.0), colour=(40.0, 240.0, 60.0))
    log = log_of(tmp_path, [image, image])
    code, found = seen(log, tmp_path)
    assert code == 0
    assert "log.mcap, 2 readings" in capsys.readouterr().err
    assert [float(row["down_m"]) for row in found] == pytest.approx([0.3, 0.3], abs=0.05)
    log.write_bytes(log.read_bytes()[:-40])
    code, found = seen(log, tmp_path)
    assert (code, len(found)) == (1, 2)
    assert "log.mcap breaks off: 2 pictures read, the log was not closed" in capsys.readouterr().err
