"""Our far control: boxes become places, the aircraft comes to the setpoint of a ship that sails away."""

import math

import numpy as np
import pytest

from shipland.guidance.far import PUBLISHED_CAMERA, FarSight, FarTables, FarTarget
from shipland.guidance.offset_free_far import OffsetFreeFar
from shipland.messages import Box
from shipland.missions.crew import response_of
from shipland.missions.scenarios import load_scenario, scenario_table

SCENARIO = load_scenario(scenario_table("near"))
GUIDANCE, RESPONSE = SCENARIO.guidance, response_of(SCENARIO)
FOCAL_PX, MIDDLE_PX = 931.0, (639.5, 359.5)
AREA_M2 = 3.24
SETPOINT_M = FOCAL_PX * math.sqrt(AREA_M2 / GUIDANCE.ship.pitch.setpoint)
TABLES = FarTables.for_camera(GUIDANCE.ship, GUIDANCE.bar, PUBLISHED_CAMERA)


def control():
    return OffsetFreeFar(
        GUIDANCE.offset_free_far, RESPONSE, FOCAL_PX, MIDDLE_PX, TABLES, {FarTarget.SHIP: AREA_M2, FarTarget.BAR: 0.42}
    )


def sight(forward_m, right_m, down_m, t_s, heading_error_deg=0.0, gimbal_pitch_rad=0.0):
    """The ship's box from its place in `level`, camera pitched as told."""
    side_px = FOCAL_PX * math.sqrt(AREA_M2) / forward_m
    row = MIDDLE_PX[1] + FOCAL_PX * math.tan(math.atan2(down_m, forward_m) + gimbal_pitch_rad)
    centre = (MIDDLE_PX[0] + FOCAL_PX * right_m / forward_m, row)
    return FarSight(
        Box(centre, (side_px, side_px), 0.9), FarTarget.SHIP, t_s, t_s + 0.5, gimbal_pitch_rad, heading_error_deg
    )


@pytest.mark.parametrize(("right_m", "sign"), [(20.0, 1.0), (-20.0, -1.0)])
def test_sticks_lead_to_the_ship(right_m, sign):
    sticks = control().sticks(sight(150.0, right_m, 20.0, 0.0))
    assert sticks.pitch > 5.0
    assert sign * sticks.roll > 5.0
    assert sticks.heave < -5.0


def test_the_camera_pitch_does_not_matter():
    level = control().sticks(sight(100.0, 5.0, 20.0, 0.0))
    pitched = control().sticks(sight(100.0, 5.0, 20.0, 0.0, gimbal_pitch_rad=-0.2))
    assert pitched == pytest.approx(level, abs=1e-6)


def test_yaw_follows_the_compass_and_without_one_the_box():
    by_compass = control().sticks(sight(100.0, 0.0, 0.0, 0.0, heading_error_deg=10.0))
    by_box = control().sticks(sight(100.0, -10.0, 0.0, 0.0, heading_error_deg=None))
    assert by_compass.yaw > 5.0
    assert by_box.yaw < -2.0


@pytest.mark.parametrize("ship_mps", [0.0, 2.0, 4.5])
def test_it_catches_a_ship_under_way(ship_mps):
    """An aircraft that is its own model, boxes every half second with 5 % of noise in area."""
    far, rng = control(), np.random.default_rng(1)
    place_m, velocity_mps, ship_m = np.zeros(2), np.zeros(2), 120.0
    step_s, sticks = 0.1, None
    for index in range(900):
        t_s = index * step_s
        ship_m += ship_mps * step_s
        if index % 5 == 0:
            seen = sight(ship_m - place_m[0], 5.0 - place_m[1], 0.0, t_s)
            grow = math.exp(0.025 * rng.normal())
            noisy = Box(seen.box.centre_px, (grow * seen.box.size_px[0], grow * seen.box.size_px[1]), 0.9)
            seen = FarSight(noisy, FarTarget.SHIP, t_s, t_s, 0.0, 0.0)
            sticks = far.sticks(seen)
            far.sent(t_s, sticks)
        push = 9.81 * np.tan(0.01 * np.array(sticks[:2]) * RESPONSE.max_tilt_rad)
        velocity_mps = velocity_mps + step_s * (push - velocity_mps / RESPONSE.speed_time_s)
        place_m = place_m + step_s * velocity_mps
    # 3 m of 24: the range's own noise is 2.5 % of it and the law aims at it from twenty metres a second before
    assert ship_m - place_m[0] == pytest.approx(SETPOINT_M, abs=3.0)
    assert place_m[1] == pytest.approx(5.0, abs=1.0)


def test_from_high_up_it_descends_before_it_comes_nearer():
    near_and_high = control().sticks(sight(58.0, 0.0, 28.0, 0.0))
    assert near_and_high.pitch < 0.0
    assert near_and_high.heave < -50.0
    assert control().sticks(sight(150.0, 0.0, 28.0, 0.0)).pitch > 5.0
