"""Run-time assurance: what the monitor finds, what the recovery flies, who has the aircraft."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.config import build, plain
from shipland.errors import ConfigError
from shipland.frames import wrap_angle
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    Override,
    PilotCommand,
    Telemetry,
)
from shipland.rig import Rig
from shipland.safety.assurance import Safety, SafetyParameters
from shipland.safety.axes import Axes
from shipland.safety.cue_checks import WayScale
from shipland.safety.estimate import SafetyEstimate, SafetyEstimator
from shipland.safety.input_gate import InputGate
from shipland.safety.monitor import Action, Finding, MonitorParameters, stopping_distance_m, telemetry_old
from shipland.safety.recovery import REFUSED_S, Recovery, Rung, Switch, next_switch, sticks_of

PARAMETERS = SafetyParameters()
TABLE = plain(PARAMETERS)
RECOVERY = PARAMETERS.recovery
CAMERA = Camera.from_fov(1280, 720, 69.0)
RIG = Rig()
DECK_M = RIG.deck_in_bar_m
SPEEDS = replace(ANAFI_LIKE, kind="velocity", max_speed_mps=4.0, servo_per_s=1.0, hold_below_percent=0.0)
TILTS = replace(ANAFI_LIKE, hold_below_percent=0.0)
STEP_S = 0.05


class Flight:
    """A point mass that follows its sticks, poses of it that come late, and the safety over what it is told to do.

    Args:
        place_m: (3,) in `bar`; the bar's axis points north.
        velocity_mps: (3,) over ground.
        response: of the vehicle.
        wind_mps2: (2,) acceleration by the wind.
        tell: alters the telemetry.
        parameters: of the safety.
    """

    def __init__(
        self, place_m, velocity_mps=(0, 0, 0), response=ANAFI_LIKE, wind_mps2=(0, 0), tell=None, parameters=PARAMETERS
    ):
        self.place_m, self.velocity_mps = np.array(place_m, dtype=float), np.array(velocity_mps, dtype=float)
        self.response, self.wind_mps2, self.tell = response, np.array(wind_mps2, dtype=float), tell
        self.safety = Safety(parameters, RIG, CAMERA, np.zeros(3), response)
        self.t_s, self.tilt_mps2 = 100.0, -self.wind_mps2
        self.ship_mps = np.zeros(3)
        self.seen, self.override, self.gimbal_off_rad = True, None, 0.0
        self.seen_off_m, self.waves_off = np.zeros(3), False
        self.reversed = ""
        self.late = [(self.t_s, self.place_m.copy())] * 6
        self.decisions = []

    def fly(self, seconds, asked):
        for _ in range(round(seconds / STEP_S)):
            self.t_s += STEP_S
            pitch_rad, roll_rad = -math.atan(self.tilt_mps2[0] / 9.81), math.atan(self.tilt_mps2[1] / 9.81)
            telemetry = Telemetry(
                self.t_s, roll_rad, pitch_rad, 0.0, 5.0 - self.place_m[2], self.velocity_mps.copy(), 80.0, 90.0, True,
                self.t_s, self.t_s, self.t_s, self.t_s,
            )  # fmt: skip
            if self.tell is not None:
                telemetry = self.tell(telemetry)
            self.late = [*self.late[1:], (self.t_s, self.place_m.copy())]
            exposed_s, place_m = self.late[0]
            pose = (
                BarPose(place_m + self.seen_off_m, 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2))) if self.seen else None
            )
            command = replace(PilotCommand(self.t_s, 0.0, 0.0, 0.0, 0.0, 0.0), **asked)
            decision = Decision(command, Mode.LAND, "asked")
            observation = Observation(exposed_s, GimbalAttitude(0.0, 0.0), pose, waves_off=self.waves_off)
            if self.gimbal_off_rad > 0.0:
                observation = replace(observation, bar_pose=None, gimbal_off_rad=self.gimbal_off_rad)
            decision = self.safety.check(decision, observation, telemetry, self.override)
            self.decisions.append(decision)
            self.move(decision.command)
        return self

    def move(self, command):
        if self.reversed:
            command = replace(command, **{self.reversed: -getattr(command, self.reversed)})
        given = np.array([self.response.input_of(stick) for stick in (command.pitch_percent, command.roll_percent)])
        if command.intent is Intent.HOLD or (not given.any() and self.response.hold_below_percent > 0.0):
            given = (
                self.velocity_mps[:2] * 0.0
                if self.response.kind == "velocity"
                else -self.wind_mps2 - self.velocity_mps[:2]
            )
        if self.response.kind == "velocity":
            given = -self.wind_mps2 + 2.0 * (given - self.velocity_mps[:2])
        self.tilt_mps2 = self.tilt_mps2 + STEP_S / 0.2 * (given - self.tilt_mps2)
        down_mps = -0.01 * command.heave_percent * self.response.max_climb_mps
        self.velocity_mps[:2] += STEP_S * (self.tilt_mps2 + self.wind_mps2)
        self.velocity_mps[2] += STEP_S / 0.3 * (down_mps - self.velocity_mps[2])
        self.place_m += STEP_S * (self.velocity_mps - self.ship_mps)

    @property
    def safety_flies(self):
        return self.decisions[-1].mode is Mode.GO_AROUND

    @property
    def said(self):
        return "; ".join(dict.fromkeys(decision.reason for decision in self.decisions))

    @property
    def over_deck_m(self):
        return DECK_M[2] - self.place_m[2]


def over_deck(height_m, forward_m=0.0, right_m=0.0):
    return DECK_M + np.array([forward_m, right_m, -height_m])


LANDING = {"heave_percent": -40.0, "intent": Intent.LAND}


def test_a_landing_without_anything_wrong_is_left_alone():
    flight = Flight(over_deck(1.2)).fly(2.0, {}).fly(1.0, LANDING)
    assert flight.said == "asked"
    assert flight.decisions[-1].command.heave_percent == -40.0


@pytest.mark.parametrize("response", [ANAFI_LIKE, TILTS, SPEEDS])
@pytest.mark.parametrize("wind_mps2", [(0.0, 0.0), (1.2, 0.0), (0.0, -1.2)])
def test_who_flies_at_the_bar_is_braked_ahead_of_it_and_brought_back(response, wind_mps2):
    """The stick towards the bar from 9 m, all the while: the aircraft never comes to the superstructure."""
    flight = Flight((-9.0, 0.0, -0.2), response=response, wind_mps2=wind_mps2)
    roll_percent = response.stick_of(-wind_mps2[1]) if response.kind == "attitude" else 0.0
    nearest_m = math.inf
    for _ in range(200):
        flight.fly(STEP_S, {"pitch_percent": 60.0, "roll_percent": roll_percent})
        above = flight.place_m[2] < -0.5  # the superstructure ends 0.15 m over the bar's centre
        nearest_m = nearest_m if above else min(nearest_m, -flight.place_m[0])
    assert nearest_m > 0.25
    assert "ahead of the bar" in flight.said


@pytest.mark.parametrize(("right_m", "towards"), [(-8.0, True), (8.0, True), (-8.0, False)])
def test_who_flies_at_the_bar_from_aside_is_braked_too_and_who_passes_beside_it_is_not(right_m, towards):
    flight = Flight((-8.0, right_m, -0.2), response=TILTS)
    roll_percent = -math.copysign(40.0, right_m) if towards else 0.0
    nearest_m = math.inf
    for _ in range(120):
        flight.fly(STEP_S, {"pitch_percent": 40.0, "roll_percent": roll_percent})
        behind = abs(flight.place_m[1]) < 0.5 * RIG.platform_width_m and flight.place_m[2] > -0.5
        nearest_m = min(nearest_m, -flight.place_m[0]) if behind else nearest_m
    assert nearest_m > 0.25
    assert ("ahead of the bar" in flight.said) == towards


def test_a_flow_that_begins_to_lie_breaks_a_landing_off_and_is_no_news_once_the_bar_is_out_of_sight():
    """A recovery is over when nothing is found any more; what poses contradicted can only be found with poses."""

    def lie(telemetry):
        off = np.array([0.0, 2.5, 0.0]) if telemetry.t_s > 104.0 else np.zeros(3)
        return replace(telemetry, velocity_in_level_mps=telemetry.velocity_in_level_mps + off)

    flight = Flight(over_deck(1.2), tell=lie).fly(3.5, {}).fly(2.5, {**LANDING, "heave_percent": -5.0})
    assert "the vehicle's velocity and the poses differ by" in flight.said
    assert flight.decisions[-1].command.intent is Intent.GO_AROUND
    flight.seen = False
    flight.fly(40.0, {})
    assert "refused" not in flight.said
    assert flight.decisions[-1].mode is Mode.LAND  # the pilot's own again


@pytest.mark.parametrize("over_deck_m", [0.35, 1.2])
def test_a_bar_that_contradicts_the_gimbal_is_not_flown_on(over_deck_m):
    flight = Flight(over_deck(1.2)).fly(2.0, {})
    flight.gimbal_off_rad = 0.06
    flight.fly(2 * STEP_S, {})
    assert "safety" not in flight.said  # two pictures may err
    flight.fly(2 * STEP_S, {})
    assert "gimbal and horizon disagree, in 3 pictures of the last seconds: go_around" in flight.said
    assert flight.decisions[-1].command.intent is Intent.GO_AROUND
    committed = Flight(over_deck(over_deck_m)).fly(2.0, {})
    committed.gimbal_off_rad = 0.06
    committed.fly(0.5, {**LANDING, "heave_percent": -1.0})
    assert ("safety" in committed.said) == (over_deck_m > PARAMETERS.monitor.commit_m)


@pytest.mark.parametrize("posed", [True, False])
def test_who_comes_near_on_boxes_alone_goes_around_unless_no_pose_was_ever_seen(posed):
    flight = Flight(over_deck(1.2, -1.5))
    if posed:
        flight.fly(1.0, {})
    flight.seen = False
    flight.fly(20.0, {"intent": Intent.HOLD})
    assert "safety" not in flight.said
    flight.t_s += STEP_S
    box_px = CAMERA.focal_px * np.array(RIG.board_size_m) / -flight.place_m[0]
    bar = Observation(flight.t_s, GimbalAttitude(0.0, 0.0), None, Box((640.0, 360.0), tuple(box_px), 0.9))
    decision = Decision(PilotCommand(flight.t_s, 5.0, 0.0, 0.0, 0.0, 0.0), Mode.TRACK_BAR, "asked")
    telemetry = Telemetry(flight.t_s, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True, *[flight.t_s] * 4)
    checked = flight.safety.check(decision, bar, telemetry)
    assert ("no pose for" in checked.reason) == posed
    assert (checked.command.heave_percent > 0.0) == posed


def test_who_flies_on_near_the_ship_and_sees_nothing_is_held_and_then_goes_around():
    flight = Flight(over_deck(1.2, -1.5)).fly(1.0, {})
    flight.seen = False
    flight.fly(2.5, {"roll_percent": 20.0})
    assert flight.decisions[-1].command.intent is Intent.HOLD
    flight.fly(2.0, {"roll_percent": 20.0})
    assert "no pose for" in flight.said
    assert flight.decisions[-1].command.heave_percent > 0.0


@pytest.mark.parametrize(("ahead_m", "goes_around"), [(-9.0, True), (-20.0, False)])
def test_poses_that_leap_by_a_third_of_the_way_to_the_bar_are_not_waited_for(ahead_m, goes_around):
    flight = Flight((ahead_m, 0.0, -1.0)).fly(1.5, {"pitch_percent": 10.0})
    flight.seen_off_m[0] = -3.0
    flight.fly(1.0, {"pitch_percent": 10.0})
    assert flight.safety_flies is goes_around
    assert ("poses leap by 3" in flight.said) is goes_around


def test_a_leap_is_forgotten_where_no_poses_follow():
    flight = Flight((-9.0, 0.0, -1.0)).fly(1.5, {"pitch_percent": 10.0})
    flight.seen_off_m[0] = -3.0
    assert flight.fly(0.5, {"pitch_percent": 10.0}).safety_flies
    flight.seen = False
    flight.fly(40.0, {"intent": Intent.HOLD})
    assert "refused" not in flight.said
    assert not flight.safety_flies


def test_with_a_ship_that_circles_place_and_velocity_are_carried_on_and_no_further_than_is_known():
    place_m, turn_rad_s, ahead_mps = np.array([-4.0, 0.5, -0.7]), 0.5, 4.5
    estimator = SafetyEstimator(RIG, CAMERA, np.zeros(3))
    velocity_mps = np.array([ahead_mps - turn_rad_s * place_m[1], turn_rad_s * place_m[0], 0.0])
    pose = BarPose(place_m, 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2)))
    for cycle in range(3000):
        t_s = 100.0 + cycle / 30.0
        told = Telemetry(
            t_s, 0.0, 0.0, wrap_angle(turn_rad_s * t_s), 5.0, velocity_mps, 80.0, 90.0, True, *[t_s] * 4
        )  # fmt: skip
        seen = Observation(t_s - 0.3, GimbalAttitude(0.0, 0.0), pose if cycle < 120 else None)
        estimate = estimator.updated(seen, told)
        if cycle == 119:
            assert estimate.place_in_bar_m == pytest.approx(place_m, abs=0.05)
            assert estimate.velocity_in_bar_mps == pytest.approx(np.zeros(3), abs=0.1)
    assert max(map(abs, estimate.velocity_in_bar_mps)) < 20.0


def way(scale, ship_mps=0.0, told=True, gap_s=None):
    """An approach from 12 m and a hover of ten seconds, by poses that err by `scale`; a swell of 10 cm."""
    fit, rng = WayScale(RIG.deck_size_m), np.random.default_rng(3)
    for t_s in np.arange(0.0, 20.0, 0.1):
        own_m = 10.0 * (1.0 - math.exp(-t_s / 4.0)) + ship_mps * t_s
        if gap_s is not None and gap_s <= t_s < gap_s + 1.0:
            fit.interrupt()
            continue
        distance_m = 12.0 + ship_mps * t_s - own_m + 0.1 * math.sin(t_s) + rng.normal(0.0, 0.02)
        fit.take(t_s, scale * distance_m, 0.5, (own_m * math.cos(0.5), own_m * math.sin(0.5)), 4e-4)
    if not told:
        fit.interrupt()
    return fit


@pytest.mark.parametrize("gap_s", [None, 4.0])
@pytest.mark.parametrize("scale", [0.7, 1.0, 1.3])
def test_the_vehicles_own_way_tells_the_scale_of_the_poses(scale, gap_s):
    fit = way(scale, gap_s=gap_s)
    assert fit.scale == pytest.approx(scale, abs=0.06)
    assert fit.sigma < (0.05 if gap_s is None else 0.1)


def test_the_scale_is_not_judged_to_a_ship_under_way_nor_without_an_own_velocity():
    assert math.isinf(way(0.7, ship_mps=2.0).sigma)
    assert math.isinf(way(0.7, told=False).sigma)


def test_a_hover_that_follows_the_waves_tells_no_scale():
    fit = way(1.0)
    for t_s in np.arange(20.0, 120.0, 0.1):
        own_m = 10.0 + 0.25 * math.sin(t_s)
        fit.take(t_s, 2.0, 0.5, (own_m * math.cos(0.5), own_m * math.sin(0.5)), 4e-4)
        off = abs(math.log(max(fit.scale, 0.01))) - fit.sigma
        assert off < MonitorParameters().scale_off or math.isinf(fit.sigma)


@pytest.mark.parametrize("ship_mps", [0.5, 0.75])
def test_a_slow_ship_whose_deck_carries_the_flow_along_is_no_cue_of_another_size(ship_mps):
    fit, rng, own_m, distance_m = WayScale(RIG.deck_size_m), np.random.default_rng(3), 0.0, 22.0
    for t_s in np.arange(0.0, 40.0, 0.1):
        over_deck = distance_m < 2.2
        closing_mps = 0.0 if over_deck else 1.2 + 0.6 * math.sin(0.7 * t_s)
        own_m += 0.1 * (closing_mps + (0.0 if over_deck else ship_mps))
        distance_m -= 0.1 * closing_mps
        told_m = distance_m + 0.1 * math.sin(t_s) + rng.normal(0.0, 0.02)
        fit.take(t_s, told_m, 0.5, (own_m * math.cos(0.5), own_m * math.sin(0.5)), 4e-4)
        assert abs(math.log(fit.scale)) - fit.sigma < MonitorParameters().scale_off


@pytest.mark.parametrize("told", [math.nan, math.inf, 1e200])
def test_what_is_no_way_tells_no_scale(told):
    fit = way(1.0)
    before = fit.scale
    fit.take(21.0, told, 0.0, (told, 0.0), 1e-4)
    assert fit.scale == before


def test_a_ships_way_is_no_contradiction():
    flight = Flight(over_deck(1.2), velocity_mps=(3.0, 1.0, 0.0))
    flight.ship_mps = np.array([3.0, 1.0, 0.0])
    flight.fly(4.0, {"pitch_percent": 1e-3})
    assert "safety" not in flight.said


@pytest.mark.parametrize("part", ["attitude", "velocity", "height"])
def test_no_landing_on_a_reading_that_stands_still(part):
    def stand(telemetry):
        return replace(telemetry, **{f"{part}_t_s": min(telemetry.t_s, 102.0)})

    flight = Flight(over_deck(1.2), tell=stand).fly(4.0, {}).fly(0.5, LANDING)
    assert f"{part} " in flight.said
    assert " s old" in flight.said
    assert flight.decisions[-1].command.heave_percent > 0.0


def test_a_reading_stays_old_when_it_is_too_old_to_be_used():
    told, refused = InputGate(now_s=110.0).telemetry(replace(Telemetry(110.0), roll_rad=0.0, attitude_t_s=102.0))
    assert (told.roll_rad, told.attitude_t_s, refused) == (None, 102.0, "telemetry refused: roll")
    look = SimpleNamespace(telemetry=told, t_s=110.0, limits=MonitorParameters())
    assert telemetry_old(look).words == "attitude 8.0 s old"


def test_what_the_vehicle_complains_of_is_not_landed_with():
    flight = Flight(over_deck(1.2), tell=lambda it: replace(it, alerts="estimator unhealthy")).fly(2.0, {})
    assert "safety" not in flight.said
    flight.fly(0.5, LANDING)
    assert "the vehicle says: estimator unhealthy" in flight.said


@pytest.mark.parametrize("response", [ANAFI_LIKE, TILTS, SPEEDS])
@pytest.mark.parametrize("stick", ["pitch", "roll", "heave"])
def test_a_vehicle_that_answers_a_stick_the_other_way_round_is_let_go(stick, response):
    flight = Flight((-12.0, 0.0, -1.5), response=response)
    flight.reversed = f"{stick}_percent"
    flight.fly(1.5, {flight.reversed: 50.0})
    assert f"the vehicle answers the {stick} stick the other way round: release" in flight.said
    flight.fly(5.0, {flight.reversed: 50.0})
    assert flight.decisions[-1].command.intent is Intent.HOLD
    assert not any(flight.decisions[-1].command.sticks_percent)
    assert np.abs(flight.velocity_mps).max() < 0.3


def test_a_recovery_too_lets_go_of_a_stick_that_is_answered_the_other_way_round():
    flight = Flight(over_deck(1.2)).fly(1.0, {})
    flight.reversed, flight.waves_off = "heave_percent", True
    flight.fly(1.5, LANDING)
    assert "red light: go_around" in flight.said
    assert flight.said.endswith("other way round: release")


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("response", [ANAFI_LIKE, SPEEDS])
def test_late_answers_are_held_against_the_stick_of_their_time(response, sign):
    """Sticks from stop to stop within a second, told 0.3 s late at 5 Hz: half a turn late would look reversed."""
    axes, lag_s = Axes(response), response.lag_s if response.kind == "attitude" else 1.0 / response.servo_per_s
    share, told, found = 0.0, Telemetry(0.0, flying=True), set()
    for cycle in range(300):
        t_s = cycle / 30.0
        stick = 1.0 if math.sin(2.0 * math.pi * t_s) > 0.0 else -1.0
        axes.take(PilotCommand(t_s - response.uplink_s - response.dead_time_s, 0.0, 100.0 * stick, 0.0, 0.0, 0.0), told)
        share += (1.0 - math.exp(-1.0 / 30.0 / lag_s)) * (stick - share)
        if cycle % 6 == 0:
            tilt_rad = sign * share * response.max_tilt_rad if response.kind == "attitude" else 0.0
            speed_mps = np.array([0.0, sign * share * response.max_speed_mps, 0.0])
            told = Telemetry(t_s + 0.3, tilt_rad, 0.0, 0.0, 5.0, speed_mps, flying=True, attitude_t_s=t_s,
                             velocity_t_s=t_s, heading_t_s=t_s)  # fmt: skip
        found.add(axes.reversed_stick)
    assert found == ({""} if sign > 0.0 else {"", "roll"})


def test_a_vehicle_that_is_blown_away_against_its_sticks_is_not_reversed():
    axes = Axes(SPEEDS)
    for cycle in range(150):
        t_s = cycle / 30.0
        blown_mps = np.array([-0.5 * SPEEDS.max_speed_mps, 0.0, 0.0])
        told = Telemetry(t_s, 0.0, -SPEEDS.max_tilt_rad, 0.0, 5.0, blown_mps, flying=True)
        axes.take(PilotCommand(t_s, 100.0, 0.0, 0.0, 0.0, 0.0), told)
        assert not axes.reversed_stick


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_a_nose_that_turns_away_from_its_stick_is_reversed(turns):
    axes = Axes(ANAFI_LIKE)
    for cycle in range(60):
        t_s = cycle / 30.0
        heading_rad = wrap_angle(3.0 + turns * 0.5 * ANAFI_LIKE.max_turn_rad_s * t_s)
        axes.take(PilotCommand(t_s, 0.0, 0.0, 0.0, 50.0, 0.0), Telemetry(t_s, 0.0, 0.0, heading_rad, flying=True))
    assert axes.reversed_stick == ("" if turns > 0.0 else "yaw")


@pytest.mark.parametrize("rate_hz", [2, 5, 10])
@pytest.mark.parametrize("after_s", [0.2, 0.4, 0.6])
def test_one_wrong_answer_just_after_a_stick_has_moved_is_no_reversed_axis(after_s, rate_hz):
    """A velocity that leaps once, a compass that is reset: the other answers are what the sticks ask for."""
    axes, climb_mps, heading_rad, told = Axes(ANAFI_LIKE), 0.0, 0.0, Telemetry(0.0, flying=True)
    for cycle in range(150):
        t_s = cycle / 30.0
        percent = 60.0 if t_s >= 3.0 else 0.0
        sent_s = t_s - ANAFI_LIKE.uplink_s - ANAFI_LIKE.dead_time_s
        axes.take(PilotCommand(sent_s, 0.0, 0.0, percent, percent, 0.0), told)
        climb_mps += (0.01 * percent * ANAFI_LIKE.max_climb_mps - climb_mps) / 30.0 / ANAFI_LIKE.climb_lag_s
        heading_rad += 0.01 * percent * ANAFI_LIKE.max_turn_rad_s / 30.0
        if cycle % (30 // rate_hz) == 0:
            leaps = 3.0 + after_s <= t_s < 3.0 + after_s + 1.0 / rate_hz
            reset_rad = 1.5 if t_s >= 3.0 + after_s else 0.0
            told = Telemetry(t_s, 0.0, 0.0, wrap_angle(heading_rad - reset_rad), 5.0,
                             np.array([0.0, 0.0, 4.0 if leaps else -climb_mps]), flying=True, attitude_t_s=t_s,
                             velocity_t_s=t_s, heading_t_s=t_s)  # fmt: skip
        assert not axes.reversed_stick


def test_a_stick_of_a_hold_asks_for_nothing():
    """The vehicle brakes and keeps its place, whatever the stick says meanwhile."""
    axes = Axes(TILTS)
    for cycle in range(60):
        t_s = cycle / 30.0
        axes.take(
            PilotCommand(t_s, 60.0, 0.0, 0.0, 0.0, 0.0, Intent.HOLD),
            Telemetry(t_s, 0.0, 0.5 * TILTS.max_tilt_rad, flying=True),
        )
        assert not axes.reversed_stick


def test_a_stick_that_is_found_reversed_again_after_a_release_is_let_go_for_good():
    """Each try with a reversed heave costs height: two of them are enough, but a person may give a third."""
    flight = Flight((-12.0, 0.0, -6.0))
    flight.reversed = "heave_percent"
    flight.fly(1.5, {"heave_percent": 50.0})
    assert flight.said.endswith("release")
    flight.fly(2.0 * REFUSED_S, {"heave_percent": 50.0})
    height_m = -flight.place_m[2]
    flight.fly(5.0 * REFUSED_S, {"heave_percent": 50.0})
    assert flight.decisions[-1].reason.endswith("release")
    assert -flight.place_m[2] == pytest.approx(height_m, abs=0.05)
    flight.override = Override.HOLD
    flight.fly(STEP_S, {})
    flight.override, flight.reversed = None, ""
    flight.fly(5.0, {"heave_percent": 50.0})
    assert flight.decisions[-1].reason == "asked"


@pytest.mark.parametrize("stands", [True, False])
def test_a_deck_that_carries_and_tilts_a_landed_aircraft_reverses_no_stick(stands):
    """Motors still run: the deck heaves up at 0.5 m/s and leans 8 deg against descent and roll sticks."""
    axes, found = Axes(ANAFI_LIKE), set()
    for cycle in range(90):
        t_s = cycle / 30.0
        told = Telemetry(t_s, -math.radians(8.0), 0.0, 0.0, 0.5, np.array([0.0, 0.0, -0.5]), flying=True)
        command = PilotCommand(t_s, 0.0, 40.0, -50.0, 0.0, 0.0, Intent.LAND, at_contact_height=stands)
        axes.take(command, told)
        found.add(axes.reversed_stick)
    assert found == ({""} if stands else {"", "roll"})


@pytest.mark.parametrize("over_deck_m", [1.2, 0.3])
def test_a_ship_that_waves_off_is_obeyed_at_any_height_and_flown_near_meanwhile(over_deck_m):
    flight = Flight(over_deck(over_deck_m)).fly(1.0, {})
    flight.waves_off = True
    assert flight.fly(0.5, {}).said == "asked"
    assert "waved off" in flight.fly(0.3, LANDING).said
    assert flight.decisions[-1].command.heave_percent > 0.0


def test_a_landing_beside_the_deck_is_broken_off_while_that_helps():
    flight = Flight(over_deck(1.2, 0.0, 0.1), velocity_mps=(0.0, 0.4, 0.7), response=SPEEDS)
    flight.fly(1.5, {"heave_percent": -70.0, "roll_percent": 12.0, "intent": Intent.LAND})
    assert "from the deck's centre: go_around" in flight.said
    assert flight.over_deck_m > 0.1


@pytest.mark.parametrize("response", [ANAFI_LIKE, TILTS, SPEEDS])
def test_a_go_around_ends_high_and_astern_and_hands_the_aircraft_back(response):
    alerts = {"words": "compass"}
    flight = Flight(
        over_deck(1.0), response=response, wind_mps2=(0.8, -0.5), tell=lambda it: replace(it, alerts=alerts["words"])
    )
    flight.fly(2.0, {}).fly(0.5, LANDING)
    alerts["words"] = ""
    lowest_m = flight.over_deck_m
    for _ in range(300):
        flight.fly(STEP_S, {"intent": Intent.HOLD})
        lowest_m = min(lowest_m, flight.over_deck_m)
        if "safety" not in flight.decisions[-1].reason:
            break
    assert "safety" not in flight.decisions[-1].reason
    assert lowest_m > 0.5
    assert flight.over_deck_m > 0.9 * RECOVERY.clear_height_m
    assert flight.place_m[0] < DECK_M[0] - 0.8 * RECOVERY.clear_back_m
    assert abs(flight.place_m[1]) < 1.5


def test_a_return_on_which_nothing_tells_the_way_does_not_fly_on_for_ever():
    flight = Flight(over_deck(3.0, -4.0), response=SPEEDS, tell=lambda it: replace(it, velocity_in_level_mps=None))
    flight.fly(2.0, {})
    flight.safety._switch = Switch(Recovery(Rung.RETURN, flight.t_s, "the wind", calm_s=math.inf))
    flight.seen = False
    flight.fly(60.0, {})
    assert -flight.place_m[0] < RECOVERY.return_m + 2.0


@pytest.mark.parametrize("heading_rad", [0.0, 0.5 * math.pi, math.pi])
def test_a_blind_go_around_backs_along_the_bars_axis_wherever_the_nose_points(heading_rad):
    estimate = SafetyEstimate(t_s=100.0, pose_s=90.0, bar_heading_rad=0.0, heading_rad=heading_rad)
    command = sticks_of(Rung.GO_AROUND, estimate, 100.0, 0.0, SPEEDS, RECOVERY)
    ahead_mps, right_mps = (SPEEDS.input_of(it) for it in (command.pitch_percent, command.roll_percent))
    along_mps = ahead_mps * math.cos(heading_rad) - right_mps * math.sin(heading_rad)
    assert along_mps == pytest.approx(-RECOVERY.astern_mps)


def test_a_ship_that_backs_up_under_a_go_around_does_not_catch_it():
    flight = Flight(over_deck(0.5), response=TILTS, wind_mps2=(-1.0, 0.0))
    flight.fly(1.5, {**LANDING, "heave_percent": -10.0, "pitch_percent": TILTS.stick_of(1.0)})
    flight.safety._switch = Switch(Recovery(Rung.GO_AROUND, flight.t_s, "broken off"))
    flight.wind_mps2[0] = 0.0  # in the superstructure's lee
    nearest_m = []
    for _ in range(40):
        flight.ship_mps[0] -= 0.6 * STEP_S
        flight.fly(STEP_S, LANDING)
        nearest_m.append(-flight.place_m[0])
    assert min(nearest_m) > 1.0


def test_a_wind_that_takes_the_tilt_is_refused_before_anything_is_tried():
    most_mps2 = 9.81 * math.tan(ANAFI_LIKE.max_tilt_rad)
    flight = Flight((-12.0, 0.0, -1.0), response=TILTS, wind_mps2=(0.0, -0.99 * most_mps2))
    held = {"roll_percent": TILTS.stick_of(0.99 * most_mps2)}
    flight.fly(12.0, held)
    assert "refused: the wind takes 15° of tilt, at most 14" in flight.said
    assert flight.decisions[-1].mode is Mode.GO_AROUND
    calm = Flight((-12.0, 0.0, -1.0), response=TILTS, wind_mps2=(0.0, -0.6 * most_mps2))
    calm.fly(12.0, {"roll_percent": TILTS.stick_of(0.6 * most_mps2)})
    assert "refused" not in calm.said


def test_what_does_not_pass_is_tried_three_times_and_then_left():
    """Alerts that last: each landing is broken off, then the ladder is climbed to its end."""
    flight = Flight(over_deck(1.0), response=SPEEDS, tell=lambda it: replace(it, alerts="motor"))
    flight.fly(40.0, LANDING)
    assert "refused: the vehicle says: motor: return" in flight.said
    assert -flight.place_m[0] > RECOVERY.return_m - 3.0
    assert flight.decisions[-1].command.intent in (Intent.HOLD, Intent.GO_AROUND)


def test_a_persons_key_ends_a_recovery_and_a_refusal_too():
    flight = Flight(over_deck(1.0), response=SPEEDS, tell=lambda it: replace(it, alerts="motor"))
    flight.fly(2.0, LANDING)
    assert "go_around" in flight.decisions[-1].reason
    flight.override = Override.HOLD
    flight.fly(2.0, LANDING)
    assert {decision.command.intent for decision in flight.decisions[-40:]} == {Intent.HOLD}
    assert flight.decisions[-1].command.heave_percent == flight.decisions[-1].command.pitch_percent == 0.0
    assert flight.decisions[-1].reason == "held by key h"
    flight.override = None
    flight.fly(40.0, LANDING)
    assert "refused" in flight.decisions[-1].reason  # for good, but for a person
    flight.override = Override.CLIMB
    flight.fly(1.0, LANDING)
    assert flight.decisions[-1].reason == "climbing by key c"
    assert flight.decisions[-1].command.heave_percent == 50.0
    flight.override = None
    flight.fly(0.5, {})
    assert flight.decisions[-1].reason == "asked"


def test_a_persons_key_is_obeyed_while_the_ship_waves_off():
    flight = Flight(over_deck(1.0), response=SPEEDS).fly(1.0, {})
    flight.waves_off = True
    flight.fly(0.5, LANDING)
    assert "waved off" in flight.decisions[-1].reason
    flight.override = Override.HOLD
    flight.fly(STEP_S, LANDING)
    assert (flight.decisions[-1].reason, flight.decisions[-1].command.intent) == ("held by key h", Intent.HOLD)


def test_a_persons_key_is_held_to_fence_and_clearance():
    flight = Flight((-9.0, 0.0, -1.0)).fly(1.0, {})
    flight.safety._parameters = replace(PARAMETERS, fence_height_m=4.0)
    flight.override = Override.CLIMB
    flight.fly(1.0, {})
    assert flight.decisions[-1].command.heave_percent == 0.0
    assert "fence: too high" in flight.decisions[-1].reason


@pytest.mark.parametrize(("aside_m", "there"), [(0.9, True), (1.1, False)])
def test_contact_height_is_over_the_deck_alone(aside_m, there):
    flight = Flight(over_deck(0.5, right_m=aside_m * 0.5 * RIG.deck_size_m)).fly(0.5, {})
    assert flight.decisions[-1].command.at_contact_height == there


def test_contact_height_needs_a_fresh_sight_of_it():
    flight = Flight(over_deck(0.5)).fly(0.5, {})
    assert flight.decisions[-1].command.at_contact_height
    flight.seen = False
    flight.fly(PARAMETERS.contact_sight_s + 0.5, {"intent": Intent.HOLD})
    assert not flight.decisions[-1].command.at_contact_height
    assert not Flight(over_deck(3.0)).fly(0.5, {}).decisions[-1].command.at_contact_height


def test_the_place_is_carried_on_from_the_exposure_to_now():
    """Poses 0.25 s late at 1 m/s: the safety's place is that of now, not of then."""
    flight = Flight((-12.0, 0.0, -1.0), velocity_mps=(1.0, 0.0, 0.0), response=SPEEDS)
    flight.fly(3.0, {"pitch_percent": 25.0})
    place_m = flight.safety.estimate.place_in_bar_m
    assert place_m[0] == pytest.approx(flight.place_m[0], abs=0.12)  # a step of 5 cm, and the poses' slope


