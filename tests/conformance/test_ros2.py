"""What only a ROS 2 vehicle does: who may command it, whose stamps count, and what others are told."""

import math
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="the extra ros2")

from ros2_bench import CAMERA, Drone, bench, own_domain

from ports import free_port
from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    FlightRecord,
    Frame,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    PilotCommand,
    Telemetry,
)
from shipland.rig import Rig
from shipland.vehicles import link_vehicle, pace
from shipland.vehicles.ros2.conversions import gimbal_message, odometry_of
from shipland.vehicles.ros2.dds import Node, Publisher, _quality
from shipland.vehicles.ros2.image_messages import camera_info, same_lens
from shipland.vehicles.ros2.state import Heard
from shipland.vehicles.ros2.types import message, message_of
from shipland.vehicles.ros2.vehicle import Ros2Vehicle
from shipland.vehicles.vehicle import Commanded, Ending, Informed, Real
from shipland.vehicles.wanted import Wanted
from waiting import until


def command(intent: Intent = Intent.FLY, pitch_percent: float = 20.0, low: bool = True) -> PilotCommand:
    return PilotCommand(time.monotonic(), pitch_percent, 0.0, 0.0, 0.0, -0.25, intent, low)


@contextmanager
def flying(options: str = "", intent: Intent = Intent.FLY, **more: float) -> Iterator[tuple[Ros2Vehicle, Drone]]:
    """A bench whose vehicle was opened, and whose drone has got its first forward stick."""
    with bench(options, **more) as (vehicle, drone):
        vehicle.open()
        vehicle.send(command(intent))
        assert until(lambda: drone.wanted.forward > 0.0)
        yield vehicle, drone


def ask(land: Publisher, wanted: bool = True) -> None:
    """For a landing, or off."""
    land.send(message("std_msgs/msg/Bool", data=wanted))


def call(land: Publisher, vehicle: Ros2Vehicle) -> None:
    """Ask until it has heard, whoever of an earlier test still seems to listen."""
    assert until(lambda: vehicle._heard.land or ask(land))


def test_it_is_a_real_vehicle_that_says_who_commands_and_passes_on_what_is_seen() -> None:
    with bench() as (vehicle, _):
        assert all(isinstance(vehicle, kind) for kind in (Real, Ending, Commanded, Informed))


def test_the_checklist_names_every_topic_and_finds_the_drone_fit() -> None:
    with bench() as (vehicle, drone):
        vehicle.connect()
        assert until(lambda: all(check.ok for check in vehicle.checks()))
        names = [check.name for check in vehicle.checks()]
        assert names == ["calibration", "state", "telemetry", "pictures", "picture's age", "limits", "battery"]
        assert vehicle.camera.matrix == pytest.approx(CAMERA.matrix)
        drone.silent = True
        assert until(lambda: not all(check.ok for check in vehicle.checks()))


def test_another_node_that_may_command_the_vehicle_is_no_start() -> None:
    """Two `shipland fly` on the same topics took turns at the vehicle."""
    with bench() as (vehicle, drone):
        vehicle.connect()
        assert until(lambda: all(check.ok for check in vehicle.checks()))
        with closing(Node(drone.domain, local=True)) as other:
            other.publisher(drone.topics["command_attitude"], "mavros_msgs/msg/AttitudeTarget")
            other.publisher("drone/elsewhere", "geometry_msgs/msg/TwistStamped")
            assert until(lambda: not all(check.ok for check in vehicle.checks()))
            (found,) = (check for check in vehicle.checks() if not check.ok)
            assert found.name == "one commander"
            assert "/drone/command_attitude" in found.words
            assert "elsewhere" not in found.words
        assert until(lambda: all(check.ok for check in vehicle.checks()))


def test_nothing_is_commanded_before_the_drone_obeys_nor_after_it_does_not() -> None:
    with bench() as (vehicle, drone):
        drone.mode = "POSCTL"
        vehicle.connect()
        vehicle.send(command())
        assert until(lambda: "pilot (POSCTL)" in vehicle.in_command)
        assert drone.wanted.hold
        drone.mode = "GUIDED"
        vehicle.open()
        vehicle.send(command())
        assert until(lambda: drone.wanted.forward > 0.0)
        assert vehicle.in_command == "shipland"
        drone.mode = "POSCTL"
        assert until(lambda: bool(vehicle.end_reason))
        assert vehicle.end_reason == "the pilot took over: POSCTL"
        assert vehicle.read() is None
        drone.mode = "GUIDED"  # it does not come back
        assert vehicle.read() is None
        before, turns = Wanted(0.0, 0.0, 0.0, 0.0), len(vehicle.late_s)
        drone.wanted = before
        vehicle.send(command())
        assert until(lambda: len(vehicle.late_s) > turns + 10)
        assert drone.wanted is before  # no set-point in ten turns


