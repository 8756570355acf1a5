"""Boxes for files: JSON lines, drawings, and clear errors."""

import json
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from studies.networks import random_weights

from pictures import write_film
from shipland.errors import DataError
from shipland.learning.export import write_onnx
from shipland.learning.yolov3 import ConvWeights, yolov3_layers
from shipland.messages import Box
from shipland.report.drawings import Drawings, draw_boxes
from shipland.vision.far.decode import Decoding, DetectorSpec
from shipland.vision.far.detector import Detector
from shipland.vision.far.files import COLUMNS, DetectResult, detect_paths
from shipland.vision.parameters import detector_parameters
from shipland.vision.pictures import FilePicture


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """A detector with one answer: a box of 24 × 16 px about every second coarse cell's middle, all equally sure."""
    path = tmp_path_factory.mktemp("weights") / "w.onnx"
    layers = yolov3_layers(1, 0.125)
    spec = DetectorSpec(("ship",), (((24.0, 16.0),) * 3,) * 3, Decoding.WIDE, 0.125)
    made = []
    heads = 0
    for item in random_weights(layers, np.random.default_rng(1)):
        if item.scale is not None:
            made.append(item)
            continue
        bias = np.full((3, 6), -20.0, np.float32)
        bias[:, :4] = 0.0
        if heads == 0:  # the coarsest scale comes first
            bias[0, 4:] = 4.0
        heads += 1
        made.append(ConvWeights(np.zeros_like(item.kernel), bias.ravel()))
    write_onnx(path, layers, made, spec)
    return path


@cache
def loaded(weights):
    return Detector.load(str(weights), replace(detector_parameters(), threads=1))


def detect(paths, weights, confidence=None, out=None):
    confidence = detector_parameters().acquire_confidence if confidence is None else confidence
    results = []
    with Drawings(out) if out is not None else nullcontext() as drawings:
        for result in detect_paths(paths, loaded(weights), confidence):
            results.append(result)
            if drawings is not None:
                drawings.add(result.picture, draw_boxes(result.picture.image, result.boxes))
    return results


@pytest.fixture
def pictures(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("b.png", "a.jpg"):
        cv2.imwrite(str(folder / name), np.full((50, 90, 3), 120, np.uint8))
    return folder


def test_boxes_are_corner_and_size_in_pixels(weights, pictures):
    """A picture of 90 × 50 px is continued to 96 × 64: six coarse cells of 32 px, each with its box.

    All six centres lie in the picture itself, the lowest at row 48.
    """
    results = detect((pictures,), weights)
    assert [result.picture.name for result in results] == [str(pictures / "a.jpg"), str(pictures / "b.png")]
    line = json.loads(json.dumps(results[0].to_json()))
    assert set(line) == {"file", "t_s", "boxes"}
    assert len(line["boxes"]) == 6
    corners = sorted((box["x"], box["y"]) for box in line["boxes"])
    # Middles at 16, 48, 80 and 16, 48; a tenth of a pixel for bf16.
    wanted = sorted((16.0 + 32 * column - 12.0, 16.0 + 32 * row - 8.0) for column in range(3) for row in range(2))
    np.testing.assert_allclose(corners, wanted, atol=0.1)
    assert line["boxes"][0]["w"] == pytest.approx(24.0, abs=0.2)
    assert line["boxes"][0]["class"] == "ship"
    assert [set(row) for row in results[0].to_rows()] == [set(COLUMNS)] * 6
    assert 0.9 < line["boxes"][0]["confidence"] <= 1.0
    assert "ship 9" in results[0].to_line()


def test_confidence_above_all_finds_nothing(weights, pictures):
    (result,) = detect((pictures / "a.jpg",), weights, confidence=0.999)
    assert result.boxes == ()
    assert result.to_line().endswith("nothing found")


def test_drawings_go_where_they_are_asked_to(weights, pictures, tmp_path):
    out = tmp_path / "out"
    before = (pictures / "a.jpg").read_bytes()
    detect((pictures,), weights, out=out)
    assert sorted(item.name for item in out.iterdir()) == ["a.jpg", "b.jpg"]
    assert cv2.imread(str(out / "a.jpg")).shape == (50, 90, 3)
    with pytest.raises(DataError, match="would be drawn over"):
        detect((pictures,), weights, out=pictures)
    assert (pictures / "a.jpg").read_bytes() == before


def test_pictures_of_one_name_have_a_drawing_each(weights, pictures, tmp_path):
    """As flight logs have, and the pictures of two days."""
    other = tmp_path / "other"
    other.mkdir()
    cv2.imwrite(str(other / "a.png"), np.zeros((40, 60, 3), np.uint8))
    detect((pictures / "a.jpg", other / "a.png", other / "a.png"), weights, out=tmp_path / "out")
    shapes = {item.name: cv2.imread(str(item)).shape for item in (tmp_path / "out").iterdir()}
    assert shapes == {"a.jpg": (50, 90, 3), "a-2.jpg": (40, 60, 3), "a-3.jpg": (40, 60, 3)}


def test_frame_is_drawn_around_the_box():
    picture = np.zeros((80, 120, 3), np.uint8)
    drawn = draw_boxes(picture, ((Box((60.0, 40.0), (20.0, 10.0), 0.5), "ship"),))
    assert picture.max() == 0
    assert drawn[40, 60].max() == 0, "the target itself stays as it is"
    assert drawn[40, 48].max() > 200 and drawn[33, 60].max() > 200


def test_video_keeps_its_pictures_and_times(weights, tmp_path):
    film = write_film(tmp_path / "film.mp4", (np.full((64, 96, 3), 40 * n, np.uint8) for n in range(5)), rate=10)
    results = detect((film,), weights, out=tmp_path / "out")
    assert [result.picture.name[-7:] for result in results] == [f"#{number:06d}" for number in range(5)]
    np.testing.assert_allclose([result.to_json()["t_s"] for result in results], np.arange(5) / 10.0, atol=1e-3)
    with av.open(str(tmp_path / "out" / "film.mp4")) as container:
        times = [frame.time for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(5) / 10.0, atol=1e-3)


def test_bad_input_is_named(weights, pictures, tmp_path):
    with pytest.raises(DataError, match="nothing to look at"):
        detect((), weights)
    with pytest.raises(DataError, match=r"none\.jpg"):
        detect((tmp_path / "none.jpg",), weights)
    with pytest.raises(DataError, match=r"none\.onnx"):
        detect((pictures,), tmp_path / "none.onnx")
    with pytest.raises(DataError, match="between 0 and 1"):
        detect((pictures,), weights, confidence=1.5)


def test_result_without_boxes_is_a_line_too():
    empty = DetectResult(FilePicture("p.jpg", Path("p.jpg"), np.zeros((1, 1, 3), np.uint8)), ())
    assert empty.to_json() == {"file": "p.jpg", "t_s": None, "boxes": []}
    assert empty.to_rows() == [{"file": "p.jpg", "t_s": None}]


def test_a_broken_picture_does_not_end_the_rest(weights, pictures, tmp_path):
    (pictures / "aa.jpg").write_bytes(b"no picture")
    (tmp_path / "film.mp4").write_bytes(b"no film")
    told = []
    paths = (tmp_path / "none.jpg", tmp_path / "film.mp4", pictures)
    results = list(detect_paths(paths, loaded(weights), 0.5, lambda path, _: told.append(path.name)))
    assert [result.picture.name[-5:] for result in results] == ["a.jpg"[-5:], "b.png"[-5:]]
    assert told == ["none.jpg", "film.mp4", "aa.jpg"]
