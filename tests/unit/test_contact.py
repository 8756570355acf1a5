"""Our own touchdown detection: what carries an aircraft, told from its throttle and downward speed."""

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shipland.config import build, packaged_toml
from shipland.frames import GRAVITY_MPS2
from shipland.guidance.response import Response
from shipland.messages import Intent, PilotCommand
from shipland.vehicles.mavlink.motors import MotorStop
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.mavlink.session import FORCE
from shipland.vehicles.mavlink.state import AutopilotState
from shipland.vehicles.touchdown import ContactSignals, GroundContact, TouchdownParameters, TouchdownWatch
from shipland.vehicles.wanted import pressed

LIMITS = TouchdownParameters()
HOVER = 0.45
STEP_S = 0.02

Flown = tuple[float, float]
"""Throttle, and downward acceleration [m/s²]."""


def falling(throttle: float, hover: float = HOVER) -> Flown:
    return throttle, GRAVITY_MPS2 * (1.0 - throttle / hover)


def fly(*flight: Any, **how: Any) -> dict[GroundContact, float]:
    """When each contact was first said in a `history`, in seconds from the start."""
    return {contact: t_s for t_s, contact in reversed(history(*flight, **how))}


def history(
    watch: TouchdownWatch,
    flown: Callable[[float], Flown],
    seconds: float,
    start_s: float = 0.0,
    down_mps: float = 0.0,
    landing: bool = True,
    leap: tuple[float, float] = (math.inf, 0.0),
    low: Callable[[float], bool] = lambda _: True,
) -> list[tuple[float, GroundContact]]:
    """What was said when, in seconds from the start.

    `leap` is (time, change) of the velocity told, `low` when contact height is seen.
    """
    said = []
    for index in range(1, int(seconds / STEP_S)):
        t_s = index * STEP_S
        throttle, down_mps2 = flown(t_s)
        down_mps += down_mps2 * STEP_S
        told_mps = down_mps + (leap[1] if t_s >= leap[0] else 0.0)
        now_s = start_s + t_s
        said.append((t_s, watch.see(ContactSignals(now_s, landing, low(t_s), throttle, now_s, told_mps, now_s, None))))
    return said


def deck(t_s: float) -> float:
    """Downward acceleration of a heaving deck [m/s²]."""
    return 1.5 * math.sin(2.0 * t_s)


def onto_a_deck(throttle: Callable[[float], float]) -> Callable[[float], Flown]:
    """In the air for half a second, then a jolt that ends the descent, then a heaving deck."""

    def flown(t_s: float) -> Flown:
        if t_s < 0.5:
            return HOVER, 0.0
        return throttle(t_s - 0.5), -10.0 if t_s < 0.57 else deck(t_s)

    return flown


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_it_stands_on_a_deck_within_half_a_second(share: float) -> None:
    throttle = HOVER * share
    said = fly(TouchdownWatch(LIMITS, HOVER), onto_a_deck(lambda _: throttle), 2.0, down_mps=0.7)
    assert 0.5 < said[GroundContact.TOUCHED] < 0.7
    assert said[GroundContact.STANDS] < 1.05


def test_a_throttle_that_comes_and_goes_does_not_hide_the_touch() -> None:
    """PX4 on a heaving deck: low for 0.3 s, then a third of full because its own landing detector let go of it."""
    said = fly(
        TouchdownWatch(LIMITS, HOVER), onto_a_deck(lambda t_s: 0.23 if t_s % 0.6 < 0.3 else 0.29), 1.4, down_mps=0.7
    )
    assert said[GroundContact.TOUCHED] < 0.7
    assert GroundContact.NONE not in fly(
        watch_of_a_touch(), lambda t_s: (0.23 if t_s % 0.6 < 0.3 else 0.29, deck(t_s)), 2.0, start_s=10.0
    )


def test_a_foot_that_a_falling_deck_leaves_again_is_a_touch() -> None:
    """PX4 in sea state 5: 0.4 m/s lost in 40 ms, then it sinks after the deck. Not pressed, it slid 35 cm."""

    def flown(t_s: float) -> Flown:
        if 0.5 <= t_s < 0.54:
            return 0.9 * HOVER, -9.5
        return falling(HOVER) if t_s < 0.5 else (0.75 * HOVER, 2.0)

    said = fly(TouchdownWatch(LIMITS, HOVER), flown, 1.0, down_mps=0.54)
    assert said[GroundContact.TOUCHED] < 0.65
    assert GroundContact.STANDS not in said


