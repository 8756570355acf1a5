"""Late pictures and a weak motor set the aircraft swinging: it comes to rest again, and lands."""

from shipland.evaluation.job import FlightJob, land_quietly
from shipland.scenario.scenario import load_scenario


def test_a_swing_with_full_sticks_ends() -> None:
    begins_s, lasts_s = (6.239175558491955, 14.798429830246691), (3.430045360154143, 3.2140409562331667)
    kinds, sizes = ("latency_jump", "weak_motor"), (0.5790435609208436, 0.21792152511551724)
    keys = ("kind", "start_s", "duration_s", "size")
    faults = [dict(zip(keys, fault, strict=True)) for fault in zip(kinds, begins_s, lasts_s, sizes, strict=True)]
    scenario = load_scenario("ship-sea5", fault=faults)
    landing = land_quietly(FlightJob(scenario, "horizon", "geometric", seed=58))
    assert landing.landed, landing.reason
    assert landing.time_s < 40.0
