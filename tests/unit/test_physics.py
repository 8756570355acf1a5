"""Our world behind somebody else's flight controller."""

import json
import math
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np
import pytest

from ports import free_port
from shipland.errors import ConfigError
from shipland.frames import euler_from_rotation, rotation_from_quaternion
from shipland.messages import TouchdownVerdict
from shipland.scenario.scenario import load_scenario
from shipland.sim.aircraft.servo import thrust_share
from shipland.sitl.physics import STEP_S, FlightStep, LaunchHold, RealTimeFactor, ServedFlight
from shipland.sitl.servo_link import JsonLink, ServoPacket, mount_pitch_rad, state_line
from waiting import until
from worlds import NoCamera


def packet(count: int, motors_us: list[float], gimbal_us: int = 0) -> bytes:
    pulses = [*(round(pulse) for pulse in motors_us), 0, 0, 0, 0, gimbal_us, *[0] * 7]
    return struct.pack("<HHI16H", 18458, 1000, count, *pulses)


def stepped(held: LaunchHold, motors_us: list[float]) -> FlightStep:
    return held.step([round(pulse) for pulse in motors_us], None)


def test_packets() -> None:
    found = ServoPacket.parse(packet(7, [1100.0, 1200.0, 1300.0, 1400.0]))
    assert found is not None
    assert (found.rate_hz, found.count) == (1000, 7)
    assert found.pulses_us[:5] == (1100, 1200, 1300, 1400, 0)
    whole = packet(1, [1000.0] * 4)
    for wrong in (b"", whole[:-1], whole + b"\0", b"\0\0" + whole[2:], struct.pack("<HHI", 29569, 1, 1)):
        assert ServoPacket.parse(wrong) is None
    assert mount_pitch_rad(0.0) is None
    assert mount_pitch_rad(1000.0) == pytest.approx(-0.5 * math.pi)


def test_it_is_held_until_its_rotors_carry_it() -> None:
    held = LaunchHold(load_scenario("rig-natops", wind={"mean_mps": 0.0}), 3, 0.9)
    for _ in range(50):
        step = stepped(held, [1000.0] * 4)
        assert not step.over
    line = state_line(step)
    state = json.loads(line)
    assert b" " not in line
    assert line.startswith(b"\n") and line.endswith(b"\n")
    assert state["position"] == [0.0, 0.0, 0.0]
    assert state["imu"] == {"gyro": [0.0, 0.0, 0.0], "accel_body": [0.0, 0.0, -9.81]}
    assert state["timestamp"] == pytest.approx(50 * STEP_S)
    assert held.world.t_s == 0.0
    stepped(held, [1900.0] * 4)
    assert held.released
    for _ in range(500):
        step = stepped(held, [1900.0] * 4)
    assert step.motion.velocity_mps[2] < -1.0
    assert step.force_in_body_mps2[2] < -9.81


def test_an_autopilot_that_knows_only_the_interface_flies_it() -> None:
    """Rates and attitude held, and a turn of 30°, by a controller that numbers its motors as ArduPilot does."""
    held = LaunchHold(load_scenario("rig-natops", wind={"mean_mps": 2.0}), 3, 0.0)
    table = np.array([thrust_share(pulse) for pulse in range(1000, 2001)])
    motors = np.array([1.0 / 2.3] * 4)
    before_rad: float | None = None
    state: dict = {}
    for count in range(4000):
        pulses = [1000.0 + float(np.searchsorted(table, share)) for share in motors]
        step = stepped(held, pulses if count else [1950.0] * 4)
        assert not step.over
        state = json.loads(state_line(step))
        rotation = rotation_from_quaternion(np.array(state["quaternion"]))
        roll, pitch, yaw = euler_from_rotation(rotation)
        before_rad = yaw if before_rad is None else before_rad
        p, q, r = state["imu"]["gyro"]
        wanted_yaw = before_rad + (math.radians(30.0) if count > 1500 else 0.0)
        a = 0.04 * (5.0 * (0.0 - roll) - p)
        b = 0.035 * (5.0 * (0.0 - pitch) - q)
        c = 0.1 * (1.5 * ((wanted_yaw - yaw + math.pi) % (2 * math.pi) - math.pi) - r)
        height = 1.0 / 2.2 + 0.1 * (0.0 + state["velocity"][2]) + 0.05 * (state["position"][2] + 1.0)
        # front right, rear left, front left, rear right: roll right = more on the left, nose up = more in front
        motors = np.clip(height + np.array([-a + b + c, a - b + c, a + b - c, -a - b - c]), 0.05, 0.95)
    assert before_rad is not None
    assert abs(math.degrees(roll)) < 3.0
    assert abs(math.degrees(pitch)) < 3.0
    assert math.degrees(yaw - before_rad) % 360.0 == pytest.approx(30.0, abs=5.0)
    assert abs(state["position"][2] + 1.0) < 0.5