@pytest.mark.parametrize("mode", ["GUIDED", ""])
def test_a_mode_that_obeys_already_is_not_a_hand_over(mode: str) -> None:
    """As before an autopilot over MAVLink: it was set for somebody else."""
    with bench(take=False, engage_timeout_s=0.5) as (vehicle, drone):
        drone.mode = mode
        with pytest.raises(VehicleError, match="already: switch out of it and back to hand over"):
            vehicle.open()


def test_an_autopilot_that_the_bridge_finds_again_is_not_handed_over() -> None:
    with bench(take=False, engage_timeout_s=2.0) as (vehicle, drone):
        vehicle.connect()
        assert until(lambda: vehicle.in_command == "the pilot (GUIDED)")

        def lose_and_find() -> None:
            time.sleep(0.5)
            drone.connected, drone.guided, drone.mode = False, False, ""
            time.sleep(0.3)
            drone.connected, drone.guided, drone.mode = True, True, "GUIDED"

        threading.Thread(target=lose_and_find).start()
        with pytest.raises(VehicleError, match="not given to us"):
            vehicle.open()


def states(*told: tuple[str, bool]) -> Iterator[Any]:
    """mavros's, of modes and whether it is connected to the autopilot; where it is not it names none."""
    for mode, connected in told:
        yield message("mavros_msgs/msg/State", mode=mode, armed=bool(mode), guided=bool(mode), connected=connected)


def test_an_autopilot_that_was_lost_when_the_wait_began_is_not_handed_over() -> None:
    heard = Heard("velocity")
    lost, found, chosen = (("GUIDED", True), ("", False)), [("GUIDED", True)], [("POSCTL", True), ("GUIDED", True)]
    for state in states(*lost):
        heard.take_state(state)
    heard.expect(asked=False)
    for told, given in ((found, False), (chosen, True)):
        for state in states(*told):
            heard.take_state(state)
        assert heard.given is given


def test_an_autopilot_that_its_bridge_finds_at_last_is_not_handed_over() -> None:
    """A bridge that comes first says: not connected, no mode."""
    heard = Heard("velocity")
    heard.expect(asked=False)
    for state in states(("", False), ("GUIDED", True)):
        heard.take_state(state)
    assert not heard.given


def test_an_autopilot_that_the_bridge_has_lost_is_not_taken_whatever_it_still_says_of_it() -> None:
    heard = Heard("velocity")
    heard.expect(asked=True)
    for state in states(("GUIDED", True), ("GUIDED", False)):
        heard.take_state(state)
    assert not heard.begin(called=False)


def test_a_mode_that_is_chosen_once_we_wait_is_a_hand_over() -> None:
    with bench(take=False) as (vehicle, drone):
        vehicle.connect()

        def hands_over() -> None:
            for mode in ("POSCTL", "GUIDED"):
                time.sleep(0.3)
                drone.mode = mode

        chosen = threading.Thread(target=hands_over)
        chosen.start()
        vehicle.open()
        chosen.join()
        assert vehicle.in_command == "shipland"


def test_a_px4_is_handed_over_in_offboard_to_fly_speeds_and_not_tilts() -> None:
    """It sets MAV_MODE_FLAG_GUIDED_ENABLED, mavros's `guided`, in AUTO modes only; thrust is thrust to it, no climb."""
    with bench() as (vehicle, drone):
        drone.mode, drone.guided = "OFFBOARD", False
        vehicle.open()
        assert vehicle.in_command == "shipland"
    with bench("&kind=attitude", engage_timeout_s=0.5) as (vehicle, drone):
        drone.mode = "OFFBOARD"
        with pytest.raises(VehicleError, match=r"switch to GUIDED to hand over \(it is OFFBOARD"):
            vehicle.open()


