import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import welch

from shipland.config import build, merge
from shipland.errors import ConfigError
from shipland.frames import Pose
from shipland.rig import default_rig, packaged_table
from shipland.sim.air.airwake import Airwake
from shipland.sim.air.dryden import Dryden, scales_at, step_covariance
from shipland.sim.air.wind import SteadyWind, Wind, WindParameters, build_wind

RIG = default_rig()
CALM = {"turbulence": {"enabled": False}, "airwake": {"enabled": False}}
ABOVE_SHIP = Pose.from_euler((0.0, 0.0, -0.9), 0.0, 0.0, 0.0)
FAR = np.array([500.0, 0.0, -10.0])


def parameters(**keys: object) -> WindParameters:
    return build(WindParameters, merge(packaged_table("wind"), keys), "wind")


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
    sheared = wind(mean_mps=6.0, profile="log", **CALM)
    speeds = [
        np.linalg.norm(sheared.velocity_at(0.0, np.array([0.0, 0.0, -h]), ABOVE_SHIP)) for h in (1.0, 6.096, 20.0)
    ]
    assert speeds[1] == pytest.approx(6.0)
    assert speeds[0] < speeds[1] < speeds[2]
    # u(1) / u(6.096) = ln(1/0.0002) / ln(6.096/0.0002)
    assert speeds[0] / speeds[1] == pytest.approx(8.517 / 10.325, abs=1e-3)


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
    scales = scales_at(parameters().turbulence, 30.48, 10.0)
    assert scales.length_vertical_m == pytest.approx(30.48)
    assert scales.length_horizontal_m == pytest.approx(30.48 / 0.2593**1.2)
    assert scales.deviation_vertical_mps == pytest.approx(1.0)
    assert scales.deviation_horizontal_mps == pytest.approx(1.0 / 0.2593**0.4)


def test_turbulence_below_ten_feet_is_that_of_ten_feet() -> None:
    model = parameters().turbulence
    assert scales_at(model, 0.5, 8.0) == scales_at(model, 3.048, 8.0)


@given(st.floats(1e-5, 3.0), st.floats(1e-5, 3.0))
def test_two_steps_are_one_long_step(first: float, second: float) -> None:
    # exact discretisation: Q(a + b) = Φ(b) Q(a) Φ(b)ᵀ + Q(b)
    def covariance(way: float) -> np.ndarray:
        q11, q12, q22 = step_covariance(way)
        return np.array([[q11, q12], [q12, q22]])

    phi = np.exp(-second) * np.array([[1.0, second], [0.0, 1.0]])
    wanted = phi @ covariance(first) @ phi.T + covariance(second)
    np.testing.assert_allclose(covariance(first + second), wanted, rtol=1e-5, atol=1e-15)


def test_a_long_step_ends_in_the_stationary_state() -> None:
    np.testing.assert_allclose(step_covariance(40.0), [0.25, 0.25, 0.5], atol=1e-12)


def turbulence(way_m: float, count: int, height_m: float = 30.48, seed: int = 1) -> np.ndarray:
    dryden = Dryden(parameters().turbulence, np.random.default_rng(seed))
    return np.array([dryden.step(way_m, height_m, 10.0) for _ in range(count)])


def test_turbulence_is_stationary_from_the_first_moment() -> None:
    scales = scales_at(parameters().turbulence, 30.48, 10.0)
    model = parameters().turbulence
    first = np.array([Dryden(model, np.random.default_rng(seed)).step(0.0, 30.48, 10.0) for seed in range(1500)])
    wanted = np.array([scales.deviation_horizontal_mps] * 2 + [scales.deviation_vertical_mps])
    # 1500 independent draws: 1.8 % of standard error
    np.testing.assert_allclose(first.std(axis=0), wanted, rtol=0.07)


@pytest.mark.parametrize("way_m", [0.5, 20.0, 400.0])
def test_variance_does_not_depend_on_the_step(way_m: float) -> None:
    scales = scales_at(parameters().turbulence, 30.48, 10.0)
    series = turbulence(way_m, 40000 if way_m < 1.0 else 8000)
    wanted = np.array([scales.deviation_horizontal_mps] * 2 + [scales.deviation_vertical_mps])
    # 0.5 m steps: 20 km over a 154 m scale are 65 independent pairs, 10 % of standard error
    np.testing.assert_allclose(series.std(axis=0), wanted, rtol=0.25 if way_m < 1.0 else 0.06)


