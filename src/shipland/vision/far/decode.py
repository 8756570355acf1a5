"""From a detector's raw maps to boxes: Darknet's decoding and a wider one, non-maximum suppression.

Boxes inside this module are rows (centre column, centre row, width, height) [px] with pixel edges at whole numbers,
the convention of YOLO labels; `to_boxes` moves them to the camera's, pixel centres at whole numbers.
"""

from __future__ import annotations

import enum
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import logit

from shipland.config import build, require
from shipland.errors import ConfigError, DataError
from shipland.files import json_of
from shipland.messages import Box

Float32 = npt.NDArray[np.float32]

STRIDES = (8, 16, 32)
PIXEL_CENTRE = 0.5
"""Pixel centres at whole numbers against pixel edges at whole numbers."""

MOST_CANDIDATES = 500
"""Most boxes that suppression compares; bounds its time."""


class Decoding(enum.Enum):
    """How raw numbers become a box; σ is the logistic function, c the cell, s the stride, a the anchor.

    DARKNET [YOLOv3, §2.1]: centre s(c + σ(x)), size a·exp(w).
    WIDE: centre s(c + 2σ(x) − ½), size a·(2σ(w))²: a cell reaches its neighbours, so that several cells and anchors
    can answer for one target, and a size cannot run away.
    """

    DARKNET = "darknet"
    WIDE = "wide"


@dataclass(frozen=True)
class DetectorSpec:
    """Metadata of a weights file, stored in it as JSON.

    Attributes:
        classes: names of the classes.
        anchors_px: three scales (strides 8, 16, 32) of three (width, height).
        decoding: how the maps are decoded.
        width: the network's width factor.
        note: where the weights come from.
        fit_px: whole pictures are first scaled to this longer side, as in training; 0 keeps native pixels.
    """

    classes: tuple[str, ...]
    anchors_px: tuple[tuple[tuple[float, float], ...], ...]
    decoding: Decoding
    width: float
    note: str = ""
    fit_px: int = 0

    def __post_init__(self) -> None:
        require(self.fit_px >= 0, "fit_px must not be negative")
        require(len(self.classes) > 0, "a detector needs at least one class")
        require(
            len(self.anchors_px) == len(STRIDES) and all(len(scale) == 3 for scale in self.anchors_px),
            "anchors_px wants three scales of three (width, height)",
        )
        require(
            all(side > 0.0 for scale in self.anchors_px for anchor in scale for side in anchor),
            "anchors_px must be positive",
        )
        require(self.width > 0.0, f"width must be positive, got {self.width}")

    def to_json(self) -> str:
        """One line of JSON."""
        return json.dumps({**asdict(self), "decoding": self.decoding.value})

    @staticmethod
    def from_json(text: str, where: str) -> DetectorSpec:
        """Read what `to_json` wrote; DataError names the file `where`."""
        try:
            return build(DetectorSpec, json_of(text), where)
        except (ValueError, ConfigError) as error:
            raise DataError(f"{where}: its detector metadata is broken: {error}") from None


def sigmoid(value: Float32) -> Float32:
    """The logistic function, without overflow."""
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * value)), dtype=np.float32)


def decode(maps: Sequence[Float32], spec: DetectorSpec, min_confidence: float) -> tuple[Float32, Float32, Float32]:
    """Candidate boxes of one picture.

    Args:
        maps: per scale, finest first, (3·(5 + classes), rows, columns) raw numbers: for every anchor x, y, w, h,
            objectness, classes.
        spec: anchors, classes and decoding.
        min_confidence: candidates whose confidence (objectness × class) lies below are left out.

    Returns:
        boxes (n,4) [px, edges], confidences (n,), class indices (n,), in no order.
    """
    count = 5 + len(spec.classes)
    boxes, scores, kinds = [], [], []
    least_logit = float(logit(min_confidence))
    for raw, stride, anchors in zip(maps, STRIDES, spec.anchors_px, strict=True):
        cells = raw.reshape(3, count, *raw.shape[-2:])
        anchor, row, column = np.nonzero(cells[:, 4] >= least_logit)
        if anchor.size == 0:
            continue
        values = cells[anchor, :, row, column]
        probability = sigmoid(values[:, 4:])
        kind = np.argmax(probability[:, 1:], axis=1)
        score = probability[:, 0] * probability[np.arange(len(kind)), 1 + kind]
        cell = np.column_stack([column, row]).astype(np.float32)
        size = np.asarray(anchors, dtype=np.float32)[anchor]
        if spec.decoding is Decoding.DARKNET:
            centre = (cell + sigmoid(values[:, :2])) * stride
            size = size * np.exp(np.clip(values[:, 2:4], -20.0, 20.0))
        else:
            centre = (cell + 2.0 * sigmoid(values[:, :2]) - 0.5) * stride
            size = size * (2.0 * sigmoid(values[:, 2:4])) ** 2
        keep = (score >= min_confidence) & np.isfinite(values[:, :4]).all(axis=1)
        boxes.append(np.concatenate([centre, size], axis=1)[keep])
        scores.append(score[keep])
        kinds.append(kind[keep])
    if not boxes:
        return np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.float32)
    return (
        np.concatenate(boxes).astype(np.float32),
        np.concatenate(scores).astype(np.float32),
        np.concatenate(kinds).astype(np.float32),
    )


