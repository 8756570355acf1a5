from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.config import build
from shipland.frames import Array
from shipland.rig import Rig
from shipland.sim.turbulence import Dryden, Kaimal, TurbulenceParameters, land_scales, sea_roughness_m, step_covariance
from shipland.sim.wind import Airwake, ShipPlace, SteadyWind, Wind, WindParameters, build_wind

RIG = Rig()
CALM = {"turbulence": {"enabled": False}, "airwake": {"enabled": False}}
ABOVE_SHIP = ShipPlace(0.0, 0.0, -0.9, 0.0)
FAR = (500.0, 0.0, -10.0)


def parameters(**keys: object) -> WindParameters:
    return build(WindParameters, keys, "wind")


def wind(seed: int = 0, **keys: object) -> Wind:
    return build_wind(parameters(**keys), RIG, np.random.default_rng(seed))


def wake() -> Airwake:
    return Airwake(parameters().airwake, RIG, np.random.default_rng(0))


def test_wind_comes_from_where_it_says() -> None:
    assert isinstance(wind(mean_mps=5.0, from_deg=90.0, **CALM), SteadyWind)
    east = wind(mean_mps=5.0, from_deg=90.0, **CALM).velocity_at(0.0, FAR, ABOVE_SHIP)
    np.testing.assert_allclose(east, [0.0, -5.0, 0.0], atol=1e-12)
    north = wind(mean_mps=5.0, **CALM).velocity_at(0.0, FAR, ABOVE_SHIP)
    np.testing.assert_allclose(north, [-5.0, 0.0, 0.0], atol=1e-12)


def test_a_log_profile_meets_the_mean_at_its_reference_height() -> None:
    sheared = wind(mean_mps=6.0, profile="log", roughness_m=0.0002, **CALM)
    speeds = [np.linalg.norm(sheared.velocity_at(0.0, (0.0, 0.0, -h), ABOVE_SHIP)) for h in (1.0, 6.096, 20.0)]
    assert speeds[1] == pytest.approx(6.0)
    assert speeds[0] < speeds[1] < speeds[2]
    # u(1) / u(6.096) = ln(1/0.0002) / ln(6.096/0.0002)
    assert speeds[0] / speeds[1] == pytest.approx(8.517 / 10.325, abs=1e-3)


def test_one_wind_is_read_in_three_ways() -> None:
    """Over mown grass 9 m/s in gusts are a mean of 5.6 at 2.1 m; 9 m/s at 10 m are 7.0 there."""
    over_land = WindParameters(mean_mps=5.6).readings_at(2.1)
    assert over_land.gust_mps == pytest.approx(9.0, abs=0.1)
    assert WindParameters(mean_mps=7.0).readings_at(2.1).mean_10m_mps == pytest.approx(9.0, abs=0.1)
    at_10_m = WindParameters(mean_mps=7.0, profile="log", reference_height_m=10.0).readings_at(2.1)
    assert at_10_m.mean_10m_mps == pytest.approx(7.0)
    assert at_10_m.mean_mps < 7.0
    steady = WindParameters(mean_mps=5.0, turbulence=TurbulenceParameters(enabled=False)).readings_at(2.1)
    assert steady.gust_mps == steady.mean_mps


def test_a_gust_rises_and_falls_as_a_cosine() -> None:
    gust = [{"start_s": 10.0, "duration_s": 4.0, "velocity_mps": [3.0, 1.0, -0.5]}]
    gusty = wind(mean_mps=5.0, from_deg=180.0, gust=gust, **CALM)
    at = {t: gusty.velocity_at(t, FAR, ABOVE_SHIP) for t in (9.9, 11.0, 12.0, 14.1)}
    np.testing.assert_allclose(at[9.9], [5.0, 0.0, 0.0], atol=1e-12)
    # wind blows north: along it is north, to its right is east
    np.testing.assert_allclose(at[12.0], [8.0, 1.0, -0.5], atol=1e-12)
    np.testing.assert_allclose(at[11.0], [6.5, 0.5, -0.25], atol=1e-12)
    np.testing.assert_allclose(at[14.1], [5.0, 0.0, 0.0], atol=1e-12)


