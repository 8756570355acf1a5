"""Real autopilots in our world; each test says which binary it wants."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from waiting import until

ROOT = Path(__file__).parents[2]


def land(folder: Path, *options: str) -> None:
    """One landing on the rig; a machine so busy that the world falls behind the clock tells nothing."""
    command = [sys.executable, str(ROOT / "tools" / "land_outside.py"), "--seeds", "1", "--first", "3"]
    done = subprocess.run([*command, "--out", str(folder), *options], capture_output=True, text=True, timeout=300.0)
    landed = "1 of 1 in the square" in done.stdout
    behind_s = json.loads((folder / "rig-natops.json").read_text())[0].get("world_fell_behind_s", 0.0)
    if not landed and behind_s > 0.1:
        pytest.skip(f"the machine was too busy: the world fell {behind_s:.1f} s behind the clock")
    assert landed, done.stdout + done.stderr


@pytest.mark.slow
def test_an_autopilot_lands_by_itself_on_the_pad_that_it_is_told(tmp_path: Path) -> None:
    """The small one of these tests in place of a real one: who flies when, and what it is told."""
    land(tmp_path, "--autopilot", "stand-in", "--own-landing", "--boot-s", "3", "--set", "wind.mean_mps=0")
    row = json.loads((tmp_path / "rig-natops.json").read_text())[0]
    assert row["own_landing_s"] > 1.0
    assert row["rest"].startswith("motors at rest")


def test_a_stop_while_the_physics_starts_leaves_no_process_of_it(tmp_path: Path) -> None:
    """What is left would keep the port from the next flight."""
    command = [sys.executable, str(ROOT / "tools" / "land_outside.py"), "--autopilot", "stand-in", "--instance", "9"]
    tool = subprocess.Popen([*command, "--out", str(tmp_path)])
    said = tmp_path / "rig-natops-1" / "physics.txt"
    assert until(lambda: said.exists() and "waiting for a flight controller" in said.read_text())
    tool.terminate()
    assert tool.wait(20.0) == 143
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 9092))


@pytest.mark.skipif(
    not os.environ.get("SHIPLAND_ARDUCOPTER"), reason="SHIPLAND_ARDUCOPTER names no ArduCopter binary for its simulator"
)
def test_an_arducopter_lands_in_our_world(tmp_path: Path) -> None:
    """ArduPilot's own defaults for its simulator may stand in SHIPLAND_ARDUCOPTER_DEFAULTS."""
    land(tmp_path, "--defaults", *os.environ.get("SHIPLAND_ARDUCOPTER_DEFAULTS", "").split())


@pytest.mark.skipif(not os.environ.get("SHIPLAND_PX4"), reason="SHIPLAND_PX4 names no PX4 binary for its simulator")
def test_a_px4_lands_in_our_world(tmp_path: Path) -> None:
    land(tmp_path, "--autopilot", "px4")
