"""The flight log: nothing is lost, the same flight gives the same bytes, viewers see the true geometry."""

import dataclasses
import itertools
import json
import math
import re

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_flight import CAMERA, INFO, RIG, VERDICT, corners_px, flight, log_of, record_at, truth_at, write_log
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_protobuf.decoder import DecoderFactory

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.frames import Pose, rotation_from_quaternion
from shipland.messages import (
    Box,
    Decision,
    FlightRecord,
    GimbalAttitude,
    GroundTruth,
    Intent,
    Mode,
    Observation,
    PilotCommand,
    TouchdownVerdict,
)
from shipland.record.channels import LogParameters
from shipland.record.columns import Derived, FlightColumns, derive
from shipland.record.foxglove_scene import nanoseconds, timestamp
from shipland.record.info import FORMAT_VERSION, FlightInfo, LogHeader, config_digest
from shipland.record.reader import read_log
from shipland.record.writer import LogWriter
from shipland.report.plots import plot_flight
from shipland.rows import from_row, json_schema, to_row
from shipland.vision.log_pictures import read_pictures

FROM_S, TO_S = 31.0, 33.0
"""Of the made-up flight: hover, and from 31.5 s on the landing."""


def messages(path, topic):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [item.decoded_message for item in reader.iter_decoded_messages(topics=[topic])]


def same(first, last):
    return json.dumps(to_row(first)) == json.dumps(to_row(last))


@pytest.fixture(scope="module")
def landing_log(tmp_path_factory):
    """Two seconds of the made-up flight with pictures, as a log."""
    return write_log(tmp_path_factory.mktemp("log") / "flight.mcap", flight(from_s=FROM_S, to_s=TO_S))


# Rows


@pytest.mark.parametrize("t_s", [0.0, 5.0, 10.0, 20.0, 33.0, 34.5])
@pytest.mark.parametrize("witnessed", [True, False])
def test_a_row_holds_a_record_without_loss(t_s, witnessed):
    record = record_at(t_s, np.random.default_rng(3), pictures=False, witnessed=witnessed)
    back = from_row(FlightRecord, json.loads(json.dumps(to_row(record), allow_nan=False)))
    assert same(record, back)
    assert (back.truth is None) == (not witnessed)
    assert (back.observation.bar_pose is None) == (record.observation.bar_pose is None)
    assert back.decision.mode is record.decision.mode
    if witnessed:
        # bit for bit, so that a figure remade from the log is the figure made in flight
        assert np.array_equal(back.truth.ned_from_camera.matrix(), record.truth.ned_from_camera.matrix())


@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.one_of(st.none(), st.tuples(*[st.floats(-1e6, 1e6)] * 5)),
    st.text(),
    st.sampled_from(Mode),
)
def test_any_decision_and_box_come_back(number, box, reason, mode):
    boxed = None if box is None else Box((box[0], box[1]), (box[2], box[3]), box[4])
    observation = Observation(number, GimbalAttitude(0.0, number, 0.0), ship_box=boxed, reason=reason)
    decision = Decision(PilotCommand(number, 1.0, 2.0, 3.0, 4.0, 0.0, Intent.GO_AROUND), mode, reason)
    for value in (observation, decision):
        assert from_row(type(value), json.loads(json.dumps(to_row(value)))) == value


def test_all_rows_have_the_same_columns_and_these_are_in_the_schema():
    rows = [to_row(record_at(t_s, np.random.default_rng(3), pictures=False)) for t_s in (0.0, 5.0, 10.0, 33.0)]
    bare = dataclasses.replace(record_at(5.0, np.random.default_rng(3), witnessed=False))
    rows.append(to_row(bare))
    described = json_schema(FlightRecord, "row")["properties"]
    for row in rows:
        assert list(row) == list(described)


def test_columns_of_numbers_carry_their_unit():
    described = json_schema(FlightRecord, "row")["properties"]
    unit = re.compile(r"_(s|m|rad|px|mps|percent)$")
    without = {
        name for name, what in described.items() if what["type"] in ("number", "array") and not unit.search(name)
    }
    # A rotation, a direction, a confidence and a probability have no unit; the covariance has four, said in BarPose.
    unitless = ("_rotation", "_normal_in_level", "_confidence", "_covariance", "_probability")
    assert all(name.endswith(unitless) for name in without), without


