"""Which quadrilateral is which: every assignment that geometry allows is found, in any order, among others."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from pictures import camera_from_bar, project_plane, rectangles
from shipland.camera import Camera
from shipland.cue import Cue, Polygon
from shipland.rig import Rig
from shipland.vision.near.associate import match_by_geometry, match_by_prediction

CAMERA = Camera.from_fov(1280, 720, 69.0)
ROLL = np.radians(40.0)
TAPES = Cue(  # two strips that tilt, as the tape of a robotics field
    (
        Polygon(((-0.151, -0.013), (-0.102, 0.0), (-0.137, 0.135), (-0.186, 0.123))),
        Polygon(((0.102, 0.0), (0.151, -0.013), (0.186, 0.123), (0.137, 0.135))),
    )
)
FIVE = rectangles(
    (-1.0, 0.0, 0.4, 0.3), (-0.2, 0.1, 0.5, 0.2), (0.6, -0.2, 0.3, 0.3), (0.5, 0.5, 0.6, 0.15), (-0.7, 0.6, 0.25, 0.35)
)
TARGETS = {"bar": Rig().cue, "tapes": TAPES, "one": rectangles((0.0, 0.0, 0.4, 0.6)), "five": FIVE}
SIZES = {"bar": 1.2, "tapes": 0.37, "one": 0.6, "five": 2.0}


def seen(target, pose):
    quads = np.array([project_plane(quad.corners_m, CAMERA, pose) for quad in target.polygon])
    return quads if np.isfinite(quads).all() else None


@pytest.mark.parametrize("name", list(TARGETS))
@given(
    seed=st.integers(0, 10_000),
    distances=st.floats(1.5, 12.0),
    azimuth_deg=st.floats(-40.0, 40.0),
    elevation_deg=st.floats(-20.0, 20.0),
    roll_deg=st.floats(-20.0, 20.0),
)
@example(seed=776, distances=1.5, azimuth_deg=-5.0, elevation_deg=11.0, roll_deg=0.0)  # another is nearer everywhere
def test_the_true_assignment_is_among_the_first(name, seed, distances, azimuth_deg, elevation_deg, roll_deg):
    target, rng = TARGETS[name], np.random.default_rng(seed)
    range_m = distances * SIZES[name]
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    away = np.array([-np.cos(azimuth) * np.cos(elevation), -np.sin(azimuth) * np.cos(elevation), -np.sin(elevation)])
    pose = camera_from_bar(range_m * away, azimuth, -elevation, np.radians(roll_deg))
    truth = seen(target, pose)
    assume(truth is not None)
    # Corners start anywhere, quadrilaterals come in any order, others lie between them.
    others = [
        np.array([[0, 0], [w, 0], [w, h], [0, h]]) + place
        for w, h, place in zip(
            rng.uniform(8, 150, 4), rng.uniform(8, 80, 4), rng.uniform(0, [1100, 600], (4, 2)), strict=True
        )
    ]
    quads = [np.roll(quad, rng.integers(4), axis=0) for quad in truth] + others
    order = rng.permutation(len(quads))
    matches = match_by_geometry(np.array([quads[i] for i in order]), target.plane_m, ROLL)
    wanted = tuple(int(np.flatnonzero(order == i)[0]) for i in range(target.count))
    right = [index for index, match in enumerate(matches) if match.candidates == wanted]
    assert right, "the true assignment is not among the hypotheses"
    assert right[0] < 8  # as many as are measured in one picture
    np.testing.assert_allclose(matches[right[0]].quads_px, truth, atol=1e-9)


def test_hypotheses_with_most_quadrilaterals_come_first():
    quads = seen(FIVE, camera_from_bar([-6.0, 0.0, 0.0]))
    counts = [len(match.model) for match in match_by_geometry(quads, FIVE.plane_m, ROLL)]
    assert counts[0] == 5
    assert counts == sorted(counts, reverse=True)


def test_a_missing_quadrilateral_leaves_the_others():
    quads = seen(FIVE, camera_from_bar([-6.0, 0.0, 0.0]))
    match = match_by_geometry(quads[[0, 2, 3, 4]], FIVE.plane_m, ROLL)[0]
    assert match.model == (0, 2, 3, 4)
    assert match.candidates == (0, 1, 2, 3)


def test_a_roll_beyond_the_limit_is_no_hypothesis():
    target = TARGETS["bar"]
    for roll_deg, any_found in ((30.0, True), (50.0, False)):
        quads = seen(target, camera_from_bar([-6.0, 0.0, 0.0], roll_rad=np.radians(roll_deg)))
        assert bool(match_by_geometry(quads, target.plane_m, ROLL)) is any_found


def test_prediction_names_what_lies_where_it_is_foreseen():
    target = TARGETS["bar"]
    predicted = seen(target, camera_from_bar([-6.0, 0.0, 0.0]))
    now = seen(target, camera_from_bar([-5.8, 0.1, 0.05]))
    decoy = np.array([[1000.0, 100.0], [1070.0, 100.0], [1070.0, 125.0], [1000.0, 125.0]])
    match = match_by_prediction(np.array([np.roll(now[1], 2, axis=0), decoy, np.roll(now[0], 1, axis=0)]), predicted)
    assert (match.model, match.candidates) == ((0, 1), (2, 0))
    np.testing.assert_allclose(match.quads_px, now)
    part = match_by_prediction(np.array([decoy, now[1]]), predicted)
    assert (part.model, part.candidates) == ((1,), (1,))
    assert match_by_prediction(decoy[None], predicted) is None


@pytest.mark.parametrize("find", [match_by_geometry, match_by_prediction])
def test_nothing_gives_nothing(find):
    nothing = np.zeros((0, 4, 2))
    plane = TARGETS["bar"].plane_m
    assert not (find(nothing, plane, ROLL) if find is match_by_geometry else find(nothing, 100.0 * plane))
