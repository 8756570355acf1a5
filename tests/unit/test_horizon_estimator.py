"""The estimator of the pilot `horizon`: what it makes of the wind that a vehicle holds against, and of a ship."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.estimation.relative_state import GUST, POSITION, STATES, WAVE, WIND
from shipland.estimation.waves import WAVE_STATES
from shipland.frames import GRAVITY_MPS2, rotated
from shipland.guidance.horizon.estimator import Estimator, _in_bar
from shipland.guidance.horizon.guidance import Goals
from shipland.guidance.parameters import GuidanceParameters
from shipland.guidance.response import ANAFI_LIKE
from shipland.guidance.view import View
from shipland.messages import BarPose, Box, GimbalAttitude, Mode, Observation, PilotCommand, Telemetry
from shipland.rig import Rig

PARAMETERS = GuidanceParameters()
RIG = Rig()
CAMERA = Camera.from_fov(1280, 720, 69.0)
CAMERA_IN_BODY_M = np.array([0.09, 0.0, 0.0])
HOVER_IN_BAR_M = RIG.deck_in_bar_m - np.array([0.0, 0.0, 1.2])


CAMERA_AT_M = HOVER_IN_BAR_M + CAMERA_IN_BODY_M


def _estimator(response=ANAFI_LIKE, horizon=PARAMETERS.horizon):
    return Estimator(horizon, response, RIG, CAMERA, CAMERA_IN_BODY_M)


def _cycle(
    estimator, t_s, camera_m=None, yaw_rad=0.0, *, box=None, ship=None, landing=False, pitch_percent=0.0, **told
):
    """A picture of the bar from a place in `bar`, or of its box alone; what is told 0.3 s later; then the sticks."""
    pose = None if camera_m is None else BarPose(camera_m, yaw_rad, np.eye(4) * 1e-6, 0.1, np.zeros((8, 2)))
    telemetry = Telemetry(t_s + 0.3, 0.0, 0.0, 0.0, 3.0, np.zeros(3), 90.0, 90.0, True)
    observation = Observation(t_s, GimbalAttitude(0.0, 0.0), pose, box, ship)
    estimator.take(observation, replace(telemetry, **told), landing)
    estimator.sent(PilotCommand(t_s + 0.33, pitch_percent, 0.0, 0.0, 0.0, 0.0))


def _flown(bar_down_m=lambda _: 0.0, tilt_rad=0.0, seconds=3.0, within_m=math.inf, response=ANAFI_LIKE):
    """An estimator after a hover with released sticks that the vehicle holds by a roll."""
    wave = replace(PARAMETERS.horizon.wave, followed_within_m=within_m)
    estimator = _estimator(response, replace(PARAMETERS.horizon, wave=wave))
    for index in range(round(30 * seconds)):
        t_s = index / 30.0
        _cycle(estimator, t_s, CAMERA_AT_M - np.array([0.0, 0.0, bar_down_m(t_s)]), roll_rad=tilt_rad)
    return estimator


def test_the_wind_that_a_vehicle_holds_against_by_itself_shows_in_its_tilt():
    across = _flown(tilt_rad=0.15).estimate(3.3).across
    wind_mps2 = across.of(WIND) + across.of(GUST)
    assert wind_mps2[1] == pytest.approx(-GRAVITY_MPS2 * math.tan(0.15), abs=0.3)
    assert wind_mps2[0] == pytest.approx(0.0, abs=0.2)


def test_a_ship_that_turns_teaches_neither_the_age_of_pictures_nor_the_sticks_gain():
    estimator = _estimator()
    for index in range(150):
        t_s = index / 30.0
        _cycle(estimator, t_s, CAMERA_AT_M, yaw_rad=-0.3 * max(t_s - 2.0, 0.0))
        if t_s == 2.0:
            assert len(estimator._latency.filters) == len(PARAMETERS.horizon.latency.candidates_s)
    assert estimator._headings.turning
    assert estimator._latency.filters == estimator._gain.filters == []


def test_a_ship_below_moves_a_velocity_from_optical_flow_and_none_from_gps():
    shares = [
        _flown(response=replace(ANAFI_LIKE, velocity_reference=against))._over_ship()
        for against in ("surface", "ground")
    ]
    assert shares[0] > 0.5
    assert shares[1] == 0.0


@pytest.mark.parametrize("before", [0.0, 0.5, 0.75])
@pytest.mark.parametrize("last_digit", [-1e-15, 0.0, 1e-15])
def test_a_view_of_nothing_but_ship_is_one_thing_whatever_it_was_and_to_any_last_digit(before, last_digit):
    """Else a last digit, and with it the processor, would decide the flight."""
    assumed = _estimator()._assumed.with_view(before, 0.3)
    assert assumed.with_view(1.0 + last_digit, 0.3).motion.over_ship == 1.0


def test_a_bar_swings_until_it_is_seen_to_stand_still():
    assert _flown(seconds=0.2).estimate(0.5).wave.bar_moves
    assert not _flown(seconds=5.0).estimate(5.3).wave.bar_moves
    assert _flown(lambda t_s: 0.15 * math.sin(1.8 * t_s), seconds=5.0).estimate(5.3).wave.bar_moves


def test_a_bars_swing_is_followed_near_it_and_less_from_afar():
    def heaving(t_s):
        return 0.15 * math.sin(1.8 * t_s)

    away_m = math.hypot(*_flown(heaving, seconds=5.0).estimate(5.3).place_m)
    for within_m, near in ((math.inf, 1.0), (away_m, 1.0), (away_m / 1.5, 0.5), (away_m / 2.0, 0.0)):
        estimate = _flown(heaving, seconds=5.0, within_m=within_m).estimate(5.3)
        assert estimate.tracked_near == pytest.approx(near, abs=0.01)
        waves = np.array([estimate.across.of(WAVE + k) for k in range(WAVE_STATES)])
        deck_m = near * (estimate.wave.tracked[0] @ waves)
        assert estimate.followed_m == pytest.approx(estimate.across.of(POSITION) - deck_m, abs=0.002)
        assert estimate.followed_states(1)[WAVE] == pytest.approx(near * waves[0, 1], abs=0.002)


def test_a_deck_that_moves_below_a_bar_at_rest_is_where_its_wave_motion_says():
    estimate = _flown(seconds=5.0).estimate(5.3)
    assert not estimate.wave.bar_moves
    mean = estimate.across.mean.copy()
    mean[STATES + WAVE] += 0.1
    shifted = replace(estimate, across=estimate.across._replace(mean=mean))
    assert shifted.deck_later(0.0) - estimate.deck_later(0.0) == pytest.approx([0.0, 0.1])
    assert shifted.followed_m == pytest.approx(estimate.followed_m)  # it is not followed
    now_m2, later_m2 = (estimate.over_deck_covariance_later(passed_s)[0, 0] for passed_s in (0.0, 0.8))
    assert later_m2 > now_m2 > estimate.across.covariance[0, 0]  # the flow shows it, with an error
    carried = _flown(lambda t_s: 0.15 * math.sin(1.8 * t_s), seconds=5.0).estimate(5.3)
    assert carried.deck_later(0.4) == pytest.approx([0.0, 0.0], abs=1e-12)  # what the bar tells is followed


def test_the_covariance_turns_with_the_bar_and_shrinks_with_what_is_seen():
    early, late = _flown(seconds=0.1).at_picture(0.5).covariance, _flown(seconds=3.0).at_picture(3.3).covariance
    for covariance in (early, late):
        assert covariance == pytest.approx(covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > 0.0
    assert (np.diag(late) < np.diag(early)).all()
    estimate, turned = _flown(seconds=3.0).estimate(3.3), np.zeros((4, 4))
    wide = estimate.across.mean, np.diag([9.0, *[1e-6] * (STATES - 1), 1.0, *[1e-6] * (STATES - 1)])
    down = estimate.down.mean, estimate.down.covariance  # the flight's first axis is the bar's left
    by_yaw = 1e-6, False
    _in_bar((wide, down), estimate.wave.bar, 0.5 * math.pi, by_yaw, np.zeros(3), np.zeros(3), turned)
    assert np.diag(turned)[:2] == pytest.approx([1.0, 9.0], abs=1e-3)


def _wagging(turn_rad_s, seconds=12.0):
    """An estimator whose vehicle's nose wags by itself under a compass of 5 Hz, and the bar's last heading."""
    estimator, reading = _estimator(), None
    for index in range(round(30 * seconds)):
        t_s = index / 30.0
        nose_rad, bar_rad = 0.09 * math.sin(2.0 * math.pi * t_s / 1.2), turn_rad_s * t_s
        if index % 6 == 0:
            reading = {"heading_t_s": t_s, "heading_rad": nose_rad}
        _cycle(estimator, t_s, CAMERA_AT_M, nose_rad - bar_rad, velocity_in_level_mps=None, **reading)
    return estimator, bar_rad


@pytest.mark.parametrize("turn_rad_s", [0.0, 0.2])
def test_a_nose_that_wags_between_compass_readings_is_no_turn_of_the_ship(turn_rad_s):
    estimator, bar_rad = _wagging(turn_rad_s)
    estimate = estimator.estimate(12.0)
    assert estimate.turn_rad_s == pytest.approx(turn_rad_s, abs=0.05)
    assert estimate.bar_rad == pytest.approx(bar_rad, abs=0.05)


def test_the_place_stays_known_by_the_vehicles_velocity_and_only_by_it():
    std_m = {}
    for with_velocity in (True, False):
        estimator = _flown()
        for index in range(180):
            _cycle(estimator, 3.0 + index / 30.0, velocity_in_level_mps=np.zeros(3) if with_velocity else None)
        std_m[with_velocity] = estimator.estimate(9.3).position_std_m
    assert std_m[True] < PARAMETERS.horizon.position_std_max_m < std_m[False]


def test_where_the_filter_for_turns_takes_over_the_axes_do_not_step():
    """A compass that errs by 3°, slowly: both filters have it by different shares when the ship begins to turn."""
    estimator, steps_rad, rng = _estimator(), [], np.random.default_rng(3)
    for index in range(240):
        t_s = index / 30.0
        bar_rad = 0.3 * max(t_s - 6.0, 0.0)
        compass_rad = 0.05 * math.sin(0.9 * t_s) + rng.normal(0.0, 0.02)
        before, quiet = estimator._headings.now, not estimator._headings.turning
        _cycle(estimator, t_s, CAMERA_AT_M, -bar_rad, heading_rad=compass_rad, heading_t_s=t_s)
        if quiet and before is not None and estimator._headings.turning:
            steps_rad.append(estimator._headings.now.bar_rad - before.bar_rad)
    assert steps_rad
    assert np.abs(steps_rad).max() < 0.015


def _seen(heading_rad, down_m, seconds=6.0):
    """An estimate after a hover under a bar at rest, with a compass and heights of its own by time."""
    estimator = _estimator()
    for index in range(round(30 * seconds)):
        t_s = index / 30.0
        told = {"heading_rad": heading_rad(t_s), "velocity_in_level_mps": None}
        _cycle(estimator, t_s, CAMERA_AT_M + np.array([0.0, 0.0, down_m(t_s)]), pitch_percent=2.0, **told)
    return estimator.estimate(seconds + 0.3)


@pytest.mark.parametrize("back_s", [4.0, 9.0])
def test_a_compass_that_leaps_turns_neither_nose_nor_bar(back_s):
    estimate = _seen(lambda t_s: 0.4 + math.radians(25.0) * (2.0 < t_s < back_s), lambda _: 0.0)
    assert estimate.bar_rad == pytest.approx(0.4, abs=0.02)
    assert estimate.nose_rad == pytest.approx(0.4, abs=0.02)
    assert abs(estimate.turn_rad_s) < 0.01


def test_a_turn_is_no_leap_of_the_compass():
    estimate = _seen(lambda t_s: 0.3 * t_s, lambda _: 0.0)
    assert estimate.turn_rad_s == pytest.approx(0.3, abs=0.05)


def test_a_height_that_no_climb_leads_to_is_refused_until_it_stays():
    hover_m = float(HOVER_IN_BAR_M[2])
    soon, late = (_seen(lambda _: 0.0, lambda t_s: 1.1 * (t_s > 1.5), seconds) for seconds in (4.2, 9.0))
    assert soon.down_m == pytest.approx(hover_m, abs=0.15)
    assert late.down_m == pytest.approx(hover_m + 1.1, abs=0.15)


def _leapt(from_s, seconds, dark_s=0.0, landing=True):
    """How far aside the estimator of a hover is led by poses that are 1.5 m off from a time on, after a dark spell."""
    estimator = _estimator()
    for index in range(round(30 * seconds)):
        t_s = index / 30.0
        place_m = CAMERA_AT_M + np.array([0.0, 1.5 * (t_s >= from_s), 0.0])
        _cycle(estimator, t_s, None if from_s - dark_s <= t_s < from_s else place_m, landing=landing)
    return float(estimator.estimate(seconds + 0.3).aircraft_in_bar_m[1]), estimator.rejected


def test_a_place_that_leaps_in_full_view_of_a_landing_is_doubted_until_it_stays():
    aside_m, doubted = _leapt(3.0, 7.5)
    assert aside_m == pytest.approx(0.0, abs=0.1)
    assert "cannot be" in doubted
    aside_m, doubted = _leapt(3.0, 9.0)
    assert aside_m == pytest.approx(1.5, abs=0.1)
    assert not doubted


def test_elsewhere_or_after_a_dark_spell_another_place_is_soon_believed():
    assert _leapt(3.0, 3.8, landing=False)[0] == pytest.approx(1.5, abs=0.1)
    assert _leapt(3.0, 3.8, dark_s=0.7)[0] == pytest.approx(1.5, abs=0.1)


def test_a_place_forgotten_begins_anew_at_the_next_pose():
    estimator = _flown()
    estimator.forget_place()
    assert estimator.estimate(3.3) is None
    _cycle(estimator, 6.0, HOVER_IN_BAR_M + np.array([0.0, 3.0, 0.8]))
    assert estimator.estimate(6.3).aircraft_in_bar_m[1] == pytest.approx(3.0, abs=0.1)


def _boxed(estimator, from_s, to_s, bar_in_level_m, velocity_mps):
    """Boxes every half second of a bar at `bar_in_level_m(t_s)`, the vehicle's velocity at 5 Hz, released sticks."""
    (column_px, row_px), (width_m, height_m) = View.of(CAMERA).middle_px, RIG.board_size_m
    for index in range(round(30 * from_s), round(30 * to_s)):
        t_s = index / 30.0
        ahead_m, right_m = bar_in_level_m(t_s)
        scale = CAMERA.focal_px / ahead_m
        box = Box((column_px + scale * right_m, row_px), (scale * width_m, scale * height_m), 0.9)
        velocity = np.array([*velocity_mps, 0.0]) if index % 6 == 0 else None
        _cycle(estimator, t_s, box=box if index % 15 == 0 else None, velocity_in_level_mps=velocity)
    return estimator.estimate(to_s)


