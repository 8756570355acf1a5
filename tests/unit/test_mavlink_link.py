"""The wire and the state of a MAVLink vehicle, without a wire."""

import io
import itertools
import math
import os
import pty
import socket
import sys
import threading
import time
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

m = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")

from fuzz_link import OURS, STRANGER, Nowhere, fuzz  # noqa: E402

from shipland.camera import Camera  # noqa: E402
from shipland.config import packaged_toml  # noqa: E402
from shipland.errors import ConfigError, VehicleError  # noqa: E402
from shipland.vehicles.address import Address, VehicleSetup, vehicle_table  # noqa: E402
from shipland.vehicles.gimbal import gimbal_at  # noqa: E402
from shipland.vehicles.mavlink.control import Control  # noqa: E402
from shipland.vehicles.mavlink.link import LinkCounts, read_key  # noqa: E402
from shipland.vehicles.mavlink.parameters import MavlinkParameters, VehicleLimits, response_within  # noqa: E402
from shipland.vehicles.mavlink.ports import Place  # noqa: E402
from shipland.vehicles.mavlink.session import Session, advice_on_silence  # noqa: E402
from shipland.vehicles.mavlink.setpoints import attitude_message  # noqa: E402
from shipland.vehicles.mavlink.setup import MavlinkSetup  # noqa: E402
from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, AutopilotState  # noqa: E402
from shipland.vehicles.mavlink.telemetry import telemetry_of  # noqa: E402
from shipland.vehicles.wanted import HeadingSetPoint, Wanted  # noqa: E402


def session(key: bytes | None = None) -> tuple[Session, Nowhere]:
    port = Nowhere()
    return Session(port, 245, 191, None, key, None, lambda *_: None), port


def heartbeat(mode: int = 4) -> object:
    return m.MAVLink_heartbeat_message(2, 3, 129, mode, 4, 3)


def attitude(boot_ms: int) -> object:
    return m.MAVLink_attitude_message(boot_ms, 0.1, 0.2, 0.3, 0, 0, 0)


def feed(made: Session, message: object, t_s: float, system: int = 1, component: int = 1) -> None:
    made.link.take(message.pack(m.MAVLink(None, srcSystem=system, srcComponent=component)), OURS, t_s)


def heard_session() -> Session:
    made, _ = session()
    feed(made, heartbeat(), 100.0)
    return made


def test_hostile_messages_move_nothing() -> None:
    counts, _, sent, sane = fuzz(4000, 1)
    assert counts.failed == 0
    assert counts.malformed > 100
    assert counts.foreign > 100
    assert sent == []
    assert sane


def test_a_stranger_is_not_heard() -> None:
    made = heard_session()
    made.link.take(heartbeat(9).pack(m.MAVLink(None, srcSystem=1, srcComponent=1)), STRANGER, 100.1)
    feed(made, heartbeat(9), 100.2, system=2)
    assert made.state.mode == 4
    assert made.link.counts.foreign == 2


def test_a_forged_time_stamp_does_not_lock_the_sender_out() -> None:
    key = bytes(range(32))
    made, codec = session(key)[0], m.MAVLink(None, srcSystem=1, srcComponent=1)
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
    made = heard_session()
    rng = np.random.default_rng(1)
    errors = []
    for index in range(400):
        boot_ms = 5000 + 20 * index
        received_s = 100.0 + 0.02 * index + 0.01 + 0.05 * rng.random()
        feed(made, attitude(boot_ms), received_s)
        errors.append(made.state.attitude_t_s - (100.0 + 0.02 * index))
    assert min(errors[50:]) >= 0.009
    assert max(errors[50:]) < 0.02
    assert made.state.clock.restarts == 0
    feed(made, attitude(200), 119.9)  # one alone is another vehicle's, or came by a longer way
    feed(made, attitude(13000), 119.92)
    assert made.state.clock.restarts == 0
    for boot_ms, received_s in ((200, 119.96), (220, 119.98), (240, 120.0)):
        feed(made, attitude(boot_ms), received_s)
    assert made.state.clock.restarts == 1
    telemetry = telemetry_of(made.state, 121.0)
    assert telemetry.attitude_t_s == pytest.approx(120.0)
    assert telemetry.height_m is None


