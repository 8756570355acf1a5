"""The look down on drawn pictures: the deck's centre to a centimetre, and nothing where there is no deck."""

import numpy as np
import pytest

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.frames import Pose, rotation_from_euler
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState
from shipland.vision.near.deck import DeckVision
from shipland.vision.near.gates import Refusal
from shipland.vision.parameters import DeckVisionParameters

RIG = Rig()
CAMERA = Camera.from_parameters(CameraParameters())
PARAMETERS = DeckVisionParameters()
DOWN = GimbalAttitude(0.0, -1.48)


@pytest.fixture(scope="module")
def scene():
    drawn = Scene(RIG, SceneParameters(), np.random.default_rng(4))
    yield drawn
    drawn.close()


def look(scene, height_m, shift_m=(0.0, 0.0), tilt_deg=(0.0, 0.0), gimbal=DOWN, aside_m=0.0, rng_seed=1):
    """A picture from over the deck's neutral place, and the deck's centre from the camera."""
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -RIG.deck_height_m]))
    tilt = rotation_from_euler(*np.radians(tilt_deg), 0.0)
    ned_from_deck = ned_from_ship @ Pose(tilt, np.array([*shift_m, 0.0]))
    eye_m = ned_from_ship.translation_m + np.array([0.09, aside_m, -height_m])
    ned_from_camera = Pose(level_from_camera(gimbal), eye_m)
    body, still = Pose(np.eye(3), eye_m - [0.09, 0.0, 0.0]), np.zeros(3)
    ned_from_bar = ned_from_ship @ RIG.ship_from_bar
    state = SceneState(0.0, ned_from_camera, ned_from_ship, ned_from_deck, ned_from_bar, body, still, still)
    image = scene.render(state, CAMERA, rng=np.random.default_rng(rng_seed))
    return Frame(0.0, image, gimbal), ned_from_deck.translation_m - eye_m


@pytest.mark.parametrize(
    ("height_m", "shift_m", "tilt_deg"),
    [
        (0.7, (0.0, 0.0), (0.0, 0.0)),
        (0.7, (0.03, -0.2), (-6.0, 1.0)),
        (1.0, (-0.05, 0.25), (8.0, -2.0)),
        (1.3, (0.05, 0.1), (4.0, 3.0)),
    ],
)
def test_the_decks_centre_is_found_to_a_centimetre(scene, height_m, shift_m, tilt_deg):
    frame, centre_m = look(scene, height_m, shift_m, tilt_deg)
    sight = DeckVision(RIG, CAMERA, PARAMETERS).see(frame).deck
    assert sight is not None
    assert sight.centre_in_level_m == pytest.approx(centre_m, abs=0.01)
    assert sight.deviation_m == pytest.approx(np.full(3, PARAMETERS.deviation_m * centre_m[2]), rel=0.05)


def test_a_deck_that_is_followed_is_found_again_where_it_has_moved_to(scene):
    vision = DeckVision(RIG, CAMERA, PARAMETERS)
    for aside_m in (0.0, 0.02, 0.05, 0.02):
        frame, centre_m = look(scene, 0.9, aside_m=aside_m)
        assert vision.see(frame).deck.centre_in_level_m == pytest.approx(centre_m, abs=0.01)


def test_without_a_deck_there_is_none(scene):
    vision = DeckVision(RIG, CAMERA, PARAMETERS)
    frame, _ = look(scene, 1.0, aside_m=8.0)  # the sea
    seen = vision.see(frame)
    assert seen.deck is None
    assert seen.reason == Refusal.NO_DECK.value
    frame, _ = look(scene, 1.0, gimbal=GimbalAttitude(0.0, -0.1))  # the superstructure
    assert vision.see(frame).deck is None
    noise = np.random.default_rng(1).integers(0, 255, frame.image.shape).astype(np.uint8)
    assert vision.see(Frame(0.0, noise, DOWN)).deck is None
    assert vision.see(Frame(0.0, None, DOWN)).reason == Refusal.NO_PICTURE.value
    assert vision.see(Frame(0.0, noise[:100], DOWN)).reason == Refusal.WRONG_SIZE.value


@pytest.mark.parametrize("unknown", [float("nan"), float("inf")])
def test_without_the_cameras_attitude_there_is_no_deck_and_a_reason(unknown):
    image = np.zeros((CAMERA.height_px, CAMERA.width_px, 3), np.uint8)
    for gimbal in (GimbalAttitude(unknown, -1.48), GimbalAttitude(0.0, unknown), GimbalAttitude(0.0, -1.48, unknown)):
        seen = DeckVision(RIG, CAMERA, PARAMETERS).see(Frame(0.0, image, gimbal))
        assert seen.deck is None and seen.reason == "the camera's attitude is not known"
