import numpy as np
import pytest

from shipland.config import build
from shipland.frames import euler_from_rotation
from shipland.rig import Rig
from shipland.sim.ship.course import StillCourse, StraightCourse
from shipland.sim.ship.deck_motion import SixDof, Still
from shipland.sim.ship.ship import Ship, ShipParameters, build_ship

RIG = Rig()


class Posed:
    """A deck that stays where it was put."""

    def __init__(self, *displacement: float) -> None:
        self._state = SixDof(np.array([*displacement, *np.zeros(12)]))

    def at(self, t_s: float) -> SixDof:
        return self._state


def parameters(**keys: object) -> ShipParameters:
    return build(ShipParameters, keys, "ship")


def test_the_neutral_ship_stands_over_the_sea_plane() -> None:
    state = Ship(RIG, StillCourse(), Still()).at(0.0)
    np.testing.assert_allclose(state.ned_from_ship.translation_m, [0.0, 0.0, -0.90])
    np.testing.assert_allclose(state.ned_from_deck.matrix(), state.ned_from_ship.matrix())
    # the bar: 2.80 - 0.71 m ahead of the deck's centre, 1.65 m above the sea plane
    np.testing.assert_allclose(state.ned_from_bar.translation_m, [2.09, 0.0, -1.65])


def test_poses_under_way_by_hand() -> None:
    # course east at 2 m/s after 3 s: ship at east 6; the bar 2.09 m further east; starboard is south
    state = Ship(RIG, StraightCourse(0.5 * np.pi, 2.0), Posed(0.1, 0.2, 0.3, 0.0, 0.0, 0.0)).at(3.0)
    np.testing.assert_allclose(state.ned_from_ship.translation_m, [0.0, 6.0, -0.90], atol=1e-12)
    np.testing.assert_allclose(state.ned_from_deck.translation_m, [-0.2, 6.1, -0.60], atol=1e-12)
    np.testing.assert_allclose(state.ned_from_bar.translation_m, [0.0, 8.09, -1.65], atol=1e-12)


def test_deck_angles_are_the_six_coordinates() -> None:
    state = Ship(RIG, StillCourse(0.4), Posed(0.0, 0.0, 0.0, 0.1, -0.05, 0.07)).at(0.0)
    roll, pitch, yaw = euler_from_rotation((state.ned_from_ship.inverse() @ state.ned_from_deck).rotation)
    assert (roll, pitch, yaw) == pytest.approx((0.1, -0.05, 0.07))
    # ned z is down: negative pitch lowers the deck's forward edge, positive roll its starboard edge
    forward, starboard = state.ned_from_deck.rotation[2, :2]
    assert forward > 0.0
    assert starboard > 0.0


def test_on_the_rig_only_the_deck_moves() -> None:
    moved = Posed(0.1, 0.2, 0.3, 0.1, 0.1, 0.1)
    state, still = Ship(RIG, StillCourse(0.3), moved).at(0.0), Ship(RIG, StillCourse(0.3), Still()).at(0.0)
    np.testing.assert_allclose(state.ned_from_bar.matrix(), still.ned_from_bar.matrix())
    np.testing.assert_allclose(state.ned_from_hull.matrix(), still.ned_from_ship.matrix())


def test_in_full_ship_mode_the_bar_rides_with_the_hull_and_stays_level() -> None:
    state = Ship(RIG, StillCourse(0.3), Posed(0.1, 0.2, 0.3, 0.12, 0.08, 0.05), full_ship=True).at(0.0)
    roll, pitch, yaw = euler_from_rotation(state.ned_from_bar.rotation)
    assert (roll, pitch) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert yaw == pytest.approx(0.35)
    np.testing.assert_allclose(state.ned_from_hull.matrix(), state.ned_from_deck.matrix())
    # its centre is a point of the hull
    in_deck = (state.ned_from_deck.inverse() @ state.ned_from_bar).translation_m
    np.testing.assert_allclose(in_deck, RIG.bar_in_ship_m, atol=1e-12)


@pytest.mark.parametrize("motion", ["still", "natops", "sinusoids", "sea"])
def test_same_seed_same_ship_and_other_seed_another(motion: str) -> None:
    one, same, other = (build_ship(parameters(motion=motion), RIG, np.random.default_rng(seed)) for seed in (5, 5, 6))
    apart = np.abs(one.at(3.3).deck.displacement - other.at(3.3).deck.displacement).max()
    assert (apart > 1e-3) == (motion != "still")
    for t_s in (0.0, 3.3, 40.0):
        np.testing.assert_array_equal(one.at(t_s).deck.displacement, same.at(t_s).deck.displacement)
        np.testing.assert_array_equal(one.at(t_s).ned_from_bar.matrix(), same.at(t_s).ned_from_bar.matrix())


def test_the_rig_limits_the_sea_and_the_full_ship_does_not() -> None:
    wild = {"motion": "sea", "sea": {"waves_from_deg": 120.0, "significant_height_m": 9.0}}
    rig = build_ship(parameters(**wild), RIG, np.random.default_rng(1))
    ship = build_ship(parameters(**wild, full_ship=True), RIG, np.random.default_rng(1))
    roll_deg = np.degrees([[s.at(t).deck.displacement[3] for t in np.arange(0.0, 60.0, 0.1)] for s in (rig, ship)])
    assert np.abs(roll_deg[0]).max() < RIG.roll_limit_deg
    assert np.abs(roll_deg[1]).max() > RIG.roll_limit_deg
    assert "roll" in {bite.name for bite in rig.limit_bites}
    assert ship.limit_bites == ()


def test_froude_time_is_the_square_root_of_the_length_scale() -> None:
    times = {rule: parameters(motion="sea", scale={"length": 9.0, "time": rule}) for rule in ("froude", "length_only")}
    decks = {rule: build_ship(p, RIG, np.random.default_rng(2)).deck_motion for rule, p in times.items()}
    np.testing.assert_allclose(
        decks["froude"].at(4.0).displacement, decks["length_only"].at(12.0).displacement, atol=1e-9
    )
