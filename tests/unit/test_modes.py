"""The mode function: every transition by its rule, and no flicker for any input."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.guidance.modes import ModeMemory, Situation, next_mode, overruled
from shipland.guidance.parameters import ModeParameters
from shipland.messages import BarPose, Box, GimbalAttitude, Intent, Mode, Observation, PilotCommand

PARAMETERS = ModeParameters()
POSE = BarPose(np.array([-5.0, 0.0, 0.0]), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))
BOX = Box((640.0, 360.0), (30.0, 20.0), 0.9)
STEP_S = 1.0 / 30.0


def situation(now_s, pose=False, bar=False, ship=False, red=False, **changes):
    seen = Observation(
        now_s,
        GimbalAttitude(0.0, 0.0),
        POSE if pose else None,
        BOX if bar else None,
        BOX if ship else None,
        "" if pose else "no green in the picture",
        waves_off=red,
    )
    return Situation(now_s, seen, "far from it", False, "", False, False, True)._replace(**changes)


def run(memory, start_s, seconds, **changes):
    now_s = start_s
    while now_s < start_s + seconds:
        memory = next_mode(situation(now_s, **changes), memory, PARAMETERS)
        now_s += STEP_S
    return memory, now_s


def test_better_evidence_leads_up():
    memory, now_s = run(ModeMemory(), 0.0, 2.0, ship=True)
    assert memory.mode is Mode.TRACK_SHIP
    memory, now_s = run(memory, now_s, 2.0, ship=True, bar=True)
    assert memory.mode is Mode.TRACK_BAR
    memory, now_s = run(memory, now_s, 2.0, bar=True, pose=True)
    assert memory.mode is Mode.APPROACH
    memory, now_s = run(memory, now_s, 2.0, pose=True, landing_condition="")
    assert memory.mode is Mode.LAND
    memory, now_s = run(memory, now_s, 0.1, pose=True, flying=False)
    assert memory.mode is Mode.DONE


def test_a_red_light_keeps_a_landing_from_beginning_and_breaks_one_off_above_commit_height():
    memory, now_s = run(ModeMemory(), 0.0, 3.0, pose=True, red=True, landing_condition="")
    assert memory.mode is Mode.APPROACH
    memory, now_s = run(memory, now_s, 1.0, pose=True, landing_condition="")
    assert memory.mode is Mode.APPROACH
    memory, now_s = run(memory, now_s, 2.0, pose=True, landing_condition="")
    assert memory.mode is Mode.LAND
    assert run(memory, now_s, 0.1, pose=True, red=True, committed=True)[0].mode is Mode.LAND
    memory, now_s = run(memory, now_s, 0.1, pose=True, red=True)
    assert (memory.mode, memory.reason) == (Mode.GO_AROUND, "waved off by the ship's red light")


def test_a_glimpse_is_not_enough():
    memory = next_mode(situation(0.0, pose=True), ModeMemory(), PARAMETERS)
    assert memory.mode is Mode.SEARCH


def test_loss_leads_to_mode_5_then_search_far_away():
    memory, now_s = run(ModeMemory(), 0.0, 2.0, ship=True)
    memory, now_s = run(memory, now_s, PARAMETERS.lost_box_s + 1.0)
    assert memory.mode is Mode.NO_VISION
    assert memory.reason == "no green in the picture"
    memory, now_s = run(memory, now_s, PARAMETERS.memory_s + 1.0)
    assert memory.mode is Mode.SEARCH


def test_loss_near_the_ship_leads_to_climb_out_and_back():
    memory, now_s = run(ModeMemory(), 0.0, 2.0, pose=True)
    memory, now_s = run(memory, now_s, PARAMETERS.memory_s + 2.5, near_ship=True)
    assert memory.mode is Mode.GO_AROUND
    memory, now_s = run(memory, now_s, 2.0, near_ship=True, clear=True, pose=True)
    assert memory.mode is Mode.APPROACH


def test_mode_5_returns_to_what_is_seen_again():
    memory, now_s = run(ModeMemory(), 0.0, 2.0, pose=True)
    memory, now_s = run(memory, now_s, 1.2)
    assert memory.mode is Mode.NO_VISION
    memory, now_s = run(memory, now_s, 1.5, ship=True)
    assert memory.mode is Mode.TRACK_SHIP


def test_landing_goes_on_blind_only_when_committed():
    landing = ModeMemory(mode=Mode.LAND, since_s=-10.0)
    landing, now_s = run(landing, 0.0, 0.5, pose=True)
    high, _ = run(landing, now_s, 1.0, committed=False)
    assert high.mode is Mode.GO_AROUND
    low, now_s = run(landing, now_s, 1.0, committed=True)
    assert low.mode is Mode.LAND
    low, _ = run(low, now_s, 1.0, committed=True)
    assert low.mode is Mode.GO_AROUND


def test_astray_landing_is_waved_off_at_once_but_not_when_committed():
    landing = ModeMemory(mode=Mode.LAND, since_s=0.0)
    off = next_mode(situation(0.1, pose=True, abort_reason="0.5 m off"), landing, PARAMETERS)
    assert (off.mode, off.reason, off.tries) == (Mode.GO_AROUND, "0.5 m off", 1)
    kept = next_mode(situation(0.1, pose=True, abort_reason="0.5 m off", committed=True), landing, PARAMETERS)
    assert kept.mode is Mode.LAND


def test_after_the_last_try_the_climb_out_stays():
    tired = ModeMemory(mode=Mode.GO_AROUND, since_s=-10.0, tries=PARAMETERS.max_tries + 1)
    tired, _ = run(tired, 0.0, 3.0, pose=True, clear=True)
    assert tired.mode is Mode.GO_AROUND
    landing = ModeMemory(mode=Mode.LAND, since_s=0.0, tries=PARAMETERS.max_tries)
    off = next_mode(situation(0.1, pose=True, abort_reason="0.5 m off"), landing, PARAMETERS)
    assert off.reason == "0.5 m off; 4 landings broken off: holds clear of the ship"


def test_by_the_published_rule_a_landing_begins_at_once_and_goes_on():
    coming = ModeMemory(mode=Mode.APPROACH, since_s=0.0)
    inside = situation(0.1, pose=True, landing_condition="")
    assert next_mode(inside, coming, PARAMETERS).mode is Mode.APPROACH  # ours waits for `settle_s` and `dwell_s`
    landing = next_mode(inside._replace(at_once=True), coming, PARAMETERS)
    assert (landing.mode, landing.reason) == (Mode.LAND, "inside the landing square")
    blind, _ = run(landing, 0.2, 5.0, at_once=True)
    assert blind.mode is Mode.LAND
    overruled, _ = run(landing, 0.2, 0.1, at_once=True, overruled=True)
    assert overruled.mode is Mode.GO_AROUND


@pytest.mark.parametrize("intent", [Intent.HOLD, Intent.GO_AROUND])
def test_what_left_the_safety_as_no_landing_ends_it(intent):
    """A person's key too: once it is lifted, the moment that the final descent was begun for has gone."""
    assert overruled(PilotCommand(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, intent), Mode.LAND)
    assert not overruled(PilotCommand(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, Intent.LAND), Mode.LAND)
    assert not overruled(None, Mode.LAND)


news = st.tuples(*[st.booleans()] * 8)


@given(st.lists(st.tuples(st.integers(1, 40), news), min_size=2, max_size=25))
def test_no_two_modes_flicker_within_a_second(stretches):
    memory, now_s, changes = ModeMemory(), 0.0, []
    for frames, (pose, bar, ship, condition, committed, abort_reason, near_ship, clear) in stretches:
        for _ in range(frames):
            told = situation(
                now_s,
                pose,
                bar,
                ship,
                landing_condition="" if condition else "not yet",
                committed=committed,
                abort_reason="off" if abort_reason else "",
                near_ship=near_ship,
                clear=clear,
            )
            after = next_mode(told, memory, PARAMETERS)
            if after.mode is not memory.mode:
                changes.append((now_s, memory.mode, after.mode))
            memory, now_s = after, now_s + STEP_S
    for (first_s, a, _), (second_s, _, c) in itertools.pairwise(changes):
        assert not (a is c and second_s - first_s < PARAMETERS.dwell_s - 1e-9)
