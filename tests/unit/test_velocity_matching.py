"""The rival that matches velocities: it follows a target under way and flies by the vehicle's own velocity loop."""

import numpy as np
import pytest

from shipland.guidance.near import MeasuredError
from shipland.guidance.parameters import VelocityMatchingParameters
from shipland.guidance.response import ANAFI_LIKE, HOLD
from shipland.guidance.rivals.velocity_matching import VelocityMatching

STEP_S = 1.0 / 30.0


def fly(target_mps, wind_mps2=0.0, seconds=30.0):
    """Errors [m] ahead over a tilt-stick vehicle without lag, towards a target that moves ahead; no picture is late."""
    near, error_m, own_mps, errors = VelocityMatching(VelocityMatchingParameters(), ANAFI_LIKE), 3.0, 0.0, []
    for index in range(round(seconds / STEP_S)):
        own = np.array([own_mps, 0.0, 0.0])
        near.observe(MeasuredError(index * STEP_S, 0.0, np.array([error_m, 0.0, 0.0]), 0.0, 0.0, own))
        own_mps += STEP_S * (ANAFI_LIKE.input_of(near.sticks(0.0).pitch) + wind_mps2)
        error_m += STEP_S * (target_mps - own_mps)
        errors.append(error_m)
    return np.array(errors)


@pytest.mark.parametrize("target_mps", [0.0, 1.5])
def test_a_target_under_way_is_reached_and_followed(target_mps):
    errors = fly(target_mps)
    assert np.abs(errors[-60:]).max() < 0.05
    assert errors.min() > -0.6  # hardly overshot


def test_its_integral_balances_the_wind():
    assert np.abs(fly(0.0, wind_mps2=-0.8)[-60:]).max() < 0.05


def test_without_a_picture_it_holds_and_a_gap_starts_the_filter_anew():
    near = VelocityMatching(VelocityMatchingParameters(), ANAFI_LIKE)
    assert near.sticks(0.0) == HOLD
    near.observe(MeasuredError(0.0, 0.3, np.array([3.0, 0.0, 0.5]), 0.0, 0.0))
    assert near.sticks(0.0).heave == pytest.approx(50.0)
    found = near.observe(MeasuredError(5.0, 0.3, np.array([1.0, 0.0, 0.0]), 0.0, 0.0))
    np.testing.assert_allclose(found.error_in_level_m, [1.0, 0.0, 0.0])
    near.reset()
    assert near.sticks(0.0) == HOLD
