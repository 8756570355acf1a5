from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import trapezoid

from shipland.sim.ship.sea import (
    BAND_RAD_S,
    SEA_STATES,
    SeaParameters,
    bretschneider,
    deck_motion,
    encounter_frequency,
    jonswap,
    sample_waves,
    significant_amplitude,
)

SEA = SeaParameters()
OMEGA = np.linspace(0.05, 12.0, 40000)


def test_both_spectra_hold_the_variance_of_the_significant_height() -> None:
    for density in (bretschneider(OMEGA, 5.0, 0.5), jonswap(OMEGA, 5.0, 0.5, 3.3)):
        assert 4.0 * np.sqrt(trapezoid(density, OMEGA)) == pytest.approx(5.0, rel=2e-3)
        assert OMEGA[np.argmax(density)] == pytest.approx(0.5, rel=2e-3)


def test_bretschneider_periods_are_ittcs() -> None:
    # ITTC: mean period T1 = 0.772 Tp, zero-crossing period Tz = 0.710 Tp; the ω⁻⁵ tail beyond 12 rad/s takes a little
    density = bretschneider(OMEGA, 3.0, 2 * np.pi / 10.0)
    m0, m1, m2 = (trapezoid(OMEGA**n * density, OMEGA) for n in range(3))
    assert 2 * np.pi * m0 / m1 == pytest.approx(7.72, rel=5e-3)
    assert 2 * np.pi * np.sqrt(m0 / m2) == pytest.approx(7.10, rel=1e-2)


def test_jonswap_without_enhancement_is_bretschneider() -> None:
    np.testing.assert_allclose(
        jonswap(OMEGA[100:5000], 4.0, 0.6, 1.0), bretschneider(OMEGA[100:5000], 4.0, 0.6), rtol=5e-3
    )


def test_jonswap_is_peakier_by_its_gamma() -> None:
    peak = 0.6
    ratio = jonswap([peak], 4.0, peak, 3.3)[0] / bretschneider([peak], 4.0, peak)[0]
    assert ratio == pytest.approx(3.3 * (1.0 - 0.287 * np.log(3.3)), rel=0.02)  # DNV-RP-C205 3.5.5.2


def test_encounter_frequency_by_hand() -> None:
    # ω = 0.5 rad/s, 10 m/s: 0.5 - 0.25·10·cos μ / 9.81; quick waves from astern are overtaken: 2 - 4·10 / 9.81
    found = encounter_frequency(np.array([0.5, 0.5, 0.5, 2.0]), np.radians([0.0, 90.0, 180.0, 0.0]), 10.0)
    np.testing.assert_allclose(found, [0.245158, 0.5, 0.754842, -2.077472], atol=1e-5)


def test_sampled_waves_hold_the_energy_of_the_band() -> None:
    omega = np.linspace(*BAND_RAD_S, 4000)
    m0 = trapezoid(SEA.density(omega), omega)
    sums = [0.5 * np.sum(sample_waves(SEA, np.random.default_rng(seed)).amplitude_m ** 2) for seed in range(10)]
    # one random frequency a band: 3 % is three standard deviations of the mean of ten
    assert np.mean(sums) == pytest.approx(m0, rel=0.03)
    # waves shorter than the band's end hold 0.5 %
    assert m0 == pytest.approx(5.0**2 / 16.0, rel=0.01)


def test_directions_spread_as_cosine_squared() -> None:
    waves = sample_waves(replace(SEA, frequencies=200, directions=40), np.random.default_rng(3))
    off = waves.heading_rad - SEA.heading_rad
    assert np.abs(off).max() <= 0.5 * np.pi
    weight = waves.amplitude_m**2
    # for (2/π) cos²θ: mean of cos 2θ is 1/2, mean of sin 2θ is 0
    assert np.average(np.cos(2 * off), weights=weight) == pytest.approx(0.5, abs=0.01)
    assert np.average(np.sin(2 * off), weights=weight) == pytest.approx(0.0, abs=0.01)


def test_a_long_crested_sea_has_one_direction() -> None:
    waves = sample_waves(replace(SEA, short_crested=False), np.random.default_rng(3))
    assert np.ptp(waves.heading_rad) == 0.0
    assert waves.amplitude_m.size == SEA.frequencies


