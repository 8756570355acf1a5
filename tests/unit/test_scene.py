"""The rendered camera: geometry to a tenth of a pixel, light by its laws, labels, determinism."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import cv2
import moderngl
import numpy as np
import pytest

from shipland.camera import Camera
from shipland.cue import Cue, Polygon
from shipland.errors import SystemLibraryError
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose, rotation_from_euler
from shipland.rig import Rig
from shipland.sim.scene import gl
from shipland.sim.scene import scene as scene_module
from shipland.sim.scene import ship as ship_layer
from shipland.sim.scene.block import RenderView
from shipland.sim.scene.light import light
from shipland.sim.scene.motion import homographies
from shipland.sim.scene.scene import Scene
from shipland.sim.scene.sea import WaveTiles, cox_munk_variance
from shipland.sim.scene.tone import FULL_SCALE, Image, Light16, develop
from shipland.sim.scene.view import Crop
from shipland.sim.scene_parameters import SceneParameters, Tone
from shipland.sim.state import SceneState

RIG = Rig()
PARAMETERS = SceneParameters()
CAMERA = Camera.from_fov(1280, 720, 69.0)
QUADS = RIG.cue.points_in_bar_m.reshape(-1, 4, 3)
WITH_LIGHT = dataclasses.replace(RIG, status_light_m=0.12)


@pytest.fixture(scope="module", autouse=True)
def painted_once() -> Iterator[None]:
    """What scenes of one seed and rig are painted with takes most of their making."""
    paints, painted = ship_layer.paints, {}

    def remembered(rng: np.random.Generator, rig: Rig) -> Image:
        key = str(rng.bit_generator.state), rig
        if key not in painted:
            painted[key] = paints(rng, rig), rng.bit_generator.state
        picture, rng.bit_generator.state = painted[key]
        return picture

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(ship_layer, "paints", remembered)
        yield


@pytest.fixture(scope="module")
def scene() -> Iterator[Scene]:
    made = Scene(RIG, PARAMETERS, np.random.default_rng(1))
    yield made
    made.close()


@pytest.fixture(scope="module")
def slow_shutter() -> Iterator[Scene]:
    """Exposes for 20 ms, its cue shines brighter than the sensor takes, its sensor is noisy."""
    made = scene_with(shutter_s=0.02, lamp=3.0, sensor_noise=4.0)
    yield made
    made.close()


@pytest.fixture(scope="module")
def night() -> Iterator[Scene]:
    """Of a ship with a status light."""
    made = Scene(WITH_LIGHT, dataclasses.replace(PARAMETERS, sun_elevation_deg=-20.0), np.random.default_rng(1))
    yield made
    made.close()


@pytest.fixture(scope="module")
def seas() -> Iterator[dict[str, Scene]]:
    """A calm and a rough one."""
    waves = {"calm": (0.02, 0.0), "rough": (0.8, 9.0)}
    made = {
        name: scene_with(significant_wave_height_m=height_m, wind_speed_mps=wind_mps, lamp=2.2)
        for name, (height_m, wind_mps) in waves.items()
    }
    yield made
    for scene in made.values():
        scene.close()


def scene_with(**changes: float) -> Scene:
    return Scene(RIG, dataclasses.replace(PARAMETERS, **changes), np.random.default_rng(1))


def look(
    camera_in_bar_m: tuple[float, float, float],
    roll_deg: float = 0.0,
    pitch_off_deg: float = 0.0,
    yaw_off_deg: float = 0.0,
    t_s: float = 3.0,
    velocity_mps: Array | None = None,
    rate_rad_s: Array | None = None,
) -> SceneState:
    """The rig at the origin under way to the north-east, seen by a camera that is aimed at the bar, then turned."""
    ned_from_ship = Pose.from_euler([30.0, -20.0, -RIG.deck_height_m], 0.0, 0.0, 0.7)
    ned_from_bar = ned_from_ship @ RIG.ship_from_bar
    position = ned_from_bar.apply(np.array(camera_in_bar_m))
    way = ned_from_bar.translation_m - position
    yaw, pitch = np.arctan2(way[1], way[0]), -np.arctan2(way[2], np.hypot(way[0], way[1]))
    turned = rotation_from_euler(np.radians(roll_deg), pitch + np.radians(pitch_off_deg), yaw + np.radians(yaw_off_deg))
    return SceneState(
        t_s=t_s,
        ned_from_camera=Pose(turned @ CAMERA_FROM_MOUNT.T, position),
        ned_from_ship=ned_from_ship,
        ned_from_deck=ned_from_ship @ Pose.from_euler([0.05, 0.0, -0.1], 0.06, 0.03, 0.02),
        ned_from_bar=ned_from_bar,
        ned_from_body=Pose(np.eye(3), position),
        camera_velocity_in_ned_mps=np.zeros(3) if velocity_mps is None else velocity_mps,
        camera_rate_in_camera_rad_s=np.zeros(3) if rate_rad_s is None else rate_rad_s,
    )


def in_picture(state: SceneState, camera: Camera, points_in_bar_m: Array) -> Array:
    return camera.project((state.ned_from_camera.inverse() @ state.ned_from_bar).apply(points_in_bar_m))


def greenness(image: Array) -> Array:
    values = image.astype(np.float32)
    return values[..., 1] - 0.5 * (values[..., 0] + values[..., 2])


def edge_errors_px(image: Light16, state: SceneState, camera: Camera, quads_m: Array = QUADS) -> Array:
    """Signed distance of the light's edge from the projected one, by the area under a profile across it."""
    signal, reach, errors = greenness(image), 3.5, []
    steps = np.linspace(-reach, reach, 141)
    for quad in quads_m:
        for here, there in zip(quad, np.roll(quad, -1, axis=0), strict=True):
            for share in np.linspace(0.2, 0.8, 13):
                near = in_picture(state, camera, np.array([here + (share + off) * (there - here) for off in (0, 1e-3)]))
                along = (near[1] - near[0]) / np.linalg.norm(near[1] - near[0])
                points = near[0] + steps[:, None] * np.array([-along[1], along[0]])
                profile = cv2.remap(signal, *points.astype(np.float32).T[..., None], cv2.INTER_LINEAR).ravel()
                outside, inside = np.median(profile[:15]), np.median(profile[-15:])
                errors.append(reach - np.trapezoid((profile - outside) / (inside - outside), steps))
    return np.array(errors)


