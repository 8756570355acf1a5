"""A weak motor and a dark spell set the aircraft swinging: it comes to rest again, and lands."""

from shipland.evaluation.job import FlightJob, land_quietly
from shipland.scenario.scenario import load_scenario


def test_a_swing_with_full_sticks_ends() -> None:
    scenario = load_scenario("ship-sea5", fault_draw={"every_kind": True, "count": 2})
    landing = land_quietly(FlightJob(scenario, "horizon", "geometric", seed=58))
    assert landing.landed, landing.reason
    assert landing.time_s < 40.0
