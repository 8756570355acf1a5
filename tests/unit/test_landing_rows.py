"""A landing's row: causes by counterfactual, conditions as drawn, and no touchdown where there was none."""

import gc
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from shipland.evaluation.job import FlightJob, land_once
from shipland.evaluation.landing import (
    BOTH,
    DECK,
    EITHER,
    OWN,
    as_text,
    conditions_of,
    landing_from,
    landing_of,
    row_of,
)
from shipland.flight import FlightResult
from shipland.messages import Decision, Intent, PilotCommand, TouchdownVerdict
from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.fly import Flown
from shipland.scenario.scenario import load_scenario
from shipland.scenario.visions import without_pictures
from shipland.sim.touchdown import NO_TOUCH, Judge, OnDeck

SCENARIO = load_scenario("rig-natops", ship={"motion": "still"})
SWAYED = {"motion": "sinusoids", "sinusoids": {"amplitude_m_deg": [0, 0.3, 0, 0, 0, 0], "period_s": [10.0] * 6}}


def verdict(forward_m, starboard_m, t_s=20.0, **keys):
    place = np.array([forward_m, starboard_m])
    inside = bool(np.abs(place).max() <= 0.175)
    words = "landed" if keys.get("landed", True) else "fell over"
    made = TouchdownVerdict(t_s, True, inside, place, place, np.array([0.0, 0.1, 0.5]), 0.1, 0.01, 20.0, words)
    return replace(made, **keys)


def landing(found, scenario=SCENARIO, seed=1):
    result = FlightResult(found.reason if found else "time limit", 100, 20.0, {})
    return landing_of(scenario, seed, Flown(result, found), [])


def instant(scenario, wanted_m):
    """When the deck is swayed by that much."""
    ship = drawn_ship(scenario, 1)

    def off_m(t_s):
        return abs(float(ship.at(t_s).deck.displacement[1]) - wanted_m)

    return min(np.linspace(0.0, 10.0, 2001).tolist(), key=off_m)


@pytest.mark.parametrize(
    ("sway", "touchdown_m", "cause"),
    [
        (0.0, 0.1, ""),
        (0.05, 0.30, OWN),  # control error 0.35: it would have missed a deck at rest; no error would have hit
        (0.25, -0.25, DECK),  # no control error
        (0.25, -0.45, EITHER),  # control error -0.2 to the other side
        (0.10, -0.20, BOTH),  # control error -0.1, deck 0.1 off: either alone would have hit
    ],
)
def test_causes_are_by_counterfactual(sway, touchdown_m, cause):
    scenario = load_scenario("rig-natops", ship=SWAYED)
    t_s = instant(scenario, sway)
    found = landing(verdict(0.0, touchdown_m, t_s), scenario)
    assert found.cause == cause
    assert found.deck_starboard_m == pytest.approx(sway, abs=2e-3)
    assert found.control_starboard_m == pytest.approx(sway + touchdown_m, abs=2e-3)
    assert found.oracle_starboard_m == pytest.approx(-sway, abs=2e-3)
    assert found.oracle_in_square == (abs(sway) < 0.175)


def test_a_wider_square_forgives_more():
    wide = load_scenario("rig-natops", ship=SWAYED, rig={"landing_square_m": 0.8})
    found = landing(verdict(0.0, -0.25, instant(wide, 0.25)), wide)
    assert found.oracle_in_square


def test_a_broken_limit_is_the_cause():
    tilted = verdict(
        0.0, 0.0, landed=False, tilt_rad=math.radians(40.0), reason="tilted 40° on the deck, the limit is 25°"
    )
    assert landing(tilted).cause == "tilt"
    assert landing(verdict(0.0, 0.0, landed=False, reason="a rotor hit the board")).cause == "a rotor hit the board"


def test_a_fall_into_the_sea_is_no_touchdown():
    judge = Judge(SCENARIO.verdict, 0.35)
    far = OnDeck((-70.2, 3.0, 0.8), (0.0, 0.0, 2.0), 0.1)
    judge.follow(1.0, far, NO_TOUCH, True)
    judge.crash(1.1, far, "fell into the sea")
    assert not judge.verdict.touched
    assert not judge.verdict.in_square
    found = landing(judge.verdict)
    assert found.cause == "fell into the sea"
    assert math.isnan(found.forward_m)
    assert math.isnan(found.error_m)
    assert found.oracle_in_square is None


