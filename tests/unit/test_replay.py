"""Recordings as vehicles."""

import math
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_flight import CAMERA, flight, write_log

from pictures import write_film
from shipland.calibration_file import write_calibration
from shipland.camera import Camera
from shipland.errors import ConfigError, DataError
from shipland.messages import Intent, PilotCommand
from shipland.record.channels import LogParameters
from shipland.scenario.real_vehicle import make_vehicle
from shipland.scenario.scenario import load_scenario
from shipland.vehicles.address import Address, VehicleSetup, vehicle_table
from shipland.vehicles.replay import Recorded, ReplayVehicle
from shipland.vehicles.vehicle import GroundTruthSource


def test_an_address_is_taken_apart() -> None:
    address = Address.parse("mavlink://udp:127.0.0.1:14550?kind=velocity&camera=rtsp%3A%2F%2Fa%2Fb")
    assert (address.scheme, address.place) == ("mavlink", "udp:127.0.0.1:14550")
    assert address.options == {"kind": "velocity", "camera": "rtsp://a/b"}
    for wrong in ("flight.mcap", "replay://", "replay://a?b"):
        with pytest.raises(ConfigError, match="expected"):
            Address.parse(wrong)
    with pytest.raises(ConfigError, match="latency_s"):
        Address.parse("replay://a.mp4?latency_s=soon").number("latency_s", 0.0)
    assert Address.parse("ros2://drone?camera=rtsp://me:a+b@c/d").options["camera"] == "rtsp://me:a+b@c/d"
    with pytest.raises(ConfigError, match="given twice"):
        Address.parse("anafi://1.2.3.4?takeoff=0&takeoff=1")


@pytest.mark.parametrize(("text", "wrong"), [("-90", False), ("90", False), ("-9000", True), ("91", True)])
def test_a_camera_is_mounted_within_a_quarter_turn_of_the_horizon(text: str, wrong: bool) -> None:
    """-9000 is an autopilot's own parameter, in hundredths of a degree."""
    address = Address.parse(f"mavlink://udp:127.0.0.1:14550?mount_deg={text}")
    setup = VehicleSetup(address, Camera.from_fov(64, 36, 69.0), vehicle_table(None))
    with pytest.raises(ConfigError, match="-90 to 90") if wrong else nullcontext():
        assert setup.fixed_pitch_rad == pytest.approx(math.radians(float(text)))


def test_a_log_is_seen_again(tmp_path: Path) -> None:
    path = write_log(tmp_path / "flight.mcap", flight(from_s=27.0, to_s=29.0), None, LogParameters(10.0, 320, 80))
    vehicle = make_vehicle(f"replay://{path}", load_scenario("near"), None, None)
    vehicle.open()
    seen = []
    while (pair := vehicle.read()) is not None:
        seen.append(pair)
    assert len(seen) == pytest.approx(20, abs=1)
    assert seen[0][0].image is not None
    assert seen[0][0].image.shape == (vehicle.camera.height_px, vehicle.camera.width_px, 3) == (180, 320, 3)
    assert isinstance(vehicle, GroundTruthSource)
    truth = vehicle.truth_at(seen[-1][0].t_s)
    assert truth is not None
    assert truth.t_s == pytest.approx(seen[-1][0].t_s)


def test_a_log_takes_no_other_calibration_and_no_options_of_a_video(tmp_path: Path) -> None:
    path = write_log(tmp_path / "flight.mcap", flight(from_s=27.0, to_s=27.5))
    calibration = tmp_path / "camera.yaml"
    write_calibration(Camera.from_fov(160, 96, 69.0), calibration)
    with pytest.raises(ConfigError, match="--calibration is of a video; the log"):
        make_vehicle(f"replay://{path}", load_scenario("near"), calibration, None)
    with pytest.raises(ConfigError, match="no option 'latency_s'"):
        make_vehicle(f"replay://{path}?latency_s=0.3", load_scenario("near"), None, None)


@pytest.mark.parametrize("odd", [0, 20])
@pytest.mark.parametrize("what", ["exposure", "receipt"])
@pytest.mark.parametrize("off_s", [1000.0, -1000.0])
def test_one_row_with_a_wrong_time_costs_itself(odd: int, what: str, off_s: float) -> None:
    flown = list(flight(from_s=27.0, to_s=29.5))
    recorded = [Recorded(record.frame, record.frame.t_s + 0.1, record.telemetry) for record in flown]
    row = recorded[odd]
    frame = replace(row.frame, t_s=row.frame.t_s + (off_s if what == "exposure" else 0.0))
    recorded[odd] = replace(row, frame=frame, arrived_s=row.arrived_s + (off_s if what == "receipt" else 0.0))
    vehicle = ReplayVehicle(recorded, CAMERA)
    vehicle.open()
    seen = []
    while (pair := vehicle.read()) is not None:
        seen.append(pair)
    assert len(seen) >= len(recorded) - 1
    assert [frame.t_s for frame, _ in seen][-5:] == [row.frame.t_s for row in flown[-5:]]


def test_pictures_that_came_meanwhile_are_passed_over() -> None:
    flown = list(flight(from_s=27.0, to_s=29.5))
    recorded = [Recorded(record.frame, record.frame.t_s + 0.1, record.telemetry) for record in flown]
    vehicle = ReplayVehicle(recorded, CAMERA)
    vehicle.open()
    first = vehicle.read()
    assert first is not None
    vehicle.send(PilotCommand(first[1].t_s + 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, Intent.FLY))
    second = vehicle.read()
    assert second is not None
    assert second[0].t_s - first[0].t_s == pytest.approx(1.0, abs=0.05)
    assert second[1].t_s >= first[1].t_s + 1.0


def test_a_video_must_fit_its_calibration(tmp_path: Path) -> None:
    path = write_film(tmp_path / "film.mp4", [np.zeros((96, 160, 3), np.uint8)] * 5)
    calibration = tmp_path / "camera.yaml"
    write_calibration(Camera.from_fov(160, 96, 69.0), calibration)
    vehicle = make_vehicle(f"replay://{path}?pitch_deg=-5", load_scenario("near"), calibration, None)
    vehicle.open()
    pair = vehicle.read()
    assert pair is not None
    assert np.degrees(pair[0].gimbal.pitch_rad) == pytest.approx(-5.0)
    assert pair[1].roll_rad is None
    with pytest.raises(DataError, match="160 × 96"):
        make_vehicle(f"replay://{path}", load_scenario("near"), None, None).open()
