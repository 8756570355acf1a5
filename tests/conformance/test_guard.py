"""The guard process of a MAVLink link: it holds the vehicle when our process hangs or dies, and only then."""

import errno
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from threading import Thread, Timer
from types import SimpleNamespace
from typing import Any

import pytest

m = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")

from fuzz_link import Nowhere  # noqa: E402
from mavlink_bench import StandIn, bench  # noqa: E402

from ports import free_port  # noqa: E402
from shipland.commands import publish  # noqa: E402
from shipland.commands.publish import Publish  # noqa: E402
from shipland.errors import ConfigError, VehicleError  # noqa: E402
from shipland.messages import Observation, PilotCommand  # noqa: E402
from shipland.vehicles.mavlink import guard_process  # noqa: E402
from shipland.vehicles.mavlink.dialect import Codec  # noqa: E402
from shipland.vehicles.mavlink.guard import Guard  # noqa: E402
from shipland.vehicles.mavlink.guard_process import GuardedPort  # noqa: E402
from shipland.vehicles.mavlink.ports import UdpPort  # noqa: E402
from shipland.vehicles.mavlink.session import Session  # noqa: E402
from waiting import until  # noqa: E402

BRAKE, LOITER, GUIDED, GUIDED_NOGPS = 17, 5, 4, 20
OFFBOARD, PX4_HOLD = 6 << 16, 4 << 16 | 3 << 24
GAP_S, SILENCE_S = 0.3, 3.0
KEY = bytes(range(32))


# The decision, on times that are given


class Air:
    """A guard between a vehicle and us, on a clock of its own."""

    def __init__(self, autopilot: int = 3, mode: int = GUIDED, key: bytes | None = None) -> None:
        self.autopilot, self.mode, self.armed, self.t_s, self.lag_s = autopilot, mode, True, 100.0, 0.0
        self.vehicle = Codec(1, 1, key)
        session = Session(Nowhere(), 245, 191, None, key, None, lambda *_: None)
        session.link.take(self._heartbeat(self.vehicle), "air:1", 0.0)
        self.guard = Guard(session.guard_orders(50.0, GAP_S, SILENCE_S), stream=False)
        self.ours, self.seen = Codec(245, 191, key, link=191), Codec(1, 1, key)
        self.sent: list[Any] = []
        self.beat()

    def _heartbeat(self, codec: Codec) -> bytes:
        base = 128 if self.armed else 0
        return codec.encode(m.MAVLink_heartbeat_message(2, self.autopilot, base | 1, self.mode, 4, 3))

    def beat(self, codec: Codec | None = None) -> None:
        self.beat_s = self.t_s
        answer = m.MAVLink_timesync_message(1, int(1e9 * (self.t_s - self.lag_s)))
        for data in ((codec or self.vehicle).encode(answer), self._heartbeat(codec or self.vehicle)):
            self.guard.hear_vehicle(data, self.t_s)

    def set_point(self, heading_rad: float = 1.0) -> None:
        c, s = math.cos(0.5 * heading_rad), math.sin(0.5 * heading_rad)
        tilted = [c * math.cos(0.1), s * math.sin(0.1), c * math.sin(0.1), s * math.cos(0.1)]
        message = m.MAVLink_set_attitude_target_message(0, 1, 1, 0, tilted, 0.0, 0.0, 0.0, 0.7)
        self.guard.hear_us(self.ours.encode(message), self.t_s)

    def go(self, seconds: float, beats: bool = True) -> list[str]:
        """Names of what the guard sent meanwhile; the vehicle's heartbeat comes each second."""
        begun = len(self.sent)
        for _ in range(round(1000 * seconds)):
            self.t_s += 0.001
            if beats and self.t_s - self.beat_s >= 1.0:
                self.beat()
            for data in self.guard.due(self.t_s):
                messages, malformed = self.seen.decode_some(data, stream=False)
                assert malformed == 0
                self.sent += messages
        return [message.get_type() for message in self.sent[begun:]]


VELOCITY, ATTITUDE, COMMAND = "SET_POSITION_TARGET_LOCAL_NED", "SET_ATTITUDE_TARGET", "COMMAND_LONG"


