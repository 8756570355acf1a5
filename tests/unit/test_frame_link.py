"""Pictures from outside: a served world's frames, a stream's newest picture."""

import time
from pathlib import Path

import numpy as np
import pytest
from made_up_flight import VERDICT

from pictures import write_film
from shipland.camera import Camera
from shipland.errors import ConfigError
from shipland.scenario.scenario import load_scenario
from shipland.sitl.frame_server import FrameServer
from shipland.sitl.physics import LaunchHold
from shipland.vehicles.camera_stream import CameraStream, VideoSource
from shipland.vehicles.frame_link import FrameSource

PORT = 19003


def test_a_served_world_is_seen_late_and_with_its_truth() -> None:
    scenario = load_scenario("rig-natops")
    held = LaunchHold(scenario, 3, 0.9)
    with FrameServer(scenario, 3, "127.0.0.1", PORT, False) as server:
        stream = CameraStream(FrameSource.at(f"127.0.0.1:{PORT}", Camera.from_parameters(scenario.camera)))
        stream.start()
        shots, last_s, t_s, end_s = [], -1e9, 0.0, time.monotonic() + 30.0
        while len(shots) < 5 and time.monotonic() < end_s:
            server.show(t_s, held.world.snapshot())
            t_s += 1.0 / 30.0
            shot = stream.newest(last_s, 0.04)
            if shot is not None:
                shots.append(shot)
                last_s = shot.exposed_s
        assert len(shots) == 5
        for shot in shots:
            assert shot.arrived_s - shot.exposed_s == pytest.approx(scenario.delays.video_s, abs=0.04)
            assert shot.truth is not None
            assert shot.truth.ned_from_body.translation_m == pytest.approx(
                held.world.truth().ned_from_body.translation_m
            )
        server.end(VERDICT)
        while stream.verdict() is None and time.monotonic() < end_s:
            time.sleep(0.02)
        verdict = stream.verdict()
        assert verdict is not None and verdict.reason == VERDICT.reason
        assert np.array_equal(verdict.touchdown_in_deck_m, VERDICT.touchdown_in_deck_m)
        stream.close()
    with pytest.raises(ConfigError, match="frames:HOST:PORT"):
        FrameSource.at("somewhere", Camera.from_fov(64, 36, 69.0))


def test_the_newest_picture_of_a_file(tmp_path: Path) -> None:
    shades = (np.full((96, 160, 3), 8 * index, np.uint8) for index in range(30))
    path = write_film(tmp_path / "film.mp4", shades, codec="mpeg4")
    camera = CameraStream(VideoSource(str(path), 0.1, (160, 96), 5.0))
    camera.start()
    first = camera.newest(-1e9, 5.0)
    assert first is not None
    time.sleep(0.3)
    second = camera.newest(first.exposed_s, 1.0)
    assert second is not None
    assert second.image is not None
    assert second.exposed_s - first.exposed_s > 0.15  # those between were left out
    assert camera.age_s >= 0.1 - 1e-6  # of a difference of two times
    assert camera.newest(time.monotonic() + 9.0, 3.0) is None
    assert camera.problem == "the stream has ended"
    camera.close()
    wrong = CameraStream(VideoSource(str(path), 0.1, (64, 36), 5.0))
    wrong.start()
    assert wrong.newest(-1e9, 3.0) is None
    assert "160 × 96" in wrong.problem
    wrong.close()