def test_motors_stopped_by_the_flight_controller_end_in_a_verdict() -> None:
    held = LaunchHold(load_scenario("rig-natops", start={"distance_m": 0.0, "distance_half_range_m": 0.0}), 3, 0.0)
    stepped(held, [1950.0] * 4)
    assert any(stepped(held, [1000.0] * 4).over for _ in range(4000))
    verdict = held.world.verdict()
    assert verdict is not None
    assert verdict.touched


def test_there_must_be_room_to_climb() -> None:
    with pytest.raises(ConfigError, match="no room"):
        LaunchHold(load_scenario("rig-natops"), 1, 3.0)


@contextmanager
def flight_controller(port: int) -> Iterator[socket.socket]:
    """The end of one, connected to the physics."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot:
        autopilot.settimeout(5.0)
        autopilot.connect(("127.0.0.1", port))
        yield autopilot


def test_a_packet_sent_again_gets_its_answer_again_and_no_step() -> None:
    """A flight controller whose answer was lost sends the same count again."""
    port = free_port(socket.SOCK_DGRAM)
    scenario = load_scenario("rig-natops", start={"distance_m": 0.0, "distance_half_range_m": 0.0})
    said: list[str] = []

    def serve() -> None:
        with JsonLink("127.0.0.1", port) as link:
            ServedFlight(LaunchHold(scenario, 3, 0.0), NoCamera(), said.append).over(link)

    served = threading.Thread(target=serve, daemon=True)
    served.start()
    until(lambda: said)
    with flight_controller(port) as autopilot:

        def answer(count: int, motor_us: float) -> bytes:
            autopilot.send(packet(count, [motor_us] * 4))
            return autopilot.recv(4096)

        first = answer(0, 1950.0)
        assert answer(0, 1950.0) == first
        autopilot.settimeout(0.5)  # the last packets of a flight that is over have no answer
        for count in range(1, 6000):
            if not served.is_alive():
                break
            with suppress(TimeoutError, ConnectionError):
                answer(count, 1000.0)
    served.join(5.0)
    assert not served.is_alive()
    assert "s of flight took" in said[-2]
    assert said[-1].startswith("motors at rest -")  # they stopped in the air


def test_a_flight_controller_that_goes_after_the_touchdown_leaves_the_verdict() -> None:
    port = free_port(socket.SOCK_DGRAM)
    scenario = load_scenario("rig-natops", start={"distance_m": 0.0, "distance_half_range_m": 0.0})
    held, said, verdicts = LaunchHold(scenario, 3, 0.0), list[str](), list[TouchdownVerdict | None]()

    def serve() -> None:
        with JsonLink("127.0.0.1", port) as link:
            verdicts.append(ServedFlight(held, NoCamera(), said.append).over(link))

    served = threading.Thread(target=serve, daemon=True)
    served.start()
    until(lambda: said)
    with flight_controller(port) as autopilot:
        for count in range(6000):
            autopilot.send(packet(count, [1000.0 if count else 1950.0] * 4))
            autopilot.recv(4096)
            if held.world.over():
                break
    served.join(10.0)
    assert not served.is_alive()
    assert verdicts == [held.world.verdict()] != [None]


def test_the_tempo_of_a_world_that_falls_behind() -> None:
    tempo = RealTimeFactor()
    assert tempo.words() == ""
    for step in range(3001):
        tempo.note(1.0 + 0.001 * step, 50.0 + 0.001 * step + (0.5 if step > 1500 else 0.0))
    assert tempo.words() == "3.0 s of flight took 3.5 s, the slowest second 1.50 s"