@pytest.mark.parametrize("calm", [True, False])
@pytest.mark.parametrize("rung", list(Rung))
@pytest.mark.parametrize("tries", [1, RECOVERY.tries + 1])
def test_the_ladder_is_climbed_one_way_and_ends(rung, tries, calm):
    """From every rung: the pilot's again, the same, or the next one; a final one stays."""
    flight = Flight(over_deck(5.0, -6.0)).fly(1.0, {})
    telemetry = Telemetry(flight.t_s, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True)
    look = flight.safety._look(PilotCommand.hold(flight.t_s, 0.0), telemetry)
    before = Switch(Recovery(rung, flight.t_s - 100.0, "why"), tries, -math.inf if calm else flight.t_s)
    after = next_switch(before, look, [], RECOVERY)
    ladder = [*RECOVERY.ladder, *RECOVERY.ladder[-1:]]
    if rung is Rung.BRAKE:
        assert after.recovery is None  # nothing stands ahead there
    elif rung in (Rung.LAND, Rung.RETURN, Rung.RELEASE):
        assert after.recovery is not None
    elif calm and tries <= RECOVERY.tries:
        assert after.recovery is None
    else:
        assert after.recovery.rung is ladder[ladder.index(rung) + 1]
    final = Switch(Recovery(rung, 0.0, "why", calm_s=math.inf), tries)
    assert next_switch(final, look, [], RECOVERY).recovery == final.recovery


