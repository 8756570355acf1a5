"""What the horizon says of boxes: size against place, and one box for one thing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.messages import Box, Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.scenario.scenario import load_scenario
from shipland.vision.far.far import _ship_spans_m
from shipland.vision.far.horizon_consistency import HorizonConsistency, Subject, apart
from shipland.vision.parameters import detector_parameters

PARAMETERS = detector_parameters()
SHIP = Subject(spans_m=(3.3, 3.3), foot=0.5, foot_m=0.0, rise=-1.0)
PITCH_RAD = -0.1


def frame(height_m: float | None) -> Frame:
    return Frame(0.0, None, GimbalAttitude(0.0, PITCH_RAD), height_m)


def on_the_sea(camera, range_m: float, height_m: float, wide_m: float, up_m: float = 0.0) -> Box:
    """A thing so wide, its foot `up_m` above the water, seen from that height and range."""
    below_rad = math.asin((height_m - up_m) / range_m)
    row = camera.matrix[1, 2] + camera.focal_px * math.tan(below_rad + PITCH_RAD)
    wide_px = camera.focal_px * wide_m / range_m
    high_px = 0.7 * wide_px
    return Box((640.0, row - 0.5 * high_px), (wide_px, high_px), 0.5)


@pytest.mark.parametrize(("range_m", "height_m"), [(250.0, 20.0), (120.0, 10.0), (60.0, 15.0)])
def test_a_ship_suits_its_place_and_what_is_smaller_or_larger_does_not(camera, range_m, height_m):
    consistency = HorizonConsistency(SHIP, camera, PARAMETERS)
    for wide_m, low, high in ((3.3, 0.8, 3.0), (2.5, 0.0, 3.0), (0.6, -6.0, -2.0), (14.0, -6.0, -2.0)):
        odds = consistency.evidence(on_the_sea(camera, range_m, height_m, wide_m), frame(height_m))
        assert low <= odds <= high, wide_m


@pytest.mark.parametrize("wide_m", [14.0, 30.0, 70.0, 98.0])
def test_a_long_hull_suits_its_place_from_wherever_it_is_seen(camera, wide_m):
    """A frigate from dead astern has a seventh of the width that it has from 40° off."""
    consistency = HorizonConsistency(
        replace(SHIP, spans_m=_ship_spans_m(load_scenario("frigate-sea5").rig)), camera, PARAMETERS
    )
    for range_m, height_m in ((3000.0, 60.0), (800.0, 40.0)):
        assert consistency.evidence(on_the_sea(camera, range_m, height_m, wide_m), frame(height_m)) > 0.8
        assert consistency.evidence(on_the_sea(camera, range_m, height_m, 0.2 * 14.0), frame(height_m)) < -2.0
    assert _ship_spans_m(Rig()) == pytest.approx((3.3, 3.3), abs=0.05)


def test_from_low_over_the_water_the_horizon_tells_little(camera):
    """At a metre the height is as good as unknown: neither for nor against."""
    consistency = HorizonConsistency(SHIP, camera, PARAMETERS)
    for wide_m in (0.6, 3.3, 14.0):
        assert abs(consistency.evidence(on_the_sea(camera, 250.0, 1.0, wide_m), frame(1.0))) < 0.8
    buoy = on_the_sea(camera, 150.0, 20.0, 0.6)
    assert consistency.evidence(buoy, frame(20.0)) < -2.0  # the same thing from above


def test_a_barometer_that_errs_by_a_metre_refuses_no_ship(camera):
    consistency = HorizonConsistency(SHIP, camera, PARAMETERS)
    for height_m in (2.0, 5.0, 20.0):
        for error_m in (-1.0, 1.0):
            box = on_the_sea(camera, 150.0, height_m, 3.3)
            assert consistency.evidence(box, frame(height_m + error_m)) > -0.5


@pytest.mark.parametrize("height_m", [None, math.nan])
def test_without_a_height_nothing_is_said(camera, height_m):
    consistency = HorizonConsistency(SHIP, camera, PARAMETERS)
    assert consistency.evidence(on_the_sea(camera, 100.0, 10.0, 0.6), frame(height_m)) == 0.0


def test_a_bar_over_the_water_is_judged_where_it_hangs(camera):
    bar = HorizonConsistency(Subject((1.3, 1.3), 0.0, 1.65, 4.0), camera, PARAMETERS)
    hanging = on_the_sea(camera, 80.0, 15.0, 1.3, up_m=1.65)
    middle = replace(hanging, centre_px=(640.0, hanging.centre_px[1] + 0.5 * hanging.size_px[1]))
    assert bar.evidence(middle, frame(15.0)) > 0.8
    near = on_the_sea(camera, 40.0, 15.0, 0.65)  # as wide in the picture, on the water, half as far
    assert bar.evidence(near, frame(15.0)) < -1.0


def test_any_box_gives_a_finite_number(camera, rng):
    consistency = HorizonConsistency(SHIP, camera, PARAMETERS)
    for _ in range(300):
        box = Box(tuple(rng.uniform(-50.0, 1300.0, 2)), tuple(rng.uniform(0.0, 900.0, 2)), 0.5)
        odds = consistency.evidence(
            box, Frame(0.0, None, GimbalAttitude(0.0, rng.uniform(-1.5, 1.5)), rng.uniform(-9, 99))
        )
        assert np.isfinite(odds) and -6.0 <= odds <= 3.0


def test_one_thing_is_one_box(camera):
    sure, doubtful = Box((100.0, 100.0), (20.0, 14.0), 0.8), Box((108.0, 104.0), (24.0, 12.0), 0.3)
    other = Box((130.0, 100.0), (20.0, 14.0), 0.4)
    assert apart([doubtful, other, sure]) == [sure, other]


def test_a_target_that_the_edge_cuts_is_not_measured(camera):
    consistency = HorizonConsistency(SHIP, camera, PARAMETERS)
    buoy = on_the_sea(camera, 60.0, 10.0, 1.0)
    assert consistency.evidence(buoy, frame(10.0)) < -1.0
    for cut_px in ((5.0, buoy.centre_px[1]), (1276.0, buoy.centre_px[1]), (640.0, 715.0)):
        assert consistency.evidence(replace(buoy, centre_px=cut_px), frame(10.0)) == 0.0