def test_set_points_keep_the_guard_silent_and_a_gap_makes_it_hold_at_their_rate() -> None:
    air = Air()
    for _ in range(100):
        air.set_point()
        assert air.go(0.02) == []
    assert air.go(GAP_S - 0.05) == []
    names = air.go(1.0)
    assert 45 <= names.count(VELOCITY) <= 50
    assert names.count("HEARTBEAT") == 1
    assert COMMAND not in names
    hold = air.sent[0]
    assert (hold.get_srcSystem(), hold.get_srcComponent(), hold.target_system) == (245, 191, 1)
    assert [hold.vx, hold.vy, hold.vz, hold.yaw_rate] == [0.0, 0.0, 0.0, 0.0]
    air.set_point()
    assert air.go(GAP_S - 0.05) == []


def test_after_a_long_silence_the_mode_that_holds_is_asked_for_a_few_times() -> None:
    air = Air()
    air.set_point()
    assert COMMAND not in air.go(SILENCE_S - 0.1)
    assert air.go(10.0).count(COMMAND) == 3
    asked = next(message for message in air.sent if message.get_type() == COMMAND)
    assert (asked.command, asked.param1, asked.param2, asked.param3) == (176, 1.0, BRAKE, 0.0)


def test_a_signed_guard_that_has_waited_for_minutes_is_still_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    """An autopilot refuses a stream that begins a minute behind its own clock, which goes on by GPS."""
    air = Air(key=KEY)
    later_s = time.time() + 600.0
    monkeypatch.setattr(time, "time", lambda: later_s)
    air.seen.signing.timestamp = int((later_s - 1420070400) * 1e5)
    air.set_point()
    assert VELOCITY in air.go(1.0)


def test_on_a_link_that_lags_no_mode_is_asked_for() -> None:
    """The heartbeat of our mode is two seconds old: a person may have chosen another since."""
    air = Air()
    air.lag_s = 2.0
    air.go(2.0)
    air.set_point()
    air.guard.lose_us(air.t_s)
    names = air.go(4.0)
    assert VELOCITY in names
    assert names.count("TIMESYNC") >= 12, "it asks itself how late what it hears is"
    assert COMMAND not in names
    air.lag_s = 0.3
    assert COMMAND in air.go(1.1)


@pytest.mark.parametrize("autopilot", [3, 12])
def test_without_our_process_it_holds_at_once_asks_for_the_mode_and_ends(autopilot: int) -> None:
    air = Air(autopilot, OFFBOARD if autopilot == 12 else GUIDED)
    air.set_point()
    air.guard.lose_us(air.t_s)
    assert air.go(0.1).count(VELOCITY) >= 4
    assert air.go(0.8).count(VELOCITY) >= 35
    (asked,) = (message for message in air.sent if message.get_type() == COMMAND)
    wanted = (4.0, 3.0) if autopilot == 12 else (BRAKE, 0.0)
    assert (asked.param2, asked.param3) == wanted
    assert not air.guard.over(air.t_s)
    air.mode = PX4_HOLD if autopilot == 12 else BRAKE
    air.beat()
    assert air.guard.over(air.t_s)
    assert air.go(2.0) == []


def test_a_mode_that_is_refused_does_not_keep_the_process_for_ever() -> None:
    air = Air()
    air.set_point()
    air.guard.lose_us(air.t_s)
    air.go(4.9)
    assert not air.guard.over(air.t_s)
    air.go(0.2)
    assert air.guard.over(air.t_s)


@pytest.mark.parametrize("gone", [False, True])
def test_a_mode_that_a_person_chose_is_never_touched(gone: bool) -> None:
    air = Air()
    air.set_point()
    air.mode = LOITER
    air.beat()
    air.set_point()  # one that was on its way
    if gone:
        air.guard.lose_us(air.t_s)
    assert air.go(6.0) == []
    air.mode = GUIDED  # given to somebody else since
    assert air.go(6.0) == []


@pytest.mark.parametrize("silent_s", [0.1, 0.5])
def test_a_mode_that_a_person_chose_while_we_were_silent_is_told(silent_s: float) -> None:
    """Our process may never see it: what is said to one that stands still does not all wait for it."""
    air = Air()
    air.set_point()
    air.go(silent_s)
    air.mode = LOITER
    air.beat()
    assert air.guard.taken == (silent_s > GAP_S)
    assert ("was taken" in air.guard.news) == air.guard.taken


