"""Flights with spoiled data: no exception, no stick step beyond the slew bound, control regained within two seconds."""

import pytest

from shipland.evaluation.job import FlightJob, land_once
from shipland.evaluation.recovery import REGAINED_S
from shipland.scenario.scenario import load_scenario


@pytest.mark.vision_fails
def test_spoiled_data_neither_stops_a_flight_nor_reaches_the_sticks():
    draw = {"kinds": ["spoiled_values"], "count": 3, "earliest_s": 0.0, "latest_s": 11.0, "longest_s": 3.0}
    scenario = load_scenario("rig-natops", fault_draw=draw, time_limit_s=16.0)
    landings = [land_once(FlightJob(scenario, "paper", "geometric", seed)) for seed in (1, 2)]
    assert max(landing.over_slew_percent for landing in landings) <= 1e-6
    regained_s = [landing.recovery_s for landing in landings if landing.recovery_s is not None]
    assert regained_s
    assert max(regained_s) <= REGAINED_S
