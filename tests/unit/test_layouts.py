"""Detectors that others made: their outputs are recognised, read as boxes of the classes asked for, or refused."""

import json
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from shipland.errors import DataError
from shipland.learning.arguments import EvaluateArguments
from shipland.learning.evaluate import evaluate
from shipland.rig import Rig
from shipland.vision.far.detector import Detector
from shipland.vision.far.far import FarVision
from shipland.vision.far.layouts import COCO_CLASSES, load_reader
from shipland.vision.parameters import detector_parameters

onnx = pytest.importorskip("onnx")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402 - after importorskip

ROWS, COLUMNS = 64, 96
CELLS = 12 * 8 + 6 * 4 + 3 * 2
MINE = 12 * 8 + 6 * 1 + 3
"""Column 3, row 1 of the scale of stride 16."""
BOX = (56.0, 24.0, 20.0, 12.0)
"""What every network here says that cell sees."""


def save(path, nodes, inputs, outputs, constants, **metadata):
    """A network of these nodes; outputs with their shapes."""
    graph = helper.make_graph(
        nodes,
        "made",
        [helper.make_tensor_value_info(name, kind, shape) for name, kind, shape in inputs],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs.items()],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def network(path, outputs, size_input=False, **metadata):
    """Says `base` + `part` × the mean of the picture's first plane, for each output (base, part) by name."""
    images = ("images", TensorProto.FLOAT, [1, 3, ROWS, COLUMNS])
    sizes = ("orig_target_sizes", TensorProto.INT64, [1, 2])
    nodes = [
        helper.make_node("Gather", ["images", "zero"], ["plane"], axis=1),
        helper.make_node("ReduceMean", ["plane"], ["mean"], keepdims=0),
    ]
    constants = {"zero": np.array(0)}
    if size_input:  # used, and of no effect
        nodes += [
            helper.make_node("Cast", ["orig_target_sizes"], ["size"], to=TensorProto.FLOAT),
            helper.make_node("ReduceSum", ["size"], ["sum"], keepdims=0),
            helper.make_node("Mul", ["sum", "nothing"], ["none"]),
            helper.make_node("Add", ["mean", "none"], ["brightness"]),
        ]
        constants["nothing"] = np.array(0.0, np.float32)
    else:
        nodes.append(helper.make_node("Identity", ["mean"], ["brightness"]))
    for name, (base, part) in outputs.items():
        constants |= {f"{name}_base": base.astype(np.float32), f"{name}_part": part.astype(np.float32)}
        nodes += [
            helper.make_node("Mul", [f"{name}_part", "brightness"], [f"{name}_scaled"]),
            helper.make_node("Add", [f"{name}_base", f"{name}_scaled"], [name]),
        ]
    inputs = [images, sizes] if size_input else [images]
    return save(
        path, nodes, inputs, {name: list(base.shape) for name, (base, _) in outputs.items()}, constants, **metadata
    )