def test_one_message_stamped_ahead_is_no_restart_and_times_stay() -> None:
    made = heard_session()
    for index in range(100):
        if index == 50:
            feed(made, attitude(900_000), 100.99)
            assert made.state.attitude_t_s == pytest.approx(100.99)
        feed(made, attitude(5000 + 20 * index), 100.0 + 0.02 * index)
        assert made.state.attitude_t_s == pytest.approx(100.0 + 0.02 * index)
    assert made.state.clock.restarts == 0


def test_a_clock_that_leapt_ahead_is_followed_from_the_third_message_on() -> None:
    """As after this computer was suspended, or on a link that was late by over a second."""
    made = heard_session()
    for index in range(10):
        feed(made, attitude(5000 + 20 * index), 100.0 + 0.02 * index)
    for index in range(10):
        feed(made, attitude(65_000 + 20 * index), 100.3 + 0.02 * index + 0.01 * (index == 9))
    assert made.state.attitude_t_s == pytest.approx(100.48)
    assert made.state.clock.restarts == 0


def test_a_receiver_that_tells_no_channels_any_more_is_an_alert_and_one_that_never_did_is_none() -> None:
    made = heard_session()
    none, sticks = (m.MAVLink_rc_channels_message(10, count, *[us] * 18, 255) for count, us in ((0, 65535), (8, 1500)))
    for message, sticks_us, words in (
        (none, 0, ""),
        (sticks, 4, ""),
        (none, 0, "the receiver is in failsafe"),
        (none, 0, "the receiver is in failsafe"),
        (sticks, 4, ""),
    ):
        feed(made, message, 100.1)
        assert (len(made.state.sticks_us), made.state.alerts["receiver"][1]) == (sticks_us, words)


def mount(boot_ms: int, pitch_rad: float, device: int = 0) -> object:
    q = [math.cos(0.5 * pitch_rad), 0.0, math.sin(0.5 * pitch_rad), 0.0]
    return m.MAVLink_gimbal_device_attitude_status_message(0, 0, boot_ms, 0, q, 0, 0, 0, 0, gimbal_device_id=device)


def test_another_components_messages_do_not_count() -> None:
    made = heard_session()
    feed(made, attitude(60_000), 100.1)
    for component in (154, 191, 158):
        feed(made, m.MAVLink_attitude_message(10, 0.5, 0.5, 0.5, 0, 0, 0), 100.2, component=component)
        feed(made, heartbeat(5), 100.2, component=component)
        feed(made, m.MAVLink_rc_channels_message(10, 8, *[1900] * 18, 255), 100.2, component=component)
    assert (made.state.clock.restarts, made.state.mode, made.state.sticks_us) == (0, 4, ())
    assert made.state.roll_rad == pytest.approx(0.1)


def test_a_gimbals_clock_is_its_own_and_the_first_gimbal_is_followed() -> None:
    made = heard_session()
    feed(made, attitude(60_000), 100.0)
    feed(made, mount(2_000, -0.3), 100.1, component=154)
    feed(made, mount(9_000, 0.9), 100.2, component=171)
    feed(made, attitude(60_300), 100.3)
    assert made.state.clock.restarts == 0
    assert made.mounts == [(pytest.approx(100.1), 0.0, pytest.approx(-0.3), 0.0)]
    feed(made, mount(5, -0.4), 101.0, component=154)  # the gimbal starts anew, and the autopilot does not
    assert made.state.clock.restarts == 0
    assert made.state.gimbal_t_s == pytest.approx(101.0)