@pytest.mark.parametrize("tries", [0, RECOVERY.tries, RECOVERY.tries + 1])
def test_a_refusal_ends_when_what_it_was_for_stays_away_and_counts_as_a_try(tries):
    flight = Flight(over_deck(5.0, -6.0)).fly(1.0, {})
    telemetry = Telemetry(flight.t_s, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True)
    look = flight.safety._look(PilotCommand.hold(flight.t_s, 0.0), telemetry)
    wind = [Finding(Action.REFUSE, "the wind")]
    refused = next_switch(Switch(tries=tries), look, wind, RECOVERY)
    assert refused.recovery.rung is RECOVERY.ladder[-1]
    assert next_switch(refused, look._replace(t_s=look.t_s + 0.9 * REFUSED_S), [], RECOVERY) == refused
    later = look._replace(t_s=look.t_s + 1.1 * REFUSED_S)
    assert next_switch(refused, later, wind, RECOVERY).recovery == refused.recovery
    after = next_switch(refused, later, [], RECOVERY)
    assert after == (replace(refused, recovery=None, tries=tries + 1) if tries <= RECOVERY.tries else refused)
    ditching = next_switch(Switch(), look, wind, replace(RECOVERY, ladder=(Rung.LAND,)))
    assert next_switch(ditching, later._replace(t_s=look.t_s + 1e6), [], RECOVERY) == ditching