def watch_of_a_touch() -> TouchdownWatch:
    """A watch that has just told a touch, at ten seconds."""
    watch = TouchdownWatch(LIMITS, HOVER)
    said = fly(watch, onto_a_deck(lambda _: 0.8 * HOVER), 0.72, start_s=10.0 - 0.7, down_mps=0.7)
    assert GroundContact.TOUCHED in said
    assert GroundContact.STANDS not in said
    return watch


def test_falling_climbing_and_gusts_are_no_touch() -> None:
    rng = np.random.default_rng(5)
    for share in (0.0, 0.3, 0.6, 1.0, 1.6):
        assert set(fly(TouchdownWatch(LIMITS, HOVER), lambda _, u=share: falling(HOVER * u), 3.0)) == {
            GroundContact.NONE
        }
    for _ in range(50):  # throttle between stops, rotors that lag by 50 ms, a vertical gust of 1 m/s², 10 % of error
        shares, gust, rate = rng.uniform(0.1, 1.9, 40), rng.uniform(-1.0, 1.0), rng.uniform(2.0, 6.0)
        turning = [1.0]

        def flown(t_s: float, shares=shares, gust=gust, rate=rate, turning=turning) -> Flown:
            share = float(np.interp(t_s * rate, range(40), shares))
            turning[0] += (share - turning[0]) * STEP_S / 0.05
            return HOVER * share, GRAVITY_MPS2 * (1.0 - 1.05 * turning[0]) + gust

        assert GroundContact.STANDS not in fly(TouchdownWatch(LIMITS, 0.95 * HOVER), flown, 4.0)


def test_a_jolt_in_the_air_is_never_standing_and_soon_forgotten() -> None:
    def flown(t_s: float) -> Flown:  # strikes something at 0.5 s, tumbles down at low throttle
        return (0.05, -20.0) if 0.5 <= t_s < 0.58 else falling(0.05 if t_s >= 0.5 else HOVER)

    said = history(TouchdownWatch(LIMITS, HOVER), flown, 2.0, down_mps=0.5)
    assert {contact for _, contact in said} == {GroundContact.NONE, GroundContact.TOUCHED}
    assert {contact for t_s, contact in said if t_s > 0.6 + LIMITS.window_s + LIMITS.release_s} == {GroundContact.NONE}


@pytest.mark.parametrize("at_s", [0.3, 0.9, 1.2])
def test_a_leap_of_the_velocitys_estimate_is_never_standing(at_s: float) -> None:
    for throttle in (0.05, 0.2, 0.4):
        said = fly(
            TouchdownWatch(LIMITS, HOVER), lambda _, u=throttle: falling(u), 2.0, leap=(at_s, -1.5), down_mps=0.5
        )
        assert GroundContact.STANDS not in said


def test_a_hover_throttle_that_is_stated_too_high_is_measured_in_flight() -> None:
    watch = TouchdownWatch(LIMITS, 0.5)
    hovering = lambda _: falling(0.22, 0.22)  # noqa: E731
    assert set(fly(watch, hovering, 20.0, landing=False)) == {GroundContact.NONE}
    assert set(fly(watch, hovering, 20.0, start_s=20.0)) == {GroundContact.NONE}
    assert GroundContact.STANDS in fly(watch, lambda _: (0.03, 0.0), 2.0, start_s=40.0)


def test_only_while_landing_and_for_a_while_after_the_pilot_left_it() -> None:
    assert set(fly(TouchdownWatch(LIMITS, HOVER), onto_a_deck(lambda _: 0.05), 3.0, landing=False)) == {
        GroundContact.NONE
    }
    said = fly(watch_of_a_touch(), lambda _: (0.2, 0.0), 0.6, start_s=10.0, landing=False)
    assert GroundContact.STANDS in said
    assert GroundContact.NONE not in said
    late = fly(watch_of_a_touch(), lambda _: (0.8 * HOVER * 0.8, 0.0), 3.0, start_s=10.0, landing=False)
    assert late[GroundContact.NONE] == pytest.approx(LIMITS.insist_s, abs=0.25)


def test_there_is_no_touch_but_at_contact_height() -> None:
    """An updraft carries an aircraft at 0.59 of its hover throttle as a deck does."""
    never = lambda _: False  # noqa: E731
    for throttle in (0.05, 0.59 * HOVER):
        flown = lambda _, u=throttle: (u, 0.0)  # noqa: E731
        assert set(fly(TouchdownWatch(LIMITS, HOVER), flown, 3.0, low=never)) == {GroundContact.NONE}
        assert GroundContact.STANDS in fly(TouchdownWatch(LIMITS, HOVER), flown, 3.0)


