"""An ANAFI before a stand-in of its far end, in a process of its own; before Olympe itself: tests/conformance."""

import json
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interrupts import receive
from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.frames import quaternion_from_euler
from shipland.guidance.modes import INTENTS
from shipland.messages import Intent, Mode, PilotCommand, Telemetry
from shipland.stopping import stop_requests
from shipland.vehicles import link_vehicle
from shipland.vehicles.address import Address, VehicleSetup, vehicle_table
from shipland.vehicles.anafi.records import merged, sticks_of, with_metadata
from shipland.vehicles.anafi.vehicle import AnafiVehicle, anafi
from shipland.vehicles.gimbal import gimbal_at
from waiting import until

FAR_END = """
import json, sys, threading, time
log, take_off = open(sys.argv[1], "w"), json.loads(sys.argv[2])
def say(record, data=b""):
    head = json.dumps({**record, "t_s": time.monotonic(), "bytes": len(data)})
    sys.stdout.buffer.write(head.encode() + b"\\n" + data)
    sys.stdout.buffer.flush()
mute, still, n = threading.Event(), threading.Event(), 0
def stream():
    global n
    while not mute.is_set():
        n += 1
        shown = bytes([0 if still.is_set() else n % 250]) + bytes(36 * 64 * 3 // 2 - 1)
        say({"kind": "picture", "stamp_s": n / 30.0, "size_px": [64, 36], "planes": "NV12"}, shown)
        if n % 6 == 0:
            say({"kind": "attitude", "values": {"roll": 0.1, "pitch": float("nan") if n % 12 else 0.2, "yaw": 3.5}})
            say({"kind": "speed", "values": {"speedX": 0.0, "speedY": 0.0, "speedZ": 0.0}})
        time.sleep(1 / 30)
say({"kind": "connected"})
sys.stdout.buffer.write(b"no record\\n")
say({"kind": "battery", "values": {"percent": 77}})
threading.Thread(target=stream, daemon=True).start()
for line in sys.stdin:
    log.write(line); log.flush()
    asked = json.loads(line)
    if "limits" in asked: say({"kind": "limits", "values": {**asked["limits"], "fence": 1.0}})
    if asked.get("take_off"): [say(record) for record in take_off]
    if "say" in asked: say(asked["say"])
    if "write" in asked: sys.stdout.buffer.write(asked["write"].encode() + b"\\n"); sys.stdout.buffer.flush()
    if asked.get("land"): say({"kind": "flying", "values": {"state": "landed"}})
    if asked.get("gimbal_deg", 0) > 80: mute.set()
    elif asked.get("gimbal_deg", 0) > 70: still.set()
    if asked.get("gimbal_deg", 0) < -80: sys.exit()
"""


def flying(state: str) -> dict[str, Any]:
    return {"kind": "flying", "values": {"state": state}}


@contextmanager
def vehicle(
    tmp_path: Path,
    take_off: Sequence[dict[str, Any]] = (flying("hovering"),),
    options: str = "takeoff=1",
    **changes: float,
) -> Iterator[tuple[AnafiVehicle, Path]]:
    script, log = tmp_path / "far_end.py", tmp_path / "asked.txt"
    script.write_text(FAR_END)
    own = {"connect_timeout_s": 30.0, "engage_timeout_s": 2.0, "video_timeout_s": 0.5} | changes
    table = {**vehicle_table(None), "anafi": own}
    setup = VehicleSetup(Address.parse(f"anafi://127.0.0.1?{options}"), Camera.from_fov(64, 36, 69.0), table)
    made = anafi(setup)
    assert isinstance(made, AnafiVehicle)
    made._setup.command[:] = [sys.executable, str(script), str(log), json.dumps(take_off)]
    try:
        yield made, log
    finally:
        made.close()