def test_stopping_distance_by_hand():
    assert stopping_distance_m(3.0, 0.0, 2.0, 0.5) == pytest.approx(1.5 + 9.0 / 4.0)
    assert stopping_distance_m(3.0, 2.0, 2.0, 0.5) == pytest.approx(1.5 + 0.25 + 16.0 / 4.0)
    assert stopping_distance_m(-3.0, 0.0, 2.0, 0.5) == 0.0


def test_graver_findings_come_first():
    assert sorted(Action) == [Action.NO_GO, Action.BRAKE, Action.GO_AROUND, Action.REFUSE, Action.RELEASE]


@pytest.mark.parametrize("section", ["", "monitor", "recovery"])
def test_no_bound_of_the_safety_can_be_set_out_of_the_world(section):
    inner = TABLE[section] if section else TABLE
    for key, value in inner.items():
        if not isinstance(value, float):
            continue
        for wrong in (1e300, math.inf, math.nan, -1.0):
            table = {**TABLE, section: {**inner, key: wrong}} if section else {**TABLE, key: wrong}
            with pytest.raises(ConfigError, match=key):
                build(SafetyParameters, table)


def test_a_pose_that_is_refused_turns_no_way_out():
    """A go-around flies astern along the bar's heading: of poses that leap not even that is believed."""
    estimator, level = SafetyEstimator(RIG, CAMERA, np.zeros(3)), GimbalAttitude(0.0, 0.0)
    for cycle in range(60):
        t_s, leaps = cycle / 30.0, cycle > 45
        place_m = np.array([-5.0, 3.0 if leaps else 0.0, -0.5])
        pose = BarPose(place_m, math.radians(120.0) if leaps else 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2)))
        telemetry = Telemetry(t_s, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True)
        estimate = estimator.updated(Observation(t_s, level, pose), telemetry)
    assert estimate.leap_m > 2.0
    assert estimate.yaw_rad == 0.0
    assert estimate.bar_in_level_rad() == pytest.approx(0.0)
    assert estimate.bar_distance_m() == pytest.approx(5.0)
    assert estimate.deck_height_m == pytest.approx(5.0 - (DECK_M[2] + 0.5))
    assert estimate.place_in_bar_m == pytest.approx((-5.0, 0.0, -0.5))


