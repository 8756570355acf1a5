"""Our world behind the interface of a PX4: its other side spoken by a client of the test's own."""

import math
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import pytest

from ports import free_port
from shipland.errors import ConfigError
from shipland.messages import TouchdownVerdict
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.sim.aircraft.record import RigidBodyState
from shipland.sitl.physics import LaunchHold, ServedFlight
from shipland.sitl.px4_link import Px4Link, SimulatedSensors, pressure_hpa
from shipland.vehicles.mavlink.dialect import dialect
from waiting import until
from worlds import NoCamera

LEVEL = RigidBodyState((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@dataclass
class Client:
    """A flight controller of the test's own: its simulator's connection."""

    link: socket.socket
    encoder: object = field(default_factory=lambda: dialect.MAVLink(None, srcSystem=1, srcComponent=1))
    parser: object = field(default_factory=lambda: dialect.MAVLink(None))
    fixes: list = field(default_factory=list)
    waiting: list = field(default_factory=list)

    def sensors(self):  # type: ignore[no-untyped-def]
        """The next HIL_SENSOR; None when the other side is gone. Fixes on the way are kept."""
        while not self.waiting:
            data = b""
            with suppress(ConnectionError):  # it may go with an answer of ours unread
                data = self.link.recv(4096)
            if not data:
                return None
            messages = self.parser.parse_buffer(data) or []  # type: ignore[attr-defined]
            self.fixes += [message for message in messages if message.get_type() == "HIL_GPS"]
            self.waiting += [message for message in messages if message.get_type() == "HIL_SENSOR"]
        return self.waiting.pop(0)

    def answer(self, motors: list[float], mode: int = 129, pitch: float = math.nan) -> None:
        controls = [*motors, 0.0, 0.0, 0.0, 0.0, pitch, *[0.0] * 7]
        message = dialect.MAVLink_hil_actuator_controls_message(0, controls, mode, 1)
        with suppress(ConnectionError):
            self.link.sendall(message.pack(self.encoder))


def serve(scenario: Scenario, port: int, climb_m: float, say: Callable[[str], None]) -> TouchdownVerdict | None:
    with Px4Link("127.0.0.1", port, 3) as link:
        return ServedFlight(LaunchHold(scenario, 3, climb_m), NoCamera(), say).over(link)


def test_a_client_flies_it_in_lockstep_until_the_verdict() -> None:
    scenario = load_scenario(
        "rig-natops", start={"distance_m": 0.0, "distance_half_range_m": 0.0}, wind={"mean_mps": 0.0}
    )
    port, said, verdicts = free_port(), [], []
    served = threading.Thread(target=lambda: verdicts.append(serve(scenario, port, 0.0, said.append)), daemon=True)
    served.start()
    until(lambda: said)
    rows = []
    with socket.create_connection(("127.0.0.1", port), 5.0) as link:
        client = Client(link)
        for count in range(2000):
            row = client.sensors()
            if row is None:
                break
            rows.append(row)
            climbing = 25 <= count < 75
            if count == 10:
                client.link.sendall(b"\xfd\x00not a message")
            if count == 60:
                client.answer([math.nan] * 4)  # changes nothing
            elif count < 75:
                client.answer([0.9 if climbing else 0.0] * 4)
            else:
                client.answer([0.0] * 4, mode=1)
    served.join(5.0)
    assert not served.is_alive()
    assert [row.time_usec for row in rows[:3]] == [4000, 8000, 12000]
    assert np.diff([row.time_usec for row in rows]).tolist() == [4000] * (len(rows) - 1)
    assert np.mean([row.zacc for row in rows[:25]]) == pytest.approx(-9.81, abs=0.05)
    assert np.mean([row.zacc for row in rows[50:75]]) < -14.0  # 0.9 of the signal is 1.85 g
    assert np.mean([row.zacc for row in rows[105:115]]) > -3.0  # disarmed: it falls
    assert len(client.fixes) == pytest.approx(len(rows) / 25.0, abs=2.0)
    assert client.fixes[3].vd < -50
    assert any("it flies" in line for line in said)
    assert verdicts[0] is not None
    assert verdicts[0].touched


def test_a_flight_controller_that_goes_ends_the_flight_in_words() -> None:
    port, said = free_port(), []
    served = threading.Thread(target=lambda: serve(load_scenario("rig-natops"), port, 0.9, said.append), daemon=True)
    served.start()
    until(lambda: said)
    socket.create_connection(("127.0.0.1", port), 5.0).close()
    served.join(10.0)
    assert not served.is_alive()
    assert "the flight controller has gone" in said


def test_a_taken_port_is_one_line() -> None:
    with Px4Link("127.0.0.1", 0, 1) as first:
        taken = first._listener.getsockname()[1]
        with pytest.raises(ConfigError, match="cannot listen on"):
            Px4Link("127.0.0.1", taken, 1)


def test_sensors_of_an_aircraft_at_rest_facing_east() -> None:
    sensors = SimulatedSensors(np.random.default_rng(1))
    east = LEVEL._replace(quaternion=(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)), position_m=(0.0, 0.0, -100.0))
    rows = [sensors.inertial(0, east, (0.0, 0.0, -9.81)) for _ in range(400)]
    force, rates, field_gauss = (
        np.mean([[getattr(row, f"{axis}{part}") for axis in "xyz"] for row in rows], axis=0)
        for part in ("acc", "gyro", "mag")
    )
    assert force == pytest.approx((0.0, 0.0, -9.81), abs=0.01)
    assert rates == pytest.approx((0.0, 0.0, 0.0), abs=0.0005)
    # north is to the left, and 1.9° of declination turns it a little ahead; in the north the field points down
    assert math.degrees(math.atan2(-field_gauss[1], field_gauss[0])) == pytest.approx(88.1, abs=0.3)
    assert field_gauss[2] > 0.45
    assert np.mean([row.abs_pressure for row in rows]) == pytest.approx(pressure_hpa(100.0), abs=0.01)


def test_fixes_scatter_about_the_place() -> None:
    far = LEVEL._replace(position_m=(111.0, 55.0, -20.0), velocity_mps=(1.0, -2.0, 0.5))
    fixes = [SimulatedSensors(np.random.default_rng(seed)).fix(0.0, far) for seed in range(200)]
    north_m = [math.radians(1e-7 * fix.lat - 60.0) * 6371000.0 for fix in fixes]
    east_m = [math.radians(1e-7 * fix.lon - 4.0) * 6371000.0 * 0.5 for fix in fixes]
    assert np.mean(north_m) == pytest.approx(111.0, abs=0.1)
    assert np.mean(east_m) == pytest.approx(55.0, abs=0.1)
    assert 0.2 < np.std(north_m) < 0.6
    assert np.mean([(fix.vn, fix.ve, fix.vd) for fix in fixes], axis=0) == pytest.approx((100.0, -200.0, 50.0), abs=1.0)
