"""The pilots p and pid: gains against the rule by hand, their closed loop on the modelled vehicle, anti-windup."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from responses import SPEED_LIKE
from shipland.frames import GRAVITY_MPS2, rotation_from_euler
from shipland.guidance.laws import PidMemory, pid_law
from shipland.guidance.linear import LinearNear
from shipland.guidance.near import MeasuredError
from shipland.guidance.parameters import GuidanceParameters, NearBaselines, PidGains
from shipland.guidance.response import ANAFI_LIKE, HOLD
from shipland.guidance.simc import Plant, horizontal_plant, simc_p, simc_pid, vertical_plant, yaw_plant

BASELINES = GuidanceParameters().near_baselines
TILT = ANAFI_LIKE
SPEED = replace(SPEED_LIKE, lag_s=0.1, smoothing_s=0.12, dead_time_s=0.0)
AGE_S, STEP_S = 0.3, 0.03


@pytest.mark.parametrize(
    ("response", "theta_s", "lag_s", "speed_mps"),
    [
        # Drag 0.3/s is a lag of 3.33 s; of the tilt's 0.16 s half goes to it and half to θ = 0.3 + 0.025 + 0.04 s.
        (TILT, 0.365 + 0.08, 1.0 / 0.3 + 0.08, GRAVITY_MPS2 * math.tan(math.radians(0.15)) / 0.3),
        # 0.06 s² + 0.5 s + 1 is (0.3 s + 1)(0.2 s + 1), behind them the tilt's 0.1 s; θ = 0.3 + 0.025 s.
        (SPEED, 0.325 + 0.1 + 0.1, 0.3 + 0.1, 0.075),
    ],
    ids=["tilt", "speed"],
)
def test_pid_is_the_rule_by_hand(response, theta_s, lag_s, speed_mps):
    k_c, tau_i_s = 1.0 / (speed_mps * 2.0 * theta_s), 8.0 * theta_s
    law = simc_pid(horizontal_plant(response, AGE_S), 1.0).law
    assert law.k_p == pytest.approx(k_c * (1.0 + lag_s / tau_i_s))
    assert law.k_p / law.t_i_s == pytest.approx(k_c / tau_i_s)
    assert law.k_p * law.t_d_s == pytest.approx(k_c * lag_s)


def test_a_servo_without_a_stated_integral_is_its_two_lags():
    plant = horizontal_plant(replace(SPEED, integral_per_s2=0.0, lag_s=0.12), AGE_S)
    assert plant.lags_s == pytest.approx((0.3, 0.2))  # 0.12 s / (2 /s) = 0.06 s², 1 / (2 /s) = 0.5 s


def test_p_counts_half_the_lag_to_the_dead_time():
    law = simc_p(horizontal_plant(SPEED, AGE_S), 1.0).law
    assert law.k_p == pytest.approx(1.0 / (0.075 * 2.0 * (0.525 + 0.2)))
    assert (law.t_i_s, law.t_d_s) == (math.inf, 0.0)


def test_a_vehicle_without_drag_is_tuned_as_a_double_integrator():
    """Table 1: Kc = 1/(4 k'' (τc + θ)²), τI = τD = 4 (τc + θ)."""
    gains = simc_pid(horizontal_plant(replace(TILT, drag_per_s=0.0), AGE_S), 1.0)
    push, time_s = GRAVITY_MPS2 * math.tan(math.radians(0.15)), 2.0 * 0.445
    k_c = 1.0 / (4.0 * push * time_s**2)
    assert gains.law.k_p == pytest.approx(2.0 * k_c, rel=1e-3)
    assert gains.law.k_p * gains.law.t_d_s == pytest.approx(k_c * 4.0 * time_s, rel=1e-3)


def test_heave_and_yaw_take_their_own_response():
    assert vertical_plant(TILT, AGE_S) == Plant(0.01, (0.3,), pytest.approx(0.365))
    assert yaw_plant(TILT, AGE_S) == Plant(pytest.approx(0.4), (0.2,), pytest.approx(0.365))


@pytest.mark.parametrize("age_s", [-5.0, 0.0, 1e9])
def test_gains_are_finite_whatever_age_a_picture_claims(age_s):
    response = replace(TILT, uplink_s=0.0, dead_time_s=0.0)
    for plant in (horizontal_plant, vertical_plant, yaw_plant):
        for rule in (simc_p, simc_pid):
            assert 0.0 < rule(plant(response, age_s), 1.0).law.k_p < math.inf


@pytest.mark.parametrize("key", ["closed_loop", "rate_filter"])
def test_constants_must_be_positive(key):
    with pytest.raises(ValueError, match=rf"{key}\s+Input should be greater than 0"):
        NearBaselines(**{"closed_loop": 1.0, "rate_filter": 0.3, key: 0.0})


class ModelledVehicle:
    """An integrator behind its stated lags and dead time on every axis, along the bar's axes, against a wind."""

    def __init__(self, response, head_mps=(0.0, 0.0)):
        self.error = np.array([6.0, -1.0, -0.8, 20.0])  # forward, right, up [m], heading [deg]
        horizontal = horizontal_plant(response, AGE_S)
        self.plants = (horizontal, horizontal, vertical_plant(response, AGE_S), yaw_plant(response, AGE_S))
        self.lagged = [np.zeros(len(plant.lags_s)) for plant in self.plants]
        self.pushed = np.array([*head_mps, 0.0, 0.0])  # speed that the wind takes from it
        waits = round(self.plants[0].dead_time_s / STEP_S)
        self.waiting = deque([(0.0,) * 4] * waits)

    def fly(self, sticks):
        self.waiting.append(sticks)
        asked = self.waiting.popleft()
        for index, plant in enumerate(self.plants):
            value = plant.speed_per_percent * asked[index] - self.pushed[index]
            for stage, lag_s in enumerate(plant.lags_s):
                self.lagged[index][stage] += (value - self.lagged[index][stage]) * -math.expm1(-STEP_S / lag_s)
                value = self.lagged[index][stage]
            self.error[index] -= value * STEP_S

    def measured(self, t_s):
        """The bar's yaw is turned by the heading error; the place is not."""
        yaw_rad = math.radians(-self.error[3])
        level = rotation_from_euler(0.0, 0.0, yaw_rad).T @ self.error[:3]
        return MeasuredError(t_s, AGE_S, level, yaw_rad, 0.0)


