"""The ship waves off by a red light: drawn, read in pictures, and obeyed by every pilot."""

import itertools
from dataclasses import replace

import cv2
import numpy as np
import pytest

from shipland.camera import Camera
from shipland.cue import Polygon
from shipland.errors import ConfigError
from shipland.frames import Pose, rotation_from_euler
from shipland.guidance.modes import WAVE_OFF_S
from shipland.messages import Mode
from shipland.rig import Rig
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario
from shipland.sim.ship.ship import ShipParameters, build_ship
from shipland.vision.near.status_light import is_red

CAMERA = Camera.from_fov(1280, 720, 69.0)
SIDE_M = 0.12
SQUARE = Polygon.rectangle((0.0, 0.0), SIDE_M, SIDE_M)
RED, GREEN, DARK, WHITE = (20, 15, 220), (30, 240, 20), (25, 25, 25), (250, 250, 250)


def seen(colour, range_m=6.0, right_m=0.5, yaw_rad=0.3):
    """The picture of a bar with such a light, and the pose."""
    turned = rotation_from_euler(0.0, yaw_rad, 0.0)  # in camera axes, about down
    pose = Pose(turned, np.array([right_m, -0.4, range_m]))
    image = np.full((720, 1280, 3), 60, np.uint8)
    for polygon, fill in [*((it, GREEN) for it in Rig().cue.polygon), (SQUARE, colour)]:
        points_px = CAMERA.project(pose.apply(np.array([(*corner, 0.0) for corner in polygon.corners_m])))
        cv2.fillConvexPoly(image, np.rint(16 * points_px).astype(np.int32), fill, cv2.LINE_AA, 4)
    return image, pose


@pytest.mark.parametrize("range_m", [1.2, 6.0, 20.0])
@pytest.mark.parametrize(("colour", "red"), [(RED, True), (DARK, False), (GREEN, False), (WHITE, False)])
def test_only_a_red_light_is_red(colour, red, range_m):
    image, pose = seen(colour, range_m)
    assert is_red(image, CAMERA, pose, SQUARE) is red


def test_a_light_that_is_too_small_or_outside_is_not_red():
    image, pose = seen(RED)
    assert not is_red(image, CAMERA, pose, Polygon.rectangle((0.0, 0.0), 0.01, 0.01))
    assert not is_red(image, CAMERA, replace(pose, translation_m=np.array([9.0, 0.0, 6.0])), SQUARE)
    assert not is_red(image, CAMERA, replace(pose, translation_m=np.array([0.0, 0.0, -6.0])), SQUARE)


def test_the_ships_light_flashes_twice_a_second_while_it_waves_off():
    ship = build_ship(ShipParameters(waves_off_s=((2.0, 4.0),)), Rig(status_light_m=SIDE_M), np.random.default_rng(1))
    red = [ship.at(0.05 * tick).waves_off for tick in range(120)]
    assert sum(red) == sum(red[40:80]) == 20
    assert sum(now and not before for before, now in itertools.pairwise(red)) == 4


def test_a_light_that_hides_the_cue_and_times_that_do_not_run_on_are_refused():
    with pytest.raises(ConfigError, match="status_light_m must fit"):
        load_scenario("near", rig={"status_light_m": 0.3})
    with pytest.raises(ConfigError, match="waves_off_s"):
        load_scenario("near", ship={"waves_off_s": [[4.0, 2.0]]})


@pytest.mark.parametrize("pilot", ["horizon", "velocity_matching"])
def test_nobody_touches_a_deck_that_waves_off(pilot):
    begin_s, end_s = 2.0, 14.0
    scenario = load_scenario(
        "rig-natops",
        start={"distance_m": 4.0, "distance_half_range_m": 0.0},
        wind={"mean_mps": 0.0},
        rig={"status_light_m": SIDE_M},
        ship={"waves_off_s": [[begin_s, end_s]]},
        time_limit_s=60.0,
    )
    landing_s = []

    def see(record):
        if record.decision.mode is Mode.LAND:
            landing_s.append(record.telemetry.t_s)

    flown = fly_quietly(scenario, pilot, "geometric", 1, see)
    assert flown.success
    assert flown.verdict is not None
    assert flown.verdict.t_s > min(landing_s) > end_s - 0.5 + WAVE_OFF_S
