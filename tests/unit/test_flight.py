"""The loop: one row a cycle, the vehicle is closed whatever happens, nothing flies past its time."""

import itertools
import logging
import math
import signal
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.flight import Autonomy, Stage, cycles, fly
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    Estimate,
    Frame,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    Override,
    PilotCommand,
    Telemetry,
)
from shipland.rig import Rig
from shipland.safety.assurance import Safety, SafetyParameters
from shipland.stopping import stop_requests
from shipland.vehicles.delays import DelayParameters

LEVEL = GimbalAttitude(0.0, 0.0)


class Recorded:
    """A vehicle that gives numbered frames and remembers what it was told."""

    camera = Camera.from_fov(64, 48, 69.0)

    def __init__(self, frames, start_s=0.0):
        self.frames, self.commands, self.closed, self.start_s = iter(range(frames)), [], False, start_s

    def open(self):
        pass

    def read(self):
        index = next(self.frames, None)
        if index is None:
            return None
        t_s = self.start_s + index / 30.0
        return Frame(t_s, None, LEVEL), Telemetry(t_s + 0.1, 0.0, 0.0, 0.0, 1.0, np.zeros(3), 90.0, 90.0, True)

    def telemetry_at(self, t_s):
        return Telemetry(t_s, 0.0, 0.0, 0.0, 1.0, np.zeros(3), 90.0, 90.0, True)

    def send(self, command):
        self.commands.append(command)

    def close(self):
        self.closed = True


class Dark(Recorded):
    """Its video stops after three frames; its telemetry goes on."""

    def read(self):
        frame, telemetry = super().read() or (None, None)
        if frame is None or frame.t_s < self.start_s + 2.5 / 30.0:
            return None if frame is None else (frame, telemetry)
        return None, telemetry


class Handed(Recorded):
    """Somebody else takes it after two cycles."""

    @property
    def in_command(self):
        return "shipland" if len(self.commands) < 2 else "the pilot: LOITER"


class Leaping(Recorded):
    """Its clock is wrong by a million seconds in the first frames."""

    def read(self):
        frame, telemetry = super().read()
        return frame, replace(telemetry, t_s=telemetry.t_s + 1e6) if frame.t_s < 0.1 else telemetry


class VisionSelector:
    def see(self, frame):
        return Observation(frame.t_s, frame.gimbal, reason="dark")


class Wild:
    """A pilot that asks for more than anyone may have."""

    def __init__(self):
        self.sent = []

    def decide(self, observation, telemetry, sent):
        self.sent.append(sent)
        return Decision(PilotCommand(telemetry.t_s, 500.0, 0.0, 0.0, 0.0, 0.0, Intent.HOLD), Mode.SEARCH, "wild")


def autonomy(**changes):
    delays = DelayParameters()
    safety = Safety(SafetyParameters(), Rig(), Recorded.camera, np.zeros(3), ANAFI_LIKE)
    return replace(Autonomy(VisionSelector(), Wild(), safety, delays), **changes)


def piloted(decide):
    """A pilot that decides so from what is seen and told."""
    return SimpleNamespace(decide=lambda observation, telemetry, sent: decide(telemetry))


def flown(vehicle, limit_s=10.0, **changes):
    """The result and the rows of a flight."""
    rows = []
    return fly(vehicle, autonomy(**changes), limit_s, lambda: 0.0, rows.append), rows


def test_every_frame_is_seen_decided_bounded_sent_and_logged():
    vehicle = Recorded(5)
    result, rows = flown(vehicle)
    assert result.cycles == len(rows) == len(vehicle.commands) == 5
    assert result.reason == "the flight is over"
    assert all(command.pitch_percent <= 100.0 for command in vehicle.commands)
    assert [row.decision.command for row in rows] == vehicle.commands
    assert vehicle.closed


