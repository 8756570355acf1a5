"""Safety: whatever the pilot says, what goes out is finite, bounded, slow to change and inside the fence."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.camera import Camera
from shipland.guidance.response import ANAFI_LIKE
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    Estimate,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    PilotCommand,
    Telemetry,
)
from shipland.rig import Rig
from shipland.safety.assurance import Safety, SafetyParameters

PARAMETERS = SafetyParameters()
CAMERA = Camera.from_fov(1280, 720, 69.0)
RIG = Rig()
LEVEL, ABEAM = GimbalAttitude(0.0, 0.0), GimbalAttitude(0.0, 0.0, math.pi / 2)


def made(response=ANAFI_LIKE):
    return Safety(PARAMETERS, RIG, CAMERA, np.zeros(3), response)


def seen(t_s, place=(-5.0, 0.0, -0.5), **changes):
    pose = None if place is None else BarPose(np.array(place), 0.0, np.eye(4) * 1e-4, 0.1, np.zeros((8, 2)))
    return Observation(t_s, LEVEL, pose, **changes)


def ship_box(range_m, column_px=639.5):
    """The ship's box as its area and place would be seen from a range."""
    side_px = CAMERA.focal_px * math.sqrt(RIG.platform_width_m * RIG.superstructure_height_m) / range_m
    return Box((column_px, 359.5), (side_px, side_px), 0.9)


def telemetry(t_s, **changes):
    return replace(Telemetry(t_s, 0.0, 0.0, 0.0, 5.0, np.zeros(3), 80.0, 90.0, True), **changes)


def decision(t_s, pitch=0.0, heave=0.0, mode=Mode.APPROACH, intent=Intent.FLY, **changes):
    command = replace(PilotCommand(t_s, pitch, 0.0, heave, 0.0, 0.0, intent), **changes)
    return Decision(command, mode, "reason")


def check(asked, observation=None, t_s=0.0, **changes):
    return made().check(asked, seen(t_s) if observation is None else observation, telemetry(t_s, **changes))


@given(st.lists(st.tuples(st.floats(0.0, 0.2), *[st.floats(allow_nan=True, allow_infinity=True)] * 4), max_size=30))
def test_output_is_finite_bounded_and_slewed(cycles):
    safety, t_s, last = made(), 0.0, None
    for dt_s, pitch, roll, heave, yaw in cycles:
        t_s += dt_s
        asked = Decision(PilotCommand(t_s, pitch, roll, heave, yaw, 0.0), Mode.SEARCH, "")
        out = safety.check(asked, seen(t_s), telemetry(t_s)).command
        sticks = np.array(out.sticks_percent)
        assert np.all(np.abs(sticks) <= PARAMETERS.max_percent)
        if last is not None:
            assert np.all(np.abs(sticks - last) <= PARAMETERS.slew_percent_per_s * dt_s + 1e-9)
        last = sticks


def test_no_box_makes_a_bar_that_poses_showed_near_a_far_one():
    estimator = made()._estimator

    def distance_m(t_s, range_m):
        return estimator.updated(seen(t_s, place=None, ship_box=ship_box(range_m)), telemetry(t_s)).bar_distance_m()

    assert estimator.updated(seen(0.0), telemetry(0.0)).bar_distance_m() < 6.0
    assert distance_m(0.5, 14.0) < 6.0  # something else that looks like it
    assert distance_m(1.0, 3.0) == pytest.approx(3.0, abs=0.1)
    assert distance_m(17.0, 14.0) == pytest.approx(14.0, abs=0.1)  # no pose for so long


def test_a_box_of_no_size_tells_no_range():
    box = Box((640.0, 360.0), (1e-200, 1e-200), 0.9)
    out = check(decision(0.0), seen(0.0, None, ship_box=box))
    assert "nothing seen yet" not in out.reason
    assert out.command.pitch_percent == 0.0


def test_good_command_passes_unchanged():
    asked = decision(0.0, pitch=12.0, heave=-7.0)
    out = check(asked)
    assert (out.command, out.mode, out.reason) == (asked.command, asked.mode, asked.reason)


@pytest.mark.parametrize("mode", [Mode.APPROACH, Mode.TRACK_SHIP, None])
def test_stale_data_holds_whatever_the_mode_and_says_so(mode):
    safety = made()
    safety.check(decision(0.0, pitch=20.0, mode=mode), seen(0.0), telemetry(0.0))
    late_s = PARAMETERS.stale_s + 0.5
    out = safety.check(decision(late_s, pitch=20.0, mode=mode), seen(late_s, None), telemetry(late_s))
    assert out.command.pitch_percent == 0.0
    assert out.command.intent is Intent.HOLD
    assert "old: hold" in out.reason


@pytest.mark.parametrize("mode", [Mode.APPROACH, Mode.TRACK_BAR, Mode.SEARCH, None])
@pytest.mark.parametrize(
    ("asked", "observation", "changes", "axis", "words"),
    [
        ({"heave": -20.0}, seen(0.0, (-2.09, 0.0, 0.3)), {}, "heave_percent", "over the deck"),
        ({"heave": -20.0}, seen(0.0, None, ship_box=ship_box(80.0)), {"height_m": 0.4}, "heave_percent", "take-off"),
        ({"heave": -20.0, "intent": Intent.HOLD}, seen(0.0, None), {"height_m": None}, "heave_percent", "unknown"),
        ({"pitch": 20.0}, seen(0.0, (-1.0, 0.0, 0.0)), {}, "pitch_percent", "to the bar"),
        ({"pitch": -20.0}, seen(0.0, None, ship_box=ship_box(450.0)), {}, "pitch_percent", "fence: 450 m"),
        ({"heave": 20.0}, seen(0.0), {"height_m": 90.0}, "heave_percent", "too high"),
        ({"pitch": math.nan}, seen(0.0), {}, "pitch_percent", "not finite"),
    ],
)
def test_interventions_hold_in_every_mode_and_are_named(asked, observation, changes, axis, words, mode):
    out = check(decision(0.0, mode=mode, **asked), observation, **changes)
    assert getattr(out.command, axis) == pytest.approx(0.0, abs=1e-9)
    assert words in out.reason


