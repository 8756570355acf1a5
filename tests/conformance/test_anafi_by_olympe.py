"""What an ANAFI vehicle does before Parrot's own device end, when all is well and when it is not."""

import json
import math
import os
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from anafi_bench import CAMERA, GREEN_BGR, Device, bench

from shipland.errors import VehicleError
from shipland.estimation.identify import identify
from shipland.messages import Decision, FlightRecord, Frame, Intent, Observation, PilotCommand, Telemetry
from shipland.vehicles.anafi.vehicle import AnafiVehicle

pytestmark = [pytest.mark.slow, pytest.mark.flaky(reruns=2, reruns_delay=2)]
"""They fly in real time: other tests beside them can keep the machine from it, not three times."""


def fly(
    vehicle: AnafiVehicle,
    seconds: float,
    *sticks: float,
    gimbal_rad: float = -0.2,
    intent: Intent = Intent.FLY,
    low: bool = False,
) -> list[tuple[Frame | None, Telemetry]]:
    """Cycles with the same sticks, until the vehicle gives no more."""
    pairs, end_s = [], time.monotonic() + seconds
    while time.monotonic() < end_s and (pair := vehicle.read()) is not None:
        pairs.append(pair)
        vehicle.send(PilotCommand(pair[1].t_s, *sticks, gimbal_rad, intent, at_contact_height=low))
    return pairs


def sticks_there(vehicle: AnafiVehicle, aircraft: Device, wanted: list[int], *sticks: float, intent: Intent) -> bool:
    """Whether these sticks come to be the aircraft's; some time is given, as the machine may stand still."""
    for _ in range(5):
        fly(vehicle, 1.0, *sticks, intent=intent)
        if aircraft.report()["pcmd"][-1][:5] == wanted:
            return True
    return False


def end_of(vehicle: AnafiVehicle, within_s: float, *sticks: float) -> float:
    """How long the flight goes on with these sticks [s]."""
    begun_s = time.monotonic()
    fly(vehicle, within_s, *sticks)
    assert vehicle.end_reason
    return time.monotonic() - begun_s


def test_limits_sticks_and_gimbal_arrive() -> None:
    with bench() as (vehicle, aircraft):
        vehicle.open()
        assert sticks_there(vehicle, aircraft, [1, -10, 20, -30, 5], 20.4, -10.0, 5.0, -30.0, intent=Intent.FLY)
        report = aircraft.report()
        assert report["limits"] == {"tilt": 15.0, "climb": 1.0, "turn": 40.0}
        assert report["gimbal"] == pytest.approx(math.degrees(-0.2), abs=1e-3)
        # Its flag is for roll and pitch alone.
        assert sticks_there(vehicle, aircraft, [0, 0, 0, 40, 0], 0.0, 0.0, 0.0, 40.0, intent=Intent.FLY)
        assert sticks_there(vehicle, aircraft, [0, 0, 0, 0, 0], 30.0, 30.0, 30.0, 30.0, intent=Intent.HOLD)
        report = aircraft.report()
        numbers = np.array([entry[5] >> 24 for entry in report["pcmd"]])
        assert set(np.diff(numbers).tolist()) <= {1, -255}  # none was lost, none came twice
        gaps_s = np.diff(report["pcmd_s"])[-50:]
        assert np.median(gaps_s) == pytest.approx(0.04, abs=0.004)


def test_events_and_metadata_become_telemetry_of_known_age() -> None:
    with bench() as (vehicle, _):
        vehicle.open()
        fly(vehicle, 2.0, 60.0, 0.0, 0.0, 50.0)
        pairs = fly(vehicle, 1.0, 60.0, 0.0, 0.0, 50.0)
        telemetry = [telemetry for _, telemetry in pairs]
        last = telemetry[-1]
        assert last.flying
        assert last.battery_percent == 83.0
        assert last.link_percent == 80.0
        assert last.height_m is not None and last.height_m > 0.3
        assert last.pitch_rad == pytest.approx(math.radians(-9.0), abs=0.01)
        assert last.velocity_in_level_mps is not None and last.velocity_in_level_mps[0] > 1.0
        ages_s = [it.t_s - it.attitude_t_s for it in telemetry if it.attitude_t_s is not None]
        assert len(ages_s) == len(telemetry)
        assert min(ages_s) >= 0.1
        assert max(ages_s) < 0.6  # a picture's latency and a slow decoder
        # the heading is true at the time that it says: it turns at 20 °/s
        headings = np.unwrap([it.heading_rad for it in telemetry])
        times_s = [it.heading_t_s for it in telemetry]
        rate = np.polyfit(times_s, headings, 1)[0]
        assert math.degrees(rate) == pytest.approx(20.0, abs=2.0)