@pytest.mark.parametrize(
    ("override", "intent", "heave_percent"),
    [(Override.HOLD, Intent.HOLD, 0.0), (Override.CLIMB, Intent.GO_AROUND, 50.0)],
)
@pytest.mark.parametrize("gimbal_rad", [None, math.nan])
def test_a_person_s_key_is_flown_whatever_becomes_of_the_pilot(override, intent, heave_percent, gimbal_rad):
    """The pilot raises, or its camera's pitch is no number."""

    def lost(telemetry):
        if gimbal_rad is None:
            raise RuntimeError("no idea")
        return Decision(PilotCommand(telemetry.t_s, 50.0, 0.0, 0.0, 0.0, gimbal_rad), None, "")

    _, rows = flown(Recorded(30), pilot=piloted(lost), override=lambda: override)
    command = rows[-1].decision.command
    assert (command.intent, command.heave_percent) == (intent, heave_percent)
    assert (command.pitch_percent, command.roll_percent, command.gimbal_pitch_rad) == (0.0, 0.0, 0.0)
    assert rows[-1].decision.reason.startswith(override.value)


class Broken:
    """A safety that fails in every cycle."""

    def admitted(self, observation, telemetry):
        return observation

    def check(self, *_):
        raise ZeroDivisionError("of its own")


def test_a_safety_that_fails_itself_holds(caplog):
    vehicle = Recorded(3)
    _, rows = flown(vehicle, safety=Broken())
    assert [command.intent for command in vehicle.commands] == [Intent.HOLD] * 3
    assert "safety failed: ZeroDivisionError: of its own: hold" in rows[0].decision.reason
    assert caplog.text.count("Traceback") == 1


def test_the_pilot_is_told_what_left_the_safety():
    vehicle, pilot = Recorded(4), Wild()
    flown(vehicle, pilot=pilot)
    assert pilot.sent == [None, *vehicle.commands[:-1]]
    assert all(command.pitch_percent <= 100.0 for command in pilot.sent[1:])  # it asked for 500 %


def test_vision_is_told_the_height_that_came_with_the_picture():
    heights_m = []

    class Keeps(VisionSelector):
        def see(self, frame):
            heights_m.append(frame.height_m)
            return super().see(frame)

    class Climbs(Recorded):
        def read(self):
            pair = super().read()
            return None if pair is None else (pair[0], replace(pair[1], height_m=30.0 * pair[0].t_s))

    flown(Climbs(3), vision=Keeps())
    assert heights_m == pytest.approx([0.0, 1.0, 2.0])


def test_a_first_pose_that_hangs_as_low_as_a_mirror_image_does_not_reach_the_pilot():
    class Sees(VisionSelector):
        def see(self, frame):
            down_m = 0.65 if frame.t_s < 1.0 else 0.65 - 1.5
            pose = BarPose(np.array([-6.0, 0.0, down_m]), 0.0, 1e-4 * np.eye(4), 0.1, frame.t_s + np.zeros((8, 2)))
            hidden = 0.2 < frame.t_s < 2.0
            return Observation(frame.t_s, frame.gimbal, None if hidden else pose, reason="hidden" if hidden else "")

    _, rows = flown(Recorded(70), vision=Sees())
    assert rows[0].observation.bar_pose is not None
    assert rows[-1].observation.bar_pose is None
    assert "mirror image" in rows[-1].observation.reason


def test_cycles_can_be_stepped_and_closing_them_closes_the_vehicle():
    vehicle = Recorded(9)
    flight = cycles(vehicle, autonomy(), lambda: 0.0)
    seen = [next(flight).frame.t_s for _ in range(3)]
    assert seen == pytest.approx([0.0, 1 / 30, 2 / 30])
    assert len(vehicle.commands) == 3
    assert not vehicle.closed
    flight.close()
    assert vehicle.closed