def asked(log: Path) -> list[dict]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def test_it_takes_off_streams_and_lands(tmp_path: Path) -> None:
    with vehicle(tmp_path) as (flown, log):
        flown.connect()
        time.sleep(0.6)
        unfit = [check.name for check in flown.checks() if not check.ok]
        assert unfit == ["telemetry"]  # five events a second, every other one broken, and no metadata
        flown.open()
        end_s, seen = time.monotonic() + 4.0, 0
        while (pair := flown.read()) is not None and time.monotonic() < end_s:
            seen += 1
            frame, telemetry = pair
            assert frame.image is not None
            assert frame.image.shape == (36, 64, 3)
            assert telemetry.t_s > frame.t_s
            flown.send(PilotCommand(telemetry.t_s, 10.0, -20.0, -40.0, 0.0, -0.3, Intent.LAND, at_contact_height=True))
        assert flown.end_reason.startswith("landed")
        assert seen > 20
        assert flown.refused >= 1
        lines = asked(log)
        assert lines[0]["limits"]["tilt_deg"] == 15.0
        assert {"sticks": [-20, 10, 0, -40]} in lines
        assert sum("land" in line for line in lines) == 1
        assert flown.telemetry_at(1.0).heading_rad == pytest.approx(3.5 - 2.0 * math.pi)


@pytest.mark.parametrize(("gimbal_deg", "reason"), [(85.0, "video lost"), (75.0, "video lost"), (-85.0, "has ended")])
def test_lost_or_frozen_video_and_a_lost_process_end_the_flight(tmp_path: Path, gimbal_deg: float, reason: str) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown.open()
        end_s = time.monotonic() + 5.0
        frames = []
        while (pair := flown.read()) is not None and time.monotonic() < end_s:
            frames.append(pair[0])
            flown.send(PilotCommand(pair[1].t_s, 0.0, 0.0, 0.0, 0.0, math.radians(gimbal_deg)))
        assert reason in flown.end_reason
        assert None in frames or reason == "has ended"  # telemetry goes on where only the video is gone


def fly_until(flown: AnafiVehicle, done: Callable[[], bool], *sticks: float, intent: Intent = Intent.FLY) -> bool:
    """Cycles with the same sticks until something is so, or the flight is over."""
    until_s = time.monotonic() + 20.0
    while not done() and time.monotonic() < until_s and (pair := flown.read()) is not None:
        flown.send(PilotCommand(pair[1].t_s, *sticks or (0.0, 0.0, 0.0, 0.0), 0.0, intent))
    return done()


@pytest.mark.parametrize(
    ("taken", "reason", "in_command"),
    [
        (flying("landing"), "somebody else lands", "somebody else (landing)"),
        (flying("landed"), "motors have stopped", "nobody: the motors have stopped"),
        (
            {"kind": "home", "values": {"state": "pending", "reason": "userRequest"}},
            "flies home by itself: userRequest",
            "the ANAFI itself (returns home)",
        ),
        (
            {"kind": "rth", "values": {"state": "in_progress", "reason": "battery_too_hot"}},
            "flies home by itself: battery_too_hot",
            "the ANAFI itself (returns home)",
        ),
    ],
)
def test_a_takeover_during_our_own_take_off_ends_the_flight_without_a_stick(
    tmp_path: Path, taken: dict[str, Any], reason: str, in_command: str
) -> None:
    with vehicle(tmp_path, [flying("takingoff"), taken], engage_timeout_s=20.0) as (flown, log):
        assert flown.in_command.startswith("somebody else")
        begun_s = time.monotonic()
        with pytest.raises(VehicleError, match=reason):
            flown.open()
        assert time.monotonic() - begun_s < 15.0
        assert flown.in_command == in_command
        assert not any("sticks" in line for line in asked(log))
        assert {"stop": True} in asked(log)  # nor are they released: they are not ours


def test_the_take_off_is_not_asked_of_an_aircraft_that_somebody_lands(tmp_path: Path) -> None:
    with vehicle(tmp_path, engage_timeout_s=0.5) as (flown, log):
        flown.connect()
        flown._process.say({"say": flying("landing")})
        assert until(lambda: flown._state == "landing")
        with pytest.raises(VehicleError, match="has not taken off"):
            flown.open()
        assert not any("take_off" in line for line in asked(log))


@pytest.mark.parametrize(("kind", "state"), [("home", "inProgress"), ("home", "pending"), ("rth", "in_progress")])
@pytest.mark.parametrize(("options", "flies"), [("takeoff=0", "flying"), ("takeoff=1", "landed")])
def test_an_aircraft_that_flies_home_as_we_start_is_not_taken(
    tmp_path: Path, kind: str, state: str, options: str, flies: str
) -> None:
    with vehicle(tmp_path, options=options, engage_timeout_s=0.5) as (flown, log):
        flown.connect()
        for record in ({"kind": kind, "values": {"state": state, "reason": "lowBattery"}}, flying(flies)):
            flown._process.say({"say": record})
        assert until(lambda: flown._state == flies)
        with pytest.raises(VehicleError, match="the ANAFI flies home by itself"):
            flown.open()
        assert flown.in_command.startswith("somebody else")
        assert not any("take_off" in line or "sticks" in line for line in asked(log))


