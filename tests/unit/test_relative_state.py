"""The relative state: its steps against integration, its consistency, what it refuses."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shipland.estimation.relative_state import (
    ACTUATION,
    POSITION,
    STATES,
    VELOCITY,
    VELOCITY_BIAS,
    WAVE,
    WAVE_RATE,
    WIND,
    AxisModel,
    Disturbances,
    Model,
    discretised,
    dynamics,
    updated,
)
from shipland.estimation.waves import WAVE_STATES, WaveMotion

NOISE = Disturbances(0.5, 1.5, 1.5, 20.0, 0.5, 300.0, 0.02)
TILT, SERVO = AxisModel(0.06, 0.4), AxisModel(0.15, 0.0, 2.0)
SWING_OF_SHIP = WaveMotion(0.12, 1.8, 0.1)
KNOWN = [axis * STATES + state for axis in range(2) for state in (POSITION, VELOCITY, WIND, WAVE)]


@pytest.mark.parametrize("motion", [TILT, SERVO])
def test_a_step_is_the_integral_of_the_motion(motion):
    a, b, q = dynamics(motion, NOISE, SWING_OF_SHIP)
    state, given = np.linspace(-1.0, 1.0, STATES), 0.7
    transition, push, _ = discretised(a, b, q, 0.25)
    exact = solve_ivp(lambda _, x: a @ x + b[:, 0] * given, (0.0, 0.25), state, rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(transition @ state + push[:, 0] * given, exact, atol=1e-8)


def test_noise_of_two_steps_is_that_of_one():
    matrices = dynamics(TILT, NOISE, SWING_OF_SHIP)
    half, _, few = discretised(*matrices, 0.1)
    _, _, all_of_it = discretised(*matrices, 0.2)
    np.testing.assert_allclose(half @ few @ half.T + few, all_of_it, atol=1e-12)


def test_the_swing_keeps_its_deviation():
    a, b, q = dynamics(TILT, NOISE, SWING_OF_SHIP)
    transition, _, noise = discretised(a, b, q, 0.05)
    rows, spread = slice(WAVE, WAVE + WAVE_STATES), SWING_OF_SHIP.covariance
    np.testing.assert_allclose(
        transition[rows, rows] @ spread @ transition[rows, rows].T + noise[rows, rows], spread, atol=1e-6
    )


def test_a_velocity_loop_settles_at_its_set_point_over_its_own_reference():
    model = Model(1, SERVO, NOISE, SWING_OF_SHIP)
    estimate = model.start(0.0, np.zeros(1), np.eye(1), 1.0)
    mean = estimate.mean.copy()
    mean[VELOCITY_BIAS] = 2.0  # the ship makes 2 m/s of way
    transition, push, _ = model.step(10_000)
    after = transition @ mean + push @ np.array([3.0])
    assert after[VELOCITY] == pytest.approx(3.0 - after[VELOCITY_BIAS], abs=0.01)


def _flight(rng, model, velocity, steps=400):
    """A drawn truth of the model's own kind and the estimate that follows it; NEES of the place and NIS."""
    size = STATES * model.axes
    start = model.start(0.0, np.zeros(model.axes), 0.01 * np.eye(model.axes), 0.5)
    truth = start.mean + np.linalg.cholesky(start.covariance + 1e-12 * np.eye(size)) @ rng.standard_normal(size)
    estimate, normalised = start, []
    transition, inputs, noise = model.step(33)
    root = np.linalg.cholesky(noise + 1e-12 * np.eye(size))
    for step in range(steps):
        given = 0.5 * np.sin(0.1 * step) * np.ones(model.axes)
        truth = transition @ truth + inputs @ given + root @ rng.standard_normal(size)
        estimate = model.predicted(estimate, 33, given)
        expected, jacobian = model.pose(estimate)
        measured = jacobian @ truth + 0.01 * rng.standard_normal(model.axes)
        estimate, squared = updated(estimate, (expected, jacobian), measured, 1e-4 * np.eye(model.axes))
        normalised.append(squared)
        if velocity and step % 6 == 0:
            expected = model.velocity(estimate)
            measured = expected[1] @ truth + 0.05 * rng.standard_normal(model.axes)
            estimate = updated(estimate, expected, measured, 0.05**2 * np.eye(model.axes))[0]
    error = (estimate.mean - truth)[KNOWN]
    return float(error @ np.linalg.solve(estimate.covariance[np.ix_(KNOWN, KNOWN)], error)), float(np.mean(normalised))


@pytest.mark.parametrize("velocity", [False, True])
@pytest.mark.parametrize("motion", [TILT, SERVO])
def test_errors_are_as_large_as_the_covariance_says(motion, velocity):
    model, rng = Model(2, motion, NOISE, SWING_OF_SHIP), np.random.default_rng(1)
    results = [_flight(rng, model, velocity, steps=75) for _ in range(60)]
    nees, nis = np.mean(results, axis=0)
    # Chi-squared of 8 and of 2 degrees of freedom; the mean of 60 flights, four standard deviations.
    assert nees == pytest.approx(8.0, abs=4.0 * math.sqrt(16.0 / 60.0))
    assert nis == pytest.approx(2.0, abs=0.1)