@pytest.mark.parametrize(
    ("flags", "yaw_rad"),
    [
        (0, 0.5),
        (m.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME | m.GIMBAL_DEVICE_FLAGS_YAW_LOCK, 0.5),
        (m.GIMBAL_DEVICE_FLAGS_YAW_LOCK, -0.2),
        (m.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME, -0.2),
    ],
)
def test_a_mount_that_looks_aside_says_so_against_the_nose(flags: int, yaw_rad: float) -> None:
    q = [math.cos(0.25), 0.0, 0.0, math.sin(0.25)]
    aside = m.MAVLink_gimbal_device_attitude_status_message(0, 0, 2_000, flags, q, 0, 0, 0, 0)
    made = heard_session()
    feed(made, m.MAVLink_attitude_message(60_000, 0.0, 0.0, 0.7, 0, 0, 0), 100.0)
    feed(made, aside, 100.1, component=154)
    assert made.mounts == [(pytest.approx(100.1), 0.0, 0.0, pytest.approx(yaw_rad))]
    assert gimbal_at(100.1, [], made.mounts, None)[0].yaw_rad == pytest.approx(yaw_rad)


def test_a_mounts_yaw_from_north_is_none_before_the_heading_is_known() -> None:
    q = [math.cos(0.25), 0.0, 0.0, math.sin(0.25)]
    flags = m.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
    made = heard_session()
    feed(made, m.MAVLink_gimbal_device_attitude_status_message(0, 0, 2_000, flags, q, 0, 0, 0, 0), 100.1, component=154)
    assert made.mounts == []


def test_a_mounts_yaw_is_interpolated_across_astern() -> None:
    at, _ = gimbal_at(0.5, [], [(0.0, 0.0, 0.0, 3.1), (1.0, 0.0, 0.0, -3.1)], None)
    assert abs(at.yaw_rad) == pytest.approx(math.pi, abs=0.01)


@pytest.mark.parametrize("value", [0.0, math.nan, 7.0])
def test_a_mount_whose_quaternion_is_none_does_not_look_level(value: float) -> None:
    made = heard_session()
    unknown = m.MAVLink_gimbal_device_attitude_status_message(0, 0, 2_000, 0, [value] * 4, 0, 0, 0, 0)
    feed(made, unknown, 100.1, component=154)
    assert made.mounts == []
    assert math.isnan(made.state.gimbal_t_s)


def test_answers_to_another_ground_station_are_not_ours() -> None:
    made = heard_session()
    feed(made, m.MAVLink_command_ack_message(400, 0, 0, 0, 255, 190), 100.1)
    assert made.state.acknowledged == {}
    for targets in ((0, 0), (245, 191), (245, 0)):
        feed(made, m.MAVLink_command_ack_message(400, 4, 0, 0, *targets), 100.2)
    assert made.state.acknowledged == {400: (4, 3)}


@pytest.mark.parametrize(("age_s", "lag_s", "asked", "handed"), [(0, 0, 1, 1), (0.5, 0, 0, 0), (0, 2, 0, 1)])
def test_no_mode_is_asked_for_while_the_present_one_is_not_known(
    age_s: float, lag_s: float, asked: int, handed: int
) -> None:
    """A heartbeat that is old, or came over a link that lags, may hide a person's mode; at the sticks it is deaf.

    Nor are motors started or stopped, or a take-off asked for.
    """
    made, port = session()
    now_s = time.monotonic()
    feed(made, heartbeat(), now_s - age_s)
    assert not made.command(m.MAV_CMD_DO_SET_MODE, 1, 5)  # how much the link lags is not known yet
    feed(made, m.MAVLink_timesync_message(5, int(1e9 * (now_s - 0.01 - lag_s))), now_s)
    for number in (m.MAV_CMD_DO_SET_MODE, m.MAV_CMD_COMPONENT_ARM_DISARM, m.MAV_CMD_NAV_TAKEOFF):
        assert made.command(number, 1, 5) == bool(asked)
    assert made.hand_over(0) == bool(handed)
    assert len(port.sent) == 3 * asked + handed
    assert made.command(m.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 20000)


