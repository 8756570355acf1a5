"""The loop: one row a cycle, the vehicle is closed whatever happens, nothing flies past its time."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.config import build
from shipland.flight import Crew, Stage, cycles, fly
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import (
    BarPose,
    Decision,
    Frame,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    PilotCommand,
    Telemetry,
)
from shipland.rig import default_rig, packaged_table
from shipland.safety.assurance import Safety, SafetyParameters
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


class Eyes:
    def see(self, frame):
        return Observation(frame.t_s, frame.gimbal, reason="dark")


class Wild:
    """A pilot that asks for more than anyone may have."""

    def __init__(self):
        self.sent = []

    def decide(self, observation, telemetry, sent):
        self.sent.append(sent)
        return Decision(PilotCommand(telemetry.t_s, 500.0, 0.0, 0.0, 0.0, 0.0, Intent.HOLD), Mode.SEARCH, "wild")


def crew(**changes):
    delays = build(DelayParameters, packaged_table("delays"))
    safety = Safety(
        build(SafetyParameters, packaged_table("safety")), default_rig(), Recorded.camera, np.zeros(3), ANAFI_LIKE
    )
    return replace(Crew(Eyes(), Wild(), safety, delays), **changes)


def test_every_frame_is_seen_decided_bounded_sent_and_logged():
    vehicle, rows = Recorded(5), []
    result = fly(vehicle, crew(), 10.0, itertools.count().__next__, rows.append)
    assert result.cycles == len(rows) == len(vehicle.commands) == 5
    assert result.reason == "the flight is over"
    assert all(command.pitch_percent <= 100.0 for command in vehicle.commands)
    assert [row.decision.command for row in rows] == vehicle.commands
    assert vehicle.closed


def test_the_pilot_is_told_what_left_the_safety():
    vehicle, pilot = Recorded(4), Wild()
    fly(vehicle, crew(pilot=pilot), 10.0, lambda: 0.0, lambda _: None)
    assert pilot.sent == [None, *vehicle.commands[:-1]]
    assert all(command.pitch_percent <= 100.0 for command in pilot.sent[1:])  # it asked for 500 %


def test_vision_is_told_the_height_that_came_with_the_picture():
    heights_m = []

    class Keeps(Eyes):
        def see(self, frame):
            heights_m.append(frame.height_m)
            return super().see(frame)

    class Climbs(Recorded):
        def read(self):
            pair = super().read()
            return None if pair is None else (pair[0], replace(pair[1], height_m=30.0 * pair[0].t_s))

    fly(Climbs(3), crew(vision=Keeps()), 10.0, lambda: 0.0, lambda _: None)
    assert heights_m == pytest.approx([0.0, 1.0, 2.0])


def test_a_first_pose_that_hangs_as_low_as_a_mirror_image_does_not_reach_the_pilot():
    class Sees(Eyes):
        def see(self, frame):
            down_m = 0.65 if frame.t_s < 1.0 else 0.65 - 1.5
            pose = BarPose(np.array([-6.0, 0.0, down_m]), 0.0, 1e-4 * np.eye(4), 0.1, frame.t_s + np.zeros((8, 2)))
            hidden = 0.2 < frame.t_s < 2.0
            return Observation(frame.t_s, frame.gimbal, None if hidden else pose, reason="hidden" if hidden else "")

    rows = []
    fly(Recorded(70), crew(vision=Sees()), 10.0, lambda: 0.0, rows.append)
    assert rows[0].observation.bar_pose is not None
    assert rows[-1].observation.bar_pose is None
    assert "mirror image" in rows[-1].observation.reason


def test_cycles_can_be_stepped_and_closing_them_closes_the_vehicle():
    vehicle = Recorded(9)
    flight = cycles(vehicle, crew(), lambda: 0.0)
    seen = [next(flight).frame.t_s for _ in range(3)]
    assert seen == pytest.approx([0.0, 1 / 30, 2 / 30])
    assert len(vehicle.commands) == 3
    assert not vehicle.closed
    flight.close()
    assert vehicle.closed


def test_a_pilot_without_modes_flies():
    class Plain:
        def decide(self, observation, telemetry, sent):
            return Decision(PilotCommand(telemetry.t_s, 10.0, 0.0, 0.0, 0.0, 0.0, Intent.HOLD), None, "steady on")

    vehicle = Recorded(3)
    fly(vehicle, crew(pilot=Plain()), 10.0, lambda: 0.0, lambda _: None)
    assert vehicle.commands[-1].pitch_percent == 10.0


def test_the_pilot_goes_on_deciding_without_pictures():
    vehicle, rows = Dark(8, 5000.0), []
    fly(vehicle, crew(), 10.0, lambda: 0.0, rows.append)
    assert [row.observation.reason for row in rows] == ["dark"] * 3 + ["no picture"] * 5
    assert {row.frame.t_s for row in rows[3:]} == {rows[2].frame.t_s}
    assert len(vehicle.commands) == 8
    assert np.all(np.diff([command.t_s for command in vehicle.commands]) > 0.0)


def test_command_is_ready_a_processing_time_after_receipt():
    vehicle = Recorded(1)
    fly(vehicle, crew(), 10.0, lambda: 0.0, lambda _: None)
    assert vehicle.commands[0].t_s == pytest.approx(0.1 + 0.03)  # [delays] near_s


@pytest.mark.parametrize("start_s", [0.0, 5000.0])
def test_time_limit_counts_from_the_first_frame(start_s):
    vehicle = Recorded(1000, start_s)
    result = fly(vehicle, crew(), 1.0, lambda: 0.0, lambda _: None)
    assert result.reason == "time limit of 1 s"
    assert result.cycles == 28
    assert vehicle.closed


class Leaping(Recorded):
    """Its clock is wrong by a million seconds in the first frames."""

    def read(self):
        frame, telemetry = super().read()
        if frame.t_s < 0.1:
            telemetry = replace(telemetry, t_s=telemetry.t_s + 1e6)
        return frame, telemetry


def test_time_limit_holds_though_the_clock_leaps():
    rows = []
    result = fly(Leaping(1000), crew(), 2.0, lambda: 0.0, rows.append)
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
        fly(vehicle, crew(), 10.0, lambda: 0.0, stop)
    assert vehicle.closed


def test_costs_add_up_to_the_clock():
    clock = itertools.count(0.0, 0.25).__next__
    result = fly(Recorded(8), crew(), 10.0, clock, lambda _: None)
    assert sum(result.cost_s.values()) == pytest.approx(8 * len(Stage) * 0.25)