@pytest.mark.parametrize(("later_s", "taken"), [(0.5, False), (3.0, True)])
def test_a_mode_that_we_asked_for_before_we_fell_silent_was_not_taken(later_s: float, taken: bool) -> None:
    air = Air()
    air.set_point()
    landing = m.MAVLink_command_long_message(1, 1, m.MAV_CMD_DO_SET_MODE, 0, 1, LOITER, 0, 0, 0, 0, 0)
    air.guard.hear_us(air.ours.encode(landing), air.t_s)
    air.go(later_s)
    air.mode = LOITER
    air.beat()
    assert air.guard.taken == taken


@pytest.mark.parametrize("what", ["disarmed", "no set-point yet"])
def test_where_nothing_is_to_be_held_nothing_is_sent(what: str) -> None:
    air = Air()
    if what == "disarmed":
        air.set_point()
        air.armed = False
        air.beat()
    assert air.go(5.0) == []
    air.guard.lose_us(air.t_s)
    assert air.guard.over(air.t_s)


def test_a_vehicle_that_is_not_heard_is_sent_nothing() -> None:
    """Its mode is then not known."""
    air = Air()
    air.set_point()
    assert air.go(SILENCE_S, beats=False).count(VELOCITY) > 100
    assert air.go(5.0, beats=False) == []


def test_other_senders_heartbeats_say_nothing_of_the_mode() -> None:
    air = Air()
    air.set_point()
    air.mode = LOITER
    air.beat(Codec(2, 1))  # another vehicle
    air.beat(Codec(1, 154))  # a gimbal of this one
    air.mode = GUIDED
    assert VELOCITY in air.go(1.0)


def test_without_a_position_it_holds_level_with_the_heading_that_was_asked_for() -> None:
    air = Air(mode=GUIDED_NOGPS)
    air.set_point(heading_rad=1.0)
    assert ATTITUDE in air.go(0.5)
    hold = air.sent[0]
    assert hold.q == pytest.approx([math.cos(0.5), 0.0, 0.0, math.sin(0.5)], abs=1e-3)
    assert (hold.thrust, hold.type_mask) == (0.5, 0)


def test_what_it_sends_is_signed_on_a_stream_of_its_own() -> None:
    air = Air(key=KEY)
    air.seen.decode_some(air.ours.encode(m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)), stream=False)
    air.set_point()
    forger = Codec(1, 1)
    air.mode = LOITER
    air.beat(forger)
    air.mode = GUIDED
    assert VELOCITY in air.go(1.0)  # unsigned, so the mode is ours still; what it sends is accepted
    assert {stream[0] for stream in air.seen.signing.stream_timestamps} == {191, 192}


# The process


Flight = tuple[subprocess.Popen[str], StandIn, int]
"""Our process, the autopilot's, the UDP port between them."""


def is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.bind(("127.0.0.1", port))
        return True
    return False


def set_points(report: dict[str, Any]) -> int:
    return sum(report["counts"].get(name, 0) for name in (VELOCITY, ATTITUDE))


def holds(report: dict[str, Any]) -> bool:
    return report["target"] == "speed" and report["values"] == [0.0, 0.0, 0.0, 0.0] and report["age_s"] < 0.2


@pytest.fixture
def flying() -> Iterator[Flight]:
    """In flight with full forward sticks, in a process of its own."""
    with ExitStack() as stack:
        port = free_port(socket.SOCK_DGRAM)
        autopilot = StandIn(port, "ardupilot")
        stack.callback(autopilot.close)
        command = [sys.executable, str(Path(__file__).with_name("held_flight.py")), str(port)]
        process = stack.enter_context(
            subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        )
        stack.callback(process.kill)
        assert process.stdout is not None
        assert process.stdout.readline() == "flying\n"
        until(lambda: autopilot.report()["target"] == "tilt")
        yield process, autopilot, port


def test_a_held_interpreter_is_held_for_and_flies_on(flying: Flight) -> None:
    process, autopilot, _ = flying
    assert process.stdin is not None
    held_s = time.monotonic()
    process.stdin.write("2.0\n")
    process.stdin.flush()
    until(lambda: holds(autopilot.report()), timeout_s=1.0)
    until(lambda: autopilot.report()["target"] == "tilt")
    assert time.monotonic() - held_s >= 2.0
    velocities = autopilot.report()["counts"][VELOCITY]
    time.sleep(0.3)
    report = autopilot.report()
    assert report["counts"][VELOCITY] == velocities  # set-points have come again: the guard is silent
    assert report["mode"] == GUIDED


