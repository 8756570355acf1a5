"""The video keeps the pace of the flight, shows the newest cycle, and is written while flying."""

import dataclasses
import math
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_flight import CAMERA, RIG, VERDICT, flight, record_at, truth_at

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.frames import euler_from_rotation
from shipland.messages import Box, Estimate, GimbalAttitude, Observation
from shipland.report.chase import chase_camera, chase_state, look_at
from shipland.report.lettering import put_text, text_width, wrap_text
from shipland.report.overlay import STRIP_HEIGHT_PX, Instruments, draw_sight, draw_zoom
from shipland.report.palette import SKY, bgr
from shipland.report.video import FlightVideo, Moments, VideoParameters, VideoWriter, between

PARAMETERS = VideoParameters(verdict_hold_s=0.5)
SMALL = Camera.from_fov(320, 180, 69.0)


def film(path, records, chase=None, verdict=None, parameters=PARAMETERS, camera=CAMERA):
    video = FlightVideo(path, RIG, camera, parameters, chase)
    for record in records:
        video.append(record)
    video.finish(verdict)
    return path


def frames_of(path):
    with av.open(str(path)) as container:
        return [(frame.time, frame.to_ndarray(format="bgr24")) for frame in container.decode(video=0)]


def grey_records(times_s, levels):
    """Records whose picture is one grey level each, without anything seen in it."""
    rng = np.random.default_rng(1)
    for t_s, level in zip(times_s, levels, strict=True):
        record = record_at(t_s, rng, pictures=False)
        image = np.full((180, 320, 3), level, np.uint8)
        observation = Observation(t_s, GimbalAttitude(0.0, 0.0))
        yield dataclasses.replace(record, frame=dataclasses.replace(record.frame, image=image), observation=observation)


def test_the_newest_cycle_is_shown_in_the_pace_of_the_flight(tmp_path):
    # a slow detector's cycles, then fast ones, off the video's ticks
    times_s = [3.0, 3.5, 4.02, 4.2, 4.22, 4.29, 4.9]
    levels = [20, 60, 100, 140, 180, 220, 250]
    frames = frames_of(film(tmp_path / "f.mp4", grey_records(times_s, levels), camera=SMALL))
    held = round(PARAMETERS.verdict_hold_s * 30)
    assert len(frames) == math.ceil(1.9 * 30) + 1 + held
    for count, (shown_s, image) in enumerate(frames):
        assert shown_s == pytest.approx(count / 30.0, abs=1e-3)
        newest = max(index for index, t_s in enumerate(times_s) if t_s <= 3.0 + count / 30.0 + 1e-6)
        # H.264 at this quality keeps a flat grey within a few levels
        assert image[100, 300].mean() == pytest.approx(levels[newest], abs=6)


def test_size_codec_and_layout(tmp_path):
    chase = np.full((540, 640, 3), (0, 0, 200), np.uint8)
    path = film(tmp_path / "f.mp4", flight(from_s=33.0, to_s=33.4), chase=lambda _: chase, verdict=VERDICT)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.profile) in (
            ("h264", "High"),
            ("mpeg4", "Simple Profile"),
        )
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert (stream.width, stream.height) == (1600, 540 + STRIP_HEIGHT_PX)
    image = frames_of(path)[5][1]
    blue, green, red = image[270, 1280].astype(int)
    assert red > 170
    assert max(blue, green) < 40
    lone = frames_of(film(tmp_path / "lone.mp4", flight(from_s=33.0, to_s=33.1)))[0][1]
    assert lone.shape == (540 + STRIP_HEIGHT_PX, 960, 3)


def test_the_same_flight_gives_the_same_film(tmp_path):
    def chase(truth):
        return np.full((540, 640, 3), int(40 * truth.t_s) % 256, np.uint8)

    films = [
        film(tmp_path / f"{n}.mp4", flight(from_s=31.0, to_s=31.2), chase=chase, verdict=VERDICT) for n in range(2)
    ]
    assert films[0].read_bytes() == films[1].read_bytes()