@pytest.mark.parametrize("cls", [FlightRecord, TouchdownVerdict, Derived, LogHeader])
def test_every_column_says_what_it_means(cls):
    columns = json_schema(cls, "row")["properties"]
    assert not [name for name, what in columns.items() if len(what.get("description", "")) < 3]


def test_a_nested_column_says_whose_it_is():
    columns = json_schema(FlightRecord, "row")["properties"]
    said = {name: what["description"] for name, what in columns.items()}
    assert said["telemetry_roll_rad"] == said["telemetry_pitch_rad"] == "attitude of `body` against `level`"
    assert said["truth_ned_from_deck_translation_m"].startswith("the deck with all motions: (3,), the child's origin")
    # of several lines in the docstring
    assert said["telemetry_velocity_t_s"].endswith("on the vehicle's clock [s]; None means `t_s`")


def test_numbers_that_json_lacks_become_nan():
    verdict = dataclasses.replace(VERDICT, slip_m=math.inf, rest_in_deck_m=np.array([math.nan, 1.0]))
    back = from_row(TouchdownVerdict, json.loads(json.dumps(to_row(verdict), allow_nan=False)))
    assert math.isnan(back.slip_m)
    assert math.isnan(back.rest_in_deck_m[0])
    assert back.rest_in_deck_m[1] == 1.0


def test_a_row_of_another_version_is_refused_by_the_column_it_lacks():
    row = to_row(VERDICT)
    del row["slip_m"]
    with pytest.raises(DataError, match="slip_m"):
        from_row(TouchdownVerdict, row)
    with pytest.raises(DataError, match="landed is 'yes', expected bool"):
        from_row(TouchdownVerdict, to_row(VERDICT) | {"landed": "yes"})
    decision = Decision(PilotCommand(0.0, 1.0, 2.0, 3.0, 4.0, 0.0, Intent.GO_AROUND), Mode.LAND, "")
    with pytest.raises(DataError, match="mode is 'SWIM', expected one of SEARCH"):
        from_row(Decision, to_row(decision) | {"mode": "SWIM"})


def test_header_comes_back_with_rig_and_lens():
    camera = Camera(640, 480, np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]]), np.array([0.1, -0.2, 0, 0, 0.01]))
    own_cue = dataclasses.replace(RIG, polygon=RIG.cue.polygon[:1], manufacturing_tolerance=0.01)
    header = LogHeader(1, FlightInfo("sea trial", None, "paper", "0.1.0", "ab", 0.24, command="x"), own_cue, camera)
    back = from_row(LogHeader, json.loads(json.dumps(to_row(header))))
    assert back.info == header.info
    assert back.rig == own_cue
    assert np.array_equal(back.camera.distortion, camera.distortion)


def test_the_digest_ignores_the_order_of_keys_only():
    assert config_digest({"a": 1, "b": {"c": 2.0, "d": 3}}) == config_digest({"b": {"d": 3, "c": 2.0}, "a": 1})
    assert config_digest({"a": 1}) != config_digest({"a": 2})
    assert re.fullmatch("[0-9a-f]{16}", config_digest({}))


# The file


def test_the_log_gives_back_the_flight(landing_log):
    log, flown = read_log(landing_log), log_of(flight(from_s=FROM_S, to_s=TO_S, pictures=False))
    assert len(log.records) == 60
    assert log == flown
    assert log != dataclasses.replace(flown, verdict=None)
    assert log != dataclasses.replace(flown, records=flown.records[1:])


def test_the_same_flight_gives_the_same_bytes(landing_log, tmp_path):
    again = write_log(tmp_path / "again.mcap", flight(from_s=FROM_S, to_s=TO_S))
    other = write_log(tmp_path / "other.mcap", flight(seed=8, from_s=FROM_S, to_s=TO_S))
    assert again.read_bytes() == landing_log.read_bytes()
    assert other.read_bytes() != landing_log.read_bytes()


