"""Whole flights that something makes hard: spoiled data, another side, a mirrored or wrong cue, a weak motor, way."""

import numpy as np
import pytest

from shipland.config import merge
from shipland.evaluation.job import FlightJob, land_once, land_quietly
from shipland.evaluation.recovery import REGAINED_S
from shipland.messages import Mode
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table


@pytest.mark.vision_fails
def test_spoiled_data_neither_stops_a_flight_nor_reaches_the_sticks():
    """No exception, no stick step beyond the slew bound, control regained within two seconds."""
    draw = {"kinds": ["spoiled_values"], "count": 3, "earliest_s": 0.0, "latest_s": 11.0, "longest_s": 3.0}
    scenario = load_scenario("rig-natops", fault_draw=draw, time_limit_s=16.0)
    landings = [land_once(FlightJob(scenario, "paper", "geometric", seed)) for seed in (1, 2)]
    assert max(landing.over_slew_percent for landing in landings) <= 1e-6
    regained_s = [landing.recovery_s for landing in landings if landing.recovery_s is not None]
    assert regained_s
    assert max(regained_s) <= REGAINED_S


def flown(scenario, seed):
    """The result and the rows of a flight of the pilot `horizon` that sees by geometry."""
    rows = []
    return fly_quietly(scenario, "horizon", "geometric", seed, rows.append), rows


def test_a_ship_met_from_ahead_is_flown_around():
    """It shows no bar: the pilot flies to its stern and lands."""
    start = {"bearing_deg": 180.0, "bearing_half_range_deg": 0.0, "distance_m": 50.0, "height_m": 5.0}
    result, rows = flown(load_scenario(merge(scenario_table("demo"), {"start": start, "time_limit_s": 120.0})), 1)
    assert result.success, result.reason
    assert Mode.TRACK_SHIP in {row.decision.mode for row in rows}
    nearest_m = min(
        max(abs(row.truth.aircraft_in_bar_m[0]), abs(row.truth.aircraft_in_bar_m[1]))
        for row in rows
        if row.truth.aircraft_in_bar_m[0] > 0.5
    )
    assert nearest_m > 2.0  # m: never over the superstructure


def test_a_mirrored_cue_after_a_gap_does_not_lead_the_flight_astray():
    """The cue is hidden for seconds, and what is seen then is its mirror image in the deck."""
    faults = [
        {"kind": "occlusion", "start_s": 6.0, "duration_s": 7.0},
        {"kind": "reflection", "start_s": 6.0, "duration_s": 11.0, "size": 0.75},
    ]
    result, rows = flown(load_scenario("rig-natops", fault=faults), 1)
    refused = [row for row in rows if "mirror image" in row.observation.reason]
    assert len(refused) > 30
    assert all(12.0 <= row.frame.t_s <= 18.0 for row in refused)
    assert result.success, result.reason


@pytest.mark.parametrize(("size", "limit_s"), [(-0.3, 20.0), (0.4, 40.0)])  # unwarned it lands hard at 12 s and 33 s
def test_by_a_cue_of_another_size_nobody_lands_and_what_is_wrong_is_said(size, limit_s):
    fault = [{"kind": "misstated_cue", "start_s": 0.0, "duration_s": 600.0, "size": size}]
    result, rows = flown(load_scenario("rig-natops", fault=fault, time_limit_s=limit_s), 3)
    assert result.verdict is None
    assert any("is the cue as large, the camera as stated?" in row.decision.reason for row in rows)


def test_a_swing_with_full_sticks_ends():
    """Late pictures and a weak motor set the aircraft swinging: it comes to rest again, and lands."""
    begins_s, lasts_s = (6.239175558491955, 14.798429830246691), (3.430045360154143, 3.2140409562331667)
    kinds, sizes = ("latency_jump", "weak_motor"), (0.5790435609208436, 0.21792152511551724)
    keys = ("kind", "start_s", "duration_s", "size")
    faults = [dict(zip(keys, fault, strict=True)) for fault in zip(kinds, begins_s, lasts_s, sizes, strict=True)]
    landing = land_quietly(FlightJob(load_scenario("ship-sea5", fault=faults), "horizon", "geometric", seed=58))
    assert landing.landed, landing.reason
    assert landing.time_s < 40.0


@pytest.mark.parametrize("profile", ["anafi", "mavlink"])
def test_speed_sticks_stay_calm_where_pictures_are_a_frame_older_than_stamped(profile):
    """Nor is it found in flight; undamped, sticks swing by 20 to 30 %."""
    scenario = load_scenario(
        "rig-natops",
        fault=[{"kind": "old_pictures", "start_s": 8.0, "duration_s": 600.0, "size": 0.03}],
        time_limit_s=22.0,
        **{
            "aircraft.loop.kind": "velocity",
            "delays.telemetry.profile": profile,
            "wind.mean_mps": 1.0,
            "guidance.horizon.latency.deviation_s": 0.0,
            "guidance.modes.settle_s": 60.0,
        },
    )
    _, rows = flown(scenario, 3)
    waiting = [row.decision.command.sticks_percent[:2] for row in rows if row.telemetry.t_s > 16.0]
    assert np.std(waiting, axis=0).max() < 6.0  # %


@pytest.mark.parametrize("seed", [7, 10])
def test_speed_sticks_land_on_a_ship_under_way(seed):
    """Held by optical flow, which low over a ship sees nothing but a ship that moves.

    A view of nothing but ship taken for three quarters of it: 27 cm off, and no touchdown within the time.
    """
    changes = {"aircraft.loop.kind": "velocity", "ship.course.speed_mps": 3.0}
    result, _ = flown(load_scenario("under-way", **changes), seed)
    assert result.success, result.reason