def test_the_spectrum_is_drydens() -> None:
    scales = scales_at(parameters().turbulence, 30.48, 10.0)
    step_m = 4.0
    series = turbulence(step_m, 60000)
    frequency, power = welch(series, 1.0 / step_m, nperseg=2048, axis=0)
    wavenumber = 2 * np.pi * frequency

    def longitudinal(length: float, sigma: float) -> np.ndarray:  # MIL-F-8785C §3.7.1.2, per cycle/m
        return 2 * np.pi * sigma**2 * 2 * length / np.pi / (1 + (length * wavenumber) ** 2)

    def lateral(length: float, sigma: float) -> np.ndarray:
        x2 = (length * wavenumber) ** 2
        return 2 * np.pi * sigma**2 * length / np.pi * (1 + 3 * x2) / (1 + x2) ** 2

    horizontal = (scales.length_horizontal_m, scales.deviation_horizontal_mps)
    vertical = (scales.length_vertical_m, scales.deviation_vertical_mps)
    wanted = np.column_stack([longitudinal(*horizontal), lateral(*horizontal), lateral(*vertical)])
    for low, high in ((0.004, 0.01), (0.01, 0.02), (0.02, 0.04), (0.04, 0.1)):  # rad/m; Nyquist is 0.79
        band = (wavenumber >= low) & (wavenumber < high)
        # some 58 averages a bin and several bins a band: 8 %; folding from beyond Nyquist adds up to 5 % at the top
        np.testing.assert_allclose(power[band].mean(axis=0), wanted[band].mean(axis=0), rtol=0.2)


def test_a_hovering_aircraft_meets_turbulence_at_the_speed_of_the_wind() -> None:
    # longitudinal correlation after 2 s in 8 m/s wind is exp(-16 m / Lu)
    air = wind(3, mean_mps=8.0, airwake={"enabled": False})
    series = np.array([air.velocity_at(0.5 * i, FAR, ABOVE_SHIP)[0] for i in range(40000)]) + 8.0
    length = scales_at(parameters().turbulence, 10.0, 8.0).length_horizontal_m
    found = np.mean(series[4:] * series[:-4]) / np.mean(series**2)
    assert found == pytest.approx(np.exp(-16.0 / length), abs=0.05)


def test_a_balloon_feels_no_change() -> None:
    air = wind(3, mean_mps=8.0, from_deg=180.0, airwake={"enabled": False})
    drifting = [air.velocity_at(t, FAR + np.array([8.0 * t, 0.0, 0.0]), ABOVE_SHIP) for t in (0.0, 1.0, 5.0)]
    np.testing.assert_allclose(drifting[1], drifting[0], atol=1e-6)
    np.testing.assert_allclose(drifting[2], drifting[0], atol=1e-6)


def test_same_seed_same_wind() -> None:
    keys = {"mean_mps": 6.0}
    for one, same in zip(
        (wind(7, **keys).velocity_at(t, FAR, ABOVE_SHIP) for t in (0.0, 0.1)),
        (wind(7, **keys).velocity_at(t, FAR, ABOVE_SHIP) for t in (0.0, 0.1)),
        strict=True,
    ):
        np.testing.assert_array_equal(one, same)


def test_still_air_over_a_still_ship_is_still() -> None:
    assert not wind().velocity_at(1.0, np.array([0.0, 0.0, -2.0]), ABOVE_SHIP).any()


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
    position = np.array([1.6, 0.0, -0.3])
    found = []
    for i in range(200):
        t_s = 0.02 * i
        ship = Pose.from_euler((3.0 * t_s, 0.0, -0.9), 0.0, 0.0, 0.0)
        found.append(air.velocity_at(t_s, ship.apply(position), ship))
    # close behind the superstructure the air is carried along by the ship at about its 3 m/s
    assert np.mean(found[50:], axis=0)[0] == pytest.approx(3.3, abs=0.6)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"mean_mps": -1.0}, "mean_mps must be in 0…30 m/s"),
        ({"mean_mps": 60.0}, "0…30 m/s"),
        ({"profile": "cubic"}, "'uniform', 'log'"),
        ({"turbulence": {"intensity": 2.0}}, "intensity must be in 0…1"),
        ({"gust": [{"start_s": 1.0, "duration_s": 0.0, "velocity_mps": [1, 0, 0]}]}, "duration_s of a gust"),
        ({"airwake": {"reattachment_heights": 0.0}}, "reattachment_heights must be positive"),
        ({"airwake": {"downwash": 0.1}}, "did you mean 'downwash_share'"),
    ],
)
def test_bad_input_is_one_line(keys: dict[str, object], says: str) -> None:
    with pytest.raises(ConfigError, match=says) as caught:
        parameters(**keys)
    assert "\n" not in str(caught.value)