def test_the_chase_view_moves_smoothly_between_slow_cycles(tmp_path):
    seen_s = []

    def chase(truth):
        seen_s.append(truth.t_s)
        return np.zeros((540, 640, 3), np.uint8)

    parameters = dataclasses.replace(PARAMETERS, chase_rate_hz=10.0)
    film(tmp_path / "f.mp4", flight(from_s=5.0, to_s=7.0, pictures=False), chase=chase, parameters=parameters)
    assert len(seen_s) == pytest.approx(1.5 * 10.0, abs=1)  # cycles every half second, the last at 6.5 s
    assert np.diff(seen_s) == pytest.approx(0.1, abs=1e-6)


def test_a_vehicle_without_truth_and_pictures_is_filmed_too(tmp_path):
    def never(_):
        raise AssertionError("there is no truth to render")

    path = film(tmp_path / "f.mp4", flight(from_s=32.5, to_s=33.0, pictures=False, witnessed=False), chase=never)
    image = frames_of(path)[3][1]
    assert image[:540].std() > 1.0  # the corners are drawn on the blank


def test_no_cycle_no_film_and_an_old_one_is_gone(tmp_path):
    path = tmp_path / "f.mp4"
    path.write_text("an earlier flight")
    FlightVideo(path, RIG, CAMERA, PARAMETERS).finish(None)
    assert not path.exists()


def test_a_film_that_is_broken_off_can_be_played(tmp_path):
    path = tmp_path / "f.mp4"
    video = FlightVideo(path, RIG, CAMERA, PARAMETERS)
    for record in flight(from_s=33.0, to_s=34.0):
        video.append(record)
    video.close()
    video.close()
    assert len(frames_of(path)) == 29