POSES = {
    "2 m, before the bar, multisampled": ((-2.0, 0.0, 0.0), 0.0),
    "3 m, beside and above, rolled": ((-3.0, 0.8, -0.5), 7.0),
    "5 m": ((-5.0, 0.0, -0.3), 0.0),
    "8 m, from the left": ((-8.0, 3.0, -0.5), -4.0),
    "12 m": ((-12.0, -3.0, -1.0), 2.0),
    "15 m, oblique": ((-14.0, 5.0, -2.0), 0.0),
}


@pytest.mark.parametrize("pose", POSES.values(), ids=POSES.keys())
def test_edges_of_the_bar_stand_where_the_pinhole_puts_them(scene: Scene, pose: tuple) -> None:
    state = look(*pose)
    errors = edge_errors_px(scene.light(state, CAMERA), state, CAMERA)
    assert np.abs(errors).max() < 0.1  # px: a tenth of what corner detection gets to
    assert abs(errors.mean()) < 0.01  # no bias: the board neither grows nor shrinks


def test_principal_point_and_unequal_focal_lengths(scene: Scene) -> None:
    matrix = np.array([[900.0, 0.0, 600.3], [0.0, 940.0, 390.8], [0.0, 0.0, 1.0]])
    camera, state = Camera(1280, 720, matrix), look((-6.0, 1.0, -0.4), 3.0)
    assert np.abs(edge_errors_px(scene.light(state, camera), state, camera)).max() < 0.1


def test_distortion_is_opencvs(scene: Scene) -> None:
    distortion = np.array([-0.22, 0.08, 0.001, -0.0007, -0.01])
    camera = Camera(1280, 720, CAMERA.matrix, distortion)
    state = look((-5.0, 0.5, -0.3), 2.0, pitch_off_deg=-14.0, yaw_off_deg=18.0)  # far off the axis
    image = scene.light(state, camera)
    assert image.shape == (720, 1280, 3)
    undistorted = in_picture(state, CAMERA, QUADS.reshape(-1, 3))
    distorted = in_picture(state, camera, QUADS.reshape(-1, 3))
    assert np.linalg.norm(undistorted - distorted, axis=1).min() > 5.0  # px: there is something to test
    assert np.abs(edge_errors_px(image, state, camera)).max() < 0.1


