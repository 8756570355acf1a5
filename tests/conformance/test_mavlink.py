"""What a MAVLink vehicle does when link, video, process, autopilot or pilot do not do what they should."""

import math
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink")

from mavlink_bench import Blank, StandIn, bench, setup_for

from interrupts import receive
from ports import free_port
from shipland import stopping
from shipland.errors import VehicleError
from shipland.messages import BarPose, Decision, FlightRecord, Intent, Observation, Override, PilotCommand
from shipland.rig import Rig
from shipland.stopping import stop_requests
from shipland.vehicles import link_vehicle, pace
from shipland.vehicles.checks import Check
from shipland.vehicles.mavlink import taking
from shipland.vehicles.mavlink.checks import gimbal_check
from shipland.vehicles.mavlink.dialect import Codec, dialect
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.setup import Engagement
from shipland.vehicles.mavlink.state import AutopilotState
from shipland.vehicles.mavlink.vehicle import MavlinkVehicle
from waiting import until

pytestmark = pytest.mark.flaky(reruns=2, reruns_delay=2)
"""They fly in real time: other tests beside them can keep the machine from it, not three times."""


def fly(
    vehicle: MavlinkVehicle, seconds: float, *sticks: float, intent: Intent = Intent.FLY, low: bool = False
) -> bool:
    """Cycles with the same sticks, at contact height or not; whether the vehicle still gives frames."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        pair = vehicle.read()
        if pair is None:
            return False
        vehicle.send(PilotCommand(pair[1].t_s, *sticks, -0.2, intent, low))
    return True


FORWARD, DOWN, STILL = (20.0, 0.0, 0.0, 0.0), (0.0, 0.0, -40.0, 0.0), (0.0, 0.0, 0.0, 0.0)
"""Sticks of `fly`."""


@contextmanager
def opened(kind: str = "ardupilot", **options: Any) -> Iterator[tuple[MavlinkVehicle, StandIn, Blank]]:
    """A bench whose vehicle was opened."""
    with bench(kind, **options) as (vehicle, autopilot, camera):
        vehicle.open()
        yield vehicle, autopilot, camera


@contextmanager
def flying_forward(kind: str = "ardupilot", **options: Any) -> Iterator[tuple[MavlinkVehicle, StandIn, Blank]]:
    """A bench whose vehicle was opened and has flown forward for half a second."""
    with opened(kind, **options) as (vehicle, autopilot, camera):
        assert fly(vehicle, 0.5, *FORWARD)
        yield vehicle, autopilot, camera


def line(vehicle: MavlinkVehicle, name: str) -> Check:
    """The line of that name in the checklist."""
    return {check.name: check for check in vehicle.checks()}[name]


SET_POINTS = ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED")
POSITION = {"ardupilot": (5, "LOITER"), "px4": (3 << 16, "POSITION")}
"""A mode that a pilot flies, and its name."""
GUIDED = {"ardupilot": 4, "px4": 6 << 16}
HOLDS = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}
"""BRAKE; AUTO, HOLD."""
OWN_LANDING = {"ardupilot": 9, "px4": 4 << 16 | 9 << 24}


def set_points(autopilot: StandIn) -> int:
    counts = autopilot.report()["counts"]
    return sum(counts.get(name, 0) for name in SET_POINTS)


def commands(autopilot: StandIn, number: int) -> list[list[float]]:
    return [command for command in autopilot.report()["commands"] if command[0] == number]


@contextmanager
def opening(vehicle: MavlinkVehicle) -> Iterator[Callable[[], str]]:
    """The vehicle's `open`, at work; what it gives waits for its end and says why it failed, empty where it did not."""
    said: list[str] = []

    def run() -> None:
        try:
            vehicle.open()
        except VehicleError as error:
            said.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()

    def ended() -> str:
        thread.join(20.0)
        assert not thread.is_alive()
        return "".join(said)

    yield ended
    thread.join()


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_takeover_in_our_own_take_off_ends_the_flight(kind: str) -> None:
    mode, name = POSITION[kind]
    with bench(kind, engagement=Engagement(take_off_m=40.0)) as (vehicle, autopilot, _), opening(vehicle) as ended:
        until(lambda: autopilot.report()["up"] > 10.5)
        autopilot.say(f"mode {mode}")
        assert ended() == f"the pilot took over: {name}"
        assert vehicle.end_reason == f"the pilot took over: {name}"
        before = set_points(autopilot)
        assert vehicle.read() is None
        vehicle.send(PilotCommand(time.monotonic(), 0.0, 0.0, -60.0, 0.0, 0.0, Intent.LAND, True))
        autopilot.say("deck")  # they land by hand
        time.sleep(0.5)
        assert set_points(autopilot) == before
        assert commands(autopilot, 400) == []
        assert autopilot.report()["mode"] == mode


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_interrupted_in_its_own_take_off_it_holds(kind: str) -> None:
    with bench(kind, engagement=Engagement(take_off_m=40.0)) as (vehicle, autopilot, _), opening(vehicle) as ended:
        until(lambda: autopilot.report()["up"] > 10.5)
        vehicle.close()
        assert "ended here" in ended()
        report = autopilot.report()
        assert (report["mode"], report["target"]) == (HOLDS[kind], "hold")
        assert vehicle.in_command == "the autopilot"


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_no_motor_is_stopped_and_nothing_pressed_in_the_pilots_mode(kind: str) -> None:
    mode, name = POSITION[kind]
    with opened(kind) as (vehicle, autopilot, _):
        assert fly(vehicle, 0.5, *DOWN, intent=Intent.LAND, low=True)
        assert vehicle.in_command == "shipland"
        autopilot.say(f"mode {mode}")
        until(lambda: vehicle.in_command == f"the pilot ({name})")
        before = set_points(autopilot)
        autopilot.say("deck")
        for _ in range(40):
            vehicle.send(PilotCommand(time.monotonic(), 0.0, 0.0, -40.0, 0.0, 0.0, Intent.LAND, True))
            time.sleep(0.03)
        autopilot.say(f"mode {GUIDED[kind]}")  # ours again, but it was taken
        until(lambda: vehicle.in_command == f"nobody: the pilot took over: {name}")
        time.sleep(0.5)
        assert set_points(autopilot) == before
        assert commands(autopilot, 400) == []


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_guided_mode_that_was_set_already_is_not_a_hand_over(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    mode, _ = POSITION[kind]
    with bench(kind, engagement=Engagement()) as (vehicle, autopilot, _), opening(vehicle) as ended:
        until(lambda: "switch out of it and back to hand over" in caplog.text)
        time.sleep(0.3)
        assert set_points(autopilot) == 0
        assert "is not handed over" in vehicle.in_command
        autopilot.say(f"mode {mode}")
        until(lambda: "the pilot" in vehicle.in_command)
        autopilot.say(f"mode {GUIDED[kind]}")
        assert ended() == ""
        assert fly(vehicle, 0.5, *STILL)
        assert vehicle.in_command == "shipland"
        assert commands(autopilot, 176) == []


def test_a_hand_over_that_does_not_come_says_what_to_do() -> None:
    said = pytest.raises(VehicleError, match="GUIDED already: switch out of it and back")
    with bench(engagement=Engagement(), engage_timeout_s=0.5) as (vehicle, _, _), said:
        vehicle.open()


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (lambda _, autopilot: autopilot.say("silent 60"), "link lost: no heartbeat for 1 s"),
        (lambda vehicle, _: vehicle.session.link.port._process.kill(), "guard process of the link has ended"),
        (lambda _, autopilot: autopilot.say("set GUID_OPTIONS 8"), "GUID_OPTIONS from 0 to 8"),
    ],
    ids=("silence", "guard", "parameter"),
)
def test_what_ends_a_flight_ends_the_wait_for_the_hand_over(
    end: Callable[[MavlinkVehicle, StandIn], None], words: str
) -> None:
    with bench(engagement=Engagement(), link_timeout_s=1.0) as (vehicle, autopilot, _):
        autopilot.say("mode 5")
        vehicle.connect()
        with opening(vehicle) as ended:
            assert until(lambda: vehicle._opening)
            end(vehicle, autopilot)
            assert words in ended()
        assert set_points(autopilot) == 0