def test_of_two_poses_of_one_exposure_the_second_may_not_leap():
    estimator, level = SafetyEstimator(RIG, CAMERA, np.zeros(3)), GimbalAttitude(0.0, 0.0)
    telemetry = Telemetry(0.0, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True)
    for ahead_m in (-5.0, -9.0):
        pose = BarPose(np.array([ahead_m, 0.0, -0.5]), 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2)))
        estimate = estimator.updated(Observation(0.0, level, pose), telemetry)
    assert estimate.leap_m == pytest.approx(4.0)
    assert estimate.place_in_bar_m == pytest.approx((-5.0, 0.0, -0.5))


def test_a_tilt_that_is_told_no_more_becomes_no_wind():
    """The last tilt, of a manoeuvre perhaps, would be held against for ever: blind, as fast as full sticks fly."""
    estimator = SafetyEstimator(RIG, CAMERA, np.zeros(3))
    for cycle in range(600):
        pitch_rad = None if cycle > 120 else math.radians(-20.0) if cycle > 115 else 0.0
        telemetry = Telemetry(
            cycle / 30.0, None if pitch_rad is None else 0.0, pitch_rad, 0.0, 5.0, None, 80.0, 90.0, True
        )
        estimate = estimator.updated(Observation(cycle / 30.0, GimbalAttitude(0.0, 0.0)), telemetry)
    held = sticks_of(Rung.HOLD, estimate, 20.0, 0.0, TILTS, RECOVERY)
    assert abs(held.pitch_percent) < 15.0


@pytest.mark.parametrize("over_deck_m", [0.4, 3.0])
def test_a_command_that_is_no_number_is_no_pilot_low_over_the_deck(over_deck_m):
    """Held there, the aircraft would be struck by a deck that heaves; high above, the vehicle holds."""
    flight = Flight(over_deck(over_deck_m)).fly(1.0, {})
    flight.fly(3.0, {**LANDING, "pitch_percent": math.nan})
    assert "command not finite" in flight.said
    assert flight.over_deck_m > min(over_deck_m, PARAMETERS.floor_m) - 0.05
    assert ("go around" in flight.said) == (over_deck_m < PARAMETERS.floor_m)


def test_a_wave_off_that_is_seen_late_counts_from_then():
    flight = Flight(over_deck(0.6)).fly(1.0, {})
    flight.late = [(flight.t_s - 2.0, flight.place_m.copy())] * 2
    flight.waves_off = True
    flight.fly(STEP_S, {**LANDING, "heave_percent": 0.0})
    assert "waved off by the ship's red light: go_around" in flight.said
