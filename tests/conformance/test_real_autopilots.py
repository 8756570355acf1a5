"""Real autopilots in our world; each test says which binary it wants."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(
    not os.environ.get("SHIPLAND_ARDUCOPTER"), reason="SHIPLAND_ARDUCOPTER names no ArduCopter binary for its simulator"
)
def test_an_arducopter_lands_in_our_world(tmp_path: Path) -> None:
    """One landing on the rig; ArduPilot's own defaults for its simulator may stand in SHIPLAND_ARDUCOPTER_DEFAULTS.

    A machine so busy that the world falls behind the clock tells nothing.
    """
    defaults = os.environ.get("SHIPLAND_ARDUCOPTER_DEFAULTS", "").split()
    command = [sys.executable, str(ROOT / "tools" / "land_outside.py"), "--seeds", "1", "--first", "3"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path), "--defaults", *defaults], capture_output=True, text=True, timeout=300.0
    )
    landed = "1 of 1 in the square" in done.stdout
    behind_s = json.loads((tmp_path / "rig-natops.json").read_text())[0].get("world_fell_behind_s", 0.0)
    if not landed and behind_s > 0.1:
        pytest.skip(f"the machine was too busy: the world fell {behind_s:.1f} s behind the clock")
    assert landed, done.stdout + done.stderr


@pytest.mark.skipif(not os.environ.get("SHIPLAND_PX4"), reason="SHIPLAND_PX4 names no running PX4, as udp:HOST:PORT")
def test_a_px4_is_understood() -> None:
    """A PX4 in its own simulator: heartbeat, limits, streams; nothing is commanded."""
    pytest.importorskip("pymavlink")
    from mavlink_bench import Blank, setup_for

    from shipland.vehicles.mavlink.setup import Engagement
    from shipland.vehicles.mavlink.vehicle import MavlinkVehicle

    setup = setup_for(1, Blank(), None, Engagement(), {})
    vehicle = MavlinkVehicle(setup.__class__(**{**vars(setup), "place": os.environ["SHIPLAND_PX4"]}))
    try:
        vehicle.connect()
        assert vehicle.response().kind == "velocity"
    finally:
        vehicle.close()