def test_a_mode_without_a_velocity_loop_is_no_start_for_speeds() -> None:
    port = free_port(socket.SOCK_DGRAM)
    autopilot = StandIn(port, "ardupilot")
    vehicle = MavlinkVehicle(setup_for(port, Blank(), None, Engagement(), {"kind": "velocity"}))
    try:
        for mode, fit in ((20, False), (4, True)):
            autopilot.say(f"mode {mode}")
            vehicle.connect()
            assert until(lambda mode=mode: vehicle.session.state.mode == mode)
            found = line(vehicle, "autopilot")
            assert (found.ok, "hand over in GUIDED" in found.words) == (fit, not fit)
    finally:
        vehicle.close()
        autopilot.close()


def test_a_pilot_who_chooses_a_mode_while_we_ask_is_not_overruled() -> None:
    with bench("px4") as (vehicle, autopilot, _):
        autopilot.say(f"mode {3 << 16}")
        autopilot.say("deaf 1000")
        with opening(vehicle) as ended:
            until(lambda: autopilot.report()["counts"].get("COMMAND_LONG", 0) > 0 and vehicle._control.asking)
            autopilot.say(f"mode {2 << 16}")
            assert ended() == "the pilot took over: ALTITUDE"


def test_an_updraft_at_height_neither_presses_nor_stops_the_motors() -> None:
    """Throttle at 0.59 of hover at a constant sink reads as standing."""
    with opened() as (vehicle, autopilot, _):
        assert fly(vehicle, 0.3, *DOWN, intent=Intent.LAND)
        autopilot.say("updraft")
        for _ in range(3):
            assert fly(vehicle, 0.5, *DOWN, intent=Intent.LAND)
            assert autopilot.report()["values"][3] == pytest.approx(-0.4, abs=1e-3)  # the pilot's, not 1.5 m/s
        assert commands(autopilot, 400) == []
        assert not fly(vehicle, 6.0, *DOWN, intent=Intent.LAND, low=True)  # it was seen as standing
        assert len(commands(autopilot, 400)) >= 1


@pytest.mark.parametrize(("enabled", "throttle_us"), [(0, 900), (1, 960)])
def test_a_receiver_in_failsafe_has_not_moved_the_sticks(enabled: int, throttle_us: int) -> None:
    """Below its own FS_THR_VALUE an ArduPilot returns or lands; a mode for a pilot's sticks would take that away."""
    with bench() as (vehicle, autopilot, _):
        autopilot.say(f"set FS_THR_ENABLE {enabled}")
        autopilot.say("set FS_THR_VALUE 975")
        vehicle.open()
        assert fly(vehicle, 0.3, *FORWARD)
        autopilot.say(f"sticks 1500 1500 {throttle_us} 1500")
        assert fly(vehicle, 1.0, *FORWARD)
        assert vehicle.telemetry_at(time.monotonic()).alerts == "the receiver is in failsafe"
        assert line(vehicle, "transmitter").ok is False
        assert commands(autopilot, 176)[1:] == []  # but for our own GUIDED
        autopilot.say("sticks 1500 1500 1500 1500")
        assert fly(vehicle, 0.5, *FORWARD)
        assert vehicle.telemetry_at(time.monotonic()).alerts == ""
        autopilot.say("sticks 1700")
        assert not fly(vehicle, 3.0, *FORWARD)
        assert vehicle.end_reason == "the pilot moved the sticks"


@pytest.mark.parametrize("sticks", ["2110", "1500 890", "1500 1500 2110"])
def test_a_stick_at_the_end_of_a_long_travel_takes_over(sticks: str) -> None:
    """Transmitters reach beyond a receiver's usual 950 to 2050 µs, and a stick is there within a tenth of a second."""
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say(f"sticks {sticks}")
        assert not fly(vehicle, 3.0, *FORWARD)
        assert vehicle.end_reason == "the pilot moved the sticks"


@pytest.mark.parametrize(("kind", "name"), [("ardupilot", "RCMAP_ROLL"), ("px4", "RC_MAP_ROLL")])
def test_sticks_are_where_the_autopilot_has_them(kind: str, name: str) -> None:
    with bench(kind) as (vehicle, autopilot, _):
        autopilot.say(f"set {name} 6")
        autopilot.say("sticks 1100 1500 1500 1500 1500 1500")
        vehicle.open()
        assert fly(vehicle, 0.3, *FORWARD)
        autopilot.say("sticks 1900")  # a knob
        assert fly(vehicle, 0.5, *FORWARD)
        autopilot.say("sticks 1900 1500 1500 1500 1500 1700")
        assert not fly(vehicle, 3.0, *FORWARD)
        assert vehicle.end_reason == "the pilot moved the sticks"


def test_a_pilot_at_the_sticks_gets_a_mode_that_obeys_them_though_requests_are_lost() -> None:
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say("deaf 4")
        autopilot.say("sticks 1500 1700")
        assert not fly(vehicle, 3.0, *FORWARD)
        vehicle.close()  # as the loop does at once
        assert autopilot.report()["mode"] == 2
        assert vehicle.in_command in ("the pilot (ALT_HOLD)", "nobody: the pilot moved the sticks")


