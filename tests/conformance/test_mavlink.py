"""What a MAVLink vehicle does when link, video, process, autopilot or pilot do not do what they should."""

import math
import os
import signal
import threading
import time

import pytest

pytest.importorskip("pymavlink")

from mavlink_bench import StandIn, bench

from shipland import stopping
from shipland.errors import VehicleError
from shipland.messages import Intent, PilotCommand
from shipland.stopping import stop_requests
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.setup import Engagement
from shipland.vehicles.mavlink.vehicle import MavlinkVehicle

pytestmark = pytest.mark.flaky(reruns=2, reruns_delay=2)
"""They fly in real time: other tests beside them can keep the machine from it, not three times."""


def fly(vehicle: MavlinkVehicle, seconds: float, *sticks: float, intent: Intent = Intent.FLY) -> bool:
    """Cycles with the same sticks; whether the vehicle still gives frames."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        pair = vehicle.read()
        if pair is None:
            return False
        vehicle.send(PilotCommand(pair[1].t_s, *sticks, -0.2, intent))
    return True


def test_sticks_become_tilt_climb_and_heading() -> None:
    with bench() as (vehicle, autopilot, _):
        vehicle.open()
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
        assert fly(vehicle, 0.5, 0.0, 0.0, 0.0, 0.0)
        assert autopilot.report()["values"][2] == 0.0


def test_nothing_is_taken_or_armed_unasked() -> None:
    with bench(engage_timeout_s=1.0) as (vehicle, autopilot, _):
        autopilot.say("mode 5")
        assert autopilot.report()["mode"] == 5
        time.sleep(0.3)  # a heartbeat with the mode before may be on its way
        with pytest.raises(VehicleError, match="mode was not given"):
            vehicle.open()
        numbers = {int(command[0]) for command in autopilot.report()["commands"]}
        assert not numbers & {400, 176, 22}


def test_stale_commands_become_a_hold() -> None:
    with bench(stale_s=0.4) as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        assert autopilot.report()["target"] == "tilt"
        time.sleep(0.8)  # the process stalls, its set-points do not
        report = autopilot.report()
        assert report["target"] == "speed"
        assert report["values"] == [0.0, 0.0, 0.0, 0.0]
        assert report["age_s"] < 0.1
        assert fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        assert autopilot.report()["target"] == "tilt"


@pytest.mark.parametrize("ended", [False, True])
def test_lost_video_leaves_telemetry_and_ends_the_flight_in_time(ended: bool) -> None:
    with bench(stale_s=0.4, video_timeout_s=1.0) as (vehicle, autopilot, camera):
        vehicle.open()
        assert fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
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


def test_a_lost_link_ends_the_flight_and_the_vehicle_holds_by_itself() -> None:
    with bench(link_timeout_s=1.5) as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        autopilot.say("silent 60")
        assert not fly(vehicle, 4.0, 60.0, 0.0, 0.0, 0.0)
        assert "link lost" in vehicle.end_reason


@pytest.mark.parametrize(
    ("words", "reason"), [("mode 5", "LOITER"), ("sticks 1700", "sticks"), ("reboot", "restarted")]
)
def test_whoever_takes_the_vehicle_keeps_it(words: str, reason: str) -> None:
    with bench() as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        autopilot.say(words)
        assert not fly(vehicle, 3.0, 60.0, 0.0, 0.0, 0.0)
        assert reason in vehicle.end_reason
        time.sleep(0.3)
        before = autopilot.report()["counts"]
        vehicle.send(PilotCommand(time.monotonic(), 80.0, 0.0, 0.0, 0.0, 0.0))
        time.sleep(0.5)
        after = autopilot.report()["counts"]
        for name in ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED"):
            assert after.get(name, 0) == before.get(name, 0)
        assert autopilot.report()["mode"] == (5 if words.startswith(("mode", "sticks")) else 4)


def test_touchdown_on_a_moving_deck_stops_the_motors_by_force() -> None:
    with bench() as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 1.0, 0.0, 0.0, -40.0, 0.0, intent=Intent.LAND)
        assert autopilot.report()["armed"]  # low throttle alone is no touchdown: it has just begun to sink
        autopilot.say("deck")
        assert not fly(vehicle, 8.0, 0.0, 0.0, -40.0, 0.0, intent=Intent.LAND)
        assert vehicle.end_reason.startswith("landed")
        disarms = [command for command in autopilot.report()["commands"] if command[0] == 400]
        assert disarms[:2] == [[400, 0.0, 0.0], [400, 0.0, 21196.0]]  # by force as soon as it was denied


@pytest.mark.parametrize(("kind", "mode"), [("ardupilot", 17), ("px4", 4 << 16 | 3 << 24)])
def test_closed_in_flight_it_leaves_the_vehicle_in_a_mode_that_holds(kind: str, mode: int) -> None:
    with bench(kind) as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        vehicle.close()
        report = autopilot.report()
        assert (report["mode"], report["target"]) == (mode, "hold")
        assert report["armed"]


def interrupted_above(autopilot: StandIn, height_m: float) -> threading.Thread:
    """A Ctrl-C as soon as the vehicle is that high."""

    def watch() -> None:
        while autopilot.report()["up"] < height_m:
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


HOLDS = {"ardupilot": 17, "px4": 4 << 16 | 3 << 24}
"""BRAKE; AUTO, HOLD."""


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_a_stop_in_take_off_is_answered_at_once_and_leaves_a_hold(kind: str) -> None:
    with bench(kind, engagement=Engagement(take_off_m=40.0)) as (vehicle, autopilot, _):
        watching = interrupted_above(autopilot, 10.5)  # it starts at 10 m
        with pytest.raises(KeyboardInterrupt), stop_requests():
            vehicle.open()
        watching.join()
        report = autopilot.report()
        assert (report["mode"], report["target"]) == (HOLDS[kind], "hold")
        assert report["armed"]
        assert report["up"] < 16.0  # at 1 and 2 m/s: a stop that waits for the take-off's end comes at 36 m


def test_a_second_ctrl_c_does_not_cut_the_hold_short(monkeypatch: pytest.MonkeyPatch) -> None:
    ask_hold = Session.ask_hold

    def interrupted(session: Session) -> int:
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
        return ask_hold(session)

    monkeypatch.setattr(stopping, "_GRACE_S", -1.0)
    monkeypatch.setattr(Session, "ask_hold", interrupted)
    with bench(engagement=Engagement(take_off_m=40.0)) as (vehicle, autopilot, _):
        watching = interrupted_above(autopilot, 10.2)
        with pytest.raises(KeyboardInterrupt), stop_requests():
            vehicle.open()
        watching.join()
        assert autopilot.report()["mode"] == HOLDS["ardupilot"]


def test_a_stop_while_we_wait_for_the_operator_is_answered_at_once() -> None:
    with bench(engage_timeout_s=20.0) as (vehicle, autopilot, _):
        autopilot.say("mode 5")
        vehicle.connect()
        assert autopilot.report()["mode"] == 5
        time.sleep(1.1)  # a heartbeat with the mode before may be on its way
        begun_s = time.monotonic()
        with pytest.raises(KeyboardInterrupt), stop_requests():
            signal.raise_signal(signal.SIGINT)
            vehicle.open()
        assert time.monotonic() - begun_s < 15.0
        assert autopilot.report()["mode"] == 5  # never ours


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_after_a_touch_the_descent_goes_on_whatever_the_pilot_does(kind: str) -> None:
    with bench(kind) as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 1.0, 0.0, 0.0, -80.0, 0.0, intent=Intent.LAND)
        autopilot.say("deck")
        assert fly(vehicle, 0.3, 0.0, 0.0, -80.0, 0.0, intent=Intent.LAND)  # too short to tell that it stands
        assert not fly(vehicle, 4.0, 100.0, -100.0, 20.0, 0.0, intent=Intent.LAND)
        assert vehicle.end_reason.startswith("landed")


def test_the_motors_are_not_stopped_while_not_landing() -> None:
    with bench() as (vehicle, autopilot, _):
        vehicle.open()
        autopilot.say("deck")
        assert fly(vehicle, 2.5, 0.0, 0.0, -40.0, 0.0)
        assert not [command for command in autopilot.report()["commands"] if command[0] == 400]


def test_signed_links_refuse_the_unsigned() -> None:
    key = bytes(range(32))
    with bench(key=key) as (vehicle, autopilot, _):
        vehicle.open()
        assert fly(vehicle, 0.5, 40.0, 0.0, 0.0, 0.0)
        assert autopilot.report()["target"] == "tilt"
    with bench(key=key, other_key=None, connect_timeout_s=1.5) as (vehicle, _, _):
        with pytest.raises(VehicleError, match="no heartbeat"):
            vehicle.open()
        assert vehicle.session.link.counts.malformed > 0


def test_set_points_keep_their_pace() -> None:
    with bench() as (vehicle, _, _):
        vehicle.open()
        assert fly(vehicle, 1.5, 10.0, 0.0, 0.0, 0.0)
        late = sorted(vehicle.late_s)
        assert 50 <= len(late) <= 200  # 50 Hz since opening; how late: tools/set_point_pace.py


def test_the_checklist_finds_what_is_not_in_order() -> None:
    with bench() as (vehicle, _, _):
        vehicle.connect()
        time.sleep(1.5)
        lines = {check.name: check for check in vehicle.checks()}
        assert lines["battery"].ok
        assert lines["geofence"].ok
        assert lines["telemetry"].ok
        assert lines["round trip"].ok
        assert lines["pictures"].ok
