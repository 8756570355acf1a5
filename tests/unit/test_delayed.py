"""Late pictures: inputs by the time of their effect, the look ahead, velocity that is younger than the pictures."""

import math

import numpy as np
import pytest

from shipland.estimation.delayed import DelayedFilter, DelayedParameters, Inputs
from shipland.estimation.relative_state import POSITION, STATES, VELOCITY, AxisModel, Disturbances, Model
from shipland.estimation.waves import WaveMotion

NOISE = Disturbances(0.5, 1.5, 1.5, 20.0, 0.5, 300.0, 0.02)


def _model():
    """Made where it is needed: it compiles."""
    return Model(2, AxisModel(0.06, 0.4), NOISE, WaveMotion(1e-3, 1.8, 0.1))


def _filter():
    return DelayedFilter(_model(), DelayedParameters(16.0, 40.0, 0.05, 0.5, 1.0, 0.0, 0.6), 0.02)


def test_inputs_are_averaged_over_their_times():
    inputs = Inputs(1)
    assert inputs.mean(0.0, 1.0) == 0.0
    inputs.add(1.0, np.array([2.0]))
    inputs.add(2.0, np.array([-1.0]))
    assert inputs.mean(0.5, 2.5) == pytest.approx((0.0 * 0.5 + 2.0 * 1.0 - 1.0 * 0.5) / 2.0)
    assert inputs.mean(1.5, 1.5) == 2.0
    assert inputs.latest() == -1.0


def test_inputs_of_long_flights_are_forgotten_and_still_right():
    inputs = Inputs(1)
    for k in range(3000):
        inputs.add(5000.0 + 0.033 * k, np.array([math.sin(0.1 * k)]))
    last_s = 5000.0 + 0.033 * 2999
    mean = np.mean([math.sin(0.1 * k) for k in range(2990, 2999)])
    assert inputs.mean(last_s - 9 * 0.033, last_s) == pytest.approx(mean, abs=1e-9)


def _truth(seconds, push=0.8):
    """Place and speed every 10 ms under a constant input from 1 s on."""
    state, rows = np.zeros(2 * STATES), []
    transition, inputs, _ = _model().step(10)
    for k in range(round(seconds / 0.01) + 1):
        rows.append(state.copy())
        given = push if 0.01 * k >= 1.0 - 1e-9 else 0.0
        state = transition @ state + inputs @ np.array([given, 0.0])
    return np.array(rows)


def test_it_looks_ahead_through_what_was_commanded():
    truth, inputs, late = _truth(3.0), Inputs(2), _filter()
    inputs.add(1.0, np.array([0.8, 0.0]))
    late.start(0.0, np.zeros(2), 1e-4 * np.eye(2), 0.1)
    for k in range(1, 60):
        t_s = 0.033 * k
        place = np.array([np.interp(t_s, 0.01 * np.arange(len(truth)), truth[:, POSITION]), 0.0])
        assert late.update_pose(t_s, place, 1e-6 * np.eye(2), inputs)
    ahead = late.predict(2.4, inputs)
    assert ahead.of(POSITION)[0] == pytest.approx(truth[240, POSITION], abs=0.01)
    assert ahead.of(VELOCITY)[0] == pytest.approx(truth[240, VELOCITY], abs=0.02)


def test_velocity_between_pictures_counts_once_and_at_its_time():
    inputs = Inputs(2)
    now, later = _filter(), _filter()
    for late in (now, later):
        late.start(0.0, np.zeros(2), 1e-4 * np.eye(2), 0.5)
    now.update_velocity(0.5, np.array([0.3, 0.0]))
    now.update_pose(1.0, np.zeros(2), 1e-4 * np.eye(2), inputs)
    later.update_velocity(0.5, np.array([0.3, 0.0]))
    before = later.predict(1.0, inputs)
    again = later.predict(1.0, inputs)
    np.testing.assert_allclose(before.mean, again.mean)
    later.update_pose(1.0, np.zeros(2), 1e-4 * np.eye(2), inputs)
    np.testing.assert_allclose(now.estimate.mean, later.estimate.mean, atol=1e-12)
    assert abs(before.of(VELOCITY)[0]) > 0.01


def test_a_picture_from_the_past_or_astray_changes_nothing():
    late, inputs = _filter(), Inputs(2)
    late.start(1.0, np.zeros(2), 1e-4 * np.eye(2), 0.1)
    estimate = late.estimate
    assert not late.update_pose(0.5, np.zeros(2), 1e-4 * np.eye(2), inputs)
    assert late.estimate is estimate
    before = late.predict(1.2, inputs)
    for t_s, forward_m in ((1.1, math.nan), (1.1, math.inf), (1.2, 9.0)):
        assert not late.update_pose(t_s, np.array([forward_m, 0.0]), 1e-4 * np.eye(2), inputs)
    assert late.refused == 3
    np.testing.assert_allclose(late.predict(1.2, inputs).mean, before.mean, atol=1e-12)
    np.testing.assert_allclose(late.predict(1.2, inputs).covariance, before.covariance, atol=1e-12)


def test_without_pictures_it_follows():
    late, inputs = _filter(), Inputs(2)
    late.start(0.0, np.zeros(2), 1e-4 * np.eye(2), 0.1)
    late.follow(5.0, inputs)
    assert late.estimate.t_s == pytest.approx(4.4, abs=0.002)
    assert late.estimate.covariance[0, 0] > 0.1


@pytest.mark.parametrize("first_mps", [0.1, 3.0])
def test_velocities_that_err_are_soon_taken_for_what_they_are(first_mps):
    """At rest and seen so; readings err by 0.2 m/s, ten times the least: from the third on none is refused as astray.

    An uncertain first estimate expects larger innovations than come, by more than any velocity errs.
    """
    late, inputs, steps_mps = _filter(), Inputs(2), []
    late.start(0.0, np.zeros(2), 1e-4 * np.eye(2), first_mps)
    for k in range(1, 10):
        t_s = 0.2 * k
        late.update_pose(t_s - 0.01, np.zeros(2), 1e-4 * np.eye(2), inputs)
        before = late.predict(t_s, inputs)
        late.update_velocity(t_s, 0.2 * (-1.0) ** k * np.ones(2))
        steps_mps.append(np.abs(late.predict(t_s, inputs).of(VELOCITY) - before.of(VELOCITY)).max())
    assert min(steps_mps[2:]) > 0.015