def test_an_earlier_flight_is_written_over(tmp_path):
    path = write_log(tmp_path / "flight.mcap", flight(from_s=20.0, to_s=21.0, pictures=False))
    write_log(path, flight(from_s=20.0, to_s=20.2, pictures=False), verdict=None)
    log = read_log(path)
    assert len(log.records) == 6
    assert log.verdict is None


@pytest.mark.parametrize("kind", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_flight_leaves_a_closed_log(kind, tmp_path):
    path = tmp_path / "deep" / "flight.mcap"
    with pytest.raises(kind), LogWriter(path, INFO, RIG, CAMERA, LogParameters()) as writer:
        for count, record in enumerate(flight(from_s=20.0, to_s=30.0, pictures=False)):
            if count == 40:
                raise kind
            writer.append(record)
    log = read_log(path)
    assert log.complete
    assert len(log.records) == 40
    assert log.verdict is None


def test_a_killed_flight_leaves_what_was_on_the_disk(landing_log, tmp_path):
    whole, path = landing_log.read_bytes(), tmp_path / "cut.mcap"
    counts = []
    for share in np.linspace(0.0, 0.999, 20):
        path.write_bytes(whole[: int(share * len(whole))])
        try:
            log = read_log(path)
        except DataError:  # not even the header is there
            counts.append(0)
            continue
        assert not log.complete
        counts.append(len(log.records))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == 60


def test_of_a_flight_that_is_killed_all_but_the_last_second_is_on_the_disk(tmp_path):
    path, seen = tmp_path / "flight.mcap", tmp_path / "seen.mcap"
    with LogWriter(path, INFO, RIG, CAMERA, LogParameters()) as writer:
        for count, record in enumerate(flight(from_s=20.0, to_s=23.0, pictures=False)):
            writer.append(record)
            if count % 10 == 0:
                seen.write_bytes(path.read_bytes())  # what a SIGKILL would leave
                log = read_log(seen)
                assert not log.complete
                assert record.frame.t_s - log.records[-1].frame.t_s < 1.0
                assert len(log.records) > 30 * (log.records[-1].frame.t_s - 20.0)


def test_the_log_says_why_the_flight_ended(tmp_path):
    with LogWriter(tmp_path / "f.mcap", INFO, RIG, CAMERA, LogParameters()) as writer:
        writer.append(next(flight(from_s=20.0, to_s=20.1, pictures=False)))
        writer.finish(None, "the pilot took over: LOITER")
    told = messages(tmp_path / "f.mcap", "/log")[-1]
    assert (told.name, told.message) == ("flight", "the pilot took over: LOITER")


def test_what_is_no_flight_log_is_said_in_words(tmp_path):
    with pytest.raises(DataError, match="cannot be read: No such file"):
        read_log(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("no log at all, but long enough for a header")
    with pytest.raises(DataError, match="not an MCAP file"):
        read_log(tmp_path / "text.mcap")
    (tmp_path / "empty.mcap").write_bytes(b"")
    with pytest.raises(DataError, match=r"not an MCAP file, .*: it is empty$"):
        read_log(tmp_path / "empty.mcap")
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        LogWriter(tmp_path / "file" / "flight.mcap", INFO, RIG, CAMERA, LogParameters())


@pytest.fixture(scope="module")
def small_log(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("small") / "flight.mcap", flight(from_s=33.8, to_s=33.84))


@pytest.mark.parametrize("value", [2**40, 2**63])
def test_lengths_that_no_file_has_end_the_log_or_are_one_line(small_log, tmp_path, value):
    """Every length and time of the first records and of the first chunk, in turn."""
    whole, path = small_log.read_bytes(), tmp_path / "hostile.mcap"
    for start in range(8, 408, 2):
        path.write_bytes(whole[:start] + value.to_bytes(8, "little") + whole[start + 8 :])
        for read in (read_log, lambda path: list(read_pictures(path))):
            try:
                read(path)
            except DataError as error:
                assert "\n" not in str(error)


def test_of_a_damaged_log_that_another_tool_compressed_what_is_before_it_is_read(small_log, tmp_path):
    """LZ4's damage is an error of its own kind."""
    path = tmp_path / "lz4.mcap"
    with small_log.open("rb") as source, path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start()
        channels = {}
        for _, channel, message in make_reader(source).iter_messages():
            if channel.topic not in channels:
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, 0)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    whole = path.read_bytes()
    assert len(read_log(path).records) == len(read_log(small_log).records)
    at = whole.index(b"lz4") + 100
    path.write_bytes(whole[:at] + bytes(300) + whole[at + 300 :])
    with pytest.raises(DataError, match=r"lz4\.mcap"):
        read_log(path)


@pytest.fixture
def logged(tmp_path):
    """Writes a log of these texts as rows, under a header."""

    def write(*rows, **of_header):
        path = tmp_path / "rows.mcap"
        with path.open("wb") as stream:
            writer = Writer(stream, compression=CompressionType.NONE)
            writer.start()
            header = json.dumps(to_row(LogHeader(FORMAT_VERSION, INFO, RIG, CAMERA)) | of_header).encode()
            for topic, data in (("/header", header), *(("/flight", row) for row in rows)):
                channel = writer.register_channel(topic, "json", 0)
                writer.add_message(channel, log_time=0, publish_time=0, data=data)
            writer.finish()
        return path

    return write


def test_a_row_that_is_no_json_is_one_line(logged, rng):
    good = json.dumps(to_row(record_at(33.0, rng))).encode()
    assert len(read_log(logged(good, good)).records) == 2
    for bad in (b'{"a": ', b"[" * 100_000, b'{"a": ' + b"1" * 5000 + b"}", b"\xff", b"3"):
        with pytest.raises(DataError, match=r"rows\.mcap: message 2 of /flight is no row"):
            read_log(logged(good, bad, good))
    with pytest.raises(DataError, match=r"rows\.mcap: a row of FlightRecord"):
        read_log(logged(good, b"[]", good))


def test_a_row_without_a_time_and_a_seed_below_zero_are_one_line(logged, rng):
    row = to_row(record_at(33.0, rng))
    with pytest.raises(DataError, match=r"rows\.mcap: seed -1, expected 0 or more"):
        read_log(logged(json.dumps(row).encode(), info_seed=-1))
    for time in ("frame_t_s", "telemetry_t_s"):
        with pytest.raises(DataError, match=r"rows\.mcap: row 1 of /flight has no time"):
            read_log(logged(json.dumps(row | {time: None}).encode()))


@pytest.mark.parametrize(
    ("vision", "std_rad"),
    [({"gimbal_noise_rad": 0.01}, 0.01), *((it, 0.001) for it in ({}, 3, {"gimbal_noise_rad": "large"}))],
)
def test_the_attitude_in_a_log_is_as_exact_as_the_flight_took_it(landing_log, vision, std_rad):
    log = read_log(landing_log)
    info = dataclasses.replace(INFO, configuration=json.dumps({"vision": vision}))
    again = dataclasses.replace(log, header=dataclasses.replace(log.header, info=info))
    assert again.attitude(landing_log).std_rad == std_rad


def test_a_log_of_another_format_says_so_whatever_its_header_lacks(logged):
    for of_header in ({"format_version": 9}, {"format_version": 9, "info_scenario": 3}):
        with pytest.raises(DataError, match=r"rows\.mcap is a flight log of format 9, expected 2"):
            read_log(logged(**of_header))


# What viewers see


def pose_of(transform):
    t, q = transform.translation, transform.rotation
    return Pose(rotation_from_quaternion(np.array([q.w, q.x, q.y, q.z])), np.array([t.x, t.y, t.z]))


def world_poses(message):
    """Frame → world_from_frame, by following parents as a viewer does."""
    edges = {one.child_frame_id: (one.parent_frame_id, pose_of(one)) for one in message.transforms}

    def world_from(frame):
        if frame == "world":
            return Pose.identity()
        parent, pose = edges[frame]
        return world_from(parent) @ pose

    return {frame: world_from(frame) for frame in edges}


def test_the_tree_of_frames_is_the_truth_under_a_z_up_root(landing_log):
    for message, record in zip(
        messages(landing_log, "/tf"), flight(from_s=FROM_S, to_s=TO_S, pictures=False), strict=True
    ):
        poses = world_poses(message)
        assert set(poses) == {"ned", "ship", "deck", "bar", "body", "camera"}
        north_m, east_m, down_m = record.truth.ned_from_body.translation_m
        # rounding only
        assert poses["body"].translation_m == pytest.approx([north_m, -east_m, -down_m], abs=1e-9)
        corners = CAMERA.project((poses["camera"].inverse() @ poses["bar"]).apply(RIG.cue.points_in_bar_m))
        assert corners == pytest.approx(corners_px(record.truth, CAMERA), abs=1e-6)
        deck = (poses["ship"].inverse() @ poses["deck"]).matrix()
        want = (record.truth.ned_from_ship.inverse() @ record.truth.ned_from_deck).matrix()
        assert deck == pytest.approx(want, abs=1e-9)


def test_without_truth_the_tree_shows_the_estimate_at_a_still_ship(tmp_path):
    records = list(flight(from_s=12.0, to_s=14.0, pictures=False, witnessed=False))
    for message, record in zip(messages(write_log(tmp_path / "f.mcap", records), "/tf"), records, strict=True):
        poses = world_poses(message)
        estimate = record.decision.estimate
        assert ("body" in poses) == (estimate is not None)
        assert poses["bar"].translation_m[2] == pytest.approx(RIG.bar_height_m)
        if estimate is not None:
            assert (poses["bar"].inverse() @ poses["body"]).translation_m == pytest.approx(
                estimate.aircraft_in_bar_m, abs=1e-9
            )
            # the camera is stabilised: its optical axis keeps the horizon whatever the body does
            assert poses["camera"].rotation[2, 2] == pytest.approx(math.sin(record.frame.gimbal.pitch_rad), abs=1e-9)


def test_pictures_come_at_their_rate_and_fit_their_calibration_and_corners(landing_log):
    pictures = messages(landing_log, "/camera/image")
    calibrations = messages(landing_log, "/camera/calibration")
    annotations = messages(landing_log, "/camera/annotations")
    assert len(pictures) == len(calibrations) == len(annotations) == 20  # 2 s at 10 Hz
    for picture, calibration, annotation in zip(pictures, calibrations, annotations, strict=True):
        image = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR)
        assert image.shape == (360, 640, 3)
        assert (calibration.width, calibration.height) == (640, 360)
        t_s = picture.timestamp.seconds + 1e-9 * picture.timestamp.nanos
        camera = Camera(640, 360, np.array(calibration.K).reshape(3, 3))
        drawn = np.array([[point.x, point.y] for loop in annotation.points for point in loop.points])
        # 0.2 px of noise on 1280 px are 0.1 px here: five deviations; and the half pixel that scaling moves centres by
        assert drawn == pytest.approx(corners_px(truth_at(t_s), camera), abs=0.5 + 0.25)
        centre = drawn[:4].mean(axis=0)
        blue, green, red = image[round(centre[1]), round(centre[0])].astype(int)
        assert green > max(blue, red) + 80


