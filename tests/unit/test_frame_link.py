"""Pictures from outside: a served world's frames, a stream's newest picture."""

import itertools
import os
import signal
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from made_up_flight import VERDICT

from pictures import write_film
from ports import free_port
from shipland.camera import Camera
from shipland.errors import ConfigError, VehicleError
from shipland.scenario.scenario import load_scenario
from shipland.sitl.frame_server import FrameServer
from shipland.sitl.physics import LaunchHold
from shipland.vehicles.camera_stream import CameraStream, VideoSource
from shipland.vehicles.frame_link import FrameSource
from waiting import until


def test_a_served_world_is_seen_late_and_with_its_truth() -> None:
    scenario, port = load_scenario("rig-natops"), free_port()
    held, turns, shots = LaunchHold(scenario, 3, 0.9), itertools.count(), []
    with FrameServer(scenario, 3, "127.0.0.1", port, False) as server:
        stream = CameraStream(FrameSource.at(f"frames:127.0.0.1:{port}", Camera.from_parameters(scenario.camera)))
        stream.start()

        def five_seen() -> bool:
            server.show(next(turns) / 30.0, held.world.snapshot())
            if (shot := stream.newest(shots[-1].exposed_s if shots else -1e9, 0.04)) is not None:
                shots.append(shot)
            return len(shots) == 5

        until(five_seen)
        for shot in shots:
            assert shot.arrived_s - shot.exposed_s == pytest.approx(scenario.delays.video_s, abs=0.04)
            assert shot.truth is not None
            assert shot.truth.ned_from_body.translation_m == pytest.approx(
                held.world.truth().ned_from_body.translation_m
            )
        server.end(VERDICT)
        until(stream.verdict)
        verdict = stream.verdict()
        assert verdict is not None and verdict.reason == VERDICT.reason
        assert np.array_equal(verdict.touchdown_in_deck_m, VERDICT.touchdown_in_deck_m)
        stream.close()
    for wrong in ("somewhere", "rtsp://127.0.0.1:9003", "frames:127.0.0.1:0"):
        with pytest.raises(ConfigError, match="frames:HOST:PORT"):
            FrameSource.at(wrong, Camera.from_fov(64, 36, 69.0))


def test_the_newest_picture_of_a_file(tmp_path: Path) -> None:
    shades = (np.full((96, 160, 3), 8 * index, np.uint8) for index in range(30))
    path = write_film(tmp_path / "film.mp4", shades, codec="mpeg4")
    camera = CameraStream(VideoSource(str(path), 0.1, (160, 96), 5.0))
    camera.start()
    first = camera.newest(-1e9, 5.0)
    assert first is not None

    def those_between_are_left_out() -> bool:
        second = camera.newest(first.exposed_s, 1.0)
        assert second is not None
        assert second.image is not None
        return second.exposed_s - first.exposed_s > 0.15

    assert until(those_between_are_left_out)
    assert camera.age_s >= 0.1 - 1e-6  # of a difference of two times
    assert camera.newest(time.monotonic() + 9.0, 3.0) is None
    assert camera.problem == "the stream has ended"
    camera.close()
    wrong = CameraStream(VideoSource(str(path), 0.1, (64, 36), 5.0))
    wrong.start()
    assert wrong.newest(-1e9, 3.0) is None
    assert "160 × 96" in wrong.problem
    wrong.close()


@pytest.mark.parametrize(("host", "words"), [("192.0.2.1", "assign"), ("no.such.host.invalid", "not known|resolution")])
def test_an_address_that_is_not_ours_is_no_port_that_is_taken(host: str, words: str) -> None:
    with pytest.raises(VehicleError, match=words):
        FrameServer(load_scenario("rig-natops"), 3, host, free_port(), False)


def test_a_machine_that_cannot_draw_is_said_before_anybody_flies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", os.devnull)
    port = free_port()
    with pytest.raises(VehicleError, match="drawn pictures need EGL"):
        FrameServer(load_scenario("rig-natops"), 3, "127.0.0.1", port, True)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), 5.0)


def test_a_camera_s_process_that_goes_is_said_and_nobody_waits_for_it() -> None:
    scenario, port = load_scenario("rig-natops"), free_port()
    snapshot = LaunchHold(scenario, 3, 0.9).world.snapshot()
    with FrameServer(scenario, 3, "127.0.0.1", port, False) as server:
        server._process.kill()
        server._process.join()
        with pytest.raises(VehicleError, match="the camera's process has ended"):
            server.show(0.0, snapshot)
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port), 5.0)


def test_a_ctrl_c_is_answered_by_whoever_serves_not_by_the_camera_s_process() -> None:
    """It reaches all processes of a terminal; a second traceback tells nobody anything."""
    scenario, port = load_scenario("rig-natops"), free_port()
    world = LaunchHold(scenario, 3, 0.9).world
    with FrameServer(scenario, 3, "127.0.0.1", port, False) as server:
        stream = CameraStream(FrameSource.at(f"frames:127.0.0.1:{port}", Camera.from_parameters(scenario.camera)))
        stream.start()
        turns = itertools.count()

        def seen_since(t_s: float) -> bool:
            server.show(next(turns) / 30.0, world.snapshot())
            return stream.newest(t_s, 0.04) is not None

        until(lambda: seen_since(-1e9))
        os.kill(server._process.pid or 0, signal.SIGINT)
        now_s = time.monotonic() + 0.2
        until(lambda: seen_since(now_s))
        stream.close()