def test_a_process_that_stays_frozen_is_left_holding_and_learns_it(flying: Flight) -> None:
    process, autopilot, _ = flying
    process.send_signal(signal.SIGSTOP)
    until(lambda: holds(autopilot.report()))
    until(lambda: autopilot.report()["mode"] == BRAKE)
    process.send_signal(signal.SIGCONT)
    assert process.stdout is not None
    assert "our process had fallen silent" in process.stdout.readline()


def test_what_a_person_gave_to_another_while_our_process_stood_still_is_not_flown(flying: Flight) -> None:
    process, autopilot, _ = flying
    process.send_signal(signal.SIGSTOP)
    time.sleep(2.6)  # what is said to it since does not wait for it
    autopilot.say(f"mode {LOITER}")
    time.sleep(0.5)
    autopilot.say(f"mode {GUIDED}")
    time.sleep(0.5)
    before = autopilot.report()
    process.send_signal(signal.SIGCONT)
    assert process.stdout is not None
    assert "the vehicle was taken" in process.stdout.readline()
    time.sleep(0.5)
    assert set_points(autopilot.report()) == set_points(before)


@pytest.mark.parametrize("order", [1, -1])
def test_a_person_who_took_over_while_the_machine_stood_still_is_left_alone(flying: Flight, order: int) -> None:
    """Heartbeats of our mode, from before, wait for the guard when it wakes."""
    process, autopilot, _ = flying
    guard = int(Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text())
    for pid in (process.pid, guard):
        os.kill(pid, signal.SIGSTOP)
    time.sleep(SILENCE_S + 0.5)
    autopilot.say(f"mode {LOITER}")
    time.sleep(0.5)
    for pid in (process.pid, guard)[::order]:
        os.kill(pid, signal.SIGCONT)
        time.sleep(0.02)
    assert process.stdout is not None
    assert "the pilot took over: LOITER" in process.stdout.readline()
    time.sleep(1.0)
    assert autopilot.report()["mode"] == LOITER


def test_what_waited_for_a_guard_that_stood_still_is_not_sent() -> None:
    with bench() as (vehicle, autopilot, _):
        vehicle.open()
        guard = vehicle.session.link.port._process.pid
        os.kill(guard, signal.SIGSTOP)
        vehicle.session.command(400, 0, 21196)  # a touchdown's
        begun_s, before = time.monotonic(), set_points(autopilot.report())
        time.sleep(1.5)
        os.kill(guard, signal.SIGCONT)
        until(lambda: set_points(autopilot.report()) > before)
        late_s = time.monotonic() - begun_s
        assert set_points(autopilot.report()) - before < 50 * (late_s - 0.7)
        assert autopilot.report()["armed"]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGHUP, signal.SIGQUIT])
def test_a_process_that_dies_is_held_for_and_the_mode_that_holds_is_asked_for(
    how: signal.Signals, flying: Flight
) -> None:
    process, autopilot, port = flying
    velocities = autopilot.report()["counts"].get(VELOCITY, 0)
    process.send_signal(how)
    assert process.wait() == -how
    until(lambda: autopilot.report()["mode"] == BRAKE)
    report = autopilot.report()
    assert report["counts"][VELOCITY] > velocities
    assert report["armed"]
    until(lambda: is_free(port))  # the guard has gone as well


def test_a_person_who_took_over_is_left_alone_when_our_process_freezes_and_dies(flying: Flight) -> None:
    process, autopilot, _ = flying
    process.send_signal(signal.SIGSTOP)
    until(lambda: holds(autopilot.report()))
    autopilot.say(f"mode {LOITER}")
    until(lambda: autopilot.report()["age_s"] > 0.5)  # the heartbeat has been heard
    before = autopilot.report()
    process.kill()
    time.sleep(2.0)
    after = autopilot.report()
    assert after["counts"] == before["counts"]
    assert (after["commands"], after["mode"]) == (before["commands"], LOITER)


def test_a_flight_that_ended_here_is_not_guarded() -> None:
    with bench() as (vehicle, autopilot, _):
        vehicle.open()
        vehicle.send(PilotCommand(time.monotonic(), 50.0, 0.0, 0.0, 0.0, -0.2))
        until(lambda: autopilot.report()["target"] == "tilt")
        vehicle.close()
        before = autopilot.report()
        assert before["mode"] == BRAKE
        autopilot.say(f"mode {GUIDED}")
        time.sleep(1.5)
        assert set_points(autopilot.report()) == set_points(before)