def test_no_pictures_when_none_are_wanted_or_given(tmp_path):
    none = LogParameters(image_rate_hz=0.0)
    path = write_log(tmp_path / "none.mcap", flight(from_s=33.0, to_s=33.3), parameters=none)
    assert messages(path, "/camera/image") == []
    path = write_log(tmp_path / "blind.mcap", flight(from_s=33.0, to_s=33.3, pictures=False))
    assert messages(path, "/camera/image") == []


def test_a_lens_with_distortion_is_calibrated_as_ros_names_it(tmp_path):
    for count, name, length in ((4, "plumb_bob", 5), (5, "plumb_bob", 5), (8, "rational_polynomial", 8)):
        camera = Camera(1280, 720, CAMERA.matrix, np.full(count, 0.01))
        path = write_log(tmp_path / "f.mcap", [record_at(33.0, np.random.default_rng(1))], camera=camera)
        (calibration,) = messages(path, "/camera/calibration")
        assert calibration.distortion_model == name
        assert len(calibration.D) == length


def test_the_log_tells_each_change_of_mode_with_its_reason(tmp_path):
    path = write_log(tmp_path / "f.mcap", itertools.islice(flight(pictures=False), 0, None, 8))
    told = [message.message for message in messages(path, "/log")]
    assert told[0] == "SEARCH: nothing seen yet"
    modes = ["SEARCH", "TRACK_SHIP", "TRACK_BAR", "APPROACH", "LAND", "DONE"]
    assert [line.split(":")[0] for line in told[:-1]] == modes
    assert told[-1] == VERDICT.reason


