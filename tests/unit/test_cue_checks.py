"""The cue's height by barometer: poses of its mirror image are refused, and no others."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.cue import Cue, Polygon
from shipland.frames import Array
from shipland.messages import BarPose, GimbalAttitude, Observation, Telemetry
from shipland.rig import Rig
from shipland.safety.cue_checks import CueHeight, CueHeightParameters

PARAMETERS = CueHeightParameters()
RIG = Rig()
DROP_M = 2.0 * (RIG.bar_height_m - RIG.deck_height_m)
STEP_S = 1.0 / 30.0


def pose(down_m: float, down_sd_m: float = 0.02) -> BarPose:
    covariance: Array = np.diag([0.1, 0.1, down_sd_m, 0.01]) ** 2
    return BarPose(np.array([-6.0, 0.5, down_m]), 0.0, covariance, 0.1, np.zeros((8, 2)))


class Flight:
    """Cycles of one flight: what is seen of a cue that hangs 1.65 m over the take-off point."""

    def __init__(self, over_takeoff_m: float | None = None, rig=RIG):
        self.state = CueHeight.of(replace(PARAMETERS, over_takeoff_m=over_takeoff_m), rig)
        self.t_s = 0.0

    def sees(self, height_m: float | None, cue_m: float | None, down_sd_m: float = 0.02, step_s: float = STEP_S) -> str:
        """Whether a pose passes: empty, or the reason; the aircraft at `height_m`, a cue at `cue_m` or none."""
        self.t_s += step_s
        telemetry = Telemetry(self.t_s, 0.0, 0.0, 0.0, height_m, None, None, None, True)
        self.state = self.state.with_height(telemetry)
        seen = None if cue_m is None else pose(cue_m - (3.0 if height_m is None else height_m), down_sd_m)
        observation = Observation(self.t_s, GimbalAttitude(0.0, 0.0), seen, reason="" if seen else "nothing")
        self.state, passed = self.state.checked(observation)
        return "" if passed.bar_pose is not None else passed.reason


def test_after_a_gap_the_mirror_image_is_refused_wherever_the_aircraft_has_flown_meanwhile():
    flight = Flight()
    assert all(flight.sees(2.0, 1.65) == "" for _ in range(60))
    for height_m in np.linspace(2.0, 6.0, 300):  # ten seconds without the cue, and four metres of climb
        assert flight.sees(float(height_m), None) == "nothing"
    assert "1.5 m too low" in flight.sees(6.0, 1.65 - DROP_M)
    assert flight.sees(6.0, 1.65) == ""


def test_in_water_it_hangs_lower_still():
    flight = Flight(over_takeoff_m=1.65)
    assert "3.3 m too low" in flight.sees(3.0, -1.65)


@pytest.mark.parametrize("known", [True, False])
def test_the_first_of_a_flight_is_told_only_where_the_height_is_known(known):
    flight = Flight(1.65 if known else None)
    assert (flight.sees(3.0, 1.65 - DROP_M) == "") != known


def test_a_cue_that_heaves_and_a_barometer_that_strays_cost_no_pose():
    rng, flight = np.random.default_rng(3), Flight()
    for number in range(3000):
        heave_m, stray_m = 0.3 * math.sin(2.1 * number * STEP_S), 0.002 * number * STEP_S
        seen = number % 120 < 80  # a gap of 1.3 s every four seconds
        reason = flight.sees(3.0 + stray_m + rng.normal(0.0, 0.05), 1.65 + heave_m if seen else None)
        assert reason == ("" if seen else "nothing"), number


def test_an_unsure_height_is_no_reason_to_refuse():
    flight = Flight(over_takeoff_m=1.65)
    assert flight.sees(3.0, 1.65 - 0.6 * DROP_M, down_sd_m=0.3) == ""
    assert flight.sees(3.0, 1.65 - 0.6 * DROP_M, down_sd_m=0.01, step_s=2.0) != ""


def test_what_stays_low_is_believed_in_the_end():
    """A barometer that has leapt must not blind a flight."""
    flight = Flight(over_takeoff_m=1.65)
    refused = [flight.sees(3.0, 0.2) != "" for _ in range(round(PARAMETERS.patience_s / STEP_S) + 10)]
    assert refused[0] and not refused[-1]
    assert sum(refused) * STEP_S == pytest.approx(PARAMETERS.patience_s, abs=0.1)


def test_glimpses_of_the_mirror_image_are_refused_one_by_one():
    flight = Flight(over_takeoff_m=1.65)
    for _ in range(4):
        assert "1.5 m too low" in flight.sees(3.0, 1.65 - DROP_M, step_s=20.0)
        assert "1.5 m too low" in flight.sees(3.0, 1.65 - DROP_M)
    assert flight.sees(3.0, 1.65) == ""


@pytest.mark.parametrize("gap_s", [STEP_S, 0.5])
def test_poses_that_follow_one_another_do_not_leap_to_the_mirror_image(gap_s):
    flight = Flight()
    assert flight.sees(3.0, 1.65) == ""
    assert "1.5 m too low" in flight.sees(3.0, 1.65 - DROP_M, step_s=gap_s)
    assert "1.5 m too low" in flight.sees(3.0, 1.65 - DROP_M)
    assert flight.sees(3.0, 1.65) == ""


@pytest.mark.parametrize("watched", [True, False])
def test_a_barometer_that_leaps_costs_no_pose_that_follows_others_while_a_pilot_watches(watched):
    flight = Flight(over_takeoff_m=1.65)
    assert flight.sees(3.0, 1.65) == ""
    if not watched:
        flight.state = flight.state.unwatched()
    pose_as_before = flight.sees(3.0 - DROP_M, 1.65 - DROP_M)
    assert ("1.5 m too low" in pose_as_before) is not watched


def test_without_a_barometer_nothing_is_refused():
    flight = Flight(over_takeoff_m=1.65)
    assert flight.sees(None, 0.0) == ""


def test_a_cue_with_an_up_needs_no_guard():
    tall = Polygon(((0.15, -0.2), (0.60, -0.2), (0.60, 0.075), (0.15, 0.075)))
    target = Cue((RIG.cue.polygon[0], tall), RIG.cue.manufacturing_tolerance)
    assert RIG.cue.mirrors_itself and not target.mirrors_itself
    flight = Flight(1.65, rig=replace(RIG, polygon=target.polygon))
    assert flight.sees(3.0, 1.65 - DROP_M) == ""
