"""A ship met from ahead shows no bar: the pilot flies around it to its stern and lands."""

from shipland.config import merge
from shipland.messages import Mode
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table


def test_a_ship_met_from_ahead_is_flown_around():
    start = {"bearing_deg": 180.0, "bearing_half_range_deg": 0.0, "distance_m": 50.0, "height_m": 5.0}
    scenario = load_scenario(merge(scenario_table("demo"), {"start": start, "time_limit_s": 120.0}))
    rows = []
    flown = fly_quietly(scenario, "horizon", "geometric", 1, rows.append)
    assert flown.success, flown.reason
    assert Mode.TRACK_SHIP in {row.decision.mode for row in rows}
    nearest_m = min(
        max(abs(row.truth.aircraft_in_bar_m[0]), abs(row.truth.aircraft_in_bar_m[1]))
        for row in rows
        if row.truth.aircraft_in_bar_m[0] > 0.5
    )
    assert nearest_m > 2.0  # m: never over the superstructure