def test_a_guard_that_dies_ends_the_flight_at_once() -> None:
    with bench(link_timeout_s=20.0) as (vehicle, _, _):
        vehicle.open()
        os.kill(vehicle.session.link.port._process.pid, signal.SIGKILL)
        until(lambda: vehicle.read() is None, timeout_s=10.0)
        assert vehicle.end_reason == "the guard process of the link has ended"


@pytest.mark.parametrize(
    ("what", "words"),
    [("guard", "the guard process of the link has ended"), ("camera", "video lost: no picture for 1 s; 0 poses")],
)
def test_what_fails_under_publish_ends_it_in_words(what: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """An autopilot that lands by our vision would be told of no deck, and nobody that it is not."""
    vision = SimpleNamespace(see=lambda frame: Observation(frame.t_s, frame.gimbal))
    monkeypatch.setattr("shipland.vision.near.pipeline.NearVision", lambda *_: vision)
    monkeypatch.setattr(publish, "_CAMERA_S", 1.0)
    with bench() as (vehicle, _, camera):
        vehicle.connect()
        monkeypatch.setattr("shipland.scenario.real_vehicle.make_vehicle", lambda *_: vehicle)
        if what == "guard":
            os.kill(vehicle.session.link.port._process.pid, signal.SIGKILL)
        stop = Timer(3.0 if what == "guard" else 0.2, lambda: setattr(camera, "frozen", True))
        stop.start()
        with pytest.raises(VehicleError, match=words):
            Publish(scenario="near").run()
        stop.join()


def test_a_turn_that_fails_is_told_and_the_messages_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    number, carry, failures = free_port(socket.SOCK_DGRAM), guard_process._Relay._from_vehicle, ["once"]

    def carry_but_once(relay: Any) -> None:
        if failures:
            failures.pop()
            raise ZeroDivisionError("of a bug")
        carry(relay)

    monkeypatch.setattr(guard_process._Relay, "_from_vehicle", carry_but_once)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with closing(UdpPort("127.0.0.1", number, listen=True)) as port, closing(theirs):
        relay = Thread(target=guard_process._Relay(port, theirs).run)
        relay.start()
        with closing(ours), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
            ours.settimeout(10.0)
            vehicle.sendto(b"heartbeat", ("127.0.0.1", number))
            assert ours.recv(1000) == b"Pthe guard process of the link failed: ZeroDivisionError: of a bug"
            assert ours.recv(1000).endswith(b"heartbeat")
        relay.join(10.0)
        assert not relay.is_alive()


def test_what_fails_with_every_message_of_the_vehicle_keeps_neither_ours_nor_a_hold_from_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_: Any) -> None:
        raise ZeroDivisionError("of a bug")

    monkeypatch.setattr(guard_process._Relay, "_from_vehicle", fail)
    holds = SimpleNamespace(
        news="", taken=False, hear_us=lambda *_: None, due_s=lambda: 0.0, due=lambda _: [b"hold"], over=lambda _: True,
        lose_us=lambda _: None,
    )  # fmt: skip
    number = free_port(socket.SOCK_DGRAM)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with closing(UdpPort("127.0.0.1", number, listen=True)) as port, closing(theirs):
        relay = guard_process._Relay(port, theirs)
        monkeypatch.setattr(relay, "_guard", holds)
        thread = Thread(target=relay.run)
        with closing(ours), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
            vehicle.settimeout(10.0)
            vehicle.sendto(b"heartbeat", ("127.0.0.1", number))  # waits for ever: a busy link's next one is there
            peer = f"127.0.0.1:{vehicle.getsockname()[1]}"
            ours.send(guard_process._message_record(peer, b"set-point"))
            thread.start()
            try:
                assert {vehicle.recv(100), vehicle.recv(100)} == {b"set-point", b"hold"}
            finally:
                ours.close()
                monkeypatch.undo()
                vehicle.sendto(b"heartbeat", ("127.0.0.1", number))
        thread.join(10.0)
        assert not thread.is_alive()