@pytest.mark.parametrize("value", [math.nan, 1e300, 3.0])
def test_a_pilot_that_writes_into_what_it_is_given_spoils_it_for_nobody_else(value):
    class Sees(VisionSelector):
        def see(self, frame):
            pose = BarPose(np.array([-6.0, 0.0, -0.5]), 0.0, 1e-4 * np.eye(4), 0.1, frame.t_s + np.zeros((8, 2)))
            return Observation(frame.t_s, frame.gimbal, pose)

    class Writes(Wild):
        def decide(self, observation, telemetry, sent):
            pose = observation.bar_pose
            for given in (telemetry.velocity_in_level_mps, pose.position_in_bar_m, pose.covariance, pose.corners_px):
                given[:] = value
            return super().decide(observation, telemetry, sent)

    safety = autonomy().safety
    _, rows = flown(Recorded(30), vision=Sees(), pilot=Writes(), safety=safety)
    assert rows[-1].decision.reason == "wild"
    assert rows[-1].observation.bar_pose.position_in_bar_m.tolist() == [-6.0, 0.0, -0.5]
    assert not rows[-1].telemetry.velocity_in_level_mps.any()
    assert safety.estimate.place_in_bar_m == pytest.approx((-6.0, 0.0, -0.5))


@pytest.mark.parametrize(
    "spoiled",
    [
        lambda frame: None,
        lambda frame: replace(frame, t_s=math.nan),
        lambda frame: replace(frame, t_s=frame.t_s - 15.0),
    ],
    ids=["no picture", "a picture without a time", "a picture of another clock"],
)
def test_without_any_good_picture_the_flight_is_held_and_a_key_obeyed(spoiled):
    class Blind(Recorded):
        def read(self):
            frame, telemetry = super().read() or (None, None)
            return None if frame is None else (spoiled(frame), telemetry)

    lost = piloted(lambda telemetry: None)
    keys = itertools.chain([None] * 10, itertools.repeat(Override.CLIMB))
    vehicle = Blind(1000)
    result, rows = flown(vehicle, 2.0, pilot=lost, override=keys.__next__)
    assert [command.intent for command in vehicle.commands[:10]] == [Intent.HOLD] * 10
    assert vehicle.commands[-1].heave_percent == 50.0
    assert rows[0].observation.reason
    assert result.reason == "time limit of 2 s"


def test_a_vehicles_clock_that_stands_still_delays_no_key():
    """Behind a time that does not go on the bound on the sticks' rate would keep them where they are."""

    class Stands(Recorded):
        def read(self):
            frame, telemetry = super().read() or (None, None)
            return None if frame is None else (replace(frame, t_s=0.0), replace(telemetry, t_s=0.1))

        def telemetry_at(self, t_s):
            return super().telemetry_at(0.1)

    forward = piloted(lambda telemetry: Decision(replace(SOUND, pitch_percent=60.0), None, "forward"))
    keys = itertools.chain([None] * 30, itertools.repeat(Override.CLIMB))
    result, rows = flown(Stands(2000), 2.0, pilot=forward, override=keys.__next__)
    assert rows[29].decision.command.pitch_percent == 60.0
    assert rows[35].decision.command.sticks_percent == (0.0, 0.0, 50.0, 0.0)
    assert result.reason == "time limit of 2 s"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9, -1e9])
def test_a_computers_clock_that_leaps_turns_no_time_back_and_takes_a_minute_at_most(value):
    times_s = itertools.chain(0.01 * np.arange(14), [value], itertools.count(0.5, 0.01))  # when the third was seen
    measured = DelayParameters(processing="measured")
    rows = []
    fly(Recorded(20), autonomy(delays=measured), 1e3, times_s.__next__, rows.append)
    steps_s = np.diff([row.telemetry.t_s for row in rows])
    assert len(rows) == 20
    assert np.all(steps_s >= 0.0) and np.all(steps_s <= 60.1)


def test_a_pilot_without_modes_flies():
    command = PilotCommand(0.0, 10.0, 0.0, 0.0, 0.0, 0.0, Intent.HOLD)
    vehicle = Recorded(3)
    flown(vehicle, pilot=piloted(lambda telemetry: Decision(replace(command, t_s=telemetry.t_s), None, "steady on")))
    assert vehicle.commands[-1].pitch_percent == 10.0