def test_a_flight_home_that_has_ended_is_over(tmp_path: Path) -> None:
    with vehicle(tmp_path, options="takeoff=0", engage_timeout_s=20.0) as (flown, _):
        flown.connect()
        for state in ("inProgress", "available"):
            flown._process.say({"say": {"kind": "home", "values": {"state": state, "reason": "finished"}}})
        flown._process.say({"say": flying("hovering")})
        flown.open()
        assert flown.in_command == "shipland"


def test_no_stick_of_before_a_suspension_is_sent_after_it_nor_are_they_released(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with vehicle(tmp_path) as (flown, log):
        flown.open()
        before = {"sticks": [0, 60, 0, 0]}
        assert fly_until(flown, lambda: before in asked(log), 60.0, 0.0, 0.0, 0.0)
        pair = flown.read()  # and it sleeps before the cycle's sticks leave
        assert pair is not None
        monkeypatch.setattr(link_vehicle, "boot_s", lambda: time.monotonic() + 30.0)
        flown.send(PilotCommand(pair[1].t_s, 77.0, 0.0, 0.0, 0.0, 0.0))
        assert "this machine was suspended for 30 s" in flown.end_reason
        assert until(lambda: asked(log)[-1] == {"stop": True})
        assert [line for line in asked(log) if "sticks" in line][-1] == before
        assert flown.read() is None


@pytest.mark.parametrize("options", ["takeoff=1", "takeoff=0"])
def test_an_aircraft_connected_before_a_suspension_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: str
) -> None:
    """What is known of it is as old."""
    with vehicle(tmp_path, options=options) as (flown, log):
        flown.connect()
        flown._process.say({"say": flying("landed" if options == "takeoff=1" else "hovering")})
        assert until(lambda: flown._state != "")
        monkeypatch.setattr(link_vehicle, "boot_s", lambda: time.monotonic() + 30.0)
        with pytest.raises(VehicleError, match="this machine was suspended for 30 s since it connected"):
            flown.open()
        assert flown.in_command.startswith("somebody else")
        assert not any("take_off" in line or "sticks" in line for line in asked(log))


@pytest.mark.parametrize(
    ("taken", "in_command"),
    [
        (flying("landing"), "somebody else (landing)"),
        (
            {"kind": "home", "values": {"state": "inProgress", "reason": "userRequest"}},
            "the ANAFI itself (returns home)",
        ),
    ],
)
def test_a_takeover_after_our_own_end_is_not_sent_released_sticks(
    tmp_path: Path, taken: dict[str, Any], in_command: str
) -> None:
    with vehicle(tmp_path) as (flown, log):
        flown.open()
        flown._end("video lost: here; the ANAFI holds", "the ANAFI itself (holds)")
        assert until(lambda: asked(log)[-1] == {"sticks": [0, 0, 0, 0]})
        for _ in range(2):
            flown._on_record(taken | {"t_s": time.monotonic()}, b"")
        assert until(lambda: {"stop": True} in asked(log))
        assert flown.in_command == in_command
        assert flown.end_reason.startswith("video lost: here; the ANAFI holds; then ")
        flown.close()
        assert sum("stop" in line for line in asked(log)) == 1
        assert flown.in_command == in_command


def test_who_is_in_command_is_told(tmp_path: Path) -> None:
    for record, in_command in (
        (flying("landing"), "somebody else (landing)"),
        ({"kind": "home", "values": {"state": "inProgress"}}, "the ANAFI itself (returns home)"),
        ({"kind": "lost"}, "nobody: link lost"),
    ):
        with vehicle(tmp_path) as (flown, _):
            flown.open()
            assert flown.in_command == "shipland"
            flown._process.say({"say": record})
            assert fly_until(flown, lambda flown=flown: bool(flown.end_reason))
            assert flown.in_command == in_command
    with vehicle(tmp_path) as (flown, _):
        flown.open()
        flown.close()
        assert flown.in_command == "the ANAFI itself (holds)"


