"""The tilt is taken out before contact, and no more of it than the deck needs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from responses import SPEED_LIKE
from shipland.errors import ConfigError
from shipland.guidance.horizon.descent import (
    Descent,
    Outlook,
    Phase,
    contact_in_s,
    dropped,
    next_descent,
)
from shipland.guidance.horizon.levelling import LevellingParameters, speed_near_contact, tilt_near_contact
from shipland.guidance.horizon.parameters import DescentParameters
from shipland.guidance.response import ANAFI_LIKE

LEVELLING = LevellingParameters(tilt_deg=10.0, lags=1.5, touch_deg=16.0, touch_m=0.08, touch_offset_m=0.2)


def lean_deg_of(acceleration_mps2: np.ndarray) -> float:
    return math.degrees(math.atan(np.linalg.norm(acceleration_mps2) / 9.80665))


def test_tilt_is_free_early_and_bounded_at_contact() -> None:
    wanted = np.array([4.0, -3.0])
    np.testing.assert_array_equal(tilt_near_contact(wanted, 2.0, ANAFI_LIKE, LEVELLING), wanted)
    at_contact = tilt_near_contact(wanted, 0.0, ANAFI_LIKE, LEVELLING)
    assert lean_deg_of(at_contact) == pytest.approx(10.0, abs=0.05)
    np.testing.assert_allclose(at_contact / np.linalg.norm(at_contact), wanted / 5.0)


def test_a_small_tilt_stays() -> None:
    wanted = np.array([0.5, -1.0])
    np.testing.assert_array_equal(tilt_near_contact(wanted, 0.0, ANAFI_LIKE, LEVELLING), wanted)


def test_the_bound_closes_no_faster_than_the_vehicle_follows() -> None:
    wanted, levelling = np.array([50.0, 0.0]), LEVELLING
    times_s = np.linspace(levelling.before_contact_s(ANAFI_LIKE), 1.0, 20)
    most = [float(tilt_near_contact(wanted, t_s, ANAFI_LIKE, levelling)[0]) for t_s in times_s]
    assert np.max(np.diff(most) / np.diff(times_s)) <= ANAFI_LIKE.max_input_rate + 1e-6


def change_mps2(wanted: np.ndarray, tilt: np.ndarray, tracked: np.ndarray) -> np.ndarray:
    asked = speed_near_contact(wanted, tilt, tracked, SPEED_LIKE, LEVELLING)
    return SPEED_LIKE.approach_per_s * (asked - tracked)


def test_a_speed_is_changed_by_as_much_as_there_is_too_much_lean() -> None:
    tracked, tilt = np.array([0.2, -0.1]), np.array([4.0, 0.0])
    np.testing.assert_allclose(change_mps2(tracked, tilt, tracked), [LEVELLING.tilt_mps2 - 4.0, 0.0])
    assert float(np.linalg.norm(change_mps2(tracked, 3.0 * tilt, tracked))) == pytest.approx(3.0)
    leaning_more = np.array([3.0, 0.0]) + tracked
    np.testing.assert_allclose(change_mps2(leaning_more, tilt, tracked), change_mps2(tracked, tilt, tracked))


def test_a_speed_that_leans_little_is_as_the_gains_want_it() -> None:
    wanted, tracked = np.array([0.3, 0.1]), np.array([0.2, -0.1])
    asked = speed_near_contact(wanted, np.array([0.5, 0.3]), tracked, SPEED_LIKE, LEVELLING)
    np.testing.assert_array_equal(asked, wanted)


@pytest.mark.parametrize("phase", [Phase.SINK, Phase.WAIT])
def test_a_contact_that_would_come_askew_ends_the_descent(phase: Phase, descent_parameters: DescentParameters) -> None:
    before = Descent(phase, 1.0, 0.3)
    over = Outlook(2.0, 0.03, 0.15, 0.1, 0.15, lull=True, contact_imminent=True)
    assert next_descent(before, over, descent_parameters).phase is Phase.FINAL_DESCENT
    assert (
        next_descent(before, replace(over, contact_imminent=False), descent_parameters).phase is not Phase.FINAL_DESCENT
    )


def test_a_drop_from_there_lasts_as_long_as_the_levelling(descent_parameters: DescentParameters) -> None:
    lag_s = SPEED_LIKE.climb_lag_s
    final_descent_offset_m, _ = dropped(LEVELLING.before_contact_s(SPEED_LIKE), 0.0, lag_s, descent_parameters)
    height_m = descent_parameters.contact_height_m + final_descent_offset_m
    lasts_s = contact_in_s(height_m, 0.0, lag_s, descent_parameters)
    assert lasts_s == pytest.approx(LEVELLING.before_contact_s(SPEED_LIKE), abs=1e-3)


def test_it_is_waited_where_the_drop_leaves_time_to_level(descent_parameters: DescentParameters) -> None:
    def waits_at_m(final_descent_height_m: float) -> float:
        descent, height_m = None, 1.0
        for cycle in range(150):
            now_s = cycle / 30.0
            over = Outlook(
                now_s, 1.0 / 30.0, height_m, 0.1, 0.15, lull=True, final_descent_height_m=final_descent_height_m
            )
            descent = next_descent(descent, over, descent_parameters)
            height_m = descent.height_m
        assert descent is not None and descent.phase is Phase.WAIT
        return height_m

    assert waits_at_m(0.29) == pytest.approx(0.29)
    assert waits_at_m(0.1) == waits_at_m(0.0) == pytest.approx(descent_parameters.wait_height_m)


@pytest.fixture
def descent_parameters() -> DescentParameters:
    return DescentParameters(
        sink_mps=0.5,
        wait_height_m=0.2,
        wait_band_m=0.1,
        slow_per_s=1.5,
        pause_m=0.25,
        final_descent_mps=1.0,
        final_descent_offset_m=0.015,
        relax_after_s=6.0,
        relax_per_s=0.1,
        contact_height_m=0.08,
        deck_watch_height_m=0.65,
        deck_watch_offset_m=0.03,
        deck_watch_max_s=20.0,
        reacquire_s=0.75,
        reacquire_max_s=2.0,
        reacquire_offset_m=0.04,
    )


@pytest.mark.parametrize("wrong", [{"tilt_deg": 90.0}, {"touch_deg": -1.0}, {"lags": -0.1}, {"touch_m": -1.0}])
def test_bad_settings_are_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises((ConfigError, ValueError), match=next(iter(wrong))):
        replace(LEVELLING, **wrong)
