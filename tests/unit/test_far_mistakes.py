"""What the tool about a far detector's mistakes calls what, on scenes drawn anew and boxes made up."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.learning.decoys import foot_box_px
from shipland.learning.evaluate import EvaluateParameters, fresh_scenes
from shipland.learning.ranges import SceneRecord
from shipland.learning.ship_and_camera import ShipAndCamera
from shipland.learning.shots import draw_scene, draw_shot
from shipland.learning.synth import FRAME_S
from shipland.sim.target_box import target_box

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))

from far_mistakes import Redrawn, apart, mistake_of, text

SEED, FRAMES = 77, 10
DRAWN = ShipAndCamera.packaged()
CAMERA = Camera.from_parameters(DRAWN.camera)
PARAMETERS = EvaluateParameters()
SYNTH = fresh_scenes(PARAMETERS)


def row_of(edges):
    left, top, right, bottom = edges
    return (0.5 * (left + right), 0.5 * (top + bottom), right - left, bottom - top)


def shot_with_both():
    """The first scene of the block with the ship in sight and a decoy well beside it."""
    light, _ = draw_scene(0, SYNTH, SEED)
    for number in range(PARAMETERS.pictures_per_scene):
        shot = draw_shot(number, "ship", light, CAMERA, DRAWN.rig, SYNTH, SEED)
        ends = [
            target_box("ship", shot.at(FRAME_S * frame, DRAWN.rig), CAMERA, DRAWN.rig, 0.9, 0.0)
            for frame in range(FRAMES)
        ]
        if not shot.empty and shot.decoys and None not in ends:
            return shot, [row_of(edges) for edges in ends]
    raise AssertionError("no such scene in the block")


def record_of(shot, targets, boxes):
    """A scene in which every frame showed these boxes."""
    return SceneRecord(
        shot.number,
        shot.range_m,
        shot.visibility_m,
        len(shot.decoys),
        targets[0],
        tuple(boxes[0]),
        tuple((target, None) for target in targets),
        (shot.roll_rad, shot.pitch_rad),
        tuple(tuple(row) for row in boxes),
        (),
    )


@pytest.fixture(scope="module")
def scene():
    return shot_with_both()


def test_a_found_target_is_no_mistake_and_stands_out(scene):
    shot, targets = scene
    record = record_of(shot, targets, [[(*target, 0.97)] for target in targets])
    assert mistake_of(record, "ship", CAMERA, 0.3) == ("", 0, None)
    judged, picture = Redrawn("ship", SEED, DRAWN, CAMERA).look([record], 0.3)[0]
    assert (judged.mistake, picture) == ("", None)
    assert judged.seen
    assert judged.levels > 1.0
    assert "1.000" in text([judged])


def test_a_target_that_no_box_fits_is_missed(scene):
    shot, targets = scene
    record = record_of(shot, targets, [[] for _ in targets])
    judged, picture = Redrawn("ship", SEED, DRAWN, CAMERA).look([record], 0.3)[0]
    assert judged.mistake == "missed"
    assert not judged.seen
    assert picture.shape == (152, 152, 3)


def test_a_false_box_is_told_by_what_it_lies_on(scene):
    shot, targets = scene
    camera_from_ned = shot.at(0.0, DRAWN.rig).ned_from_camera.inverse()
    redrawn = Redrawn("ship", SEED, DRAWN, CAMERA)
    decoy = shot.decoys[0]
    assert redrawn.like(shot, 0.0, (*row_of(foot_box_px(decoy, CAMERA, camera_from_ned)), 0.9)) == decoy.kind
    assert redrawn.like(replace(shot, decoys=()), 0.0, (*targets[0], 0.9)) == "sea and sky"


def test_levels_are_those_of_the_change_in_the_box():
    picture = np.full((20, 20, 3), 100, np.uint8)
    changed = picture.copy()
    changed[5:10, 5:10] += 6
    assert apart(changed, picture, (7.5, 7.5, 5.0, 5.0)) == 6.0
    assert apart(changed, picture, (15.0, 15.0, 4.0, 4.0)) == 0.0
