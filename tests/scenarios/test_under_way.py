"""A vehicle that holds its speed by optical flow: low over a ship under way it sees nothing but a ship that moves."""

import pytest

from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario


@pytest.mark.parametrize("seed", [7, 10])
def test_speed_sticks_land_on_a_ship_under_way(seed):
    """A view of nothing but ship taken for three quarters of it: 27 cm off, and no touchdown within the time."""
    changes = {"aircraft.loop.kind": "velocity", "ship.course.speed_mps": 3.0}
    flown = fly_quietly(load_scenario("under-way", **changes), "horizon", "geometric", seed)
    assert flown.success, flown.reason
