"""The odds of a landing against drawn contacts, and when waiting is worth while."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from shipland.guidance.horizon.odds import Odds, odds_below, odds_in_area
from shipland.rig import Rig

RIG = Rig()


@pytest.mark.parametrize("bar_rad", [0.0, 0.4, 2.5])
@pytest.mark.parametrize("offset_m", [(0.0, 0.0), (0.1, -0.05), (0.3, 0.0)])
def test_odds_are_the_share_of_drawn_contacts_in_the_square(bar_rad: float, offset_m: tuple[float, float]) -> None:
    cosine, sine = math.cos(bar_rad), math.sin(bar_rad)
    axes = np.array([[cosine, -sine], [sine, cosine]])
    covariance = axes @ np.diag([0.1**2, 0.06**2]) @ axes.T
    drawn = np.random.default_rng(1).multivariate_normal(axes @ np.array(offset_m), covariance, 40_000) @ axes
    half_m = 0.5 * RIG.landing_square_m
    share = float(np.mean(np.all(np.abs(drawn) <= half_m, axis=1)))
    assert odds_in_area(RIG, axes @ np.array(offset_m), covariance, bar_rad) == pytest.approx(share, abs=0.01)


def test_odds_below_a_limit_are_the_share_of_drawn_values() -> None:
    drawn = np.random.default_rng(4).normal(1.2, 0.3, 40_000)
    assert odds_below(1.5, 1.2, 0.3) == pytest.approx(float(np.mean(drawn < 1.5)), abs=0.01)


def test_a_circle_counts_as_a_square_of_its_area() -> None:
    circle, variance = replace(RIG, landing_area="circle"), 0.08**2 * np.eye(2)
    drawn = np.random.default_rng(2).normal(0.0, 0.08, (40_000, 2))
    share = float(np.mean(np.hypot(*drawn.T) <= 0.5 * RIG.landing_square_m))
    assert odds_in_area(circle, np.zeros(2), variance, 0.7) == pytest.approx(share, abs=0.02)


def test_the_gain_of_another_draw_is_that_of_drawn_ones() -> None:
    draws = np.random.default_rng(3).normal(0.7, 0.1, 200_000)
    for now in (0.6, 0.75, 0.9):
        odds = Odds(now, 0.7, 0.7**2 + 0.1**2, 5.0)
        assert odds.gain == pytest.approx(float(np.mean(np.maximum(draws - now, 0.0))), abs=5e-4)


def test_nothing_is_waited_for_that_cannot_be_better() -> None:
    assert Odds(0.999, 0.5, 0.5, 5.0).worth_taking(0.003)
    assert not Odds(0.6, 0.7, 0.7**2 + 0.1**2, 5.0).worth_taking(0.003)
    assert Odds(0.96, 0.85, 0.85**2 + 0.13**2, 5.0, best=0.96).worth_taking(0.003)  # nothing better was seen


def test_mean_and_square_follow_what_was_offered() -> None:
    odds = None
    for k in range(3000):
        odds = Odds(0.5 + 0.3 * math.sin(0.7 * k)).after(odds, 0.033)
    assert odds is not None
    assert odds.mean == pytest.approx(0.5, abs=0.02)
    assert odds.square - odds.mean**2 == pytest.approx(0.045, abs=0.01)


def test_odds_that_stay_low_are_given_up_after_the_time_over_which_they_are_judged() -> None:
    def offered(odds: Sequence[float]) -> Odds:
        last = None
        for now in odds:
            last = Odds(now).after(last, 0.1)
        assert last is not None
        return last

    assert not offered([0.1] * 50).stay_below(0.2)
    assert offered([0.1] * 150).stay_below(0.2)
    assert not offered([0.1] * 130 + [0.6] + [0.1] * 20).stay_below(0.2)  # one good moment of late
    assert not offered([0.3] * 150).stay_below(0.2)
