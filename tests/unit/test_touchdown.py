"""Touchdowns: contacts, what the moving deck does with what stands on it, and the verdict in words."""

import math

import numpy as np
import pytest

from shipland.config import build, merge
from shipland.messages import Intent, PilotCommand, TouchdownVerdict
from shipland.rig import Rig
from shipland.sim.aircraft.record import at
from shipland.sim.ship.course import StillCourse, StraightCourse
from shipland.sim.ship.ship import Ship, ShipParameters, build_ship
from shipland.sim.touchdown import NO_TOUCH, Contacts, Judge, OnDeck, VerdictParameters
from shipland.sim.world import World
from worlds import QUIET, CircleCourse, Deck, come_down, natops, six_sinusoids, world

LIMITS = VerdictParameters()


def verdict_of(flown: World) -> TouchdownVerdict:
    verdict = flown.verdict()
    assert verdict is not None
    return verdict


def creep_m(flown: World, seconds: float) -> float:
    """Farthest that the aircraft strays over the deck from where it stands now."""
    start = flown.truth().aircraft_in_deck_m
    farthest = 0.0
    for _ in range(int(2 * seconds)):
        flown.advance(flown.t_s + 0.5)
        farthest = max(farthest, float(np.linalg.norm(flown.truth().aircraft_in_deck_m - start)))
    return farthest


def test_lands_on_a_still_deck() -> None:
    flown = world(distance_m=0.1, height_m=0.8, aircraft=QUIET)
    come_down(flown)
    verdict = verdict_of(flown)
    assert verdict.landed
    assert verdict.in_square
    assert verdict.reason == "landed in the square, 10 cm from its centre"
    np.testing.assert_allclose(verdict.touchdown_in_deck_m, [-0.1, 0.0], atol=0.01)
    np.testing.assert_allclose(verdict.relative_velocity_in_deck_mps, [0.0, 0.0, 0.5], atol=0.06)  # ground effect
    assert verdict.slip_m < 0.005
    assert verdict.tilt_rad < math.radians(1.0)
    weight_n = 0.32 * 9.81
    assert verdict.peak_contact_force_n > 2.0 * weight_n
    assert not flown.motors_run
    assert -flown.truth().aircraft_in_deck_m[2] == pytest.approx(0.045, abs=0.002)  # it stands on its feet


def test_motors_stop_only_when_landing_is_meant() -> None:
    flown = world(distance_m=0.0, height_m=0.4, aircraft=QUIET)
    come_down(flown, intent=Intent.FLY, most_s=4.0)
    assert flown.motors_run
    assert not flown.over()
    assert -flown.truth().aircraft_in_deck_m[2] == pytest.approx(0.045, abs=0.01)
    come_down(flown, intent=Intent.GO_AROUND, percent=60.0, most_s=7.0)  # a touch-and-go leaves no verdict
    assert -flown.truth().aircraft_in_deck_m[2] > 0.5
    assert not flown.over()
    come_down(flown)
    assert verdict_of(flown).landed
    assert verdict_of(flown).t_s > 7.0


def test_low_hover_is_not_a_landing() -> None:
    flown = world(distance_m=0.0, height_m=0.3, aircraft=QUIET)
    while flown.t_s < 5.0:
        flown.command(PilotCommand(flown.t_s, 0.0, 0.0, 0.0, 0.0, 0.0, Intent.LAND))
        flown.advance(flown.t_s + 0.1)
    assert flown.motors_run


def packaged_ship(rig: Rig, **change: object) -> Ship:
    parameters = build(ShipParameters, change, "ship")
    return build_ship(parameters, rig, np.random.default_rng(3))