def test_the_pilot_goes_on_deciding_without_pictures():
    vehicle = Dark(8, 5000.0)
    _, rows = flown(vehicle)
    assert [row.observation.reason for row in rows] == ["dark"] * 3 + ["no picture"] * 5
    assert {row.frame.t_s for row in rows[3:]} == {rows[2].frame.t_s}
    assert len(vehicle.commands) == 8
    assert np.all(np.diff([command.t_s for command in vehicle.commands]) > 0.0)


def test_command_is_ready_a_processing_time_after_receipt():
    vehicle = Recorded(1)
    flown(vehicle)
    assert vehicle.commands[0].t_s == pytest.approx(0.1 + 0.03)  # [delays] near_s


@pytest.mark.parametrize("start_s", [0.0, 5000.0])
def test_time_limit_counts_from_the_first_frame(start_s):
    vehicle = Recorded(1000, start_s)
    result, _ = flown(vehicle, 1.0)
    assert result.reason == "time limit of 1 s"
    assert result.cycles == 28
    assert vehicle.closed


def test_a_landing_that_has_begun_is_not_cut_by_the_time_limit(monkeypatch):
    landing = replace(PilotCommand.hold(0.0, 0.0), heave_percent=-20.0, intent=Intent.LAND)

    lands = piloted(lambda telemetry: Decision(replace(landing, t_s=telemetry.t_s), Mode.LAND, ""))
    monkeypatch.setattr(Safety, "check", lambda _, decision, *more: decision)
    result, _ = flown(Recorded(60), 1.0, pilot=lands)
    assert (result.cycles, result.reason) == (60, "the flight is over")
    assert flown(Recorded(2000), 1.0, pilot=lands)[0].t_s < 32.0


def test_time_limit_holds_though_the_clock_leaps():
    result, rows = flown(Leaping(1000), 2.0)
    assert result.reason == "time limit of 2 s"
    assert result.cycles < 150
    steps_s = np.diff([row.telemetry.t_s for row in rows])
    assert np.min(steps_s) >= 0.0 and np.max(steps_s) < 1.0


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_vehicle_is_closed_when_the_loop_is_broken_off(error):
    vehicle = Recorded(10)

    def stop(_):
        raise error

    with pytest.raises(error):
        fly(vehicle, autonomy(), 10.0, lambda: 0.0, stop)
    assert vehicle.closed


class UnspeakableError(Exception):
    def __str__(self):
        raise RuntimeError("and no words for it")


class UnprintableError(SyntaxError):
    """Its place in a text is none, which the standard library's words for it do not bear."""

    def __init__(self):
        super().__init__("broken", ("pilot.toml", "line one", "column three", "text"))


class Panic(BaseException):
    """What code in Rust raises is no Exception either."""


SOUND = PilotCommand(0.0, 10.0, 0.0, 0.0, 0.0, -0.2, Intent.GO_AROUND)
ESTIMATE = Estimate(0.0, np.zeros(3), 0.0)
MALFORMED_DECISIONS = {
    "nothing": None,
    "a text": "forward",
    "a bare command": SOUND,
    "no command": Decision(None, None, ""),
    "a command of another kind": Decision((10.0, 0.0, 0.0, 0.0), None, ""),
    "a stick beyond a float": Decision(replace(SOUND, pitch_percent=10**400), None, ""),
    "a stick beyond any": Decision(replace(SOUND, pitch_percent=1e300, roll_percent=-1e300), None, ""),
    "a stick that is none": Decision(replace(SOUND, roll_percent=None), None, ""),
    "a stick in words": Decision(replace(SOUND, heave_percent="50"), None, ""),
    "sticks in an array": Decision(replace(SOUND, yaw_percent=np.zeros(3)), None, ""),
    "a complex stick": Decision(replace(SOUND, yaw_percent=1j), None, ""),
    "a stick that is no number": Decision(replace(SOUND, yaw_percent=math.nan), None, ""),
    "a gimbal in words": Decision(replace(SOUND, gimbal_pitch_rad="down"), None, ""),
    "a gimbal beyond any": Decision(replace(SOUND, gimbal_pitch_rad=1e300), None, ""),
    "a time in words": Decision(replace(SOUND, t_s="now"), None, ""),
    "an intent in words": Decision(replace(SOUND, intent="fly"), None, ""),
    "a mode in words": Decision(SOUND, "LAND", ""),
    "a reason that is none": Decision(SOUND, None, None),
    "a reason of bytes": Decision(SOUND, None, b"because"),
    "an estimate that is none": Decision(SOUND, None, "", np.zeros(3)),
    "an estimate in words": Decision(SOUND, None, "", replace(ESTIMATE, aircraft_in_bar_m=np.array(["a", "b", "c"]))),
    "an estimate of objects": Decision(SOUND, None, "", replace(ESTIMATE, aircraft_in_bar_m=np.array([10**400, 1, 2]))),
    "an estimate's heading": Decision(SOUND, None, "", replace(ESTIMATE, yaw_rad=None)),
    "an error without words": UnspeakableError(),
    "an error that cannot be printed": UnprintableError(),
    "a StopIteration": StopIteration(),
    "no memory": MemoryError(),
    "a panic": Panic(),
}

