"""The swing: its size, its band, and how it spreads over the axes of a ship."""

import numpy as np
import pytest

from shipland.estimation.relative_state import STATES, WAVE, AxisModel, Disturbances, Model
from shipland.estimation.waves import WaveMotion, WaveShares

SHIP = WaveMotion(0.12, 2.0, 0.2)
NOISE = Disturbances(0.5, 1.5, 1.5, 20.0, 0.5, 300.0, 0.02)


def _density(wave, frequency_rad_s):
    """Power spectral density of the swing, but for a constant."""
    answer = np.linalg.solve(1j * frequency_rad_s * np.eye(4) - wave.matrix, np.sqrt(np.diag(wave.noise)))
    return float(np.sum(np.abs(answer[0]) ** 2))


def test_its_deviation_is_what_it_says_and_lasts():
    assert SHIP.covariance[0, 0] == pytest.approx(0.12**2)
    rest = SHIP.matrix @ SHIP.covariance + SHIP.covariance @ SHIP.matrix.T + np.diag(SHIP.noise)
    np.testing.assert_allclose(rest, 0.0, atol=1e-12)


def test_it_lies_in_a_band_and_has_neither_long_waves_nor_ripples():
    peak = max(_density(SHIP, f) for f in np.linspace(1.4, 2.8, 29))
    assert _density(SHIP, 0.2) < 0.01 * peak
    assert _density(SHIP, 6.0) < 0.001 * peak
    assert _density(SHIP, 40.0) / _density(SHIP, 20.0) == pytest.approx(2.0**-6, rel=0.05)


SHARES = (0.6, -0.3, 0.4, 0.1)


@pytest.mark.parametrize("bar_moves", [True, False])
def test_only_a_bar_that_swings_is_followed_and_as_the_deck_does(bar_moves):
    wave = WaveMotion(0.12, 2.0, 0.2, bar_moves, SHARES)
    of_deck = np.array([0.6, -0.15, 0.2, 0.025])  # over 1, w, w, w^2
    np.testing.assert_allclose(wave.tracked[0], bar_moves * of_deck)
    np.testing.assert_allclose(wave.deck[0], of_deck if bar_moves else [1.0, 0.0, 0.0, 0.0])
    assert wave.bar[0][0] == bar_moves


def test_the_decks_rate_is_that_of_its_motion():
    wave, states = WaveMotion(0.12, 2.0, 0.2, True, SHARES), np.array([0.1, -0.2, 0.05, 0.3])
    place, rate = (float(row @ states) for row in wave.deck)
    assert (float(wave.deck[0] @ wave.later(states, 0.001)) - place) / 0.001 == pytest.approx(rate, abs=2e-3)


@pytest.mark.parametrize("along_rad", [0.0, 0.7])
def test_a_ship_sways_more_than_it_surges_whatever_its_heading(along_rad):
    model = Model(2, AxisModel(0.06, 0.4), NOISE, SHIP, WaveShares(0.25, 1.0, along_rad))
    estimate = model.start(0.0, np.zeros(2), np.eye(2), 0.5)
    ahead, aside = np.zeros((2, len(estimate.mean)))
    ahead[[WAVE, STATES + WAVE]] = np.cos(along_rad), np.sin(along_rad)
    aside[[WAVE, STATES + WAVE]] = -np.sin(along_rad), np.cos(along_rad)
    for _ in range(3):
        assert ahead @ estimate.covariance @ ahead == pytest.approx((0.25 * 0.12) ** 2)
        assert aside @ estimate.covariance @ aside == pytest.approx(0.12**2)
        assert ahead @ estimate.covariance @ aside == pytest.approx(0.0, abs=1e-12)
        estimate = model.predicted(estimate, 700, np.zeros(2))