def test_any_set_of_quadrilaterals_can_be_the_cue() -> None:
    target = Cue(
        (Polygon(((-0.5, -0.1), (-0.1, -0.2), (0.0, 0.15), (-0.45, 0.1))), Polygon.rectangle((0.5, 0.0), 0.3, 0.2))
    )
    scene = Scene(dataclasses.replace(RIG, polygon=target.polygon), PARAMETERS, np.random.default_rng(1))
    state = look((-4.0, 0.4, -0.2))
    errors = edge_errors_px(scene.light(state, CAMERA), state, CAMERA, target.points_in_bar_m.reshape(-1, 4, 3))
    scene.close()
    assert np.abs(errors).max() < 0.1


@pytest.mark.parametrize("range_m", [2.5, 6.0, 12.0])
def test_the_papers_gate_finds_the_rectangles_and_nothing_else(scene: Scene, range_m: float) -> None:
    state = look((-range_m, 0.3, -0.2))
    hsv = cv2.cvtColor(scene.render(state, CAMERA), cv2.COLOR_BGR2HSV)
    gate = cv2.inRange(hsv, (35, 70, 90), (85, 255, 255))  # [Lee2022, §Image Filtering]
    wanted = np.zeros_like(gate)
    for quad in QUADS:
        cv2.fillConvexPoly(wanted, np.rint(in_picture(state, CAMERA, quad)).astype(np.int32), 255)
    near = cv2.dilate(wanted, np.ones((5, 5), np.uint8))
    core = cv2.erode(wanted, np.ones((5, 5), np.uint8))
    assert np.all(gate[core > 0] == 255)
    assert np.count_nonzero(gate[near == 0]) == 0


def test_same_inputs_same_bits(scene: Scene) -> None:
    other = Scene(RIG, PARAMETERS, np.random.default_rng(1))
    first, second = look((-12.0, 1.0, -1.0)), look((-2.0, 0.0, 0.0), t_s=8.0)
    pictures = [scene.render(first, CAMERA, rng=np.random.default_rng(5)) for _ in range(2)]
    other.render(second, CAMERA)  # what was drawn before must not matter
    third = other.render(first, CAMERA, rng=np.random.default_rng(5))
    other.close()
    # The bank of noise is filled at first use from the scene's own generator: the same in both.
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], third)


def reference(scene: Scene, state: SceneState, box: tuple[int, int, int, int], factor: int = 8) -> Array:
    """Left, top, width, height of the picture, its light area-averaged from a render at `factor` times its size."""
    left, top, width, height = box
    big = CAMERA.scaled(CAMERA.width_px * factor, CAMERA.height_px * factor).matrix.copy()
    big[0, 2] -= left * factor
    big[1, 2] -= top * factor
    fine = scene.light(state, Camera(width * factor, height * factor, big)).astype(float)
    light = fine.reshape(height, factor, width, factor, 3).mean(axis=(1, 3))
    return PARAMETERS.tone.display(light * FULL_SCALE / 65535.0)


@pytest.mark.parametrize("range_m", [60.0, 100.0, 200.0, 300.0])
def test_far_ship_is_right_to_the_pixel(scene: Scene, range_m: float) -> None:
    state = look((-range_m, 2.0, -0.02 * range_m), 1.5)
    box = scene.labels(state, CAMERA).ship
    assert box is not None
    left, top = int(box.left_px) - 1, int(box.top_px) - 1
    width, height = int(box.right_px) - left + 2, int(box.bottom_px) - top + 2
    seen = scene.render(state, CAMERA).astype(float)[top : top + height, left : left + width]
    wanted = reference(scene, state, (left, top, width, height))
    # Superstructure and bar, in display values of 255; the deck's lines and the sea are drawn at other mipmaps.
    upper, inner = slice(3 if height > 10 else 2, 2 + max(int(0.35 * height), 1)), slice(3, -4)
    assert np.abs(seen - wanted)[upper, inner].mean() < 3.0
    assert np.abs(seen - wanted)[upper, inner].max() < 16.0
    green = greenness(wanted) > 15.0
    lit, meant = greenness(seen)[green].sum(), greenness(wanted)[green].sum()
    assert green.sum() >= 4
    assert lit == pytest.approx(meant, rel=0.05)  # the bar's green as a whole; at 300 m the picture's rounding is 3 %