LIKE = Observation(0.0, LEVEL)
POSE = BarPose(np.zeros(3), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))
MALFORMED_OBSERVATIONS = {
    "nothing": None,
    "a pose alone": POSE,
    "a time that is none": replace(LIKE, t_s=None),
    "a time beyond a float": replace(LIKE, t_s=10**400),
    "a gimbal that is none": replace(LIKE, gimbal=None),
    "a gimbal's pitch in words": replace(LIKE, gimbal=GimbalAttitude(0.0, "down")),
    "a gimbal's roll beyond a float": replace(LIKE, gimbal=GimbalAttitude(10**400, 0.0)),
    "a pose that is none": replace(LIKE, bar_pose=(0.0, 0.0, 0.0)),
    "a pose in words": replace(LIKE, bar_pose=replace(POSE, position_in_bar_m=np.array(["a", "b", "c"]))),
    "a pose of objects": replace(LIKE, bar_pose=replace(POSE, position_in_bar_m=np.array([None, None, None]))),
    "a heading that is none": replace(LIKE, bar_pose=replace(POSE, yaw_rad=None)),
    "a heading that is an array": replace(LIKE, bar_pose=replace(POSE, yaw_rad=np.zeros(2))),
    "a covariance of complex numbers": replace(LIKE, bar_pose=replace(POSE, covariance=1j * np.eye(4))),
    "a box that is none": replace(LIKE, bar_box=(1.0, 2.0)),
    "a box of one side": replace(LIKE, ship_box=Box((1.0, 2.0), (3.0,), 0.5)),
    "a box without size": replace(LIKE, ship_box=Box((1.0, 2.0), None, 0.5)),
    "a box in words": replace(LIKE, bar_box=Box((1.0, 2.0), ("wide", "tall"), 0.5)),
    "a reason that is none": replace(LIKE, reason=None),
    "learned in an array": replace(LIKE, learned=np.zeros(2)),
    "a deck that is none": replace(LIKE, deck="below"),
    "an error without words": UnspeakableError(),
    "an error that cannot be printed": UnprintableError(),
    "a StopIteration": StopIteration(),
    "a panic": Panic(),
}


def giving(result):
    """A pilot and a vision that gives a result, or raises it."""

    def method(*_):
        if isinstance(result, BaseException):
            raise result
        return result

    return SimpleNamespace(decide=method, see=method)


def safely_flown(**changes):
    vehicle = Recorded(4)
    _, rows = flown(vehicle, **changes)
    assert len(vehicle.commands) == len(rows) == 4
    assert vehicle.closed
    for command in vehicle.commands:
        sticks = command.sticks_percent
        assert all(type(stick) is float and abs(stick) <= 100.0 for stick in sticks)
        assert math.isfinite(command.gimbal_pitch_rad) and abs(command.gimbal_pitch_rad) < 7.0
    return rows


