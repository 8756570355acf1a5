"""Lines of the checklist that must be able to fail."""

import math
from dataclasses import replace

import pytest

from shipland.config import build, packaged_toml
from shipland.guidance.response import Response
from shipland.scenario.real_vehicle import wind_check

LIMITS = {"max_tilt_rad": math.radians(15.0), "max_climb_mps": 1.0, "max_turn_rad_s": 0.7}
SPEEDS = {"kind": "velocity", "max_speed_mps": 4.0, **LIMITS}
TILTS = {"kind": "attitude", "max_speed_mps": 0.0, "servo_per_s": 0.0, **LIMITS}


@pytest.mark.parametrize("own", [SPEEDS, TILTS], ids=["speeds", "tilts"])
def test_every_vehicle_has_a_wind_that_it_cannot_hold(own: dict[str, object]) -> None:
    response = build(Response, packaged_toml("vehicles")["response"][own["kind"]] | own, "response")
    most_mps = 0.6 * 9.80665 * math.tan(math.radians(15.0)) / 0.3
    assert wind_check(most_mps - 0.1, response, 0.6).ok
    assert not wind_check(most_mps + 0.1, response, 0.6).ok
    assert not wind_check(math.nan, response, 0.6).ok
    assert not wind_check(-1.0, response, 0.6).ok
    line = wind_check(0.0, replace(response, drag_per_s=0.0), 0.6)
    assert not line.ok
    assert "unknown" in line.words
