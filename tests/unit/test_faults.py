"""Faults: each reaches what it says and nothing raises; a weak rotor turns the aircraft the way it must."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from shipland.config import build
from shipland.errors import ConfigError
from shipland.evaluation.job import FlightJob, land_once
from shipland.evaluation.recovery import recoveries
from shipland.flight import fly
from shipland.messages import Intent, Mode, PilotCommand
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.faults import Fault, FaultDraw, FaultKind, faults_of, with_faults
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario

START_S, LONG_S, LONGEST_S = 1.0, 2.0, 3.6
"""A fault begins, lasts, and the flight ends."""
HOVER = PilotCommand(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CLOSE = {"distance_m": 5.0, "distance_half_range_m": 0.0}
"""A start from which the landing begins at 7.25 s."""


@cache
def flown(kind, length_s=LONGEST_S, **fault):
    """Records and the scenario of a short flight in which one thing fails; flown once."""
    return flown_with(kind, length_s, **fault)


def flown_with(kind, length_s, *also, start=None, **fault):
    """The same with other faults `also`, from another start."""
    table = {"kind": kind, "start_s": START_S, "duration_s": LONG_S} | fault
    scenario = load_scenario("rig-natops", fault=[table, *also], start=start or {})
    vehicle = build_vehicle(scenario, 3, None)
    faulty, autonomy = with_faults(scenario, vehicle, build_autonomy(scenario, vehicle, "horizon", "geometric", 3), 3)
    records = []
    fly(faulty, autonomy, length_s, lambda: 0.0, records.append)
    end_s = records[0].frame.t_s + length_s  # a go-around goes on
    return [it for it in records if it.telemetry.t_s <= end_s], scenario


def during(records, late_s=0.3):
    return [it for it in records if START_S + late_s < it.telemetry.t_s < START_S + LONG_S - 0.1]


def clean():
    return flown("low_battery", size=50.0)[0]


@pytest.mark.vision_fails
@pytest.mark.parametrize("kind", list(FaultKind))
def test_no_fault_stops_the_loop_or_breaks_the_slew_bound(kind):
    records, scenario = flown(kind.value)
    assert records[-1].telemetry.t_s > START_S + LONG_S + 0.5
    commands = [record.decision.command for record in records]
    for before, after in pairwise(commands):
        allowed = scenario.safety.slew_percent_per_s * (after.t_s - before.t_s) + 1e-6
        for name in ("pitch_percent", "roll_percent", "heave_percent", "yaw_percent"):
            assert math.isfinite(getattr(after, name))
            assert abs(getattr(after, name) - getattr(before, name)) <= allowed


def test_dropped_and_lost_pictures_do_not_come():
    assert len(during(flown("dropped_frames", size=0.9)[0])) < 0.5 * len(during(clean()))
    for kind, telemetry_goes_on in (("dropped_frames", True), ("link_loss", False)):
        dark = during(flown(kind, size=1.0)[0])
        assert {it.observation.reason for it in dark} == {"no picture"}
        assert np.max(np.diff([it.telemetry.t_s for it in dark])) < 0.3
        assert (np.ptp([it.telemetry.attitude_t_s for it in dark]) > 1.0) == telemetry_goes_on


def test_without_pictures_the_pilot_climbs_out_from_above_the_deck():
    records, _ = flown_with("dropped_frames", 11.0, start=CLOSE, start_s=7.5, duration_s=4.0, size=1.0)
    dark = [it for it in records if 8.5 < it.telemetry.t_s < 10.5]
    assert {it.decision.command.intent for it in dark} == {Intent.GO_AROUND}
    assert dark[-1].telemetry.height_m - dark[0].telemetry.height_m > 0.5


@pytest.mark.parametrize("kind", ["wrong_size_frames", "occlusion"])
def test_pictures_without_content_give_no_pose(kind):
    assert all(it.observation.bar_pose is None for it in during(flown(kind)[0]))


def test_a_spoiled_clock_does_not_let_hours_pass():
    scenario = load_scenario("rig-natops", fault=[{"kind": "spoiled_values", "start_s": 0.0, "duration_s": 9.0}])
    vehicle = build_vehicle(scenario, 3, None)
    faulty, _ = with_faults(scenario, vehicle, build_autonomy(scenario, vehicle, "horizon", "geometric", 3), 3)
    faulty.open()
    _, telemetry = faulty.read()
    true_s = faulty.now_s
    faulty.telemetry_at(telemetry.t_s + 1e6)
    faulty.send(replace(HOVER, t_s=telemetry.t_s + 1e6))
    assert faulty.now_s - true_s < 0.1
    assert faulty.read() is not None
    assert faulty.now_s - true_s < 1.0


def test_the_geometric_camera_sees_on_after_a_clock_that_leapt():
    scenario = load_scenario("rig-natops", fault_draw={"kinds": ["spoiled_values"]})
    rows = []
    flown = fly_quietly(scenario, "horizon", "geometric", 58, rows.append)
    offsets_s = [row.frame.stamp_s - row.frame.t_s for row in rows if row.frame.stamp_s is not None]
    assert offsets_s[-1] != 0.0  # from some spoiled time on the flight's clock is not the vehicle's
    assert flown.success, flown.reason


def test_a_frozen_picture_is_recognised():
    frozen = during(flown("frozen_frames")[0])
    assert np.ptp([it.frame.t_s for it in frozen]) > 1.0
    assert all(it.observation.bar_pose is None for it in frozen)
    assert all("picture repeated" in it.observation.reason for it in frozen)


def test_late_pictures_are_late():
    late = during(flown("latency_jump", size=0.4)[0], 0.8)
    soon = during(clean(), 0.8)
    age_s = [np.median([it.telemetry.t_s - it.frame.t_s for it in records]) for records in (late, soon)]
    assert age_s[0] - age_s[1] == pytest.approx(0.4, abs=0.05)


def test_what_the_telemetry_says():
    assert all(it.telemetry.heading_rad is None for it in during(flown("nan_telemetry")[0]))
    assert np.ptp([it.telemetry.height_m for it in during(flown("stale_telemetry")[0])]) == 0.0
    assert {it.telemetry.battery_percent for it in during(flown("low_battery", size=7.0)[0])} == {7.0}
    assert "battery at 7 %" in during(flown("low_battery", size=7.0)[0])[0].decision.reason


def test_compass_is_off_by_its_size():
    records = during(flown("compass_bias", size=20.0)[0])
    sound = {it.frame.t_s: it for it in during(clean())}
    first = next(it for it in records if it.frame.t_s in sound)
    before = math.degrees(sound[first.frame.t_s].telemetry.heading_rad)
    assert math.degrees(first.telemetry.heading_rad) - before == pytest.approx(20.0, abs=8.0)  # it has begun to turn


@pytest.mark.parametrize(("kind", "age_s"), [("frozen_gimbal", 0.0), ("stale_gimbal", 1.8)])
def test_a_gimbals_reading_stands_still_and_says_so_or_not(kind, age_s):
    records = flown(kind)[0]
    still, before = during(records), [it for it in records if it.frame.t_s < START_S]
    assert len({(it.frame.gimbal.roll_rad, it.frame.gimbal.pitch_rad) for it in still}) == 1
    assert np.ptp([it.frame.gimbal.pitch_rad for it in before]) > 1e-3
    ages_s = [it.frame.gimbal_age_s for it in still]
    assert max(ages_s) == pytest.approx(age_s, abs=0.3)
    assert age_s == 0.0 or np.min(np.diff(ages_s)) > 0.0


def test_a_frozen_gimbal_moves_the_height_by_what_it_is_off_at_that_range():
    records, _ = flown("frozen_gimbal", 14.0, start_s=5.0, duration_s=9.0)
    checked = 0
    for record in records:
        pose, truth, off = record.observation.bar_pose, record.truth, record.frame.gimbal
        if pose is None or truth is None or not 5.4 < record.frame.t_s < 13.0:
            continue
        camera_in_bar = truth.ned_from_bar.inverse() @ truth.ned_from_camera
        true_pitch_rad = -math.asin(camera_in_bar.rotation[2, 2])
        wrong_rad = off.pitch_rad - true_pitch_rad
        if abs(wrong_rad) < math.radians(1.0):
            continue
        wrong_m = float(pose.position_in_bar_m[2] - camera_in_bar.translation_m[2])
        lever_m = -float(camera_in_bar.translation_m[0])
        # Either the corners prove the reading wrong, or it turns the line of sight by its error.
        assert abs(wrong_m) < 0.1 or wrong_m == pytest.approx(wrong_rad * lever_m, rel=0.35)
        checked += abs(wrong_m) > 0.1
    assert checked > 10


@pytest.mark.parametrize(("direction", "axis"), [([0.0, 1.0, 0.0], 1), ([0.0, 0.0, 1.0], 2)])
def test_flow_is_off_in_the_direction_that_is_said(direction, axis):
    records = flown("flow_bias", size=2.0, direction_in_level=tuple(direction))[0]
    false = next(it for it in records if it.telemetry.t_s > START_S + 0.02)
    sound = next(it for it in clean() if it.telemetry.t_s > START_S + 0.02)
    off_mps = false.telemetry.velocity_in_level_mps - sound.telemetry.velocity_in_level_mps
    assert off_mps.tolist() == pytest.approx([2.0 if i == axis else 0.0 for i in range(3)], abs=0.05)


def test_old_pictures_show_what_was_and_are_stamped_as_new():
    # so little that bar and gimbal still agree: else the safety goes around
    records = flown("old_pictures", size=0.3)[0]
    places_m = {round(it.frame.t_s, 3): it.truth for it in records if it.truth is not None}
    seen = 0
    for record in during(records, 1.0):
        assert record.telemetry.t_s - record.frame.t_s < 0.4
        assert record.frame.t_s - record.frame.stamp_s == pytest.approx(0.3, abs=0.04)
        camera = places_m[round(record.frame.stamp_s, 3)]
        shown_m = (camera.ned_from_bar.inverse() @ camera.ned_from_camera).translation_m
        if (pose := record.observation.bar_pose) is not None:
            seen += 1
            assert np.linalg.norm(pose.position_in_bar_m - shown_m) < 0.9  # 1.5 m in that second; the gimbal is today's
    assert seen > 10


@pytest.mark.parametrize(("kind", "goes_on"), [("frozen_barometer", True), ("stale_barometer", False)])
def test_a_barometer_stands_still_and_its_time_or_not(kind, goes_on):
    still = during(flown(kind)[0])
    assert np.ptp([it.telemetry.height_m for it in still]) == 0.0
    assert (np.ptp([it.telemetry.height_t_s for it in still]) > 1.0) == goes_on
    assert np.ptp([it.telemetry.attitude_t_s for it in still]) > 1.0


def test_a_cue_stated_too_large_is_seen_as_much_too_far_away():
    for share in (0.1, -0.1):
        seen = [it for it in during(flown("misstated_cue", size=share)[0]) if it.observation.bar_pose is not None]
        assert len(seen) > 10
        for record in seen:
            truth, pose = record.truth, record.observation.bar_pose
            true_m = (truth.ned_from_bar.inverse() @ truth.ned_from_camera).translation_m
            far_m = float(np.linalg.norm(pose.position_in_bar_m))
            assert far_m / float(np.linalg.norm(true_m)) == pytest.approx(1.0 + share, abs=0.03)


def test_a_stalled_process_decides_nothing_meanwhile():
    records = flown("process_stall", duration_s=1.5)[0]
    assert max(np.diff([it.telemetry.t_s for it in records])) == pytest.approx(1.5, abs=0.1)
    records = flown("pilot_stalls", duration_s=1.5)[0]
    assert max(np.diff([it.telemetry.t_s for it in records])) == pytest.approx(1.5, abs=0.1)


def test_after_a_stall_over_the_deck_nothing_is_left_of_the_landing():
    records, _ = flown_with("process_stall", 14.0, start=CLOSE, start_s=8.3, duration_s=3.0)
    before, after = ([it for it in records if lo < it.telemetry.t_s < hi] for lo, hi in ((7.8, 8.3), (11.3, 14.0)))
    assert {it.decision.mode for it in before} == {Mode.LAND}
    assert {it.decision.mode for it in after} == {Mode.GO_AROUND}
    assert after[0].decision.estimate is None


def test_blind_after_a_stall_it_climbs_held_by_the_vehicle_and_then_backs_off_against_the_wind():
    dark = {"kind": "occlusion", "start_s": 8.2, "duration_s": 20.0}
    records, _ = flown_with("process_stall", 22.0, dark, start=CLOSE, start_s=8.3, duration_s=3.0)
    commands = {it.telemetry.t_s: it.decision.command for it in records if it.telemetry.t_s > 11.8}
    assert {it.intent for it in commands.values()} == {Intent.GO_AROUND}
    climb, back = ([it for t_s, it in commands.items() if lo < t_s < hi] for lo, hi in ((11.8, 15.3), (16.3, 18.3)))
    assert {(it.pitch_percent, it.roll_percent) for it in climb} == {(0.0, 0.0)}
    assert min(it.heave_percent for it in climb) > 50.0
    assert {it.heave_percent for it in back} == {0.0}
    tilted = np.mean(
        [[it.telemetry.pitch_rad, it.telemetry.roll_rad] for it in records if 13.3 < it.telemetry.t_s < 15.3], 0
    )
    assert math.degrees(tilted[1]) > 1.5
    for command in back:
        assert command.roll_percent == pytest.approx(100.0 * tilted[1] / math.radians(30.0), abs=4.0)
    first, last = (next(it for it in records if it.telemetry.t_s > t_s).truth.aircraft_in_bar_m for t_s in (15.8, 21.3))
    assert -8.0 < last[0] - first[0] < -2.0  # astern of where it climbed


def test_who_lost_the_place_near_the_ship_climbs_out_and_does_not_search():
    dark = {"kind": "occlusion", "start_s": 8.9, "duration_s": 20.0}
    records, _ = flown_with("process_stall", 18.0, dark, start_s=9.0, duration_s=2.0)
    after = [it for it in records if it.telemetry.t_s > 11.5]
    assert after[0].decision.estimate is None
    assert after[-1].decision.mode is Mode.GO_AROUND
    assert Mode.SEARCH not in {it.decision.mode for it in after}


def test_a_false_pose_over_the_deck_is_not_believed_and_the_landing_broken_off():
    records, _ = flown_with("false_pose", 10.9, start=CLOSE, start_s=7.9, duration_s=3.0, size=1.5)
    false = [it for it in records if 7.9 < it.frame.t_s < 10.9 and it.decision.estimate is not None]
    assert len(false) > 30
    for record in false:
        off_m = record.decision.estimate.aircraft_in_bar_m - record.truth.aircraft_in_bar_m
        assert math.hypot(*off_m[:2].tolist()) < 0.4
    assert records[-1].decision.mode is Mode.GO_AROUND


def test_a_pilot_that_raises_holds_far_from_the_deck_and_climbs_near_it():
    far = during(flown("pilot_raises")[0])
    assert all("pilot failed: RuntimeError: made to fail: hold" in it.decision.reason for it in far)
    assert far[-1].decision.command.intent is Intent.HOLD
    records, _ = flown_with("pilot_raises", 15.3, start=CLOSE, start_s=8.5, duration_s=3.0)
    climbing = [it for it in records if "go around" in it.decision.reason]
    assert climbing
    assert climbing[-1].decision.command.heave_percent > 0.0
    heights_m = [-it.truth.aircraft_in_deck_m[2] for it in climbing]
    assert heights_m[-1] > heights_m[0]
    assert records[-1].decision.mode is not None  # the pilot flies on


def test_a_mirror_image_that_comes_while_the_pilot_raises_leads_nobody_down():
    mirror = {"kind": "reflection", "start_s": 9.66, "duration_s": 3.9, "size": 1.2}
    records, _ = flown_with("pilot_raises", 34.0, mirror, start_s=9.62, duration_s=2.7)
    anew = [it for it in records if it.telemetry.t_s > 12.5 and it.decision.estimate is not None]
    assert len(anew) > 30
    for record in anew:
        off_m = record.decision.estimate.aircraft_in_bar_m - record.truth.aircraft_in_bar_m
        assert abs(float(off_m[2])) < 0.5


def test_a_weak_rotor_sinks_to_its_side_and_is_given_back():
    scenario = load_scenario("rig-natops")
    world = build_vehicle(scenario, 1, None).world
    world.advance(0.5)
    world.weaken_rotor(1, 0.6)  # front left
    world.advance(0.7)
    roll_rad, pitch_rad = world.readings().roll_rad, world.readings().pitch_rad
    assert roll_rad < -0.05
    assert pitch_rad < -0.05
    world.weaken_rotor(1, 0.0)
    world.advance(4.0)
    assert abs(world.readings().roll_rad) < 0.4


def test_the_same_seed_fails_in_the_same_way():
    kinds = ["link_loss", "spoiled_values", "weak_motor"]
    scenario = load_scenario("rig-natops", fault_draw={"kinds": kinds, "count": 3}, time_limit_s=10.0)
    assert faults_of(scenario, 5) == faults_of(scenario, 5) != faults_of(scenario, 6)
    assert {fault.kind.value for seed in range(20) for fault in faults_of(scenario, seed)} == set(kinds)
    one, two = (land_once(FlightJob(scenario, "paper", "geometric", 5)) for _ in range(2))
    assert str(one) == str(two)
    assert one.conditions.faults.count("+") == 3


def test_nothing_drawn_leaves_a_flight_as_it_was():
    scenario = load_scenario("rig-natops")
    vehicle = build_vehicle(scenario, 1, None)
    autonomy = build_autonomy(scenario, vehicle, "paper", "geometric", 1)
    assert with_faults(scenario, vehicle, autonomy, 1) == (vehicle, autonomy)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "gremlins", "start_s": 1.0, "duration_s": 1.0}, "dropped_frames"),
        ({"kind": "glare", "start_s": 1.0, "duration_s": 1.0, "size": 2.0}, "size of glare is a share"),
        ({"kind": "glare", "start_s": 1.0, "duration_s": 0.0}, "duration_s: expected more than 0"),
        ({"kind": "misstated_cue", "start_s": 1.0, "duration_s": 1.0, "size": -1.0}, "must be above -1"),
        ({"kind": "old_pictures", "start_s": 1.0, "duration_s": 1.0, "size": 0.0}, "must be positive"),
        (
            {"kind": "flow_bias", "start_s": 1.0, "duration_s": 1.0, "direction_in_level": [0.0, 2.0, 0.0]},
            "must be a unit vector, got length 2",
        ),
        (
            {"kind": "glare", "start_s": 1.0, "duration_s": 1.0, "direction_in_level": [0.0, 1.0, 0.0]},
            "glare has no direction_in_level",
        ),
    ],
)
def test_wrong_faults_are_named(table, words):
    with pytest.raises(ConfigError, match=words):
        load_scenario("rig-natops", fault=[table])


def test_drawn_faults_begin_and_last_within_what_is_asked():
    draw = FaultDraw((FaultKind.GLARE,), False, 200, 3.0, 5.0, 0.5, 1.0)
    faults = draw.draw(np.random.default_rng(1))
    assert all(3.0 <= it.start_s <= 5.0 and 0.5 <= it.duration_s <= 1.0 and 0.0 < it.size <= 1.0 for it in faults)
    assert {it.kind for it in replace(draw, every_kind=True).draw(np.random.default_rng(1))} == set(FaultKind)
    assert list(faults) == sorted(faults, key=lambda it: it.start_s)


def test_drawn_faults_are_as_large_and_directed_as_is_said():
    draw = FaultDraw((FaultKind.FLOW_BIAS,), False, 3, 3.0, 5.0, 0.5, 1.0, size=2.0, direction_in_level=(0.0, 1.0, 0.0))
    faults = draw.draw(np.random.default_rng(1))
    assert {(it.size, it.direction_in_level) for it in faults} == {(2.0, (0.0, 1.0, 0.0))}
    usual = replace(draw, size=None, direction_in_level=None).draw(np.random.default_rng(1))
    assert [it.start_s for it in usual] == [it.start_s for it in faults]


def test_recovery_is_the_time_until_the_place_is_true():
    records, scenario = flown("occlusion", 6.0)
    (recovery_s,) = recoveries(records, scenario.fault)
    assert 0.0 <= recovery_s < 2.0

    def estimated(change):
        """The same records with other estimates."""
        return [
            replace(it, decision=replace(it.decision, estimate=change(it.decision.estimate)))
            if it.decision.estimate
            else it
            for it in records
        ]

    off = estimated(lambda told: replace(told, aircraft_in_bar_m=told.aircraft_in_bar_m + 5.0))
    assert recoveries(off, scenario.fault) == [math.inf]
    assert recoveries(estimated(lambda _: None), scenario.fault) == [math.inf]
    later = build(Fault, {"kind": "glare", "start_s": 4.0, "duration_s": 2.0})
    assert recoveries(records[: len(records) // 2], [later]) == []