@pytest.mark.parametrize(("denied", "mode"), [("5", 2), ("5 2", 17)])
def test_a_pilot_at_the_sticks_is_not_left_in_our_mode_where_modes_are_refused(denied: str, mode: int) -> None:
    """LOITER without a position, ALT_HOLD without a barometer; the flight ends at once, the requests go on."""
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say(f"deny {denied}")
        autopilot.say("sticks 1500 1700")
        assert not fly(vehicle, 3.0, *FORWARD)
        vehicle.close()
        assert autopilot.report()["mode"] == mode
        modes = [str(int(command[2])) for command in commands(autopilot, dialect.MAV_CMD_DO_SET_MODE)]
        assert [modes.count(refused) for refused in denied.split()] == [1] * len(denied.split())  # the next one at once


def test_a_vehicle_that_obeys_no_sticks_holds_when_they_are_moved() -> None:
    """A PX4 with COM_RC_IN_MODE = 4 tells of its transmitter and refuses every mode that obeys it."""
    with bench("px4") as (vehicle, autopilot, _):
        autopilot.say("set COM_RC_IN_MODE 4")
        autopilot.say("deny 2 3")
        vehicle.open()
        assert fly(vehicle, 0.3, *FORWARD)
        autopilot.say("sticks 1500 1700")
        assert not fly(vehicle, 3.0, *FORWARD)
        vehicle.close()
        assert autopilot.report()["mode"] == HOLDS["px4"]


def test_where_the_throttle_stick_belongs_is_said_in_the_air_and_on_the_ground() -> None:
    """An ArduPilot refuses to arm with it in the middle."""
    with bench() as (vehicle, autopilot, _):
        vehicle.connect()
        assert until(lambda: line(vehicle, "transmitter").words == "heard, throttle stick at 1500 µs")
        autopilot.say("sticks 1500 1500 1000 1500")
        assert until(lambda: "put it in the middle, or taking over" in line(vehicle, "transmitter").words)
        assert vehicle.session.command(400, 0, 21196)
        assert until(lambda: "arms with it at the bottom only" in line(vehicle, "transmitter").words)


def test_without_a_transmitter_it_is_said_before_take_off(caplog: pytest.LogCaptureFixture) -> None:
    with bench() as (vehicle, autopilot, _):
        autopilot.say("sticks")
        vehicle.connect()
        found = line(vehicle, "transmitter")
        assert found.ok
        assert "no transmitter is heard" in found.words
        vehicle.open()
        assert "no transmitter is heard" in caplog.text


def test_what_the_vehicle_says_is_wrong_stands_in_the_telemetry_until_it_is_not() -> None:
    with opened() as (vehicle, autopilot, _):
        autopilot.say("sick")
        until(lambda: vehicle.telemetry_at(time.monotonic()).alerts == "not healthy: 3d gyro")
        found = line(vehicle, "health")
        assert (found.ok, found.words) == (False, "not healthy: 3d gyro")
        autopilot.say("well")
        until(lambda: vehicle.telemetry_at(time.monotonic()).alerts == "")


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_change_of_mode_is_seen_at_once(kind: str) -> None:
    """A PX4 refuses a rate for its heartbeat."""
    with bench(kind) as (vehicle, _, _):
        vehicle.connect()
        assert until(lambda: "a takeover by mode is seen late" not in line(vehicle, "messages").words)


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_required_parameter_that_is_not_told_is_not_assumed(kind: str) -> None:
    name = {"ardupilot": "GUID_OPTIONS", "px4": "MPC_TILTMAX_AIR"}[kind]
    with bench(kind) as (vehicle, autopilot, _):
        autopilot.say(f"lose {name}")
        with pytest.raises(VehicleError, match=f"does not tell {name}"):
            vehicle.connect()


@pytest.mark.parametrize(("kind", "name"), [("ardupilot", "GUID_TIMEOUT"), ("px4", "COM_OBL_RC_ACT")])
def test_when_it_holds_by_itself_is_not_assumed(kind: str, name: str) -> None:
    with bench(kind) as (vehicle, autopilot, _):
        autopilot.say(f"lose {name}")
        vehicle.connect()
        found = line(vehicle, "own hold")
        assert not found.ok
        assert name in found.words


@pytest.mark.parametrize(
    ("kind", "settings", "lines"),
    [
        (
            "px4",
            {"COM_OBL_RC_ACT": 4, "GF_ACTION": 4, "NAV_RCL_ACT": 6, "NAV_DLL_ACT": 5},
            {
                "own hold": "it lands then",
                "geofence": "stops the motors in the air",
                "failsafes": "NAV_RCL_ACT is 6, NAV_DLL_ACT is 5: stops the motors in the air",
            },
        ),
        (
            "px4",
            {"COM_OBL_RC_ACT": 7, "GF_ACTION": 1},
            {"own hold": "it stops its motors then", "geofence": "only warns"},
        ),
        ("ardupilot", {"FENCE_ACTION": 0}, {"geofence": "only reports"}),
    ],
)
def test_a_failsafe_that_does_not_keep_it_flying_is_no_start(
    kind: str, settings: dict[str, int], lines: dict[str, str]
) -> None:
    with bench(kind) as (vehicle, autopilot, _):
        for name, value in settings.items():
            autopilot.say(f"set {name} {value}")
        vehicle.connect()
        for name, words in lines.items():
            found = line(vehicle, name)
            assert not found.ok
            assert words in found.words


@pytest.mark.parametrize(("sticks", "mode"), [("sticks", 3), ("", 4)])
def test_a_px4_that_waits_for_sticks_without_set_points_is_no_start_without_them(sticks: str, mode: int) -> None:
    """Its failsafe is none then: it flies the last set-point on."""
    with bench("px4") as (vehicle, autopilot, _):
        autopilot.say(f"set COM_RC_IN_MODE {mode}")
        autopilot.say(sticks)
        vehicle.connect()
        assert until(lambda: "WARNING" in line(vehicle, "transmitter").words)
        found = line(vehicle, "own hold")
        assert (found.ok, "set COM_OBL_RC_ACT to 5" in found.words) == (False, True)


def test_a_hold_is_a_fit_failsafe_and_a_fence_without_a_size_is_not_called_on() -> None:
    """A PX4 as delivered has an action, and nothing that it is for."""
    with bench("px4") as (vehicle, autopilot, _):
        autopilot.say("set COM_OBL_RC_ACT 5")
        autopilot.say("set GF_MAX_HOR_DIST 0")
        vehicle.connect()
        assert line(vehicle, "own hold").ok
        assert line(vehicle, "failsafes").ok
        fence = line(vehicle, "geofence")
        assert (fence.ok, "WARNING" in fence.words) == (True, True)


def test_a_check_fails_for_what_has_stopped() -> None:
    with bench() as (vehicle, autopilot, camera):
        vehicle.connect()
        names = ("telemetry", "pictures")
        lines = lambda: {check.name: check.ok for check in vehicle.checks()}  # noqa: E731
        until(lambda: all(lines()[name] for name in names))
        camera.frozen = True
        autopilot.say("silent 60")
        until(lambda: not any(lines()[name] for name in names))