# Dryden turbulence


def test_turbulence_scales_are_those_of_the_specification() -> None:
    # MIL-F-8785C at h = 100 ft, 20 ft wind of 10 m/s: 0.177 + 0.0823 = 0.2593
    scales = land_scales(parameters().turbulence, 30.48, 10.0)
    assert scales.length_vertical_m == pytest.approx(30.48)
    assert scales.length_horizontal_m == pytest.approx(30.48 / 0.2593**1.2)
    assert scales.deviations_mps[2] == pytest.approx(1.0)
    assert scales.deviations_mps[0] == pytest.approx(1.0 / 0.2593**0.4)
    low, lowest = (land_scales(parameters().turbulence, height_m, 8.0) for height_m in (0.5, 3.048))
    assert low == lowest  # ten feet


@given(st.floats(1e-5, 3.0), st.floats(1e-5, 3.0))
def test_two_steps_are_one_long_step(first: float, second: float) -> None:
    # exact discretisation: Q(a + b) = Φ(b) Q(a) Φ(b)ᵀ + Q(b)
    def covariance(distance: float) -> Array:
        q11, q12, q22 = step_covariance(distance)
        return np.array([[q11, q12], [q12, q22]])

    phi = np.exp(-second) * np.array([[1.0, second], [0.0, 1.0]])
    wanted = phi @ covariance(first) @ phi.T + covariance(second)
    np.testing.assert_allclose(covariance(first + second), wanted, rtol=1e-5, atol=1e-15)


def test_a_long_step_ends_in_the_stationary_state() -> None:
    np.testing.assert_allclose(step_covariance(40.0), [0.25, 0.25, 0.5], atol=1e-12)


def turbulence(distance_m: float, count: int, seed: int = 1) -> Array:
    dryden = Dryden(np.random.default_rng(seed))
    scales = land_scales(parameters().turbulence, 30.48, 10.0)
    return np.array([dryden.step(distance_m, scales) for _ in range(count)])


def test_turbulence_is_stationary_from_the_first_moment() -> None:
    scales = land_scales(parameters().turbulence, 30.48, 10.0)
    first = np.array([Dryden(np.random.default_rng(seed)).step(0.0, scales) for seed in range(1500)])
    wanted = np.array(scales.deviations_mps)
    # 1500 independent draws: 1.8 % of standard error
    np.testing.assert_allclose(first.std(axis=0), wanted, rtol=0.07)


@pytest.mark.parametrize("distance_m", [0.5, 20.0, 400.0])
def test_variance_does_not_depend_on_the_step(distance_m: float) -> None:
    scales = land_scales(parameters().turbulence, 30.48, 10.0)
    series = turbulence(distance_m, 20000 if distance_m < 1.0 else 8000)
    wanted = np.array(scales.deviations_mps)
    # 0.5 m steps: 10 km over a 154 m scale are 32 independent pairs, 14 % of standard error
    np.testing.assert_allclose(series.std(axis=0), wanted, rtol=0.25 if distance_m < 1.0 else 0.06)


def spectrum(series: Array, per_unit: float, nperseg: int) -> tuple[Array, Array]:
    """Frequencies (n,), and densities (n, axes) by Welch."""
    from scipy.signal import welch  # half a second of imports, which every worker would do

    return welch(series, per_unit, nperseg=nperseg, axis=0)


def assert_spectrum(frequency: Array, power: Array, wanted: Array, edges: tuple[float, ...], rtol: float) -> None:
    """Means (axes,) over each band between edges."""
    for low, high in pairwise(edges):
        band = (frequency >= low) & (frequency < high)
        np.testing.assert_allclose(power[band].mean(axis=0), wanted[band].mean(axis=0), rtol=rtol)