@pytest.mark.parametrize("mode", ["LOITER", "AUTO.RTL", "GUIDED_NOGPS"])
def test_a_pilots_mode_that_mavros_calls_guided_is_a_takeover(mode: str) -> None:
    """An ArduPilot sets MAV_MODE_FLAG_GUIDED_ENABLED in LOITER, BRAKE and RTL, a PX4 in every AUTO."""
    with bench(engage_timeout_s=1.0) as (vehicle, drone):
        drone.mode = mode
        with pytest.raises(VehicleError, match=f"it is {mode}"):
            vehicle.open()
    with flying() as (vehicle, drone):
        drone.mode = mode
        assert until(lambda: bool(vehicle.end_reason))
        assert vehicle.end_reason == f"the pilot took over: {mode}"


def test_a_vehicle_that_is_given_after_the_machine_was_suspended_is_sent_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with bench(take=False) as (vehicle, drone):
        vehicle.connect()
        drone.mode = "POSCTL"

        def sleeps_and_is_given() -> None:
            time.sleep(0.5)
            for module in (pace, link_vehicle):
                monkeypatch.setattr(module, "boot_s", lambda: time.monotonic() + 30.0)
            drone.mode = "GUIDED"

        asleep = threading.Thread(target=sleeps_and_is_given)
        asleep.start()
        with pytest.raises(VehicleError, match="this machine was suspended for 30 s since it connected"):
            vehicle.open()
        asleep.join()
        assert not drone.holds_s


@pytest.mark.parametrize("how", ["taken over", "closed"])
def test_motors_may_no_longer_stop_once_it_is_not_ours(how: str) -> None:
    with flying(intent=Intent.LAND) as (vehicle, drone):
        assert until(lambda: drone.landing)
        if how == "closed":
            vehicle.close()
        else:
            drone.mode = "POSCTL"
        assert until(lambda: not drone.landing)


def test_odometry_that_comes_late_is_old_and_another_clocks_is_not() -> None:
    """Nor does it take the place of a newer one that has come before it."""
    told = Telemetry(0.0, 0.0, 0.0, 0.0, 5.0, np.zeros(3), None, None, flying=True)
    synchronised, foreign = Heard("velocity"), Heard("velocity")
    synchronised.take_odometry(odometry_of(told, time.time() - 0.1))
    for heard, height_m, age_s in ((synchronised, 5.0, 0.1), (foreign, 9.0, 0.0)):
        heard.take_odometry(odometry_of(replace(told, height_m=9.0), time.time() - 1.5))
        newest = heard.telemetry_at(0.0)
        assert newest.height_m == pytest.approx(height_m)
        assert time.monotonic() - newest.velocity_t_s == pytest.approx(age_s, abs=0.05)
    ages_s = [time.monotonic() - true_s for true_s, *_ in synchronised._attitudes]
    assert ages_s == pytest.approx([0.1, 1.5], abs=0.05)


@pytest.mark.parametrize("stamp_s", [0.0, 1e9])
def test_a_mount_of_another_clock_is_believed_beside_odometry_of_ours(stamp_s: float) -> None:
    told = Telemetry(0.0, 0.0, 0.0, 0.0, 5.0, np.zeros(3), None, None, flying=True)
    heard = Heard("velocity")
    heard.take_odometry(odometry_of(told, time.time()))
    heard.take_gimbal(gimbal_message(GimbalAttitude(0.0, -0.2), stamp_s))
    _, age_s = heard.gimbal_at(time.monotonic(), None)
    assert age_s == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("fixed_pitch_rad", [None, 0.0])
def test_the_cameras_attitude_is_that_of_its_exposure_in_whatever_order_readings_come(
    fixed_pitch_rad: float | None,
) -> None:
    heard, now_s = Heard("velocity"), time.time()
    for age_s, pitch_rad in ((0.10, 0.1), (0.02, 0.1), (0.20, -1.0)):
        told = Telemetry(0.0, 0.0, pitch_rad, 0.0, 5.0, np.zeros(3), None, None, flying=True)
        heard.take_gimbal(gimbal_message(GimbalAttitude(0.0, pitch_rad), now_s - age_s))
        heard.take_odometry(odometry_of(told, now_s - age_s))
    at, _ = heard.gimbal_at(time.monotonic() - (time.time() - now_s) - 0.06, fixed_pitch_rad)
    assert at.pitch_rad == pytest.approx(0.1)


def test_a_camera_that_looks_aside_says_so() -> None:
    heard = Heard("velocity")
    heard.take_gimbal(gimbal_message(GimbalAttitude(0.1, -0.2, 0.5), time.time()))
    at, _ = heard.gimbal_at(time.monotonic(), None)
    assert (at.roll_rad, at.pitch_rad, at.yaw_rad) == pytest.approx((0.1, -0.2, 0.5))