def test_pictures_come_with_the_cameras_attitude() -> None:
    with bench() as (vehicle, _):
        vehicle.open()
        pairs = fly(vehicle, 2.0, 0.0, 0.0, 0.0, 0.0, gimbal_rad=-0.3)
        frames = [frame for frame, _ in pairs if frame is not None]
        assert len(frames) > 30
        image = frames[-1].image
        assert image is not None
        assert image.shape == (CAMERA.height_px, CAMERA.width_px, 3)
        assert image[176, 320].tolist() == pytest.approx(GREEN_BGR, abs=12)
        assert image[20, 20].tolist() == pytest.approx((90, 90, 90), abs=12)
        assert frames[-1].gimbal.pitch_rad == pytest.approx(-0.3, abs=1e-3)
        assert {frame.gimbal_age_s for frame in frames} == {0.0}
        assert frames[-1].gimbal.roll_rad == pytest.approx(0.02, abs=1e-3)  # of the picture, not of the event
        exposed_s = np.array([frame.t_s for frame in frames])
        assert np.diff(exposed_s).min() > 0.0
        ages_s = [telemetry.t_s - frame.t_s for frame, telemetry in pairs if frame is not None]
        assert 0.28 <= np.median(ages_s) < 0.6


def test_the_checklist_finds_what_is_not_in_order() -> None:
    with bench() as (vehicle, aircraft):
        vehicle.connect()
        time.sleep(1.5)
        assert [check.name for check in vehicle.checks() if not check.ok] == []
        assert aircraft.report()["pcmd"] == []  # who only looks sends no sticks
    with bench(max_tilt_deg=44.0) as (vehicle, _):  # an ANAFI tilts by 40° at most
        vehicle.connect()
        lines = {check.name: check for check in vehicle.checks()}
        assert not lines["limits"].ok
        assert "40.0" in lines["limits"].words


def test_it_lands_on_what_it_cannot_sink_through(tmp_path: Path) -> None:
    with bench(log=tmp_path / "link.jsonl") as (vehicle, aircraft):
        vehicle.open()
        fly(vehicle, 0.5, 0.0, 0.0, -40.0, 0.0, intent=Intent.LAND)
        assert "ardrone3.Piloting.Landing" not in [name for name, _ in aircraft.report()["heard"]]
        aircraft.say("deck")
        fly(vehicle, 2.0, 0.0, 0.0, -40.0, 0.0, intent=Intent.LAND)
        assert "ardrone3.Piloting.Landing" not in [name for name, _ in aircraft.report()["heard"]]
        fly(vehicle, 6.0, 0.0, 0.0, -40.0, 0.0, intent=Intent.LAND, low=True)
        assert vehicle.end_reason == "landed: the motors have stopped"
        report = aircraft.report()
        assert report["state"] == "landed"
        assert "ardrone3.Piloting.Landing" in [name for name, _ in report["heard"]]
        assert report["pcmd"][-1][:5] == [0, 0, 0, 0, 0]  # its own landing is left alone
    lines = [json.loads(line) for line in (tmp_path / "link.jsonl").read_text().splitlines()]
    assert {"sticks": [0, 0, 0, -40]} in [line.get("to") for line in lines]
    kinds = {line["from"]["kind"] for line in lines if "from" in line}
    assert {"attitude", "speed", "altitude", "flying", "picture", "limits", "battery"} <= kinds