def test_the_spectrum_is_drydens() -> None:
    scales = land_scales(parameters().turbulence, 30.48, 10.0)
    step_m = 4.0
    series = turbulence(step_m, 30000)
    frequency, power = spectrum(series, 1.0 / step_m, nperseg=2048)
    wavenumber = 2 * np.pi * frequency

    def longitudinal(length: float, sigma: float) -> Array:  # MIL-F-8785C §3.7.1.2, per cycle/m
        return 2 * np.pi * sigma**2 * 2 * length / np.pi / (1 + (length * wavenumber) ** 2)

    def lateral(length: float, sigma: float) -> Array:
        x2 = (length * wavenumber) ** 2
        return 2 * np.pi * sigma**2 * length / np.pi * (1 + 3 * x2) / (1 + x2) ** 2

    across_m, upright_m = scales.length_horizontal_m, scales.length_vertical_m
    along, across, upright = scales.deviations_mps
    densities = longitudinal(across_m, along), lateral(across_m, across), lateral(upright_m, upright)
    wanted = np.column_stack(densities)
    # In rad/m; Nyquist is 0.79. Some 29 averages a bin and several bins a band: 11 %; folding from beyond Nyquist adds
    # up to 5 % at the top.
    assert_spectrum(wavenumber, power, wanted, (0.004, 0.01, 0.02, 0.04, 0.1), 0.2)


def test_the_spectrum_is_kaimals() -> None:
    step_s, mean_mps, height_m = 0.025, 6.0, 1.5
    land, sea = (parameters(mean_mps=mean_mps, surface=surface) for surface in ("land_kaimal", "sea_kaimal"))
    on_land_mps, friction_mps = (0.4 * mean_mps / np.log(height_m / p.surface_roughness_m) for p in (land, sea))
    made, scales = Kaimal(np.random.default_rng(3)), sea.turbulence_at(height_m)
    # On land the same spectrum at the friction velocity of the land.
    as_on_land_mps = np.array(scales.deviations_mps) * on_land_mps / friction_mps
    assert land.turbulence_at(height_m)._replace(deviations_mps=()) == scales._replace(deviations_mps=())
    assert land.turbulence_at(height_m).deviations_mps == pytest.approx(as_on_land_mps)
    series = np.array([made.step(mean_mps * step_s, scales) for _ in range(50000)])
    np.testing.assert_allclose(series.std(axis=0), scales.deviations_mps, rtol=0.08)
    frequency_hz, power = spectrum(series, 1.0 / step_s, nperseg=4096)
    f = frequency_hz * height_m / mean_mps
    reduced = frequency_hz[:, None] * power / friction_mps**2
    wanted = np.column_stack(  # Kaimal et al. 1972
        [105 * f / (1 + 33 * f) ** (5 / 3), 17 * f / (1 + 9.5 * f) ** (5 / 3), 2.1 * f / (1 + 5.3 * f ** (5 / 3))]
    )
    # Nyquist is 5. 24 averages a bin; the lowest band has 5 bins, so 9 %; the fit adds 13 %, folding at the top more.
    assert_spectrum(f, reduced, wanted, (0.006, 0.02, 0.06, 0.2, 0.6), 0.25)


def test_kaimals_eddies_end_at_the_lowest_height() -> None:
    low, lower = (parameters(mean_mps=5.0, surface="land_kaimal").turbulence_at(height_m) for height_m in (0.5, 0.1))
    assert low == lower
    assert low.length_vertical_m == 0.5


# Land and sea


def test_the_seas_roughness_is_charnocks() -> None:
    # z0 = α u*²/g and U(z) = u*/κ ln(z/z0), both at once; 5 m/s at 6.096 m: u* 0.164 m/s, z0 0.030 mm
    z0_m = sea_roughness_m(0.011, 5.0, 6.096)
    friction_mps = 0.4 * 5.0 / np.log(6.096 / z0_m)
    assert z0_m == pytest.approx(0.011 * friction_mps**2 / 9.81, rel=1e-9)
    assert z0_m == pytest.approx(3.0e-5, rel=0.03)
    assert sea_roughness_m(0.011, 10.0, 6.096) > z0_m
    assert np.isfinite(sea_roughness_m(0.011, 0.0, 6.096))


