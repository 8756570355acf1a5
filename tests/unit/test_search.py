"""The search pattern: still first, then around, then up, and an end."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipland.guidance.parameters import SearchParameters
from shipland.guidance.view import search

PARAMETERS = SearchParameters()
LOOKING_S = PARAMETERS.look_s * len(PARAMETERS.camera_pitch_deg)
TURN_S = PARAMETERS.turn_s + PARAMETERS.climb_s


def test_it_looks_at_every_pitch_before_it_moves():
    pitches = set()
    for t_s in np.arange(0.0, LOOKING_S, 0.1):
        sticks, pitch_rad = search(float(t_s), PARAMETERS)
        assert not any(sticks)
        pitches.add(round(math.degrees(pitch_rad)))
    assert pitches == set(PARAMETERS.camera_pitch_deg)


def test_turns_climbs_and_the_next_turn_looks_elsewhere():
    first, first_rad = search(LOOKING_S + 0.5 * PARAMETERS.turn_s, PARAMETERS)
    climb, _ = search(LOOKING_S + PARAMETERS.turn_s + 0.1, PARAMETERS)
    second, second_rad = search(LOOKING_S + TURN_S + 0.1, PARAMETERS)
    assert first == (0.0, 0.0, 0.0, PARAMETERS.turn_percent)
    assert climb == (0.0, 0.0, PARAMETERS.climb_percent, 0.0)
    assert second == first
    assert second_rad != first_rad


def test_after_the_last_turn_it_holds():
    sticks, _ = search(LOOKING_S + PARAMETERS.turns * TURN_S + 1.0, PARAMETERS)
    assert not any(sticks)


def test_a_search_without_a_camera_pitch_is_refused():
    with pytest.raises(ValueError, match="camera_pitch_deg"):
        replace(PARAMETERS, camera_pitch_deg=())


def test_it_turns_to_the_side_asked_for():
    left, _ = search(LOOKING_S + 1.0, PARAMETERS, side=-0.3)
    assert left.yaw == -PARAMETERS.turn_percent