def test_the_gimbal_is_asked_for_again_where_that_is_lost_and_a_refusal_is_said() -> None:
    number = dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
    for word, asked, words in (("miss", 2, "and is ours"), ("refuse", 1, "WARNING: it is not ours to turn (MAV_RES")):
        with bench() as (vehicle, autopilot, _):
            autopilot.say(f"{word} {number}")
            vehicle.connect()
            assert len(commands(autopilot, number)) == asked
            found = gimbal_check(replace(vehicle.session.state, gimbal_t_s=time.monotonic()))
            assert found.ok
            assert words in found.words


@pytest.mark.parametrize("taken", [False, True])
def test_the_gimbal_is_given_back(taken: bool) -> None:
    """A ground station's requests to turn it would be refused for good: to whoever has it now, we are in control."""
    with opened() as (vehicle, autopilot, _):
        if taken:
            autopilot.say("mode 5")
            assert not fly(vehicle, 3.0, *STILL)
        vehicle.close()
        assert until(
            lambda: commands(autopilot, dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE)[-1][1:] == [-3.0, -3.0], 3.0
        )


@pytest.mark.parametrize(
    ("withheld", "words", "others"),
    [
        ("LOCAL_POSITION_NED", "no touchdown is seen", "a takeover"),
        ("RC_CHANNELS", "a takeover by stick is seen late", "no touchdown"),
    ],
)
def test_a_message_that_comes_too_seldom_is_missed_for_what_it_tells(withheld: str, words: str, others: str) -> None:
    """An ArduPilot without an origin sends no LOCAL_POSITION_NED, and a request for a rate may be lost."""
    with bench() as (vehicle, autopilot, _):
        vehicle.connect()
        assert until(lambda: "WARNING" not in line(vehicle, "messages").words)
        autopilot.say(f"withhold {withheld}")
        assert until(lambda: f"{withheld} 0 Hz" in line(vehicle, "messages").words)
        assert words in line(vehicle, "messages").words
        assert others not in line(vehicle, "messages").words


def test_the_pictures_age_is_not_called_measured_where_it_was_stated() -> None:
    with bench() as (vehicle, _, _):
        vehicle.connect()
        assert "measured; at most" in line(vehicle, "picture's age").words
        vehicle._setup = replace(vehicle._setup, latency_s=0.1)
        words = line(vehicle, "picture's age").words
        assert "0.100 s stated, not measured" in words
        assert "0.000 s behind the quickest picture, measured" in words


def test_sticks_become_tilt_climb_and_heading() -> None:
    with opened() as (vehicle, autopilot, _):
        assert math.degrees(vehicle.response().max_tilt_rad) == pytest.approx(15.0)
        assert fly(vehicle, 0.6, 50.0, -20.0, -40.0, 0.0)
        report = autopilot.report()
        assert report["target"] == "tilt"
        roll, pitch, _, climb = report["values"]
        assert math.degrees(roll) == pytest.approx(-3.0, abs=0.01)
        assert math.degrees(pitch) == pytest.approx(-7.5, abs=0.01)
        assert climb == pytest.approx(-0.4, abs=1e-3)
        assert report["refusals"] == 0


def test_a_px4_gets_set_points_before_offboard_and_velocities_only() -> None:
    with bench("px4", engagement=Engagement(take=True)) as (vehicle, autopilot, _):
        autopilot.say(f"mode {3 << 16}")
        assert autopilot.report()["mode"] == 3 << 16
        vehicle.open()
        assert vehicle.response().kind == "velocity"
        assert fly(vehicle, 0.5, 50.0, 0.0, 0.0, 25.0)
        report = autopilot.report()
        assert report["target"] == "speed"
        assert report["values"] == pytest.approx([2.0, 0.0, 0.0, math.radians(10.0)], abs=1e-4)
        assert report["mode"] == 6 << 16


def test_a_px4_takes_off_in_offboard() -> None:
    """Its own take-off is a mode of its own, which would leave OFFBOARD."""
    with bench("px4", engagement=Engagement(take_off_m=11.5)) as (vehicle, autopilot, _):
        autopilot.say(f"mode {3 << 16}")
        vehicle.open()
        report = autopilot.report()
        assert report["mode"] == 6 << 16
        assert report["up"] == pytest.approx(11.0, abs=0.8)  # from 10 m, a tenth off is near enough
        assert 22 not in {int(command[0]) for command in report["commands"]}
        assert fly(vehicle, 0.5, *STILL)
        assert autopilot.report()["values"][2] == 0.0


