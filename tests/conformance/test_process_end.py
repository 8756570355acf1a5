"""`shipland fly` in a process of its own, killed, interrupted or frozen in flight: what the aircraft gets then."""

import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from anafi_bench import CAMERA, device, olympe_python
from mavlink_bench import StandIn
from steady_pilot import PITCH_PERCENT

from pictures import write_film
from ports import free_port
from shipland.calibration_file import write_calibration
from shipland.record.reader import read_log

pytest.importorskip("pymavlink")
pytestmark = [pytest.mark.slow, pytest.mark.flaky(reruns=2, reruns_delay=2)]

FULL_TILT_RAD = math.radians(15.0)


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two minutes of a grey picture, twelve a second."""
    picture = np.full((CAMERA.height_px, CAMERA.width_px, 3), 90, np.uint8)
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    return write_film(path, repeat(picture, 120 * 12), rate=12, preset="ultrafast", crf="40")


@contextmanager
def flying(address: str, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """The command, at work."""
    write_calibration(CAMERA, tmp_path / "camera.yaml")
    # On a busy machine pictures are late, and telemetry is slow: that is not what is tested here.
    (tmp_path / "busy.toml").write_text("[preflight]\npicture_age_s = 3.0\npicture_hz = 2.0\ntelemetry_hz = 2.0\n")
    command = [
        sys.executable, "-m", "shipland.cli", "fly", "--vehicle", address, "--pilot", "steady_pilot:steady",
        "--vehicle-config", str(tmp_path / "busy.toml"), "--calibration", str(tmp_path / "camera.yaml"),
        "--wind-mps", "0", "--no-video", "--out", str(tmp_path / "out"),
    ]  # fmt: skip
    here = Path(__file__).parent
    with subprocess.Popen(command, cwd=here, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def until(what: Callable[[], bool], process: subprocess.Popen[str] | None = None, timeout_s: float = 60.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not what():
        if process is not None and process.poll() is not None:
            assert process.stderr is not None
            pytest.fail(f"it ended: {process.stderr.read()}")
        assert time.monotonic() < end_s
        time.sleep(0.1)


def said_at_its_end(process: subprocess.Popen[str]) -> str:
    return process.communicate(timeout=60.0)[1]


# MAVLink


def set_points(report: dict[str, Any]) -> int:
    return sum(report["counts"].get(f"SET_{name}", 0) for name in ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"))


@pytest.fixture
def over_mavlink(film: Path, tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], StandIn]]:
    """In flight, pitched forward."""
    port = free_port(socket.SOCK_DGRAM)
    autopilot = StandIn(port, "ardupilot")
    try:
        with flying(f"mavlink://udp:127.0.0.1:{port}?camera={film}&mount_deg=-5&take=1", tmp_path) as process:
            until(lambda: autopilot.report()["target"] == "tilt", process)
            pitch_rad = autopilot.report()["values"][1]
            until(lambda: autopilot.report()["speed"] > 1.0, process)
            assert pitch_rad <= 0.0
            assert autopilot.report()["values"][1] == pytest.approx(-0.01 * PITCH_PERCENT * FULL_TILT_RAD, abs=1e-3)
            yield process, autopilot
    finally:
        autopilot.close()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_mavlink_interrupted_says_hold_and_closes_its_log(
    how: signal.Signals, over_mavlink: tuple[subprocess.Popen[str], StandIn], tmp_path: Path
) -> None:
    process, autopilot = over_mavlink
    process.send_signal(how)
    said = said_at_its_end(process)
    assert process.returncode == 130
    assert "Traceback" not in said
    report = autopilot.report()
    assert (report["mode"], report["target"]) == (17, "hold")  # BRAKE
    time.sleep(0.5)
    assert set_points(autopilot.report()) == set_points(report)
    assert len(read_log(tmp_path / "out/flight.mcap").records) > 0
    assert (tmp_path / "out/link.tlog").stat().st_size > 1000


def test_mavlink_killed_leaves_the_vehicle_to_the_guard_of_its_link_which_holds_it(
    over_mavlink: tuple[subprocess.Popen[str], StandIn], tmp_path: Path
) -> None:
    process, autopilot = over_mavlink
    process.kill()
    process.wait()
    until(lambda: autopilot.report()["mode"] == 17, timeout_s=10.0)  # BRAKE
    until(lambda: autopilot.report()["speed"] < 0.3, timeout_s=15.0)
    report = autopilot.report()
    assert report["counts"]["SET_POSITION_TARGET_LOCAL_NED"] > 0
    assert report["armed"]
    assert len(read_log(tmp_path / "out/flight.mcap").records) > 0


def test_mavlink_frozen_is_held_for_and_goes_on_with_level_sticks_first(
    over_mavlink: tuple[subprocess.Popen[str], StandIn],
) -> None:
    process, autopilot = over_mavlink
    process.send_signal(signal.SIGSTOP)
    until(lambda: autopilot.report()["target"] == "speed", timeout_s=3.0)
    report = autopilot.report()
    assert report["values"] == [0.0, 0.0, 0.0, 0.0]
    process.send_signal(signal.SIGCONT)
    until(lambda: autopilot.report()["target"] == "tilt", process)
    before = set_points(autopilot.report())
    until(lambda: set_points(autopilot.report()) > before + 50, process)
    # what was missed is not made up for at once
    gaps_s = autopilot.report()["gaps_s"]
    assert sum(gap_s < 0.005 for gap_s in gaps_s[-50:]) < 30


# ANAFI


@pytest.fixture
def over_olympe(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], Any]]:
    """In flight, pitched forward."""
    python = olympe_python()
    forward = [1, 0, round(PITCH_PERCENT), 0, 0]
    with ExitStack() as stack:
        aircraft, stream = stack.enter_context(device())
        address = f"anafi://127.0.0.1?python={python}&stream={stream}&takeoff=1"
        process = stack.enter_context(flying(address, tmp_path))
        until(lambda: [entry[:5] for entry in aircraft.report()["pcmd"][-25:]] == 25 * [forward], process)
        yield process, aircraft


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_an_anafi_s_sticks_are_released_however_the_process_ends(
    how: signal.Signals, over_olympe: tuple[subprocess.Popen[str], Any], tmp_path: Path
) -> None:
    process, aircraft = over_olympe
    process.send_signal(how)
    said = said_at_its_end(process)
    assert process.returncode == (-signal.SIGKILL if how is signal.SIGKILL else 130)
    assert "Traceback" not in said
    # ARSDK has no good-bye: that nothing comes any more is all that the aircraft sees
    until(lambda: (report := aircraft.report())["now_s"] - report["pcmd_s"][-1] > 0.5, timeout_s=5.0)
    report = aircraft.report()
    assert report["pcmd"][-1][:5] == [0, 0, 0, 0, 0]
    assert report["state"] == "hovering"
    if how is not signal.SIGKILL:
        assert len(read_log(tmp_path / "out/flight.mcap").records) > 0
    lines = [json.loads(line) for line in (tmp_path / "out/link.jsonl").read_text().splitlines()[:-1]]
    assert {"sticks": [0, round(PITCH_PERCENT), 0, 0]} in [line.get("to") for line in lines]


def test_a_frozen_process_releases_an_anafi_s_sticks(over_olympe: tuple[subprocess.Popen[str], Any]) -> None:
    process, aircraft = over_olympe
    os.kill(process.pid, signal.SIGSTOP)
    until(lambda: aircraft.report()["pcmd"][-1][:5] == [0, 0, 0, 0, 0], timeout_s=3.0)
    report = aircraft.report()
    assert report["now_s"] - report["pcmd_s"][-1] < 0.3
    os.kill(process.pid, signal.SIGCONT)
    until(lambda: aircraft.report()["pcmd"][-1][0] == 1, process)
