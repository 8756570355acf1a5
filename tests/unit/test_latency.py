"""Pictures with wrong times: the bank finds what to add to them, and leaves right ones alone."""

import math

import numpy as np
import pytest

from shipland.estimation.banks import LatencyBank, LatencyParameters
from shipland.estimation.delayed import DelayedFilter, DelayedParameters, Inputs
from shipland.estimation.relative_state import POSITION, STATES, AxisModel, Disturbances, Model
from shipland.estimation.waves import WaveMotion

NOISE = Disturbances(0.02, 1.5, 0.02, 20.0, 0.1, 300.0, 1e-4)
DELAYED = DelayedParameters(16.0, 40.0, 0.05, 0.5, 1.0, 0.0, 0.6)


def _parameters(deviation_s=0.05, candidates_s=(-0.12, -0.06, 0.0, 0.06, 0.12)):
    return LatencyParameters(deviation_s, candidates_s, 0.05, 0.25, 20.0, 0.05)


def _push(t_s):
    return np.array([math.sin(1.3 * t_s), math.cos(0.9 * t_s)])


def _bank(off_s, parameters, seconds=12.0):
    """A bank after an aircraft that is pushed to and fro has been seen in pictures stamped `off_s` too early."""
    rng, inputs, bank = np.random.default_rng(3), Inputs(2), LatencyBank(parameters)
    model = Model(2, AxisModel(0.1, 0.4), NOISE, WaveMotion(1e-3, 1.8, 0.1))
    follows = DelayedFilter(model, DELAYED, 0.02)
    transition, entry, _ = model.step(10)
    state, places = np.zeros(2 * STATES), []
    for k in range(round((seconds + 1.0) / 0.01)):
        places.append(state[POSITION::STATES].copy())
        state = transition @ state + entry @ _push(0.01 * k)
    follows.start(0.0, places[0], 1e-4 * np.eye(2), 0.1)
    for k in range(1, round(seconds / 0.05)):
        stamp_s = 0.05 * k
        for past_s in (0.16, 0.17, 0.18, 0.19, 0.20):
            inputs.add(stamp_s + past_s, _push(stamp_s + past_s))
        place_m = places[round((stamp_s + off_s) / 0.01)] + 0.005 * rng.standard_normal(2)
        bank.update_pose(stamp_s, place_m, 2.5e-5 * np.eye(2), inputs, 0.0, follows)
        follows.update_pose(stamp_s + bank.correction_s, place_m, 2.5e-5 * np.eye(2), inputs)
    return bank


@pytest.mark.parametrize("off_s", [-0.05, 0.0, 0.03, 0.09])
def test_it_finds_what_the_stamps_are_off_by(off_s):
    assert _bank(off_s, _parameters()).correction_s == pytest.approx(off_s, abs=0.015)


def test_it_can_be_told_that_the_stamps_are_right():
    assert _bank(0.06, _parameters(deviation_s=0.0)).correction_s == 0.0


def test_it_changes_the_times_no_faster_than_it_may():
    assert abs(_bank(0.09, _parameters(), seconds=1.0).correction_s) <= 0.05 * 1.0


@pytest.mark.parametrize("candidates_s", [(0.0, 0.06), (0.0, 0.06, 0.05), (0.0, 0.01, 0.06)])
def test_candidates_that_do_not_rise_in_equal_steps_are_refused(candidates_s):
    with pytest.raises(ValueError, match="candidates_s"):
        _parameters(candidates_s=candidates_s)