def test_a_film_that_cannot_be_written_is_said_in_words(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        VideoWriter(tmp_path / "file" / "f.mp4", 320, 180, PARAMETERS)
    writer = VideoWriter(tmp_path / "f.mp4", 320, 180, PARAMETERS)
    with pytest.raises(ValueError, match=r"shape \(180, 320, 3\), got \(10, 10, 3\)"):
        writer.write(np.zeros((10, 10, 3), np.uint8), 0.0)
    writer.close()


def test_without_x264_the_film_is_mpeg4(tmp_path, monkeypatch):
    monkeypatch.setattr(av.codec, "codecs_available", av.codec.codecs_available - {"libx264"})
    path = film(tmp_path / "f.mp4", flight(from_s=33.0, to_s=33.19))
    with av.open(str(path)) as container:
        assert container.streams.video[0].codec_context.name == "mpeg4"
    assert len(frames_of(path)) == 6 + 15


def test_another_aspect_keeps_its_proportions(tmp_path):
    camera = Camera.from_fov(640, 480, 60.0)
    records = (
        dataclasses.replace(record, frame=dataclasses.replace(record.frame, image=np.zeros((480, 640, 3), np.uint8)))
        for record in flight(from_s=33.0, to_s=33.1, pictures=False)
    )
    assert frames_of(film(tmp_path / "f.mp4", records, camera=camera))[0][1].shape == (720 + STRIP_HEIGHT_PX, 960, 3)
    assert (chase_camera(camera).width_px, chase_camera(camera).height_px) == (640, 720)


# Interpolated truth


@given(st.floats(0.0, 30.0), st.floats(0.01, 0.6), st.floats(0.0, 1.0))
def test_between_two_truths_lies_the_truth(from_s, step_s, share):
    first, last = truth_at(from_s), truth_at(from_s + step_s)
    middle = between(first, last, from_s + share * step_s)
    want = truth_at(from_s + share * step_s)
    # the made-up flight bends by at most 3 m/s² and 1 rad/s², over half of 0.6 s: ½·a·t²
    assert middle.t_s == pytest.approx(want.t_s)
    assert middle.ned_from_body.translation_m == pytest.approx(want.ned_from_body.translation_m, abs=0.15)
    assert middle.ned_from_deck.rotation == pytest.approx(want.ned_from_deck.rotation, abs=0.05)
    assert middle.ned_from_body.rotation @ middle.ned_from_body.rotation.T == pytest.approx(np.eye(3), abs=1e-9)


def test_between_is_exact_at_its_ends_and_holds_beyond():
    first, last = truth_at(20.0), truth_at(20.5)
    for t_s, want in ((19.0, first), (20.0, first), (20.5, last), (21.0, last)):
        assert between(first, last, t_s).ned_from_camera.matrix() == pytest.approx(
            want.ned_from_camera.matrix(), abs=1e-12
        )
    assert between(first, first, 20.0).t_s == first.t_s


def test_traces_of_the_deck_are_smooth_between_slow_cycles():
    instruments, period_s = Instruments(with_traces=True, trace_s=10.0), 3.0

    def heave_m(t_s):
        return 0.5 * np.sin(2.0 * np.pi * t_s / period_s)

    for t_s in np.arange(0.0, 12.01, 0.5):  # a detector's cycles
        deck = SimpleNamespace(deck_turn_rad=np.zeros(3), deck_shift_m=np.array([0.0, 0.0, heave_m(t_s)]))
        instruments.note(t_s, deck)
        instruments.note(t_s, deck)  # once more changes nothing
    times_s = np.linspace(3.0, 11.0, 81)
    # A straight line between them is off by up to 6 cm.
    assert instruments._deck_at(times_s)[:, 2] == pytest.approx(heave_m(times_s), abs=0.01)


def test_traces_of_a_large_ship_are_not_cut_off():
    """A frigate heaves by metres: the trace keeps its crests, which a fixed range of 0.7 m would flatten."""
    rows_px = []
    for heave_m in (0.5, 2.5):
        instruments = Instruments(with_traces=True, trace_s=10.0)
        for t_s in np.arange(0.0, 10.01, 0.1):
            lift_m = heave_m * np.sin(2.0 * np.pi * t_s / 5.0)
            instruments.note(t_s, SimpleNamespace(deck_turn_rad=np.zeros(3), deck_shift_m=np.array([0, 0, lift_m])))
        strip = np.zeros((STRIP_HEIGHT_PX, 1600, 3), np.uint8)
        instruments._draw_traces(strip, 10.0)
        drawn = strip[28:, 1389:1588].any(axis=2)
        rows_px.append(drawn.argmax(axis=0).astype(float))
    for row_px in rows_px:  # a sine is within 5 % of its crest for a fifth of the time, a cut one for far longer
        assert 0.1 < np.mean(row_px < row_px.min() + 1.5) < 0.3
        assert row_px.max() - row_px.min() > 25.0


# The outside view


@pytest.mark.parametrize("t_s", [0.0, 8.0, 15.0, 22.0, 30.0, 33.0, 34.5])
def test_the_chase_view_holds_the_aircraft_and_looks_at_the_ship(t_s):
    truth, camera = truth_at(t_s), chase_camera(CAMERA)
    state = chase_state(truth)
    camera_from_ned = state.ned_from_camera.inverse()
    for point_m, margin_px in (
        (truth.ned_from_body.translation_m, 60.0),  # the whole aircraft, not only its centre
        (truth.ned_from_deck.translation_m, 0.0),
    ):
        column, row = camera.project(camera_from_ned.apply(point_m))[0]
        assert margin_px <= column <= camera.width_px - margin_px
        assert margin_px <= row <= camera.height_px - margin_px
    assert state.ned_from_camera.translation_m[2] <= -0.5 + 1e-9  # never under water
    offset_m = truth.ned_from_ship.rotation.T @ (
        state.ned_from_camera.translation_m - truth.ned_from_body.translation_m
    )
    assert list(np.sign(offset_m)) == [-1.0, 1.0, -1.0]  # astern, to starboard, above
    assert state.ned_from_camera.rotation[2, 0] == pytest.approx(0.0, abs=1e-12)  # its horizon is level


def test_look_at_puts_the_aim_in_the_middle_and_up_at_the_top():
    pose = look_at(np.array([1.0, 2.0, -3.0]), np.array([4.0, -2.0, -1.0]))
    seen = pose.inverse().apply(np.array([[4.0, -2.0, -1.0], [4.0, -2.0, -2.0]]))
    assert seen[0] == pytest.approx([0.0, 0.0, math.sqrt(29.0)])
    assert seen[1, 1] < 0.0  # what is higher is higher in the picture
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    assert euler_from_rotation(np.eye(3)) == (0.0, 0.0, 0.0)


# Drawing


def test_corners_are_drawn_where_they_are_seen():
    record = record_at(33.0, np.random.default_rng(1), pictures=False)
    image = np.zeros((540, 960, 3), np.uint8)
    draw_sight(image, record.observation, 0.75)
    rows, columns = np.nonzero(image.any(axis=2))
    corners = (record.observation.bar_pose.corners_px + 0.5) * 0.75 - 0.5
    # rings of 4 px around the corners, and one pixel of antialiasing
    assert columns.min() == pytest.approx(corners[:, 0].min() - 4.0, abs=1.5)
    assert columns.max() == pytest.approx(corners[:, 0].max() + 4.0, abs=1.5)
    assert rows.min() == pytest.approx(corners[:, 1].min() - 4.0, abs=1.5)


@pytest.mark.parametrize("centre_px", [(640.0, 360.0), (2.0, 3.0), (1279.0, 719.0), (-50.0, 900.0)])
def test_boxes_and_zoom_stay_inside_the_picture(centre_px):
    image, picture = np.zeros((540, 960, 3), np.uint8), np.full((720, 1280, 3), 90, np.uint8)
    observation = Observation(0.0, GimbalAttitude(0.0, 0.0), ship_box=Box(centre_px, (20.0, 14.0), 0.5))
    draw_sight(image, observation, 0.75)
    draw_zoom(image, picture, observation)
    assert (image[40:120, 700:900] > 60).mean() > 0.9  # the inset


def test_a_label_is_read_on_a_sky_of_its_own_colour():
    image = np.full((540, 960, 3), bgr(SKY), np.uint8)
    sky = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)[0, 0]
    observation = Observation(0.0, GimbalAttitude(0.0, 0.0), ship_box=Box((640.0, 360.0), (20.0, 14.0), 0.5))
    draw_sight(image, observation, 0.75)
    label = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)[244:256, 474:600]
    assert (label > 0.9 * sky).mean() > 0.1  # the letters
    assert (label < 0.6 * sky).mean() > 0.4  # between them