def iou(boxes: npt.NDArray[np.floating[Any]], other: npt.NDArray[np.floating[Any]]) -> Float32:
    """Intersection over union (n,m) of boxes (n,4) and (m,4), rows (centre, size)."""
    a, b = boxes[:, None, :], other[None, :, :]
    low = np.maximum(a[..., :2] - 0.5 * a[..., 2:], b[..., :2] - 0.5 * b[..., 2:])
    high = np.minimum(a[..., :2] + 0.5 * a[..., 2:], b[..., :2] + 0.5 * b[..., 2:])
    overlap = np.prod(np.clip(high - low, 0.0, None), axis=-1)
    union = np.prod(a[..., 2:], axis=-1) + np.prod(b[..., 2:], axis=-1) - overlap
    return np.asarray(overlap / np.maximum(union, 1e-9), dtype=np.float32)


def suppress(
    boxes: Float32, scores: Float32, kinds: Float32, max_iou: float, merge: bool
) -> tuple[Float32, Float32, Float32]:
    """Greedy non-maximum suppression within each class, best first, of the MOST_CANDIDATES most confident.

    Args:
        boxes: (n,4) rows (centre, size).
        scores: (n,) confidences.
        kinds: (n,) class indices.
        max_iou: of two boxes that overlap more, the less confident goes.
        merge: a kept box becomes the confidence-weighted mean of those it suppresses with at least half its
            confidence; steadies the box, and leaves its confidence as it is.

    Returns:
        boxes (k,4), scores (k,), kinds (k,), most confident first.
    """
    order = np.argsort(-scores, kind="stable")[:MOST_CANDIDATES]
    boxes, scores, kinds = boxes[order], scores[order], kinds[order]
    kept_boxes, kept = [], []
    alive = np.ones(len(boxes), dtype=bool)
    for index in range(len(boxes)):
        if not alive[index]:
            continue
        overlap = iou(boxes[index : index + 1], boxes)[0]
        group = alive & (overlap > max_iou) & (kinds == kinds[index])
        group[index] = True
        alive &= ~group
        kept.append(index)
        if merge:
            weight = np.where(group & (scores >= 0.5 * scores[index]), scores, 0.0)
            kept_boxes.append(weight @ boxes / weight.sum())
        else:
            kept_boxes.append(boxes[index])
    if not kept:
        return boxes, scores, kinds
    return np.asarray(kept_boxes, dtype=np.float32), scores[kept], kinds[kept]


def to_boxes(boxes: Float32, scores: Float32, origin_px: tuple[float, float], scale: float) -> list[Box]:
    """Messages in the picture's pixels.

    Args:
        boxes: (n,4) rows (centre, size) [px of the tile, edges].
        scores: (n,).
        origin_px: (column, row) of the tile's corner in the picture [px, edges].
        scale: picture pixels per tile pixel.
    """
    return [
        Box(
            (
                float(origin_px[0] + scale * x - PIXEL_CENTRE),
                float(origin_px[1] + scale * y - PIXEL_CENTRE),
            ),
            (float(scale * w), float(scale * h)),
            float(score),
        )
        for (x, y, w, h), score in zip(boxes, scores, strict=True)
    ]
