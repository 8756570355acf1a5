"""The filters' compiled arithmetic against its textbook form in NumPy."""

import math
from functools import cache

import numpy as np
import pytest

from shipland.estimation.delayed import Inputs
from shipland.estimation.kernels import (
    LONGEST_MS,
    correct,
    matrices_of,
    mean_input,
    predicted_covariance,
    propagate,
    see_bank,
)
from shipland.estimation.relative_state import (
    POSITION,
    STATES,
    VELOCITY,
    VELOCITY_BIAS,
    WAVE,
    AxisModel,
    Disturbances,
    Model,
    discretised,
    dynamics,
    less_wave,
    position_covariance,
)
from shipland.estimation.waves import WAVE_STATES, WaveMotion

NOISE = Disturbances(0.5, 1.5, 1.5, 20.0, 0.5, 300.0, 0.02)
MOTION, SWING_OF_SHIP = AxisModel(0.06, 0.4), WaveMotion(0.12, 1.8, 0.1)


@cache  # not while tests are collected: it compiles
def _model():
    return Model(2, MOTION, NOISE, SWING_OF_SHIP)


def _spread(rng, size):
    root = rng.standard_normal((size, size))
    return root @ root.T + np.eye(size)


@pytest.mark.parametrize("size", [4, 9, 17])
def test_a_covariance_through_a_step(size):
    rng = np.random.default_rng(size)
    transition = rng.standard_normal((size, size)) * (rng.random((size, size)) < 0.4)
    covariance, noise = _spread(rng, size), _spread(rng, size)
    expected = transition @ covariance @ transition.T + noise
    np.testing.assert_allclose(predicted_covariance(transition, covariance, noise), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("measured", [1, 2, 3])
def test_a_measurement(measured):
    rng = np.random.default_rng(measured)
    mean, covariance = rng.standard_normal(9), _spread(rng, 9)
    jacobian, innovation, noise = rng.standard_normal((measured, 9)), rng.standard_normal(measured), _spread(rng, 3)
    noise = noise[:measured, :measured].copy()
    spread = jacobian @ covariance @ jacobian.T + noise
    gain = covariance @ jacobian.T @ np.linalg.inv(spread)
    after, spread_left = mean.copy(), covariance.copy()
    normalised = correct(after, spread_left, jacobian, innovation, noise, math.inf)
    np.testing.assert_allclose(after, mean + gain @ innovation, atol=1e-12)
    np.testing.assert_allclose(spread_left, covariance - gain @ spread @ gain.T, atol=1e-11)
    assert normalised == pytest.approx(float(innovation @ np.linalg.solve(spread, innovation)))
    np.testing.assert_array_equal(spread_left, spread_left.T)
    assert correct(mean, covariance, jacobian, innovation, noise, 0.9 * normalised) == normalised
    np.testing.assert_allclose(mean + gain @ innovation, after, atol=1e-12)  # gated out: as it was


def test_a_measurement_that_nothing_can_be_told_from_is_not_finite():
    normalised = correct(np.zeros(2), np.zeros((2, 2)), np.ones((1, 2)), np.ones(1), np.zeros((1, 1)), math.inf)
    assert not math.isfinite(normalised)


@pytest.mark.parametrize("turn_rad_s", [0.0, 0.2])
def test_a_mean_through_inputs_that_change(turn_rad_s):
    rng, inputs = np.random.default_rng(3), Inputs(2)
    for k in range(20):
        inputs.add(1.0 + 0.033 * k, rng.standard_normal(2))
    mean = expected = rng.standard_normal(2 * STATES)
    t_s = 1.02
    (first, push, _), (last, last_push, _) = _model().step(80), _model().step(37)
    for transition, entry, step_s in ((first, push, 0.08), (first, push, 0.08), (last, last_push, 0.037)):
        expected = transition @ expected + entry @ mean_input(inputs.history, inputs.count, t_s, t_s + step_s)
        ahead, aside = expected[VELOCITY_BIAS], expected[STATES + VELOCITY_BIAS]
        change = turn_rad_s * step_s * np.array([-aside, ahead])
        expected[[VELOCITY_BIAS, STATES + VELOCITY_BIAS]] += change
        expected[[VELOCITY, STATES + VELOCITY]] -= change
        t_s += step_s
    covariance, (transition, _, noise) = _spread(rng, 2 * STATES), _model().step(197)
    spread = transition @ covariance @ transition.T + noise
    way = (1.02, 197, _model().steps, _model().shape, inputs.history, inputs.count, turn_rad_s)
    propagate(mean, covariance, way, VELOCITY, VELOCITY_BIAS)
    np.testing.assert_allclose(mean, expected, atol=1e-12)
    np.testing.assert_allclose(covariance, spread, atol=1e-11)


def test_a_bank_is_one_filter_for_each_hypothesis():
    rng, count = np.random.default_rng(4), 3
    mean, score = rng.standard_normal((count, 4)), rng.standard_normal(count)
    covariance, noise = (np.array([_spread(rng, 4) for _ in range(count)]) for _ in range(2))
    transition, row, variance = rng.standard_normal((count, 4, 4)), np.array([[1.0, 0.0, -1.0, 0.0]]), 0.3
    found = mean.copy(), covariance.copy(), score.copy()
    see_bank(*found, (transition, noise), 0.2, -1.4, variance)
    for k in range(count):
        x = transition[k] @ mean[k] + np.array([0.2, 0.0, 0.0, 0.0])
        p = transition[k] @ covariance[k] @ transition[k].T + noise[k]
        logarithm = math.log((row @ p @ row.T)[0, 0] + variance)
        normalised = correct(x, p, row, -1.4 - row @ x, np.array([[variance]]), math.inf)
        np.testing.assert_allclose(found[0][k], x, atol=1e-12)
        np.testing.assert_allclose(found[1][k], p, atol=1e-11)
        assert found[2][k] == pytest.approx(score[k] - 0.5 * (min(normalised, 25.0) + logarithm))


def test_a_place_less_a_share_of_the_swing():
    rng = np.random.default_rng(5)
    mean, covariance, near = rng.standard_normal(2 * STATES), _spread(rng, 2 * STATES), 0.7
    shares, rates = rng.standard_normal((2, WAVE_STATES))
    rows = np.zeros((4, 2 * STATES))  # places, then rates
    for axis in range(2):
        first = STATES * axis
        waves = slice(first + WAVE, first + WAVE + WAVE_STATES)
        rows[axis, first + POSITION], rows[axis, waves] = 1.0, -near * shares
        rows[2 + axis, first + VELOCITY], rows[2 + axis, waves] = 1.0, -near * rates
    np.testing.assert_allclose(np.concatenate(less_wave(mean, (shares, rates), near)), rows @ mean, atol=1e-12)
    expected = rows[:2] @ covariance @ rows[:2].T
    np.testing.assert_allclose(position_covariance(covariance, near * shares), expected, atol=1e-11)


@pytest.mark.parametrize("way_ms", [0, 33, 80, 160, 197])
def test_a_step_of_the_model_is_that_of_its_axes(way_ms):
    step = matrices_of(_model().steps, way_ms)
    transition, push, noise = _model().step(way_ms)
    np.testing.assert_array_equal(np.kron(np.eye(2), step[0]), transition)
    np.testing.assert_array_equal(np.kron(np.eye(2), step[1] + step[3]), noise)
    np.testing.assert_array_equal(np.kron(np.eye(2), step[2][:, :1]), push)
    assert not step[2][:, 1:].any()
    if way_ms == 0:
        np.testing.assert_array_equal(step[0], np.eye(STATES))


def test_matrices_asked_for_again_after_others_are_the_same():
    asked_ms = [*range(1, 300), LONGEST_MS]
    first = {step_ms: matrices_of(_model().steps, step_ms).copy() for step_ms in asked_ms}
    for step_ms in asked_ms:
        np.testing.assert_array_equal(matrices_of(_model().steps, step_ms), first[step_ms])


@pytest.mark.parametrize("step_ms", [1, 33, 255, 1023])
def test_a_step_made_of_shorter_ones_is_the_step(step_ms):
    transition, push, noise = discretised(*dynamics(MOTION, NOISE, SWING_OF_SHIP), 1e-3 * step_ms)
    whole, inputs, spread = _model().step(step_ms)
    for axis in range(2):
        rows = slice(STATES * axis, STATES * (axis + 1))
        np.testing.assert_allclose(whole[rows, rows], transition, atol=1e-11)
        np.testing.assert_allclose(inputs[rows, axis], push[:, 0], atol=1e-11)
        np.testing.assert_allclose(spread[rows, rows], noise, atol=1e-11)
