"""What full sticks mean, found from flights."""

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shipland.api import fly
from shipland.commands.identify import Identify
from shipland.config import build
from shipland.errors import ConfigError, DataError
from shipland.estimation.identify import identify
from shipland.guidance.pilot import Pilot, PilotSetup
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import (
    Decision,
    FlightRecord,
    Frame,
    GimbalAttitude,
    Intent,
    Observation,
    PilotCommand,
    Telemetry,
)
from shipland.record.info import FlightInfo
from shipland.scenario.autonomy import build_vehicle, response_of
from shipland.scenario.real_vehicle import identified, make_vehicle
from shipland.scenario.scenario import load_scenario
from shipland.vehicles.address import vehicle_table
from shipland.vehicles.anafi.vehicle import AnafiVehicle
from shipland.vehicles.mavlink.parameters import MavlinkParameters, VehicleLimits, response_within
from shipland.vehicles.mavlink.state import ARDUPILOT


@cache
def flown(kind: str, wind_mps: float = 0.0) -> tuple[FlightRecord, ...]:
    """The simulated aircraft, far from the ship, with sticks that change each second or so; flown once."""
    scenario = load_scenario(
        "near",
        aircraft={"loop": {"kind": kind, "velocity_reference": "ground"}},
        start={"distance_m": 300.0, "height_m": 40.0},
        delays={"telemetry": {"profile": "mavlink"}},
        wind={"mean_mps": wind_mps},
    )
    vehicle, rng = build_vehicle(scenario, 4, None), np.random.default_rng(9)
    vehicle.open()
    sticks, until_s, rows = np.zeros(4), 0.0, []
    while (pair := vehicle.read()) is not None and pair[1].t_s < 40.0:
        frame, telemetry = pair
        if telemetry.t_s >= until_s:
            until_s = telemetry.t_s + rng.uniform(0.6, 1.6)
            sticks = rng.choice([-60.0, -30.0, 30.0, 60.0], 4)
        command = PilotCommand(telemetry.t_s + 0.03, *sticks.tolist(), 0.0)
        vehicle.send(command)
        seen = Observation(frame.t_s, frame.gimbal)
        rows.append(FlightRecord(frame, telemetry, seen, Decision(command, None, ""), None))
    vehicle.close()
    return tuple(rows)


def test_the_attitude_loop_is_found() -> None:
    found = identify(flown("attitude"))
    assert found.kind == "attitude"
    assert found.level is not None and found.climb is not None and found.turn is not None
    assert math.degrees(found.level.full) == pytest.approx(15.0, rel=0.1)
    assert found.level.lag_s + found.level.delay_s == pytest.approx(0.2, abs=0.08)
    assert found.climb.full == pytest.approx(1.0, rel=0.15)
    assert math.degrees(found.turn.full) == pytest.approx(40.0, rel=0.15)
    assert found.drag_per_s == pytest.approx(0.3, abs=0.2)


def test_the_drag_is_found_in_a_wind_that_comes_from_another_side_as_the_aircraft_turns() -> None:
    assert identify(flown("attitude", wind_mps=6.0)).drag_per_s == pytest.approx(0.3, abs=0.06)


def test_sticks_of_a_landing_that_was_broken_off_count_for_what_comes_after() -> None:
    rows = list(flown("attitude"))
    for index, row in enumerate(rows):
        if 10.0 < row.telemetry.t_s < 18.0:
            command = replace(row.decision.command, intent=Intent.LAND)
            rows[index] = replace(row, decision=replace(row.decision, command=command))
    found = identify(rows)
    assert found.turn is not None
    assert math.degrees(found.turn.full) == pytest.approx(40.0, rel=0.05)
    assert found.turn.explained > 0.98


@pytest.mark.parametrize("axis", ["pitch", "roll", "heave", "yaw"])
@pytest.mark.parametrize("kind", ["attitude", "velocity"])
def test_an_axis_that_answers_the_other_way_round_is_named(kind: str, axis: str) -> None:
    """As behind a bridge that takes z for up where it is down."""
    rows = []
    for row in flown(kind):
        command, name = row.decision.command, f"{axis}_percent"
        turned = replace(command, **{name: -getattr(command, name)})
        rows.append(replace(row, decision=replace(row.decision, command=turned)))
    with pytest.raises(DataError, match=f"^{axis}: the vehicle answers the other way round"):
        identify(rows)


def test_holding_against_a_strong_wind_does_not_look_like_it() -> None:
    """Released sticks hold with more tilt than the full stick gives, which flies with the wind at first."""
    flight = fly(load_scenario("near", wind={"mean_mps": 9.0}, time_limit_s=30.0), seed=3)
    identify(flight.records)