def test_a_high_take_off_has_the_time_of_its_climb(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(taking, "_TAKE_OFF_S", 1.0)
    with bench("px4", engagement=Engagement(take_off_m=12.0), max_climb_mps=0.3) as (vehicle, autopilot, _):
        vehicle.open()  # from 10 m
        assert autopilot.report()["up"] > 10.7


def test_a_take_off_whose_answer_is_lost_goes_on() -> None:
    """An ArduPilot that climbs denies a second one."""
    with bench(engagement=Engagement(take_off_m=12.0)) as (vehicle, autopilot, _):
        autopilot.say("swallow 22")
        vehicle.open()
        assert autopilot.report()["up"] > 10.7  # from 10 m


def test_nothing_is_taken_or_armed_unasked() -> None:
    with bench(engagement=Engagement(), engage_timeout_s=1.0) as (vehicle, autopilot, _):
        autopilot.say("mode 5")
        assert autopilot.report()["mode"] == 5
        time.sleep(0.3)  # a heartbeat with the mode before may be on its way
        with pytest.raises(VehicleError, match="mode was not given"):
            vehicle.open()
        numbers = {int(command[0]) for command in autopilot.report()["commands"]}
        assert not numbers & {400, 176, 22}


def test_stale_commands_become_a_hold() -> None:
    with flying_forward(stale_s=0.4) as (vehicle, autopilot, _):
        assert autopilot.report()["target"] == "tilt"
        time.sleep(0.8)  # the process stalls, its set-points do not
        report = autopilot.report()
        assert report["target"] == "speed"
        assert report["values"] == [0.0, 0.0, 0.0, 0.0]
        assert report["age_s"] < 0.1
        assert fly(vehicle, 0.5, *FORWARD)
        assert autopilot.report()["target"] == "tilt"


@pytest.mark.parametrize("ended", [False, True])
def test_lost_video_leaves_telemetry_and_ends_the_flight_in_time(ended: bool) -> None:
    with flying_forward(stale_s=0.4, video_timeout_s=1.0) as (vehicle, autopilot, camera):
        camera.frozen, camera.closed = True, ended
        dark = []
        while (pair := vehicle.read()) is not None:
            vehicle.send(PilotCommand(pair[1].t_s, 0.0, 60.0, 0.0, 0.0, -0.2))
            if pair[0] is None:
                dark.append(pair[1])
                if len(dark) == 2:
                    report = autopilot.report()
                    assert report["target"] == "tilt"
                    assert math.degrees(report["values"][0]) == pytest.approx(9.0, abs=0.01)
        assert 3 <= len(dark) <= 7  # a cycle every 0.2 s, for a second
        attitude_s = [telemetry.attitude_t_s for telemetry in dark if telemetry.attitude_t_s is not None]
        assert attitude_s[-1] > attitude_s[0]
        assert "video lost" in vehicle.end_reason
        time.sleep(0.2)
        report = autopilot.report()
        assert (report["target"], report["values"], report["mode"]) == ("speed", [0.0, 0.0, 0.0, 0.0], 4)


def test_a_picture_that_stands_still_is_none() -> None:
    with opened(video_timeout_s=1.0) as (vehicle, _, camera):
        camera.picture = np.full((36, 64, 3), 90, np.uint8)
        pictures, end_s = [], time.monotonic() + 10.0
        while (pair := vehicle.read()) is not None and time.monotonic() < end_s:
            pictures += [pair[0]] if pair[0] is not None and pair[0].image is not None else []
            vehicle.send(PilotCommand(pair[1].t_s, 0.0, 0.0, 0.0, 0.0, -0.2, Intent.FLY))
        assert len(pictures) == 1
        assert vehicle.end_reason == "video lost: no picture for 1 s; the vehicle holds"


def test_a_lost_link_ends_the_flight_and_the_vehicle_holds_by_itself() -> None:
    with flying_forward(link_timeout_s=1.5) as (vehicle, autopilot, _):
        autopilot.say("silent 60")
        assert not fly(vehicle, 4.0, *FORWARD)
        assert "link lost" in vehicle.end_reason


@pytest.mark.parametrize(("mute_s", "mode"), [(60, GUIDED["ardupilot"]), (1.5, HOLDS["ardupilot"])])
def test_a_vehicle_that_is_not_heard_any_more_is_left_holding(mute_s: float, mode: int) -> None:
    """It may still hear: an ArduPilot flies the last tilt until GUID_TIMEOUT, and then drifts with the wind."""
    with flying_forward(link_timeout_s=1.0) as (vehicle, autopilot, _):
        autopilot.say(f"mute {mute_s}")
        assert not fly(vehicle, 4.0, *FORWARD)
        assert "link lost" in vehicle.end_reason
        vehicle.close()
        report = autopilot.report()
        assert (report["mode"], report["target"] == "tilt") == (mode, False)


@pytest.mark.parametrize(("words", "mode", "reason"), [("mode 5", 5, "LOITER"), ("sticks 1700", 5, "sticks")])
def test_whoever_takes_the_vehicle_keeps_it(words: str, mode: int, reason: str) -> None:
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say(words)
        assert not fly(vehicle, 3.0, *FORWARD)
        assert reason in vehicle.end_reason
        time.sleep(0.3)
        before = set_points(autopilot)
        vehicle.send(PilotCommand(time.monotonic(), 80.0, 0.0, 0.0, 0.0, 0.0))
        time.sleep(0.5)
        assert set_points(autopilot) == before
        assert autopilot.report()["mode"] == mode


def restart(_: MavlinkVehicle, autopilot: StandIn) -> None:
    autopilot.say("reboot")


def stray_disarmed_heartbeat(vehicle: MavlinkVehicle, _: StandIn, mode: int | None = None) -> None:
    """As of a second vehicle with the same id; the vehicle's own come ten times a second."""
    link, state = vehicle.session.link, vehicle.session.state
    beat = dialect.MAVLink_heartbeat_message(2, state.autopilot, 1, state.mode if mode is None else mode, 4, 3)
    link.take(Codec(1, 1).encode(beat), link._peer, time.monotonic())


def stray_heartbeat_of_a_spare(vehicle: MavlinkVehicle, autopilot: StandIn) -> None:
    """STABILIZE, or a PX4's mode without a name: it stands on the deck, and was switched on just now."""
    stray_disarmed_heartbeat(vehicle, autopilot, 0)


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
@pytest.mark.parametrize(
    ("happens", "reason"),
    [
        (restart, "restarted"),
        *((stray, "motors have stopped") for stray in (stray_disarmed_heartbeat, stray_heartbeat_of_a_spare)),
    ],
)
def test_a_vehicle_that_flies_on_in_our_mode_is_left_holding_whatever_ended_the_flight(
    kind: str, happens: Callable[[MavlinkVehicle, StandIn], None], reason: str
) -> None:
    """Nobody has taken it: it would fly the last tilt until its own timeout, and then drift where sticks are dead."""
    with flying_forward(kind) as (vehicle, autopilot, _):
        happens(vehicle, autopilot)
        assert not fly(vehicle, 3.0, *FORWARD)
        assert reason in vehicle.end_reason
        vehicle.close()  # as the loop does at once
        report = autopilot.report()
        assert (report["mode"], report["target"]) == (HOLDS[kind], "hold")


def test_a_vehicle_that_flies_tilts_alone_is_left_level() -> None:
    """GUIDED_NOGPS flies no velocity of zero, and BRAKE is denied there; no other set-point need leave by then."""
    with bench(engagement=Engagement()) as (vehicle, autopilot, _), opening(vehicle) as ended:
        autopilot.say("mode 5")
        until(lambda: vehicle._opening and "LOITER" in vehicle.in_command)
        autopilot.say("mode 20")
        assert ended() == ""
        assert fly(vehicle, 0.5, *FORWARD)
        assert vehicle._pace is not None
        vehicle._pace.stop()
        tilted = autopilot.report()
        autopilot.say("deny 17")
        vehicle.close()
        level = autopilot.report()
        pitches_deg = [math.degrees(each["values"][1]) for each in (tilted, level)]
        assert pitches_deg == pytest.approx([-3.0, 0.0], abs=0.01)


@pytest.mark.parametrize("next_mode", [None, 5])
def test_a_vehicle_whose_motors_have_stopped_is_sent_nothing(next_mode: int | None) -> None:
    """Nor is a person at its sticks asked into another mode."""
    with flying_forward() as (vehicle, autopilot, _):
        vehicle.session.command(400, 0, 21196)
        assert not fly(vehicle, 3.0, *FORWARD)
        assert vehicle.end_reason == "the motors have stopped"
        assert until(lambda: not vehicle.session.state.armed)
        before, modes = set_points(autopilot), commands(autopilot, 176)
        autopilot.say("sticks 1500 1900" if next_mode is None else f"mode {next_mode}")
        time.sleep(0.5)
        vehicle.close()
        assert (set_points(autopilot), commands(autopilot, 176)) == (before, modes)
        assert autopilot.report()["mode"] == (next_mode or 4)


def test_touchdown_on_a_moving_deck_stops_the_motors_by_force() -> None:
    with opened() as (vehicle, autopilot, _):
        assert fly(vehicle, 1.0, *DOWN, intent=Intent.LAND, low=True)
        assert autopilot.report()["armed"]  # low throttle alone is no touchdown: it has just begun to sink
        autopilot.say("deck")
        assert not fly(vehicle, 8.0, *DOWN, intent=Intent.LAND, low=True)
        assert vehicle.end_reason.startswith("landed")
        disarms = commands(autopilot, 400)
        assert disarms[:2] == [[400, 0.0, 0.0], [400, 0.0, 21196.0]]  # by force as soon as it was denied


def test_on_a_link_that_lags_no_motor_is_stopped_in_the_pilots_hands() -> None:
    """The touch that seems new is two seconds old: the pilot has taken over and lifted off since."""
    with opened() as (vehicle, autopilot, _):
        assert fly(vehicle, 1.0, *DOWN, intent=Intent.LAND, low=True)
        autopilot.say("lag 2")
        autopilot.say("deck")
        assert fly(vehicle, 1.9, *DOWN, intent=Intent.LAND, low=True)
        autopilot.say("mode 5")
        seen, end_s = "", time.monotonic() + 8.0
        while (pair := vehicle.read()) is not None and time.monotonic() < end_s:
            seen = seen or pair[1].alerts
            vehicle.send(PilotCommand(pair[1].t_s, 0.0, 0.0, -40.0, 0.0, -0.2, Intent.LAND, at_contact_height=True))
        assert "LOITER" in vehicle.end_reason
        assert autopilot.report()["armed"]
        assert not commands(autopilot, 400)
        assert "no answer" in seen


OWN = Engagement(take=True, own_landing=True)


@contextmanager
def landing_by_itself(kind: str = "ardupilot") -> Iterator[tuple[MavlinkVehicle, StandIn]]:
    """In the autopilot's own landing."""
    with opened(kind, engagement=OWN) as (vehicle, autopilot, _):
        assert fly(vehicle, 1.0, *DOWN, intent=Intent.LAND)
        assert autopilot.report()["mode"] == OWN_LANDING[kind]
        yield vehicle, autopilot


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_where_the_autopilot_is_to_land_it_does_once_the_pilot_would(kind: str) -> None:
    with opened(kind, engagement=OWN) as (vehicle, autopilot, _):
        assert fly(vehicle, 0.5, *STILL)
        assert vehicle.in_command == "shipland"
        assert fly(vehicle, 1.0, *DOWN, intent=Intent.LAND)
        assert autopilot.report()["mode"] == OWN_LANDING[kind]
        pose = BarPose(np.array([-3.0, 0.0, -1.0]), 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2)))
        frame, telemetry = vehicle.read() or (None, None)
        assert frame is not None
        assert telemetry is not None
        vehicle.inform_of(Rig(), np.zeros(3))
        decision = Decision(PilotCommand.hold(frame.t_s, 0.0), None, "")
        vehicle.inform(FlightRecord(frame, telemetry, Observation(frame.t_s, frame.gimbal, pose), decision, None))
        until(lambda: autopilot.report()["counts"].get("LANDING_TARGET") == 1)
        before, turned = set_points(autopilot), autopilot.report()["counts"]["GIMBAL_MANAGER_SET_PITCHYAW"]
        assert fly(vehicle, 1.0, 0.0, 0.0, 100.0, 0.0, intent=Intent.GO_AROUND)  # it is the autopilot's for good
        assert vehicle.in_command == "the autopilot"
        assert set_points(autopilot) == before
        assert autopilot.report()["counts"]["GIMBAL_MANAGER_SET_PITCHYAW"] > turned  # the camera follows the cue
        vehicle.session.command(400, 0, 21196)
        assert not fly(vehicle, 3.0, *STILL)
        assert vehicle.end_reason.startswith("landed")


