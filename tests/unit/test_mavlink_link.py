"""The wire and the state of a MAVLink vehicle, without a wire."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

m = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
sys.path.append(str(Path(__file__).parents[2] / "tools"))

from fuzz_link import OURS, STRANGER, Nowhere, fuzz  # noqa: E402

from shipland.errors import ConfigError, VehicleError  # noqa: E402
from shipland.vehicles.camera_stream import ExposureClock  # noqa: E402
from shipland.vehicles.mavlink.link import open_port, read_key  # noqa: E402
from shipland.vehicles.mavlink.parameters import VehicleLimits  # noqa: E402
from shipland.vehicles.mavlink.session import Session  # noqa: E402
from shipland.vehicles.mavlink.setpoints import AttitudeTarget, ClimbScale, Target, Wanted  # noqa: E402
from shipland.vehicles.mavlink.state import ARDUPILOT  # noqa: E402
from shipland.vehicles.mavlink.telemetry import gimbal_at, telemetry_of  # noqa: E402


def session(key: bytes | None = None) -> tuple[Session, Nowhere, object]:
    port = Nowhere()
    made = Session(port, 245, 191, None, key, None, lambda *_: None)
    return made, port, m.MAVLink(None, srcSystem=1, srcComponent=1)


def heartbeat(mode: int = 4) -> object:
    return m.MAVLink_heartbeat_message(2, 3, 129, mode, 4, 3)


def test_hostile_messages_move_nothing() -> None:
    counts, _, sent, sane = fuzz(4000, 1)
    assert counts.failed == 0
    assert counts.malformed > 100
    assert counts.foreign > 100
    assert sent == []
    assert sane


def test_a_stranger_is_not_heard() -> None:
    made, _, codec = session()
    made.link.take(heartbeat().pack(codec), OURS, 0.0)
    made.link.take(heartbeat(9).pack(codec), STRANGER, 0.1)
    other = m.MAVLink(None, srcSystem=2, srcComponent=1)
    made.link.take(heartbeat(9).pack(other), OURS, 0.2)
    assert made.state.mode == 4
    assert made.link.counts.foreign == 2


def test_a_forged_time_stamp_does_not_lock_the_sender_out() -> None:
    key = bytes(range(32))
    made, _, codec = session(key)
    codec.signing.secret_key, codec.signing.sign_outgoing = key, True
    codec.signing.timestamp = 5 * 10**13
    made.link.take(heartbeat(4).pack(codec), OURS, 0.0)
    forger = m.MAVLink(None, srcSystem=1, srcComponent=1)
    forger.signing.secret_key, forger.signing.sign_outgoing = bytes(32), True
    forger.signing.timestamp = 10**14
    made.link.take(heartbeat(9).pack(forger), OURS, 0.1)
    assert made.state.mode == 4
    made.link.take(heartbeat(5).pack(codec), OURS, 0.2)
    assert made.state.mode == 5
    assert made.link.counts.malformed == 1


def test_times_of_messages_are_on_our_clock_and_jitter_is_not_in_them() -> None:
    made, _, codec = session()
    made.link.take(heartbeat().pack(codec), OURS, 100.0)
    rng = np.random.default_rng(1)
    errors = []
    for index in range(400):
        boot_ms = 5000 + 20 * index
        received_s = 100.0 + 0.02 * index + 0.01 + 0.05 * rng.random()
        made.link.take(m.MAVLink_attitude_message(boot_ms, 0.1, 0.2, 0.3, 0, 0, 0).pack(codec), OURS, received_s)
        errors.append(made.state.attitude_t_s - (100.0 + 0.02 * index))
    assert min(errors[50:]) >= 0.009
    assert max(errors[50:]) < 0.02
    assert made.state.reboots == 0
    made.link.take(m.MAVLink_attitude_message(200, 0.1, 0.2, 0.3, 0, 0, 0).pack(codec), OURS, 120.0)
    assert made.state.reboots == 1
    telemetry = telemetry_of(made.state, 121.0)
    assert telemetry.attitude_t_s == pytest.approx(120.0)
    assert telemetry.height_m is None


def test_a_clock_that_runs_slow_does_not_make_telemetry_look_old() -> None:
    made, _, codec = session()
    made.link.take(heartbeat().pack(codec), OURS, 0.0)
    ages = []
    for index in range(1000):
        received_s = 0.02 * index
        boot_ms = round(0.9 * 1e3 * received_s) + 1000
        made.link.take(m.MAVLink_attitude_message(boot_ms, 0.1, 0.2, 0.3, 0, 0, 0).pack(codec), OURS, received_s)
        ages.append(received_s - made.state.attitude_t_s)
    assert max(ages) < 0.25


def test_values_that_no_vehicle_has_change_nothing() -> None:
    made, _, codec = session()
    made.link.take(heartbeat().pack(codec), OURS, 0.0)
    made.link.take(m.MAVLink_attitude_message(10, 0.1, 0.2, 0.3, 0, 0, 0).pack(codec), OURS, 0.1)
    made.link.take(m.MAVLink_attitude_message(20, math.nan, 0.2, 0.3, 0, 0, 0).pack(codec), OURS, 0.2)
    assert made.state.roll_rad == pytest.approx(0.1)
    assert made.refused == 1


def test_a_heading_that_is_held_up_does_not_wind_up() -> None:
    tilts = AttitudeTarget(ClimbScale(2.5, 1.5), Target(1))
    for _ in range(500):
        message = tilts.message(Wanted(0.0, 0.0, 0.0, 0.7), 1.0, 0.02, 0)
    w, _, _, z = message.q
    assert 2.0 * math.atan2(z, w) == pytest.approx(1.3)
    assert message.type_mask == 0


def test_limits_are_the_vehicles() -> None:
    limits = VehicleLimits.of(ARDUPILOT, {"ANGLE_MAX": 2000.0, "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0})
    assert math.degrees(limits.tilt_rad) == pytest.approx(20.0)
    assert limits.climb_scale == ClimbScale(2.5, 1.5)
    with pytest.raises(VehicleError, match="GUID_OPTIONS"):
        VehicleLimits.of(ARDUPILOT, {"GUID_OPTIONS": 8.0})
    with pytest.raises(VehicleError, match="thrust has no meaning"):
        _ = VehicleLimits.of(ARDUPILOT, {}).climb_scale


def test_exposures_are_free_of_the_networks_jitter() -> None:
    clock, rng, errors = ExposureClock(0.2), np.random.default_rng(2), []
    for index in range(300):
        exposed_s = 50.0 + index / 30.0
        arrived_s = exposed_s + 0.2 + 0.1 * rng.random() ** 3
        errors.append(clock.exposed_s(index / 30.0, arrived_s) - exposed_s)
    assert max(map(abs, errors[60:])) < 0.003
    assert ExposureClock(0.2).exposed_s(None, 7.0) == pytest.approx(6.8)


def test_a_fixed_camera_tilts_with_the_aircraft() -> None:
    attitudes = [(0.0, 0.0, 0.0), (1.0, 0.2, -0.1)]
    at = gimbal_at(0.5, attitudes, [], -0.3)
    assert at.pitch_rad == pytest.approx(-0.35, abs=0.01)
    assert at.roll_rad == pytest.approx(0.1, abs=0.01)
    assert gimbal_at(0.5, attitudes, [(0.4, 0.0, -0.2)], None).pitch_rad == pytest.approx(-0.2)


def test_ports_and_keys(tmp_path: Path) -> None:
    for wrong in ("udp:127.0.0.1", "udp:127.0.0.1:0", "mqtt:host:1", "serial:57600"):
        with pytest.raises(ConfigError, match="expected"):
            open_port(wrong)
    secret = tmp_path / "key"
    secret.write_text("correct horse\n")
    assert len(read_key(secret)) == 32
    with pytest.raises(ConfigError, match="cannot be read"):
        read_key(tmp_path / "none")