def test_identify_finds_the_aircrafts_own_constants() -> None:
    """From sticks through Olympe to the aircraft, and back through events and metadata to a response.

    A busy machine delays sticks behind their log: what the device end saw of it counts as the aircraft's.
    """
    records, late_s = random_flight(22.0)
    found = identify(records)
    assert found.level is not None and found.climb is not None and found.turn is not None
    assert math.degrees(found.level.full) == pytest.approx(15.0, rel=0.05)
    assert found.level.lag_s + found.level.delay_s == pytest.approx(0.15 + late_s, abs=0.04)
    assert found.climb.full == pytest.approx(1.0, rel=0.05)
    assert found.climb.lag_s + found.climb.delay_s == pytest.approx(0.2 + late_s, abs=0.05)
    assert math.degrees(found.turn.full) == pytest.approx(40.0, rel=0.05)
    assert found.drag_per_s == pytest.approx(0.3, abs=0.05)


def random_flight(time_s: float) -> tuple[list[FlightRecord], float]:
    """What a log holds of a flight with other sticks every second, and how late they reached the aircraft [s]."""
    rng = np.random.default_rng(3)
    records: list[FlightRecord] = []
    with bench(latency_s=0.01, event_latency_s=0.002) as (vehicle, aircraft):  # on this machine nothing is late
        vehicle.open()
        for _ in range(int(time_s)):
            sticks = rng.choice([-60.0, -30.0, 30.0, 60.0], 4).tolist()
            for frame, telemetry in fly(vehicle, 1.0, *sticks):
                if frame is not None:
                    command = PilotCommand(telemetry.t_s, *sticks, -0.2)
                    seen = Observation(frame.t_s, frame.gimbal)
                    frame = replace(frame, image=None)
                    records.append(FlightRecord(frame, telemetry, seen, Decision(command, None, ""), None))
        report = aircraft.report()
    commands = [record.decision.command for record in records]
    logged = [[it.roll_percent, it.pitch_percent, it.yaw_percent, it.heave_percent] for it in commands]
    heard = list(zip(report["pcmd_s"], report["pcmd"], strict=True))
    late_s = [
        next(at_s for at_s, sticks in heard if at_s >= command.t_s and sticks[1:5] == logged[index]) - command.t_s
        for index, command in enumerate(commands)
        if index and logged[index] != logged[index - 1]
    ]
    return records, float(np.mean(late_s))


def test_a_stalled_loop_releases_the_sticks() -> None:
    with bench() as (vehicle, aircraft):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        assert aircraft.report()["pcmd"][-1][:3] == [1, 0, 60]
        time.sleep(1.5)
        report = aircraft.report()
        assert report["pcmd"][-1][:5] == [0, 0, 0, 0, 0]
        assert report["now_s"] - report["pcmd_s"][-1] < 1.0  # they go on, on a busy machine too
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        assert aircraft.report()["pcmd"][-1][:3] == [1, 0, 60]


def test_lost_video_leaves_telemetry_and_ends_the_flight_in_time() -> None:
    with bench(video_timeout_s=1.5) as (vehicle, aircraft):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        aircraft.say("freeze")
        fly(vehicle, 1.0, 0.0, 0.0, 0.0, 0.0)
        aircraft.say("thaw")
        back = [frame for frame, _ in fly(vehicle, 1.5, 60.0, 0.0, 0.0, 0.0) if frame is not None]
        assert len(back) > 5
        assert not vehicle.end_reason
        aircraft.say("freeze")
        dark = [telemetry for frame, telemetry in fly(vehicle, 5.0, 0.0, 60.0, 0.0, 0.0) if frame is None]
        assert "video lost" in vehicle.end_reason
        assert 4 <= len(dark) <= 9  # a cycle every 0.2 s, for 1.5 s
        assert dark[-1].attitude_t_s > dark[0].attitude_t_s
        time.sleep(0.3)
        report = aircraft.report()
        assert report["state"] == "hovering"
        assert report["pcmd"][-1][:5] == [0, 0, 0, 0, 0]