@pytest.mark.parametrize(
    ("ship", "seconds"),
    [
        (lambda rig: packaged_ship(rig, motion="natops", course={"kind": "s", "speed_mps": 4.5, "start_s": 2.0}), 30.0),
        (lambda rig: Ship(rig, CircleCourse(2.0, -0.2), six_sinusoids()), 20.0),
        (lambda rig: Ship(rig, StraightCourse(0.7, 4.5), natops(), full_ship=True), 20.0),
        (lambda rig: packaged_ship(rig, motion="sea"), 20.0),
    ],
    ids=[
        "natops on an S",
        "six motions in a turn",
        "full ship",
        "frigate in sea state 6",
    ],
)
def test_the_moving_deck_carries_what_stands_on_it(ship, seconds: float, rig: Rig) -> None:
    flown = world(ship=ship(rig), distance_m=0.0, height_m=0.0451, aircraft=QUIET)
    _stand(flown)
    assert flown.over()
    assert not flown.motors_run
    assert creep_m(flown, seconds) < 0.001  # [m]; a body carried half a step late creeps 1 mm each second in a turn


def _stand(flown: World) -> None:
    """Put the aircraft on the deck at the deck's velocity, motors off, and wait for rest."""
    deck = Deck.of(flown._record.values[at("deck")])
    lift_m = -0.0452 * deck.ned_from_deck[:, 2]
    carried_mps = deck.velocity_mps + np.cross(deck.turn_rad_s, lift_m)
    flown._bodies.put(tuple(deck.origin_m + lift_m), *deck.angles_rad, tuple(carried_mps))
    flown._motors_run = False
    flown.advance(flown.t_s + 3.0)


def test_a_slippery_deck_does_not_carry(rig: Rig) -> None:
    """With friction below tan 8° the aircraft slides: what holds it is friction, not a constraint."""
    slippery = merge(QUIET, {"airframe": {"foot_friction": 0.1}})
    flown = world(ship=Ship(rig, StillCourse(), natops()), distance_m=0.0, height_m=0.0451, aircraft=slippery)
    _stand(flown)
    assert creep_m(flown, 20.0) > 0.05


def test_lands_on_a_rolling_deck_at_every_phase(rig: Rig) -> None:
    ship = Ship(rig, StillCourse(), natops())
    for height_m in (0.5, 1.0, 1.5, 2.0, 2.5):
        flown = world(ship=ship, distance_m=0.0, height_m=height_m)
        come_down(flown)
        verdict = verdict_of(flown)
        assert verdict.landed, verdict.reason
        assert verdict.slip_m < 0.08
        assert verdict.tilt_rad < math.radians(12.0)


@pytest.mark.parametrize(
    ("distance_m", "landed", "reason"),
    [(0.3, True, "landed outside the square, 30 cm from its centre"), (1.5, False, "fell into the sea")],
)
def test_outside_the_square_and_beside_the_deck_is_said(distance_m: float, landed: bool, reason: str) -> None:
    flown = world(distance_m=distance_m, height_m=0.5, aircraft=QUIET)
    come_down(flown)
    verdict = verdict_of(flown)
    assert (verdict.landed, verdict.in_square, verdict.reason) == (landed, False, reason)
    assert not flown.motors_run


def test_half_on_the_deck_tips_off() -> None:
    flown = world(distance_m=0.63, height_m=0.5, aircraft=QUIET)
    come_down(flown)
    assert not verdict_of(flown).landed
    assert any(word in verdict_of(flown).reason for word in ("struck the deck", "beside the deck", "sea"))


@pytest.mark.parametrize(("height_m", "struck"), [(0.75, "struck the horizon bar"), (0.4, "struck the superstructure")])
def test_flying_into_the_ship_is_a_crash(height_m: float, struck: str) -> None:
    flown = world(distance_m=1.0, height_m=height_m, aircraft=QUIET)
    while not flown.over() and flown.t_s < 10.0:
        flown.command(PilotCommand(flown.t_s, 60.0, 0.0, 0.0, 0.0, 0.0))
        flown.advance(flown.t_s + 0.1)
    assert verdict_of(flown).reason == struck
    assert not verdict_of(flown).landed


def test_falling_on_the_deck_from_high_is_too_hard() -> None:
    flown = world(distance_m=0.0, height_m=0.5, aircraft=merge(QUIET, {"settings": {"max_vertical_speed_mps": 3.0}}))
    come_down(flown, percent=-100.0)
    verdict = verdict_of(flown)
    assert not verdict.landed
    assert "too hard" in verdict.reason or "struck" in verdict.reason


