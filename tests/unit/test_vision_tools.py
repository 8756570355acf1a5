"""What the tools about near vision measure with: spoilers, views, hung tags, pictures without the cue."""

import cv2
import numpy as np
import pytest
from studies.decoys import DECOYS, Canvas, decoy_view, hide_bar
from studies.spoiling import SPOILERS, exposed, hue_turned, noise, panned, rolling_shutter, through_h264, vary
from studies.tags import apriltag, aruco, in_picture
from studies.views import Setting, look, view_at

from shipland.messages import Frame
from shipland.vision.near.gates import Refusal

SETTING = Setting.packaged()
PLACES = ((3.0, 15.0), (7.0, -20.0), (12.0, 5.0))  # range [m], degrees off the axis
SPOILED = {
    **SPOILERS,
    "another exposure": lambda picture, rng: exposed(picture, -2.0),
    "another white balance": lambda picture, rng: hue_turned(picture, 10),
    "another scene": vary,
    "noise": lambda picture, rng: noise(picture, rng, 2.0),
}


def place(index):
    return view_at(*PLACES[index], SETTING.gimbal_noise_rad, np.random.default_rng(index))


@pytest.fixture(scope="module")
def pictures():
    scene = SETTING.scene(1)
    made = [scene.render(place(index).state(SETTING.rig), SETTING.camera) for index in range(len(PLACES))]
    scene.close()
    for picture in made:
        picture.flags.writeable = False  # whoever spoils a picture spoils a copy of it
    return made


@pytest.mark.parametrize("name", list(SPOILED))
def test_a_spoiler_changes_a_copy_and_goes_by_its_seed(name, pictures):
    picture = pictures[0]
    first, again = (SPOILED[name](picture, np.random.default_rng(4)) for _ in range(2))
    assert (first.shape, first.dtype) == (picture.shape, np.uint8)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, picture)
    if name not in ("another exposure", "another white balance"):
        assert not np.array_equal(first, SPOILED[name](picture, np.random.default_rng(5)))


def test_fewer_bits_leave_less_of_a_film(pictures):
    film = panned(pictures[0], np.random.default_rng(4))
    assert np.array_equal(film[-1], pictures[0])
    psnr_db = [cv2.PSNR(through_h264(film, rate)[-1], film[-1]) for rate in (1.0, 2.0, 4.0)]
    assert psnr_db == sorted(psnr_db)
    assert psnr_db[-1] > psnr_db[0] + 1.0


def test_exposure_and_white_balance_go_by_their_laws():
    picture = np.full((2, 2, 3), (40, 200, 60), np.uint8)
    # √(1 − exp(−light)) of 200 / 255: light 0.955; a quarter of it gives 0.461 of full scale.
    assert np.array_equal(exposed(picture, -2.0)[0, 0, 1:2], [round(0.4608 * 255)])
    assert np.array_equal(exposed(picture, 0.0), picture)
    hues = [cv2.cvtColor(p, cv2.COLOR_BGR2HSV)[0, 0, 0] for p in (picture, hue_turned(picture, 10))]
    assert abs(int(hues[1]) - int(hues[0]) - 10) <= 1  # eight bits round


def test_the_still_row_of_a_rolling_shutter_stays(pictures):
    moved = rolling_shutter(pictures[0], np.random.default_rng(4), still_row=300.0)
    assert np.array_equal(moved[300], pictures[0][300])
    assert not np.array_equal(moved[500], pictures[0][500])


@pytest.mark.parametrize("range_m", [2.0, 15.0])
@pytest.mark.parametrize("angle_deg", [-40.0, 0.0, 20.0])
def test_a_view_lies_where_it_was_asked_for(range_m, angle_deg, rng):
    for _ in range(50):
        view = view_at(range_m, angle_deg, 0.001, rng)
        forward_m, right_m, _ = view.bar_from_camera.translation_m
        assert np.linalg.norm(view.bar_from_camera.translation_m) == pytest.approx(range_m, abs=1e-9)
        assert abs(np.degrees(np.arctan2(-right_m, -forward_m)) - angle_deg) <= 2.0
        pixels = SETTING.camera.project(view.bar_from_camera.inverse().apply(np.zeros(3)))
        assert np.all((pixels > 0) & (pixels < [SETTING.camera.width_px, SETTING.camera.height_px]))


@pytest.mark.parametrize("index", range(len(PLACES)))
def test_a_look_at_a_rendered_picture_is_right_by_its_own_covariance(index, pictures):
    picture = noise(pictures[index], np.random.default_rng(index), 1.5)
    trial = look(place(index), picture, SETTING.eyes(), SETTING)
    assert trial.reason == ""
    assert trial.nees < 23.5  # χ² of four degrees, one in ten thousand
    assert np.abs(trial.corner_error_px).max() < 0.6  # px: a bright rectangle grows under the tone curve


@pytest.mark.parametrize("make", [aruco, apriltag])
def test_hung_tags_are_where_they_should_be(make, pictures):
    peer, camera_from_bar = make(SETTING.rig), place(0).bar_from_camera.inverse()
    hung = peer.board.hung(pictures[0], SETTING.camera, camera_from_bar)
    found = peer.detect(hung)
    assert set(found) == set(peer.board.tags_m)
    for number, quad_px in found.items():
        wanted_px = in_picture(peer.board.tags_m[number], SETTING.camera, camera_from_bar)
        assert np.abs(quad_px - wanted_px).max() < 0.6  # px: what the libraries measure to
    pose = peer.pose(found, SETTING.camera)
    assert np.linalg.norm(pose.inverse().translation_m - place(0).bar_from_camera.translation_m) < 0.1  # m, from 3 m
    assert not peer.detect(pictures[0])


@pytest.mark.parametrize("name", list(DECOYS))
def test_a_decoy_shows_and_goes_by_its_seed(name, pictures):
    drawn = []
    for _ in range(2):
        rng = np.random.default_rng(8)
        drawn.append(pictures[1].copy())
        DECOYS[name](Canvas(drawn[-1], SETTING, decoy_view(name, SETTING, rng), rng))
    assert np.array_equal(drawn[0], drawn[1])
    changed = np.any(drawn[0] != pictures[1], axis=2)
    assert changed.sum() > 100  # pixels


@pytest.mark.parametrize("index", range(len(PLACES)))
def test_a_hidden_bar_is_not_seen(index, pictures):
    picture = pictures[index].copy()
    hide_bar(Canvas(picture, SETTING, place(index), np.random.default_rng(0)))
    seen = SETTING.eyes().see(Frame(0.0, picture, place(index).gimbal))
    assert seen.bar_pose is None
    assert seen.reason == Refusal.NOTHING_GREEN.value