def test_the_pilots_own_estimate_is_not_believed():
    asked = replace(decision(0.0, pitch=20.0), estimate=Estimate(0.0, np.array([-50.0, 0.0, -20.0]), 0.0))
    out = check(asked, seen(0.0, (-1.0, 0.0, 0.0)))
    assert out.command.pitch_percent == pytest.approx(0.0)


def test_the_fence_holds_sideways_and_lets_the_way_back_through():
    """The ship abeam to the right, 450 m away: no roll to the left, but to the right, and along it."""
    heading_to_ship = seen(0.0, None, ship_box=ship_box(450.0))
    safety = made()
    safety.check(decision(0.0), heading_to_ship, telemetry(0.0, heading_rad=math.pi / 2))
    nose_north = {"heading_rad": 0.0}
    away = safety.check(decision(0.1, roll_percent=-20.0, pitch=15.0), seen(0.1, None), telemetry(0.1, **nose_north))
    assert away.command.roll_percent == pytest.approx(0.0, abs=1e-6)
    assert away.command.pitch_percent == pytest.approx(15.0)
    back = safety.check(decision(0.2, roll_percent=20.0), seen(0.2, None), telemetry(0.2, **nose_north))
    assert back.command.roll_percent == pytest.approx(20.0)


def test_the_fence_knows_where_a_camera_looks_that_looks_aside():
    """As above, seen by a camera that looks to the right of a nose that points north."""
    safety = made()
    safety.check(decision(0.0), replace(seen(0.0, None, ship_box=ship_box(450.0)), gimbal=ABEAM), telemetry(0.0))
    away = safety.check(decision(0.1, roll_percent=-20.0, pitch=15.0), seen(0.1, None), telemetry(0.1))
    assert away.command.roll_percent == pytest.approx(0.0, abs=1e-6)
    assert away.command.pitch_percent == pytest.approx(15.0)


@pytest.mark.parametrize(("cycle_s", "full_mps", "most_m"), [(0.05, 1.0, 1.2), (0.5, 4.0, 4.5)])
@pytest.mark.parametrize("from_m", [19.0, 19.5, 20.0, 20.5])
def test_a_descent_is_stopped_before_the_floor(cycle_s, full_mps, most_m, from_m):
    """Full heave down with nothing in sight: an aircraft that follows its stick within 0.3 s stays dry.

    With a far detector too, which takes half a second for a cycle.
    """
    safety, height_m, sink_mps = made(replace(ANAFI_LIKE, max_climb_mps=full_mps)), from_m, 0.0
    for cycle in range(round(60.0 / cycle_s)):
        t_s = cycle * cycle_s
        state = telemetry(t_s, height_m=height_m, velocity_in_level_mps=np.array([0.0, 0.0, sink_mps]))
        out = safety.check(decision(t_s, heave=-100.0, intent=Intent.HOLD), seen(t_s, None), state)
        for _ in range(round(cycle_s / 0.05)):
            sink_mps += 0.05 / 0.3 * (-0.01 * out.command.heave_percent * full_mps - sink_mps)
            height_m -= 0.05 * sink_mps
    assert 0.3 < height_m < most_m


def test_a_barometer_that_stands_still_is_believed_no_longer_than_it_is_fresh():
    """Its values arrive, but their time stands: the floor counts from the measurement, not from the receipt."""
    asked = decision(3.0, heave=-20.0, intent=Intent.SEARCH)
    fresh = check(asked, seen(3.0, None), t_s=3.0, height_t_s=2.9)
    still = check(asked, seen(3.0, None), t_s=3.0, height_t_s=3.0 - PARAMETERS.stale_s - 0.1)
    assert fresh.command.heave_percent == -20.0
    assert still.command.heave_percent == 0.0
    assert "height unknown" in still.reason


def test_floor_lets_a_landing_through_over_the_deck_only():
    landing = decision(0.0, heave=-50.0, mode=None, intent=Intent.LAND)
    assert check(landing, seen(0.0, (-2.09, 0.0, 0.6))).command.heave_percent == -50.0
    beside = check(landing, seen(0.0, (-2.09, 1.2, 0.6)))
    assert beside.command.heave_percent == 0.0
    assert "floor" in beside.reason


@pytest.mark.parametrize("intent", [Intent.FLY, Intent.LAND])
def test_low_battery_is_said_and_breaks_nothing_off(intent):
    landing = decision(0.0, heave=-50.0, mode=None, intent=intent)
    low, full = (check(landing, seen(0.0, (-2.09, 0.0, 0.6)), battery_percent=percent) for percent in (5.0, 90.0))
    assert "battery at 5 %" in low.reason
    assert "battery" not in full.reason
    assert low.command == full.command


def test_the_command_bears_the_time_of_its_decision():
    out = made().check(decision(math.nan), seen(3.0), telemetry(3.0))
    assert out.command.t_s == 3.0
