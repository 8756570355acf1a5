"""Sticks that do more, or less, than was told: the bank finds by how much, and leaves a true response alone."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipland.estimation.banks import GainBank, GainParameters
from shipland.estimation.delayed import DelayedFilter, DelayedParameters, Inputs
from shipland.estimation.relative_state import POSITION, STATES, AxisModel, Disturbances, Model
from shipland.estimation.waves import WaveMotion

MOTION, NOISE = AxisModel(0.1, 0.4), Disturbances(0.3, 1.5, 1.0, 300.0, 0.1, 300.0, 1e-3)
DELAYED = DelayedParameters(16.0, 40.0, 0.05, 0.5, 1.0, 0.0, 0.6)


@cache  # not while tests are collected: it compiles
def _model(gain):
    return Model(2, replace(MOTION, gain=gain), NOISE, WaveMotion(1e-3, 1.8, 0.1))


def _parameters(deviation=0.15, candidates=(0.8, 1.0, 1.25)):
    return GainParameters(deviation, candidates, 0.05, 0.25, 20.0, 4.0)


def _push(t_s):
    return 2.5 * np.array([math.sin(1.3 * t_s), math.cos(1.9 * t_s)])


def _flown(gain, parameters, seconds=15.0, blind_s=(0.0, 0.0), leap_m=0.0, seed=3):
    """The gain in use, and the filter in use, after a flight whose sticks do `gain` times what was told.

    In between it may be blind, and come out of that elsewhere than its filter believes.
    """
    rng, inputs, bank = np.random.default_rng(seed), Inputs(2), GainBank(parameters)
    follows = DelayedFilter(_model(1.0), DELAYED, 0.02)
    transition, entry, _ = _model(1.0).step(50)
    state = np.zeros(2 * STATES)
    follows.start(0.0, state[POSITION::STATES], 1e-4 * np.eye(2), 0.1)
    for k in range(1, round(seconds / 0.05)):
        inputs.add(0.05 * (k - 1), _push(0.05 * (k - 1)))
        state = transition @ state + gain * entry @ _push(0.05 * (k - 1))
        if blind_s[0] < 0.05 * k < blind_s[1]:
            continue
        place_m = state[POSITION::STATES] + 0.005 * rng.standard_normal(2)
        place_m += leap_m if blind_s[1] <= 0.05 * k else 0.0
        news = (0.05 * k, place_m, 2.5e-5 * np.eye(2), inputs)
        better = bank.update_pose(*news, 0.0, follows, [_model(gain) for gain in parameters.candidates])
        follows = follows if better is None else better
        follows.update_pose(*news)
        if follows.refused >= 10:
            follows.start(0.05 * k, place_m, 2.5e-5 * np.eye(2), 0.1)
            bank.forget_place()
    return bank.gain, follows


@pytest.mark.parametrize("gain", [0.8, 1.0, 1.25])
def test_it_finds_what_the_sticks_do(gain):
    found, follows = _flown(gain, _parameters())
    assert found == gain
    assert follows.model is _model(gain)


def test_a_response_a_little_off_is_kept():
    assert _flown(1.05, _parameters())[0] == 1.0


@pytest.mark.parametrize(("seed", "leap_m"), [(0, 2.0), (0, 2.25), (2, 3.5), (4, 2.0), (5, 3.5)])
def test_a_place_lost_while_blind_says_nothing_of_the_sticks(seed, leap_m):
    assert _flown(1.0, _parameters(), 22.0, (5.0, 8.0), leap_m, seed)[0] == 1.0


def test_it_can_be_told_that_the_response_is_right():
    assert _flown(1.25, _parameters(deviation=0.0))[0] == 1.0


@pytest.mark.parametrize("candidates", [(0.8, 1.25), (0.0, 1.0)])
def test_candidates_without_the_told_one_or_without_effect_are_refused(candidates):
    with pytest.raises(ValueError, match="candidates"):
        _parameters(candidates=candidates)