def test_solids_stand_in_their_frames(landing_log):
    (scene,) = messages(landing_log, "/scene")
    assert {entity.frame_id for entity in scene.entities} == {"ship", "deck", "bar", "body"}
    assert all(entity.frame_locked for entity in scene.entities)
    platform = next(entity for entity in scene.entities if entity.id == "platform")
    low = min(cube.pose.position.z + 0.5 * cube.size.z for cube in platform.cubes)
    assert low == pytest.approx(RIG.deck_height_m)  # its foot is the sea plane, z down
    bow = max(cube.pose.position.x + 0.5 * cube.size.x for cube in platform.cubes)
    assert bow == pytest.approx(RIG.platform_length_m - RIG.deck_ahead_of_stern_m)


def json_messages(path, topic):
    with path.open("rb") as stream:
        return [(schema, json.loads(message.data)) for schema, _, message in make_reader(stream).iter_messages([topic])]


@pytest.mark.parametrize("topic", ["/header", "/flight", "/verdict"])
def test_viewers_can_parse_the_schemas_and_they_fit_the_rows(landing_log, topic):
    # Foxglove's and Lichtblick's parseJsonSchema.ts throw on lists of types, nested arrays and arrays without items.
    rows = json_messages(landing_log, topic)
    described = json.loads(rows[0][0].data)
    assert described["type"] == "object"
    kinds = {"number": (int, float), "integer": int, "boolean": bool, "string": str, "array": list}
    for name, what in described["properties"].items():
        plain = {key: value for key, value in what.items() if key != "description"}  # as Foxglove's own schemas have it
        assert plain in (
            {"type": "number"}, {"type": "integer"}, {"type": "boolean"}, {"type": "string"},
            {"type": "array", "items": {"type": "number"}},
        )  # fmt: skip
        for _, row in rows:
            assert row[name] is None or isinstance(row[name], kinds[what["type"]])
            if what["type"] == "array" and row[name] is not None:
                assert all(item is None or isinstance(item, int | float) for item in row[name])
    assert all(set(row) == set(described["properties"]) for _, row in rows)