class StalledDisk(io.BytesIO):
    """Takes nothing until it is freed."""

    def __init__(self) -> None:
        super().__init__()
        self.freed, self.written = threading.Event(), b""

    def write(self, data: bytes) -> int:
        self.freed.wait(20.0)
        self.written += data
        return len(data)


def test_a_disk_that_stalls_keeps_neither_set_points_nor_a_takeover() -> None:
    port, disk, seen = Nowhere(), StalledDisk(), list[int]()
    made = Session(port, 245, 191, None, None, disk, lambda _, after: seen.append(after.mode))

    def work_on() -> None:
        feed(made, heartbeat(), 100.0)
        feed(made, heartbeat(5), 100.1)
        made.beat()

    work = threading.Thread(target=work_on)
    work.start()
    work.join(5.0)
    assert not work.is_alive()
    assert seen == [4, 5]
    assert len(port.sent) == 1
    disk.freed.set()
    made.link.close()
    assert disk.written.count(b"\xfd") >= 3


def test_a_disk_that_is_full_is_told_at_the_end(caplog: pytest.LogCaptureFixture) -> None:
    for log, whole in ((Path("/dev/full"), False), (Path("/dev/null"), True)):
        made = Session(Nowhere(), 245, 191, None, None, log.open("wb"), lambda *_: None)
        feed(made, heartbeat(), 100.0)
        made.link.close()
        assert ("mavlink-log is not whole: No space left on device" in caplog.text) is not whole
        caplog.clear()


def test_a_second_batterys_charge_is_not_the_firsts() -> None:
    made = heard_session()
    for number, percent in ((0, 30), (1, 95)):
        message = m.MAVLink_battery_status_message(number, 0, 0, 300, [65535] * 10, 0, 0, 0, percent)
        feed(made, message, 100.1)
    assert telemetry_of(made.state, 100.2).battery_percent == 30.0


def test_a_radio_is_heard_from_the_vehicles_address_only() -> None:
    made = heard_session()
    radio = m.MAVLink_radio_status_message(127, 100, 100, 10, 10, 0, 0)
    made.link.take(radio.pack(m.MAVLink(None, srcSystem=51, srcComponent=68)), STRANGER, 100.1)
    assert made.state.link_percent is None
    feed(made, radio, 100.2, system=51, component=68)
    assert telemetry_of(made.state, 100.3).link_percent == pytest.approx(50.0)
    feed(made, m.MAVLink_attitude_message(10, 0.5, 0.5, 0.5, 0, 0, 0), 100.4, system=51, component=68)
    assert math.isnan(made.state.roll_rad)


def test_nothing_old_is_stamped_new() -> None:
    made = heard_session()
    feed(made, m.MAVLink_battery_status_message(0, 0, 0, 300, [65535] * 10, 0, 0, 0, 87), 100.0)
    feed(made, attitude(1_000), 100.0)
    feed(made, m.MAVLink_local_position_ned_message(4_000, 0, 0, 0, 1, 0, 0), 103.0)
    telemetry = telemetry_of(made.state, 103.0)
    assert telemetry.attitude_t_s == telemetry.velocity_t_s == pytest.approx(100.0)  # turned by a heading 3 s old
    assert telemetry_of(made.state, 111.0).battery_percent is None


def test_a_link_that_becomes_slow_shows_in_the_round_trip() -> None:
    made = heard_session()
    for index in range(20):
        trip_s = 0.01 if index < 10 else 0.8
        asked_s = 100.0 + index
        feed(made, m.MAVLink_timesync_message(5, int(1e9 * asked_s)), asked_s + trip_s)
    assert made.state.round_trip_s == pytest.approx(0.8)


SENSORS = 0xFFFF
FLYING = 1 | 2 | 4 | 8 | 16 | 32