@pytest.mark.parametrize("waves_from_deg", [60.0, 120.0])
def test_variance_of_the_series_is_that_of_the_spectrum(waves_from_deg: float) -> None:
    sea = replace(SEA, waves_from_deg=waves_from_deg)
    wanted = significant_amplitude(sea)
    t_s = np.arange(0.0, 4000.0, 0.7)  # 350 roll periods
    found = []
    for seed in range(3):
        motion = deck_motion(sea, np.random.default_rng(seed), 1.0, 1.0)
        found.append(2.0 * np.std([motion.at(t).displacement for t in t_s], axis=0))
    # a record of 350 periods of a narrow band leaves about 5 % of scatter, three of them 3 %
    np.testing.assert_allclose(np.mean(found, axis=0), wanted, rtol=0.08)


def test_mean_period_of_the_series_is_that_of_its_moments() -> None:
    motion = deck_motion(SEA, np.random.default_rng(5), 1.0, 1.0)
    t_s = np.arange(0.0, 3000.0, 0.5)
    series = np.array([motion.at(t).displacement for t in t_s])
    power = np.abs(motion.amplitude) ** 2
    for index in (2, 3, 4):
        m0, m2 = power[index].sum(), (power[index] * motion.frequency_rad_s**2).sum()
        crossings = np.count_nonzero((series[:-1, index] < 0.0) & (series[1:, index] >= 0.0))
        # Rice: 2π √(m0/m2); over some 300 crossings the count scatters by 3 %
        assert t_s[-1] / crossings == pytest.approx(2 * np.pi * np.sqrt(m0 / m2), rel=0.08)


@pytest.mark.parametrize(
    ("waves_from_deg", "reference"),
    [(120.0, (1.38, 2.01, 2.79, 11.5, 2.27, 1.40)), (60.0, (0.67, 1.73, 2.79, 8.8, 2.43, 1.06))],
)
def test_significant_amplitudes_against_the_design_reference(
    waves_from_deg: float, reference: tuple[float, ...]
) -> None:
    # an independent prototype of the same ship, with another hull and method: docs/results/ship-motion.md
    found = significant_amplitude(replace(SEA, waves_from_deg=waves_from_deg))
    found[3:] = np.degrees(found[3:])
    np.testing.assert_allclose(found, reference, rtol=0.15)


def test_the_deck_moves_at_the_frequencies_of_encounter() -> None:
    motion = deck_motion(SEA, np.random.default_rng(6), 8.33, 2.0)
    waves = sample_waves(SEA, np.random.default_rng(6))
    wanted = encounter_frequency(waves.omega_rad_s, waves.heading_rad, 10.0 * 1852.0 / 3600.0)
    np.testing.assert_allclose(motion.frequency_rad_s, 2.0 * wanted, rtol=1e-12)
    # waves from 60° off the bow: met more often than they pass a fixed point
    assert np.average(motion.frequency_rad_s / 2.0 / waves.omega_rad_s, weights=waves.amplitude_m**2) > 1.05


@pytest.mark.parametrize("time_scale", [3.0, 1.0], ids=["froude", "length only"])
def test_a_model_is_smaller_and_quicker_and_turns_by_the_same_angles(time_scale: float) -> None:
    full, model = (deck_motion(SEA, np.random.default_rng(8), *scales) for scales in ((1.0, 1.0), (9.0, time_scale)))
    at_sea, on_rig = full.at(30.0), model.at(30.0 / time_scale)
    for name, quickness in (("displacement", 1.0), ("velocity", time_scale), ("acceleration", time_scale**2)):
        wanted = getattr(at_sea, name) * quickness
        np.testing.assert_allclose(getattr(on_rig, name), [*wanted[:3] / 9.0, *wanted[3:]], atol=1e-12)


def test_the_ladder_rises_and_each_rung_is_within_its_range() -> None:
    rungs = [SEA_STATES[number] for number in sorted(SEA_STATES)]
    for rung in rungs:
        low, high = rung.height_range_m
        assert low < rung.significant_height_m < high
    for lower, upper in pairwise(rungs):
        assert lower.height_range_m[1] == upper.height_range_m[0]
        assert lower.modal_period_s < upper.modal_period_s


def test_a_flat_sea_moves_nothing() -> None:
    motion = deck_motion(replace(SEA, significant_height_m=0.0), np.random.default_rng(0), 1.0, 1.0).at(3.0)
    assert np.all(motion.displacement == 0.0)
    jonswap_sea = replace(SEA, significant_height_m=0.0, spectrum="jonswap")
    assert np.all(jonswap_sea.density([0.5]) == 0.0)