def test_derived_columns_are_in_the_row_by_name(landing_log):
    row = json_messages(landing_log, "/flight")[0][1]
    truth_m = row["derived_truth_in_pad_m"]
    assert truth_m[2] == pytest.approx(1.2, abs=0.1)  # the made-up flight hovers at 1.2 m then
    assert row["derived_mode_number"] == Mode.APPROACH.value


# Columns


def hover(place_in_ship_m, deck=(0.0, 0.0, 0.0), yaw_rad=0.0):
    ship = Pose.from_euler([10.0, -4.0, -RIG.deck_height_m], 0.0, 0.0, 2.0)
    body = ship @ Pose.from_euler(place_in_ship_m, 0.0, 0.0, yaw_rad)
    return GroundTruth(
        0.0, body, np.zeros(3), ship, ship @ Pose.from_euler(deck, 0.1, -0.05, 0.0), ship @ RIG.ship_from_bar,
        body, np.zeros(3),
    )  # fmt: skip


def test_places_are_forward_right_up_from_the_pad():
    record = record_at(20.0, np.random.default_rng(1), pictures=False)
    truth = hover([-0.3, 0.2, -1.1], deck=(0.0, 0.0, 0.25), yaw_rad=0.07)
    derived = derive(dataclasses.replace(record, truth=truth), RIG)
    assert derived.truth_in_pad_m == pytest.approx([-0.3, 0.2, 1.1])
    assert derived.truth_yaw_rad == pytest.approx(0.07)
    assert derived.deck_shift_m == pytest.approx([0.0, 0.0, -0.25])  # down in `ship` is a sunk deck
    assert derived.deck_turn_rad == pytest.approx([0.1, -0.05, 0.0])
    level = derive(dataclasses.replace(record, truth=hover([0.0, 0.0, -1.0])), RIG)
    assert float(np.linalg.norm(level.truth_in_deck_m)) == pytest.approx(1.0)


