"""Whatever the vehicle's clock says at the start and whichever camera it carries: the same flight, and a landing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.flight import fly
from shipland.frames import Pose, rotation_from_euler
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario
from shipland.vehicles.simulated import SimulatedVehicle


class Shifted(SimulatedVehicle):
    """A simulated vehicle whose clock is ahead of the simulator's by `offset_s`."""

    def __init__(self, vehicle, offset_s):
        self.__dict__.update(vars(vehicle))
        self._offset_s = offset_s

    def _later(self, telemetry):
        names = ("t_s", "attitude_t_s", "heading_t_s", "height_t_s", "velocity_t_s")
        times = {name: getattr(telemetry, name) for name in names}
        return replace(
            telemetry, **{name: None if t_s is None else t_s + self._offset_s for name, t_s in times.items()}
        )

    def read(self):
        pair = super().read()
        if pair is None:
            return None
        return replace(pair[0], t_s=pair[0].t_s + self._offset_s), self._later(pair[1])

    def telemetry_at(self, t_s):
        return self._later(super().telemetry_at(t_s - self._offset_s))

    def send(self, command):
        super().send(replace(command, t_s=command.t_s - self._offset_s))

    def truth_at(self, t_s):
        truth = super().truth_at(t_s - self._offset_s)
        return None if truth is None else replace(truth, t_s=t_s)


def sticks(offset_s, pilot):
    scenario = load_scenario("near")
    vehicle = Shifted(build_vehicle(scenario, 3, None), offset_s)
    autonomy = build_autonomy(scenario, vehicle, pilot, "geometric", 3)
    records = []
    result = fly(vehicle, autonomy, 11.0, lambda: 0.0, records.append)
    assert result.reason == "time limit of 11 s"
    return np.array([record.decision.command.sticks_percent for record in records])


@pytest.mark.parametrize("pilot", ["paper", "horizon"])
def test_a_vehicle_clock_at_5000_s_flies_the_same_flight(pilot):
    at_zero, late = sticks(0.0, pilot), sticks(5000.0, pilot)
    assert at_zero.shape == late.shape
    assert np.ptp(at_zero[:, 0]) > 5.0
    # picoseconds of rounding in the times, amplified by eleven seconds of feedback
    np.testing.assert_allclose(late, at_zero, atol=0.05)


def test_a_full_hd_camera_of_60_degrees_lands_too():
    """Before, the setpoints stayed those of the published camera and the aircraft flew into the sea."""
    overlay = {
        "camera.width_px": 1920,
        "camera.height_px": 1080,
        "camera.horizontal_fov_deg": 60.0,
        "start.distance_m": 80.0,
        "start.height_m": 8.0,
    }
    flown = fly_quietly(load_scenario("near", **overlay), "horizon", "geometric", 1)
    assert flown.success, flown.reason


class Aside(SimulatedVehicle):
    """A simulated vehicle whose gimbal looks to the right of its nose, and says so."""

    def __init__(self, vehicle, aside_rad):
        self.__dict__.update(vars(vehicle))
        self._aside_rad = aside_rad

    def read(self):
        pair = super().read()
        if pair is None:
            return None
        return replace(pair[0], gimbal=replace(pair[0].gimbal, yaw_rad=self._aside_rad)), pair[1]

    def truth_at(self, t_s):
        truth = super().truth_at(t_s)
        if truth is None:
            return None
        camera = truth.ned_from_camera
        turned = Pose(rotation_from_euler(0.0, 0.0, self._aside_rad) @ camera.rotation, camera.translation_m)
        return replace(truth, ned_from_camera=turned)


def test_a_camera_that_looks_aside_lands_as_well():
    """Its heading taken for the nose's, 12° land 18 cm off here, where a camera that looks ahead lands within 3 cm."""
    scenario = load_scenario("near", **{"start.distance_m": 80.0, "start.height_m": 8.0})
    vehicle = Aside(build_vehicle(scenario, 1, None), math.radians(12.0))
    autonomy = build_autonomy(scenario, vehicle, "horizon", "geometric", 1)
    fly(vehicle, autonomy, 90.0, lambda: 0.0, lambda record: None)
    verdict = vehicle.verdict()
    assert verdict is not None
    assert np.hypot(*verdict.touchdown_in_deck_m) < 0.06
