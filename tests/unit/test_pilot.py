"""The published pilot: every stick moves the right way, and a simple aircraft under it comes to its place."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.frames import rotation_from_euler
from shipland.guidance.near import measure
from shipland.guidance.parameters import GuidanceParameters
from shipland.guidance.pilot import PilotSetup, horizon, paper
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import BarPose, Box, GimbalAttitude, Intent, Mode, Observation, Telemetry
from shipland.rig import Rig

PARAMETERS = GuidanceParameters()
RIG = Rig()
CAMERA = Camera.from_fov(1280, 720, 69.0)
CAMERA_IN_BODY_M = np.array([0.09, 0.0, 0.0])
HOVER_IN_BAR_M = RIG.deck_in_bar_m - np.array([0.0, 0.0, PARAMETERS.approach.hover_height_m])
LEVEL = GimbalAttitude(0.0, 0.0)
STEP_S = 1.0 / 30.0


def paper_pilot(rig=RIG, **approach):
    response = ANAFI_LIKE
    approach = replace(PARAMETERS.approach, **approach)
    guidance = replace(PARAMETERS, far_control="exponential", far_variant="growing", approach=approach)
    return paper(PilotSetup(guidance, rig, CAMERA, CAMERA_IN_BODY_M, response, np.random.default_rng(0)))


def horizon_pilot():
    return horizon(PilotSetup(PARAMETERS, RIG, CAMERA, CAMERA_IN_BODY_M, ANAFI_LIKE, np.random.default_rng(0)))


def pose_of(aircraft_in_bar_m, yaw_rad=0.0):
    camera_in_bar_m = np.asarray(aircraft_in_bar_m) + rotation_from_euler(0.0, 0.0, yaw_rad) @ CAMERA_IN_BODY_M
    return BarPose(camera_in_bar_m, yaw_rad, np.eye(4) * 1e-6, 0.1, np.zeros((8, 2)))


def telemetry(t_s, flying=True):
    return Telemetry(t_s, 0.0, 0.0, 0.0, 3.0, np.zeros(3), 90.0, 90.0, flying)


def settled(aircraft_in_bar_m, yaw_rad=0.0, cycles=30, pilot=None, start_s=0.0):
    """Decision after some cycles at one place."""
    pilot = pilot or paper_pilot()
    for index in range(cycles):
        t_s = start_s + index * STEP_S
        seen = Observation(t_s, LEVEL, pose_of(aircraft_in_bar_m, yaw_rad))
        decision = pilot.decide(seen, telemetry(t_s), None)
    return decision


def boxed(pilot, cycles, box_at, start=0):
    """Decisions over cycles in which the ship's box is `box_at(t_s)`, or nothing is seen."""
    times_s = STEP_S * np.arange(start, start + cycles)
    seen = ((float(t_s), Observation(float(t_s), LEVEL, ship_box=box_at(t_s), reason="nothing")) for t_s in times_s)
    return [pilot.decide(observation, telemetry(t_s), None) for t_s, observation in seen]


def box(column_px):
    return Box((column_px, 360.0), (20.0, 20.0), 0.9)


@pytest.mark.parametrize(
    ("offset_m", "stick", "sign"),
    [
        ((-2.0, 0.0, 0.0), "pitch_percent", 1),
        ((2.0, 0.0, 0.0), "pitch_percent", -1),
        ((0.0, -0.5, 0.0), "roll_percent", 1),
        ((0.0, 0.5, 0.0), "roll_percent", -1),
        ((0.0, 0.0, 1.0), "heave_percent", 1),
        ((0.0, 0.0, -1.0), "heave_percent", -1),
    ],
)
def test_stick_leads_back_to_the_place_wanted(offset_m, stick, sign):
    command = settled(HOVER_IN_BAR_M + np.array(offset_m)).command
    assert sign * getattr(command, stick) > 3.0
    others = {"pitch_percent", "roll_percent", "heave_percent", "yaw_percent"} - {stick}
    assert all(abs(getattr(command, other)) < 1e-6 for other in others)


def test_nose_right_of_the_bar_turns_left():
    command = settled(HOVER_IN_BAR_M, yaw_rad=math.radians(10.0)).command
    assert command.yaw_percent == pytest.approx(-55.0, abs=3.0)  # K_P 5.5 %/° and a little integral


