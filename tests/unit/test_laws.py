"""The laws against the paper's tables and equations, and their stated properties."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.guidance.laws import NearMemory, PidMemory, derivative_gain, exponential_law, near_law, pid_law
from shipland.guidance.parameters import FarGains, GuidanceParameters, NearGains, NearParameters, PidGains
from shipland.guidance.response import clamp

TABLE_1 = {  # [Lee2022, Table 1]: m, a, c, d
    ("ship", "pitch"): (0.008, 0.0, 5000.0, 0.0),
    ("ship", "roll"): (1.2, 0.0158, 640.0, 1.0),
    ("ship", "heave"): (3.0, 0.0108, 360.0, 1.0),
    ("bar", "pitch"): (0.004, 0.0, 3400.0, 0.0),
    ("bar", "roll"): (1.0, 0.0158, 640.0, 1.0),
    ("bar", "heave"): (5.0, 0.0108, 360.0, 1.0),
}
TABLE_2 = {  # [Lee2022, Table 2]: K_P, K_I, b, mu, sigma
    "pitch": (7.5, 0.05, 4.5, 0.02, 0.04),
    "roll": (7.5, 0.01, 8.5, 0.0, 0.04),
    "heave": (15.0, 0.01, 7.0, 0.0, 0.02),
    "yaw": (5.5, 0.05, 1.75, 0.0, 5.0),
}
ROLL = FarGains(1.2, 0.0158, 640.0, 1.0)
PITCH = FarGains(0.008, 0.0, 5000.0, 0.0)
NEAR_ROLL = NearGains(7.5, 0.01, 8.5, 0.0, 0.04, 1.0, 1e9)
errors = st.floats(-700.0, 700.0)


@pytest.mark.parametrize(("target", "axis"), TABLE_1)
def test_packaged_far_gains_are_table_1(target, axis):
    gains = getattr(getattr(GuidanceParameters(), target), axis)
    assert (gains.m, gains.a, gains.setpoint, gains.d) == TABLE_1[target, axis]


@pytest.mark.parametrize("axis", TABLE_2)
def test_packaged_near_gains_are_table_2(axis):
    gains = getattr(NearParameters(), axis)
    assert (gains.k_p, gains.k_i, gains.b, gains.mu, gains.sigma) == TABLE_2[axis]


def test_printed_roll_law_gives_the_erratum_3_figures():
    # FACTS, erratum 3: +463 / −95 percent at ±100 px before clamping; a tenth of m keeps them under the clamp
    small = FarGains(0.12, 0.0158, 640.0, 1.0)
    assert exponential_law(100.0, small, "printed") == pytest.approx(46.3, abs=0.05)
    assert exponential_law(-100.0, small, "printed") == pytest.approx(-12.0 * -0.794 * -1.0, abs=0.05)


def test_printed_pitch_law_is_forward_on_both_sides():
    assert exponential_law(1000.0, PITCH, "printed") == pytest.approx(8.0)
    assert exponential_law(-1000.0, PITCH, "printed") == pytest.approx(8.0)


@given(error=errors, variant=st.sampled_from(["growing", "saturating"]))
def test_symmetric_readings_are_odd_and_bounded(error, variant):
    up, down = exponential_law(error, ROLL, variant), exponential_law(-error, ROLL, variant)
    assert up == -down
    assert abs(up) <= 100.0
    assert up * error >= 0.0


@given(error=errors)
def test_readings_agree_with_the_printed_side_they_keep(error):
    printed = exponential_law(error, ROLL, "printed")
    variant = "growing" if error >= 0.0 else "saturating"
    assert exponential_law(error, ROLL, variant) == pytest.approx(printed, abs=1e-9)


@given(a=st.floats(1.0, 300.0), b=st.floats(1.0, 300.0))
def test_gain_grows_with_error(a, b):
    low, high = sorted((a, b))
    for variant in ("growing", "saturating"):
        assert exponential_law(low, ROLL, variant) <= exponential_law(high, ROLL, variant) + 1e-9


def test_derivative_gain_is_the_normal_density_without_its_factor():
    assert derivative_gain(0.0, 0.03, NEAR_ROLL, "probabilistic") == pytest.approx(8.5)
    assert derivative_gain(0.04, 0.03, NEAR_ROLL, "probabilistic") == pytest.approx(8.5 * math.exp(-0.5))
    assert derivative_gain(0.3, 0.03, NEAR_ROLL, "probabilistic") < 1e-9
    assert derivative_gain(0.3, 0.03, NEAR_ROLL, "linear") == 8.5


@given(rate=st.floats(-3.0, 3.0), dt_s=st.floats(0.005, 0.2))
def test_probabilistic_gain_depends_on_rate_not_on_frame_rate(rate, dt_s):
    at_published = derivative_gain(rate * 0.03, 0.03, NEAR_ROLL, "probabilistic")
    assert derivative_gain(rate * dt_s, dt_s, NEAR_ROLL, "probabilistic") == pytest.approx(at_published, rel=1e-6)


def test_printed_gain_does_depend_on_frame_rate():
    assert derivative_gain(0.1, 0.1, NEAR_ROLL, "printed") < derivative_gain(0.03, 0.03, NEAR_ROLL, "printed") / 10


def test_near_law_by_hand():
    terms, memory = near_law(0.50, 10.00, NearMemory(), NEAR_ROLL, "probabilistic")
    assert (terms.proportional, terms.integral, terms.derivative) == (3.75, 0.0, 0.0)
    terms, memory = near_law(0.47, 10.03, memory, NEAR_ROLL, "probabilistic")
    # step −0.03 m: K_D = 8.5·exp(−0.5·(0.03/0.04)²) = 6.4162, times −1 m/s
    assert terms.derivative == pytest.approx(-6.4162, abs=1e-3)
    assert terms.integral == pytest.approx(0.01 * 0.47 * 0.03)
    assert memory.integral == pytest.approx(0.47 * 0.03)


@pytest.mark.parametrize(("error_m", "again_s"), [(0.5, 1.0), (5.0, 2.0)], ids=["repeated frame", "beyond the band"])
def test_what_adds_nothing_to_the_integral(error_m, again_s):
    _, memory = near_law(error_m, 1.0, NearMemory(), NEAR_ROLL, "probabilistic")
    terms, memory = near_law(error_m, again_s, memory, NEAR_ROLL, "probabilistic")
    assert terms.derivative == 0.0
    assert memory.integral == 0.0


def test_false_estimate_is_rejected():
    # the paper's case: a jump of half a metre in one step moves the linear derivative by > 100 %, this one not at all
    _, memory = near_law(0.0, 0.00, NearMemory(), NEAR_ROLL, "probabilistic")
    jumped, _ = near_law(0.5, 0.03, memory, NEAR_ROLL, "probabilistic")
    linear, _ = near_law(0.5, 0.03, memory, NEAR_ROLL, "linear")
    assert abs(jumped.derivative) < 1e-6
    assert linear.derivative > 100.0


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_error_that_is_not_finite_gives_no_stick_and_is_not_remembered(value):
    for variant in ("printed", "growing", "saturating"):
        assert exponential_law(value, ROLL, variant) == 0.0
    memory = NearMemory(0.3, 1.0, 0.2)
    for error, t_s in ((value, 1.1), (0.3, value)):
        terms, after = near_law(error, t_s, memory, NEAR_ROLL, "probabilistic")
        assert (terms.stick_percent, after) == (0.0, memory)
        stick, kept = pid_law(error, t_s, PidMemory(1.0, 1.0, 3.0), PidGains(1.0, 4.0, 1.0))
        assert (stick, kept) == (0.0, PidMemory(1.0, 1.0, 3.0))


def test_clamp_asks_for_nothing_where_there_is_no_number():
    assert clamp(math.nan, 100.0) == 0.0  # and not +100 %
    assert (clamp(math.inf, 100.0), clamp(-math.inf, 100.0), clamp(7.0, 5.0)) == (100.0, -100.0, 5.0)