@pytest.mark.parametrize("name", MALFORMED_DECISIONS)
def test_a_pilot_that_gives_no_decision_costs_its_cycle(name, caplog):
    rows = safely_flown(pilot=giving(MALFORMED_DECISIONS[name]))
    if name == "a stick that is no number":  # this one the safety takes
        assert all("command not finite" in row.decision.reason for row in rows)
        return
    assert all(row.decision.reason.startswith("pilot failed: ") for row in rows)
    assert all(row.decision.command.intent is Intent.HOLD for row in rows)
    (record,) = [record for record in caplog.records if record.name == "shipland.flight"]  # not one a cycle
    assert record.exc_info is not None


@pytest.mark.vision_fails
@pytest.mark.parametrize("name", MALFORMED_OBSERVATIONS)
def test_a_vision_that_gives_no_observation_costs_its_frame(name, caplog):
    rows = safely_flown(vision=giving(MALFORMED_OBSERVATIONS[name]))
    assert all(row.observation.reason.startswith("vision failed: ") for row in rows)
    assert all(row.observation.bar_pose is None and row.observation.gimbal == LEVEL for row in rows)
    (record,) = [record for record in caplog.records if record.name == "shipland.vision.vision"]
    assert record.exc_info is not None


def test_of_ever_new_errors_the_first_few_are_logged(caplog):
    def inventive(_):
        raise type("NewError", (Exception,), {})

    flown(Recorded(60), pilot=piloted(inventive))
    assert 1 <= len([record for record in caplog.records if record.levelno >= logging.ERROR]) <= 10


def test_numbers_of_other_types_are_numbers_and_words_are_fit_for_a_log():
    sticks = np.float32(8.0), np.int64(4), True, 0.0, np.float64(-0.2)
    estimate = replace(ESTIMATE, aircraft_in_bar_m=[1, 2, 3])

    def numpys(telemetry):
        return Decision(PilotCommand(telemetry.t_s, *sticks, Intent.HOLD, True), None, "half a pair: \ud800", estimate)

    row = safely_flown(pilot=piloted(numpys))[-1]
    command = row.decision.command
    assert (command.pitch_percent, command.roll_percent, command.heave_percent) == (8.0, 4.0, 1.0)
    assert not command.at_contact_height  # the pilot's own word for it is none
    assert row.decision.estimate.aircraft_in_bar_m.tolist() == [1.0, 2.0, 3.0]
    assert row.decision.reason.encode() == b"half a pair: ?"


def test_who_is_in_command_stands_in_the_row_in_which_that_changes():
    _, rows = flown(Handed(4))
    told = [row.decision.reason.partition("in command: ")[2] for row in rows]
    assert told == ["shipland", "", "the pilot: LOITER", ""]


@pytest.mark.parametrize("where", ["open", "read", "telemetry_at", "send"])
def test_a_vehicle_that_fails_is_closed(where):
    vehicle = Recorded(5)
    setattr(vehicle, where, giving(RuntimeError("broken")).see)
    with pytest.raises(RuntimeError, match="broken"):
        flown(vehicle)
    assert vehicle.closed


@pytest.mark.parametrize("who", ["pilot", "vision"])
@pytest.mark.parametrize("error", [SystemExit, KeyboardInterrupt, GeneratorExit])
def test_who_ends_the_process_leaves_the_vehicle_closed(who, error):
    vehicle = Recorded(5)
    with pytest.raises(error):
        flown(vehicle, **{who: giving(error())})
    assert vehicle.closed


def test_a_second_ctrl_c_does_not_cut_the_closing_short(monkeypatch):
    monkeypatch.setattr("shipland.stopping._GRACE_S", -1.0)
    signals = (signal.SIGINT, signal.SIGINT)

    class Slow(Recorded):
        def close(self):
            for which in signals:
                signal.getsignal(which)(which, None)
            super().close()

    vehicle = Slow(5)
    with pytest.raises(KeyboardInterrupt), stop_requests():
        flown(vehicle)
    assert vehicle.closed