def test_nose_turns_to_the_axis_only_as_far_as_the_bar_stays_in_the_picture():
    # 10 m astern and 10 m right: the bar lies 45° left of its axis, 20° are allowed off the picture's middle
    place_m = np.array([-10.0, 10.0, 0.0])
    widest_rad = math.radians(PARAMETERS.approach.max_bearing_deg)
    towards = settled(place_m, yaw_rad=-math.pi / 4).command.yaw_percent
    resting = settled(place_m, yaw_rad=-math.pi / 4 + widest_rad).command.yaw_percent
    assert towards > 50.0
    assert resting == pytest.approx(0.0, abs=5.0)


def test_error_is_flown_in_the_aircrafts_own_axes():
    # 90° nose right of the bar: what is ahead of the bar lies to the left of the aircraft
    command = settled(HOVER_IN_BAR_M + np.array([-2.0, 0.0, 0.0]), yaw_rad=math.pi / 2).command
    assert command.roll_percent < -10.0
    assert abs(command.pitch_percent) < 1e-6


def test_errors_of_a_pose_by_hand():
    """2 m astern and 0.5 m left of the reference point, nose 90° right of the bar: the place is to the left, behind."""
    measured = measure(1.0, 0.3, pose_of((-4.0, -0.5, 0.0), math.pi / 2), np.array([-2.0, 0.0, -0.5]), CAMERA_IN_BODY_M)
    np.testing.assert_allclose(measured.error_in_level_m, [0.5, -2.0, 0.5], atol=1e-12)


def test_camera_looks_at_the_bar():
    command = settled(np.array([-2.0, 0.0, 0.0]) - CAMERA_IN_BODY_M + np.array([0.0, 0.0, 0.7]), cycles=90).command
    assert command.gimbal_pitch_rad == pytest.approx(math.atan2(0.7, 2.0), abs=0.01)


def test_steady_in_the_square_lands_and_the_landed_vehicle_ends_it():
    pilot = paper_pilot()
    landing = settled(HOVER_IN_BAR_M, cycles=90, pilot=pilot)
    assert landing.mode is Mode.LAND
    assert landing.command.intent is Intent.LAND
    assert landing.command.heave_percent == -PARAMETERS.approach.descent_percent
    after_s = 91 * STEP_S
    done = pilot.decide(Observation(after_s, LEVEL), telemetry(after_s, flying=False), None)
    assert done.mode is Mode.DONE
    assert done.command.heave_percent == 0.0


def test_the_landing_condition_is_that_of_the_rigs_square():
    half_m = 0.5 * 0.8 * PARAMETERS.approach.square_margin
    wide = paper_pilot(replace(RIG, landing_square_m=0.8))
    assert settled(HOVER_IN_BAR_M + np.array([0.0, half_m - 0.05, 0.0]), cycles=90, pilot=wide).mode is Mode.LAND
    wide = paper_pilot(replace(RIG, landing_square_m=0.8))
    assert settled(HOVER_IN_BAR_M + np.array([0.0, half_m + 0.03, 0.0]), cycles=90, pilot=wide).mode is Mode.APPROACH


def test_by_the_published_rule_it_lands_wherever_it_enters_the_square():
    """High, low, off heading and fast: what our rule waits for does not count."""
    half_m = 0.5 * RIG.landing_square_m
    for inside_m in ((0.0, half_m - 0.02, 2.0), (half_m - 0.02, 0.0, -0.5)):
        at_m = HOVER_IN_BAR_M + np.array(inside_m)
        ours, printed = paper_pilot(), paper_pilot(landing_rule="printed")
        assert settled(at_m, yaw_rad=0.3, cycles=40, pilot=ours).mode is Mode.APPROACH
        landing = settled(at_m, yaw_rad=0.3, cycles=40, pilot=printed)
        assert landing.mode is Mode.LAND
        assert landing.command.heave_percent == -PARAMETERS.approach.descent_percent
        far_off = settled(at_m + np.array([0.0, 3.0, 0.0]), cycles=5, pilot=printed, start_s=41 * STEP_S)
        assert far_off.mode is Mode.LAND  # ours would break it off, and wait with the descent before
        assert far_off.command.heave_percent == -PARAMETERS.approach.descent_percent
    outside_m = HOVER_IN_BAR_M + np.array([0.0, half_m + 0.02, 0.0])
    assert settled(outside_m, cycles=90, pilot=paper_pilot(landing_rule="printed")).mode is Mode.APPROACH


def test_without_data_the_sticks_decay_to_zero():
    pilot = paper_pilot()
    before = settled(HOVER_IN_BAR_M + np.array([-4.0, 0.0, 0.0]), cycles=60, pilot=pilot)
    assert before.command.pitch_percent == pytest.approx(11.25)
    decision = boxed(pilot, 90, lambda _: None, 60)[-1]
    assert decision.mode is Mode.NO_VISION
    assert abs(decision.command.pitch_percent) < 1.0  # percent, of the 11 fed before