# The judge alone, on made-up histories.

STILL = OnDeck((0.05, -0.02, -0.045), (0.0, 0.0, 0.0), 0.0)
FEET = Contacts(4, 3.1, "")


def judge_history(
    *, velocity: tuple[float, float, float] = (0.0, 0.0, 0.4), slide_m: float = 0.0, tilt_rad: float = 0.0
) -> Judge:
    """Airborne, one contact, motors off, rest."""
    judge = Judge(LIMITS, 0.35)
    judge.follow(0.0, OnDeck((0.05, -0.02, -0.046), velocity, 0.0), NO_TOUCH, True)
    judge.follow(0.002, OnDeck((0.05, -0.02, -0.045), (0.0, 0.0, 0.1), tilt_rad), Contacts(1, 20.0, ""), True)
    for index in range(900):
        rest = OnDeck((0.05 + slide_m, -0.02, -0.045), (0.0, 0.0, 0.0), 0.0)
        judge.follow(0.004 + 0.002 * index, rest, FEET, False)
    return judge


def test_judge_takes_speed_before_contact_and_waits_for_rest() -> None:
    verdict = judge_history().verdict
    assert verdict is not None
    assert verdict.landed
    assert verdict.t_s == 0.002
    np.testing.assert_array_equal(verdict.relative_velocity_in_deck_mps, [0.0, 0.0, 0.4])
    np.testing.assert_array_equal(verdict.touchdown_in_deck_m, [0.05, -0.02])
    assert verdict.peak_contact_force_n == 20.0


@pytest.mark.parametrize(
    ("history", "words"),
    [
        ({"velocity": (0.0, 0.0, LIMITS.max_descent_mps + 0.1)}, "too hard"),
        ({"velocity": (0.0, LIMITS.max_drift_mps + 0.1, 0.3)}, "drifting"),
        ({"slide_m": LIMITS.max_slip_m + 0.01}, "slipped"),
        ({"tilt_rad": math.radians(LIMITS.max_tilt_deg + 1.0)}, "tilted"),
    ],
)
def test_judge_says_which_limit_was_broken(history: dict[str, float], words: str) -> None:
    verdict = judge_history(**history).verdict
    assert verdict is not None
    assert not verdict.landed
    assert words in verdict.reason


def test_judge_forgets_a_bounce_that_flew_on_and_keeps_a_short_one() -> None:
    for gap_s, first_s in ((LIMITS.bounce_s + 0.1, None), (LIMITS.bounce_s - 0.1, 0.0)):
        judge = Judge(LIMITS, 0.35)
        judge.follow(0.0, STILL, FEET, True)
        for t_s in np.arange(0.01, gap_s, 0.01):
            judge.follow(float(t_s), STILL, NO_TOUCH, True)
        for t_s in np.arange(gap_s, gap_s + 2.0, 0.01):
            judge.follow(float(t_s), STILL, FEET, False)
        assert judge.verdict is not None
        assert judge.verdict.t_s == pytest.approx(gap_s if first_s is None else first_s)


def test_judge_loses_patience_with_what_never_rests() -> None:
    judge = Judge(LIMITS, 0.35)
    sliding = OnDeck((0.0, 0.0, -0.045), (0.2, 0.0, 0.0), 0.0)
    for t_s in np.arange(0.0, LIMITS.patience_s, 0.01):
        assert judge.verdict is None
        judge.follow(float(t_s), sliding, FEET, False)
    judge.follow(LIMITS.patience_s + 0.2, sliding, FEET, False)
    assert judge.verdict is not None
    assert not judge.verdict.landed
    assert "rest" in judge.verdict.reason


def test_judge_gives_one_verdict_only() -> None:
    judge = judge_history()
    first = judge.verdict
    judge.follow(9.0, STILL, Contacts(0, 0.0, "a rotor struck the deck"), False)
    judge.crash(9.1, STILL, "fell into the sea")
    assert judge.verdict is first