def test_what_stands_on_the_deck_tells_nothing() -> None:
    rows = [row for row in flown("attitude") if row.telemetry.t_s < 25.0]
    last = rows[-1]
    for index in range(1, 300):
        t_s = last.telemetry.t_s + index / 30.0
        command = replace(last.decision.command, t_s=t_s, heave_percent=-100.0, intent=Intent.LAND)
        still = replace(last.telemetry, t_s=t_s, velocity_in_level_mps=np.zeros(3), velocity_t_s=t_s, attitude_t_s=t_s)
        rows.append(replace(last, telemetry=still, decision=replace(last.decision, command=command)))
    found = identify(rows)
    assert found.climb is not None
    assert found.climb.full == pytest.approx(1.0, rel=0.15)
    assert found.climb.explained > 0.8


def test_the_velocity_loop_is_found() -> None:
    found = identify(flown("velocity"))
    assert found.kind == "velocity"
    assert found.level is not None
    assert found.level.full == pytest.approx(7.5, rel=0.25)
    assert found.level.explained > 0.7


def flown_by_speed(seconds: float = 40.0) -> Iterator[FlightRecord]:
    """Speeds tracked as PX4 does, 4 m/s at full stick, in a steady wind; 50 rows a second."""
    rng, step_s = np.random.default_rng(3), 0.005
    sticks, asked, velocity, summed, tilt = np.zeros(2), [np.zeros(2)] * 24, np.zeros(2), np.zeros(2), np.zeros(2)
    wind_mps2 = np.array([0.6, -0.9])
    for index in range(int(seconds / step_s)):
        t_s = index * step_s
        if index % 200 == 0:
            sticks = rng.choice([-0.5, -0.2, 0.2, 0.5], 2)
        if index % 4 == 0:
            command = PilotCommand(t_s, *(100.0 * sticks).tolist(), 0.0, 0.0, 0.0)
            roll, pitch = math.atan(tilt[1] / 9.80665), -math.atan(tilt[0] / 9.80665)
            told = np.append(velocity, 0.0)
            telemetry = Telemetry(t_s, roll, pitch, 0.0, 1.0, told, None, None, True, t_s, t_s, t_s, t_s)
            gimbal = GimbalAttitude(0.0, 0.0)
            decision = Decision(command, None, "")
            yield FlightRecord(Frame(t_s, None, gimbal), telemetry, Observation(t_s, gimbal), decision, None)
        asked = [*asked[1:], 4.0 * sticks]  # 0.12 s
        error = asked[0] - velocity
        summed = summed + 0.4 * error * step_s
        tilt = tilt + (1.8 * error + summed - tilt) * step_s / 0.09
        velocity = velocity + (tilt + wind_mps2 - 0.3 * velocity) * step_s


def test_the_lean_of_a_vehicle_that_flies_speeds_is_found() -> None:
    found = identify(list(flown_by_speed()))
    assert found.kind == "velocity"
    assert found.loop is not None
    assert found.loop.full == pytest.approx(4.0, rel=0.03)
    assert found.loop.servo_per_s == pytest.approx(1.8, rel=0.05)
    assert found.loop.lag_s == pytest.approx(0.09, abs=0.01)
    assert found.loop.delay_s == pytest.approx(0.12, abs=0.01)
    assert f"\nlag_s = {found.loop.lag_s:.4f}\n" in found.toml(0.02)
    assert "tilt" in found.table()


def test_tilts_and_speeds_that_were_never_told_together_leave_the_loop_out() -> None:
    rows = []
    for row in flown_by_speed():
        half = {"roll_rad": None, "pitch_rad": None} if row.telemetry.t_s > 20.0 else {"velocity_in_level_mps": None}
        rows.append(replace(row, telemetry=replace(row.telemetry, **half)))
    found = identify(rows)
    assert found.kind == "velocity"
    assert found.loop is None