@pytest.mark.parametrize("latched", [True, False])
def test_what_was_latched_before_we_came_is_heard_and_what_is_sent_live_too(latched: bool) -> None:
    domain, came = own_domain(), list[Any]()
    with closing(Node(domain, local=True)) as sender, closing(Node(domain, local=True)) as hearer:
        info = sender.publisher("drone/camera/camera_info", "sensor_msgs/msg/CameraInfo", latched=latched)
        if latched:
            info.send(camera_info(CAMERA, time.time(), "camera"))
        hearer.subscribe("drone/camera/camera_info", "sensor_msgs/msg/CameraInfo", came.append, latched=True)
        if not latched:
            assert until(lambda: info.heard)
            info.send(camera_info(CAMERA, time.time(), "camera"))
        assert until(lambda: came)


def test_a_drone_that_never_obeys_is_said_to() -> None:
    with bench(engage_timeout_s=0.3) as (vehicle, drone):
        drone.armed = False
        with pytest.raises(VehicleError, match=r"not given to us .arm the vehicle, and take off. within 0\.3 s"):
            vehicle.open()


@pytest.mark.parametrize(("intent", "words"), [(Intent.LAND, "landed: "), (Intent.FLY, "")])
def test_motors_that_stop_have_landed_where_a_landing_was_flown(intent: Intent, words: str) -> None:
    with flying(intent=intent) as (vehicle, drone):
        assert until(lambda: drone.landing is (intent is Intent.LAND))
        assert drone.mount is not None
        drone.armed = False
        assert until(lambda: bool(vehicle.end_reason))
        assert vehicle.end_reason == f"{words}the motors have stopped"


def test_a_landing_high_over_the_deck_lets_no_motors_stop() -> None:
    with flying(intent=Intent.LAND) as (vehicle, drone):
        assert until(lambda: drone.landing)
        vehicle.send(command(Intent.LAND, low=False))
        assert until(lambda: not drone.landing)
        assert drone.wanted.forward > 0.0  # it is flown on


def test_without_new_commands_it_holds() -> None:
    with flying(stale_s=0.2) as (_, drone):
        assert until(lambda: drone.wanted.hold)


@pytest.mark.parametrize("kind", ["velocity", "attitude"])
def test_closing_leaves_it_holding(kind: str) -> None:
    with flying(f"&kind={kind}") as (vehicle, drone):
        vehicle.close()
        assert until(lambda: drone.wanted.hold)


@pytest.mark.parametrize("kind", ["velocity", "attitude"])
def test_a_flight_that_has_ended_by_itself_leaves_it_holding(kind: str) -> None:
    """It is closed before the next turn of the set-points."""
    with bench(f"&kind={kind}", video_timeout_s=0.5, setpoint_hz=5.0) as (vehicle, drone):
        vehicle.open()
        drone.frozen = True
        while vehicle.read() is not None:
            vehicle.send(command(Intent.LAND))
        assert vehicle.end_reason.startswith("video lost")
        closing_s = time.time()
        vehicle.close()
        assert until(lambda: drone.wanted.hold)
        # more than once: a listener of two topics may take the attitude that left before it later
        assert until(lambda: sum(t_s > closing_s for t_s in drone.holds_s) >= 2)


@pytest.mark.parametrize("intent", [Intent.FLY, Intent.LAND])
def test_an_autopilot_that_the_bridge_has_lost_has_not_landed(intent: Intent) -> None:
    """Mavros then says once: not connected, not armed, no mode."""
    with flying(intent=intent) as (vehicle, drone):
        drone.connected = drone.armed = drone.guided = False
        drone.mode = ""
        assert until(lambda: bool(vehicle.end_reason))
        assert vehicle.end_reason == "link lost: the vehicle's bridge has lost the autopilot"


@pytest.mark.parametrize("kind", ["velocity", "attitude"])
def test_a_landing_is_asked_for_and_ended_by_a_topic(kind: str) -> None:
    """Called off, the vehicle holds, while the flight is open and after it."""
    with bench(f"&wait=1&kind={kind}", take=False) as (vehicle, drone):
        land = drone.node.publisher("shipland/land", "std_msgs/msg/Bool")
        vehicle.connect()
        call(land, vehicle)
        vehicle.open()
        vehicle.send(PilotCommand(time.monotonic(), 20.0, 0.0, 0.0, 0.0, -0.2, Intent.FLY))
        assert until(lambda: drone.wanted.forward > 0.0)
        ask(land, wanted=False)
        assert until(lambda: vehicle.end_reason == "ended by /shipland/land")
        assert until(lambda: drone.wanted.hold)
        held = len(drone.holds_s)
        vehicle.close()
        assert until(lambda: len(drone.holds_s) >= held + 2)
        assert drone.wanted.hold