def test_air_over_the_sea_is_calmer_than_over_land() -> None:
    land, sea = (parameters(mean_mps=5.0, surface=surface).turbulence_at(1.5) for surface in ("land", "sea"))
    assert land.deviations_mps == pytest.approx((0.98, 0.98, 0.50), abs=0.01)
    assert sea.deviations_mps == pytest.approx((0.44, 0.36, 0.23), abs=0.01)
    assert sea.length_horizontal_m == land.length_horizontal_m
    # the intensity is close to 1 / ln(z/z0)
    z0_m = parameters(mean_mps=5.0, surface="sea").surface_roughness_m
    assert sea.deviations_mps[0] / 5.0 == pytest.approx(1.0 / np.log(1.5 / z0_m), rel=0.06)


def test_deviations_over_the_sea_do_not_change_with_height_in_a_log_profile() -> None:
    sea = parameters(mean_mps=8.0, surface="sea", profile="log")
    np.testing.assert_allclose(sea.turbulence_at(2.0).deviations_mps, sea.turbulence_at(40.0).deviations_mps)


@pytest.mark.parametrize("surface", ["land", "sea"])
def test_turbulence_met_at_a_point_has_the_surfaces_variance_and_spectrum(surface: str) -> None:
    """The whole wind, 2.8 h at a point 1.5 m up in 5 m/s, against the formulas of the surface."""
    step_s, mean_mps = 0.2, 5.0
    keys = {"mean_mps": mean_mps, "surface": surface, "airwake": {"enabled": False}}
    air, scales = wind(11, from_deg=180.0, **keys), parameters(**keys).turbulence_at(1.5)
    place = (500.0, 0.0, -1.5)
    series = np.array([air.velocity_at(step_s * i, place, ABOVE_SHIP) for i in range(50000)])
    series[:, 0] -= mean_mps
    # 50 km over a scale of 61 m are some 400 independent pairs: 3.5 % of standard error
    np.testing.assert_allclose(series.std(axis=0), scales.deviations_mps, rtol=0.08)
    frequency_hz, power = spectrum(series, 1.0 / step_s, nperseg=1024)
    wavenumber = 2 * np.pi * frequency_hz / mean_mps
    lengths_m = np.array([scales.length_horizontal_m, scales.length_horizontal_m, scales.length_vertical_m])
    x2 = (lengths_m * wavenumber[:, None]) ** 2
    shape = np.column_stack([2.0 / (1 + x2[:, 0]), (1 + 3 * x2[:, 1:]) / (1 + x2[:, 1:]) ** 2])
    wanted = 2 * np.square(scales.deviations_mps) * lengths_m / mean_mps * shape  # one-sided, per Hz
    assert_spectrum(frequency_hz, power, wanted, (0.01, 0.03, 0.1, 0.3), 0.2)


def test_a_hovering_aircraft_meets_turbulence_at_the_speed_of_the_wind() -> None:
    # longitudinal correlation after 2 s in 8 m/s wind is exp(-16 m / Lu)
    air = wind(3, mean_mps=8.0, airwake={"enabled": False})
    series = np.array([air.velocity_at(0.5 * i, FAR, ABOVE_SHIP)[0] for i in range(20000)]) + 8.0
    length = land_scales(parameters().turbulence, 10.0, 8.0).length_horizontal_m
    found = np.mean(series[4:] * series[:-4]) / np.mean(series**2)
    assert found == pytest.approx(np.exp(-16.0 / length), abs=0.05)


def test_a_balloon_feels_no_change() -> None:
    air = wind(3, mean_mps=8.0, from_deg=180.0, airwake={"enabled": False})
    drifting = [air.velocity_at(t, (FAR[0] + 8.0 * t, *FAR[1:]), ABOVE_SHIP) for t in (0.0, 1.0, 5.0)]
    np.testing.assert_allclose(drifting[1], drifting[0], atol=1e-6)
    np.testing.assert_allclose(drifting[2], drifting[0], atol=1e-6)


