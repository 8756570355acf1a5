"""The bank of swings: a still bar stays still, a heaving one is found with its frequency."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.estimation.waves import WaveBank, WaveParameters

PARAMETERS = WaveParameters()
BANK = WaveBank(PARAMETERS)


def _believed(heave_at, seconds=20.0, seed=0, gusts_mps=0.05, wind_mps2=0.0):
    """The hypothesis after a hover under a heaving bar; the aircraft strays by itself, and says how fast."""
    rng, down_m, drift = np.random.default_rng(seed), -1.5, 0.0
    estimate = BANK.start(0.0, down_m - heave_at(0.0))
    for k in range(1, round(30 * seconds)):
        drift += (-drift / 0.7) / 30.0 + gusts_mps * rng.standard_normal() * math.sqrt(2.0 / 0.7 / 30.0)
        down_m += drift / 30.0
        seen_m = down_m - heave_at(k / 30.0) + 0.003 * rng.standard_normal()
        estimate = BANK.update_pose(estimate, k / 30.0, 0.0, seen_m, 1e-5, wind_mps2)
        if k % 6 == 0:
            estimate = BANK.update_velocity(estimate, drift + 0.02 * rng.standard_normal(), 0.05)
    return BANK.hypotheses[estimate.chosen]


@pytest.mark.parametrize("seed", range(4))
def test_a_still_bar_is_believed_still(seed):
    assert _believed(lambda _: 0.0, seed=seed).deviation_m == PARAMETERS.still_m


def test_vertical_gusts_of_a_strong_wind_are_not_taken_for_a_heaving_bar():
    def believed_still(wind_mps2):
        found = [_believed(lambda _: 0.0, seed=seed, gusts_mps=0.25, wind_mps2=wind_mps2) for seed in range(10)]
        return sum(wave.deviation_m == PARAMETERS.still_m for wave in found)

    assert believed_still(0.0) <= 5
    assert believed_still(3.0) >= 8


@pytest.mark.parametrize(("amplitude_m", "frequency_rad_s"), [(0.15, 1.0), (0.2, 1.8), (0.12, 2.4)])
def test_a_heaving_bar_is_found(amplitude_m, frequency_rad_s):
    found = _believed(lambda t: amplitude_m * math.sin(frequency_rad_s * t))
    assert found.deviation_m >= 0.05
    assert found.frequency_rad_s == pytest.approx(frequency_rad_s, rel=0.35)


def test_what_is_not_finite_changes_nothing():
    estimate = BANK.start(0.0, -1.5)
    assert BANK.update_pose(estimate, 0.1, 0.0, math.nan, 1e-4) is estimate
    assert BANK.update_pose(estimate, 0.1, math.inf, -1.5, 1e-4) is estimate
    assert BANK.update_velocity(estimate, math.nan, 0.05) is estimate


@pytest.mark.parametrize(("behind", "quick"), [(0.8, True), (1.2, False)])
def test_a_quick_swing_a_little_behind_is_taken_before_a_bar_at_rest(behind, quick):
    estimate = BANK.start(0.0, -1.5)
    rates = [it.frequency_rad_s for it in BANK.hypotheses[1:]]
    small_and_quick = 1 + rates.index(max(rates))
    score = np.full(len(BANK.hypotheses), -50.0)
    score[[0, small_and_quick, PARAMETERS.first]] = 0.0, -behind, -10.0
    taken = BANK.update_pose(replace(estimate, score=score), 1e-3, 0.0, -1.5, 1e-4)
    assert taken.chosen == (small_and_quick if quick else 0)