def test_a_landing_called_off_before_the_hand_over_is_not_flown_until_it_is_called_again() -> None:
    with bench("&wait=1", take=False) as (vehicle, drone):
        drone.mode = "LOITER"
        land = drone.node.publisher("shipland/land", "std_msgs/msg/Bool")
        vehicle.connect()
        call(land, vehicle)
        opening = threading.Thread(target=vehicle.open, daemon=True)
        opening.start()
        assert until(lambda: vehicle._heard._hand_over is not None)
        ask(land, wanted=False)
        assert until(lambda: vehicle._heard.land is False)
        drone.mode = "GUIDED"  # for somebody else
        assert until(lambda: vehicle._heard.mode == "GUIDED")
        opening.join(1.0)
        assert opening.is_alive()
        assert vehicle.in_command == "the pilot (GUIDED)"
        ask(land)
        opening.join(20.0)
        assert vehicle.in_command == "shipland"


def test_a_call_is_answered_where_the_vehicle_was_not_given() -> None:
    with bench("&wait=1", take=False, engage_timeout_s=0.5) as (vehicle, drone):
        drone.armed, told = False, list[str]()
        drone.node.subscribe("shipland/result", "std_msgs/msg/String", lambda result: told.append(result.data))
        land = drone.node.publisher("shipland/land", "std_msgs/msg/Bool")
        vehicle.connect()
        call(land, vehicle)
        assert until(lambda: vehicle._telling._result.heard)
        with pytest.raises(VehicleError, match="was not given to us") as failed:
            vehicle.open()
        assert until(lambda: told == [str(failed.value)])


def test_a_call_is_answered_where_connecting_fails() -> None:
    """By the only word it gets: the node is gone when the vehicle is closed."""
    with bench("&wait=1", take=False, connect_timeout_s=5.0) as (vehicle, drone):
        drone.silent, told = True, list[str]()
        drone.node.subscribe(
            "shipland/result", "std_msgs/msg/String", lambda result: told.append(result.data), reliable=True
        )
        land = drone.node.publisher("shipland/land", "std_msgs/msg/Bool")
        failed = list[str]()

        def connect() -> None:
            try:
                vehicle.connect()
            except VehicleError as error:
                failed.append(str(error))

        connecting = threading.Thread(target=connect, daemon=True)
        connecting.start()
        call(land, vehicle)
        assert until(lambda: vehicle._telling._result.heard)
        connecting.join(20.0)
        assert "camera_info has not come" in failed[0]
        assert until(lambda: told)
        assert told == failed


def test_who_waits_for_no_call_answers_none() -> None:
    """As `shipland publish` beside the flight that was called."""
    with bench() as (vehicle, drone):
        land = drone.node.publisher("shipland/land", "std_msgs/msg/Bool")
        vehicle.connect()
        call(land, vehicle)
        sent: list[object] = []
        vehicle._telling._result.send = sent.append
        vehicle.close()
        assert not sent


CALL = """
import rclpy
from std_srvs.srv import SetBool
rclpy.init()
node = rclpy.create_node("mission")
client = node.create_client(SetBool, "/shipland/land")
assert client.wait_for_service(timeout_sec=30.0)
answer = None
while answer is None or answer.message.startswith("nobody waits"):
    asked = client.call_async(SetBool.Request(data=True))
    rclpy.spin_until_future_complete(node, asked, timeout_sec=30.0)
    answer = asked.result()
print(answer.success, answer.message)
"""


