"""Gains, references and the descent of the pilot `horizon`."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shipland.estimation.delayed import Inputs
from shipland.estimation.kernels import mean_input
from shipland.estimation.relative_state import (
    GUST,
    POSITION,
    STATES,
    VELOCITY,
    WAVE,
    WIND,
    AxisModel,
    Model,
    discretised,
    dynamics,
)
from shipland.estimation.waves import WAVE_STATES, WaveMotion
from shipland.frames import Array
from shipland.guidance.horizon.descent import Descent, Fall, Outlook, Phase, next_descent
from shipland.guidance.horizon.guidance import Pace, at_rest, moved, reference_reset
from shipland.guidance.horizon.odds import Odds
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.regulator import INPUT, Gains, gains_of
from shipland.guidance.horizon.stick_history import ShapedSpeed
from shipland.guidance.response import ANAFI_LIKE

PARAMETERS = HorizonParameters()
NOISE = PARAMETERS.horizontal
TILT, SERVO = AxisModel(0.06, 0.4), AxisModel(0.15, 0.0, 2.0)
STILL, SHIP = WaveMotion(0.003, 1.8, 0.1), WaveMotion(0.12, 1.8, 0.1)


def _closed(motion, wave, true_motion=None):
    """The loop's matrix when the gains of one motion fly another."""
    a, b, q = dynamics(true_motion or motion, NOISE, wave)
    transition, push, _ = discretised(a, b, q, 0.033)
    push = push[:, 0]
    big = np.zeros((STATES + 1, STATES + 1))
    big[:STATES, :STATES], big[:STATES, INPUT], big[INPUT, INPUT] = transition, push, 1.0
    return big - np.outer(np.append(push, 1.0), gains_of(motion, NOISE, wave, _weights(motion), 33).steady)


def _weights(motion):
    return PARAMETERS.weights_servo if motion.servo_per_s > 0.0 else PARAMETERS.weights


@pytest.mark.parametrize("motion", [TILT, SERVO])
@pytest.mark.parametrize("lag", [0.7, 1.0, 1.4])
def test_the_loop_is_stable_for_vehicles_that_answer_faster_and_slower(motion, lag):
    true = AxisModel(motion.lag_s * lag, motion.drag_per_s, motion.servo_per_s)
    assert np.max(np.abs(np.linalg.eigvals(_closed(motion, STILL, true)))) < 1.0