def test_boxes_fly_the_far_laws():
    decision = boxed(paper_pilot(), 60, lambda _: box(740.0))[-1]
    assert decision.mode is Mode.TRACK_SHIP
    assert decision.command.pitch_percent == pytest.approx(0.008 * (5000.0 - 400.0))
    assert decision.command.roll_percent == 100.0  # 1.2 · (exp(1.58) − 1) · 100, clamped
    assert decision.command.heave_percent == pytest.approx(0.0, abs=0.1)  # the setpoint is the row 360 of the paper
    assert abs(decision.command.yaw_percent) > 10.0  # the nose turns to where the ship was first seen


def test_far_heading_is_held_from_the_first_box_on():
    pilot = paper_pilot()
    boxed(pilot, 60, lambda _: box(639.5))
    turned = replace(telemetry(60 * STEP_S), heading_rad=math.radians(5.0))
    decision = pilot.decide(Observation(60 * STEP_S, LEVEL, ship_box=box(639.5)), turned, None)
    assert decision.command.yaw_percent < -20.0  # K_P 5.5 %/° and its derivative, back to the left


def test_far_sticks_are_kept_while_a_box_is_missing():
    decision = boxed(paper_pilot(), 60, lambda t_s: box(640.0) if t_s < 1.49 else None)[-1]
    assert decision.mode is Mode.TRACK_SHIP
    assert decision.command.pitch_percent == pytest.approx(0.008 * (5000.0 - 400.0))


def test_search_holds_turns_and_climbs():
    pilot, commands = paper_pilot(), []
    search = PARAMETERS.search
    for t_s in np.arange(0.0, search.look_s + search.turn_s + search.climb_s, 0.5):
        decision = pilot.decide(Observation(t_s, LEVEL, reason="nothing"), telemetry(t_s), None)
        assert decision.mode is Mode.SEARCH
        commands.append(decision.command)
    assert commands[2].yaw_percent == 0.0
    turned_deg = sum(0.5 * 0.4 * command.yaw_percent for command in commands)  # 40°/s at full stick
    assert turned_deg == pytest.approx(360.0, abs=4.0)
    assert commands[-2].heave_percent == search.climb_percent


@pytest.mark.parametrize("start_m", [(-10.0, 2.0, -1.0), (-6.0, -3.0, 1.0)])
def test_a_velocity_held_aircraft_comes_to_rest_in_the_square(start_m):
    """Aircraft that takes sticks as velocities (4 m/s, 1 m/s, 40°/s) with a lag of 0.5 s: the law alone."""
    pilot = paper_pilot()
    place_m, velocity_mps = np.array(start_m), np.zeros(3)
    for index in range(30 * 60):
        t_s = index * STEP_S
        decision = pilot.decide(Observation(t_s, LEVEL, pose_of(place_m)), telemetry(t_s), None)
        if decision.mode is Mode.LAND:
            break
        command = decision.command
        wanted_mps = np.array(
            [0.04 * command.pitch_percent, 0.04 * command.roll_percent, -0.01 * command.heave_percent]
        )
        velocity_mps += (wanted_mps - velocity_mps) * STEP_S / 0.5
        place_m = place_m + velocity_mps * STEP_S
    assert decision.mode is Mode.LAND
    assert np.all(np.abs(place_m[:2] - RIG.deck_in_bar_m[:2]) < 0.5 * RIG.landing_square_m)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_target_lost_to_a_side_is_searched_for_on_that_side(side):
    search_s = PARAMETERS.search.look_s * len(PARAMETERS.search.camera_pitch_deg)
    cycles = round(30 * (2.0 + PARAMETERS.modes.memory_s + search_s + 8.0))
    decision = boxed(paper_pilot(), cycles, lambda t_s: box(639.5 + side * 300.0 * t_s) if t_s < 2.0 else None)[-1]
    assert decision.mode is Mode.SEARCH
    assert decision.command.yaw_percent == pytest.approx(side * PARAMETERS.search.turn_percent)


def test_the_nose_follows_a_target_that_would_leave_the_picture():
    decision = boxed(paper_pilot(), 90, lambda t_s: box(639.5 if t_s < 1.49 else 639.5 + 600.0))[-1]
    assert decision.command.yaw_percent > 20.0  # 33° off the nose, 20° are let stand


