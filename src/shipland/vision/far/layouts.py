"""What stands in a detector's outputs: those of `shipland train`, YOLOX's, RT-DETR's and YOLOv8's can be read.

A file of `shipland train` says in its metadata how it is read. Any other is given a blank picture once: names and
shapes of what comes out tell the layout. Boxes are rows (centre column, centre row, width, height) [px, edges].
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shipland.errors import DataError
from shipland.vision.far.decode import STRIDES, DetectorSpec, Float32, decode, sigmoid
from shipland.vision.far.runtime import METADATA_KEY, Network, Picture, load_network
from shipland.vision.parameters import Precision, Runtime

Size = tuple[int, int]
"""Rows and columns of what the network sees [px]."""
_BLANK: Size = (256, 320)
"""Of the blank picture, where the network takes any size."""
# fmt: off
COCO_CLASSES = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow", "elephant",
    "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard",
    "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle",
    "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich", "orange", "broccoli",
    "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch", "potted plant", "bed", "dining table", "toilet",
    "tv", "laptop", "mouse", "remote", "keyboard", "cell phone", "microwave", "oven", "toaster", "sink",
    "refrigerator", "book", "clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush",
)
# fmt: on
"""The 80 of COCO, in the order that detectors number them; what a file of 80 classes without names is taken for."""


class Rows(NamedTuple):
    """Boxes (n,4), confidences (n,), classes' numbers (n,), and how many classes there are (0: not said)."""

    boxes: Float32
    scores: Float32
    kinds: Float32
    classes: int


@dataclass(frozen=True)
class Layout:
    """One way in which detectors are exported.

    Attributes:
        outputs: names or shapes, in words.
        rgb, divisor: the picture's order of colours, and what 0 … 255 is divided by.
        read: rows of the outputs by name, for a picture of this size; None where they are not of this layout.
    """

    outputs: str
    rgb: bool
    divisor: float
    read: Callable[[Mapping[str, Float32], Size], Rows | None]


