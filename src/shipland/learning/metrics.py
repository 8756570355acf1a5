"""Which boxes hit which targets, and what follows: recall, precision, average precision."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipland.learning.dataset import Targets
from shipland.vision.far.decode import Float32, iou

COCO_IOUS = tuple(round(0.5 + 0.05 * step, 2) for step in range(10))
"""Overlaps that COCO's mean average precision is taken over."""


def match(boxes: Float32, scores: Float32, targets: Targets, min_iou: float) -> npt.NDArray[np.int64]:
    """For each box (n,4) the index of the target that it hits, -1 for a false box, -2 for one not to be counted.

    The surest box takes first; a target is hit once; classes with an index below zero are not to be counted.
    """
    verdict = np.full(len(boxes), -1, dtype=np.int64)
    if not len(targets):
        return verdict
    overlap = iou(boxes, targets[:, 1:5])
    taken = np.zeros(len(targets), dtype=bool)
    for index in np.argsort(-scores, kind="stable"):
        free = np.where(taken | (targets[:, 0] < 0.0), 0.0, overlap[index])
        best = int(np.argmax(free))
        if free[best] >= min_iou:
            taken[best] = True
            verdict[index] = best
        elif np.any((targets[:, 0] < 0.0) & (overlap[index] > 0.0)):
            verdict[index] = -2
    return verdict


class Tally:
    """Hits and misses over pictures, of all classes together; a box is a hit from the overlap `min_iou` on."""

    def __init__(self, min_iou: float) -> None:
        self.min_iou = min_iou
        self.pictures = 0
        self.targets = 0
        self.hit_scores: list[float] = []
        self.false_scores: list[float] = []

    def add(self, boxes: Float32, scores: Float32, targets: Targets) -> npt.NDArray[np.int64]:
        """Count one picture; what `match` said."""
        verdict = match(boxes, scores, targets, self.min_iou)
        self.pictures += 1
        self.targets += int(np.sum(targets[:, 0] >= 0.0))
        self.hit_scores += scores[verdict >= 0].tolist()
        self.false_scores += scores[verdict == -1].tolist()
        return verdict

    def recall(self, confidence: float) -> float:
        """Part of the targets that are hit at this confidence; NaN-free: 0 without targets."""
        return float(np.sum(np.array(self.hit_scores) >= confidence)) / max(self.targets, 1)

    def precision(self, confidence: float) -> float:
        """Part of the boxes at this confidence that are hits; 1 without boxes."""
        hits = float(np.sum(np.array(self.hit_scores) >= confidence))
        false = float(np.sum(np.array(self.false_scores) >= confidence))
        return hits / (hits + false) if hits + false else 1.0

    def false_per_picture(self, confidence: float) -> float:
        """False boxes a picture at this confidence."""
        return float(np.sum(np.array(self.false_scores) >= confidence)) / max(self.pictures, 1)

    def average_precision(self) -> float:
        """Area under precision over recall, precision made falling (all points, as PASCAL VOC from 2010 on)."""
        if not self.targets:
            return 0.0
        scores = np.array(self.hit_scores + self.false_scores)
        hit = np.array([1.0] * len(self.hit_scores) + [0.0] * len(self.false_scores))
        order = np.argsort(-scores, kind="stable")
        hits = np.cumsum(hit[order])
        precision = hits / np.arange(1, len(hits) + 1)
        falling = np.maximum.accumulate(precision[::-1])[::-1]
        return float(np.sum(falling * hit[order]) / self.targets)