def test_same_seed_same_wind() -> None:
    one, same = (wind(7, mean_mps=6.0) for _ in range(2))
    for t_s in (0.0, 0.1):
        np.testing.assert_array_equal(*(air.velocity_at(t_s, FAR, ABOVE_SHIP) for air in (one, same)))


def test_still_air_over_a_still_ship_is_still() -> None:
    assert not any(wind().velocity_at(1.0, (0.0, 0.0, -2.0), ABOVE_SHIP))


# The airwake

ASTERN = np.pi
"""A head wind blows astern."""


def test_the_lee_of_a_head_wind_is_astern_of_the_superstructure_and_below_its_top() -> None:
    close = wake().place((1.6, 0.0, -0.3), ASTERN)
    over_deck = wake().place((0.0, 0.0, -0.3), ASTERN)
    far_astern = wake().place((-12.0, 0.0, -0.3), ASTERN)
    high = wake().place((0.0, 0.0, -3.0), ASTERN)
    ahead = wake().place((5.0, 0.0, -0.3), ASTERN)
    beside = wake().place((0.0, 4.0, -0.3), ASTERN)
    assert close.deficit > 1.0  # reversed
    assert 0.3 < over_deck.deficit < 1.0
    assert 0.0 < far_astern.deficit < 0.2
    for undisturbed in (high, ahead, beside):
        assert undisturbed.deficit < 1e-3
    assert over_deck.downwash > 0.1


def test_turbulence_peaks_in_the_shear_layer() -> None:
    layer, inside, above = (wake().place((0.5, 0.0, -h), ASTERN).turbulence for h in (0.9, 0.2, 2.0))
    assert layer > inside > above
    assert layer == pytest.approx(1.0, abs=0.1)


def test_a_following_wind_leaves_the_deck_free() -> None:
    assert wake().place((0.0, 0.0, -0.3), 0.0).deficit == 0.0


def test_a_beam_wind_moves_the_lee_to_the_other_side() -> None:
    # wind from port blows to starboard: the lee is starboard of the superstructure (2.09 to 2.29 m ahead)
    lee = wake().place((2.19, 1.5, -0.3), 0.5 * np.pi)
    luff = wake().place((2.19, -1.5, -0.3), 0.5 * np.pi)
    assert lee.deficit > 0.3
    assert luff.deficit == 0.0


@given(st.floats(-8.0, 1.9), st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.floats(-np.pi, np.pi))
def test_the_wake_is_mirrored_with_the_wind(forward: float, starboard: float, height: float, towards: float) -> None:
    one = wake().place((forward, starboard, -height), towards)
    mirrored = wake().place((forward, -starboard, -height), -towards)
    assert one.deficit == pytest.approx(mirrored.deficit, abs=1e-9)
    assert 0.0 <= one.deficit <= 1.2
    assert 0.0 <= one.turbulence <= 1.0


@given(st.floats(-6.0, 1.8), st.floats(-2.0, 2.0), st.floats(0.0, 2.0))
def test_the_wake_has_no_steps_over_the_deck(forward: float, starboard: float, height: float) -> None:
    here, near = (wake().place((forward + d, starboard + d, -height - d), ASTERN).deficit for d in (0.0, 1e-4))
    assert abs(near - here) < 0.01  # a shear layer of 0.09 m: at most some 10 per metre and axis


def test_the_ships_way_makes_an_airwake_in_still_air() -> None:
    air = wind(0)
    found = []
    for i in range(200):
        t_s = 0.02 * i
        ship = ShipPlace(3.0 * t_s, 0.0, -0.9, 0.0)
        found.append(air.velocity_at(t_s, (ship.north_m + 1.6, 0.0, ship.down_m - 0.3), ship))
    # close behind the superstructure the air is carried along by the ship at about its 3 m/s
    assert np.mean(found[50:], axis=0)[0] == pytest.approx(3.3, abs=0.6)