def test_a_touch_outlives_a_short_loss_of_sight_and_no_long_one() -> None:
    said = history(watch_of_a_touch(), lambda _: (0.2, 0.0), 3.0, start_s=10.0, low=lambda _: False)
    assert (0.5, GroundContact.STANDS) in [(round(t_s, 2), contact) for t_s, contact in said]
    assert {contact for t_s, contact in said if t_s > LIMITS.insist_s} == {GroundContact.NONE}
    short = history(watch_of_a_touch(), lambda _: (0.2, 0.0), 3.0, start_s=10.0, low=lambda t_s: t_s > 0.9)
    assert GroundContact.NONE not in {contact for _, contact in short}


def test_old_unknown_or_frozen_telemetry_is_no_touch() -> None:
    watch = TouchdownWatch(LIMITS, HOVER)
    for index in range(200):
        t_s = index * STEP_S
        assert watch.see(ContactSignals(t_s, True, True, math.nan, t_s, 0.0, t_s, None)) is GroundContact.NONE
        assert (
            watch.see(ContactSignals(t_s, True, True, 0.05, t_s, 0.0, t_s, 1.0)) is GroundContact.NONE
        )  # a rangefinder says 1 m
        assert watch.see(ContactSignals(t_s, True, True, 0.05, t_s - 0.3, 0.0, t_s, None)) is GroundContact.NONE
        assert watch.see(ContactSignals(t_s, True, True, 0.05, t_s, 0.0, 0.0, None)) is GroundContact.NONE


def test_what_presses_it_is_level_and_goes_along_with_the_deck() -> None:
    tilts = build(Response, RESPONSE, "response")
    assert pressed(tilts, (2.0, -1.0, 0.3), 1.5).forward == 0.0
    speeds = replace(tilts, kind="velocity", max_speed_mps=4.0, servo_per_s=1.0)
    wanted = pressed(speeds, (2.0, -1.0, 0.3), 1.5)
    assert (wanted.forward, wanted.right, wanted.climb_mps, wanted.turn_rad_s) == (2.0, -1.0, -1.5, 0.0)
    assert not wanted.hold


RESPONSE = packaged_toml("vehicles")["response"]["attitude"] | {
    "kind": "attitude", "max_tilt_rad": 0.3, "max_climb_mps": 1.0, "max_turn_rad_s": 0.7, "max_speed_mps": 0.0,
    "servo_per_s": 0.0,
}  # fmt: skip


def session_into(sent: list[int]) -> Any:
    """A session whose commands are kept by their numbers."""
    return SimpleNamespace(command=lambda number, *_: sent.append(number) is None)


def test_a_disarm_that_may_not_be_asked_for_yet_is_no_reason_to_force_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """The session asks for none where link and mode are not known."""
    may, asked = iter((False, True, True)), list[float]()
    session: Any = SimpleNamespace(command=lambda _number, _arm, force: asked.append(force) is None and next(may))
    motors = MotorStop(session, MavlinkParameters(), LIMITS, HOVER)
    monkeypatch.setattr(motors, "_watch", SimpleNamespace(see=lambda _: GroundContact.STANDS))
    for t_s in (100.0, 100.02, 100.04, 101.0):
        motors.look(None, AutopilotState(armed=True), t_s)
    assert asked == [0, 0, FORCE]


@pytest.mark.parametrize(("flown_percent", "stops"), [(39.0, True), (0.0, False)])
def test_a_throttle_of_zero_stops_no_motor_where_it_was_zero_in_flight(flown_percent: float, stops: bool) -> None:
    """Zero is also the word of a vehicle that does not tell its throttle: a steady descent would read as standing."""
    sent: list[int] = []
    motors = MotorStop(session_into(sent), MavlinkParameters(), LIMITS, 0.39)
    for turn in range(200):
        t_s, lands = 100.0 + 0.02 * turn, turn >= 100
        state = AutopilotState(
            heartbeat_s=t_s, asked_s=t_s, armed=True, throttle_t_s=t_s, velocity_t_s=t_s,
            throttle_percent=0.0 if lands else flown_percent, velocity_in_ned_mps=(0.0, 0.0, 0.4 if lands else 0.0),
        )  # fmt: skip
        intent = Intent.LAND if lands else Intent.FLY
        motors.look(PilotCommand(t_s, 0.0, 0.0, -40.0, 0.0, 0.0, intent, lands), state, t_s)
    assert bool(sent) == stops