def test_an_own_landing_that_is_given_while_the_thread_that_asked_waits_is_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """For the interpreter, which vision may hold: taken for a person's, it went on without being told of the deck."""
    with opened(engagement=OWN) as (vehicle, _, _):
        command = Session.command

        def delayed(session: Session, number: int, *parameters: float) -> bool:
            sent = command(session, number, *parameters)
            if sent and parameters[1:2] == (OWN_LANDING["ardupilot"],):
                until(lambda: session.state.mode == OWN_LANDING["ardupilot"])
            return sent

        monkeypatch.setattr(Session, "command", delayed)
        assert fly(vehicle, 1.5, *DOWN, intent=Intent.LAND), vehicle.end_reason
        assert vehicle.in_command == "the autopilot"


@pytest.mark.parametrize("intent", [Intent.LAND, Intent.GO_AROUND])
def test_a_persons_landing_is_not_taken_for_one_that_was_denied(intent: Intent) -> None:
    with opened(engagement=OWN) as (vehicle, autopilot, _):
        autopilot.say("deny 9")
        assert fly(vehicle, 1.0, *DOWN, intent=Intent.LAND)
        assert vehicle.in_command == "shipland"
        assert fly(vehicle, 0.5, 0.0, 0.0, 40.0, 0.0, intent=intent)
        before = set_points(autopilot)
        autopilot.say("mode 9")
        assert not fly(vehicle, 3.0, *STILL, intent=intent)
        assert "took over: LAND" in vehicle.end_reason
        given = set_points(autopilot)
        assert given <= before + 6  # 50 a second, until one of ten heartbeats a second tells the mode
        time.sleep(0.5)
        assert set_points(autopilot) == given


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_an_own_landing_that_is_given_when_it_is_not_wanted_any_more_ends_in_a_hold(kind: str) -> None:
    """Granted, and not told yet, when the pilot goes around: it would land where it is, perhaps in the sea."""
    with opened(kind, engagement=OWN) as (vehicle, autopilot, _):
        autopilot.say("lag 0.6")
        assert fly(vehicle, 2.0, *STILL)
        assert fly(vehicle, 0.3, *DOWN, intent=Intent.LAND)
        assert autopilot.report()["mode"] == OWN_LANDING[kind]
        assert not fly(vehicle, 4.0, 0.0, 0.0, 50.0, 0.0, intent=Intent.GO_AROUND)
        assert "not wanted any more" in vehicle.end_reason
        vehicle.close()
        assert autopilot.report()["mode"] == HOLDS[kind]


def test_on_a_link_that_lags_our_end_takes_no_mode_from_a_person() -> None:
    """The heartbeat that shows our mode is two seconds old."""
    with opened() as (vehicle, autopilot, _):
        autopilot.say("lag 2")
        assert fly(vehicle, 3.5, *FORWARD)
        autopilot.say("mode 5")
        assert until(lambda: autopilot.report()["mode"] == 5)
        vehicle.close()
        assert autopilot.report()["mode"] == 5


