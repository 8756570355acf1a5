"""Measured recall: counting by hand, and a run over fresh scenes that goes on where it stopped."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from studies.networks import random_weights

from shipland.errors import ConfigError, DataError
from shipland.learning.arguments import EvaluateArguments, SynthArguments
from shipland.learning.evaluate import evaluate
from shipland.learning.export import read_onnx, write_onnx
from shipland.learning.ranges import SceneRecord, markdown, range_table, summary
from shipland.learning.synth import synth
from shipland.learning.yolov3 import yolov3_layers
from shipland.vision.far.decode import Decoding, DetectorSpec

TARGET = (100.0, 50.0, 10.0, 8.0)


def scene(number, range_m, target, *boxes, believed=(), visibility_m=20000.0):
    return SceneRecord(number, range_m, visibility_m, 0, target, tuple(boxes), tuple(believed))


def test_counts_by_hand():
    """Three targets from 0 to 25 m: hit, hit but unsure, missed with a false box; one empty scene with a false box."""
    good, unsure, false = (101.0, 50.0, 10.0, 8.0, 0.9), (100.0, 50.0, 11.0, 8.0, 0.2), (300.0, 50.0, 10.0, 8.0, 0.8)
    records = [
        scene(0, 10.0, TARGET, good, believed=[(TARGET, None), (TARGET, good)]),
        scene(1, 12.0, TARGET, unsure, believed=[(TARGET, None), (TARGET, None)]),
        scene(2, 24.0, TARGET, false, believed=[(TARGET, None), (TARGET, false)]),
        scene(3, 30.0, None, false, believed=[(None, None), (None, None)]),
        scene(4, 60.0, TARGET, good),
    ]
    table = range_table(records, [0.0, 25.0, 50.0, 75.0], 0.4, 0.3)
    near, middle, far = table.bins
    assert (near.scenes, middle.scenes, far.scenes) == (3, 0, 1)
    assert near.recall == pytest.approx(1 / 3)
    assert near.precision == pytest.approx(1 / 2)
    assert near.confirmed == pytest.approx(1 / 3)
    assert near.centre_px == pytest.approx(1.0)
    assert near.area_bias == pytest.approx(0.0)
    assert np.isnan(middle.recall) and np.isnan(far.confirmed)
    assert table.false_per_frame == pytest.approx(2 / 5)
    assert (table.frames, table.false_believed_per_1000) == (8, pytest.approx(125.0))
    assert table.empty == 1
    assert "0–25 | 3 | 10 | 0.333" in markdown(table)


def test_reach_ends_where_recall_first_falls():
    hit = (*TARGET, 0.9)
    records = [scene(n, 5.0 + n % 30, TARGET, hit) for n in range(120)]
    records += [scene(n, 45.0, TARGET, *([hit] if n % 4 else [])) for n in range(40)]
    records += [scene(n, 55.0, TARGET) for n in range(10)] + [scene(n, 65.0, TARGET, hit) for n in range(10)]
    table = range_table(records, np.arange(0.0, 80.0, 10.0).tolist(), 0.4, 0.3)
    assert table.range_99_m == 40.0
    assert table.range_50_m == 50.0
    assert "| all | 180 (0) |" in summary({"all": table})


def test_one_miss_in_a_bin_does_not_end_the_range():
    hit = (*TARGET, 0.9)
    records = [scene(n, 5.0 + 10.0 * (n % 3), TARGET, *([] if n == 1 else [hit])) for n in range(120)]
    records += [scene(n, 35.0, TARGET, *([hit] if n % 10 else [])) for n in range(40)]
    table = range_table(records, np.arange(0.0, 50.0, 10.0).tolist(), 0.4, 0.3)
    assert [item.recall >= 0.99 for item in table.bins] == [True, False, True, False]
    assert table.range_99_m == 30.0


def test_record_survives_its_line():
    record = scene(
        7, 33.25, TARGET, (1.0, 2.0, 3.0, 4.0, 0.5), believed=[(None, None), (TARGET, (1.0, 2.0, 3.0, 4.0, 0.5))]
    )
    assert SceneRecord.from_json(record.to_json(), "here") == record
    with pytest.raises(DataError, match="here: no scene"):
        SceneRecord.from_json('{"number": 1}', "here")


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """An untrained detector."""
    path = tmp_path_factory.mktemp("weights") / "w.onnx"
    anchors = (((8.0, 6.0),) * 3, ((20.0, 16.0),) * 3, ((80.0, 60.0),) * 3)
    layers = yolov3_layers(1, 0.125)
    spec = DetectorSpec(("ship",), anchors, Decoding.WIDE, 0.125, "untrained")
    write_onnx(path, layers, random_weights(layers, np.random.default_rng(1)), spec)
    return str(path)


@pytest.mark.slow
def test_fresh_scenes_go_on_to_the_same_records(weights, tmp_path):
    """One scene, then two: as two in one go; a line that was cut off is made again."""
    first = EvaluateArguments(weights, "ship", count=1, frames=2, out=tmp_path / "a", confidence=0.99, threads=1)
    evaluate(first)
    lines = tmp_path / "a" / "scenes.jsonl"
    lines.write_text(lines.read_text()[:-9])
    result = evaluate(replace(first, count=2))
    evaluate(replace(first, count=2, out=tmp_path / "b"))
    assert lines.read_text() == (tmp_path / "b" / "scenes.jsonl").read_text()
    assert result.pictures == 2
    assert {item.name for item in (tmp_path / "a").iterdir()} >= {"evaluation.json", "table.md", "recall.png"}
    assert json.loads((tmp_path / "a" / "evaluation.json").read_text())["tables"]["all"]["frames"] == 4
    with pytest.raises(DataError, match="choose another folder"):
        evaluate(replace(first, seed=5))


def test_labelled_set_with_ranges(weights, tmp_path):
    folder = synth(SynthArguments(tmp_path / "set", "ship", count=4, seed=9, crop_px=96))
    result = evaluate(EvaluateArguments(weights, "ship", data=folder, out=tmp_path / "out", threads=1))
    assert result.pictures == 4
    assert result.tables["all"].scenes == 4
    assert np.isnan(result.tables["all"].false_believed_per_1000)
    assert len(result.missed) <= 4
    (folder / "classes.txt").write_text("ship\nbuoy\n")
    with pytest.raises(DataError, match=r"ship, buoy; .*--classes names the set's classes"):
        evaluate(EvaluateArguments(weights, "ship", data=folder, out=tmp_path / "out", threads=1))


@pytest.fixture
def looked(weights, tmp_path):
    """An evaluation of one scene that is in its folder already, so that nothing is drawn."""
    mine, out = tmp_path / "mine.onnx", tmp_path / "out"
    mine.write_bytes(Path(weights).read_bytes())
    out.mkdir()
    (out / "scenes.jsonl").write_text(scene(0, 355.0, TARGET, (*TARGET, 0.9)).to_json() + "\n")
    return EvaluateArguments(str(mine), "ship", count=1, frames=2, out=out, threads=1)


def test_scenes_that_another_detector_or_configuration_made_are_not_taken(looked, unarranged, tmp_path):
    evaluate(looked)
    config = tmp_path / "mine.toml"
    config.write_text("[evaluate]\nship_range_m = [15.0, 360.0]\n")
    with pytest.raises(DataError, match="choose another folder"):
        evaluate(replace(looked, config=config))
    layers = yolov3_layers(1, 0.125)
    _, spec = read_onnx(Path(looked.weights), layers)
    write_onnx(Path(looked.weights), layers, random_weights(layers, np.random.default_rng(2)), spec)
    with pytest.raises(DataError, match="choose another folder"):
        evaluate(looked)


def test_the_farthest_scenes_have_a_bin(looked, unarranged, tmp_path):
    config = tmp_path / "mine.toml"
    config.write_text("[evaluate]\nship_range_m = [15.0, 360.0]\n")
    bins = evaluate(replace(looked, config=config)).tables["all"].bins
    assert (bins[-1].high_m, bins[-1].scenes) == (375.0, 1)


@pytest.mark.parametrize("confidence", [0.01, 2.0, float("nan")])
def test_a_confidence_that_no_box_is_kept_for_is_refused(looked, confidence):
    with pytest.raises(ConfigError, match=r"confidence .*0\.05 … 1"):
        evaluate(replace(looked, confidence=confidence))


@pytest.mark.parametrize(("of", "step_m"), [("", 25.0), (', "kind": "bar"', 10.0)])
def test_a_set_may_tell_ranges_alone_or_what_it_is_of_too(weights, unarranged, tmp_path, of, step_m):
    folder = tmp_path / "set"
    folder.mkdir()
    cv2.imwrite(str(folder / "a.png"), np.zeros((64, 64, 3), np.uint8))
    (folder / "a.txt").write_text("0 0.5 0.5 0.2 0.2\n")
    (folder / "scenes.jsonl").write_text(f'{{"file": "a.png", "range_m": 30.0{of}}}\n')
    found = evaluate(EvaluateArguments(weights, data=folder, classes=("ship",), out=tmp_path / "out", threads=1))
    assert {name: table.scenes for name, table in found.tables.items()} == {"all": 1}
    first = found.tables["all"].bins[0]
    assert first.high_m - first.low_m == step_m
