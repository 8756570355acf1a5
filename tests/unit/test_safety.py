"""Safety: whatever the pilot says, what goes out is finite, bounded, slow to change and inside the fence."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.config import build
from shipland.guidance.safety import Safety, SafetyParameters
from shipland.messages import (
    BarPose,
    Decision,
    Estimate,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    PilotCommand,
    Telemetry,
)
from shipland.rig import default_rig, packaged_table

PARAMETERS = build(SafetyParameters, packaged_table("safety"))
POSE = BarPose(np.array([-5.0, 0.0, 0.0]), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))


def seen(t_s, pose=True):
    return Observation(t_s, GimbalAttitude(0.0, 0.0), POSE if pose else None)


def telemetry(t_s, **changes):
    return replace(Telemetry(t_s, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True), **changes)


def decision(t_s, pitch=0.0, heave=0.0, place=(-5.0, 0.0, -0.5), mode=Mode.APPROACH, intent=Intent.FLY, **changes):
    command = replace(PilotCommand(t_s, pitch, 0.0, heave, 0.0, 0.0, intent), **changes)
    return Decision(command, mode, "reason", None if place is None else Estimate(t_s, np.array(place), 0.0))


def check(told, t_s=0.0, pose=True, **changes):
    return Safety(PARAMETERS, default_rig()).check(told, seen(t_s, pose), telemetry(t_s, **changes))


@given(st.lists(st.tuples(st.floats(0.0, 0.2), *[st.floats(allow_nan=True, allow_infinity=True)] * 4), max_size=30))
def test_output_is_finite_bounded_and_slewed(cycles):
    safety, t_s, last = Safety(PARAMETERS, default_rig()), 0.0, None
    for dt_s, pitch, roll, heave, yaw in cycles:
        t_s += dt_s
        told = Decision(PilotCommand(t_s, pitch, roll, heave, yaw, 0.0), Mode.SEARCH, "")
        out = safety.check(told, seen(t_s), telemetry(t_s)).command
        sticks = np.array([out.pitch_percent, out.roll_percent, out.heave_percent, out.yaw_percent])
        assert np.all(np.abs(sticks) <= PARAMETERS.max_percent)
        if last is not None:
            assert np.all(np.abs(sticks - last) <= PARAMETERS.slew_percent_per_s * dt_s + 1e-9)
        last = sticks


def test_good_command_passes_unchanged():
    told = decision(0.0, pitch=12.0, heave=-7.0)
    out = check(told)
    assert (out.command, out.mode, out.reason) == (told.command, told.mode, told.reason)


def test_stale_data_holds_and_says_so():
    safety = Safety(PARAMETERS, default_rig())
    safety.check(decision(0.0, pitch=20.0), seen(0.0), telemetry(0.0))
    late_s = PARAMETERS.stale_s + 0.5
    out = safety.check(decision(late_s, pitch=20.0), seen(late_s, pose=False), telemetry(late_s))
    assert out.command.pitch_percent == 0.0
    assert out.command.intent is Intent.HOLD
    assert "old: hold" in out.reason


@pytest.mark.parametrize(
    ("told", "changes", "axis", "words"),
    [
        (decision(0.0, heave=-20.0, place=(-2.09, 0.0, 0.3)), {}, "heave_percent", "floor"),
        (decision(0.0, pitch=20.0, place=(-1.0, 0.0, 0.0)), {}, "pitch_percent", "to the bar"),
        (decision(0.0, pitch=-20.0, place=(-500.0, 0.0, 0.0)), {}, "pitch_percent", "too far"),
        (decision(0.0, heave=20.0), {"height_m": 90.0}, "heave_percent", "too high"),
        (decision(0.0, pitch=math.nan), {}, "pitch_percent", "not finite"),
    ],
)
def test_interventions_are_named(told, changes, axis, words):
    out = check(told, **changes)
    assert getattr(out.command, axis) == 0.0
    assert words in out.reason


def test_floor_lets_a_landing_through():
    out = check(decision(0.0, heave=-50.0, place=(-2.09, 0.0, 0.6), mode=Mode.LAND, intent=Intent.LAND))
    assert out.command.heave_percent == -50.0


def test_low_battery_is_said():
    assert "battery" in check(decision(0.0), battery_percent=5.0).reason
