"""Sticks from stop to stop are told from those that answer gusts."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from shipland.guidance.horizon.guidance import LimitCycleDetector


def after(seconds: float, share_of: Callable[[float], tuple[float, float]]) -> LimitCycleDetector:
    detector = LimitCycleDetector()
    for cycle in range(round(30.0 * seconds)):
        detector.take(np.array(share_of(cycle / 30.0)), 1.0 / 30.0)
    return detector


def stops(t_s: float, period_s: float) -> tuple[float, float]:
    return math.copysign(1.0, math.sin(2.0 * math.pi * t_s / period_s)), 0.0


@pytest.mark.parametrize("period_s", [0.6, 1.0, 2.0])
def test_a_swing_from_stop_to_stop_is_known_within_two_seconds(period_s: float) -> None:
    assert after(2.0, lambda t_s: stops(t_s, period_s)).oscillating


def test_a_lean_against_the_wind_and_gusts_are_none() -> None:
    rng = np.random.default_rng(1)

    def gusty(_: float) -> tuple[float, float]:
        forward, right = 0.2 * rng.standard_normal(2)
        return 0.6 + float(forward), float(right)

    assert not after(20.0, gusty).oscillating


def test_it_ends_when_the_sticks_rest() -> None:
    for seconds in (5.0, 8.0):
        ends = after(seconds, lambda t_s: stops(t_s, 1.0) if t_s < 5.0 else (0.0, 0.0))
        assert ends.oscillating == (seconds == 5.0)


def test_a_clock_that_leaps_back_raises_nothing() -> None:
    detector = LimitCycleDetector()
    detector.take(np.array([1.0, 0.0]), 0.03)
    detector.take(np.array([-1.0, 0.0]), -1e9)
    assert not detector.oscillating