@pytest.mark.parametrize(
    ("message", "well", "words"),
    [
        (
            m.MAVLink_sys_status_message(SENSORS, SENSORS, SENSORS & ~4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
            m.MAVLink_sys_status_message(SENSORS, SENSORS & ~4, SENSORS & ~4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
            "not healthy: 3d mag",
        ),
        (
            m.MAVLink_ekf_status_report_message(FLYING, 0.1, 0.1, 0.1, 1.2, 0.1),
            m.MAVLink_ekf_status_report_message(FLYING, 0.1, 0.1, 0.1, 0.7, 9.0),
            "estimator: compass innovation 1.5 of its limit",
        ),
        (
            m.MAVLink_ekf_status_report_message(32768 | 128 | 1 | 4, 0.1, 0.1, 0.1, 0.1, 0.1),
            m.MAVLink_ekf_status_report_message(FLYING, 0.1, 0.1, 0.1, 0.1, 0.1),
            "estimator: no position, GPS glitch",
        ),
        (
            m.MAVLink_estimator_status_message(0, FLYING & ~4 | 2048, 2.0, 0.1, 0.1, math.nan, 9.0, 9.0, 1.0, 1.0),
            m.MAVLink_estimator_status_message(0, FLYING, 0.9, 0.1, 0.1, 0.1, 9.0, 9.0, 1.0, 1.0),
            "estimator: no vertical speed, accelerometer error, velocity innovation 2.0 of its limit",
        ),
        (m.MAVLink_heartbeat_message(2, 3, 129, 4, 5, 3), heartbeat(), "the autopilot says CRITICAL"),
        (
            m.MAVLink_rc_channels_message(10, 8, 1500, 1500, 900, *[1500] * 15, 255),
            m.MAVLink_rc_channels_message(10, 8, *[1500] * 18, 255),
            "the receiver is in failsafe",
        ),
    ],
    ids=["sensors", "EKF variance", "EKF flags", "PX4's estimator", "system status", "receiver"],
)
def test_what_the_vehicle_complains_of_is_an_alert_until_it_is_well_or_silent(
    message: object, well: object, words: str
) -> None:
    made = heard_session()
    feed(made, message, 100.1)
    assert telemetry_of(made.state, 100.2).alerts == words
    assert telemetry_of(made.state, 105.0).alerts == ""
    feed(made, message, 106.0)
    feed(made, well, 106.1)
    assert telemetry_of(made.state, 106.2).alerts == ""


def test_histories_can_be_read_while_messages_come() -> None:
    """The checklist and the gimbal's attitude read what the receiving thread writes."""
    made, stop, interval_s = heard_session(), threading.Event(), sys.getswitchinterval()
    count, rows = itertools.count(1_000), list[tuple[float, float, float]]()

    def write() -> None:
        while not stop.is_set():
            boot_ms = next(count)
            feed(made, attitude(boot_ms), 1e-3 * boot_ms)

    for boot_ms in (next(count) for _ in range(512)):
        feed(made, attitude(boot_ms), 1e-3 * boot_ms)
    writer = threading.Thread(target=write)
    sys.setswitchinterval(1e-6)
    writer.start()
    try:
        for _ in range(300):
            rows = [row for row in made.attitudes if row[0] > 0.0]
            gimbal_at(1.0, made.attitudes, made.mounts, 0.0)
    finally:
        stop.set()
        writer.join()
        sys.setswitchinterval(interval_s)
    assert rows


def test_a_vehicle_that_is_no_multicopter_is_not_flown() -> None:
    """Mode 4 of an ArduPlane is ACRO."""
    made, _ = session()
    feed(made, m.MAVLink_heartbeat_message(1, 3, 129, 4, 4, 3), 100.0)
    made.link.start = lambda: None
    with pytest.raises(VehicleError, match="multicopters"):
        made.connect(0.1)


def test_a_hand_over_is_a_change_and_a_takeover_is_for_good() -> None:
    loiter, guided = (AutopilotState(autopilot=ARDUPILOT, mode=mode, armed=True) for mode in (5, 4))
    control = Control(80)
    control.see(loiter, guided)
    assert not control.has(guided)  # before we were ready
    control.begin(guided, asking=False)
    control.see(guided, guided)
    assert (control.has(guided), control.holder(guided)) == (False, "nobody: GUIDED is not handed over")
    control.see(guided, loiter)
    control.see(loiter, guided)
    assert (control.has(guided), control.holder(guided)) == (True, "shipland")
    assert not control.has(loiter)  # at the very set-point
    control.see(guided, loiter)
    control.see(loiter, guided)
    assert (control.has(guided), control.lost) == (False, "the pilot took over: LOITER")


@pytest.mark.parametrize("asking", [False, True])
def test_an_autopilot_that_restarted_before_the_hand_over_is_not_ours(asking: bool) -> None:
    """What was asked of it and read from it is of before: rates of telemetry, the gimbal, what sticks mean."""
    loiter = AutopilotState(autopilot=ARDUPILOT, mode=5, armed=True)
    again = replace(loiter, clock=replace(loiter.clock, restarts=1))
    guided = replace(again, mode=4)
    for connected in (loiter, again):
        control = Control(80)
        control.begin(connected, asking)
        control.see(connected, again)
        control.see(again, guided)
        assert (control.has(guided), control.lost) == (False, "the autopilot has restarted")


@pytest.mark.parametrize("what", ["restart", "disarmed", "a spare"])
def test_what_ends_the_flight_leaves_it_ours_to_hold_until_a_person_takes_it(what: str) -> None:
    guided = AutopilotState(autopilot=ARDUPILOT, mode=4, armed=True)
    restarted = replace(guided, clock=replace(guided.clock, restarts=1))
    happened = {
        "restart": restarted,
        "disarmed": replace(guided, armed=False),
        "a spare": replace(guided, armed=False, mode=0),
    }
    ours = restarted if what == "restart" else guided
    control = Control(80)
    control.begin(guided, asking=True)
    control.see(guided, guided)
    control.see(guided, happened[what])
    assert control.over
    assert control.has(happened[what]) == (what == "restart")  # nothing is sent to one that says it is disarmed
    control.see(happened[what], ours)
    assert control.has(ours)
    loiter = replace(ours, mode=5)
    control.see(ours, loiter)
    control.see(loiter, ours)
    assert (control.has(ours), control.lost) == (False, "the pilot took over: LOITER")


def test_a_vtol_in_forward_flight_is_not_ours() -> None:
    made, _ = session()
    feed(made, m.MAVLink_heartbeat_message(22, PX4, 129, 6 << 16, 4, 3), 100.0)
    hovers = m.MAVLink_extended_sys_state_message(m.MAV_VTOL_STATE_MC, 2)
    forward = m.MAVLink_extended_sys_state_message(m.MAV_VTOL_STATE_FW, 2)
    control = Control(80)
    control.begin(made.state, asking=True)
    feed(made, forward, 100.1)
    before = made.state
    control.see(before, before)
    assert not control.granted
    feed(made, hovers, 100.2)
    control.see(before, made.state)
    assert control.has(made.state)
    before = made.state
    feed(made, m.MAVLink_extended_sys_state_message(m.MAV_VTOL_STATE_TRANSITION_TO_FW, 2), 100.3)
    control.see(before, made.state)
    assert control.lost == "the pilot took over: OFFBOARD in forward flight"


def test_a_mode_without_a_velocity_loop_is_none_of_ours_where_sticks_are_speeds() -> None:
    loiter, guided, nogps = (AutopilotState(autopilot=ARDUPILOT, mode=mode, armed=True) for mode in (5, 4, 20))
    for by_speed in (False, True):
        control = Control(80, by_speed)
        control.begin(loiter, asking=False)
        control.see(loiter, nogps)
        assert control.has(nogps) is not by_speed
        control.see(nogps, guided)
        control.see(guided, nogps)
        assert control.lost == ("the pilot took over: GUIDED_NOGPS" if by_speed else "")


def test_a_landing_that_is_denied_is_not_ours_when_a_person_sets_it() -> None:
    guided = AutopilotState(autopilot=ARDUPILOT, mode=4, armed=True)
    landing = replace(guided, mode=9)
    for result, lost in ((0, ""), (4, "the pilot took over: LAND")):
        control = Control(80)
        control.begin(guided, asking=True)
        control.see(guided, guided)
        control.hands_over = True
        answered = replace(guided, acknowledged={m.MAV_CMD_DO_SET_MODE: (result, 1)})
        control.see(guided, answered)
        control.see(answered, landing)
        assert (control.lands(landing), control.lost) == (not lost, lost)


def test_a_guided_mode_that_ends_the_autopilots_own_landing_is_a_persons() -> None:
    """A ground station's, whose button to stop sets it: a landing is not asked for again."""
    control = Control(80)
    guided, landing = (AutopilotState(autopilot=ARDUPILOT, mode=mode, armed=True) for mode in (4, 9))
    control.begin(guided, asking=True)
    control.see(guided, guided)
    control.hands_over = True
    control.see(guided, landing)
    assert control.answers_for(landing)
    control.see(landing, guided)
    assert control.lost == "the pilot took over: GUIDED"


def test_a_clock_that_runs_slow_does_not_make_telemetry_look_old() -> None:
    made, ages = heard_session(), []
    for index in range(1000):
        received_s = 0.02 * index
        feed(made, attitude(round(0.9 * 1e3 * received_s) + 1000), received_s)
        ages.append(received_s - made.state.attitude_t_s)
    assert max(ages) < 0.25


def test_values_that_no_vehicle_has_change_nothing() -> None:
    made = heard_session()
    feed(made, attitude(10), 100.1)
    feed(made, m.MAVLink_attitude_message(20, math.nan, 0.2, 0.3, 0, 0, 0), 100.2)
    assert made.state.roll_rad == pytest.approx(0.1)
    assert made.refused == 1


def test_a_heading_that_is_held_up_does_not_wind_up() -> None:
    heading = HeadingSetPoint()
    for _ in range(500):
        to_rad = heading.next_rad(0.7, 1.0, 0.02)
    message = attitude_message(Wanted(0.0, 0.0, 0.0, 0.7), to_rad, 0.5, 1, 0)
    w, _, _, z = message.q
    assert 2.0 * math.atan2(z, w) == pytest.approx(1.3)
    assert message.type_mask == 0


def test_limits_are_the_vehicles() -> None:
    told = {"GUID_OPTIONS": 0.0, "ANGLE_MAX": 2000.0, "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0}
    limits = VehicleLimits.of(ARDUPILOT, told)
    assert math.degrees(limits.tilt_rad) == pytest.approx(20.0)
    assert (limits.up_mps, limits.down_mps) == (2.5, 1.5)
    assert limits.velocity_reference == "ground"
    assert VehicleLimits.of(ARDUPILOT, told | {"EK3_SRC1_VELXY": 5.0}).velocity_reference == "surface"
    px4 = {"MPC_TILTMAX_AIR": 45.0, "MPC_XY_VEL_MAX": 12.0, "MPC_Z_VEL_MAX_UP": 3.0, "MPC_Z_VEL_MAX_DN": 1.0}
    assert VehicleLimits.of(PX4, px4).velocity_reference == "ground"
    assert VehicleLimits.of(PX4, px4 | {"EKF2_GPS_CTRL": 0.0}).velocity_reference == "surface"
    for options in (8.0, 32.0):  # raw thrust; a velocity of zero that does not hold
        with pytest.raises(VehicleError, match="clear that bit"):
            VehicleLimits.of(ARDUPILOT, told | {"GUID_OPTIONS": options})
    at_rest = VehicleLimits.of(ARDUPILOT, told | {"WPNAV_SPEED_UP": 0.0})
    with pytest.raises(ConfigError, match="max_climb_mps"):  # thrust would have no meaning
        response_within(MavlinkParameters(), at_rest, ARDUPILOT, packaged_toml("vehicles")["response"])
    for name in told:
        with pytest.raises(VehicleError, match=f"does not tell {name}"):
            VehicleLimits.of(ARDUPILOT, {other: value for other, value in told.items() if other != name})


def test_a_fixed_camera_tilts_with_the_aircraft() -> None:
    attitudes = [(0.0, 0.0, 0.0, 0.0), (1.0, 0.2, -0.1, 0.0)]
    at, age_s = gimbal_at(0.5, attitudes, [], -0.3)
    assert at.pitch_rad == pytest.approx(-0.35, abs=0.01)
    assert at.roll_rad == pytest.approx(0.1, abs=0.01)
    assert age_s == pytest.approx(0.5)


def test_a_gimbals_attitude_says_how_old_it_is() -> None:
    for t_s, age_s in ((0.5, 0.1), (0.4, 0.0), (60.4, 60.0)):
        at, found_s = gimbal_at(t_s, [(t_s, 0.0, 0.0, 0.0)], [(0.4, 0.0, -0.2, 0.0)], None)
        assert at.pitch_rad == pytest.approx(-0.2)
        assert found_s == pytest.approx(age_s)
    assert gimbal_at(0.5, [(0.5, 0.0, 0.0, 0.0)], [], None)[1] == math.inf
    assert gimbal_at(60.0, [(0.5, 0.0, 0.0, 0.0)], [(60.0, 0.0, 0.0, 0.0)], -0.3)[1] == pytest.approx(59.5)


def test_ports_and_keys(tmp_path: Path) -> None:
    for wrong in ("udp:127.0.0.1", "udp:127.0.0.1:0", "mqtt:host:1", "serial:57600"):
        with pytest.raises(ConfigError, match="expected"):
            Place.of(wrong)
    server = socket.create_server(("127.0.0.1", 0))
    with server, closing(Place.of("tcp:127.0.0.1:{1}".format(*server.getsockname())).open()) as port:
        # what waits for an end that does not answer is given up: a command must not come late
        assert 0 < port._end.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) <= 3000
    secret = tmp_path / "key"
    secret.write_text("correct horse\n")
    assert len(read_key(secret)) == 32
    with pytest.raises(ConfigError, match="cannot be read"):
        read_key(tmp_path / "none")


@pytest.mark.parametrize(("baud", "carries"), [(57600, True), (19200, False)])
def test_a_serial_line_that_is_too_slow_for_set_points_is_refused(baud: int, carries: bool) -> None:
    """They would be later and later, which the checklist cannot see: none leaves before the flight."""
    address = Address.parse(f"mavlink://serial:/dev/ttyUSB0:{baud}?camera=/dev/video0")
    setup = VehicleSetup(address, Camera.from_fov(1280, 720, 69.0), vehicle_table(None))
    with nullcontext() if carries else pytest.raises(ConfigError, match="39000 baud"):
        MavlinkSetup.of(setup)


@pytest.mark.parametrize(
    ("counts", "advice"),
    [
        (LinkCounts(), "udp: listens, so the autopilot must send to this address"),
        (LinkCounts(malformed=3), "check the baud rate"),
        (LinkCounts(malformed=3, foreign=2), "2 messages came, none of an autopilot"),
    ],
)
def test_silence_has_its_advice(counts, advice):
    assert advice in advice_on_silence(counts)


def test_a_serial_line_that_flies_is_nobody_elses() -> None:
    """A second process would take its bytes, or change its baud rate."""
    pytest.importorskip("serial")
    near, far = pty.openpty()
    with os.fdopen(near, "rb"), os.fdopen(far, "rb"):
        flying = Place.of(f"serial:{os.ttyname(far)}:57600").open()
        with pytest.raises(VehicleError, match="cannot be opened"):
            Place.of(f"serial:{os.ttyname(far)}:115200").open()
        flying.close()
