from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.errors import DataError
from shipland.rig import Rig
from shipland.sim.ship.deck_motion import DeckMotion, Harmonics, LimitedMotion, Sinusoids, SixDof, Still, rig_limits
from shipland.sim.ship.recorded import HEADER, RecordedMotion, read_motion
from shipland.sim.ship.ship import ShipParameters

STEP_S = 1e-4
LINE = ",".join(HEADER)


def assert_derivatives(motion: DeckMotion, times_s: np.ndarray, tolerance: float = 1e-6) -> None:
    for t_s in times_s:
        before, now, after = motion.at(t_s - STEP_S), motion.at(t_s), motion.at(t_s + STEP_S)
        np.testing.assert_allclose(
            now.velocity, (after.displacement - before.displacement) / (2 * STEP_S), atol=tolerance
        )
        np.testing.assert_allclose(now.acceleration, (after.velocity - before.velocity) / (2 * STEP_S), atol=tolerance)


def random_harmonics(seed: int, count: int = 30) -> Harmonics:
    rng = np.random.default_rng(seed)
    amplitude = rng.normal(size=(6, count)) + 1j * rng.normal(size=(6, count))
    return Harmonics(rng.uniform(-0.5, 3.0, count), 0.05 * amplitude)


def test_still_is_still() -> None:
    state = Still().at(12.0)
    assert not state.displacement.any()
    assert not state.velocity.any()
    assert not state.acceleration.any()


@given(st.integers(0, 1000), st.floats(0.0, 300.0))
def test_derivatives_of_harmonics_are_analytic(seed: int, t_s: float) -> None:
    # amplitude 0.05·30, frequency below 3: the third derivative times step² is below 1e-6
    assert_derivatives(random_harmonics(seed), np.array([t_s]), 1e-6)


@pytest.mark.parametrize("t_s", [0.0, 0.002, 0.254, 0.256, 17.3, 17.30001, 299.998, -4.1])
def test_harmonics_are_the_sum_of_their_waves_on_the_worlds_grid_and_beside_it(t_s: float) -> None:
    motion = random_harmonics(3)
    omega, waves = motion.frequency_rad_s, motion.amplitude * np.exp(1j * motion.frequency_rad_s * t_s)
    parts = np.concatenate([waves.sum(1), (1j * omega * waves).sum(1), (-(omega**2) * waves).sum(1)])
    for _ in range(2):  # at first and from what is kept
        np.testing.assert_allclose(motion.at(t_s).values, parts.real, atol=1e-11)


def test_a_sinusoid_by_hand() -> None:
    motion = Sinusoids([0, 0, 0, 0.2, 0, 0], [1, 1, 1, 10.0, 1, 1], [0, 0, 0, 0.0, 0, 0])
    quarter = motion.at(2.5)
    assert quarter.displacement[3] == pytest.approx(0.2)
    assert quarter.velocity[3] == pytest.approx(0.0, abs=1e-12)
    assert quarter.acceleration[3] == pytest.approx(-0.2 * (0.2 * np.pi) ** 2)
    assert not quarter.displacement[[0, 1, 2, 4, 5]].any()


def test_natops_reaches_its_limits_at_its_periods() -> None:
    natops = ShipParameters().natops.motion(np.random.default_rng(0))
    t_s = np.arange(0.0, 101.0, 0.01)
    deck = np.degrees([natops.at(t).displacement for t in t_s])
    assert np.abs(deck[:, 3]).max() == pytest.approx(8.0, abs=0.001)
    assert np.abs(deck[:, 4]).max() == pytest.approx(3.0, abs=0.001)
    assert not deck[:, [0, 1, 2, 5]].any()
    np.testing.assert_allclose(natops.at(3.0 + 10.1).displacement[3], natops.at(3.0).displacement[3], atol=1e-12)
    np.testing.assert_allclose(natops.at(3.0 + 6.5).displacement[4], natops.at(3.0).displacement[4], atol=1e-12)


def test_the_motion_base_holds_its_limits_smoothly() -> None:
    limit = rig_limits(Rig())
    asked = Sinusoids(1.6 * limit, [7.0, 8.0, 9.0, 10.0, 6.0, 5.0], np.arange(6))
    held = LimitedMotion(asked, limit, 0.75)
    times_s = np.random.default_rng(2).uniform(0.0, 60.0, 200)
    # at the knee the third derivative jumps by 2 v³/((1 − k) L)², some 30 m/s³: a quarter step of it
    assert_derivatives(held, times_s, 1e-3)
    deck = np.array([held.at(t).displacement for t in np.arange(0.0, 60.0, 0.01)])
    assert np.all(np.abs(deck).max(axis=0) < limit)
    assert np.all(np.abs(deck).max(axis=0) > 0.95 * limit)