def _trailing():
    """An estimator after 15 s astern of a ship at its own 3 m/s."""
    estimator = _estimator()
    _boxed(estimator, 0.0, 15.0, lambda _: (40.0, 0.0), (3.0, 0.0))
    return estimator


def test_a_ship_under_way_is_no_nearer_than_its_boxes_say():
    """The aircraft trails at the ship's own 3 m/s: what it flies is no way towards the ship."""
    estimate = _trailing().estimate(15.0)
    assert estimate.place_m == pytest.approx([-40.0, 0.0], abs=6.0)
    assert estimate.speed_mps == pytest.approx([0.0, 0.0], abs=1.0)


def _approached(from_m, bar_m, to_m, share_of_bar):
    """An estimate after a way at 6 m/s towards a ship that lies still, seen from aside: its boxes tell three quarters
    of the range. From `bar_m` on the bar's tell `share_of_bar` of it."""
    estimator, (column_px, row_px) = _estimator(), View.of(CAMERA).middle_px
    sizes_m = {"ship": (RIG.platform_width_m, RIG.superstructure_height_m), "box": RIG.board_size_m}
    for index in range(round(30 * (2.0 + (from_m - to_m) / 6.0))):
        t_s = index / 30.0
        range_m = from_m - 6.0 * max(t_s - 2.0, 0.0)
        seen, share = ("ship", 0.75) if range_m > bar_m else ("box", share_of_bar)
        scale = CAMERA.focal_px / (share * range_m)
        box = Box((column_px, row_px), (scale * sizes_m[seen][0], scale * sizes_m[seen][1]), 0.9)
        velocity = np.array([6.0 * (t_s > 2.0), 0.0, 0.0])
        _cycle(estimator, t_s, velocity_in_level_mps=velocity, **{seen: box})
    return estimator.estimate(t_s)


