"""Headings of nose and bar, and the bar's turn."""

import math

import numpy as np
import pytest

from shipland.estimation.heading import (
    Compass,
    HeadingFilters,
    HeadingNoise,
    first_headings,
    headings_at,
    with_compass,
    with_pose,
)
from shipland.messages import BarPose
from shipland.scenario.scenario import load_scenario

NOISE = HeadingNoise(0.03, 0.01, 0.05, 0.03, 0.01)


def _follow(turn_rad_s, compass, seconds=20.0):
    rng, headings = np.random.default_rng(4), first_headings(0.0, 0.5)
    for k in range(1, round(30 * seconds)):
        t_s = k / 30.0
        bar = 0.2 + turn_rad_s * t_s
        headings = headings_at(headings, t_s, 0.0, NOISE)
        if compass:
            headings = with_compass(headings, 0.5 + 0.01 * rng.standard_normal(), NOISE)
        headings = with_pose(headings, 0.5 - bar + 0.01 * rng.standard_normal(), 1e-4, NOISE)
    return headings, bar


@pytest.mark.parametrize("turn_rad_s", [0.0, 0.3])
def test_the_turn_of_the_bar_is_found(turn_rad_s):
    headings, bar_rad = _follow(turn_rad_s, compass=True)
    assert headings.turn_rad_s == pytest.approx(turn_rad_s, abs=0.05)
    assert headings.bar_rad == pytest.approx(bar_rad, abs=0.03)


def test_a_turn_that_nobody_sees_ends():
    headings, bar_rad = _follow(0.3, compass=True)
    seen_s = headings.t_s
    for k in range(1, 900):
        headings = headings_at(headings, seen_s + k / 30.0, 0.0, NOISE)
        if k == 45:  # pictures may be lost for a second or two in a turn
            assert headings.bar_rad == pytest.approx(bar_rad + 0.3 * 1.5, abs=0.1)
    assert abs(headings.turn_rad_s) < 0.01
    assert headings.bar_rad - bar_rad < 0.3 * 8.0


def test_without_a_compass_the_difference_of_the_headings_is_as_good():
    headings, bar_rad = _follow(0.0, compass=False)
    assert headings.nose_rad - headings.bar_rad == pytest.approx(0.5 - bar_rad, abs=0.02)


def test_headings_over_the_north_do_not_jump():
    headings = with_compass(first_headings(0.0, math.pi - 0.02), -math.pi + 0.02, NOISE)
    assert abs(headings.nose_rad - math.pi) < 0.03


def test_what_is_not_finite_is_refused():
    headings = with_pose(first_headings(0.0, 0.1), 0.05, 1e-4, NOISE)
    assert with_compass(headings, math.nan, NOISE) is headings
    assert with_pose(headings, math.inf, 1e-4, NOISE) is headings


def test_the_compass_is_read_between_its_readings_across_north():
    compass = Compass()
    assert compass.at(0.0) is None
    for t_s, heading_rad in ((1.0, math.pi - 0.1), (1.2, -math.pi + 0.1), (1.1, 0.0), (1.3, math.nan)):
        compass.add(t_s, heading_rad)  # the last two: old news, and none
    assert compass.at(0.5) == pytest.approx(math.pi - 0.1)
    assert compass.at(1.15) == pytest.approx(math.pi + 0.05)
    assert compass.at(9.0) == pytest.approx(-math.pi + 0.1)


def test_a_reading_is_news_once():
    compass = Compass()
    assert compass.since(-math.inf, 9.0) is None
    for t_s, heading_rad in ((1.0, 0.1), (1.2, 0.2)):
        compass.add(t_s, heading_rad)
    assert compass.since(0.9, 1.1) == (1.0, 0.1)
    assert compass.since(1.0, 1.19) is None
    assert compass.since(0.9, 1.3) == (1.2, 0.2)  # the newer of two


@pytest.mark.parametrize("compass_ends_s", [0.0, 10.0])
def test_a_nose_that_swings_in_the_wind_does_not_turn_the_bar_without_a_compass(compass_ends_s):
    filters, rng = _filters(), np.random.default_rng(7)
    bar_deg = []
    for k in range(900):
        t_s = k / 30.0
        nose_rad = math.radians(5.0) * math.sin(2.0 * math.pi * t_s)
        if t_s < compass_ends_s and k % 6 == 0:
            filters.compass(t_s, nose_rad + 0.02 * rng.standard_normal())
        headings = filters.take(t_s, _pose(nose_rad - 0.1 + 0.005 * rng.standard_normal()))
        if t_s > compass_ends_s + 5.0:
            bar_deg.append(math.degrees(headings.bar_rad))
    half_swing = np.array(bar_deg[15:]) - np.array(bar_deg[:-15])  # a slow drift turns axes, bar and place alike
    assert np.max(np.abs(half_swing)) < 0.2


def test_of_a_turn_that_has_ended_nothing_is_left():
    filters, bar_rad = _filters(), 0.0
    for k in range(900):
        t_s = k / 30.0
        bar_rad += float(np.interp(t_s, [10.0, 25.0], [0.2, 0.0])) / 30.0
        if k % 6 == 0:
            filters.compass(t_s, 0.0)
        headings = filters.take(t_s, _pose(-bar_rad))
        if t_s > 25.5:
            assert abs(headings.turn_rad_s) < 0.03


def test_a_ship_that_turns_is_followed_without_a_compass():
    filters = _filters()
    for k in range(900):
        bar_rad = 0.15 * k / 30.0  # the nose keeps its heading, whatever the axes
        headings = filters.take(k / 30.0, _pose(-bar_rad))
    assert headings.turn_rad_s == pytest.approx(0.15, abs=0.02)
    assert headings.nose_rad - headings.bar_rad == pytest.approx(-bar_rad, abs=0.02)


def test_a_compass_that_comes_back_with_another_error_does_not_turn_the_nose_against_the_bar():
    filters = _filters()
    for k in range(1500):
        t_s = k / 30.0
        if k % 6 == 0 and not 10.0 < t_s < 30.0:
            filters.compass(t_s, 0.2 if t_s < 20.0 else 0.35)
        headings = filters.take(t_s, _pose(0.1))
    assert headings.nose_rad - headings.bar_rad == pytest.approx(0.1, abs=0.02)


def _filters():
    horizon = load_scenario("near").guidance.horizon
    return HeadingFilters(horizon.heading, horizon.heading_turning, horizon.turn_from_rad_s)


def _pose(yaw_rad):
    return BarPose(np.array([-8.0, 0.0, 0.0]), yaw_rad, np.diag([1e-4, 1e-4, 1e-4, 2.5e-5]), 0.1, np.zeros((4, 2)))
