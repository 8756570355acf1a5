"""A camera from outside: exposure times that one bad stamp does not falsify, and a source that is opened again."""

from __future__ import annotations

import errno
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shipland.commands.options import command_line
from shipland.errors import VehicleError
from shipland.messages import TouchdownVerdict
from shipland.vehicles import camera_stream
from shipland.vehicles.camera_stream import CameraStream, ExposureClock, StreamedPicture, VideoSource
from waiting import until

LATENCY_S, PERIOD_S = 0.2, 1.0 / 30.0


def errors_s(stamps_s: np.ndarray, late_s: np.ndarray) -> list[float | None]:
    """By how much each exposure is off; pictures are exposed every `PERIOD_S` and come `LATENCY_S` and more later."""
    clock, found = ExposureClock(LATENCY_S), []
    for index, (stamp_s, more_s) in enumerate(zip(stamps_s, late_s, strict=True)):
        true_s = 50.0 + index * PERIOD_S
        exposed_s = clock.exposed_s(float(stamp_s), true_s + LATENCY_S + float(more_s))
        found.append(None if exposed_s is None else exposed_s - true_s)
    return found


@pytest.fixture
def late_s(rng: np.random.Generator) -> np.ndarray:
    """Jitter of 600 pictures."""
    return 0.06 * rng.random(600) ** 2


@pytest.mark.parametrize("off_s", [0.5, -0.5, 0.15, 20.0, -20.0])
@pytest.mark.parametrize("bad", [0, 1, 12, 300])
def test_one_bad_stamp_falsifies_no_other_exposure(off_s: float, bad: int, late_s: np.ndarray) -> None:
    stamps_s = np.arange(600) * PERIOD_S
    stamps_s[bad] += off_s
    found = errors_s(stamps_s, late_s)
    off = [index for index, error_s in enumerate(found) if error_s is not None and not abs(error_s) < 0.061]
    assert set(off) <= {0, 1, bad}  # of the first pictures nobody knows yet which one is wrong
    assert found.count(None) <= 4
    if bad == 300:
        clean = errors_s(np.arange(600) * PERIOD_S, late_s)
        assert found[bad] is None
        assert [it for it in found if it is not None] == clean[:bad] + clean[bad + 1 :]


def test_exposures_of_a_clean_stream_are_those_of_its_quickest_picture(late_s: np.ndarray) -> None:
    found = errors_s(np.arange(600) * PERIOD_S, late_s)
    quickest_s = [late_s[max(0, index - 300) : index + 1].min() for index in range(600)]
    assert found == pytest.approx(quickest_s, abs=2e-3)  # a window of ten seconds, by receipt
    assert ExposureClock(LATENCY_S).exposed_s(None, 7.0) == pytest.approx(7.0 - LATENCY_S)  # a stream without stamps


@pytest.mark.parametrize("step_s", [0.5, -0.5, 5.0, -5.0, 1e6, -0.12])
def test_a_step_of_the_streams_clock_that_lasts_is_followed(step_s: float, late_s: np.ndarray) -> None:
    stamps_s = np.arange(600) * PERIOD_S
    stamps_s[300:] += step_s
    found = errors_s(stamps_s, late_s)
    assert all(error_s is None or abs(error_s) < 0.061 for error_s in found)
    assert None not in found[:300] + found[310:]


@pytest.mark.parametrize("gap_s", [5.0, 15.0])
def test_a_streams_clock_that_begins_again_after_a_gap_is_followed(gap_s: float, late_s: np.ndarray) -> None:
    clock, found = ExposureClock(LATENCY_S), []
    for index, more_s in enumerate(late_s):
        begun, true_s = index >= 300, 50.0 + index * PERIOD_S + (gap_s if index >= 300 else 0.0)
        exposed_s = clock.exposed_s((index - 300 * begun) * PERIOD_S, true_s + LATENCY_S + float(more_s))
        found.append(None if exposed_s is None else exposed_s - true_s)
    assert all(error_s is None or abs(error_s) < 0.061 for error_s in found)
    assert None not in found[:300] + found[310:]


def test_a_picture_that_stood_in_a_queue_is_refused(late_s: np.ndarray) -> None:
    late_s[300:345] += 1.5 - np.arange(45) * PERIOD_S  # a stall of 1.5 s, then all at once
    found = errors_s(np.arange(600) * PERIOD_S, late_s)
    assert found[300] is None
    assert all(error_s is None or abs(error_s) < 0.061 for error_s in found)
    assert None not in found[320:]


def test_pictures_that_come_later_and_later_are_known_to_be_old(late_s: np.ndarray) -> None:
    """A decoder that is a twentieth too slow has a queue that grows by 50 ms a second, within any window alike."""
    late_s += 0.05 * np.arange(600) * PERIOD_S
    found = errors_s(np.arange(600) * PERIOD_S, late_s)
    assert all(error_s is None or abs(error_s) < 0.11 for error_s in found)