def test_a_heartbeat_of_another_program_as_component_1_is_not_the_autopilots() -> None:
    with opened() as (vehicle, _, _):
        link = vehicle.session.link
        for kind in (dialect.MAV_AUTOPILOT_INVALID, dialect.MAV_AUTOPILOT_GENERIC):
            beat = dialect.MAVLink_heartbeat_message(18, kind, 0, 0, 4, 3)
            link.take(Codec(1, 1).encode(beat), link._peer, time.monotonic())
        assert fly(vehicle, 0.5, *FORWARD), vehicle.end_reason


def test_a_message_that_another_ground_station_stops_is_asked_for_again() -> None:
    """An ArduPilot's rates are a link's: REQUEST_DATA_STREAM from whoever shares it sets them all anew."""
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say("halt RC_CHANNELS")
        autopilot.say("sticks 1500 1700")
        assert not fly(vehicle, 10.0, *FORWARD)
        assert vehicle.end_reason == "the pilot moved the sticks"


def test_a_pilots_mode_ends_the_autopilots_own_landing_too() -> None:
    with landing_by_itself() as (vehicle, autopilot):
        autopilot.say("mode 5")
        assert not fly(vehicle, 3.0, *STILL)
        assert "LOITER" in vehicle.end_reason


def test_a_stop_in_the_autopilots_own_landing_holds() -> None:
    """Without us nobody tells it where the deck is: it would land where it is."""
    with landing_by_itself() as (vehicle, autopilot):
        vehicle.close()
        assert autopilot.report()["mode"] == 17


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
@pytest.mark.parametrize("override", Override)
def test_a_persons_key_ends_the_autopilots_own_landing_in_a_hold(kind: str, override: Override) -> None:
    with landing_by_itself(kind) as (vehicle, autopilot):
        frame, telemetry = vehicle.read() or (None, None)
        assert frame is not None
        assert telemetry is not None
        vehicle.inform_of(Rig(), np.zeros(3))
        decision = Decision(PilotCommand.hold(frame.t_s, 0.0), None, f"{override.value}; too low to climb")
        vehicle.inform(FlightRecord(frame, telemetry, Observation(frame.t_s, frame.gimbal, None), decision, None))
        assert vehicle.read() is None
        assert override.value in vehicle.end_reason
        vehicle.close()
        assert autopilot.report()["mode"] == HOLDS[kind]


def test_a_pilot_at_the_sticks_has_the_autopilots_own_landing_and_keeps_the_mode_chosen_next() -> None:
    with landing_by_itself() as (vehicle, autopilot):
        autopilot.say("sticks 1500 1700")
        assert until(lambda: autopilot.report()["mode"] == 5)
        assert until(lambda: bool(vehicle.end_reason))
        assert "sticks" in vehicle.end_reason
        for mode in (9, 4):  # the pilot lands; the pilot gives it to somebody else
            time.sleep(0.3)
            autopilot.say(f"mode {mode}")
            time.sleep(1.2)
            assert autopilot.report()["mode"] == mode


def test_the_autopilots_own_landing_is_not_asked_for_in_a_mode_that_a_person_chose_unheard() -> None:
    with opened(engagement=OWN) as (vehicle, autopilot, _):
        assert fly(vehicle, 0.5, *STILL)
        autopilot.say("mute 1.2")
        time.sleep(0.4)
        autopilot.say("mode 5")
        assert not fly(vehicle, 5.0, *DOWN, intent=Intent.LAND)
        assert "took over: LOITER" in vehicle.end_reason
        assert autopilot.report()["mode"] == 5


def test_a_pilot_at_the_sticks_has_it_alone_after_a_flight_that_has_ended() -> None:
    """Nor does the guard of the link hold then."""
    with opened(video_timeout_s=0.5) as (vehicle, autopilot, camera):
        camera.frozen = True
        assert until(lambda: vehicle.read() is None)
        autopilot.say("deaf 100")
        autopilot.say("sticks 1500 1700")
        assert until(lambda: vehicle.in_command.startswith("nobody"))
        time.sleep(0.2)
        before = set_points(autopilot)
        time.sleep(1.0)
        assert set_points(autopilot) == before