def cells():
    """Decoded rows (1,126,4): every cell's own square."""
    rows = []
    for stride in (8, 16, 32):
        for row in range(ROWS // stride):
            rows += [[(c + 0.5) * stride, (row + 0.5) * stride, stride, stride] for c in range(COLUMNS // stride)]
    return np.array(rows)[None]


def yolox(path, *, raw=False, classes=80, kind=8):
    base, part = np.zeros((1, CELLS, 5 + classes)), np.zeros((1, CELLS, 5 + classes))
    base[..., :4] = cells()
    base[0, MINE, :4] = BOX
    base[0, MINE, 4] = 1.0
    part[0, MINE, 5 + kind] = 1.0 / 255.0
    if raw:
        base[..., :4] = (0.5, 0.5, 0.0, 0.0)
        base[0, MINE, :4] = (56 / 16 - 3, 24 / 16 - 1, np.log(20 / 16), np.log(12 / 16))
    return network(path, {"output": (base, part)})


def yolov8(path, classes=2, kind=1, **metadata):
    base, part = np.zeros((1, 4 + classes, CELLS)), np.zeros((1, 4 + classes, CELLS))
    base[:, :4] = cells().transpose(0, 2, 1)
    base[0, :4, MINE] = BOX
    part[0, 4 + kind, MINE] = 1.0
    return network(path, {"output0": (base, part)}, **({"names": "{0: 'person', 1: 'boat'}"} | metadata))


def rt_detr(path):
    labels, boxes, scores = np.full((1, 300), 2.0), np.zeros((1, 300, 4)), np.zeros((1, 300))
    labels[0, 7], boxes[0, 7] = 8, (46, 18, 66, 30)
    part = np.zeros((1, 300))
    part[0, 7] = 1.0
    outputs = {"labels": (labels, 0 * labels), "boxes": (boxes, 0 * boxes), "scores": (scores, part)}
    return network(path, outputs, size_input=True)


def rt_detr_logits(path):
    """Log-odds −L + 2 L r, of a plane of r = 0.8 with L = ln 4 / 0.6, are ln 4: 0.8."""
    logits, part, boxes = np.full((1, 300, 80), -20.0), np.zeros((1, 300, 80)), np.zeros((1, 300, 4))
    steep = np.log(4.0) / 0.6
    logits[0, 7, 8], part[0, 7, 8] = -steep, 2.0 * steep
    boxes[0, 7] = (56 / COLUMNS, 24 / ROWS, 20 / COLUMNS, 12 / ROWS)
    return network(path, {"logits": (logits, part), "pred_boxes": (boxes, 0 * boxes)})


@pytest.mark.parametrize(
    ("names", "classes", "kind"),
    [("{8: 'boat', 0: 'person'}", 80, 8), ("['person', 'boat']", 2, 1), ("{'0': 'person', '10': 'boat'}", 11, 10)],
)
def test_names_stand_at_their_numbers(names, classes, kind, tmp_path):
    path = yolov8(tmp_path / "made.onnx", classes, kind, names=names, task="detect")
    detector = Detector.load(str(path), detector_parameters(), ("boat",))
    ((_, name),) = detector.detect_named(np.full((ROWS, COLUMNS, 3), 204, np.uint8), 0.1)
    assert name == "boat"
    assert detector.kinds == {kind: "boat"}


def test_networks_of_other_tasks_are_refused_by_name(tmp_path):
    """A pose's key points would be read as confidences of classes."""
    path = yolov8(tmp_path / "pose.onnx", 52, names="{0: 'person'}", task="pose")
    with pytest.raises(DataError, match="task pose, expected detect"):
        load_reader(path)


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_networks_of_half_precision_are_given_it(runtime, tmp_path):
    model = onnx.load(yolov8(tmp_path / "made.onnx"))
    model.graph.input[0].type.tensor_type.elem_type = TensorProto.FLOAT16
    (first,) = (node for node in model.graph.node if "images" in node.input)
    first.input[0] = "single"
    model.graph.node.insert(0, helper.make_node("Cast", ["images"], ["single"], to=TensorProto.FLOAT))
    onnx.save(model, tmp_path / "half.onnx")
    settings = replace(detector_parameters(), runtime=runtime, precision="fp32", threads=1)
    detector = Detector.load(str(tmp_path / "half.onnx"), settings, ("boat",))
    (box,) = detector.detect(np.full((ROWS, COLUMNS, 3), 204, np.uint8), 0.1)
    assert box.confidence == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
@pytest.mark.parametrize(
    ("make", "layout", "confidence"),
    [
        (yolox, "YOLOX", 0.2),
        (lambda path: yolox(path, raw=True), "YOLOX", 0.2),
        (yolov8, "YOLOv8", 0.8),
        (rt_detr, "RT-DETR", 0.8),
        (rt_detr_logits, "RT-DETR's logits", 0.8),
    ],
    ids=["yolox", "yolox, raw", "yolov8", "rt-detr", "rt-detr, logits"],
)
def test_layouts_are_recognised_and_read(make, layout, confidence, runtime, tmp_path):
    """The confidence tells what the network was given: blue as it is is 0.2, red over 255 is 0.8."""
    settings = replace(detector_parameters(), runtime=runtime, precision="fp32", threads=1)
    detector = Detector.load(str(make(tmp_path / "made.onnx")), settings, ("boat",))
    assert detector.description.endswith(f"layout {layout}")
    picture = np.empty((ROWS, COLUMNS, 3), np.uint8)
    picture[:] = (51, 120, 204)
    ((box, name),) = detector.detect_named(picture, 0.1)
    assert name == "boat"
    assert box.confidence == pytest.approx(confidence, abs=1e-4)
    np.testing.assert_allclose((*box.centre_px, *box.size_px), (55.5, 23.5, 20.0, 12.0), atol=1e-3)
    assert detector.detect(picture, confidence + 0.01) == []


def test_classes_are_chosen_by_name_or_number(tmp_path):
    path, settings = str(yolox(tmp_path / "coco.onnx")), replace(detector_parameters(), threads=1)
    picture = np.full((ROWS, COLUMNS, 3), 200, np.uint8)
    assert len(COCO_CLASSES) == 80
    assert [name for _, name in Detector.load(path, settings).detect_named(picture, 0.1)] == ["boat"]
    assert len(Detector.load(path, settings, ("8",)).detect(picture, 0.1)) == 1
    assert Detector.load(path, settings, ("person", "bird")).detect(picture, 0.1) == []
    for unknown in ("ship", "80"):
        with pytest.raises(DataError, match=rf"has no class '{unknown}': name one of person, .*0 … 79$"):
            Detector.load(path, settings, (unknown,))
    one = str(yolox(tmp_path / "one.onnx", classes=1, kind=0))
    assert len(Detector.load(one, settings, ("ship",)).detect(picture, 0.1)) == 1


def test_a_flight_takes_the_class_that_the_configuration_names(camera, tmp_path):
    path = str(yolox(tmp_path / "coco.onnx"))
    settings = replace(detector_parameters(), threads=1, ship_weights=path)
    with pytest.raises(DataError, match="has no class 'ship'"):
        FarVision.load(camera, settings, Rig())
    assert FarVision.load(camera, replace(settings, ship_class="boat"), Rig()).ship.kinds == {8: "boat"}


def test_a_set_is_measured_by_the_classes_that_the_detector_knows(tmp_path):
    """One picture of a ship where the network sees a boat; 80 classes, of which the set names one."""
    path = str(yolox(tmp_path / "coco.onnx"))
    for name in ("images", "labels"):
        (tmp_path / "set" / name).mkdir(parents=True)
    cv2.imwrite(str(tmp_path / "set" / "images" / "a.png"), np.full((ROWS, COLUMNS, 3), 200, np.uint8))
    (tmp_path / "set" / "labels" / "a.txt").write_text(f"0 {56 / 96} {24 / 64} {20 / 96} {12 / 64}\n")
    asked = EvaluateArguments(path, data=tmp_path / "set", classes=("boat",), out=tmp_path / "out", threads=1)
    found = evaluate(asked)
    assert (found.recall, found.precision, found.missed) == (1.0, 1.0, ())
    assert json.loads((tmp_path / "out" / "evaluation.json").read_text())["pictures"] == 1
    with pytest.raises(DataError, match=r"has the classes ship; .* has no class 'ship': .*; --classes names"):
        evaluate(replace(asked, classes=("ship",)))


def bright_cells(path):
    """A YOLOX of 64 × 64 px that sees a box in every bright cell of 8 px, and nothing else."""
    nodes = [
        helper.make_node("AveragePool", ["images"], ["pooled"], kernel_shape=[8, 8], strides=[8, 8]),
        helper.make_node("ReduceMean", ["pooled"], ["grey"], axes=[1]),
        helper.make_node("Reshape", ["grey", "shape"], ["fine"]),
        helper.make_node("Mul", ["fine", "scale"], ["sure"]),
        helper.make_node("Concat", ["sure", "coarse"], ["objectness"], axis=1),
        helper.make_node("Concat", ["boxes", "objectness", "class"], ["output"], axis=2),
    ]
    constants = {
        "shape": np.array([1, 64, 1]),
        "scale": np.array(1.0 / 255.0, np.float32),
        "coarse": np.zeros((1, 20, 1), np.float32),
        "boxes": np.tile(np.array([0.5, 0.5, 0.0, 0.0], np.float32), (1, 84, 1)),
        "class": np.ones((1, 84, 1), np.float32),
    }
    return save(path, nodes, [("images", TensorProto.FLOAT, [1, 3, 64, 64])], {"output": [1, 84, 6]}, constants)


@pytest.mark.parametrize("column", [56, 72, 200])
def test_a_network_of_one_size_finds_what_is_small_in_tiles(column, tmp_path):
    """Shrunk to a quarter the bright block is two pixels and no cell's; its tile shows it, and one box is left."""
    settings = replace(detector_parameters(), threads=1, tile_min_px=64, tile_max_px=64)
    detector = Detector.load(str(bright_cells(tmp_path / "cells.onnx")), settings)
    picture = np.zeros((256, 256, 3), np.uint8)
    picture[96:104, column : column + 8] = 255
    (box,) = detector.detect(picture, 0.5)
    np.testing.assert_allclose((*box.centre_px, *box.size_px), (column + 3.5, 99.5, 8.0, 8.0), atol=1e-3)
    assert detector.detect_in_tile(picture, (column + 8.0, 104.0), 64, 1, 0.5) == [box]
    tile = replace(settings, tile_max_px=256)
    assert Detector.load(str(tmp_path / "cells.onnx"), tile).detect(picture, 0.5) == []


def test_what_a_tile_cuts_or_is_too_small_for_is_left_to_the_whole():
    """A network that always says the same: a large box in the middle, and a small one over its right edge.

    Of the tiles, 64 px in five rows of five, the last column's edge is the picture's own: five small boxes are left.
    """

    def candidates(picture, least):
        boxes = np.array([[32, 32, 40, 40], [62, 32, 8, 8]], np.float32)
        return boxes, np.full(2, 0.9, np.float32), np.zeros(2, np.float32)

    reader = SimpleNamespace(size_px=(64, 64), fit_px=0, classes=("ship",), candidates=candidates)
    boxes = Detector(reader, 0.45, tile_px=64).detect(np.zeros((256, 256, 3), np.uint8), 0.5)
    whole = [box for box in boxes if box.size_px[0] > 8.0]
    assert sorted((box.centre_px, box.size_px) for box in whole) == [
        ((127.5, 127.5), (160, 160)),
        ((247.5, 127.5), (32, 32)),
    ]
    small = sorted(box.centre_px for box in boxes if box not in whole)
    assert small == [(253.5, 31.5 + 48.0 * row) for row in range(5)]


def test_a_block_that_fills_the_picture_is_found_in_the_whole(tmp_path):
    """Four times a cell wide: the tiles see parts of it, cut off where they end, the whole sees it as one cell."""
    settings = replace(detector_parameters(), threads=1, tile_min_px=256, tile_max_px=256)
    detector = Detector.load(str(bright_cells(tmp_path / "cells.onnx")), settings)
    picture = np.zeros((128, 256, 3), np.uint8)
    picture[64:96, 96:128] = 255
    boxes = detector.detect(picture, 0.5)
    np.testing.assert_allclose((*boxes[0].centre_px, *boxes[0].size_px), (111.5, 79.5, 32.0, 32.0), atol=1e-3)


def test_other_layouts_are_refused_with_what_was_found(tmp_path):
    """Three rows too many for the picture's cells; and a picture whose colours come last."""
    rows = np.zeros((1, CELLS + 3, 85))
    path = network(tmp_path / "other.onnx", {"found": (rows, rows)})
    wanted = (
        r"other\.onnx is no detector that can be read: it has found \[1, 129, 85\]; expected .*YOLOX: one of.*RT-DETR"
    )
    for runtime in ("openvino", "onnxruntime"):
        with pytest.raises(DataError, match=wanted) as caught:
            load_reader(path, runtime)
        assert "\n" not in str(caught.value)
    nodes = [helper.make_node("Identity", ["picture"], ["found"])]
    shape = [1, 64, 64, 3]
    save(path, nodes, [("picture", TensorProto.FLOAT, shape)], {"found": shape}, {})
    save(tmp_path / "still.onnx", [helper.make_node("Constant", [], ["found"], value_float=1.0)], [], {"found": []}, {})
    for runtime in ("openvino", "onnxruntime"):
        with pytest.raises(DataError, match="it has no input; expected"):
            load_reader(tmp_path / "still.onnx", runtime)
    with pytest.raises(DataError, match=r"it has the input picture \[1, 64, 64, 3\]"):
        load_reader(path)