def test_the_vision_s_error_is_seen_minus_true():
    record = record_at(33.0, np.random.default_rng(1), pictures=False)
    pose, truth = record.observation.bar_pose, record.truth
    true_m = (truth.ned_from_bar.inverse() @ truth.ned_from_camera).translation_m
    shifted = dataclasses.replace(pose, position_in_bar_m=true_m + np.array([0.1, -0.2, 0.3]))
    observation = dataclasses.replace(record.observation, bar_pose=shifted)
    derived = derive(dataclasses.replace(record, observation=observation), RIG)
    assert derived.vision_error_m == pytest.approx([0.1, -0.2, 0.3])
    assert abs(derived.vision_error_yaw_rad) < 0.05  # five deviations of the made-up noise


def test_speed_is_against_the_moving_ship():
    records = [record_at(t_s, np.random.default_rng(1), pictures=False) for t_s in np.arange(26.0, 30.0, 1 / 30)]
    columns = FlightColumns.from_records(records, RIG)
    # the ship makes 2 m/s, the aircraft hangs over it with a few cm/s of sway
    assert np.abs(columns.speed_in_pad_mps).max() < 0.3


def test_spans_of_modes_cover_the_flight_without_gap():
    columns = FlightColumns.from_records(list(flight(pictures=False)), RIG)
    spans = columns.mode_spans()
    assert [mode for _, _, mode in spans] == [
        Mode.SEARCH, Mode.TRACK_SHIP, Mode.TRACK_BAR, Mode.APPROACH, Mode.LAND, Mode.DONE,
    ]  # fmt: skip
    assert all(first[1] == then[0] for first, then in itertools.pairwise(spans))
    assert spans[0][0] == columns.t_s[0]
    assert spans[-1][1] == columns.t_s[-1]
    assert FlightColumns.from_records([], RIG).mode_spans() == []


def test_a_flight_without_modes_is_logged_and_read_back(unarranged, tmp_path):
    records = [
        dataclasses.replace(record, decision=dataclasses.replace(record.decision, mode=None))
        for record in flight(from_s=33.0, to_s=33.2, pictures=False)
    ]
    log = read_log(write_log(tmp_path / "f.mcap", records))
    assert {record.decision.mode for record in log.records} == {None}
    assert [mode for _, _, mode in log.columns().mode_spans()] == [None]
    for record, back in zip(records, log.records, strict=True):
        assert back.decision.estimate.t_s == record.decision.estimate.t_s
    plot_flight(tmp_path / "plots.png", log, dpi=60)
    assert (tmp_path / "plots.png").stat().st_size > 10_000


@pytest.mark.parametrize("t_s", [-5.0, 1e12, 1e300])
def test_a_time_beyond_the_format_is_written_as_its_bound(t_s):
    stamp = timestamp(nanoseconds(t_s))
    assert (stamp.sec, stamp.nsec) == ((0, 0) if t_s < 0.0 else (2**32 - 1, 999_999_999))


def test_a_log_from_before_a_field_was_added_is_read():
    header = LogHeader(1, INFO, RIG, CAMERA)
    row = to_row(header)
    assert row.pop("info_weights_digest") == INFO.weights_digest
    assert row.pop("rig_landing_area") == RIG.landing_area
    again = from_row(LogHeader, row)
    assert again.info == dataclasses.replace(INFO, weights_digest="")
    assert again.rig.landing_area == "square"
    del row["info_seed"]  # a field without a default
    with pytest.raises(DataError, match="lacks the column 'info_seed'"):
        from_row(LogHeader, row)
