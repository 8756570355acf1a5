"""The stated response of the simulated aircraft is that of its parameters."""

import math

import numpy as np
import pytest

from shipland.config import merge
from shipland.guidance.horizon.descent import Fall
from shipland.messages import PilotCommand
from shipland.scenario.autonomy import response_of
from shipland.scenario.scenario import load_scenario
from worlds import QUIET, world


def stated(aircraft):
    return response_of(load_scenario("rig-natops", aircraft=aircraft))


def test_the_packaged_aircrafts_response_is_what_its_step_responses_show():
    response = stated({})
    assert (response.lag_s, response.dead_time_s, response.drag_per_s) == (0.05, 0.075, 0.4)


def test_three_times_the_drag_is_told():
    drag = {"rotor_drag_per_s": 0.6, "body_drag_per_m": 0.057}
    assert stated({"airframe": drag}).drag_per_s == pytest.approx(1.2, abs=0.1)  # the inflow's loss stays


@pytest.mark.parametrize("changes", [{}, {"loop": {"attitude_per_s": 5.0}}, {"airframe": {"motor_time_s": 0.08}}])
def test_a_tilt_lags_its_stick_by_lag_and_dead_time(changes):
    """The area between a step and the tilt that follows it is the tilt times both; half a tick comes on top."""
    response = stated(changes)
    flown = world(aircraft=merge(QUIET, changes))
    area_s, step_s, asked_rad = 0.0, 0.01, math.radians(0.1 * 15.0)
    for _ in range(200):
        flown.command(PilotCommand(flown.t_s, 10.0, 0.0, 0.0, 0.0, 0.0))
        flown.advance(flown.t_s + step_s)
        nose_down = -np.arcsin(-flown.truth().ned_from_body.rotation[2, 0])
        area_s += step_s * (1.0 - nose_down / asked_rad)
    assert area_s == pytest.approx(response.lag_s + response.dead_time_s, abs=0.012)


def test_a_climb_lags_its_stick_by_its_own_lag_and_dead_time_and_not_by_a_tilts():
    response, flown = stated({}), world(aircraft=QUIET)
    asked_mps, area_s, step_s = 0.3 * response.max_climb_mps, 0.0, 0.01
    for _ in range(300):
        flown.command(PilotCommand(flown.t_s, 0.0, 0.0, 30.0, 0.0, 0.0))
        flown.advance(flown.t_s + step_s)
        area_s += step_s * (1.0 + flown.truth().velocity_in_ned_mps[2] / asked_mps)
    assert area_s == pytest.approx(response.climb_lag_s + response.climb_dead_s, abs=0.02)


@pytest.mark.parametrize("passed_s", [0.1, 0.2, 0.3, 0.4])
def test_a_descent_at_full_stick_loses_the_height_that_is_foreseen(passed_s):
    response, flown, step_s = stated({}), world(aircraft=QUIET), 0.01
    begins_s, begins_m = flown.t_s, flown.truth().ned_from_body.translation_m[2]
    for _ in range(round(passed_s / step_s)):
        flown.command(PilotCommand(flown.t_s, 0.0, 0.0, -100.0, 0.0, 0.0))
        flown.advance(flown.t_s + step_s)
    lost_m, _ = Fall(0.0, response.max_climb_mps, response.climb_lag_s, response.climb_dead_s).after(
        flown.t_s - begins_s
    )
    assert flown.truth().ned_from_body.translation_m[2] - begins_m == pytest.approx(lost_m, abs=0.012)
