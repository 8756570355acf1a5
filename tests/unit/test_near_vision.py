"""The near chain on drawn pictures, where truth is exact: poses, refusals by name, odd inputs, real photographs."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import shipland
from pictures import TONES, Look, add_target, bar_picture, camera_from_bar, decoys, finish, light_of, project_plane
from shipland.camera import Camera, CameraParameters
from shipland.cue import Cue, Polygon
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.vision.near.covariance import bar_pose_of
from shipland.vision.near.gates import Refusal
from shipland.vision.near.pipeline import NearVision
from shipland.vision.near.planar_pose import Corners, LevelPrior, solve
from shipland.vision.parameters import VisionParameters

PARAMETERS = VisionParameters()
CORNERS_ALONE = VisionParameters(gimbal_noise_rad=0.0)
CAMERA = Camera.from_parameters(CameraParameters())
BAR = Rig().cue
NO_GIMBAL = GimbalAttitude(float("nan"), float("nan"))


def look(image, target=BAR, camera=CAMERA, parameters=CORNERS_ALONE):
    return NearVision(target, camera, parameters).see(Frame(0.0, image, NO_GIMBAL))


@pytest.mark.parametrize("tone", list(TONES))
def test_a_tone_curve_costs_little(tone):
    """All edges move outward together, by up to 0.4 px: measured as they look, the camera is 1–3 % too near."""
    for index, (range_m, azimuth_deg) in enumerate([(3.0, 20.0), (13.0, -20.0)]):
        azimuth_rad = np.radians(azimuth_deg)
        place_m = range_m * np.array([-np.cos(azimuth_rad), -np.sin(azimuth_rad), 0.02])
        pose = camera_from_bar(place_m, azimuth_rad + 0.05)
        image = bar_picture(BAR, CAMERA, pose, np.random.default_rng(index), Look(0.4, 1.0, tone=TONES[tone]))
        seen = NearVision(BAR, CAMERA, PARAMETERS).see(Frame(0.0, image, GimbalAttitude(0.0, 0.0)))
        assert seen.bar_pose is not None, seen.reason
        told_m = np.linalg.norm(seen.bar_pose.position_in_bar_m)
        assert abs(told_m / range_m - 1.0) < 0.006, (range_m, told_m)
        assert abs(seen.bar_pose.yaw_rad - azimuth_rad - 0.05) < np.radians(1.0), range_m


@pytest.mark.parametrize("range_m", [10.0, 11.6, 13.2, 14.8])
def test_a_clipped_lamp_is_measured_by_luma_where_colour_is_coded(range_m):
    """JPEG's colour at half resolution: the colours that do not clip hardly differ here and their edges are smeared."""
    place_m = (-range_m, 0.2 * range_m, 0.05)
    look_at, rng = camera_from_bar(place_m, np.arctan2(-0.2, 1.0)), np.random.default_rng(1)
    canvas = np.full((720, 1280, 3), light_of((200.0, 170.0, 140.0)))
    add_target(canvas, BAR, CAMERA, look_at, Look(0.6), (90.0, 250.0, 110.0), board=(90.0, 90.0, 90.0))
    written = cv2.imencode(".jpg", finish(canvas, rng, Look(noise=2.0)), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    picture = cv2.imdecode(written, cv2.IMREAD_COLOR)
    seen = NearVision(BAR, CAMERA, PARAMETERS).see(Frame(0.0, picture, GimbalAttitude(0.0, 0.0)))
    assert seen.bar_pose is not None, seen.reason
    error_m = seen.bar_pose.position_in_bar_m - place_m
    assert error_m @ np.linalg.solve(seen.bar_pose.covariance[:3, :3], error_m) < 12.0


def test_distorted_camera_gives_the_same_pose():
    camera = Camera(1280, 720, CAMERA.matrix, np.array([0.08, -0.12, 0.001, -0.0005, 0.02]))
    place_m = np.array([-3.0, -0.2, 0.1])
    image = bar_picture(BAR, camera, camera_from_bar(place_m), np.random.default_rng(4))
    seen = look(image, camera=camera)
    assert seen.bar_pose is not None, seen.reason
    np.testing.assert_allclose(seen.bar_pose.position_in_bar_m, place_m, atol=0.03)  # m; straight sides drawn bent


def test_what_lies_where_a_lens_has_no_inverse_is_not_the_cue():
    """The polynomial folds back outside of the part of the picture that the board of its calibration was in."""
    camera = Camera(640, 480, Camera.from_fov(640, 480, 130.0).matrix, np.array([0.4, -2.0, 0.0, 0.0]))
    eyes = NearVision(BAR, camera, PARAMETERS)
    reasons = set()
    for left, top in ((4, 4), (440, 4), (4, 440), (300, 200), (500, 440)):
        image = np.full((480, 640, 3), 120, np.uint8)
        for at in (left, left + 105):
            cv2.rectangle(image, (at, top), (at + 64, top + 21), (60, 190, 70), cv2.FILLED)
        reasons.add(eyes.see(Frame(0.0, image, NO_GIMBAL)).reason)
        eyes.reset()
    assert Refusal.NO_MATCH.value in reasons


def bar_at(place_m, yaw_rad=0.0):
    return bar_picture(BAR, CAMERA, camera_from_bar(place_m, yaw_rad), np.random.default_rng(5))


def test_the_bar_is_found_among_decoys():
    rng = np.random.default_rng(7)
    place_m = np.array([-4.0, 0.2, 0.1])
    canvas = decoys(CAMERA, "shapes", rng)
    add_target(canvas, BAR, CAMERA, camera_from_bar(place_m))
    seen = look(finish(canvas, rng))
    assert seen.bar_pose is not None, seen.reason
    np.testing.assert_allclose(seen.bar_pose.position_in_bar_m, place_m, atol=0.05)  # m; no gimbal


def test_covariance_follows_the_arc():
    """From 25 m the angle about the cue's vertical errs by degrees, so the camera along an arc."""
    rng = np.random.default_rng(8)
    plane_m = BAR.points_in_bar_m[:, 1:].reshape(-1, 4, 2)
    sigma_px, squared = 0.02, []
    for _ in range(300):
        azimuth_rad = rng.uniform(-0.35, 0.35)
        place_m = 25.0 * np.array([-np.cos(azimuth_rad), -np.sin(azimuth_rad), 0.02])
        pose = camera_from_bar(place_m, azimuth_rad)
        pixels = project_plane(plane_m, CAMERA, pose) + rng.normal(0.0, sigma_px, (8, 2))
        corners = Corners(pixels.reshape(-1, 4, 2), np.tile(np.eye(8) / sigma_px, (2, 1, 1)), plane_m)
        told = bar_pose_of(solve(corners, CAMERA, LevelPrior(pose.rotation[:, 2], 0.001)), corners.undistorted_px)
        error = np.append(told.position_in_bar_m - place_m, told.yaw_rad - azimuth_rad)
        squared.append(float(error @ np.linalg.solve(told.covariance, error)))
    assert np.median(squared) > 1.0
    assert np.mean(squared) < 7.0  # 4 by rights; 13 by the straight line


@pytest.mark.parametrize("shear", [0.02, 0.05])
def test_a_sheared_picture_does_not_bend_the_pose(shear):
    """Rows exposed one after the other while the camera turns shift sideways; the corners then fit no level pose."""
    place_m, yaw_rad = 3.0 * np.array([-np.cos(0.3), -np.sin(0.3), 0.03]), 0.3
    pose = camera_from_bar(place_m, yaw_rad)
    still = bar_picture(BAR, CAMERA, pose, np.random.default_rng(0))
    row = project_plane(BAR.points_in_bar_m[:, 1:], CAMERA, pose)[:, 1].mean()
    way = np.array([[1.0, shear, -shear * row], [0.0, 1.0, 0.0]])
    image = cv2.warpAffine(still, way, still.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)
    seen = NearVision(BAR, CAMERA, PARAMETERS).see(Frame(0.0, image, GimbalAttitude(0.0, 0.0)))
    assert seen.bar_pose is not None, seen.reason
    np.testing.assert_allclose(seen.bar_pose.position_in_bar_m, place_m, atol=0.01)  # m; 0.17 m by the corners' word
    assert abs(seen.bar_pose.yaw_rad - yaw_rad) < np.radians(0.1)


@pytest.mark.parametrize(("blur_px", "found"), [(1.2, True), (2.5, False)])
def test_a_cue_smeared_over_its_own_height_is_refused(blur_px, found):
    """From 8 m the rectangles are 17 px high: a tenth of it is the most."""
    pose = camera_from_bar((-8.0, 0.0, 0.0))
    seen = look(bar_picture(BAR, CAMERA, pose, np.random.default_rng(0), Look(blur_px=blur_px)))
    assert (seen.bar_pose is not None) is found
    assert found or seen.reason == Refusal.CORNERS_UNSURE.value


TINY = Camera.from_fov(96, 64, 30.0)
NUMBERS = st.one_of(st.floats(), st.sampled_from([float("nan"), float("inf"), -float("inf"), -1.0, 0.0, 0.1, 1e300]))
GIMBALS = st.builds(GimbalAttitude, NUMBERS, NUMBERS, NUMBERS)


@cache
def tiny_bar(number=0):
    """Three are in view, one is cut."""
    place_m = np.array([-3.0, (-0.05, 0.0, 0.05, 1.2)[number], 0.0])
    return bar_picture(BAR, TINY, camera_from_bar(place_m), np.random.default_rng(9))


def blocks(data, shape):
    """Any bytes as a picture of blocks in grey levels or the cue's green, so that regions come of it."""
    values = np.resize(np.frombuffer(data or b"\0", np.uint8), (8, 12, 3)).copy()
    values[values[..., 0] > 128] = (60, 190, 70)
    return cv2.resize(values, shape[1::-1], interpolation=cv2.INTER_NEAREST).reshape(*shape[:2], 3)


PICTURES = {
    "a bar": lambda data: tiny_bar(len(data) % 4),
    "bytes": lambda data: np.resize(np.frombuffer(data or b"\0", np.uint8), (64, 96, 3)),
    "blocks": lambda data: blocks(data, (64, 96, 3)),
    "a mirrored bar": lambda data: tiny_bar()[:, ::-1],
    "upside down": lambda data: tiny_bar()[::-1, ::-1],
    "channels reversed": lambda data: tiny_bar()[..., ::-1],
    "strided": lambda data: np.repeat(np.repeat(tiny_bar(), 2, 0), 3, 1)[::2, ::3],
    "columns first": lambda data: np.asfortranarray(tiny_bar()),
    "read-only": lambda data: np.frombuffer(tiny_bar().tobytes(), np.uint8).reshape(64, 96, 3),
    "none": lambda data: None,
    "not a number": lambda data: np.full((64, 96, 3), np.nan),
    "floats": lambda data: tiny_bar() / 255.0,
    "16 bits": lambda data: tiny_bar().astype(np.uint16) * 257,
    "signed": lambda data: tiny_bar().astype(np.int8),
    "one channel": lambda data: tiny_bar()[..., 1],
    "one channel, three axes": lambda data: tiny_bar()[..., 1:2],
    "two channels": lambda data: tiny_bar()[..., :2],
    "four channels": lambda data: np.dstack([tiny_bar(), tiny_bar()[..., 0]]),
    "one pixel": lambda data: tiny_bar()[:1, :1],
    "one row": lambda data: tiny_bar()[:1],
    "empty": lambda data: np.zeros((0, 0, 3), np.uint8),
    "no columns": lambda data: np.zeros((64, 0, 3), np.uint8),
    "a number": lambda data: np.uint8(7),
    "another size": lambda data: cv2.resize(tiny_bar(), (48, 32)),
    "on its side": lambda data: tiny_bar().transpose(1, 0, 2),
}
NO_PICTURES = {"none"} | set(list(PICTURES)[list(PICTURES).index("not a number") :])
SEEN = st.tuples(st.sampled_from(list(PICTURES)), st.binary(max_size=300), NUMBERS, GIMBALS)


def assert_sound(seen, t_s, gimbal):
    """An observation of its own frame that carries a finite pose or a refusal by name, not both."""
    assert seen.t_s is t_s
    assert seen.gimbal is gimbal
    named = {each.value for each in Refusal}
    assert (seen.bar_pose is None) == (seen.reason in named or seen.gimbal_off_rad > 0.0)
    if seen.bar_pose is not None:
        assert np.isfinite(seen.bar_pose.position_in_bar_m).all()
        assert np.isfinite(seen.bar_pose.covariance).all()
        assert np.linalg.eigvalsh(seen.bar_pose.covariance).min() > -1e-9
        assert np.isfinite(seen.bar_pose.yaw_rad)


@given(st.lists(SEEN, min_size=1, max_size=4))
@settings(max_examples=12)
def test_whatever_comes_after_whatever_else_is_answered_in_words(sequence):
    """Pictures, time stamps (NaN, endless, backward) and gimbals of any kind, with a pose followed or without."""
    eyes = NearVision(BAR, TINY, VisionParameters())
    for name, data, t_s, gimbal in sequence:
        # Not a Frame, which would refuse some of these itself.
        seen = eyes.see(SimpleNamespace(t_s=t_s, image=PICTURES[name](data), gimbal=gimbal))
        assert_sound(seen, t_s, gimbal)
        if name in NO_PICTURES:
            assert seen.bar_pose is None


@pytest.mark.parametrize(
    ("name", "t_s"),
    [*((name, 0.1) for name in PICTURES), *(("a bar", t_s) for t_s in (0.0, -1.0, float("nan"), float("inf")))],
)
def test_an_odd_frame_leaves_a_followed_bar_followed(name, t_s):
    eyes = NearVision(BAR, TINY, PARAMETERS)
    level = GimbalAttitude(0.0, 0.0)
    for index in range(2):
        first = eyes.see(Frame(0.05 * index - 0.1, tiny_bar(index), level))
        assert first.bar_pose is not None, first.reason
    for gimbal in (level, NO_GIMBAL, GimbalAttitude(float("inf"), 0.0)):
        odd = eyes.see(SimpleNamespace(t_s=t_s, image=PICTURES[name](b"7"), gimbal=gimbal))
        assert_sound(odd, t_s, gimbal)
    assert eyes.see(Frame(0.2, tiny_bar(2), level)).bar_pose is not None


@pytest.mark.parametrize("name", ["a bar", "strided", "columns first", "read-only"])
def test_how_a_picture_lies_in_memory_does_not_matter(name):
    wanted = NearVision(BAR, TINY, PARAMETERS).see(Frame(0.0, tiny_bar(), NO_GIMBAL)).bar_pose
    image = PICTURES[name](b"")
    told = NearVision(BAR, TINY, PARAMETERS).see(Frame(0.0, image, NO_GIMBAL)).bar_pose
    assert np.array_equal(told.corners_px, wanted.corners_px)
    assert np.array_equal(told.covariance, wanted.covariance)


def test_20_megapixels():
    """Without the bar, with it, and green all over."""
    camera = Camera.from_fov(5472, 3648, 69.0)
    image = np.full((3648, 5472, 3), 120, np.uint8)
    eyes = NearVision(BAR, camera, CORNERS_ALONE)
    assert eyes.see(Frame(0.0, image, NO_GIMBAL)).reason == Refusal.NOTHING_GREEN.value
    place_m = np.array([-8.0, 0.5, 0.2])
    corners_px = project_plane(BAR.points_in_bar_m[:, 1:], camera, camera_from_bar(place_m))
    for quad in np.rint(corners_px).astype(np.int32).reshape(-1, 4, 2):
        cv2.fillPoly(image, [quad], (60, 190, 70))
    seen = eyes.see(Frame(0.1, image, NO_GIMBAL))
    assert seen.bar_pose is not None, seen.reason
    np.testing.assert_allclose(seen.bar_pose.position_in_bar_m, place_m, atol=0.3)  # m; drawn on whole pixels
    image[:] = (60, 190, 70)
    assert eyes.see(Frame(0.2, image, NO_GIMBAL)).bar_pose is None


ASYMMETRIC = Cue.from_file(Path(shipland.__file__).parent / "configs" / "cues" / "bar_asymmetric.toml")


def reflected(image):
    """Upside down about its middle row, which a level camera's horizon is: what a mirror below shows."""
    return np.ascontiguousarray(image[::-1])


@pytest.mark.parametrize("gimbal", [GimbalAttitude(0.0, 0.0), NO_GIMBAL], ids=["gimbal", "no gimbal"])
def test_a_cue_that_has_an_up_is_not_its_reflection(gimbal):
    rng = np.random.default_rng(11)
    for _ in range(3):
        range_m, azimuth_rad = rng.uniform(2.0, 15.0), rng.uniform(-0.6, 0.6)
        place_m = range_m * np.array([-np.cos(azimuth_rad), -np.sin(azimuth_rad), rng.uniform(-0.1, 0.05)])
        look = Look(0.5, 1.0)
        for target, mirrored_is_found in ((ASYMMETRIC, False), (BAR, True)):
            image = bar_picture(target, CAMERA, camera_from_bar(place_m, azimuth_rad), rng, look)
            there = NearVision(target, CAMERA, PARAMETERS).see(Frame(0.0, image, gimbal))
            mirrored = NearVision(target, CAMERA, PARAMETERS).see(Frame(0.0, reflected(image), gimbal))
            assert there.bar_pose is not None, there.reason
            assert (mirrored.bar_pose is not None) is mirrored_is_found, (target, mirrored.reason)


def test_the_reflection_of_a_followed_bar_is_refused():
    """A level camera 0.75 m above a mirror sees the bar's image 1.5 m lower: no aircraft rises so in 0.1 s."""
    level = GimbalAttitude(0.0, 0.0)
    eyes = NearVision(BAR, CAMERA, PARAMETERS)
    assert eyes.see(Frame(0.0, bar_at((-6.0, 0.2, 0.75)), level)).bar_pose is not None
    seen = eyes.see(Frame(0.1, bar_at((-6.0, 0.2, -0.75)), level))
    assert seen.reason == Refusal.JUMP.value
    assert eyes.see(Frame(0.2, bar_at((-5.9, 0.2, 0.7)), level)).bar_pose is not None
    assert eyes.see(Frame(1.5, bar_at((-6.0, 0.2, -0.75)), level)).bar_pose is not None  # the last is forgotten


@pytest.mark.parametrize(
    ("width_m", "height_m", "middle_m", "place_m"),
    [
        (0.450, 0.136, 0.396, (-3.1, 0.15, 0.0)),  # as if all sides had grown inward by three pixels
        (0.503, 0.150, 0.433, (-4.4, 3.3, -0.44)),
        (0.376, 0.150, 0.297, (-7.8, -1.5, 0.36)),
        (0.450, 0.175, 0.330, (-16.2, 2.5, 0.0)),
    ],
)
def test_a_growth_does_not_excuse_another_bar(width_m, height_m, middle_m, place_m):
    """One or two dimensions are off by 9 to 21 %."""
    other = Cue(tuple(Polygon.rectangle((side * middle_m, 0.0), width_m, height_m) for side in (-1.0, 1.0)))
    pose = camera_from_bar(place_m, np.arctan2(-place_m[1], -place_m[0]))
    image = bar_picture(other, CAMERA, pose, np.random.default_rng(2), Look(0.4, 1.5))
    assert NearVision(BAR, CAMERA, PARAMETERS).see(Frame(0.0, image, GimbalAttitude(0.0, 0.0))).bar_pose is None


def test_two_ellipses_are_no_rectangles():
    turn = np.linspace(0.0, 2.0 * np.pi, 65)[:-1]
    outline = np.column_stack([0.225 * np.cos(turn), 0.075 * np.sin(turn)])
    rng = np.random.default_rng(4)
    for range_m in (17.0, 19.0):
        image = np.full((720, 1280, 3), 128.0)
        for middle_m in (-0.375, 0.375):
            corners_px = project_plane(
                outline + np.array([middle_m, 0.0]), CAMERA, camera_from_bar((-range_m, 0.2, 0.1))
            )
            fine = np.zeros((720 * 4, 1280 * 4), np.uint8)
            cv2.fillPoly(fine, [np.round(64.0 * (corners_px + 0.5) - 8.0).astype(np.int32)], 255, cv2.LINE_8, 4)
            cover = cv2.resize(fine, (1280, 720), interpolation=cv2.INTER_AREA)[..., None] / 255.0
            image = image * (1.0 - cover) + cover * (60.0, 210.0, 20.0)
        image = np.clip(image + rng.normal(0.0, 1.5, image.shape), 0, 255).astype(np.uint8)
        seen = NearVision(BAR, CAMERA, PARAMETERS).see(Frame(0.0, image, GimbalAttitude(0.0, 0.0)))
        assert seen.bar_pose is None, range_m


def test_green_at_the_edge_is_no_cut_cue():
    image = np.full((720, 1280, 3), 120, np.uint8)
    cv2.fillPoly(image, [np.array([[300, -5], [520, -5], [420, 160]])], (60, 190, 70))
    assert look(image).reason == Refusal.NO_QUADRILATERAL.value