def test_far_sea_has_the_brightness_of_a_supersampled_one(scene: Scene) -> None:
    state = look((-150.0, 0.0, -6.0))
    picture = scene.render(state, CAMERA).astype(float)
    for top in (400, 480, 600):  # some 210, 70 and 35 m away
        box = (200, top, 64, 24)
        wanted = reference(scene, state, box, 4).mean(axis=(0, 1))
        assert picture[top : top + 24, 200:264].mean(axis=(0, 1)) == pytest.approx(wanted, abs=9.0)


@pytest.mark.parametrize("roll_deg", [0.0, 12.0])
def test_horizon_stands_where_level_rays_go(scene: Scene, roll_deg: float) -> None:
    state = look((-80.0, 0.0, -4.0), roll_deg)
    gray = cv2.cvtColor(scene.render(state, CAMERA), cv2.COLOR_BGR2GRAY).astype(float)
    for column in (150, 1100):
        # The row of a level ray through this column: solve ray_z = 0.
        ray = state.ned_from_camera.rotation @ np.linalg.inv(CAMERA.matrix)
        row = -(ray[2, 0] * column + ray[2, 2]) / ray[2, 1]
        steps = np.diff(gray[int(row) - 12 : int(row) + 14, column])
        assert abs(int(row) - 12 + int(np.argmin(steps)) + 0.5 - row) < 1.6  # px: sky is brighter than sea


def test_contrast_in_haze_follows_koschmieder() -> None:
    tele = Camera(320, 240, np.array([[30000.0, 0, 159.5], [0, 30000.0, 119.5], [0, 0, 1]]))
    state = look((-1500.0, 0.0, 0.0))
    contrasts = {}
    for visibility_m in (1e7, 3500.0):
        scene = scene_with(visibility_m=visibility_m, glare=0.0)
        seen, exposure = scene.light(state, tele), light(scene._parameters).exposure
        sky = light(scene._parameters).horizon_rgb[1] * exposure
        # The superstructure's wall, 0.5 m below the bar.
        row, column = in_picture(state, tele, np.array([[0.05, 0.75, 0.35]]))[0][::-1].round().astype(int)
        wall = seen[row - 3 : row + 4, column - 3 : column + 4, 1].mean() * FULL_SCALE / 65535.0
        contrasts[visibility_m] = (wall - sky) / sky
        scene.close()
    assert contrasts[3500.0] / contrasts[1e7] == pytest.approx(0.05 ** (1500.0 / 3500.0), rel=0.05)


def test_rain_takes_contrast_by_itu_p1814() -> None:
    dry = light(dataclasses.replace(PARAMETERS, visibility_m=1e7))
    wet = light(dataclasses.replace(PARAMETERS, visibility_m=1e7, rain_mm_h=10.0))
    decibel_a_km = 10.0 * np.log10(np.e) * 1e3 * (wet.extinction_per_m - dry.extinction_per_m)
    assert decibel_a_km == pytest.approx(1.076 * 10.0**0.67, rel=0.01)


def test_noise_has_its_deviation_and_needs_a_generator(slow_shutter: Scene) -> None:
    scene, state = slow_shutter, look((-30.0, 0.0, -1.0))
    clean, again = scene.render(state, CAMERA), scene.render(state, CAMERA)
    noise = scene.render(state, CAMERA, rng=np.random.default_rng(0)).astype(float) - clean
    other = scene.render(state, CAMERA, rng=np.random.default_rng(1)).astype(float) - clean
    gain = light(scene._parameters).gain
    assert np.array_equal(clean, again)
    assert noise[100:600].std() == pytest.approx(4.0 * gain, rel=0.03)
    assert abs(np.corrcoef(noise[::7, ::7].ravel(), other[::7, ::7].ravel())[0, 1]) < 0.05


