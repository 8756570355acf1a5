"""The one-state Kalman filter: erratum 1's reading against its theory."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.guidance.near import ScalarKalman

Q, R = 0.005, 0.05  # [Lee2022, §Pose Estimation], as read in erratum 1


def test_two_updates_by_hand():
    kalman = ScalarKalman(Q, R)
    assert kalman.update(1.0) == 1.0
    # P⁻ = 0.05 + 0.005, K = 0.055 / 0.105, x = 1 + K, P = (1 − K) P⁻
    assert kalman.update(2.0) == pytest.approx(1.0 + 0.055 / 0.105, abs=1e-12)
    assert kalman.variance == pytest.approx(0.055 * 0.05 / 0.105, abs=1e-12)


def test_gain_settles_where_the_riccati_equation_says():
    kalman = ScalarKalman(Q, R)
    for _ in range(60):
        kalman.update(0.0)
    predicted = 0.5 * (Q + math.sqrt(Q * Q + 4.0 * Q * R))  # P⁻² − Q P⁻ − Q R = 0
    step = kalman.update(1.0)
    assert step == pytest.approx(predicted / (predicted + R), abs=1e-6)
    assert step == pytest.approx(0.27, abs=0.005)  # erratum 1: K → 0.27


def test_variance_is_that_of_the_errors():
    rng = np.random.default_rng(3)
    errors, kalman = [], ScalarKalman(Q, R)
    truth = 0.0
    for _ in range(20000):
        truth += rng.normal(0.0, math.sqrt(Q))
        errors.append(kalman.update(truth + rng.normal(0.0, math.sqrt(R))) - truth)
    # Correlated over some four steps: the variance of 20,000 errors is known to about 2 %.
    assert np.var(errors[50:]) == pytest.approx(kalman.variance, rel=0.08)


@given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=30))
def test_estimate_stays_within_what_was_measured(measurements):
    kalman = ScalarKalman(Q, R)
    estimates = [kalman.update(value) for value in measurements]
    assert min(measurements) - 1e-9 <= min(estimates) <= max(estimates) <= max(measurements) + 1e-9


def test_a_gap_of_three_steps_trusts_like_three_steps():
    one, three = ScalarKalman(Q, R), ScalarKalman(Q, R)
    for kalman in (one, three):
        kalman.update(0.0)
    for _ in range(2):
        one.update(math.nan)
    assert one.update(1.0) == pytest.approx(three.update(1.0, steps=3.0), abs=1e-12)


def test_not_finite_measurements_change_nothing():
    kalman = ScalarKalman(Q, R)
    assert math.isnan(kalman.update(math.nan))
    assert kalman.value is None
    kalman.update(2.0)
    assert kalman.update(math.inf) == 2.0
    kalman.reset()
    assert kalman.update(5.0) == 5.0


@pytest.mark.parametrize(("process", "measurement"), [(-1.0, 1.0), (0.0, 0.0), (math.nan, 1.0), (1.0, math.nan)])
def test_noises_must_make_sense(process, measurement):
    with pytest.raises(ValueError, match="noise"):
        ScalarKalman(process, measurement)
