"""A detector's boxes on a labelled set, picture by picture: which hit, which are false, and what was missed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shipland.learning.dataset import Dataset, Targets
from shipland.learning.metrics import Tally
from shipland.messages import Box
from shipland.progress import followed
from shipland.vision.far.decode import PIXEL_CENTRE, Float32
from shipland.vision.far.detector import Detector

LEAST_CONFIDENCE = 0.05
"""Of boxes that are kept for a table; far below what a detector is used with."""


@dataclass(frozen=True)
class Look:
    """One labelled picture as a detector sees it, boxes as (centre column, centre row, width, height) [px, edges].

    Attributes:
        scene: what is known of how it was made; empty otherwise.
        boxes, scores: (n,4) and (n,) their confidences.
        targets: (k,5) class and box of what is there.
        verdict: for each box the index of its target, −1 for a false one.
    """

    path: Path
    scene: dict[str, Any]
    boxes: Float32
    scores: Float32
    targets: Targets
    verdict: np.ndarray[Any, np.dtype[np.int64]]

    def above(self, confidence: float) -> Look:
        """The same without less confident boxes."""
        kept = self.scores >= confidence
        return replace(self, boxes=self.boxes[kept], scores=self.scores[kept], verdict=self.verdict[kept])

    @property
    def missed(self) -> list[int]:
        """Indices of targets that no box hits."""
        return sorted(set(range(len(self.targets))) - set(self.verdict[self.verdict >= 0].tolist()))


def looks_at(detector: Detector, dataset: Dataset, tallies: Sequence[Tally]) -> Iterator[Look]:
    """What the detector sees in every picture of a set, counted in every tally; the first one judges the boxes."""
    for sample in followed(dataset.samples, "pictures", len(dataset.samples)):
        picture, targets = sample.load()
        found = [edges_of(box) for box in detector.detect(picture, LEAST_CONFIDENCE)]
        rows = np.array(found, np.float32).reshape(-1, 5)
        verdict, *_ = [tally.add(rows[:, :4], rows[:, 4], targets) for tally in tallies]
        yield Look(sample.path, sample.scene, rows[:, :4], rows[:, 4], targets, verdict)


def edges_of(box: Box) -> tuple[float, float, float, float, float]:
    """A box and its confidence, with pixel edges at whole numbers as labels have them."""
    (column, row), (wide, high) = box.centre_px, box.size_px
    centre = round(column + PIXEL_CENTRE, 3), round(row + PIXEL_CENTRE, 3)
    return *centre, round(wide, 3), round(high, 3), round(box.confidence, 4)