def test_motion_blur_widens_edges_by_the_way_and_moves_them_not(slow_shutter: Scene) -> None:
    rate = np.array([0.0, 0.4, 0.0])  # rad/s to the right: 0.02 s × 0.4 rad/s × 931 px = 7.4 px
    still, moving = look((-5.0, 0.0, 0.0)), look((-5.0, 0.0, 0.0), rate_rad_s=rate)
    row = greenness(slow_shutter.light(still, CAMERA))[360], greenness(slow_shutter.light(moving, CAMERA))[360]
    left = in_picture(still, CAMERA, QUADS[0])[0, 0]
    span = slice(int(left) - 15, int(left) + 16)
    sharp, soft = (np.clip((line[span] - line[span].min()) / np.ptp(line[span]), 0, 1) for line in row)
    assert np.count_nonzero((soft > 0.05) & (soft < 0.95)) == pytest.approx(7.4, abs=1.6)
    assert soft.sum() == pytest.approx(sharp.sum(), abs=0.25)  # px
    assert homographies(CAMERA, still, 0.02, None, np.zeros((1, 2))) == []


def test_motion_of_the_sea_is_its_planes() -> None:
    velocity = np.array([3.0, -2.0, 0.5])
    state, shutter_s = look((-40.0, 0.0, -5.0), velocity_mps=velocity), 0.02
    eye = state.ned_from_camera
    down, height_m = eye.rotation.T @ [0.0, 0.0, 1.0], -eye.translation_m[2]
    point = np.array([40.0, -10.0, 0.0])
    maps = homographies(CAMERA, state, shutter_s, (down, height_m), np.array([[640.0, 700.0]]))
    before = CAMERA.project(eye.inverse().apply(point[None]))[0]
    last = 0.5 * (1.0 - 1.0 / len(maps)) * shutter_s
    after = CAMERA.project(Pose(eye.rotation, eye.translation_m + velocity * last).inverse().apply(point[None]))[0]
    moved = maps[-1] @ [*before, 1.0]
    assert moved[:2] / moved[2] == pytest.approx(after, abs=1e-6)


@pytest.fixture(scope="module")
def clear(scene: Scene) -> Image:
    return develop(scene.light(look((-8.0, 0.0, -0.4), t_s=4.0), CAMERA), PARAMETERS.tone)