def test_seen_has_the_jacobian_of_its_value():
    model = Model(2, TILT, NOISE, SWING_OF_SHIP)
    rng = np.random.default_rng(2)
    estimate = model.start(0.0, np.ones(2), np.eye(2), 1.0)
    mean = rng.standard_normal(len(estimate.mean))
    at = lambda m: model.pose(type(estimate)(0.0, m, estimate.covariance))  # noqa: E731
    value, jacobian = at(mean)
    for index in range(len(mean)):
        step = np.zeros(len(mean))
        step[index] = 1e-6
        np.testing.assert_allclose((at(mean + step)[0] - value) / 1e-6, jacobian[:, index], atol=1e-5)


def test_what_a_flow_over_a_ship_tells_follows_the_ship_late():
    model, settle_s, w = Model(1, TILT, NOISE, WaveMotion(0.12, 1.8, 0.1)), 0.3, 1.8
    fused = solve_ivp(lambda t, x: (-0.1 * w * np.sin(w * t) - x) / settle_s, (0.0, 20.0), [0.0], rtol=1e-9).y[0, -1]
    estimate = model.start(20.0, np.zeros(1), np.eye(1), 0.1)
    estimate.mean[[VELOCITY, WAVE, WAVE_RATE]] = 0.7, 0.1 * math.cos(w * 20.0), -0.1 * w * math.sin(w * 20.0)
    assert model.velocity(estimate, 1.0, settle_s)[0] == pytest.approx(0.7 - fused, abs=1e-4)


def test_a_flow_over_a_ship_sees_the_deck_which_swings_less_than_the_bar():
    told_mps = {}
    for followed in (1.0, 0.5):
        model = Model(1, TILT, NOISE, WaveMotion(0.12, 1.8, 0.1, deck_shares=(followed, 0.0, 0.0, 0.0)))
        estimate = model.start(0.0, np.zeros(1), np.eye(1), 0.1)
        estimate.mean[[VELOCITY, WAVE_RATE]] = 0.7, 0.2
        told_mps[followed] = model.velocity(estimate, 1.0)[0][0]
    assert told_mps == pytest.approx({1.0: 0.5, 0.5: 0.6})


def test_an_autopilot_on_optical_flow_is_carried_along_by_the_ship():
    servo, state = AxisModel(0.15, 0.0, 2.0, 1.0, 0.3), np.zeros(STATES)
    state[WAVE_RATE] = 0.2
    a, _, _ = dynamics(servo, NOISE, SWING_OF_SHIP)
    own = Model(1, servo, NOISE, SWING_OF_SHIP).start(0.0, np.zeros(1), np.eye(1), 0.1)
    own.mean[:STATES] = state
    told = Model(1, servo, NOISE, SWING_OF_SHIP).velocity(own, 1.0, 0.3)[0][0]
    assert told < -0.1  # the ship below goes ahead, and the flow reads as flying back
    assert (a @ state)[ACTUATION] == pytest.approx(-2.0 / 0.15 * told)


def test_a_steady_push_is_learned():
    model = Model(1, TILT, NOISE, WaveMotion(1e-3, 1.8, 0.1))
    truth, estimate = np.zeros(STATES), model.start(0.0, np.zeros(1), 1e-4 * np.eye(1), 0.1)
    truth[WIND] = 1.2
    matrix = model.step(33)[0].copy()
    matrix[WIND, WIND] = 1.0
    for _ in range(200):
        truth = matrix @ truth
        estimate = model.predicted(estimate, 33, np.zeros(1))
        estimate = updated(estimate, model.pose(estimate), truth[:1], 1e-4 * np.eye(1))[0]
    pushed = float(estimate.of(WIND)[0] + estimate.mean[WIND - 1])
    assert pushed == pytest.approx(1.2, abs=0.1)


def test_a_model_of_another_swing_keeps_the_offset():
    still = Model(1, TILT, NOISE, WaveMotion(0.003, 1.8, 0.1, bar_moves=False))
    ship = Model(1, TILT, NOISE, SWING_OF_SHIP)
    estimate = still.start(0.0, np.array([0.4]), 1e-4 * np.eye(1), 0.1)
    adopted = ship.adopted(estimate, still.wave)
    assert still.pose(estimate)[0] == pytest.approx(ship.pose(adopted)[0])
    shown = ship.pose(adopted)[1]
    # What is seen is as certain as before, where the bar's mean is has become uncertain.
    assert (shown @ adopted.covariance @ shown.T)[0, 0] == pytest.approx(1e-4, rel=0.2)
    assert adopted.covariance[POSITION, POSITION] > 0.1**2


def test_a_deck_below_a_still_bar_takes_the_flow_that_pictures_deny():
    # Pictures hold the place against a bar that stands still; the flow over the deck says that the vehicle moves.
    deck = Model(1, TILT, NOISE, WaveMotion(0.1, 1.8, 0.2, bar_moves=False))
    none = Model(1, TILT, NOISE, WaveMotion(0.003, 1.8, 0.2, bar_moves=False))
    speeds = []
    for model in (deck, none):
        estimate = model.start(0.0, np.zeros(1), 1e-6 * np.eye(1), 0.1)
        for step in range(60):
            estimate = model.predicted(estimate, 33, np.zeros(1))
            estimate = updated(estimate, model.pose(estimate), np.zeros(1), 1e-5 * np.eye(1))[0]
            if step % 6 == 0:
                flow = model.velocity(estimate, over_ship=1.0)
                estimate = updated(estimate, flow, np.array([0.3]), 0.05**2 * np.eye(1))[0]
        speeds.append(estimate.of(VELOCITY)[0])
    assert abs(speeds[0]) < 0.5 * abs(speeds[1])