def test_a_port_that_cannot_be_opened_is_said_before_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(VehicleError, match=f"cannot listen on 127.0.0.1:{port}"):
            GuardedPort(f"udp:127.0.0.1:{port}")
    with pytest.raises(ConfigError, match="expected udp:HOST:PORT"):
        GuardedPort("mqtt:host:1")
    with pytest.raises(VehicleError, match=r"tcp:10\.0\.0\.\.1:5760: UnicodeError"):
        GuardedPort("tcp:10.0.0..1:5760")
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(VehicleError, match="guard process of the link ended"):
        GuardedPort(f"udp:127.0.0.1:{port}")
    monkeypatch.setattr(sys, "executable", "/nowhere")
    with pytest.raises(VehicleError, match="cannot be started"):
        GuardedPort(f"udp:127.0.0.1:{port}")


def test_udpout_hears_only_the_stated_peer() -> None:
    """Another sender that knows our port must not become the vehicle by being the first with a heartbeat."""
    with ExitStack() as stack:
        stated, stranger = (stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2))
        stated.bind(("127.0.0.1", 0))
        stated.settimeout(10.0)
        port = GuardedPort(f"udpout:127.0.0.1:{stated.getsockname()[1]}")
        session = Session(port, 245, 191, None, None, None, lambda *_: None)
        stack.callback(session.link.close)
        session.link.start()
        session.beat()
        our_address = stated.recvfrom(1000)[1]
        heartbeat = m.MAVLink_heartbeat_message(2, 3, 129, GUIDED, 4, 3)
        stranger.sendto(Codec(7, 1).encode(heartbeat), our_address)
        stated.sendto(Codec(1, 1).encode(heartbeat), our_address)
        until(lambda: session.link.vehicle)
        assert session.link.vehicle == 1
        assert session.link.counts.foreign == 0


def test_an_end_that_waits_to_be_spoken_to_hears_us_first() -> None:
    """A router's server endpoint knows nobody to send the vehicle's heartbeat to until it has heard somebody."""
    with ExitStack() as stack:
        stated = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        stated.bind(("127.0.0.1", 0))
        stated.settimeout(10.0)
        session = Session(
            GuardedPort(f"udpout:127.0.0.1:{stated.getsockname()[1]}"), 245, 191, None, None, None, lambda *_: None
        )
        stack.callback(session.link.close)
        with pytest.raises(VehicleError, match="no heartbeat"):
            session.connect(0.5)
        (message,), _ = Codec(1, 1).decode_some(stated.recv(1000), stream=False)
        assert (message.get_type(), message.get_srcSystem()) == ("HEARTBEAT", 245)


def test_a_router_that_rejects_a_datagram_does_not_end_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    """ICMP's "administratively prohibited" is EHOSTUNREACH at the next receipt, which is no ConnectionError."""
    port = UdpPort("127.0.0.1", free_port(socket.SOCK_DGRAM), listen=False)

    class Rejected:
        def recvfrom(self, _: int) -> tuple[bytes, Any]:
            raise OSError(errno.EHOSTUNREACH, "No route to host")

    with closing(port):
        monkeypatch.setattr(port, "_end", Rejected())
        assert port.receive() is None
        monkeypatch.undo()


@pytest.mark.parametrize("kind", ["udp", "tcp", "serial"])
def test_every_kind_of_port_carries_bytes_both_ways_and_is_silent_once_its_end_has_gone(kind: str) -> None:
    heard: list[tuple[bytes, object, float]] = []
    with ExitStack() as stack:
        if kind == "serial":
            pytest.importorskip("serial")
            far, near = os.openpty()
            port = GuardedPort(f"serial:{os.ttyname(near)}:57600")
            os.close(near)
            read, write, hang_up = lambda: os.read(far, 100), lambda data: os.write(far, data), lambda: os.close(far)
        elif kind == "tcp":
            server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            port = GuardedPort(f"tcp:127.0.0.1:{server.getsockname()[1]}")
            end = server.accept()[0]
            read, write, hang_up = lambda: end.recv(100), end.sendall, end.close
        else:
            end = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            number = free_port(socket.SOCK_DGRAM)
            end.connect(("127.0.0.1", number))
            port = GuardedPort(f"udp::{number}")
            read, write, hang_up = lambda: end.recv(100), end.send, end.close
        stack.callback(port.close)
        assert port.stream == (kind != "udp")
        write(b"up")
        until(lambda: (got := port.receive()) is not None and heard.append(got) is None)
        ((data, peer, _),) = heard
        assert data == b"up"
        port.send(b"down", peer)
        assert read() == b"down"
        hang_up()
        assert [port.receive() for _ in range(5)] == [None] * 5
        port.send(b"into the void", peer)
        assert port.problem == ""