def test_another_range_by_another_box_is_no_motion_of_the_ship():
    estimate = _approached(160.0, 100.0, 70.0, 1.0)
    assert estimate.speed_mps == pytest.approx([6.0, 0.0], abs=1.5)
    assert estimate.place_m == pytest.approx([-70.0, 0.0], abs=8.0)


@pytest.mark.parametrize(("from_m", "bar_m", "share"), [(30.0, 14.0, 1.5), (130.0, 60.0, 3.0)])
def test_a_bar_seen_from_aside_that_looks_farther_away_is_not_believed_at_once(from_m, bar_m, share):
    estimate = _approached(from_m, bar_m, bar_m - 1.0, share)
    assert -estimate.place_m[0] < 1.1 * bar_m


def test_the_nose_follows_the_newest_box_of_a_ship_that_turns_away():
    estimate = _boxed(_trailing(), 15.0, 20.0, lambda t_s: (40.0, 3.0 * (t_s - 15.0)), (3.0, 0.0))
    assert estimate.to_bar_rad == pytest.approx(math.atan2(13.5, 40.0), abs=0.02)  # of the last one, at 19.5 s


def test_a_ship_seen_again_is_where_it_is_seen():
    """After 20 s in which it went on, and the aircraft stood."""
    estimate = _boxed(_trailing(), 35.0, 36.0, lambda _: (90.0, 40.0), (0.0, 0.0))
    assert estimate.place_m == pytest.approx([-90.0, -40.0], abs=3.0)


