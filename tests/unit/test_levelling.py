"""The tilt is taken out before contact, and no more of it than the deck needs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from responses import SPEED_LIKE
from shipland.errors import ConfigError
from shipland.guidance.horizon.odds import odds_of_tilt
from shipland.guidance.horizon.parameters import LevellingParameters
from shipland.guidance.horizon.regulator import speed_near_contact, tilt_near_contact
from shipland.guidance.response import ANAFI_LIKE

LEVELLING = LevellingParameters(tilt_deg=10.0, lags=1.5, tilt_max_deg=25.0, tilt_std_deg=5.0)
LEVEL = np.zeros(2)
"""Of a deck's normal."""


def tilt_deg_of(acceleration_mps2: np.ndarray) -> float:
    return math.degrees(math.atan(np.linalg.norm(acceleration_mps2) / 9.80665))


def test_tilt_is_free_early_and_bounded_at_contact() -> None:
    wanted = np.array([4.0, -3.0])
    np.testing.assert_array_equal(tilt_near_contact(wanted, LEVEL, 2.0, ANAFI_LIKE, LEVELLING), wanted)
    at_contact = tilt_near_contact(wanted, LEVEL, 0.0, ANAFI_LIKE, LEVELLING)
    assert tilt_deg_of(at_contact) == pytest.approx(10.0, abs=0.05)
    np.testing.assert_allclose(at_contact / np.linalg.norm(at_contact), wanted / 5.0)


def test_a_small_tilt_stays() -> None:
    wanted = np.array([0.5, -1.0])
    np.testing.assert_array_equal(tilt_near_contact(wanted, LEVEL, 0.0, ANAFI_LIKE, LEVELLING), wanted)


def test_a_deck_tilted_as_the_aircraft_leaves_it_its_tilt_and_one_tilted_against_it_takes_more() -> None:
    wanted, normal = np.array([3.4, 0.0]), np.array([1.7, 0.0])
    np.testing.assert_array_equal(tilt_near_contact(wanted, normal, 0.0, ANAFI_LIKE, LEVELLING), wanted)
    against = tilt_near_contact(wanted, -normal, 0.0, ANAFI_LIKE, LEVELLING)
    np.testing.assert_allclose(against, [LEVELLING.tilt_mps2 - 1.7, 0.0])


def test_the_bound_closes_no_faster_than_the_vehicle_follows() -> None:
    wanted, levelling = np.array([50.0, 0.0]), LEVELLING
    times_s = np.linspace(levelling.before_contact_s(ANAFI_LIKE), 1.0, 20)
    most = [float(tilt_near_contact(wanted, LEVEL, t_s, ANAFI_LIKE, levelling)[0]) for t_s in times_s]
    assert np.max(np.diff(most) / np.diff(times_s)) <= ANAFI_LIKE.max_input_rate + 1e-6


def change_mps2(wanted: np.ndarray, tilt: np.ndarray, tracked: np.ndarray, normal: np.ndarray = LEVEL) -> np.ndarray:
    asked = speed_near_contact(wanted, normal, tilt, tracked, SPEED_LIKE, LEVELLING)
    return SPEED_LIKE.approach_per_s * (asked - tracked)


def test_a_speed_is_changed_by_as_much_as_there_is_too_much_tilt() -> None:
    tracked, tilt = np.array([0.2, -0.1]), np.array([4.0, 0.0])
    np.testing.assert_allclose(change_mps2(tracked, tilt, tracked), [LEVELLING.tilt_mps2 - 4.0, 0.0])
    assert float(np.linalg.norm(change_mps2(tracked, 3.0 * tilt, tracked))) == pytest.approx(3.0)
    tilting_more = np.array([3.0, 0.0]) + tracked
    np.testing.assert_allclose(change_mps2(tilting_more, tilt, tracked), change_mps2(tracked, tilt, tracked))


def test_a_speed_is_changed_by_the_tilt_against_the_deck() -> None:
    tracked, tilt, normal = np.array([0.2, -0.1]), np.array([3.0, 0.0]), np.array([1.0, 0.0])
    for deck in (normal, -normal):
        left_mps2 = tilt + change_mps2(tracked, tilt, tracked, deck) - deck
        np.testing.assert_allclose(left_mps2, [min(LEVELLING.tilt_mps2, 3.0 - deck[0]), 0.0])
    np.testing.assert_array_equal(change_mps2(tracked, tilt, tracked, 2.0 * normal), np.zeros(2))


def test_a_speed_that_tilts_little_is_as_the_gains_want_it() -> None:
    wanted, tracked = np.array([0.3, 0.1]), np.array([0.2, -0.1])
    asked = speed_near_contact(wanted, LEVEL, np.array([0.5, 0.3]), tracked, SPEED_LIKE, LEVELLING)
    np.testing.assert_array_equal(asked, wanted)


def test_a_tilt_is_gone_by_contact_only_where_there_is_time() -> None:
    level, tilted = 9.80665 * math.tan(math.radians(4.0)), 9.80665 * math.tan(math.radians(24.0))
    assert odds_of_tilt(level, 0.0, ANAFI_LIKE, LEVELLING) > 0.999
    at_once, later = (odds_of_tilt(tilted, left_s, ANAFI_LIKE, LEVELLING) for left_s in (0.0, 0.5))
    assert at_once == pytest.approx(0.58, abs=0.01)  # a fifth of a standard deviation below the limit
    assert later > 0.99


@pytest.mark.parametrize("wrong", [{"tilt_deg": 90.0}, {"tilt_max_deg": -1.0}, {"lags": -0.1}])
def test_bad_settings_are_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises((ConfigError, ValueError), match=next(iter(wrong))):
        replace(LEVELLING, **wrong)