def test_what_is_found_goes_through_the_door(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    found = identify(flown("attitude"))
    path.write_text(found.toml(0.025), encoding="utf-8")
    assumed = response_of(load_scenario("near"))
    taken = identified(path, assumed)
    assert found.level is not None
    assert taken.max_tilt_rad == pytest.approx(found.level.full, abs=1e-4)
    assert taken.hold_below_percent == assumed.hold_below_percent
    assert "15" in found.table() or "rad of tilt" in found.table()
    with pytest.raises(ConfigError, match=r"no \[response.velocity\].* it holds \[response.attitude\]"):
        identified(path, replace(ANAFI_LIKE, kind="velocity", max_speed_mps=5.0, servo_per_s=1.0))


def moving_sticks(setup: PilotSetup) -> Pilot:
    """Other sticks each second, as a go-around, which the safety lets through with nothing in view."""

    class Moving:
        def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
            sticks = np.random.default_rng(int(telemetry.t_s)).choice([-60.0, -30.0, 30.0, 60.0], 4)
            command = PilotCommand(telemetry.t_s, *sticks.tolist(), 0.0, Intent.GO_AROUND)
            return Decision(command, None, "moving")

    return Moving()


def test_from_a_flights_log_to_the_pilot_of_every_vehicle(without_plots: None, tmp_path: Path) -> None:
    """The commands of "Fly a vehicle", and what an ANAFI's, an ArduPilot's and the simulated pilot make of the file."""
    scenario = load_scenario(
        "near",
        start={"distance_m": 300.0, "height_m": 40.0},
        delays={"telemetry": {"profile": "mavlink"}},
        time_limit_s=40.0,
    )
    fly(scenario, pilot=moving_sticks, vision="geometric", out=tmp_path, video=False)
    path = tmp_path / "vehicle.toml"
    assert Identify(tmp_path / "flight.mcap", path).run() == 0
    simulated = identified(path, response_of(scenario))
    assert simulated.lag_s != response_of(scenario).lag_s
    assert simulated.climb_dead_s == pytest.approx(response_of(scenario).climb_dead_s, abs=0.05)
    made = make_vehicle("anafi://192.168.42.1", scenario, None, path)
    assert isinstance(made, AnafiVehicle)
    anafi = made.response()
    assert (anafi.max_tilt_rad, anafi.lag_s, anafi.climb_lag_s, anafi.max_climb_mps) == pytest.approx(
        (simulated.max_tilt_rad, simulated.lag_s, simulated.climb_lag_s, simulated.max_climb_mps)
    )
    limits = VehicleLimits(math.inf, math.inf, math.inf, math.inf, None, False, math.nan)
    table = vehicle_table(path)
    parameters = build(MavlinkParameters, table["mavlink"], "mavlink")
    ardupilot = response_within(parameters, limits, ARDUPILOT, table["response"])
    assert (ardupilot.lag_s, ardupilot.turn_lag_s) == pytest.approx((simulated.lag_s, simulated.turn_lag_s))


def info_of(kind: str, command: str = "shipland fly") -> FlightInfo:
    """Of a flight in whose configuration the simulated aircraft's sticks are of a kind."""
    return FlightInfo("near", 1, "horizon", "0", "0", 0.3, command=command, configuration=CONFIGURATION % kind)


CONFIGURATION = '{"aircraft": {"loop": {"kind": "%s"}}}'


def test_a_simulated_flight_that_tells_another_kind_than_flew_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A landing hardly changes its sticks: a tilt that is held looks like a speed."""
    info, out = info_of("attitude"), tmp_path / "vehicle.toml"
    log = SimpleNamespace(records=flown("velocity"), header=SimpleNamespace(info=info))
    monkeypatch.setattr("shipland.record.reader.read_log", lambda _path: log)
    with pytest.raises(DataError, match=r"meant a tilt, but explain a speed better.*fly one in which every stick"):
        Identify(tmp_path / "flight.mcap", out).run()
    assert not out.exists()
    log.header.info = info_of("attitude", "shipland fly --vehicle mavlink://udp:127.0.0.1:14550")
    assert Identify(tmp_path / "flight.mcap", out).run() == 0  # what flew is another aircraft


def test_the_name_of_a_log_may_be_no_utf_8(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    log = SimpleNamespace(records=flown("attitude"), header=SimpleNamespace(info=info_of("attitude")))
    monkeypatch.setattr("shipland.record.reader.read_log", lambda _path: log)
    assert Identify(tmp_path / os.fsdecode(b"fl\xfcg.mcap"), tmp_path / "vehicle.toml").run() == 0
    assert (tmp_path / "vehicle.toml").read_text(encoding="utf-8").startswith("# shipland identify fl?g.mcap\n")


def test_a_flight_that_tells_nothing_is_refused() -> None:
    still = [
        FlightRecord(
            Frame(t_s, None, GimbalAttitude(0.0, 0.0)),
            Telemetry(t_s, 0.0, 0.0, 0.0, 1.0, np.zeros(3), None, None, True),
            Observation(t_s, GimbalAttitude(0.0, 0.0)),
            Decision(PilotCommand(t_s, 0.0, 0.0, 0.0, 0.0, 0.0), None, ""),
            None,
        )
        for t_s in np.arange(0.0, 10.0, 0.1).tolist()
    ]
    with pytest.raises(DataError, match="no stick"):
        identify(still)
    with pytest.raises(DataError, match="at least 50"):
        identify(still[:10])