@pytest.mark.parametrize("motion", [TILT, SERVO])
def test_a_swing_followed_by_half_is_half_of_the_swing_in_the_gains(motion):
    ships = (replace(SHIP, deck_shares=(it, 0.0, 0.0, 0.0)) for it in (1.0, 0.5))
    whole, half = (gains_of(motion, NOISE, ship, _weights(motion), 33) for ship in ships)
    halved = np.ones(STATES + 1)
    halved[WAVE : WAVE + WAVE_STATES] = 0.5
    assert np.abs(whole.steady[WAVE : WAVE + WAVE_STATES]).max() > 0.1
    assert half.steady == pytest.approx(halved * whole.steady, rel=1e-5, abs=1e-6)
    assert half.offset_to_contact[-1] == pytest.approx(halved * whole.offset_to_contact[-1], rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("motion", [TILT, SERVO])
def test_a_steady_push_leaves_no_steady_offset(motion):
    closed = _closed(motion, STILL)
    closed[WIND, WIND] = 1.0
    state = np.zeros(STATES + 1)
    state[WIND] = 1.5
    for _ in range(600):
        state = closed @ state
    assert abs(state[POSITION]) < 0.02
    assert abs(state[VELOCITY]) < 1e-3


def test_the_model_of_a_servo_with_an_integral_is_that_of_its_loop_and_its_gains_hold_the_place():
    motion = AxisModel(0.125, 0.0, 2.0, integral_per_s2=1.0, approach_per_s=2.0, smoothing_s=0.15)
    steady = gains_of(motion, NOISE, STILL, PARAMETERS.weights_servo, 33).steady

    def servo(_, x, asked_mps, wind_mps2):
        _, speed, thrust, integral, tracked, rate = x
        pushed = rate + 2.0 * (tracked - speed) + integral
        return (
            *(speed, thrust + wind_mps2, (pushed - thrust) / 0.125),
            *(tracked - speed, rate, (2.0 * (asked_mps - tracked) - rate) / 0.15),
        )

    inputs, state, x, asked_mps, wind_mps2 = Inputs(4), np.zeros(STATES), np.zeros(6), 0.0, 0.6
    x[0] = state[POSITION] = 0.3
    state[WIND] = wind_mps2  # what the wind pushes and the integral does not yet hold
    shaped, model = ShapedSpeed(motion), Model(2, motion, NOISE, STILL)
    mean = np.zeros(2 * STATES)
    for k in range(300):
        mean[:STATES] = state
        full = np.concatenate([state, [asked_mps], shaped.state[:, 0]])
        asked_mps -= float(steady @ full)
        t_s = 0.033 * k
        shaped.ask(t_s, np.array([asked_mps, 0.0]), inputs)
        shaped.advance(t_s + 0.033, inputs)
        transition, push, _ = model.step(33)
        state = (transition @ mean + push @ mean_input(inputs.history, inputs.count, t_s, t_s + 0.033))[:STATES]
        x = solve_ivp(servo, (0.0, 0.033), x, args=(asked_mps, wind_mps2), rtol=1e-8, atol=1e-10).y[:, -1]
        if k < 90:
            assert state[POSITION] == pytest.approx(x[0], abs=0.02)  # the model has the integral act at once
            assert state[VELOCITY] == pytest.approx(x[1], abs=0.03)
    assert abs(x[0]) < 0.01
    assert abs(x[1]) < 0.01


def _offset_flown(gains: Gains, wave: WaveMotion, start: Array, rows: Sequence[Array]) -> float:
    """The offset of a tilted vehicle from what it follows, after a cycle under each of these gains."""
    transition, push, _ = discretised(*dynamics(TILT, NOISE, wave), gains.step_s)
    state = start.copy()
    for row in rows:
        given = state[INPUT] - row @ state
        state = np.append(transition @ state[:STATES] + push[:, 0] * given, given)
    return float(state[POSITION] - wave.tracked[0] @ state[WAVE : WAVE + WAVE_STATES])


def test_the_offset_at_contact_is_that_of_the_loop_flown_step_by_step():
    gains = gains_of(TILT, NOISE, SHIP, PARAMETERS.weights, 33)
    start = np.array([0.1, -0.2, 0.1, 0.3, -0.2, 0.0, 0.05, 0.1, 0.02, -0.1, 0.2])
    for left in (0, 1, 12, 40):
        flown_m = _offset_flown(gains, SHIP, start, gains.to_contact[:left][::-1])
        assert gains.offset_to_contact[left] @ start == pytest.approx(flown_m, abs=1e-9)


def test_gains_to_contact_end_nearer_than_the_steady_ones():
    gains = gains_of(TILT, NOISE, STILL, PARAMETERS.weights, 33)
    start = np.zeros(STATES + 1)
    start[POSITION], start[VELOCITY], start[GUST] = 0.08, 0.1, 0.3
    steady_m = _offset_flown(gains, STILL, start, [gains.steady] * 20)
    assert abs(gains.offset_to_contact[20] @ start) < abs(steady_m)


PACE = Pace(
    speed_mps=1.2,
    brake_mps2=0.4,
    acceleration_mps2=0.6,
    closing_per_s=0.7,
    tracking_error_max_m=0.5,
    tracking_error_max_mps=0.7,
)


def _led(start_m, goal_m, goal_mps=(0.0, 0.0), seconds=30.0, step_s=0.033):
    reference, goal = at_rest(np.array(start_m), np.zeros(2)), np.array(goal_m)
    way = []
    for _ in range(round(seconds / step_s)):
        goal = goal + step_s * np.array(goal_mps)
        reference = moved(reference, step_s, goal, np.array(goal_mps), PACE)
        way.append((reference, goal))
    return way


def test_a_reference_stays_within_its_pace_and_arrives_without_passing():
    way = _led((-12.0, 2.0), (0.0, 0.0))
    speeds = [math.hypot(*reference.speed_mps) for reference, _ in way]
    assert max(speeds) <= 1.2 + 1e-6
    assert max(math.hypot(*reference.rate_mps2) for reference, _ in way) <= 0.6 + 1e-9
    assert math.hypot(*way[-1][0].place_m) < 0.01
    assert max(reference.place_m[0] for reference, _ in way) < 0.03


@pytest.mark.parametrize(("goal_m", "within_m"), [(-3.0, 3.3), (3.5, 4.3)])
def test_a_reference_that_comes_too_fast_brakes_as_hard_as_it_must(goal_m, within_m):
    """At 3 m/s past its goal, or with less room before it than the 7.5 m that its usual change of speed takes."""
    reference, furthest_m = at_rest(np.zeros(2), np.array([3.0, 0.0])), 0.0
    for _ in range(400):
        reference = moved(reference, 0.033, np.array([goal_m, 0.0]), np.zeros(2), PACE)
        furthest_m = max(furthest_m, reference.place_m[0])
    assert furthest_m < within_m
    assert reference.place_m[0] == pytest.approx(goal_m, abs=0.3)


def test_a_reference_keeps_up_with_a_moving_goal():
    way = _led((-5.0, 0.0), (0.0, 0.0), goal_mps=(0.5, -0.3))
    reference, goal = way[-1]
    assert math.hypot(*(reference.place_m - goal)) < 0.02
    np.testing.assert_allclose(reference.speed_mps, (0.5, -0.3), atol=0.01)


def test_an_aircraft_far_from_its_reference_is_led_anew():
    reference = at_rest(np.array([5.0, 0.0]), np.zeros(2))
    assert reference_reset(reference, np.array([4.6, 0.0]), np.array([0.3, 0.0]), PACE) is reference
    too_far, too_fast = np.array([4.4, 0.0]), np.array([0.0, 0.8])
    np.testing.assert_allclose(reference_reset(reference, too_far, np.zeros(2), PACE).place_m, too_far)
    led = reference_reset(reference, np.array([4.9, 0.0]), too_fast, PACE)
    assert math.hypot(*(led.speed_mps - too_fast)) == pytest.approx(PACE.tracking_error_max_mps)


def test_an_estimate_that_leaps_in_every_picture_does_not_take_the_speed_wanted_away():
    reference, drift_mps = at_rest(np.zeros(2), np.array([0.0, 0.4])), np.array([0.0, 0.4])
    for leap in range(60):
        place_m = np.array([0.0, 2.0 * (leap % 2)])
        reference = moved(reference, 1.0 / 30.0, np.array([60.0, 1.0]), np.zeros(2), PACE)
        reference = reference_reset(reference, place_m, drift_mps, PACE)
    assert reference.speed_mps[0] > 0.5 * PACE.tracking_error_max_mps
    assert abs(reference.speed_mps[1]) < 0.2


def _over(t_s, height_m, offset_m=0.0, odds=1.0, sink_mps=0.0):
    return Outlook(t_s, 0.033, height_m, sink_mps, offset_m, odds, climb_in_s=0.3, hover_height_m=1.2)


@pytest.mark.parametrize("sink_mps", [-0.3, 0.0, 0.1, 0.6, 1.0, 1.3])
@pytest.mark.parametrize("over_m", [0.02, 0.07, 0.22, 0.92])
@pytest.mark.parametrize("after_s", [-0.025, 0.0, 0.05])
def test_contact_is_foreseen_as_the_climb_rate_settles(over_m: float, sink_mps: float, after_s: float) -> None:
    """The command that sets a climb off acts before or after the tilt's, from which times count."""
    final_mps, lag_s, step_s = PARAMETERS.descent.final_descent_mps, 0.3, 1e-4
    left_m, fall_mps, passed_s = over_m - sink_mps * min(after_s, 0.0), sink_mps, min(after_s, 0.0)
    while left_m > 0.0 or fall_mps < 0.0:
        if passed_s >= after_s:
            fall_mps += step_s / lag_s * (max(final_mps, sink_mps) - fall_mps)
        left_m -= step_s * fall_mps
        passed_s += step_s
    foreseen_s = Fall(sink_mps, final_mps, lag_s, after_s).contact_in_s(over_m)
    assert foreseen_s == pytest.approx(max(passed_s, 0.0), abs=0.01 if sink_mps <= final_mps else 0.3)


def _land(offset_m=0.0, odds_at=lambda _: 1.0, seconds=30.0, height_m=1.2):
    descent, way = None, []
    for k in range(round(seconds / 0.033)):
        t_s = 0.033 * k
        descent = next_descent(descent, _over(t_s, height_m, offset_m, odds_at(t_s)), PARAMETERS.descent)
        height_m = max(descent.height_m, 0.05)
        way.append((t_s, descent))
    return way


def _begin_s(way, phase):
    return next(t_s for t_s, descent in way if descent.phase is phase)


def test_a_steady_hover_sinks_and_drops():
    descent, way = PARAMETERS.descent, _land(offset_m=0.02)
    fall_m = 1.2 - descent.wait_height_m
    assert _begin_s(way, Phase.FINAL_DESCENT) == pytest.approx(fall_m / descent.sink_mps, abs=1.0)
    heights_m = np.array([it.height_m for _, it in way if it.phase is Phase.SINK])
    sinks_mps = -np.diff(heights_m) / 0.033
    assert sinks_mps.max() == pytest.approx(descent.sink_mps)
    low = heights_m[:-1] < descent.wait_height_m + 0.1
    assert sinks_mps[low].max() < 0.6 * descent.sink_mps  # what sinks fast to the end sinks through


def test_the_rate_commanded_leads_a_sink_that_slows_by_the_vehicles_lag():
    slowing = [it for _, it in _land(offset_m=0.02) if it.phase is Phase.SINK and it.height_m < 0.45]
    rates_mps, heights_m = np.array([it.rate_mps for it in slowing]), np.array([it.height_m for it in slowing])
    later = round(0.3 / 0.033)
    flown_mps = np.diff(heights_m)[later:] / 0.033
    np.testing.assert_allclose(rates_mps[: len(flown_mps) - 3], flown_mps[:-3], atol=0.05)


def test_far_off_it_does_not_sink_and_rises_from_low_over_the_deck():
    assert all(it.height_m == 1.2 for _, it in _land(offset_m=0.5, seconds=5.0))
    low = Descent(Phase.WAIT, 0.0, PARAMETERS.descent.wait_height_m)
    for k in range(120):
        low = next_descent(low, _over(0.033 * k, low.height_m, offset_m=0.5), PARAMETERS.descent)
    assert low.phase is Phase.SINK
    assert low.height_m == pytest.approx(1.2, abs=0.02)


def test_poor_odds_are_waited_out_and_good_ones_taken():
    def odds_at(t_s):
        return 0.6 - 0.25 * math.cos(2.0 * (t_s - 2.4))  # poor as the wait begins

    way = _land(odds_at=odds_at)
    waited_s = _begin_s(way, Phase.FINAL_DESCENT) - _begin_s(way, Phase.WAIT)
    assert 0.5 < waited_s < 3.2  # not beyond the next best
    assert way[-1][1].odds.now > 0.75
    hasty = replace(PARAMETERS.descent, wait_cost=1.0)
    waiting = Descent(Phase.WAIT, 0.0, hasty.wait_height_m)
    assert next_descent(waiting, _over(0.1, 0.22, odds=0.3), hasty).phase is Phase.FINAL_DESCENT


@pytest.mark.parametrize("phase", [Phase.SINK, Phase.WAIT])
def test_a_touch_by_mischance_is_taken_at_good_odds_and_climbed_from_else(phase: Phase) -> None:
    descent, low_m = PARAMETERS.descent, PARAMETERS.descent.contact_height_m + 0.05
    before = Descent(phase, 0.0, descent.wait_height_m, odds=Odds(0.8, 0.8, 0.65, 3.0))
    climbs = next_descent(before, _over(1.0, low_m, odds=0.2, sink_mps=0.3), descent)
    assert climbs.phase is phase
    assert climbs.rate_mps == descent.sink_mps
    taken = next_descent(before, _over(1.0, low_m, odds=0.9, sink_mps=0.3), descent)
    assert taken.phase is Phase.FINAL_DESCENT
    touched = next_descent(before, _over(1.0, descent.contact_height_m + 0.01, odds=0.2), descent)
    assert touched.rate_mps == descent.sink_mps  # the height is uncertain by more than the way to contact
    hasty = replace(descent, wait_cost=1.0)  # any moment will do
    assert next_descent(before, _over(1.0, low_m, odds=0.2, sink_mps=0.3), hasty).phase is Phase.FINAL_DESCENT


def test_a_drop_is_not_taken_back():
    in_final_descent = Descent(Phase.FINAL_DESCENT, 0.0, 0.0)
    assert next_descent(in_final_descent, _over(1.0, 0.2, 2.0, 0.0), PARAMETERS.descent) is in_final_descent


def test_sticks_and_inputs_are_each_others_inverse():
    for stick in (-80.0, -1.0, 0.0, 35.0):
        assert ANAFI_LIKE.stick_of(ANAFI_LIKE.input_of(stick)) == pytest.approx(stick)
    assert ANAFI_LIKE.input_of(100.0) == pytest.approx(ANAFI_LIKE.full_input)