@pytest.mark.parametrize(
    ("change", "least"),
    [
        ({"rain_mm_h": 20.0}, 1.0),
        ({"lens_drops": 1.0}, 0.05),
        ({"spray": 1.0}, 0.002),
        ({"exposure_ev": 1.0}, 10.0),
        ({"sun_azimuth_deg": 40.0, "sun_elevation_deg": -3.0}, 5.0),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_each_weather_changes_the_picture_and_not_the_bars_place_or_its_passing_the_gate(
    clear: Image, change: dict[str, float], least: float
) -> None:
    state = look((-8.0, 0.0, -0.4), t_s=4.0)
    other = scene_with(**change)
    light = other.light(state, CAMERA)
    other.close()
    assert np.abs(clear.astype(float) - develop(light, PARAMETERS.tone)).mean() > least
    # Rain and drops may hide some of an edge; the median edge stays.
    assert abs(np.median(edge_errors_px(light, state, CAMERA))) < 0.1
    hsv = cv2.cvtColor(develop(light, PARAMETERS.tone), cv2.COLOR_BGR2HSV)
    for quad in QUADS:
        column, row = in_picture(state, CAMERA, quad).mean(axis=0).round().astype(int)
        assert cv2.inRange(hsv[row : row + 1, column : column + 1], (35, 70, 90), (85, 255, 255))[0, 0] == 255


@pytest.mark.parametrize("by_night", [False, True])
def test_the_status_light_shines_red_while_the_ship_waves_off_by_day_and_by_night(night: Scene, by_night: bool) -> None:
    scene = night if by_night else Scene(WITH_LIGHT, PARAMETERS, np.random.default_rng(1))
    state = look((-6.0, 0.3, -0.2))
    column, row = np.rint(in_picture(state, CAMERA, np.zeros((1, 3)))[0]).astype(int)
    green_px = np.rint(in_picture(state, CAMERA, QUADS[0].mean(axis=0)[None])[0]).astype(int)
    for waves_off in (True, False):
        image = scene.render(dataclasses.replace(state, waves_off=waves_off), CAMERA)
        blue, green, red = (int(value) for value in image[row, column])
        assert (red > 180 and max(blue, green) < 60) if waves_off else max(red, blue, green) < 90
        assert image[green_px[1], green_px[0], 1] > 180
        assert (np.median(image) < 5.0) == by_night
    if not by_night:
        scene.close()


def test_lights_around_the_deck_shine_green_from_sunset_on(night: Scene) -> None:
    state, evening = look((-5.0, 0.3, -1.0), pitch_off_deg=-15.0), scene_with(sun_elevation_deg=1.0)
    side_m = 0.01 * RIG.deck_size_m
    at_m = np.linspace(-0.5, 0.5, 4) * (RIG.deck_size_m - side_m)
    lights_m = np.array([(x, y, -0.5 * side_m) for x in at_m for y in at_m if max(abs(x), abs(y)) == at_m[-1]])
    lights_px = in_picture(state, CAMERA, (state.ned_from_bar.inverse() @ state.ned_from_deck).apply(lights_m))
    images = [scene.render(state, CAMERA).astype(int) for scene in (evening, night)]
    evening.close()
    assert len(lights_px) == 12
    for column, row in np.rint(lights_px).astype(int):
        shine = [green > 60 and green > 3 * max(blue, red) for blue, green, red in (it[row, column] for it in images)]
        assert shine == [False, True]


@pytest.mark.parametrize("range_m", [3.0, 12.0, 60.0, 250.0])
def test_labels_are_tight(scene: Scene, range_m: float) -> None:
    state = look((-range_m, 0.0, -0.02 * range_m), 2.0)
    bar = scene.labels(state, CAMERA).bar
    half_m = 0.5 * np.array([RIG.board_width_m, RIG.board_height_m])
    corners = np.array([[x, *(half_m * [i, j])] for x in (0.0, 0.02) for i in (-1, 1) for j in (-1, 1)])
    pixels = in_picture(state, CAMERA, corners)
    assert bar is not None
    box = [bar.left_px, bar.top_px, bar.right_px, bar.bottom_px]
    assert box == pytest.approx([*pixels.min(axis=0), *pixels.max(axis=0)], abs=1.5 if range_m < 5.0 else 0.6)
    assert bar.visible > 0.9


def test_labels_know_what_hides_and_what_is_outside(scene: Scene) -> None:
    state = look((-6.0, 0.0, 0.0))
    hidden = dataclasses.replace(
        state, ned_from_body=Pose(state.ned_from_ship.rotation, state.ned_from_bar.apply(np.array([-4.0, 0.1, 0.0])))
    )
    free, behind = scene.labels(hidden, CAMERA), scene.labels(hidden, CAMERA, draw_aircraft=True)
    assert free.bar is not None
    assert behind.bar is not None
    assert free.bar.visible > 0.99
    assert 0.5 < behind.bar.visible < free.bar.visible - 0.02
    cut = scene.labels(look((-6.0, 0.0, 0.0), yaw_off_deg=34.5), CAMERA)
    assert cut.ship is not None
    assert cut.ship.left_px == -0.5
    assert 0.2 < cut.ship.visible < 0.8
    gone = scene.labels(look((-6.0, 0.0, 0.0), yaw_off_deg=120.0), CAMERA)
    assert gone.ship is None
    assert gone.bar is None


@pytest.mark.parametrize(
    "aim", [(0.0, 80.0, 0.0), (0.0, -80.0, 0.0), (90.0, 0.0, 0.0), (180.0, 0.0, 30.0), (0.0, 0.0, 180.0)]
)
def test_every_way_to_look_gives_a_picture(scene: Scene, aim: tuple[float, float, float]) -> None:
    image = scene.render(look((-4.0, 0.0, -1.0), *aim), Camera.from_fov(321, 181, 60.0), draw_aircraft=True)
    assert image.shape == (181, 321, 3)
    assert image.std() > 0.5


def test_waves_have_their_height_slope_and_direction() -> None:
    waves = WaveTiles(0.6, 7.0, np.radians(30.0), np.random.default_rng(3))
    texels = waves.long_texels(10.0).astype(float) / 255.0
    height_m = (texels[..., 3] - 0.5) * 8.0 * waves.height_deviation_m / np.sqrt(2.0)
    assert 4.0 * np.sqrt(2.0) * height_m.std() == pytest.approx(0.6, rel=0.2)  # two copies are laid over each other
    slopes = (texels[..., :2] - 0.5) * waves.long_gain
    short = (waves.short_texels[..., :2] / 255.0 - 0.5) * waves.short_gain
    total = 2.0 * (slopes**2).sum(axis=2).mean() + (short**2).sum(axis=2).mean() + waves.residual_variance
    assert total == pytest.approx(cox_munk_variance(7.0), rel=0.2)
    # The pattern moves towards the waves' direction: the best shift between two instants.
    later = waves.long_texels(10.4).astype(float)[..., 3]
    spectrum = np.fft.fft2(later) * np.conj(np.fft.fft2(texels[..., 3] - texels[..., 3].mean()))
    east, north = np.unravel_index(np.argmax(np.fft.ifft2(spectrum).real), later.shape)
    shift = (np.array([north, east]) + 64) % 128 - 64
    assert shift @ [np.cos(np.radians(30.0)), np.sin(np.radians(30.0))] > 0.0


def test_missing_libraries_are_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise ImportError("libEGL.so.1 not loaded:\ncannot open shared object file")

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(SystemLibraryError, match=r"libegl1 libgl1 libgl1-mesa-dri .*--no-video") as caught:
        gl.open_context()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("range_m", [20.0, 40.0, 80.0])  # the rectangles are 21, 10 and 5 px wide
def test_a_pixel_half_under_a_rectangle_shows_half_of_its_light(scene: Scene, range_m: float) -> None:
    # The right rectangle's left edge through the middle of a pixel's column, its middle in the middle of a row.
    left, middle = QUADS[1, 0], QUADS[1].mean(axis=0)
    state = look((-range_m, 0.0, 0.0))
    at = in_picture(state, CAMERA, np.array([left, middle]))
    matrix = CAMERA.matrix.copy()
    matrix[0, 2] += np.round(at[0, 0]) - at[0, 0]
    matrix[1, 2] += np.round(at[1, 1]) - at[1, 1]
    camera = Camera(1280, 720, matrix)
    column, row = (round(value) for value in (at[0, 0], at[1, 1]))
    light = scene.light(state, camera)[row].astype(float) * FULL_SCALE / 65535.0
    shown = scene.render(state, camera)[row].astype(float)
    board, half, green = light[column - 1], light[column], light[column + 2]
    assert half == pytest.approx(0.5 * (board + green), rel=0.03, abs=0.004)
    tone = PARAMETERS.tone
    assert shown[column] == pytest.approx(tone.display(0.5 * (board + green)), abs=2.5)
    of_display_values = 0.5 * (tone.display(board) + tone.display(green))
    assert shown[column, 1] - of_display_values[1] > 40.0  # half of twice the saturation is white


def test_motion_blur_averages_light_before_the_sensor_clips(slow_shutter: Scene) -> None:
    still, moving = look((-5.0, 0.0, 0.0)), look((-5.0, 0.0, 0.0), rate_rad_s=np.array([0.0, 0.4, 0.0]))
    sharp, soft = (slow_shutter.light(state, CAMERA)[350:370].astype(float) for state in (still, moving))
    assert sharp.max() * FULL_SCALE / 65535.0 > 2.0  # beyond the sensor's saturation
    assert soft[..., 1].sum() == pytest.approx(sharp[..., 1].sum(), rel=0.01)


def test_tone_is_monotonic_inverts_and_clips() -> None:
    levels = np.linspace(0.0, 3.0, 400)
    for tone in (Tone(2.2, 0.25, 0.2, 0.0), Tone(1.8, 0.0, 0.0, 0.0), Tone(2.6, 0.6, 0.5, 0.0)):
        shown = tone.display(levels)
        assert np.all(np.diff(shown) >= -1e-9)
        assert shown[0] == pytest.approx(0.0, abs=1e-6)
        assert shown[-1] == pytest.approx(255.0, abs=1.5)
        inside = levels[levels < 0.98 - tone.shoulder]
        assert tone.light(tone.display(inside)) == pytest.approx(inside, abs=1e-3)
        values = (levels * 65535.0 / FULL_SCALE).astype(np.uint16).reshape(20, 20)
        assert np.abs(develop(values, tone) - shown.reshape(20, 20)).max() < 1.0
    assert Tone(2.2, 0.0, 0.0, 0.0).display(np.array([0.18]))[0] == pytest.approx(106.0, abs=1.0)  # a grey card


def below_the_foot(picture: Light16, state: SceneState, up_m: float) -> Array:
    """Light (3,) of the sea where a flat one mirrors the left rectangle, `up_m` above the cue's middle."""
    corners_in_ned_m = state.ned_from_bar.apply(QUADS[0] + [0.0, 0.0, -up_m]) * [1.0, 1.0, -1.0]
    pixels = CAMERA.project(state.ned_from_camera.inverse().apply(corners_in_ned_m))
    (left, top), (right, bottom) = np.rint(pixels.min(axis=0)).astype(int), np.rint(pixels.max(axis=0)).astype(int)
    return np.asarray(picture[top : bottom + 1, left : right + 1].mean(axis=(0, 1)))


def test_calm_water_mirrors_the_cue_where_a_plane_mirror_would_and_rough_water_spreads_it(seas) -> None:
    state, green = look((-30.0, 0.0, -1.0)), {}
    for name, scene in seas.items():
        picture = scene.light(state, CAMERA)
        for place, up_m in (("image", 0.0), ("beside", 1.0)):
            light = below_the_foot(picture, state, up_m)
            green[name, place] = light[1] / (0.5 * (light[0] + light[2]))
    calm, rough = (green[name, "image"] / green[name, "beside"] for name in ("calm", "rough"))
    assert calm > 1.3
    assert calm > 1.2 * rough


def test_waves_hide_the_hulls_foot_and_calm_water_does_not(seas) -> None:
    feet, crop = {}, Crop(0, 0, 1280, 720)
    abreast_m = np.linspace(-0.7, 0.7, 40)
    stern = np.array([[-RIG.deck_ahead_of_stern_m, y, RIG.deck_height_m - 0.08] for y in abreast_m])
    for name, scene in seas.items():
        seen = []
        for t_s in (3.0, 4.0, 5.0, 6.0):
            state = look((-12.0, 0.0, -1.0), t_s=t_s)
            scene.light(state, CAMERA)
            with scene._context:
                placed = scene._ship.place(state, draw_aircraft=False)
                scene._ship.aim(CAMERA, state)
                scene._look(RenderView(CAMERA, state.ned_from_camera, crop, 1, 0.5, 50.0, state.t_s), state)
                layer = scene._draw_ship(placed, state, CAMERA, crop, crop, 1)
            in_camera = (state.ned_from_camera.inverse() @ state.ned_from_ship).apply(stern)
            columns, rows = CAMERA.project(in_camera).round().astype(int).T
            seen.append(layer[rows, columns, 3] > 32768)
        feet[name] = np.mean(seen)
    assert feet["calm"] == 1.0
    assert 0.2 < feet["rough"] < 0.8


@pytest.mark.parametrize("ahead_m", [-1.2, -3.0, -8.0])
def test_what_the_ship_hides_or_cannot_cover_need_not_be_drawn(ahead_m, seas, monkeypatch) -> None:
    state = look((ahead_m, 0.3, -1.0), t_s=2.0)
    for scene in seas.values():
        spared = scene.light(state, CAMERA)
        with monkeypatch.context() as all_drawn:
            all_drawn.setattr(scene_module, "hidden_behind", lambda *_: Crop(0, 0, 0, 0))
            all_drawn.setattr(scene_module, "box_before", lambda _, __, ___, crop: crop)
            assert np.array_equal(spared, scene.light(state, CAMERA))