@pytest.mark.parametrize("away_m", [4.0, 12.0, 30.0])
def test_who_waits_for_corners_keeps_the_stand_off_also_from_a_ship_that_comes(away_m):
    approach, view = PARAMETERS.approach, View.of(CAMERA)
    estimator = _estimator()
    estimate = _boxed(estimator, 0.0, 0.2, lambda _: (away_m, 0.0), (0.0, 0.0))
    goal_m, _ = Goals(PARAMETERS.horizon, approach, RIG, view).of(Mode.TRACK_BAR, estimate)
    assert goal_m == pytest.approx([-PARAMETERS.horizon.path.stand_off_m, 0.0], abs=0.2)


def test_a_ship_that_turns_far_away_is_followed_within_seconds():
    """It goes ahead at 3 m/s, then to starboard; the aircraft flies along with it all the time."""
    estimate = _boxed(_trailing(), 15.0, 25.0, lambda _: (40.0, 0.0), (0.0, 3.0))
    assert estimate.course_rad == pytest.approx(0.5 * math.pi, abs=0.25)
    assert estimate.speed_mps == pytest.approx([0.0, 0.0], abs=1.0)


def test_who_flies_abeam_of_a_ship_under_way_is_led_astern_of_its_course():
    estimator = _estimator()
    estimate = _boxed(estimator, 0.0, 20.0, lambda _: (40.0, 0.0), (0.0, 3.0))
    goal_m, _ = Goals(PARAMETERS.horizon, PARAMETERS.approach, RIG, View.of(CAMERA)).of(Mode.TRACK_BAR, estimate)
    ahead_m, right_m = rotated(goal_m, -estimate.course_rad).tolist()
    lead_deg = PARAMETERS.horizon.path.round_lead_deg
    assert math.degrees(math.atan2(abs(right_m), -ahead_m)) == pytest.approx(90.0 - lead_deg, abs=10.0)  # from abeam