@pytest.mark.parametrize("drift", [0.001, -0.001])
def test_a_stream_whose_clock_runs_at_another_rate_is_followed(drift: float, late_s: np.ndarray) -> None:
    """Of 30 pictures a second, as stamped, there are 29.97."""
    late_s = np.resize(late_s, 6_000)
    found = errors_s(np.arange(6_000) * PERIOD_S * (1.0 - drift), late_s)
    assert None not in found
    assert max(map(abs, found)) < 0.08


class Camera:
    """A source that does at each opening what it is told to."""

    def __init__(self, *openings: Callable[[], Iterator[StreamedPicture]]) -> None:
        self.openings, self.opened, self.closed = list(openings), 0, threading.Event()

    def pictures(self) -> Iterator[StreamedPicture]:
        self.opened += 1
        return self.openings[min(self.opened, len(self.openings)) - 1]()

    def close(self) -> None:
        self.closed.set()

    def verdict(self) -> TouchdownVerdict | None:
        return None


def shot() -> StreamedPicture:
    now_s = time.monotonic()
    return StreamedPicture(None, now_s, now_s)


def one_then(words: str) -> Callable[[], Iterator[StreamedPicture]]:
    """A picture, then a failure; without words, an end."""

    def pictures() -> Iterator[StreamedPicture]:
        yield shot()
        if words:
            raise VehicleError(words)

    return pictures


def absent() -> Iterator[StreamedPicture]:
    raise VehicleError("connection refused")
    yield


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_stream, "_REOPEN_S", 0.01)
    monkeypatch.setattr(camera_stream, "_LONGEST_REOPEN_S", 0.02)


def test_a_camera_that_stops_is_opened_again_and_its_problem_stays_in_words_meanwhile() -> None:
    back = threading.Event()

    def again() -> Iterator[StreamedPicture]:
        if not back.is_set():
            raise VehicleError("connection refused")
        while True:
            yield shot()
            time.sleep(0.01)

    source = Camera(one_then("timed out"), again)
    stream = CameraStream(source)
    stream.start()
    first = stream.newest(-1e9, 10.0)
    assert first is not None
    assert until(lambda: stream.problem == "connection refused" and source.opened > 3)
    assert stream.newest(first.exposed_s, 0.0) is None
    back.set()
    assert stream.newest(first.exposed_s, 10.0) is not None
    assert stream.problem == ""
    stream.close()
    assert not stream._thread.is_alive()


