"""What the tool about another renderer looks at, and what it calls found; nothing is path-traced here."""

from importlib.util import find_spec

import numpy as np
import pytest
from path_traced import (
    RENDERERS,
    SEED,
    Arguments,
    Looked,
    _camera,
    _look_far,
    _look_near,
    _synth,
    _tables,
    main,
    places,
)
from studies.views import Setting

from shipland.sim.scene.scene import Scene
from shipland.sim.scene.tone import FULL_SCALE
from shipland.vision.far.detector import Detector
from shipland.vision.parameters import detector_parameters

SETTING = Setting.packaged()


def drawn(place):
    scene = Scene(SETTING.rig, place.scene, np.random.default_rng(place.waves))
    try:
        return scene.light(place.state, place.camera)
    finally:
        scene.close()


@pytest.mark.parametrize("kind", ["ship", "bar", "near"])
def test_places_are_the_same_for_the_same_seed_and_hold_their_target(kind):
    made, again, others = (list(places(kind, 6, seed)) for seed in (SEED, SEED, SEED + 1))
    assert [repr(place) for place in made] == [repr(place) for place in again]
    assert [place.range_m for place in made] != [place.range_m for place in others]
    for place in made:
        size = np.array([place.camera.width_px, place.camera.height_px])
        camera_from_bar = place.state.ned_from_camera.inverse() @ place.state.ned_from_bar
        distance_m = float(np.linalg.norm(camera_from_bar.translation_m))
        assert distance_m == pytest.approx(place.range_m, abs=3.0 if kind == "ship" else 1e-6)
        if kind == "near":
            px = place.camera.project(camera_from_bar.apply(SETTING.rig.cue.points_in_bar_m))
            assert (px > 0.0).all()
            assert (px < size - 1).all()


def test_a_near_pose_in_its_window_is_that_of_the_whole_picture():
    place = next(place for place in places("near", 8, SEED) if place.range_m < 8.0)
    picture = drawn(place)
    found, _ = _look_near(place, picture, RENDERERS[1], SETTING)
    assert found.found
    assert abs(found.distance_error) < 0.02
    assert abs(found.yaw_error_deg) < 3.0
    dark, _ = _look_near(place, np.zeros_like(picture), RENDERERS[1], SETTING)
    assert not dark.found
    assert dark.reason


def test_a_far_target_is_found_where_it_is_and_not_in_the_dark():
    place = next(place for place in places("ship", 16, SEED) if place.range_m < 120.0 and place.box is not None)
    detector, confidence = Detector.load("ship", detector_parameters()), 0.5
    picture = drawn(place)
    assert _look_far(place, _camera(place, picture, _synth()), RENDERERS[1], detector, confidence).found
    flat = np.full_like(picture, round(65535 / FULL_SCALE / 4))
    assert not _look_far(place, _camera(place, flat, _synth()), RENDERERS[0], detector, confidence).found


def test_tables_count_pairs():
    def looked(number, renderer, found):
        return Looked("ship", number, 100.0 + number, renderer, found, 0.9, np.nan, np.nan, np.nan, "")

    verdicts = [(True, True), (True, False), (False, False)]
    looks = [looked(n, name, v[side]) for n, v in enumerate(verdicts) for side, name in enumerate(RENDERERS)]
    ship, *_ = _tables(looks)
    row = next(line for line in ship.splitlines() if line.startswith("| 60–120"))
    assert "2 of 3" in row
    assert "1 of 3" in row
    assert row.endswith("| 1 | 0 |")


@pytest.mark.parametrize(("step", "said"), [("draw", "pip install bpy"), ("look", "holds no pictures")])
def test_what_is_missing_is_said_in_one_line(step, said, tmp_path, capsys):
    if step == "draw" and find_spec("bpy"):
        pytest.skip("Blender is there")
    with pytest.raises(SystemExit, match="2"):
        main(Arguments(step, out=tmp_path / "out", share=0.01))
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