@pytest.mark.parametrize(("mode", "intent"), INTENTS.items())
def test_every_modes_sticks_leave_but_a_holds(mode: Mode, intent: Intent) -> None:
    assert sticks_of(PilotCommand(0.0, 10.0, -20.0, 30.0, 40.0, 0.0, intent)) == (
        [0, 0, 0, 0] if mode is Mode.DONE else [-20, 10, 40, 30]
    )


def test_without_contact_height_it_never_uses_its_own_landing(tmp_path: Path) -> None:
    """Its own landing comes down where it is; what stops a descent over water is an updraft."""
    with vehicle(tmp_path) as (flown, log):
        flown.open()
        begun_s = time.monotonic()
        down = (0.0, 0.0, -40.0, 0.0)
        assert fly_until(flown, lambda: time.monotonic() - begun_s > 2.0, *down, intent=Intent.LAND)
        assert flown._telemetry.velocity_in_level_mps is not None  # it stands still, and it is known
        assert not any("land" in line for line in asked(log))
        until_s = time.monotonic() + 20.0
        while (pair := flown.read()) is not None and time.monotonic() < until_s:
            flown.send(PilotCommand(pair[1].t_s, *down, 0.0, Intent.LAND, at_contact_height=True))
        assert flown.end_reason.startswith("landed")


def test_the_second_without_descent_begins_at_contact_height(tmp_path: Path) -> None:
    """One that was gathered higher up is no deck's."""
    with vehicle(tmp_path) as (flown, log):
        flown.open()
        begun_s, down = time.monotonic(), (0.0, 0.0, -40.0, 0.0)
        assert fly_until(flown, lambda: time.monotonic() - begun_s > 2.0, *down, intent=Intent.LAND)
        pair, there_s = flown.read(), time.monotonic()
        while pair is not None and not any("land" in line for line in asked(log)):
            flown.send(PilotCommand(pair[1].t_s, *down, 0.0, Intent.LAND, at_contact_height=True))
            pair = flown.read()
        assert until(lambda: any("land" in line for line in asked(log)))
        assert time.monotonic() - there_s > 0.9


def test_a_landing_of_anothers_high_in_our_own_is_a_takeover(tmp_path: Path) -> None:
    """As a battery's last does: at that height our sticks begin none."""
    with vehicle(tmp_path) as (flown, log):
        flown.open()
        begun_s, down = time.monotonic(), (0.0, 0.0, -40.0, 0.0)
        assert fly_until(flown, lambda: time.monotonic() - begun_s > 0.5, *down, intent=Intent.LAND)
        flown._on_record(flying("emergency_landing") | {"t_s": time.monotonic()}, b"")
        assert flown.end_reason == "somebody else lands the ANAFI: emergency_landing"
        assert until(lambda: {"stop": True} in asked(log))


def test_a_landing_of_its_own_that_has_ended_is_over(tmp_path: Path) -> None:
    """The next descent is flown, and another's landing in it is a takeover again."""
    with vehicle(tmp_path) as (flown, log):
        flown.open()
        now_s, down = time.monotonic(), (0.0, 0.0, -40.0, 0.0)
        flown._asked_s = now_s - 5.0  # for long it did not sink
        for state in ("landing", "hovering"):
            flown._state = "landing" if state == "landing" else flown._state
            flown._on_record(flying(state) | {"t_s": now_s}, b"")
        assert fly_until(flown, lambda: {"sticks": [0, 0, 0, -40]} in asked(log), *down, intent=Intent.LAND)
        flown._on_record(flying("landing") | {"t_s": time.monotonic()}, b"")
        assert flown.end_reason == "somebody else lands the ANAFI: landing"


