import numpy as np
import pytest

from shipland.config import build
from shipland.errors import ConfigError
from shipland.sim.ship.course import (
    Course,
    CourseParameters,
    Manoeuvre,
    ManoeuvringCourse,
    StraightCourse,
    build_course,
)

STEP_S = 1e-4


def course(**keys: object) -> Course:
    parameters = build(CourseParameters, keys, "course")
    return build_course(parameters, np.random.default_rng(4))


@pytest.mark.parametrize("kind", ["still", "straight", "s", "turn", "turn90", "random", "varying", "reverse"])
def test_derivatives_are_those_of_the_values(kind: str) -> None:
    way = course(kind=kind, course_deg=40.0, speed_mps=3.0)
    for t_s in np.random.default_rng(1).uniform(0.0, 200.0, 300):
        before, now, after = way.at(t_s - STEP_S), way.at(t_s), way.at(t_s + STEP_S)
        velocity = (after.position_in_ned_m - before.position_in_ned_m) / (2 * STEP_S)
        acceleration = (after.velocity_in_ned_mps - before.velocity_in_ned_mps) / (2 * STEP_S)
        rate = (after.course_rad - before.course_rad) / (2 * STEP_S)
        course_acceleration = (after.course_rate_rad_s - before.course_rate_rad_s) / (2 * STEP_S)
        # central differences over 0.2 ms: rounding 1e-16·500 m/1e-4 s and curvature are both below 1e-7, ten times less
        np.testing.assert_allclose(now.velocity_in_ned_mps, velocity, atol=1e-6)
        np.testing.assert_allclose(now.acceleration_in_ned_mps2, acceleration, atol=1e-6)
        assert now.course_rate_rad_s == pytest.approx(rate, abs=1e-6)
        # the third derivative jumps where manoeuvres meet: half a step of it at most
        assert now.course_acceleration_rad_s2 == pytest.approx(course_acceleration, abs=1e-4)


@pytest.mark.parametrize("kind", ["s", "turn90", "random", "varying"])
def test_nothing_jumps_along_the_way(kind: str) -> None:
    way = course(kind=kind, speed_mps=4.5)
    states = [way.at(t_s) for t_s in np.arange(0.0, 150.0, 0.01)]
    velocity = np.array([state.velocity_in_ned_mps for state in states])
    acceleration = np.array([state.acceleration_in_ned_mps2 for state in states])
    position = np.array([state.position_in_ned_m for state in states])
    assert np.abs(np.diff(position, axis=0)).max() <= 4.5 * 0.01 + 1e-9
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.05
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.1


def test_a_ship_that_reverses_stops_and_goes_astern_as_fast() -> None:
    way = course(kind="reverse", speed_mps=2.0, start_s=10.0, leg_s=2.0)
    north_mps = [float(way.at(t_s).velocity_in_ned_mps[0]) for t_s in (9.9, 11.0, 12.1, 60.0)]
    assert north_mps == pytest.approx([2.0, 0.0, -2.0, -2.0], abs=1e-9)
    assert {way.at(t_s).course_rad for t_s in (9.9, 11.0, 12.1)} == {0.0}
    with pytest.raises(ConfigError, match="needs a leg_s above 0"):
        course(kind="reverse", leg_s=0.0)


def test_the_ship_moves_along_its_course() -> None:
    way = course(kind="s", speed_mps=3.0)
    for t_s in np.linspace(0.0, 120.0, 50):
        state = way.at(t_s)
        along = np.array([np.cos(state.course_rad), np.sin(state.course_rad)])
        np.testing.assert_allclose(state.velocity_in_ned_mps, 3.0 * along, atol=1e-12)


def test_an_s_swings_by_its_change_of_course_to_either_side() -> None:
    way = course(kind="s", course_deg=20.0, speed_mps=3.0, change_deg=130.0, manoeuvres=4)
    headings = np.degrees([way.at(t).course_rad for t in np.arange(0.0, 300.0, 0.1)])
    assert headings.max() == pytest.approx(20.0 + 65.0, abs=1e-6)
    assert headings.min() == pytest.approx(20.0 - 65.0, abs=1e-6)


def test_a_right_angle_turn_ends_on_the_new_course() -> None:
    way = course(kind="turn90", course_deg=10.0, speed_mps=2.0, start_s=5.0)
    assert way.at(5.0).course_rad == pytest.approx(np.radians(10.0))
    end = way.at(500.0)
    assert end.course_rad == pytest.approx(np.radians(100.0))
    assert end.course_rate_rad_s == 0.0


def test_a_turn_is_no_tighter_than_its_radius() -> None:
    way = course(kind="turn", change_deg=130.0, speed_mps=3.0, turn_radius_m=9.0)
    rates = [abs(way.at(t).course_rate_rad_s) for t in np.arange(0.0, 100.0, 0.01)]
    assert 3.0 / max(rates) == pytest.approx(9.0, rel=1e-4)


def test_a_quarter_turn_by_hand() -> None:
    # symmetric about its middle: north and east gain the same way in a turn from north to east
    way = ManoeuvringCourse(0.0, 2.0, [Manoeuvre(0.0, 8.0, 0.5 * np.pi)])
    north, east = way.at(8.0).position_in_ned_m
    assert north == pytest.approx(east, abs=1e-9)
    assert np.hypot(north, east) < 16.0


def test_speed_changes_smoothly_to_its_new_value() -> None:
    way = ManoeuvringCourse(0.0, 1.0, [Manoeuvre(2.0, 4.0, 0.0, 2.0)])
    # the blend is symmetric: mean speed in the manoeuvre is 2 m/s
    assert way.at(6.0).position_in_ned_m[0] == pytest.approx(2.0 + 8.0, abs=1e-9)
    assert way.at(10.0).position_in_ned_m[0] == pytest.approx(10.0 + 4.0 * 3.0, abs=1e-9)


def test_a_random_course_keeps_within_its_speeds_and_repeats_with_its_seed() -> None:
    times_s = np.arange(0.0, 300.0, 0.5)
    one, same = course(kind="random", speed_mps=4.0), course(kind="random", speed_mps=4.0)
    found = np.array([np.hypot(*one.at(t_s).velocity_in_ned_mps) for t_s in times_s])
    assert found.max() <= 4.0 + 1e-9
    assert found.min() >= 2.0 - 1e-9
    assert np.ptp(found) > 0.3
    np.testing.assert_array_equal(one.at(77.0).position_in_ned_m, same.at(77.0).position_in_ned_m)


def test_straight_and_still_by_hand() -> None:
    east = StraightCourse(0.5 * np.pi, 2.0).at(3.0)
    np.testing.assert_allclose(east.position_in_ned_m, [0.0, 6.0], atol=1e-12)
    still = course(kind="still", course_deg=30.0).at(9.0)
    assert still.course_rad == pytest.approx(np.radians(30.0))
    assert np.all(still.position_in_ned_m == 0.0)


def test_manoeuvres_that_overlap_are_refused() -> None:
    with pytest.raises(ValueError, match="follow one another"):
        ManoeuvringCourse(0.0, 1.0, [Manoeuvre(0.0, 5.0, 1.0), Manoeuvre(3.0, 5.0, 1.0)])
