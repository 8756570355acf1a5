from importlib import resources

import numpy as np
import pytest

from shipland.frames import GRAVITY_MPS2
from shipland.sim.ship.sea import BAND_RAD_S, MIRRORED, at_point, frigate

TABLE = frigate()
LONGEST = float(TABLE.omega_rad_s[0])


def response(speed_kn: float, heading_deg: float, omega_rad_s: float) -> np.ndarray:
    return TABLE.responses(speed_kn, np.radians([heading_deg]), np.array([omega_rad_s]))[0]


@pytest.mark.parametrize("heading_deg", [0.0, 60.0, 90.0, 120.0, 180.0])
def test_a_very_long_wave_carries_the_ship_like_a_cork(heading_deg: float) -> None:
    # at ω = 0.1 rad/s (6 km waves) heave follows the surface and pitch its slope along the ship; 1 % is what is left
    # of the hull's length and of the table's numerics
    motion = response(0.0, heading_deg, LONGEST)
    slope = LONGEST**2 / GRAVITY_MPS2
    assert abs(motion[2]) == pytest.approx(1.0, abs=0.01)
    assert abs(motion[4]) / slope == pytest.approx(abs(np.cos(np.radians(heading_deg))), abs=0.01)
    # down is positive and the crest is at the origin at t = 0: heave is -1
    assert motion[2].real == pytest.approx(-1.0, abs=0.01)


def test_a_long_beam_wave_rolls_the_ship_with_its_slope() -> None:
    # quasi-static roll k, raised by (1 - (ω/ω_roll)²)⁻¹ = 3 % and by the coupling with sway: 8 % tolerance
    motion = response(0.0, 90.0, LONGEST)
    assert abs(motion[3]) / (LONGEST**2 / GRAVITY_MPS2) == pytest.approx(1.03, abs=0.08)


@pytest.mark.parametrize(("heading_deg", "axis", "sign"), [(180.0, 4, 1.0), (90.0, 3, -1.0)], ids=["pitch", "roll"])
def test_signs_in_long_waves(heading_deg: float, axis: int, sign: float) -> None:
    # A quarter period before the crest arrives (at the origin at t = 0), the surface rises towards it: the bow is up in
    # head waves, which run aft (positive pitch), starboard in waves from there (negative roll).
    motion = response(0.0, heading_deg, LONGEST)[axis]
    assert sign * (motion * np.exp(-0.5j * np.pi)).real > 0.9 * abs(motion)


def test_natural_periods_are_those_of_the_design() -> None:
    heave, roll, pitch = TABLE.natural_period_s
    assert roll == pytest.approx(10.8, abs=0.05)
    assert heave == pytest.approx(5.0, abs=0.3)
    assert pitch == pytest.approx(4.8, abs=0.3)


def test_roll_resonates_at_its_natural_period() -> None:
    omega = np.linspace(0.4, 0.9, 201)
    roll = TABLE.responses(0.0, np.full(omega.size, 0.5 * np.pi), omega)[:, 3]
    per_slope = np.abs(roll) / (omega**2 / GRAVITY_MPS2)
    peak = omega[np.argmax(per_slope)]
    # 10 % of critical damping shifts the peak by 1 %, the exciting force's slope by a few more
    assert 2 * np.pi / peak == pytest.approx(10.8, abs=0.8)
    # 1 / (2ζ) = 5 with ζ = 0.1 and no other damping; radiation takes a little, forcing is below the slope
    assert 3.0 < per_slope.max() < 5.0


def test_lateral_motion_vanishes_in_head_and_following_waves() -> None:
    for heading_deg in (0.0, 180.0):
        motion = TABLE.responses(10.0, np.full(20, np.radians(heading_deg)), np.linspace(0.3, 1.2, 20))
        # what is left is the mesh's own asymmetry, amplified at the roll resonance
        assert np.abs(motion[:, 1]).max() < 0.02
        assert np.degrees(np.abs(motion[:, 3]).max()) < 0.1


def test_short_waves_do_not_move_the_ship() -> None:
    motion = response(0.0, 90.0, 2.0)
    assert np.all(np.abs(motion[:3]) < 0.25)
    assert np.all(np.degrees(np.abs(motion[3:])) < 1.0)


def test_the_table_is_met_at_its_own_points() -> None:
    i, j, k = 3, 7, 20
    found = response(float(TABLE.speed_kn[i]), float(TABLE.heading_deg[j]), float(TABLE.omega_rad_s[k]))
    np.testing.assert_allclose(found, TABLE.rao[i, j, k], atol=1e-9)


def test_waves_from_port_are_the_mirror_of_waves_from_starboard() -> None:
    starboard, port = response(7.0, 70.0, 0.6), response(7.0, -70.0, 0.6)
    np.testing.assert_allclose(port, starboard * MIRRORED, atol=1e-12)


def test_the_table_covers_what_the_sea_asks_for() -> None:
    assert (TABLE.speed_kn[0], TABLE.speed_kn[-1]) == (0.0, 15.0)
    assert (TABLE.heading_deg[0], TABLE.heading_deg[-1]) == (0.0, 180.0)
    assert TABLE.omega_rad_s[0] <= BAND_RAD_S[0]
    assert TABLE.omega_rad_s[-1] >= BAND_RAD_S[1] - 1e-9
    assert np.isfinite(TABLE.rao).all()


def test_the_table_stays_small() -> None:
    assert len((resources.files("shipland.sim.ship") / "data" / "frigate_rao.npz").read_bytes()) < 2_000_000


def test_motion_at_a_point_adds_the_lever_arms() -> None:
    # roll 1, pitch 2, yaw 3 at (-50, 0, -6): surge -6·2, sway 3·(-50) + 6·1, heave +50·2
    still = np.array([[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]], dtype=complex)
    np.testing.assert_allclose(at_point(still, (-50.0, 0.0, -6.0))[0], [-12.0, -144.0, 100.0, 1.0, 2.0, 3.0])
