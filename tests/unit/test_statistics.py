"""Intervals against published values, and paired comparisons that find what is there and nothing else."""

import tracemalloc

import numpy as np
import pytest

from shipland.statistics import compare, mean_interval, quantile_interval, share_interval


def test_exact_interval_is_clopper_and_pearsons():
    # 1 of 1: 0.025^(1/1); 81 of 263: Clopper-Pearson 0.2527, 0.3676 (Newcombe 1998, table I)
    assert share_interval(1, 1) == pytest.approx((0.025, 1.0), abs=1e-6)
    assert share_interval(81, 263) == pytest.approx((0.2527, 0.3676), abs=5e-5)


def test_wilson_interval():
    assert share_interval(81, 263, "wilson") == pytest.approx((0.2553, 0.3662), abs=5e-5)  # Newcombe 1998, table I
    assert share_interval(10, 10, "wilson") == pytest.approx((10 / (10 + 1.96**2), 1.0), abs=1e-4)
    assert share_interval(0, 0) == (0.0, 1.0)


def test_mean_interval_is_students():
    # 2 values 0.4, 0.6: mean 0.5, standard error 0.1, t(1) = 12.706: beyond 0…1, so cut
    assert mean_interval([0.4, 0.6]) == (0.0, 1.0)
    low, high = mean_interval([0.5, 0.5, 0.5, 0.6])
    assert (low, high) == pytest.approx((0.525 - 0.025 * 3.1824, 0.525 + 0.025 * 3.1824), abs=1e-4)


def test_mcnemar_counts_only_seeds_that_differ():
    first = np.array([True] * 50 + [True] * 9 + [False])
    second = np.array([True] * 50 + [False] * 9 + [True])
    errors = np.full(60, 0.1)
    found = compare(first, second, errors, errors, np.random.default_rng(0))
    assert (found.flights, found.only_first, found.only_second) == (60, 9, 1)
    assert found.p_value == pytest.approx(2 * 11 / 1024)  # binomial of 10 tosses, 9 or more or 1 or fewer
    assert found.error_difference_m == 0.0


def test_equal_pilots_are_not_told_apart():
    ok, errors = np.array([True, False, True]), np.array([0.1, np.nan, 0.2])
    found = compare(ok, ok, errors, errors, np.random.default_rng(0))
    assert found.p_value == 1.0
    assert found.error_interval_m == (0.0, 0.0)


def test_paired_bootstrap_sees_a_shift_smaller_than_the_spread():
    rng = np.random.default_rng(3)
    conditions_m = rng.uniform(0.0, 0.3, 100)  # the seeds differ by far more than the pilots
    first, second = conditions_m + 0.02 + rng.normal(0.0, 0.003, 100), conditions_m + rng.normal(0.0, 0.003, 100)
    ok = np.ones(100, dtype=bool)
    found = compare(ok, ok, first, second, rng)
    assert found.error_difference_m == pytest.approx(0.02, abs=0.01)
    assert found.error_interval_m.low > 0.005


def test_a_bootstrap_of_many_flights_takes_little_memory():
    """50 MB; drawn at once 10,000 flights take ten times as much."""
    errors_m = np.random.default_rng(3).gamma(2.0, 0.05, 10_000)
    ok = np.ones(len(errors_m), dtype=bool)
    tracemalloc.start()
    try:
        compare(ok, ok, errors_m, errors_m + 0.01, np.random.default_rng(1))
        quantile_interval(errors_m, 0.9, np.random.default_rng(1))
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


def test_a_bootstrap_draws_the_same_whether_at_once_or_in_parts(monkeypatch):
    values = np.random.default_rng(3).standard_normal(30)
    whole = quantile_interval(values, 0.9, np.random.default_rng(1))
    monkeypatch.setattr("shipland.statistics._MOST_DRAWN", 70)
    assert quantile_interval(values, 0.9, np.random.default_rng(1)) == whole


def test_no_touchdown_on_one_side_leaves_no_pairs():
    ok = np.array([True])
    found = compare(ok, ~ok, np.array([0.1]), np.array([np.nan]), np.random.default_rng(0))
    assert np.isnan(found.error_difference_m)