def test_no_zoom_when_the_bar_is_large_or_nothing_is_seen():
    picture = np.full((720, 1280, 3), 90, np.uint8)
    for observation in (
        record_at(33.0, np.random.default_rng(1), pictures=False).observation,
        Observation(0.0, GimbalAttitude(0.0, 0.0)),
    ):
        image = np.zeros((540, 960, 3), np.uint8)
        draw_zoom(image, picture, observation)
        assert not image.any()


@given(st.integers(-300, 300), st.integers(-60, 160), st.text(min_size=1, max_size=12))
def test_text_is_cut_at_the_picture_s_edge(column, row, text):
    framed = np.zeros((140, 240, 3), np.uint8)
    put_text(framed[20:120, 20:220], text, (column, row), 18, (255, 255, 255))
    framed[20:120, 20:220] = 0
    assert not framed.any()


def test_text_covers_the_width_that_it_says():
    image = np.zeros((40, 400, 3), np.uint8)
    put_text(image, "−12.3° × 4 … ²", (10, 28), 18, (255, 255, 255))
    columns = np.nonzero(image.any(axis=(0, 2)))[0]
    assert columns.max() - columns.min() == pytest.approx(text_width("−12.3° × 4 … ²", 18), abs=4)
    assert image.max() == 255


@given(st.text(st.characters(codec="latin-1", categories=("L", "N", "Zs")), max_size=200), st.integers(1, 4))
def test_wrapped_text_fits(text, lines):
    wrapped = wrap_text(text, 14, 200, lines)
    assert 1 <= len(wrapped) <= lines
    assert all(text_width(line, 14) <= 200 or " " not in line for line in wrapped[:-1])
    assert text_width(wrapped[-1], 14) <= 200
    if wrapped[-1] and not wrapped[-1].endswith("…"):
        assert " ".join(wrapped).split() == text.split()


def test_the_estimate_shown_is_beside_the_truth_of_its_own_time():
    moments, rng = Moments(), np.random.default_rng(3)
    for t_s in np.arange(14.0, 15.0, 1.0 / 30.0):
        ahead = truth_at(t_s + 0.3)
        estimate = Estimate(ahead.t_s, ahead.aircraft_in_bar_m, 0.0)
        record = record_at(t_s, rng, pictures=False)
        moments.note(dataclasses.replace(record, decision=dataclasses.replace(record.decision, estimate=estimate)))
    shown, truth = moments.at(14.95, None)
    assert 14.9 < shown.t_s <= 14.95
    assert truth.t_s == pytest.approx(shown.t_s)
    assert truth.aircraft_in_bar_m == pytest.approx(shown.aircraft_in_bar_m, abs=0.002)
