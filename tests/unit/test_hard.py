"""Windows around a detector's errors: what they hold, and what they must not touch."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shipland.learning.hard import MOST_WINDOWS, hard_corners, window_box
from shipland.messages import Box

SIZE, CROP = (1280, 720), 352


def box(column, row, confidence=0.6, side=12.0):
    return Box((column, row), (side, 0.7 * side), confidence)


def holds(corner, column, row):
    return corner[0] <= column < corner[0] + CROP and corner[1] <= row < corner[1] + CROP


def test_every_false_box_gets_a_window_and_the_target_the_first_one():
    target = (600.0, 300.0, 620.0, 314.0)
    found = [box(610, 307, 0.9), box(100, 100), box(1200, 650, 0.3), box(300, 600, 0.02)]
    corners = hard_corners(SIZE, CROP, target, None, found, 0.5, np.random.default_rng(1))
    assert len(corners) == 3  # the hit and the unsure box ask for none
    assert holds(corners[0], 610, 307)
    assert holds(corners[1], 100, 100)
    assert holds(corners[2], 1200, 650)


def test_boxes_side_by_side_share_a_window():
    found = [box(640, 360), box(650, 365), box(645, 350)]
    assert len(hard_corners(SIZE, CROP, None, None, found, 0.5, np.random.default_rng(2))) == 1


def test_a_frame_without_errors_still_gives_a_window():
    assert len(hard_corners(SIZE, CROP, None, None, [], 0.5, np.random.default_rng(3))) == 1


@given(
    st.tuples(st.floats(0, 1270), st.floats(0, 710), st.floats(2, 200), st.floats(2, 200)),
    st.lists(st.tuples(st.floats(0, 1279), st.floats(0, 719)), max_size=9),
    st.booleans(),
    st.integers(0, 99),
)
def test_no_window_shows_a_sliver_of_the_target(place, others, labelled, seed):
    """A labelled target lies in a window by half at least or not at all; an unlabelled one never."""
    left, top, width, height = place
    target = (left, top, min(left + width, 1280.0), min(top + height, 720.0))
    area = (target[2] - target[0]) * (target[3] - target[1])
    found = [box(*other) for other in others]
    whole, partly = (target, None) if labelled else (None, target)
    corners = hard_corners(SIZE, CROP, whole, partly, found, 0.5, np.random.default_rng(seed))
    assert len(corners) <= MOST_WINDOWS
    for corner in corners:
        assert 0 <= corner[0] <= SIZE[0] - CROP and 0 <= corner[1] <= SIZE[1] - CROP
        cut = window_box(target, corner, CROP)
        if cut is not None:
            assert labelled
            assert (cut[2] - cut[0]) * (cut[3] - cut[1]) >= 0.5 * area - 1e-6