def test_a_row_in_a_file_has_nothing_where_there_is_no_number():
    never = landing(None)
    texts = {name: str(value) for name, value in as_text(row_of(never)).items()}
    assert "nan" not in texts.values()
    assert texts["forward_m"] == texts["oracle_in_square"] == ""
    again = landing_from(texts)
    assert math.isnan(again.forward_m) and again.time_s == never.time_s


class Hovering:
    """A pilot without modes that holds every stick where it is, and says what for."""

    def __init__(self, intent):
        self.intent = intent

    def decide(self, observation, telemetry, sent):
        command = PilotCommand(telemetry.t_s, 0.0, 0.0, 0.0, 0.0, 0.0, self.intent)
        return Decision(command, None, "")


@pytest.mark.parametrize(
    ("distance_m", "heading_deg", "intent", "cause"),
    [
        (12.0, 0.0, Intent.FLY, "never steady over the deck"),
        (12.0, 0.0, Intent.LAND, "not down in time"),
        (12.0, 0.0, Intent.GO_AROUND, "landings broken off"),
        (60.0, 0.0, Intent.FLY, "never near the bar"),
        (60.0, 180.0, Intent.FLY, "never found the ship"),
    ],
)
def test_never_down_says_how_far_it_got_by_what_was_seen_and_flown(distance_m, heading_deg, intent, cause):
    start = {"distance_m": distance_m, "heading_error_deg": heading_deg}
    scenario = load_scenario("rig-natops", start=start, time_limit_s=3.0)
    flown = land_once(FlightJob(scenario, lambda _: Hovering(intent), "geometric", 1))
    assert (flown.phases.search_s, flown.cause) == (0.0, cause)
    assert landing(None).cause == "never found the ship"


@pytest.mark.vision_fails
def test_a_pilot_or_a_vision_that_raises_in_most_cycles_is_the_cause():
    class Failing(Hovering):
        def decide(self, observation, telemetry, sent):
            raise RuntimeError(telemetry.t_s)

        def see(self, frame):
            raise RuntimeError(frame.t_s)

    scenario = load_scenario("rig-natops", time_limit_s=2.0)
    for pilot, vision, cause in ((Failing, "geometric", "pilot failed"), (Hovering, Failing, "vision failed")):
        made = vision if isinstance(vision, str) else without_pictures(lambda _: Failing(Intent.FLY))
        assert land_once(FlightJob(scenario, lambda _, pilot=pilot: pilot(Intent.FLY), made, 1)).cause == cause


def test_conditions_are_those_that_were_drawn():
    wind = {"mean_mps": 4.0, "mean_half_range_mps": 1.0, "from_deg": 90.0, "from_half_range_deg": 0.0}
    scenario = load_scenario("under-way", wind=wind, ship={"course": {"course_deg": 30.0}})
    drawn = [conditions_of(scenario, seed, drawn_ship(scenario, seed), []) for seed in range(1, 30)]
    speeds = {one.wind_mps for one in drawn}
    assert len(speeds) == 29
    assert all(3.0 <= speed <= 5.0 for speed in speeds)
    assert {round(one.wind_off_bow_deg, 6) for one in drawn} == {60.0}  # from the east, heading 30°: 60° to starboard
    assert {(one.course, one.ship_mps, one.surface, one.sea_state) for one in drawn} == {
        ("straight", 2.0, "land", None)
    }
    assert len({one.motion_seed for one in drawn}) == 29


def test_a_flight_starts_where_its_row_says():
    """Flown for half a second: the start is taken from the truth at the first frame."""
    scenario = load_scenario("near", time_limit_s=0.5, start={"bearing_deg": 25.0, "bearing_half_range_deg": 0.0})
    found = land_once(FlightJob(scenario, "paper", "geometric", 3))
    assert found.conditions.start_bearing_deg == pytest.approx(25.0, abs=0.2)
    assert 10.0 <= found.conditions.start_distance_m <= 14.0
    assert 1.0 <= found.conditions.start_height_m <= 2.0
    assert abs(found.conditions.start_heading_error_deg) <= 5.5
    assert len(str(found.time_s)) < 8


def test_a_flight_leaves_nothing_in_its_process():
    """Flown again when caches have what it asks for; the collector is off, so that cycles of references are seen."""
    flight = FlightJob(load_scenario("near", time_limit_s=0.5), "horizon", "geometric", 3)

    def ours():
        return Counter(type(it) for it in gc.get_objects() if str(type(it).__module__).startswith("shipland"))

    land_once(flight)
    gc.collect()
    gc.disable()
    try:
        before = ours()
        land_once(flight)
        assert ours() - before == Counter()
    finally:
        gc.enable()