@pytest.mark.parametrize(("ship_mps", "known"), [(0.0, True), (3.0, False)])
def test_the_heading_of_a_ship_under_way_is_not_known_for_ever(ship_mps, known):
    """Poses of the bar, then ten seconds of boxes alone."""
    estimator = _estimator()
    for index in range(300):
        velocity = np.array([ship_mps, 0.0, 0.0]) if index % 6 == 0 else None
        _cycle(estimator, index / 30.0, np.array([-12.0, 0.0, 0.0]), velocity_in_level_mps=velocity)
    assert estimator.estimate(10.0).bar_known
    assert _boxed(estimator, 10.0, 20.0, lambda _: (12.0, 0.0), (ship_mps, 0.0)).bar_known is known


@pytest.mark.parametrize(("climb_dead_time_s", "waits_s"), [(0.0, 0.0), (None, ANAFI_LIKE.dead_time_s)])
def test_a_climb_waits_for_its_own_dead_time(climb_dead_time_s: float | None, waits_s: float) -> None:
    """Height half a second after full heave: the stated climb rate with its lag, begun after uplink and dead time."""
    estimator = _estimator(replace(ANAFI_LIKE, climb_dead_time_s=climb_dead_time_s))
    for k in range(60):
        _cycle(estimator, k / 30.0, CAMERA_AT_M)
    now_s = 60 / 30.0 + 0.3
    before_m, later_s = estimator.estimate(now_s).down_m, 0.5
    estimator.sent(PilotCommand(now_s, 0.0, 0.0, 100.0, 0.0, 0.0))
    climbs_s, lag_s = later_s - ANAFI_LIKE.uplink_s - waits_s, ANAFI_LIKE.climb_lag_s
    climbed_m = ANAFI_LIKE.max_climb_mps * (climbs_s - lag_s * (1.0 - math.exp(-climbs_s / lag_s)))
    assert before_m - estimator.estimate(now_s + later_s).down_m == pytest.approx(climbed_m, abs=0.02)