def test_a_bearing_is_added_to_the_heading_of_its_own_picture():
    """The nose turns at 20 °/s; a ship ahead at exposure stays at the heading of the exposure, 0.6 s before."""
    pilot, turn_rad_s, delay_s = paper_pilot(), math.radians(20.0), 0.6
    for index in range(90):
        now_s = index * STEP_S
        exposure_s = now_s - delay_s
        bearing_rad = -turn_rad_s * exposure_s  # of a ship due north
        box = Box((CAMERA.matrix[0, 2] + CAMERA.focal_px * math.tan(bearing_rad), 360.0), (20.0, 20.0), 0.9)
        seen = Observation(exposure_s, LEVEL, ship_box=box if index > 20 and exposure_s < 1.3 else None)
        decision = pilot.decide(seen, replace(telemetry(now_s), heading_rad=turn_rad_s * now_s), None)
    assert decision.mode is Mode.TRACK_SHIP
    assert pilot._state.far_heading_rad == pytest.approx(0.0, abs=math.radians(0.5))  # 12° off with the newest heading


@pytest.mark.parametrize("build_pilot", [paper_pilot, horizon_pilot])
def test_a_camera_that_looks_aside_is_flown_as_one_that_looks_ahead(build_pilot):
    aside_rad = math.radians(15.0)

    def flown(gimbal, pilot):
        bearing_rad = math.atan2(60.0, CAMERA.focal_px) - gimbal.yaw_rad
        ship = Box((CAMERA.matrix[0, 2] + CAMERA.focal_px * math.tan(bearing_rad), 360.0), (20.0, 20.0), 0.9)
        pose = pose_of((-4.0, 0.3, -0.5))
        for index in range(150):
            t_s = index * STEP_S
            near = replace(pose, yaw_rad=gimbal.yaw_rad) if index > 90 else None
            decision = pilot.decide(Observation(t_s, gimbal, near, ship_box=ship), telemetry(t_s), None)
            if index in (90, 149):
                yield decision

    ahead = list(flown(LEVEL, build_pilot()))
    aside = list(flown(replace(LEVEL, yaw_rad=aside_rad), build_pilot()))
    assert [decision.mode for decision in aside] == [Mode.TRACK_SHIP, Mode.APPROACH]
    for one, other in zip(ahead, aside, strict=True):
        assert other.command.sticks_percent == pytest.approx(one.command.sticks_percent, abs=4.0)
        assert max(map(abs, one.command.sticks_percent)) > 5.0


# `horizon` steps its filters by whole milliseconds, so a rounding of the clock moves a stick by tenths of a percent.
@pytest.mark.parametrize(("build_pilot", "off_percent"), [(paper_pilot, 1e-6), (horizon_pilot, 5.0)])
@pytest.mark.parametrize("start_s", [5000.0, -20.0])
def test_time_may_start_anywhere(start_s, build_pilot, off_percent):
    """Search, boxes, corners, landing: the same sticks whatever the vehicle's clock says at the start."""

    def sticks(offset_s):
        pilot, rows, sent = build_pilot(), [], None
        for index in range(300):
            t_s = offset_s + index / 32.0  # a step that adds up without rounding: no change of mode comes a cycle later
            box = Box((660.0, 370.0), (20.0, 20.0), 0.9) if 100 <= index < 160 else None
            pose = pose_of(HOVER_IN_BAR_M + np.array([-0.05, 0.02, 0.0])) if index >= 160 else None
            sent = pilot.decide(Observation(t_s - 0.25, LEVEL, pose, ship_box=box), telemetry(t_s), sent).command
            names = ("pitch_percent", "roll_percent", "heave_percent", "yaw_percent", "gimbal_pitch_rad")
            rows.append([getattr(sent, name) for name in names])
        return np.array(rows)

    at_zero = sticks(0.0)
    assert np.ptp(at_zero, axis=0).min() > 0.0
    off = np.abs(sticks(start_s) - at_zero)
    assert (
        np.percentile(off, 98.0) <= off_percent
    )  # rounded to milliseconds, a cycle may be on the other side of a limit


def test_a_vehicle_that_was_never_heard_is_no_gap():
    never = np.float64(-math.inf)
    silent = Telemetry(0.0, None, None, None, None, None, None, None, True, never, never, never, never)
    pilot = horizon_pilot()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(2):
            decision = pilot.decide(Observation(never, LEVEL), silent, None)
    assert decision.mode is Mode.SEARCH
    assert "nothing heard" not in decision.reason


def test_after_a_gap_the_position_is_found_anew():
    pilot, place_m = horizon_pilot(), (-8.0, 0.0, 0.0)
    assert settled(place_m, cycles=60, pilot=pilot).estimate is not None
    assert settled(place_m, cycles=1, pilot=pilot, start_s=5.0).estimate is None
