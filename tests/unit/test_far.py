"""Far controls: the published law on boxes, its yaw, and the linear laws it is compared with."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.camera import Camera
from shipland.guidance.far import (
    PUBLISHED_CAMERA,
    FarSight,
    FarTables,
    FarTarget,
    FarYaw,
    LinearFar,
    PidFar,
    PublishedFar,
    far_control,
)
from shipland.guidance.laws import PidMemory, exponential_law, pid_law
from shipland.guidance.parameters import GuidanceParameters, PidGains
from shipland.messages import Box, GimbalAttitude

PARAMETERS = GuidanceParameters()
SHIP, BAR, BASELINES, NEAR = PARAMETERS.ship, PARAMETERS.bar, PARAMETERS.far_baselines, PARAMETERS.near
FOCAL_PX = PUBLISHED_CAMERA.focal_px
KINDS = {"exponential": PublishedFar, "p": LinearFar, "pid": PidFar}
SLOW = PidGains(k_p=0.5, t_i_s=4.0, t_d_s=1.0)


def sight(box: Box, t_s: float, heading_error_deg: float | None, target=FarTarget.SHIP) -> FarSight:
    return FarSight(box, target, t_s, GimbalAttitude(0.0, 0.0), heading_error_deg)


def box(right_px=0.0, below_px=0.0, area_px2=400.0):
    side = math.sqrt(area_px2)
    return Box((640.0 + right_px, 360.0 + below_px), (side, side), 0.9)


def control(kind="exponential", variant="growing", camera=PUBLISHED_CAMERA):
    tables = FarTables.for_camera(SHIP, BAR, camera)
    return far_control(kind, variant, BASELINES, NEAR, tables, camera)


@pytest.mark.parametrize("kind", KINDS)
def test_the_factory_builds_what_the_key_says(kind):
    assert isinstance(control(kind), KINDS[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_a_centred_box_of_the_wanted_size_holds(kind):
    at_setpoint = control(kind).sticks(sight(box(area_px2=SHIP.pitch.setpoint), 1.0, 0.0))
    assert at_setpoint == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("variant", ["growing", "saturating"])
def test_every_stick_leads_to_the_box(kind, variant):
    far = control(kind, variant)
    right = far.sticks(sight(box(right_px=80.0, below_px=-80.0, area_px2=400.0), 1.0, 0.0, FarTarget.BAR))
    assert right.pitch == pytest.approx(0.004 * 3000.0)  # Table 1: m · (3400 − 400)
    assert right.roll > 20.0
    assert right.heave > 20.0
    left = control(kind, variant).sticks(
        sight(box(right_px=-80.0, below_px=80.0, area_px2=9000.0), 1.0, 0.0, FarTarget.BAR)
    )
    assert left.pitch == pytest.approx(0.004 * (3400.0 - 9000.0))  # erratum 2: too large a box means back off
    assert left.roll == pytest.approx(-right.roll)
    assert left.heave == pytest.approx(-right.heave)


def test_the_printed_law_stays_selectable():
    sticks = control(variant="printed").sticks(sight(box(right_px=-100.0), 1.0, 0.0))
    # erratum 3: −m(e^{ae} − d)·e at −100 px is 1.2 · (0.206 − 1) · 100, and to the LEFT
    assert sticks.roll == pytest.approx(1.2 * (math.exp(-1.58) - 1.0) * 100.0, abs=0.1)


def test_p_gives_the_laws_stick_at_the_stated_error_and_half_of_it_at_half():
    far = control("p", "saturating")
    wanted = exponential_law(BASELINES.match_px, SHIP.roll, "saturating")
    assert far.sticks(sight(box(right_px=BASELINES.match_px), 1.0, 0.0)).roll == pytest.approx(wanted)
    assert far.sticks(sight(box(right_px=0.5 * BASELINES.match_px), 2.0, 0.0)).roll == pytest.approx(0.5 * wanted)


def test_pid_by_hand():
    stick, memory = pid_law(20.0, 1.0, PidMemory(), SLOW)
    assert stick == pytest.approx(10.0)  # the first error: P alone
    stick, memory = pid_law(18.0, 1.5, memory, SLOW)
    # P 9; I 0.5 · 18 · 0.5 / 4 = 1.125; D 0.5 · 1 · (−2 / 0.5) = −2
    assert stick == pytest.approx(9.0 + 1.125 - 2.0)
    again, after = pid_law(18.0, 1.5, memory, SLOW)
    assert again == pytest.approx(9.0 + 1.125)
    assert after.integral_percent == memory.integral_percent


@given(errors=st.lists(st.floats(-600.0, 600.0), min_size=2, max_size=60))
def test_pid_stays_within_the_stick_and_its_integral_too(errors):
    memory = PidMemory()
    for index, error in enumerate(errors):
        stick, memory = pid_law(error, 0.5 * index, memory, SLOW)
        assert abs(stick) <= 100.0
        assert abs(memory.integral_percent) <= 100.0


def test_pid_does_not_wind_up_at_the_stop():
    memory = PidMemory()
    for index in range(40):  # 20 s at an error whose P alone is at the stop
        _, memory = pid_law(400.0, 0.5 * index, memory, SLOW)
    assert memory.integral_percent == 0.0
    stick, _ = pid_law(-20.0, 20.0, memory, dataclasses.replace(SLOW, t_d_s=0.0))
    assert stick < 0.0  # turns round with the error


def test_yaw_follows_the_magnetometer_by_the_near_law():
    far = control()
    first = far.sticks(sight(box(right_px=100.0), 1.0, 4.0))
    assert first.yaw == pytest.approx(5.5 * 4.0)  # Table 2: K_P · 4°, whatever the box says
    second = far.sticks(sight(box(right_px=100.0), 1.5, 3.0))
    # step −1° in 0.5 s is −0.06° in 0.03 s, far inside σ = 5°: K_D = b; K_I adds 0.05 · 3 · 0.5
    assert second.yaw == pytest.approx(5.5 * 3.0 - 1.75 * 2.0 + 0.075, abs=0.01)


def test_without_a_magnetometer_the_nose_turns_to_the_box():
    sticks = control().sticks(sight(box(right_px=FOCAL_PX * math.tan(math.radians(5.0))), 1.0, None))
    assert sticks.yaw == pytest.approx(5.5 * 5.0)


def test_heading_errors_wrap_and_a_change_of_source_gives_no_kick():
    yaw = FarYaw(NEAR.yaw, NEAR.derivative, FOCAL_PX)
    assert yaw.stick_percent(0.0, 1.0, 350.0) == pytest.approx(-55.0)
    # 10° by magnetometer, then 0° by vision: without the derivative of that jump
    assert yaw.stick_percent(0.0, 1.5, None) == pytest.approx(0.0)


def test_reset_forgets_the_last_error():
    far = control("pid")
    far.sticks(sight(box(right_px=50.0), 1.0, 0.0))
    far.reset()
    sticks = far.sticks(sight(box(right_px=-50.0), 1.5, 0.0, FarTarget.BAR))
    assert sticks.roll == pytest.approx(-50.0 * BASELINES.roll.k_p)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("target", FarTarget)
def test_the_law_in_angles_is_the_same_for_every_camera(kind, target):
    """The same target, seen by a 1080p camera of 60° and by the published one, gives the same sticks."""
    other = Camera.from_fov(1920, 1080, 60.0)
    point = np.array([[3.0, 1.5, 60.0]])
    sticks = []
    for camera in (PUBLISHED_CAMERA, other):
        centre = camera.project(point)[0]
        side_px = camera.focal_px * 1.8 / 60.0
        seen = Box((float(centre[0]), float(centre[1])), (side_px, side_px), 0.9)
        sticks.append(control(kind, "saturating", camera).sticks(sight(seen, 1.0, None, target)))
    assert sticks[1] == pytest.approx(sticks[0], abs=0.2)  # the paper's 640, 360 are half a pixel off the true middle


def test_table_1_is_that_of_its_own_camera():
    tables = FarTables.for_camera(SHIP, BAR, PUBLISHED_CAMERA)
    assert (tables.ship, tables.bar) == (SHIP, BAR)


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_that_is_no_number_moves_no_stick_and_leaves_no_trace(kind):
    far, untouched = control(kind), control(kind)
    for value in (math.nan, math.inf, -math.inf):
        spoiled = Box((value, value), (value, value), 0.9)
        assert all(math.isfinite(stick) for stick in far.sticks(sight(spoiled, 1.0, value)))
    good = sight(box(right_px=30.0, below_px=10.0), 2.0, 5.0)
    assert far.sticks(good) == untouched.sticks(good)