def test_what_fails_at_the_end_does_not_keep_the_process_alive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown.open()
        monkeypatch.setattr(flown, "_leave", lambda: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            flown.close()
        assert flown._process._process.poll() is not None


MALFORMED = [
    {"kind": "picture", "stamp_s": 1.0, "size_px": "ab", "planes": "NV12"},
    {"kind": "picture", "stamp_s": 1.0, "size_px": [64, 36, 3], "planes": "NV12"},
    {"kind": "picture", "stamp_s": 10**400, "size_px": [64, 36], "planes": "NV12"},
    {"kind": "picture", "stamp_s": 1.0, "size_px": [64, 36], "planes": ["NV12"]},
    {"kind": "picture", "stamp_s": 1.0, "size_px": [64, 36], "planes": "NV12"},  # without its bytes
    {"kind": "limits", "values": {"tilt_deg": "much"}},
    {"kind": "limits", "values": [1, 2]},
    {"kind": "flying", "values": {"state": ["hovering"]}},
    {"kind": "flying", "values": {"state": "sleeping"}},
    {"kind": "flying", "values": 7},
    {"kind": "link", "values": {"value": 1e400}},
    {"kind": "battery", "values": {"percent": 10**400}},
    {"kind": "gimbal", "values": {"roll_absolute": {}}},
    {"kind": "altitude"},
    {"values": {}},
]
LINES = [
    "[]", "7", "null", '{"kind": "picture", "bytes": -1}', '{"kind": "picture", "bytes": 1e400}',
    '{"kind": "picture", "bytes": 99999999999999999999}', '{"kind": "picture", "bytes": "many"}', "[" * 100_000,
    '{"kind": "attitude", "t_s": NaN, "values": {"roll": 0, "pitch": 0, "yaw": 0}}',
    '{"kind": "attitude", "t_s": "late", "values": {"roll": 0, "pitch": 0, "yaw": 0}}',
]  # fmt: skip


def test_malformed_records_are_refused_and_counted_and_the_flight_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown.open()
        before = flown.refused
        for record in MALFORMED:
            flown._process.say({"say": record})
        for line in LINES:
            flown._process.say({"write": line})
        assert fly_until(flown, lambda: flown.refused - before >= len(MALFORMED) + len(LINES))
        flown._process.say({"say": {"kind": "battery", "values": {"percent": 55}}})
        assert fly_until(flown, lambda: flown._telemetry.battery_percent == 55.0)
        assert not flown.end_reason
        assert flown.checks()
        assert "a record of the ANAFI's process was refused" in caplog.text


def test_the_gimbals_age_is_told_with_every_picture(tmp_path: Path) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown.open()
        frame = next(pair[0] for pair in iter(flown.read, None) if pair[0] is not None)
        assert frame.gimbal_age_s == math.inf  # nothing was told yet
        flown._process.say({"say": {"kind": "gimbal", "values": {"roll_absolute": 0.0, "pitch_absolute": -20.0}}})
        ages_s = []
        assert fly_until(flown, lambda: bool(flown._gimbals))
        while len(ages_s) < 15:
            pair = flown.read()
            assert pair is not None
            if pair[0] is not None:
                assert pair[0].gimbal.pitch_rad == pytest.approx(math.radians(-20.0))
                ages_s.append(pair[0].gimbal_age_s)
        assert ages_s[-1] > 0.1  # it stands still while the pictures go on


def test_a_gimbal_is_read_between_its_events() -> None:
    readings = [(1.0, 0.0, -0.1), (1.2, 0.02, -0.3), (1.4, 0.02, -0.3)]
    gimbal, age_s = gimbal_at(1.05, [], readings, None)
    assert (gimbal.roll_rad, gimbal.pitch_rad) == pytest.approx((0.005, -0.15))
    assert age_s == pytest.approx(0.05)
    assert gimbal_at(4.4, [], readings, None)[1] == pytest.approx(3.0)


def test_the_picture_s_age_says_what_is_stated_and_what_is_measured(tmp_path: Path) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown.connect()
        assert until(lambda: len(flown._late) > 20)
        flown._late.extend([0.5] * 280)  # most come that late
        check = next(check for check in flown.checks() if check.name == "picture's age")
        assert not check.ok
        assert "0.28 s to the quickest, stated and not measured, and 0.500 s more, measured" in check.words


def test_an_alert_of_the_aircraft_is_told(tmp_path: Path) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown.open()
        for state, alerts in (("cut_out", "alert: cut_out"), ("none", "")):
            flown._process.say({"say": {"kind": "alert", "values": {"state": state}}})
            assert fly_until(flown, lambda alerts=alerts: flown.telemetry_at(1.0).alerts == alerts)


def test_nobody_there_is_one_line(tmp_path: Path) -> None:
    with vehicle(tmp_path) as (flown, _):
        flown._setup.command[:] = [str(tmp_path / "no-python"), "x"]
        with pytest.raises(VehicleError, match="cannot be started"):
            flown.open()
        assert not any(thread.name == "anafi-log" for thread in threading.enumerate())  # its file is closed


def test_a_stop_while_it_waits_for_the_take_off_is_answered_and_lets_go(tmp_path: Path) -> None:
    with vehicle(tmp_path, options="takeoff=0", engage_timeout_s=20.0) as (flown, _):
        flown.connect()
        assert flown._process is not None
        begun_s = time.monotonic()
        interrupt = threading.Timer(0.5, receive, (signal.SIGINT,))
        with pytest.raises(KeyboardInterrupt), stop_requests():
            interrupt.start()
            try:
                flown.open()
            finally:
                interrupt.cancel()
        assert time.monotonic() - begun_s < 15.0
        assert flown._process._process.poll() is not None  # which releases the sticks at its end


def test_a_stop_before_the_take_off_is_answered_before_it(tmp_path: Path) -> None:
    with vehicle(tmp_path) as (flown, log):
        flown.connect()
        with pytest.raises(KeyboardInterrupt), stop_requests():
            receive(signal.SIGINT)
            flown.open()
        assert not any("take_off" in line for line in asked(log))


def test_sticks_and_events() -> None:
    command = PilotCommand(0.0, 10.4, -20.0, 5.0, 200.0, 0.0)
    assert sticks_of(command) == [-20, 10, 100, 5]
    assert sticks_of(replace(command, intent=Intent.HOLD)) == [0, 0, 0, 0]
    assert sticks_of(replace(command, heave_percent=math.nan)) == [0, 0, 0, 0]
    nothing = Telemetry(0.0)
    turned = merged(nothing, "attitude", {"roll": 0.0, "pitch": 0.0, "yaw": math.pi / 2}, 3.0)
    moving = merged(turned, "speed", {"speedX": 0.0, "speedY": 2.0, "speedZ": -1.0}, 3.2)
    assert moving.velocity_in_level_mps == pytest.approx(np.array([2.0, 0.0, -1.0]), abs=1e-9)
    assert moving.velocity_t_s == 3.2
    with pytest.raises(ValueError, match="not finite"):
        merged(nothing, "altitude", {"altitude": math.inf}, 1.0)


def metadata(roll: float, pitch: float, yaw: float, camera_pitch: float) -> dict:
    def quaternion(roll: float, pitch: float, yaw: float) -> dict[str, float]:
        return dict(zip("wxyz", quaternion_from_euler(roll, pitch, yaw), strict=True))

    return {
        "drone": {"quat": quaternion(roll, pitch, yaw), "speed": {"north": 0.0, "east": 2.0, "down": 0.5}},
        "camera": {"quat": quaternion(0.0, camera_pitch, yaw + 0.1)},
    }


def test_a_picture_s_metadata_are_the_aircraft_at_its_exposure() -> None:
    nothing = Telemetry(0.0)
    moment = metadata(0.1, -0.2, math.pi / 2, -0.4)
    told, gimbal = with_metadata(nothing, moment, 5.0)
    assert (told.roll_rad, told.pitch_rad, told.heading_rad) == pytest.approx((0.1, -0.2, math.pi / 2))
    assert gimbal.pitch_rad == pytest.approx(-0.4)
    assert gimbal.yaw_rad == pytest.approx(0.1)
    assert told.velocity_in_level_mps == pytest.approx(np.array([2.0, 0.0, 0.5]), abs=1e-9)
    assert (told.attitude_t_s, told.velocity_t_s) == (5.0, 5.0)
    newer = merged(told, "attitude", {"roll": 0.3, "pitch": 0.0, "yaw": 1.0}, 5.1)
    assert with_metadata(newer, moment, 5.05)[0].roll_rad == 0.3  # an older one does not undo it
    assert merged(told, "attitude", {"roll": 0.3, "pitch": 0.0, "yaw": 1.0}, 4.9).roll_rad == pytest.approx(0.1)
    unset = metadata(0.0, 0.0, 0.0, 0.0)
    unset["camera"]["quat"] = dict.fromkeys("wxyz", 0.0)
    with pytest.raises(ValueError, match="quaternion"):
        with_metadata(nothing, unset, 5.0)


def test_a_python_without_olympe_says_so(tmp_path: Path) -> None:
    camera = Camera.from_fov(64, 36, 69.0)
    flown = anafi(VehicleSetup(Address("anafi", "127.0.0.1", {}), camera, vehicle_table(None)))
    with pytest.raises(VehicleError, match="has no Olympe that works"):
        flown.open()