def test_a_mode_that_a_person_chose_unheard_is_not_taken_away_by_our_end() -> None:
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say("mute 10")
        time.sleep(0.5)
        autopilot.say("mode 5")
        assert autopilot.report()["mode"] == 5
        vehicle.close()
        assert autopilot.report()["mode"] == 5


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_machine_that_is_suspended_while_it_waits_for_the_hand_over_does_not_take_it(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who has the vehicle when it wakes is not known."""
    with bench(kind, engagement=Engagement()) as (vehicle, autopilot, _):
        autopilot.say(f"mode {POSITION[kind][0]}")
        vehicle.connect()
        with opening(vehicle) as ended:
            assert until(lambda: POSITION[kind][1] in vehicle.in_command)
            for module in (pace, link_vehicle):
                monkeypatch.setattr(module, "boot_s", lambda: time.monotonic() + 30.0)
            assert "this machine was suspended for 30 s" in ended()
        autopilot.say(f"mode {GUIDED[kind]}")
        assert until(lambda: autopilot.report()["mode"] == GUIDED[kind])
        vehicle.close()
        assert autopilot.report()["mode"] == GUIDED[kind]


@pytest.mark.parametrize(("mode", "left"), [(4, 17), (5, 5)])
def test_no_mode_is_asked_for_before_a_heartbeat_after_the_machine_was_suspended(
    mode: int, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with flying_forward() as (vehicle, autopilot, _):
        autopilot.say("mute 0.2")
        autopilot.say(f"mode {mode}")
        for module in (pace, link_vehicle):
            monkeypatch.setattr(module, "boot_s", lambda: time.monotonic() + 30.0)
        assert not fly(vehicle, 3.0, *FORWARD)
        vehicle.close()
        assert autopilot.report()["mode"] == left


def test_a_parameter_that_changes_what_sticks_mean_ends_the_flight_in_a_hold() -> None:
    """With GUID_OPTIONS = 8 the thrust that asks for a descent is a thrust far below the weight."""
    with opened() as (vehicle, autopilot, _):
        assert fly(vehicle, 0.5, 20.0, 0.0, -50.0, 0.0)
        autopilot.say("set WPNAV_SPEED 600")  # no stick means it
        autopilot.say("set MOT_THST_HOVER 0.4")  # it learns that by itself
        assert fly(vehicle, 0.5, 20.0, 0.0, -50.0, 0.0)
        autopilot.say("set GUID_OPTIONS 8")
        assert until(lambda: autopilot.report()["values"] == [0.0, 0.0, 0.0, 0.0])
        assert vehicle.read() is None
        assert "GUID_OPTIONS from 0 to 8" in vehicle.end_reason
        vehicle.close()
        assert autopilot.report()["mode"] == 17


def test_a_second_vehicle_and_a_second_shipland_are_no_start() -> None:
    """A ground station is no other, nor is a vehicle of another system where ours is stated."""
    with bench() as (vehicle, _, _):
        vehicle.connect()

        def hear(system: int, component: int) -> None:
            beat = dialect.MAVLink_heartbeat_message(2, 3 if component == 1 else 8, 129, 4, 4, 3)
            vehicle.session.link.take(Codec(system, component).encode(beat), "elsewhere:1", time.monotonic())

        def others() -> dict[str, str]:
            return {it.name: it.words for it in vehicle.checks() if it.name.startswith("one ") and not it.ok}

        hear(255, 190)
        assert not others()
        hear(7, 1)
        assert "system 7" in others()["one vehicle"]
        vehicle._setup = replace(vehicle._setup, vehicle=1)
        assert not others()
        hear(245, 191)
        assert "as system 245" in others()["one shipland"]
        hear(1, 1)
        for stated in (1, None):
            vehicle._setup = replace(vehicle._setup, vehicle=stated)
            assert "from two addresses" in others()["one vehicle"]


def test_a_second_vehicle_with_the_same_system_id_is_no_start() -> None:
    with bench() as (vehicle, _, _):
        vehicle.connect()
        link = vehicle.session.link
        for boot_ms in range(10**6, 10**6 + 60, 20):  # one alone may be stamped wrongly
            attitude = dialect.MAVLink_attitude_message(boot_ms, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            link.take(Codec(1, 1).encode(attitude), link._peer, time.monotonic())
        until(lambda: vehicle.session.state.clock.restarts)
        (check,) = [check for check in vehicle.checks() if check.name == "one vehicle"]
        assert not check.ok


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_closed_in_flight_it_leaves_the_vehicle_in_a_mode_that_holds(kind: str) -> None:
    with flying_forward(kind) as (vehicle, autopilot, _):
        vehicle.close()
        report = autopilot.report()
        assert (report["mode"], report["target"]) == (HOLDS[kind], "hold")
        assert report["armed"]


@contextmanager
def interrupted_above(autopilot: StandIn, height_m: float) -> Iterator[None]:
    """A Ctrl-C as soon as the vehicle is that high, within the block and never after it."""
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.05):
            if autopilot.report()["up"] >= height_m:
                receive(signal.SIGINT)
                return

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_stop_in_take_off_is_answered_at_once_and_leaves_a_hold(kind: str) -> None:
    with bench(kind, engagement=Engagement(take_off_m=40.0)) as (vehicle, autopilot, _):
        with pytest.raises(KeyboardInterrupt), stop_requests(), interrupted_above(autopilot, 10.5):  # it starts at 10 m
            vehicle.open()
        report = autopilot.report()
        assert (report["mode"], report["target"]) == (HOLDS[kind], "hold")
        assert report["armed"]
        assert report["up"] < 16.0  # at 1 and 2 m/s: a stop that waits for the take-off's end comes at 36 m


def test_a_second_ctrl_c_does_not_cut_the_hold_short(monkeypatch: pytest.MonkeyPatch) -> None:
    ask_hold = Session.ask_hold

    def interrupted(session: Session, is_ours: Callable[[AutopilotState], bool]) -> None:
        for _ in range(2):
            receive(signal.SIGINT)
        ask_hold(session, is_ours)

    monkeypatch.setattr(stopping, "_GRACE_S", -1.0)
    monkeypatch.setattr(Session, "ask_hold", interrupted)
    with bench(engagement=Engagement(take_off_m=40.0)) as (vehicle, autopilot, _):
        with pytest.raises(KeyboardInterrupt), stop_requests(), interrupted_above(autopilot, 10.2):
            vehicle.open()
        assert autopilot.report()["mode"] == HOLDS["ardupilot"]


def test_a_stop_while_we_wait_for_the_operator_is_answered_at_once() -> None:
    with bench(engage_timeout_s=20.0) as (vehicle, autopilot, _):
        autopilot.say("mode 5")
        vehicle.connect()
        assert autopilot.report()["mode"] == 5
        time.sleep(0.3)  # a heartbeat with the mode before may be on its way
        begun_s = time.monotonic()
        with pytest.raises(KeyboardInterrupt), stop_requests():
            receive(signal.SIGINT)
            vehicle.open()
        assert time.monotonic() - begun_s < 15.0
        assert autopilot.report()["mode"] == 5  # never ours


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_after_a_touch_the_descent_goes_on_whatever_the_pilot_does(kind: str) -> None:
    with opened(kind) as (vehicle, autopilot, _):
        assert fly(vehicle, 1.0, 0.0, 0.0, -80.0, 0.0, intent=Intent.LAND)
        autopilot.say("deck")
        assert fly(vehicle, 0.3, 0.0, 0.0, -80.0, 0.0, intent=Intent.LAND, low=True)  # too short to tell that it stands
        assert not fly(vehicle, 4.0, 100.0, -100.0, 20.0, 0.0, intent=Intent.LAND, low=True)
        assert vehicle.end_reason.startswith("landed")


def test_the_motors_are_not_stopped_while_not_landing() -> None:
    with opened() as (vehicle, autopilot, _):
        autopilot.say("deck")
        assert fly(vehicle, 2.5, *DOWN, low=True)
        assert not commands(autopilot, 400)


def test_signed_links_refuse_the_unsigned() -> None:
    key = bytes(range(32))
    with opened(key=key) as (vehicle, autopilot, _):
        assert fly(vehicle, 0.5, 40.0, 0.0, 0.0, 0.0)
        assert autopilot.report()["target"] == "tilt"
    with bench(key=key, other_key=None, connect_timeout_s=1.5) as (vehicle, _, _):
        with pytest.raises(VehicleError, match=r"no heartbeat.*check the baud rate, and the signing key"):
            vehicle.open()
        assert vehicle.session.link.counts.malformed > 0


def test_set_points_keep_their_pace() -> None:
    with opened() as (vehicle, _, _):
        assert fly(vehicle, 1.5, *FORWARD)
        late = sorted(vehicle.late_s)
        assert 50 <= len(late) <= 200  # 50 Hz since opening; how late: tools/set_point_pace.py


def test_the_checklist_finds_what_is_not_in_order() -> None:
    with bench() as (vehicle, _, _):
        vehicle.connect()
        wanted = {"battery", "geofence", "telemetry", "round trip", "pictures"}
        until(lambda: wanted <= {check.name for check in vehicle.checks() if check.ok})