def flown(rule, response, time_s=40.0, **wind):
    """(n, 4) the errors of a flight from some metres, in which every stick acts along the bar's axes."""
    near, vehicle, errors = LinearNear(rule, BASELINES, response), ModelledVehicle(response, **wind), []
    for index in range(round(time_s / STEP_S)):
        near.observe(vehicle.measured(index * STEP_S))
        sticks = near.sticks(0.0)
        turned = rotation_from_euler(0.0, 0.0, math.radians(-vehicle.error[3])) @ (sticks.pitch, sticks.roll, 0.0)
        vehicle.fly((turned[0], turned[1], sticks.heave, sticks.yaw))
        errors.append(vehicle.error.copy())
    return np.array(errors)


@pytest.mark.parametrize("response", [TILT, SPEED], ids=["tilt", "speed"])
def test_pid_settles_without_much_overshoot(response):
    errors = flown(simc_pid, response)
    assert np.max(np.abs(errors[-100:])) < 0.02  # m, deg
    assert np.min(errors[:, 0]) > -0.3  # m past the point, from 6 m


@pytest.mark.parametrize("response", [TILT, SPEED], ids=["tilt", "speed"])
def test_pid_leaves_no_offset_in_a_steady_wind_and_p_does(response):
    head_mps = (1.0, 0.5)
    offset = flown(simc_pid, response, 60.0, head_mps=head_mps)[-1, :2]
    assert np.max(np.abs(offset)) < 0.02  # m
    gain = simc_p(horizontal_plant(response, AGE_S), 1.0).law.k_p
    stick_percent = head_mps[0] / horizontal_plant(response, AGE_S).speed_per_percent
    assert flown(simc_p, response, 120.0, head_mps=head_mps)[-1, 0] == pytest.approx(stick_percent / gain, abs=0.05)


def near_at(error_m, cycles, yaw_rad=0.0, start=0, near=None):
    near = near or LinearNear(simc_pid, BASELINES, TILT)
    level = rotation_from_euler(0.0, 0.0, yaw_rad).T @ np.array([*error_m, 0.0])
    for index in range(start, start + cycles):
        near.observe(MeasuredError(index * STEP_S, AGE_S, level, yaw_rad, 0.0))
        sticks = near.sticks(0.0)
    return near, sticks


def test_the_integral_does_not_wind_up_at_the_stop():
    """Held back for a minute far away, it lets go as soon as it may: the other side answers at once."""
    near, sticks = near_at((20.0, 0.0), 2000)
    assert sticks.pitch == 100.0
    gains = simc_pid(horizontal_plant(TILT, AGE_S), 1.0).law
    _, sticks = near_at((-1.0, 0.0), 300, start=2000, near=near)
    assert -100.0 <= sticks.pitch < -gains.k_p


def test_the_integral_outlasts_a_reset_and_follows_the_bar_not_the_nose():
    near, before = near_at((0.0, 1.0), 300)
    near.reset()
    assert near.sticks(0.0) == HOLD
    _, after = near_at((0.0, 0.0), 1, start=300, near=near)
    gains = simc_pid(horizontal_plant(TILT, AGE_S), 1.0).law
    assert 10.0 < after.roll == pytest.approx(before.roll - gains.k_p, abs=0.3 * gains.k_p)
    near.reset()
    _, turned = near_at((0.0, 0.0), 1, yaw_rad=0.5, start=301, near=near)
    assert turned.pitch == pytest.approx(math.sin(0.5) * after.roll, abs=1e-6)
    assert turned.roll == pytest.approx(math.cos(0.5) * after.roll, abs=1e-6)


def test_a_turning_nose_is_no_speed():
    near = LinearNear(simc_pid, BASELINES, TILT)
    for index in range(30):
        yaw_rad = 0.02 * index  # 38°/s
        level = rotation_from_euler(0.0, 0.0, yaw_rad).T @ np.array([10.0, 0.0, 0.0])
        estimate = near.observe(MeasuredError(index * STEP_S, AGE_S, level, yaw_rad, 0.0))
    assert np.linalg.norm(estimate.rate_in_level_mps) < 1e-9


def test_a_measured_rate_takes_the_place_of_the_difference():
    gains = PidGains(2.0, math.inf, 0.5)
    stick, _ = pid_law(1.0, 1.0, PidMemory(0.0, 0.9), gains, rate=-3.0)
    assert stick == pytest.approx(2.0 - 3.0)