def test_costs_add_up_to_the_clock():
    clock = itertools.count(0.0, 0.25).__next__
    result = fly(Recorded(8), autonomy(), 10.0, clock, lambda _: None)
    assert sum(result.cost_s.values()) == pytest.approx(8 * len(Stage) * 0.25)


@pytest.mark.parametrize(
    ("override", "intent", "heave_percent"),
    [(Override.HOLD, Intent.HOLD, 0.0), (Override.CLIMB, Intent.GO_AROUND, 50.0), ("c", Intent.HOLD, 0.0)],
)
def test_a_persons_key_is_obeyed_although_the_safety_fails(override, intent, heave_percent):
    """Any other value than a key's is a hold too."""
    _, rows = flown(Recorded(3), safety=Broken(), override=lambda: override)
    command = rows[0].decision.command
    assert (command.intent, command.sticks_percent) == (intent, (0.0, 0.0, heave_percent, 0.0))
    assert rows[0].decision.override is (override if isinstance(override, Override) else None)
    assert "safety failed: ZeroDivisionError" in rows[0].decision.reason


def test_a_go_around_that_has_begun_is_not_cut_by_the_time_limit(monkeypatch):
    """What is left holding there is as low over the deck as the landing that was broken off."""

    def asked(telemetry):
        intent = Intent.LAND if telemetry.t_s < 1.5 else Intent.GO_AROUND if telemetry.t_s < 3.0 else Intent.FLY
        return Decision(PilotCommand(telemetry.t_s, 0.0, 0.0, 0.0, 0.0, 0.0, intent), None, "")

    monkeypatch.setattr(Safety, "check", lambda _, decision, *more: decision)
    result, rows = flown(Recorded(600), 1.0, pilot=piloted(asked))
    assert result.reason == "time limit of 1 s"
    assert rows[-1].decision.command.intent is Intent.FLY
    assert result.t_s == pytest.approx(3.0, abs=0.05)
    climbs = piloted(lambda telemetry: Decision(PilotCommand(0.0, *[0.0] * 5, Intent.GO_AROUND), None, ""))
    assert flown(Recorded(2000), 1.0, pilot=climbs)[0].t_s < 32.0


def test_a_first_time_that_no_clock_has_does_not_stop_the_flights_time():
    """With it as the beginning a float would not tell one cycle from the next, and no stick would move again."""

    class Begins(Recorded):
        def read(self):
            frame, telemetry = super().read() or (None, None)
            return None if frame is None else (frame, replace(telemetry, t_s=1e18 if frame.t_s == 0.0 else frame.t_s))

    forward = piloted(lambda telemetry: Decision(replace(SOUND, pitch_percent=60.0), None, "forward"))
    keys = itertools.chain([None] * 30, itertools.repeat(Override.CLIMB))
    result, rows = flown(Begins(1000), 2.0, pilot=forward, override=keys.__next__)
    assert rows[35].decision.command.sticks_percent == (0.0, 0.0, 50.0, 0.0)
    assert result.reason == "time limit of 2 s"


def test_a_vision_that_goes_back_in_time_is_not_flown_on():
    """Poses in no order have no slope: no velocity against the bar would be known, and no stopping distance."""

    class Late(VisionSelector):
        def __init__(self):
            self.frames = itertools.count()

        def see(self, frame):
            t_s = frame.t_s - (0.5 if next(self.frames) % 2 else 0.0)
            place_m = np.array([-9.0 + 2.0 * t_s, 0.0, -0.5])
            return Observation(t_s, frame.gimbal, BarPose(place_m, 0.0, 1e-4 * np.eye(4), 0.1, t_s + np.zeros((8, 2))))

    safety = autonomy().safety
    _, rows = flown(Recorded(60), vision=Late(), safety=safety)
    assert [row.observation.bar_pose is None for row in rows[2:6]] == [False, True, False, True]
    assert "older than the last" in rows[-1].observation.reason
    assert safety.estimate.velocity_in_bar_mps[0] == pytest.approx(2.0, abs=0.1)
