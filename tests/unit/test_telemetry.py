"""What arrives of the vehicle's readings, when, and how old; and the video's jitter, losses and clock."""

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.config import build
from shipland.messages import PilotCommand, Telemetry
from shipland.vehicles.delays import DelayParameters
from shipland.vehicles.simulated import SimulatedVehicle
from worlds import QUIET, world

GRID_S = 0.0061
"""A control tick of 4 ms, a physics step of 2 ms."""


def delays(profile: str = "anafi", **change: object) -> DelayParameters:
    return build(DelayParameters, {"telemetry": {"profile": profile}} | change, "delays")


def vehicle(camera: Camera, parameters: DelayParameters, rng: np.random.Generator | None = None) -> SimulatedVehicle:
    made = SimulatedVehicle(world(aircraft=QUIET), camera, parameters, None, rng)
    made.open()
    return made


def cycles(made: SimulatedVehicle, count: int) -> list[Telemetry]:
    said = []
    for _ in range(count):
        _, telemetry = made.read()
        said.append(telemetry)
        made.send(PilotCommand(telemetry.t_s + 0.005, 20.0, 0.0, 0.0, 0.0, 0.0))
    return said


@pytest.mark.parametrize(("profile", "rate_hz", "latency_s"), [("anafi", 5.0, 0.1), ("mavlink", 50.0, 0.03)])
def test_values_are_as_old_as_the_profile_says(camera: Camera, profile: str, rate_hz: float, latency_s: float) -> None:
    said = cycles(vehicle(camera, delays(profile)), 120)
    ages = np.array([telemetry.t_s - telemetry.velocity_t_s for telemetry in said])
    assert ages.min() >= latency_s - 1e-9
    assert ages.max() <= latency_s + 1.0 / rate_hz + GRID_S + 1e-9
    steps = np.diff(sorted({telemetry.velocity_t_s for telemetry in said}))
    assert steps.min() == pytest.approx(max(1.0 / rate_hz, 1.0 / 50.0), abs=GRID_S)


def test_metadata_is_of_the_frame_that_it_comes_with(camera: Camera) -> None:
    made = vehicle(camera, delays("anafi_metadata"))
    for _ in range(30):
        frame, telemetry = made.read()
        assert telemetry.attitude_t_s == telemetry.velocity_t_s == pytest.approx(frame.t_s, abs=GRID_S)
        made.send(PilotCommand(telemetry.t_s + 0.03, 20.0, 0.0, 0.0, 0.0, 0.0))


def test_a_part_of_no_rate_and_the_profile_none_are_none(camera: Camera) -> None:
    telemetry = cycles(vehicle(camera, delays("none")), 10)[-1]
    for name in ("roll_rad", "pitch_rad", "heading_rad", "height_m", "velocity_in_level_mps", "velocity_t_s"):
        assert getattr(telemetry, name) is None
    assert telemetry.flying
    assert telemetry.battery_percent is not None
    no_compass = delays(telemetry={"anafi": {"heading": {"rate_hz": 0.0}}})
    telemetry = cycles(vehicle(camera, no_compass), 10)[-1]
    assert telemetry.heading_rad is None
    assert telemetry.roll_rad is not None


def test_neither_flight_nor_values_depend_on_how_often_telemetry_is_asked_for(camera: Camera) -> None:
    quiet, curious = (vehicle(camera, delays("mavlink")) for _ in range(2))
    for vehicle_, asks in ((quiet, 1), (curious, 7)):
        for index in range(60):
            for part in range(asks):
                vehicle_.telemetry_at(0.05 * (index + (part + 1) / asks))
    first, second = quiet.telemetry_at(3.0), curious.telemetry_at(3.0)
    for name in ("roll_rad", "heading_rad", "height_m", "velocity_t_s"):
        assert getattr(first, name) == getattr(second, name)
    np.testing.assert_array_equal(first.velocity_in_level_mps, second.velocity_in_level_mps)
    np.testing.assert_array_equal(
        quiet.world.truth().ned_from_body.matrix(), curious.world.truth().ned_from_body.matrix()
    )


def test_frames_jitter_get_lost_and_carry_another_clock(camera: Camera) -> None:
    rough = delays(video_jitter_s=0.05, video_loss_share=0.2, video_clock_s=0.5)
    made = vehicle(camera, rough, np.random.default_rng(3))
    stamps, arrivals, truths = [], [], []
    for _ in range(300):
        frame, telemetry = made.read()
        stamps.append(frame.t_s)
        arrivals.append(telemetry.t_s)
        truths.append(made.truth_at(frame.t_s).t_s)
        made.send(PilotCommand.hold(telemetry.t_s, 0.0))
    clock_s = np.array(stamps) - truths
    assert np.ptp(clock_s) < 1e-9
    assert abs(clock_s[0]) > 0.01
    late_s = np.array(arrivals) - truths
    assert late_s.min() >= 0.28 - 1e-9
    assert late_s.std() > 0.01
    assert np.diff(truths).min() > 0.0  # in order
    periods = np.rint(np.diff(truths) * 30.0)
    assert np.mean(periods > 1.5) > 0.1
