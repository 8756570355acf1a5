"""An airframe and an inner loop from outside the package fly by name."""

import math
from pathlib import Path

import numpy as np
import pytest

from shipland.errors import ConfigError
from shipland.messages import PilotCommand
from worlds import QUIET, come_down, world

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def _in_the_examples_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))


def own(**places):
    return world(aircraft=QUIET | {"kind": "own_aircraft:octocopter"}, **places)


def test_the_octocopter_flies_what_its_own_loop_makes_of_the_stick() -> None:
    flown = own()
    for _ in range(20):
        flown.command(PilotCommand(flown.t_s, 50.0, 0.0, 0.0, 0.0, 0.0))
        flown.advance(flown.t_s + 0.1)
    forward = flown.truth().ned_from_body.rotation[:, 0]
    assert math.degrees(math.asin(forward[2])) == pytest.approx(0.25 * 15.0, abs=0.2)  # nose down a quarter of MaxTilt
    flown.advance(flown.t_s + 8.0)  # the command times out: it brakes and holds
    np.testing.assert_allclose(flown.truth().velocity_in_ned_mps, 0.0, atol=0.1)


def test_its_own_feet_stand_on_the_deck() -> None:
    flown = own(distance_m=0.0, height_m=1.0)
    come_down(flown, most_s=10.0)
    verdict = flown.verdict()
    assert verdict is not None
    assert verdict.landed, verdict.reason
    height_m = -flown.truth().ned_from_body.translation_m[2] - 0.9
    assert height_m == pytest.approx(0.35, abs=0.01)


def test_unknown_aircraft_and_loops_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="quadrotor"):
        world(aircraft={"kind": "zeppelin"})
    with pytest.raises(ConfigError, match="attitude, velocity"):
        world(aircraft={"loop": {"kind": "rate"}})