@pytest.mark.skipif("SHIPLAND_RCLPY" not in os.environ, reason="SHIPLAND_RCLPY names no Python with rclpy")
def test_a_landing_is_called_as_a_service() -> None:
    """By a real rclpy, through `examples/ros2_land.py`."""
    rclpy, example = os.environ["SHIPLAND_RCLPY"], Path(__file__).parents[2] / "examples" / "ros2_land.py"
    with bench("&wait=1", take=False) as (vehicle, drone):
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        environment |= {"ROS_DOMAIN_ID": str(drone.domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with (
            subprocess.Popen([rclpy, str(example)], env=environment) as land,
            subprocess.Popen([rclpy, "-c", CALL], env=environment, stdout=subprocess.PIPE, text=True) as call,
        ):
            try:
                vehicle.open()  # waits to be called
                vehicle.send(command(Intent.LAND))
                drone.armed = False
                assert until(lambda: bool(vehicle.end_reason))
                vehicle.close()
                answer = f"{vehicle.end_reason.startswith('landed')} {vehicle.end_reason}\n"
                assert call.communicate(timeout=60.0)[0] == answer
                land.terminate()
                assert land.wait(20.0) == 0
            finally:
                land.kill()
                call.kill()


@pytest.mark.parametrize(
    ("timeout", "what", "reason"),
    [("link_timeout_s", "silent", "link lost"), ("video_timeout_s", "frozen", "video lost: no picture for 0.5 s")],
)
def test_silence_and_pictures_that_stop_end_the_flight(timeout: str, what: str, reason: str) -> None:
    with bench(**{timeout: 0.5}) as (vehicle, drone):
        vehicle.open()
        assert vehicle.read() is not None
        setattr(drone, what, True)
        assert until(lambda: vehicle.read() is None)
        assert vehicle.end_reason.startswith(reason)


def test_pictures_are_not_looked_at_once_camera_info_says_another_lens() -> None:
    """A zoom by two shows the cue at half its distance."""
    with bench(video_timeout_s=1.0) as (vehicle, drone):
        vehicle.open()
        assert vehicle.read() is not None
        drone.camera = Camera.from_fov(CAMERA.width_px, CAMERA.height_px, 30.0)
        assert until(lambda: vehicle.read() is None)
        assert vehicle.end_reason.startswith("video lost: /drone/camera/camera_info is not what it was")


def zoomed(lens: Camera, factor: float) -> Camera:
    focal = np.array([[factor, 1.0, 1.0], [1.0, factor, 1.0], [1.0, 1.0, 1.0]])
    return replace(lens, matrix=lens.matrix * focal)


@pytest.mark.parametrize("distortion", [np.zeros(5), np.array([-0.2, 0.05, 0.001, 0.0, 0.0])])
def test_a_lens_whose_focus_moves_the_digits_is_the_same(distortion: np.ndarray) -> None:
    """What a change does at the picture's edge counts: a wrong principal point, or distortion, too."""
    lens = Camera(CAMERA.width_px, CAMERA.height_px, CAMERA.matrix, distortion)
    assert same_lens(lens, zoomed(lens, 1.003))
    assert not same_lens(lens, zoomed(lens, 1.01))
    assert not same_lens(lens, replace(lens, matrix=lens.matrix + np.array([[0.0, 0.0, 1.0], [0.0] * 3, [0.0] * 3])))
    assert not same_lens(lens, replace(lens, distortion=distortion + np.array([0.1, 0.0, 0.0, 0.0, 0.0])))
    assert not same_lens(lens, lens.scaled(2 * lens.width_px, 2 * lens.height_px))


def test_pictures_are_looked_at_on_where_camera_info_changes_in_its_last_digits() -> None:
    with bench(video_timeout_s=1.0) as (vehicle, drone):
        vehicle.open()
        assert vehicle.read() is not None
        drone.camera = zoomed(CAMERA, 1.002)
        end_s = time.monotonic() + 2.0
        while time.monotonic() < end_s:
            assert vehicle.read() is not None
        assert vehicle.camera.matrix == pytest.approx(CAMERA.matrix)


@pytest.mark.parametrize("kind", ["velocity", "attitude"])
@pytest.mark.parametrize("silent", ["the vehicle", "the autopilot"])
def test_a_vehicle_that_is_heard_no_more_is_left_holding(kind: str, silent: str) -> None:
    """It may still hear."""
    with flying(f"&kind={kind}", link_timeout_s=0.5) as (vehicle, drone):
        if silent == "the vehicle":
            drone.silent = True
        else:
            drone.connected = drone.armed = drone.guided = False
            drone.mode = ""
        assert until(lambda: vehicle.end_reason.startswith("link lost"))
        assert until(lambda: drone.wanted.hold)
        drone.connected = drone.armed = drone.guided = True
        drone.silent, drone.mode = False, "POSCTL"  # and the pilot has it
        assert until(lambda: vehicle._heard.mode == "POSCTL")
        turns = len(vehicle.late_s)
        assert until(lambda: len(vehicle.late_s) > turns + 5)  # what was on its way has come
        held = len(drone.holds_s)
        vehicle.close()
        assert len(drone.holds_s) == held
        assert vehicle.end_reason.startswith("link lost")


def test_the_pilots_takeover_stays_the_reason_whoever_calls_off_the_landing_then() -> None:
    with flying() as (vehicle, drone):
        land = drone.node.publisher("shipland/land", "std_msgs/msg/Bool")
        assert until(lambda: land.heard)
        drone.mode = "POSCTL"
        assert until(lambda: bool(vehicle.end_reason))
        ask(land, wanted=False)
        assert until(lambda: vehicle._heard.land is False)
        turns = len(vehicle.late_s)
        assert until(lambda: len(vehicle.late_s) > turns + 3)
        assert vehicle.end_reason == "the pilot took over: POSCTL"


def test_a_vehicle_that_was_given_and_fell_silent_is_not_taken() -> None:
    heard = Heard("velocity")
    heard.expect(asked=True)
    for state in states(("GUIDED", True)):
        heard.take_state(state)
    assert heard.given
    heard._state_s -= 60.0
    assert not heard.begin(called=False)
    assert heard.hand_over_words == "switch to GUIDED or OFFBOARD to hand over (it is unknown)"


def test_stamps_of_another_clock_are_refused_unless_the_latency_is_stated() -> None:
    refused = pytest.raises(VehicleError, match=r"\+30.*synchronise the clocks")
    with bench(stamp_off_s=-30.0) as (vehicle, _), refused:
        vehicle.connect()
    with bench("&latency_s=0.1", stamp_off_s=-30.0) as (vehicle, _):
        vehicle.open()
        pair = vehicle.read()
        assert pair is not None
        assert pair[0] is not None
        assert 0.05 < pair[1].t_s - pair[0].t_s < 1.0


def test_exposure_is_the_pictures_own_stamp() -> None:
    with bench() as (vehicle, _):
        vehicle.open()
        pair = vehicle.read()
        assert pair is not None
        assert pair[0] is not None
        assert 0.02 <= pair[1].t_s - pair[0].t_s < 0.9  # stamped 20 ms before it left
        assert pair[0].gimbal.pitch_rad == pytest.approx(-0.1)
        assert pair[0].gimbal_age_s < 0.5


def test_others_are_told_what_is_seen_and_decided() -> None:
    with bench() as (vehicle, drone):
        vehicle.open()
        heard: dict[str, list[object]] = {name: [] for name in ("cue_pose", "detections", "diagnostics", "tf")}
        kinds = {
            "cue_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
            "detections": "vision_msgs/msg/Detection2DArray",
            "diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
            "tf": "tf2_msgs/msg/TFMessage",
        }
        for name, kind in kinds.items():
            topic = name if name == "tf" else f"shipland/{name}"
            drone.node.subscribe(topic, kind, heard[name].append)
        pair = vehicle.read()
        assert pair is not None
        assert pair[0] is not None
        vehicle.inform_of(Rig(), np.zeros(3))
        pose = BarPose(np.array([-3.0, 0.0, 0.0]), 0.0, np.eye(4) * 0.01, 0.1, np.zeros((8, 2)))
        box = Box((30.0, 20.0), (8.0, 4.0), 0.8)
        at_s = pair[0].t_s
        seen = Observation(at_s, GimbalAttitude(0.0, -0.1), pose, bar_box=box)
        record = FlightRecord(pair[0], pair[1], seen, Decision(command(), Mode.APPROACH, "seen"), None)

        def told() -> bool:
            vehicle.inform(record)
            return all(heard.values())

        assert until(told)
        status = heard["diagnostics"][-1].status[0]  # type: ignore[attr-defined]
        assert status.message == "APPROACH: seen"
        stamp = heard["cue_pose"][-1].header.stamp  # type: ignore[attr-defined]
        exposed_s = time.time() - (time.monotonic() - at_s)
        assert stamp.sec + 1e-9 * stamp.nanosec == pytest.approx(exposed_s, abs=0.05)
        edge = heard["tf"][-1].transforms[0]  # type: ignore[attr-defined]
        assert (edge.header.frame_id, edge.child_frame_id) == ("camera_optical", "cue")


def test_the_result_is_kept_for_those_who_come_later() -> None:
    with bench() as (vehicle, drone):
        vehicle.open()
        got: list[str] = []
        drone.node.subscribe("shipland/result", "std_msgs/msg/String", lambda told: got.append(told.data))
        publisher = vehicle._telling._result
        assert until(lambda: publisher.heard)
        vehicle.close()
        assert until(lambda: bool(got))
        assert got[-1] == "the flight was ended here; the vehicle holds"


def test_a_closed_node_tells_nobody_who_comes_later_what_it_had_told() -> None:
    from cyclonedds.sub import DataReader

    domain, kind = own_domain(), "std_msgs/msg/String"
    one, other = Node(domain, local=True), Node(domain, local=True)

    def listener() -> Callable[[], list[str]]:
        """Takes what has come since."""
        reader = DataReader(other._participant, other._topic("x", kind)[0], _quality(kind, reliable=True, latched=True))
        return lambda: [message_of(sample.cdr, kind).data for sample in reader.take(8) if hasattr(sample, "cdr")]

    try:
        told = one.publisher("x", kind, latched=True)
        told.send(message(kind, data="landed"))
        early = listener()
        assert until(lambda: early() == ["landed"])
        one.close()
        told.send(message(kind, data="too late"))
        assert told.left_out == 1
        assert not told.heard
        other.publisher("x", kind, latched=True).send(message(kind, data="another"))
        late = listener()
        assert until(lambda: bool(early()))
        assert until(lambda: bool(got := late()) and got == ["another"])
    finally:
        one.close()
        other.close()


def test_a_closed_node_is_not_found_listening() -> None:
    """`examples/ros2_land.py` answers a call by whether anybody listens."""
    domain, kind = own_domain(), "std_msgs/msg/Bool"
    with closing(Node(domain, local=True)) as other, closing(Node(domain, local=True)) as node:
        node.subscribe("shipland/land", kind, lambda _: None, reliable=True)
        land = other.publisher("shipland/land", kind)
        assert until(lambda: land.heard)
        node.close()
        assert until(lambda: not land.heard)


def test_looking_without_flying_commands_nothing() -> None:
    with bench() as (vehicle, drone):
        vehicle.connect()
        frame = vehicle.look(5.0)
        assert isinstance(frame, Frame)
        vehicle.tell(Observation(frame.t_s, frame.gimbal, reason="no green"))
        assert drone.wanted.hold
        assert vehicle.read() is None


def test_messages_that_are_none_are_counted_and_said_and_the_next_is_heard(caplog: pytest.LogCaptureFixture) -> None:
    domain, got = own_domain(), list[float]()

    def take(told: Any) -> None:
        if math.isnan(told.data):
            raise ValueError("no number")
        got.append(told.data)

    with closing(Node(domain, local=True)) as one, closing(Node(domain, local=True)) as other:
        other.subscribe("x", "std_msgs/msg/Float64", take)
        out = one.publisher("x", "std_msgs/msg/Float64")
        assert until(lambda: out.heard)
        out.send(message("std_msgs/msg/Float64", data=math.nan))
        out.send(message("std_msgs/msg/Float64", data=2.0))
        assert until(lambda: got == [2.0])
        assert other.malformed == 1
        assert "a message was not taken: std_msgs/msg/Float64" in caplog.text
        assert "no number" in caplog.text


@pytest.mark.slow
@pytest.mark.flaky(reruns=2, reruns_delay=2)
def test_a_landing_is_flown_through_the_topics(tmp_path: Path) -> None:
    """Our simulator at the other end, in a process of its own, in real time; vision without pictures."""
    port, domain = free_port(socket.SOCK_STREAM), own_domain()
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    example = Path(__file__).parents[2] / "examples" / "ros2-simulated.toml"
    shipland = [sys.executable, "-m", "shipland"]
    served = [*shipland, "serve-physics", "--interface", "ros2", "--frames-port", str(port), "--seed", "3"]
    flown = [
        *shipland, "fly", "--vehicle", f"ros2://drone?take=1&camera=frames:127.0.0.1:{port}", "--vision", "geometric",
        "--vehicle-config", str(example), "--no-video", "--out", str(tmp_path),
    ]  # fmt: skip
    with subprocess.Popen([*served, "--set", "aircraft.loop.kind=velocity"], env=environment) as server:
        try:
            assert subprocess.run(flown, env=environment, timeout=300, check=False).returncode == 0
            assert server.wait(30.0) == 0
        finally:
            server.kill()
