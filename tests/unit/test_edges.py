"""Sub-pixel corners: against drawn edges, through lenses and codecs, with errors as large as they say."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.integrate import quad as integral
from scipy.special import ndtr

from pictures import TONES, Look, bar_picture, camera_from_bar, finish, light_of, paint, project_plane, rectangles
from shipland.camera import Camera
from shipland.vision.near import edges, published
from shipland.vision.near.edges import edge_response, normal
from shipland.vision.parameters import VisionParameters

PARAMETERS = VisionParameters()
PLAIN = Camera.from_fov(160, 90, 20.0)


def drawn(corners, rng, look, background=110.0, size=(90, 160)):
    canvas = np.full((*size, 3), light_of(background))
    paint(canvas, corners, (50.0, 235.0, 45.0), 6, look.blur_px)
    return finish(canvas, rng, look)


def turned_box(width, height, centre=(80.3, 44.6), angle_deg=0.0):
    angle = np.radians(angle_deg)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) @ turn + centre


METHODS = {"edges": edges.measure_corners, "forstner": published.measure_corners}


def found(image, start, camera=PLAIN, method="edges", **changes):
    return METHODS[method](image, np.asarray(start)[None], camera, replace(PARAMETERS, **changes))


@pytest.mark.parametrize("distance_px", [-0.9, -0.2, 0.0, 0.3, 1.1])
@pytest.mark.parametrize("blur_px", [0.15, 0.6, 2.0])
def test_edge_response_is_the_blurred_step_over_a_pixel(distance_px, blur_px):
    seen, by_distance, by_blur = edge_response(distance_px, blur_px)
    over_pixel, _ = integral(lambda u: ndtr((distance_px + u) / blur_px), -0.5, 0.5)
    assert seen == pytest.approx(over_pixel, abs=1e-7)
    density = np.exp(-0.5 * distance_px**2) / np.sqrt(2.0 * np.pi)
    assert normal(distance_px) == pytest.approx((ndtr(distance_px), density), abs=1e-14)
    step = 1e-5
    ahead, behind = (edge_response(distance_px + s, blur_px)[0] for s in (step, -step))
    assert by_distance == pytest.approx((ahead - behind) / (2 * step), abs=1e-5)
    more, less = (edge_response(distance_px, blur_px + s)[0] for s in (step, -step))
    assert by_blur == pytest.approx((more - less) / (2 * step), abs=1e-5)


@pytest.mark.parametrize("size", [(28.0, 9.3), (120.0, 40.0)], ids=["as from 15 m", "as from 3.5 m"])
@pytest.mark.parametrize("blur_px", [0.0, 0.4, 0.9, 1.5])
@pytest.mark.parametrize("angle_deg", [0.0, 3.0, -20.0])
def test_corners_without_noise(size, blur_px, angle_deg):
    # Quantisation to 8 bits leaves some 0.01 px; a pixel's square without blur, which the fit takes for blurred by
    # 0.12 px, 0.03 px; where blur makes the ends of a rectangle 9 px high merge, twice that.
    allowed_px = 0.05 if blur_px < 1.0 else 0.09
    rng = np.random.default_rng(5)
    for _ in range(5):
        corners = turned_box(*size, np.array([80.0, 45.0]) + rng.uniform(-0.5, 0.5, 2), angle_deg)
        measured = found(drawn(corners, rng, Look(blur_px, 0.0)), corners + rng.uniform(-0.7, 0.7, (4, 2)))
        assert np.abs(measured.corners_px[0] - corners).max() < allowed_px


def test_errors_are_as_large_as_they_say():
    rng = np.random.default_rng(8)
    corners, sums = turned_box(40.0, 14.0, angle_deg=4.0), []
    for _ in range(150):
        measured = found(drawn(corners, rng, Look(0.5, 3.0)), corners, edge_floor_px=0.0, edge_coded_px=0.0)
        deviations = measured.whiten[0] @ (measured.corners_px[0] - corners).ravel()
        sums.append(deviations @ deviations)
    # Eight squared standard deviations; 150 trials know their mean to 4 %. Bias of some 0.3 standard deviations is
    # what `edge_floor_px` is for.
    assert 6.5 < np.mean(sums) < 11.0


@pytest.mark.parametrize("method", ["edges", "forstner"])
def test_both_methods_find_them(method, rng):
    corners = turned_box(90.0, 30.0, angle_deg=2.0)
    measured = found(drawn(corners, rng, Look(0.6, 1.5)), corners + 0.6, method=method)
    assert np.abs(measured.corners_px[0] - corners).max() < {"edges": 0.05, "forstner": 0.4}[method]  # px


def test_edges_beat_forstner(rng):
    errors = {"edges": [], "forstner": []}
    for _ in range(10):
        corners = turned_box(60.0, 20.0, np.array([80.0, 45.0]) + rng.uniform(-0.5, 0.5, 2), rng.uniform(-5.0, 5.0))
        image = drawn(corners, rng, Look(0.5, 1.5))
        for method, kept in errors.items():
            kept.append(found(image, corners + 0.4, method=method).corners_px[0] - corners)
    rms = {method: np.sqrt(np.mean(np.square(kept))) for method, kept in errors.items()}
    assert rms["edges"] < 0.3 * rms["forstner"]


def test_straight_in_the_world_through_a_lens(rng):
    # A wide lens bends the sides by up to three pixels; the fit works where they are straight.
    matrix = np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]])
    lens = Camera(320, 240, matrix, np.array([-0.28, 0.08, 0.001, -0.0005, 0.0]))
    pose = camera_from_bar([-1.5, 0.05, 0.1], -0.05)
    wide = Camera(1280, 960, matrix * [[2.0], [2.0], [1.0]] + [[0, 0, 640 - 319.0], [0, 0, 480 - 239.0], [0, 0, 0]])
    target = rectangles((0.0, 0.0, 1.2, 0.8))
    straight = bar_picture(target, wide, pose, rng, Look(1.2, 0.0)).astype(np.float32)
    columns, rows = np.meshgrid(np.arange(320.0), np.arange(240.0))
    undistorted = lens.undistort(np.column_stack([columns.ravel(), rows.ravel()]))
    rays = (undistorted - matrix[:2, 2]) / 300.0
    where = (rays * 600.0 + wide.matrix[:2, 2]).astype(np.float32).reshape(240, 320, 2)
    image = np.rint(cv2.remap(straight, where[..., 0], where[..., 1], cv2.INTER_CUBIC)).clip(0, 255).astype(np.uint8)
    truth = project_plane(target.polygon[0].corners_m, Camera(320, 240, matrix), pose)
    assert np.abs(lens.undistort(project_plane(target.polygon[0].corners_m, lens, pose)) - truth).max() < 1e-6
    measured = found(image, truth + 0.5, lens)
    assert np.abs(measured.corners_px[0] - truth).max() < 0.1  # px: the remap itself errs by some hundredths


def tapes(rng, count):
    """Corners and pictures of a plain green rectangle."""
    for _ in range(count):
        corners = turned_box(60.0, 20.0, np.array([80.0, 45.0]) + rng.uniform(-1.0, 1.0, 2), 2.0)
        yield corners, drawn(corners, rng, Look(0.4, 1.0))


def lamps(rng, count):
    """Corners and pictures of a lamp whose green is brighter than the picture can tell, its red and blue dim."""
    for _ in range(count):
        corners = turned_box(60.0, 20.0, np.array([80.0, 45.0]) + rng.uniform(-1.0, 1.0, 2), 2.0)
        yield corners, drawn(corners, rng, Look(0.2, 2.0, tone=TONES["clipped"]), background=60.0)


def test_a_lamp_that_clips_is_measured_by_the_colours_that_do_not(rng):
    errors_px = [found(picture, corners + 0.3).corners_px[0] - corners for corners, picture in lamps(rng, 8)]
    assert np.sqrt(np.mean(np.square(errors_px))) < 0.06  # by the clipped colour 0.3


@pytest.mark.parametrize(
    ("pictures", "count", "most_px"),
    [
        (tapes, 6, 0.08),  # its colour is kept at half resolution: by it alone corners err by 0.1–0.3 px
        (lamps, 8, 0.16),  # so are the red and blue that do not clip: they err by 0.3 px and more, and state less
    ],
)
def test_coded_colour_is_measured_by_its_light(pictures, count, most_px, rng):
    errors, squared = [], []
    for corners, picture in pictures(rng, count):
        coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
        measured = found(cv2.imdecode(coded, cv2.IMREAD_COLOR), corners + 0.3)
        error_px, edge_bias = measured.corners_px[0] - corners, measured.edge_bias_px[0]
        along = np.vdot(error_px, edge_bias) / np.vdot(edge_bias, edge_bias)
        errors.append(error_px - along * edge_bias)  # as the pose does
        squared.append(np.square(measured.whiten[0] @ errors[-1].ravel()).mean())
    assert np.sqrt(np.mean(np.square(errors))) < most_px
    assert np.mean(squared) < 2.0  # of what is stated; 6 by the columns of pixels alone


@pytest.mark.parametrize("method", ["edges", "forstner"])
def test_nothing_to_measure(method, rng):
    grey = np.full((90, 160, 3), 128, np.uint8)
    assert found(grey, turned_box(60.0, 20.0), method=method) is None
    noise = rng.integers(0, 255, (90, 160, 3), dtype=np.uint8)
    measured = found(noise, turned_box(60.0, 20.0), method=method)
    assert measured is None or np.isfinite(measured.corners_px).all()


def test_a_side_on_the_picture_edge_is_held_there(rng):
    corners = turned_box(60.0, 30.0, (80.0, 74.5))  # its lower side at row 89.5
    measured = found(drawn(corners, rng, Look(0.4, 0.0)), corners)
    np.testing.assert_array_equal(measured.held, [[False, False, True, False]])
    assert np.abs(measured.corners_px[0] - corners).max() < 0.05  # px