def test_the_motion_base_leaves_small_motions_alone_and_records_large_ones() -> None:
    limit = rig_limits(Rig())
    small = LimitedMotion(Sinusoids(0.7 * limit, np.full(6, 8.0), np.zeros(6)), limit, 0.75)
    for t_s in np.arange(0.0, 8.0, 0.1):
        np.testing.assert_array_equal(small.at(t_s).displacement, small.motion.at(t_s).displacement)
    assert small.bites == ()
    amplitude = np.zeros(6)
    amplitude[3] = np.radians(20.0)
    large = LimitedMotion(Sinusoids(amplitude, np.full(6, 8.0), np.zeros(6)), limit, 0.75)
    for t_s in np.arange(0.0, 8.0, 0.1):
        large.at(t_s)
    (bite,) = large.bites
    assert bite.name == "roll"
    assert bite.largest_demand == pytest.approx(np.radians(20.0), abs=1e-9)
    # 20° sin(2πt/8) passes 9.75° = 0.75 · 13° at 0.648 s; sampled each 0.1 s
    assert bite.t_s == pytest.approx(0.7)
    assert str(bite) == "motion base: roll held back since t = 0.70 s, asked 20.00 ° of at most 13.00 °"


def test_a_record_is_played_as_it_was_and_then_again_without_a_jump() -> None:
    t_s = np.arange(0.0, 20.0, 0.1)
    wanted = 0.2 * np.sin(np.outer(t_s, [0.5, 0.7, 0.9, 1.1, 1.3, 1.5]) + np.arange(6))
    motion = RecordedMotion(t_s, wanted)
    np.testing.assert_allclose([motion.at(t).displacement for t in t_s[:170]], wanted[:170], atol=1e-6)
    # the spline's third derivative jumps at its knots
    assert_derivatives(motion, np.random.default_rng(1).uniform(0.0, 90.0, 200), 1e-4)
    deck = np.array([motion.at(t).displacement for t in np.arange(0.0, 90.0, 0.01)])
    assert np.abs(np.diff(deck, axis=0)).max() < 0.01
    np.testing.assert_allclose(motion.at(20.0).displacement, motion.at(20.0 + 17.9).displacement, atol=1e-9)


def write(folder: Path, *lines: str) -> Path:
    path = folder / "motion.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_csv_round_trip_with_scales(tmp_path: Path) -> None:
    rows = [f"{5 + t},{t},0,{2 * t},{3 * t},0,{-t}" for t in range(8)]
    motion = read_motion(write(tmp_path, LINE, *rows), length_scale=2.0, time_scale=4.0)
    state = motion.at(0.5)  # two recorded seconds into it
    np.testing.assert_allclose(state.displacement, [1.0, 0.0, 2.0, np.radians(6.0), 0.0, np.radians(-2.0)], atol=1e-12)
    np.testing.assert_allclose(state.velocity[2], 4.0, atol=1e-9)  # 2 m/s / 2 · 4


GOOD = [f"{t},0,0,0,0,0,0" for t in range(6)]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["time,roll", *GOOD], r"line 1: expected the header t_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg"),
        ([LINE, *GOOD[:2], "2,0,0,x,0,0,0", *GOOD[3:]], r"line 4, column heave_m: 'x' is not a finite number"),
        ([LINE, *GOOD[:2], "2,0,0,nan,0,0,0", *GOOD[3:]], r"line 4, column heave_m"),
        ([LINE, *GOOD, "6,0,0"], r"line 8: expected 7 columns .* found 3"),
        ([LINE, *GOOD, "5,0,0,0,0,0,0"], r"line 8, column t_s: times must increase"),
        ([LINE, *GOOD, "6,0,0,-85,0,0,0"], r"heave_m reaches 85, expected 30 at most; is the unit another\?"),
        ([LINE, *GOOD[:3]], r"at least 4 lines"),
        ([], r"line 1: expected the header"),
    ],
)
def test_a_broken_csv_is_named_by_line_and_column(tmp_path: Path, lines: list[str], says: str) -> None:
    with pytest.raises(DataError, match=says) as caught:
        read_motion(write(tmp_path, *lines))
    assert "\n" not in str(caught.value)


def test_a_missing_csv_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"nowhere\.csv does not exist"):
        read_motion(tmp_path / "nowhere.csv")


def test_harmonics_refuse_wrong_shapes() -> None:
    with pytest.raises(ValueError, match=r"amplitudes \(6, K\), got \(3,\), \(6, 2\)"):
        Harmonics(np.ones(3), np.ones((6, 2), dtype=complex))


def test_six_dof_is_a_plain_value() -> None:
    state = SixDof(np.zeros(18))
    with pytest.raises(AttributeError):
        state.values = np.ones(18)  # type: ignore[misc]