def test_a_source_that_gave_pictures_is_opened_again_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A damaged picture, as of a topic, costs itself and not the half second after it."""
    monkeypatch.setattr(camera_stream, "_REOPEN_S", 60.0)
    source = Camera(one_then("a compressed picture cannot be decoded"))
    stream = CameraStream(source)
    stream.start()
    assert until(lambda: source.opened > 3)
    stream.close()


@pytest.mark.parametrize(("opening", "problem"), [(one_then(""), "the stream has ended"), (absent, "refused")])
def test_a_recording_that_has_ended_and_a_camera_that_never_was_are_not_opened_again(
    opening: Callable[[], Iterator[StreamedPicture]], problem: str
) -> None:
    source = Camera(opening)
    stream = CameraStream(source)
    stream.start()
    stream._thread.join(20.0)
    assert not stream._thread.is_alive()
    assert source.opened == 1
    assert problem in stream.problem
    begun_s = time.monotonic()
    assert stream.newest(time.monotonic(), 30.0) is None  # nobody waits for it
    assert time.monotonic() - begun_s < 15.0
    stream.close()


def test_closing_ends_the_wait_for_a_camera() -> None:
    stream = CameraStream(Camera(one_then("gone"), absent))
    stream.start()
    assert until(lambda: stream.problem == "connection refused")
    stream.close()
    assert not stream._thread.is_alive()


def test_a_source_whose_pictures_all_come_too_late_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    source, now_s = VideoSource("rtsp://camera/live", LATENCY_S, (64, 36), 5.0), 100.0

    def slow() -> Iterator[tuple[np.ndarray, float]]:
        nonlocal now_s
        begun_s = now_s
        for index in range(3000):
            now_s = begun_s + 1.1 * index * PERIOD_S
            yield np.zeros((36, 64, 3), np.uint8), index * PERIOD_S

    monkeypatch.setattr(source, "_decoded", slow)
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    for _ in range(2):
        opened_s = now_s
        with pytest.raises(VehicleError, match="come more than 1 s late"):
            for picture in source.pictures():
                age_s = LATENCY_S + 0.1 / 1.1 * (now_s - opened_s)
                assert now_s - picture.exposed_s == pytest.approx(age_s, abs=0.05)


def test_a_live_source_fails_at_its_end_and_a_file_is_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = np.zeros((36, 64, 3), np.uint8)
    for url, live in (("rtsp://camera/live", True), ("gst:v4l2src ! appsink", True), ("/dev/video0", True),
                      (str(tmp_path / "film.mp4"), False), ("gst:filesrc location=a ! appsink", False)):  # fmt: skip
        source = VideoSource(url, LATENCY_S, (64, 36), 5.0)
        monkeypatch.setattr(source, "_decoded", lambda: iter([(image, 0.0), (image, 0.1)]))
        monkeypatch.setattr(source, "_gstreamer", lambda: iter([(image, None), (image, None)]))
        for _ in range(2):  # and again
            if live:
                with pytest.raises(VehicleError, match="the stream has ended"):
                    list(source.pictures())
            else:
                assert len(list(source.pictures())) == 2


def webcam(path: Path, broken: range) -> VideoSource:
    """Thirty pictures as a webcam's, some of them cut to nothing that can be decoded."""
    av, rng = pytest.importorskip("av"), np.random.default_rng(1)
    with av.open(str(path), "w") as film:
        stream = film.add_stream("mjpeg", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 36, "yuvj420p"
        images = (rng.integers(0, 255, (36, 64, 3), np.uint8) for _ in range(30))
        packets = [it for image in images for it in stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24"))]
        for index, packet in enumerate(packets + list(stream.encode())):
            cut = av.Packet(bytes(packet.size)) if index in broken else packet
            cut.stream, cut.pts, cut.dts, cut.time_base = stream, packet.pts, packet.dts, packet.time_base
            film.mux(cut)
    return VideoSource(str(path), LATENCY_S, (64, 36), 5.0)


def test_a_picture_that_cannot_be_decoded_costs_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]  # s: a clock that no busy machine makes late
    clock = SimpleNamespace(monotonic=lambda: now_s[0], sleep=lambda wait_s: now_s.append(now_s.pop() + wait_s))
    monkeypatch.setattr(camera_stream, "time", clock)
    whole, film = (list(webcam(tmp_path / "film.avi", range(10, end)).pictures()) for end in (10, 12))
    assert len(film) == len(whole) - 2 > 20


@pytest.mark.parametrize(
    ("url", "kind"),
    [("/dev/video0", "v4l2"), ("/dev/v4l/by-id/usb-camera-index0", "v4l2"), ("/dev/shm/film.mp4", None)],
)
def test_a_camera_is_one_by_its_lasting_name_too(url: str, kind: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """By number it may be another camera after the next start."""
    formats: list[str | None] = []

    def opened(_: str, format: str | None, **__: object) -> None:  # noqa: A002 - PyAV's name
        formats.append(format)
        raise OSError(errno.ENOENT, "No such file or directory")

    monkeypatch.setattr("av.open", opened)
    with pytest.raises(VehicleError, match="No such file"):
        list(VideoSource(url, LATENCY_S, (64, 36), 5.0).pictures())
    assert formats == [kind]


@pytest.mark.parametrize("colon", [":", "%3A"])
def test_a_cameras_password_is_in_no_words_and_in_no_log(colon: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Why a flight was over, and its command line, stand in logs that are passed on."""
    at, slashes = ("@", "//") if colon == ":" else ("%40", "%2F%2F")
    url = f"rtsp{colon}{slashes}me{colon}secret{at}127.0.0.1{colon}1/live"
    if colon == ":":
        with pytest.raises(VehicleError, match=r"camera rtsp://me:\*\*\*@127\.0\.0\.1:1/live: "):
            list(VideoSource(url, LATENCY_S, (64, 36), 5.0).pictures())
    monkeypatch.setattr(sys, "argv", ["shipland", "fly", "--vehicle", f"mavlink://udp:h:1?camera={url}&key=a@b"])
    assert "secret" not in command_line()
    assert "key=a@b" in command_line()


def test_a_source_whose_pictures_are_all_broken_is_opened_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(camera_stream, "REFUSED_S", 0.0)
    with pytest.raises(VehicleError, match="Invalid data"):
        list(webcam(tmp_path / "film.avi", range(10, 30)).pictures())


@pytest.mark.parametrize(
    "image", [np.zeros((36, 64), np.uint8), np.zeros((36, 64, 4), np.uint8), np.zeros((36, 64, 3), np.uint16)]
)
def test_a_pipeline_of_other_pictures_is_no_camera(image: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    """GRAY8, BGRx and 16 bits: before a flight, in words, and not in it by an error of the first picture."""
    capture = SimpleNamespace(isOpened=lambda: True, read=lambda: (True, image), release=lambda: None)
    monkeypatch.setattr("cv2.VideoCapture", lambda *_: capture)
    with closing(CameraStream(VideoSource("gst:v4l2src ! appsink", LATENCY_S, (64, 36), 5.0))) as stream:
        stream.start()
        assert stream.newest(-1e9, 10.0) is None
        assert "format=BGR" in stream.problem