def test_a_silent_aircraft_ends_the_flight_with_the_sticks_released() -> None:
    with bench(link_timeout_s=1.5) as (vehicle, aircraft):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        aircraft.say("mute")
        dark = fly(vehicle, 5.0, 60.0, 0.0, 0.0, 0.0)
        assert 1.0 < dark[-1][1].t_s - dark[0][1].t_s < 3.0
        # until then the pictures tell the attitude, and the velocity
        assert len({telemetry.attitude_t_s for _, telemetry in dark}) > 15
        assert len({telemetry.velocity_t_s for _, telemetry in dark}) > 15
        assert "link lost" in vehicle.end_reason
        time.sleep(0.3)
        assert aircraft.report()["pcmd"][-1][:5] == [0, 0, 0, 0, 0]


def test_an_aircraft_that_is_gone_ends_the_flight() -> None:
    with bench(video_timeout_s=20.0) as (vehicle, aircraft):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        aircraft.process.kill()
        aircraft.process.wait()
        assert end_of(vehicle, 6.0, 60.0, 0.0, 0.0, 0.0) < 5.0
        assert "link lost" in vehicle.end_reason


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("state landing", "somebody else lands"),
        ("home", "flies home by itself: lowBattery"),
        ("state emergency", "motors"),
    ],
)
def test_whoever_takes_the_aircraft_keeps_it(words: str, reason: str) -> None:
    with bench() as (vehicle, aircraft):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        aircraft.say(words)
        end_of(vehicle, 3.0, 60.0, 0.0, 0.0, 0.0)
        assert reason in vehicle.end_reason
        time.sleep(0.3)
        before = len(aircraft.report()["pcmd"])
        vehicle.send(PilotCommand(time.monotonic(), 80.0, 0.0, 0.0, 0.0, 0.0))
        time.sleep(0.7)
        vehicle.close()
        assert len(aircraft.report()["pcmd"]) == before


def test_whoever_lands_it_during_our_take_off_keeps_it() -> None:
    with bench(engage_timeout_s=20.0) as (vehicle, aircraft):
        threading.Timer(0.0, lambda: land_as_soon_as_it_rises(aircraft)).start()
        with pytest.raises(VehicleError, match="somebody else lands"):
            vehicle.open()
        assert aircraft.report()["pcmd"] == []
        assert vehicle.in_command == "somebody else (landing)"


def land_as_soon_as_it_rises(aircraft: Device) -> None:
    until_s = time.monotonic() + 60.0
    while time.monotonic() < until_s and aircraft.report()["state"] != "takingoff":
        time.sleep(0.02)
    aircraft.say("state landing")


def test_the_death_of_olympes_process_is_noticed() -> None:
    with bench() as (vehicle, _):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        assert vehicle._process is not None
        os.kill(vehicle._process._process.pid, signal.SIGKILL)
        assert end_of(vehicle, 3.0, 60.0, 0.0, 0.0, 0.0) < 1.0
        assert "has ended" in vehicle.end_reason
        vehicle.send(PilotCommand(time.monotonic(), 80.0, 0.0, 0.0, 0.0, 0.0))
        assert vehicle.read() is None


def test_a_hanging_process_of_olympe_is_noticed() -> None:
    with bench(link_timeout_s=1.5) as (vehicle, _):
        vehicle.open()
        fly(vehicle, 0.5, 60.0, 0.0, 0.0, 0.0)
        assert vehicle._process is not None
        os.kill(vehicle._process._process.pid, signal.SIGSTOP)
        assert end_of(vehicle, 5.0, 60.0, 0.0, 0.0, 0.0) < 3.0
        assert "link lost" in vehicle.end_reason


def test_nobody_there_and_no_stream_are_one_line() -> None:
    with bench() as (vehicle, _):
        vehicle._setup.command[-1] = "rtsp://127.0.0.1:1/live"
        with pytest.raises(VehicleError, match="no video from rtsp"):
            vehicle.open()
    with bench(connect_timeout_s=4.0) as (vehicle, aircraft):
        aircraft.process.kill()
        aircraft.process.wait()
        with pytest.raises(VehicleError, match="does not answer"):
            vehicle.open()