def _cells(size: Size) -> tuple[Float32, Float32]:
    """Column and row (n,2) and stride (n,1) of all cells, the finest scale first."""
    grids = [
        np.stack(np.meshgrid(np.arange(size[1] // stride), np.arange(size[0] // stride)), -1).reshape(-1, 2)
        for stride in STRIDES
    ]
    strides = np.repeat(STRIDES, [len(grid) for grid in grids])
    return np.concatenate(grids).astype(np.float32), strides[:, None].astype(np.float32)


def _surest(boxes: Float32, probabilities: Float32) -> Rows:
    """Each box with its likeliest class, of probabilities (n, classes)."""
    kinds = np.argmax(probabilities, axis=1)
    scores = probabilities[np.arange(len(kinds)), kinds]
    return Rows(boxes.astype(np.float32), scores, kinds.astype(np.float32), probabilities.shape[1])


def _yolox(outputs: Mapping[str, Float32], size: Size) -> Rows | None:
    """A row a cell: box, objectness, classes. Exports leave boxes decoded or not; a decoded one lies near its cell."""
    cells, strides = _cells(size)
    rows = next(iter(outputs.values()))
    if len(outputs) != 1 or rows.ndim != 2 or len(rows) != len(cells) or rows.shape[1] < 6:
        return None
    boxes = rows[:, :4]
    if np.median(np.abs(boxes[:, :2])) < np.median(np.abs(boxes[:, :2] / strides - cells)):
        boxes = np.hstack([boxes[:, :2] + cells, np.exp(np.clip(boxes[:, 2:], -20.0, 20.0))]) * strides
    return _surest(boxes, rows[:, 4:5] * rows[:, 5:])


def _yolov8(outputs: Mapping[str, Float32], size: Size) -> Rows | None:
    """A column a cell: box, classes."""
    columns = next(iter(outputs.values()))
    if len(outputs) != 1 or columns.ndim != 2 or columns.shape[1] != len(_cells(size)[0]) or len(columns) < 5:
        return None
    return _surest(columns[:4].T, columns[4:].T)


def _rt_detr(outputs: Mapping[str, Float32], size: Size) -> Rows | None:  # noqa: ARG001 - boxes are in pixels
    """A row a query: the class's number, corners, confidence."""
    if set(outputs) != {"labels", "boxes", "scores"} or outputs["boxes"].shape != (*outputs["scores"].shape, 4):
        return None
    low, high = outputs["boxes"][:, :2], outputs["boxes"][:, 2:]
    boxes = np.hstack([0.5 * (low + high), high - low]).astype(np.float32)
    return Rows(boxes, outputs["scores"], outputs["labels"].astype(np.float32), 0)


def _rt_detr_logits(outputs: Mapping[str, Float32], size: Size) -> Rows | None:
    """A row a query: the classes' log-odds; the box in fractions of the picture."""
    if set(outputs) != {"logits", "pred_boxes"} or outputs["pred_boxes"].shape != (*outputs["logits"].shape[:1], 4):
        return None
    return _surest(outputs["pred_boxes"] * np.array([*size[::-1], *size[::-1]], np.float32), sigmoid(outputs["logits"]))


LAYOUTS = {
    "YOLOX": Layout("one of [1, cells, 5 + classes]", False, 1.0, _yolox),
    "RT-DETR": Layout("labels, boxes and scores", True, 255.0, _rt_detr),
    "RT-DETR's logits": Layout("logits and pred_boxes", True, 255.0, _rt_detr_logits),
    "YOLOv8": Layout("one of [1, 4 + classes, cells]", True, 255.0, _yolov8),
}
"""What is tried, in this order. YOLOX takes BGR of 0 … 255, the others RGB of 0 … 1."""


@dataclass(frozen=True)
class Reader:
    """A network and how its outputs are read.

    Attributes:
        network: what runs.
        classes: their names, by number.
        note: where the weights come from, or the layout.
        size_px: rows and columns of the only picture that it takes; None where it takes any of multiples of 32.
        fit_px: whole pictures are first scaled to this longer side, as in training; 0 keeps native pixels.
        rgb, divisor: see `Layout`.
        read: boxes (n,4), confidences (n,) and classes' numbers (n,) of the outputs, for a picture of this size and a
            least confidence.
    """

    network: Network
    classes: tuple[str, ...]
    note: str
    size_px: Size | None
    fit_px: int
    rgb: bool
    divisor: float
    read: Callable[[list[Float32], Size, float], tuple[Float32, Float32, Float32]]

    def candidates(self, picture: Picture, min_confidence: float) -> tuple[Float32, Float32, Float32]:
        """What may be seen in a picture (h,w,3) BGR of a size that the network takes, overlapping boxes included."""
        seen = np.ascontiguousarray(picture[..., ::-1]) if self.rgb else picture
        return self.read(self.network.run(seen, self.divisor), (picture.shape[0], picture.shape[1]), min_confidence)


def load_reader(path: Path, runtime: Runtime = "auto", precision: Precision = "auto", threads: int = 0) -> Reader:
    """The detector of an ONNX file; arguments as of `load_network`.

    Raises:
        DataError: the file is missing, damaged, or no detector; it names the layouts that can be read, and what it has.
        SystemLibraryError: the runtime asked for, or any, is not installed.
    """
    network = load_network(path, runtime, precision, threads)
    text = network.metadata(METADATA_KEY)
    if text is not None:
        spec = DetectorSpec.from_json(text, str(path))
        return Reader(
            network,
            spec.classes,
            spec.note,
            None,
            spec.fit_px,
            False,
            1.0,
            lambda maps, _, least: decode(maps, spec, least),
        )
    task = network.metadata("task")
    if task not in (None, "detect"):
        raise DataError(f"{path} is no detector that can be read: its metadata says task {task}, expected detect")
    shapes = list(network.inputs.values())
    if 1 <= len(shapes) <= 2 and len(shapes[0]) == 4 and shapes[0][1] in (3, -1):
        rows, columns = shapes[0][2:]
        fixed = (rows, columns) if rows > 0 and columns > 0 else None
        size = fixed or _BLANK
        outputs = network.run(np.full((*size, 3), 114, np.uint8))
        for name, layout in LAYOUTS.items():
            found = layout.read(dict(zip(network.outputs, outputs, strict=True)), size)
            if found is not None:
                classes = _class_names(network.metadata("names"), found.classes)
                read = _surer(layout, list(network.outputs))
                return Reader(network, classes, f"layout {name}", fixed, 0, layout.rgb, layout.divisor, read)
        shown = ", ".join(f"{name} {[1, *item.shape]}" for name, item in zip(network.outputs, outputs, strict=True))
    else:
        shown = " and ".join(f"the input {name} {list(shape)}" for name, shape in network.inputs.items()) or "no input"
    known = "; ".join(f"{name}: {layout.outputs}" for name, layout in LAYOUTS.items())
    raise DataError(
        f"{path} is no detector that can be read: it has {shown}; expected a file of `shipland train`, or an input "
        f"[1, 3, rows, columns] and the outputs of {known}"
    )


def _surer(
    layout: Layout, names: Sequence[str]
) -> Callable[[list[Float32], Size, float], tuple[Float32, Float32, Float32]]:
    def read(outputs: list[Float32], size: Size, least: float) -> tuple[Float32, Float32, Float32]:
        rows = layout.read(dict(zip(names, outputs, strict=True)), size)
        assert rows is not None  # as the blank picture's
        kept = (rows.scores >= least) & np.isfinite(rows.boxes).all(axis=1) & (rows.boxes[:, 2:] > 0.0).all(axis=1)
        return rows.boxes[kept], rows.scores[kept], rows.kinds[kept]

    return read


def _class_names(listed: str | None, count: int) -> tuple[str, ...]:
    """Those that the file lists, by number (`{0: 'boat', …}`) or in order, else COCO's, else numbers."""
    try:
        told = ast.literal_eval(listed or "{}")
        items = told.items() if isinstance(told, dict) else enumerate(told)
        named = {int(number): str(name) for number, name in items}
    except (SyntaxError, TypeError, ValueError):
        named = {}
    if not named and count in (0, len(COCO_CLASSES)):
        return COCO_CLASSES
    return tuple(named.get(number, str(number)) for number in range(count or 1 + max(named)))
