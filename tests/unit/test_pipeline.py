"""The near chain on pictures: what it finds, what it refuses and why, and that nothing makes it raise."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pictures import (
    GREEN,
    Look,
    add_target,
    bar_picture,
    camera_from_bar,
    decoys,
    finish,
    foliage,
    light_of,
    paint,
    plain_canvas,
    project_plane,
    rectangles,
)
from shipland.camera import Camera
from shipland.config import read_toml
from shipland.cue import Cue, Polygon
from shipland.frames import Pose
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.vision.near import published
from shipland.vision.near.gates import Refusal
from shipland.vision.near.pipeline import NearVision, Steps
from shipland.vision.near.published import published_vision
from shipland.vision.near.regions import find_regions
from shipland.vision.near.segment import Window
from shipland.vision.parameters import VisionParameters

PARAMETERS = VisionParameters()
BAR = Rig().cue
SMALL = Camera.from_fov(640, 360, 38.0)  # the packaged focal length over a quarter of the picture: quick to paint
LEVEL = GimbalAttitude(0.0, 0.0)
QUIET = Look(0.45, 0.0)
REASONS = {refusal.value for refusal in Refusal}


def vision(target=BAR, camera=SMALL, **changes):
    return NearVision(target, camera, replace(PARAMETERS, **changes))


def look_at(eyes, image, t_s=0.0, gimbal=LEVEL):
    return eyes.see(Frame(t_s, image, gimbal))


def place(range_m, azimuth_deg=0.0, down=0.0):
    azimuth = np.radians(azimuth_deg)
    return range_m * np.array([-np.cos(azimuth), -np.sin(azimuth), down])


def assert_pose(observation, position_in_bar_m, yaw_rad, sigmas=5.0):
    assert observation.reason == ""
    pose = observation.bar_pose
    spread = np.sqrt(np.diag(pose.covariance))
    error = np.append(pose.position_in_bar_m - position_in_bar_m, pose.yaw_rad - yaw_rad)
    assert np.all(np.abs(error) < sigmas * spread + [2e-3, 2e-3, 2e-3, 1e-3]), (error, spread)


@pytest.mark.parametrize("range_m", [1.6, 2.0, 4.0, 8.0, 12.0, 15.0, 18.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, -18.0])
def test_the_bar_from_touchdown_to_18_m(range_m, azimuth_deg, rng, camera):
    camera = camera if range_m < 3.0 else SMALL
    where, yaw = place(range_m, azimuth_deg, 0.04), np.radians(azimuth_deg) + 0.01
    image = bar_picture(BAR, camera, camera_from_bar(where, yaw), rng, Look(0.45, 1.5))
    assert_pose(look_at(vision(camera=camera), image), where, yaw)


@pytest.mark.parametrize("range_m", [2.0, 6.0])
@pytest.mark.parametrize("azimuth_deg", [-40.0, 40.0])
def test_40_degrees_off_the_axis(range_m, azimuth_deg, rng, camera):
    where, yaw = place(range_m, azimuth_deg), np.radians(azimuth_deg)
    image = bar_picture(BAR, camera, camera_from_bar(where, yaw), rng, QUIET)
    assert_pose(look_at(vision(camera=camera), image), where, yaw)
    as_printed = look_at(published_vision(BAR, camera, PARAMETERS), image)
    assert (as_printed.reason == Refusal.SIDES_UNEQUAL.value) is (range_m < 3.0)  # 15 % longer on one side


def test_over_the_deck_looking_up(rng, camera):
    where, pitch = np.array([-2.0, 0.05, 0.7]), np.radians(19.0)
    image = bar_picture(BAR, camera, camera_from_bar(where, -0.02, pitch), rng, QUIET)
    for gimbal in (GimbalAttitude(0.0, pitch), GimbalAttitude(np.nan, 0.0)):  # right, unknown
        assert_pose(look_at(vision(camera=camera), image, gimbal=gimbal), where, -0.02)


@pytest.mark.parametrize(("off_deg", "range_m"), [(-10.0, 4.0), (10.0, 4.0), (5.0, 4.0), (19.0, 2.5)])
def test_a_pose_is_refused_where_gimbal_and_horizon_disagree(rng, camera, off_deg, range_m):
    """A gimbal that is off by 10° would move the height by 0.7 m at 4 m."""
    where, pitch = np.array([-range_m, 0.05, 0.3]), np.radians(5.0)
    image, eyes = bar_picture(BAR, camera, camera_from_bar(where, -0.02, pitch), rng, QUIET), vision(camera=camera)
    for _ in range(2):  # the second time near the first
        seen = look_at(eyes, image, gimbal=GimbalAttitude(0.0, pitch + np.radians(off_deg)))
        assert seen.bar_pose is None
        assert seen.reason.startswith("gimbal and horizon disagree by ")
        assert float(seen.reason.split()[-1].rstrip("°")) == pytest.approx(abs(off_deg), abs=1.5)  # what corners tell
    assert_pose(look_at(eyes, image, gimbal=GimbalAttitude(0.0, pitch)), where, -0.02)


def test_a_rolled_camera(rng):
    where = place(5.0, 10.0)
    for roll in (-0.3, 0.3):
        image = bar_picture(BAR, SMALL, camera_from_bar(where, 0.17, 0.0, roll), rng, QUIET)
        assert_pose(look_at(vision(), image, gimbal=GimbalAttitude(roll, 0.0)), where, 0.17)


TARGETS = {
    "one": (rectangles((0.1, 0.0, 0.5, 0.7)), 3.5),
    "tilted": (
        Cue(
            (
                Polygon(((-0.59, -0.05), (-0.40, 0.0), (-0.54, 0.53), (-0.73, 0.48))),
                Polygon(((0.40, 0.0), (0.59, -0.05), (0.73, 0.48), (0.54, 0.53))),
            )
        ),
        5.0,
    ),
    "unequal": (rectangles((-0.6, 0.0, 0.3, 0.4), (0.0, -0.3, 0.5, 0.2), (0.5, 0.2, 0.25, 0.25)), 5.0),
    "ten": (rectangles(*((0.35 * i - 0.7, 0.3 * j, 0.2 + 0.02 * i, 0.15) for i in range(5) for j in range(2))), 5.0),
}


@pytest.mark.parametrize("name", list(TARGETS))
def test_any_known_coplanar_quadrilaterals(name, rng):
    target, range_m = TARGETS[name]
    where = place(range_m, 15.0, 0.05)
    image = bar_picture(target, SMALL, camera_from_bar(where, 0.25), rng, QUIET)
    observation = look_at(vision(target), image)
    assert_pose(observation, where, 0.25)
    truth = project_plane(target.points_in_bar_m[:, 1:], SMALL, camera_from_bar(where, 0.25))
    assert np.abs(observation.bar_pose.corners_px - truth).max() < 0.1  # px, in the target's own order


EXAMPLE = Path(__file__).parents[2] / "examples" / "near_vision_printed.toml"
PRINTED = replace(PARAMETERS, **read_toml(EXAMPLE)["vision"])


@pytest.mark.parametrize(
    ("eyes", "azimuth_deg"),
    [
        (NearVision(BAR, SMALL, PARAMETERS, Steps(quads_of=published.find_quads)), 8.0),
        (NearVision(BAR, SMALL, PARAMETERS, Steps(measure=published.measure_corners)), 8.0),
        (published_vision(BAR, SMALL, PRINTED), 0.0),
    ],
    ids=["watershed", "forstner", "as printed"],
)
def test_each_published_step_works_in_our_chain_and_all_of_them_square_on(eyes, azimuth_deg, rng):
    where, yaw = place(5.0, azimuth_deg), np.radians(azimuth_deg)
    image = bar_picture(BAR, SMALL, camera_from_bar(where, yaw), rng, Look(0.6, 1.5))
    assert_pose(look_at(eyes, image), where, yaw)


SQUARE = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 40.0], [0.0, 40.0]])


@pytest.mark.parametrize(
    ("corner", "moved_px", "passes"),
    [
        (2, (0.0, 3.5), True),  # the right side 9 % longer, the lower one at a slope of 3.5 %
        (2, (0.0, 4.5), False),  # 11 % longer
        (2, (1.9, 0.0), True),  # the right side at a slope of 4.75 %
        (2, (2.2, 0.0), False),  # 5.5 %
    ],
)
def test_the_printed_screening_has_its_printed_tolerances(corner, moved_px, passes):
    quads = np.stack([SQUARE, SQUARE + np.array([150.0, 0.0])])
    quads[1, corner] += moved_px
    refusal = published.screened_as_printed(quads)
    assert refusal is (None if passes else Refusal.SCREENED)
    assert published.screened_as_printed(0.1 * quads) is refusal  # however short the sides


def test_as_printed_the_corners_are_screened_before_their_pose(rng, camera, monkeypatch):
    """From 40° off at 2 m one upright side is 15 % longer than the other: refused, and in these words."""
    where, yaw = place(2.0, 40.0), np.radians(40.0)
    image = bar_picture(BAR, camera, camera_from_bar(where, yaw), rng, QUIET)
    from_hulls = replace(PRINTED, quads="hull")
    solved = []
    monkeypatch.setattr("shipland.vision.near.pipeline.solve_pose", lambda *given: solved.append(given))
    assert look_at(published_vision(BAR, camera, from_hulls), image).reason == Refusal.SCREENED.value
    assert not solved


def test_as_printed_half_a_cue_is_no_cue(rng):
    where = np.array([-4.0, 0.0, 0.0])
    image = bar_picture(BAR, SMALL, camera_from_bar(where, 0.5), rng, QUIET)
    assert look_at(published_vision(BAR, SMALL, PRINTED), image).bar_pose is None


@pytest.mark.parametrize("kind", ["rectangles", "shapes", "foliage"])
def test_no_pose_without_the_cue(kind, rng):
    with_and_without_gimbal = [vision(gimbal_noise_rad=noise_rad) for noise_rad in (0.001, 0.0)]
    for _ in range(10):
        canvas = foliage(SMALL, rng, rng.uniform(0.1, 0.8)) if kind == "foliage" else decoys(SMALL, kind, rng)
        image = finish(canvas, rng, Look(noise=1.0))
        for eyes in with_and_without_gimbal:
            eyes.reset()
            observation = look_at(eyes, image)
            assert observation.bar_pose is None
            assert observation.reason in REASONS


@pytest.mark.parametrize(
    "other",
    [
        rectangles((-0.3, 0.0, 0.45, 0.15), (0.3, 0.0, 0.45, 0.15)),
        rectangles((-0.5, 0.0, 0.45, 0.15), (0.5, 0.0, 0.45, 0.15)),
        rectangles((-0.375, 0.0, 0.3, 0.15), (0.375, 0.0, 0.3, 0.15)),
        rectangles((-0.375, 0.0, 0.45, 0.25), (0.375, 0.0, 0.45, 0.25)),
        rectangles((-0.375, -0.1, 0.45, 0.15), (0.375, 0.1, 0.45, 0.15)),
        rectangles((0.0, 0.0, 0.45, 0.15)),
    ],
    ids=["narrower", "wider", "shorter", "higher", "askew", "half"],
)
def test_a_bar_of_other_dimensions_is_not_the_bar(other, rng):
    for range_m, azimuth_deg in ((3.0, 0.0), (6.0, 20.0), (14.0, -10.0)):
        pose = camera_from_bar(place(range_m, azimuth_deg), np.radians(azimuth_deg))
        observation = look_at(vision(), bar_picture(other, SMALL, pose, rng, QUIET))
        assert observation.bar_pose is None
        assert observation.reason in REASONS


def two_bars(rng, pose, others):
    canvas = plain_canvas(SMALL)
    for other in (pose, *others):
        add_target(canvas, BAR, SMALL, other, QUIET)
    return finish(canvas, rng, QUIET)


def test_of_two_bars_the_nearest_or_the_one_followed(rng):
    pose = camera_from_bar(place(9.0), 0.0)
    # The second one stands 1.7 m to the right and 0.6 m farther off.
    far = pose @ Pose(np.eye(3), np.array([0.6, 1.7, 0.0]))
    image = two_bars(rng, pose, [far])
    nearest = look_at(vision(), image)
    assert_pose(nearest, place(9.0), 0.0)
    assert look_at(vision(several_cues="refuse"), image).reason == Refusal.AMBIGUOUS.value
    eyes = vision()
    look_at(eyes, bar_picture(BAR, SMALL, far, rng, QUIET), 0.0)
    followed = look_at(eyes, image, 0.03)
    assert followed.bar_pose.position_in_bar_m[1] == pytest.approx(-1.7, abs=0.05)


def test_tracking_gives_what_searching_gives(rng):
    eyes = vision()
    for step in range(12):
        where, yaw = place(9.0 - 0.2 * step, 10.0 - step, 0.05), np.radians(10.0 - step) + 0.05
        image = bar_picture(BAR, SMALL, camera_from_bar(where, yaw), rng, Look(0.45, 1.5))
        followed, fresh = look_at(eyes, image, 0.1 * step), look_at(vision(), image)
        assert_pose(followed, where, yaw)
        spread = np.sqrt(np.diag(fresh.bar_pose.covariance))[:3]
        apart = followed.bar_pose.position_in_bar_m - fresh.bar_pose.position_in_bar_m
        assert np.all(np.abs(apart) < 0.3 * spread + 1e-4)


def test_a_steady_pan_is_followed_without_searching(rng, monkeypatch):
    searched = []

    def noted(image, window, *more):
        searched.append(window == Window.whole(image))
        return find_regions(image, window, *more)

    eyes = NearVision(BAR, SMALL, PARAMETERS, Steps(regions_of=noted))
    for step in range(7):
        yaw = 0.2 - 0.066 * step  # 61 px a frame, beyond the region's margin
        image = bar_picture(BAR, SMALL, camera_from_bar(place(9.0), yaw), rng, QUIET)
        assert_pose(look_at(eyes, image, 0.05 * step), place(9.0), yaw)
    assert sum(searched) == 2  # to find it, and to see how fast it moves


def test_a_jump_out_of_the_tracked_region_is_found_in_the_whole_picture(rng):
    eyes = vision()
    for t_s, right_m in ((0.0, -1.0), (0.03, 1.0)):
        where = np.array([-7.0, right_m, 0.0])
        assert_pose(look_at(eyes, bar_picture(BAR, SMALL, camera_from_bar(where), rng, QUIET), t_s), where, 0.0)


def test_refusals_say_why(rng):
    plain = np.full((360, 640, 3), 128, np.uint8)
    assert look_at(vision(), None).reason == Refusal.NO_PICTURE.value
    assert look_at(vision(), plain[:100]).reason == Refusal.WRONG_SIZE.value
    assert look_at(vision(), plain).reason == Refusal.NOTHING_GREEN.value
    far = bar_picture(BAR, SMALL, camera_from_bar(place(9.0)), rng, QUIET)
    assert look_at(vision(max_distance_m=8.0), far).reason == Refusal.OUT_OF_REACH.value
    wider = rectangles((-0.42, 0.0, 0.45, 0.15), (0.42, 0.0, 0.45, 0.15))  # a gap of 0.39 m, not 0.30 m
    misfit = bar_picture(wider, SMALL, camera_from_bar(place(9.0)), rng, QUIET)
    assert look_at(vision(), misfit).reason == Refusal.REPROJECTION.value
    assert look_at(
        vision(), bar_picture(BAR, SMALL, camera_from_bar(place(9.0), 0.0, 0.0, 0.8), rng, QUIET)
    ).reason == (Refusal.NO_MATCH.value)
    aslant = bar_picture(BAR, SMALL, camera_from_bar(place(5.0, 56.0), np.radians(56.0)), rng, QUIET)
    assert look_at(vision(), aslant).reason == Refusal.OUT_OF_REACH.value
    disc = np.zeros_like(plain)
    cv2.circle(disc, (300, 200), 40, (60, 190, 70), cv2.FILLED)
    assert look_at(vision(), disc).reason == Refusal.NO_QUADRILATERAL.value


CUTS = {  # the bar 3 m away, turned to an edge until the edge cuts it
    "left": (0.43, 0.0),
    "right": (-0.43, 0.0),
    "above": (0.0, -0.19),
    "below": (0.0, 0.19),
}


@pytest.mark.parametrize("edge", list(CUTS))
def test_a_bar_cut_by_the_edge_is_refused_by_name_unless_three_sides_of_each_rectangle_are_left(edge, rng):
    yaw, pitch = CUTS[edge]
    image = bar_picture(BAR, SMALL, camera_from_bar(place(3.0), yaw, pitch), rng, QUIET)
    observation = look_at(vision(), image, gimbal=GimbalAttitude(0.0, pitch))
    if edge in ("above", "below"):
        assert_pose(observation, place(3.0), yaw)
        assert observation.bar_pose.reprojection_px < 0.1  # of the sides that are seen
    else:
        assert observation.reason == Refusal.CUT_BY_FRAME.value


def test_a_rectangle_and_the_rest_of_the_other_are_enough(rng):
    # The left rectangle is whole; the edge cuts the right one where the left one's pose foresees it.
    where, yaw = place(3.0), -0.16
    image = bar_picture(BAR, SMALL, camera_from_bar(where, yaw), rng, QUIET)
    observation = look_at(vision(), image)
    assert observation.bar_pose.corners_px.shape == (4, 2)
    assert_pose(observation, where, yaw)


@pytest.mark.parametrize("yaw", [-0.16, -0.3], ids=["cut", "outside"])
def test_something_green_at_the_edge_is_not_the_rest_of_the_bar(yaw, rng):
    # The left rectangle is whole; instead of the right one, cut or outside, there is another thing at the edge.
    pose = camera_from_bar(place(3.0), yaw)
    canvas = bar_picture(rectangles((-0.375, 0.0, 0.45, 0.15)), SMALL, pose, rng, QUIET)
    canvas = light_of(canvas)
    paint(canvas, [(560, 230), (700, 230), (700, 280), (560, 280)], GREEN, 2)
    assert look_at(vision(), finish(canvas, rng, QUIET)).reason == Refusal.CUT_BY_FRAME.value


def test_a_frame_that_the_edge_cuts_is_told_of(rng):
    # What is left of a frame is a U, open where the edge is: far from its own hull, which is a quadrilateral.
    canvas = plain_canvas(SMALL)
    for left, right, bottom in ((250, 390, 280), (250, 280, 370), (360, 390, 370)):
        paint(canvas, [(left, 250), (right, 250), (right, bottom), (left, bottom)], GREEN, 2)
    observation = look_at(vision(rectangles((0.0, 0.0, 0.5, 0.7))), finish(canvas, rng, QUIET))
    assert observation.reason == Refusal.CUT_BY_FRAME.value


def test_a_lone_rectangle_is_used_only_when_it_was_followed(rng):
    # The left rectangle alone is in the picture.
    where, whole, part = place(3.0), -0.02, -0.3
    lone = bar_picture(BAR, SMALL, camera_from_bar(where, part), rng, QUIET)
    assert look_at(vision(), lone).bar_pose is None
    eyes = vision()
    for step, yaw in enumerate(np.linspace(whole, part, 12)):
        observation = look_at(eyes, bar_picture(BAR, SMALL, camera_from_bar(where, yaw), rng, QUIET), 0.05 * step)
    assert_pose(observation, where, part)


def test_a_bar_that_just_touches_the_edge_is_whole(rng):
    target = rectangles((0.0, 0.0, 0.5, 0.7))
    pose = camera_from_bar(place(3.0), 0.0)
    low = project_plane([(0.0, 0.35)], SMALL, pose)[0, 1]
    for beyond_px, found in ((0.0, True), (25.0, False)):
        pitch = np.arctan2(SMALL.height_px - 0.5 + beyond_px - SMALL.matrix[1, 2], SMALL.focal_px) - np.arctan2(
            low - SMALL.matrix[1, 2], SMALL.focal_px
        )
        image = bar_picture(target, SMALL, camera_from_bar(place(3.0), 0.0, pitch), rng, QUIET)
        observation = look_at(vision(target), image, gimbal=GimbalAttitude(0.0, pitch))
        assert (observation.bar_pose is not None) is found
        assert found or observation.reason == Refusal.CUT_BY_FRAME.value


@pytest.mark.parametrize(
    "gimbal", [GimbalAttitude(np.nan, np.nan), GimbalAttitude(np.inf, 0.0), GimbalAttitude(9.0, -7.0)]
)
def test_odd_gimbals_do_not_matter(gimbal, rng):
    where = place(4.0, 10.0)
    image = bar_picture(BAR, SMALL, camera_from_bar(where, 0.17), rng, QUIET)
    observation = look_at(vision(), image, gimbal=gimbal)
    assert_pose(observation, where, 0.17)
