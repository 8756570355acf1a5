"""Within a second: what the far vision's confirmation believes, over kept boxes of fresh scenes of the simulator.

Scenes that share light and sea are on one side of the two halves; the packaged settings were chosen on one half of the
480 and judged on the other. What is counted is scenes, for the frames of one scene show the same things.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shipland.camera import Camera, CameraParameters
from shipland.learning.arguments import EvaluateArguments
from shipland.learning.evaluate import EvaluateParameters, evaluate
from shipland.learning.ranges import SceneRecord, SureBox, hits
from shipland.learning.synth import FRAME_S
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.statistics import share_interval
from shipland.vision.far.decode import PIXEL_CENTRE
from shipland.vision.far.detector import Detector, Picture
from shipland.vision.far.far import FarVision
from shipland.vision.parameters import DetectorParameters, detector_parameters
from studies.harness import Case, Column, Row, Study, estimate

SETS: dict[str, tuple[str, int, float]] = {
    "ship, chosen on": ("ship", 5000000, 1.0),
    "ship, another seed": ("ship", 7000000, 0.25),
    "bar": ("bar", 6000000, 0.22),
}
"""Name: kind, seed, share of the scenes."""
FRAMES, SETTLED = 10, 4
MIN_IOU = 0.3
_TOUCHING = 1e-3
"""Overlap (IoU) of boxes that have anything in common."""


class KeptBoxes(Detector):
    """A detector that gives the boxes that were kept; a tile shows those whose middle lies in it."""

    def __init__(self) -> None:
        self.boxes: list[Box] = []

    def detect(self, picture: Picture, min_confidence: float) -> list[Box]:  # noqa: ARG002
        """See `Detector.detect`."""
        return [box for box in self.boxes if box.confidence >= min_confidence]

    def detect_in_tile(
        self,
        picture: Picture,
        centre_px: tuple[float, float],
        tile_px: int,
        reduction: int,
        min_confidence: float,
    ) -> list[Box]:
        """See `Detector.detect_in_tile`."""
        reach = 0.5 * tile_px * reduction
        return [
            box
            for box in self.detect(picture, min_confidence)
            if max(abs(box.centre_px[0] - centre_px[0]), abs(box.centre_px[1] - centre_px[1])) < reach
        ]


def box_of(row: SureBox) -> Box:
    """A kept row as a message."""
    return Box((row[0] - PIXEL_CENTRE, row[1] - PIXEL_CENTRE), (row[2], row[3]), row[4])


def row_of(box: Box) -> SureBox:
    """A message as a kept row."""
    column, row = (at + PIXEL_CENTRE for at in box.centre_px)
    return (column, row, *box.size_px, box.confidence)


def replayed_boxes(
    record: SceneRecord, kind: str, camera: Camera, parameters: DetectorParameters, *, heights: bool = True
) -> list[SureBox | None]:
    """What the far vision says in each frame of a scene; without `heights` as where no vehicle tells them."""
    picture = np.zeros((camera.height_px, camera.width_px, 3), np.uint8)
    detector = KeptBoxes()
    far = FarVision(
        detector if kind == "ship" else None, detector if kind == "bar" else None, camera, parameters, Rig()
    )
    told: list[SureBox | None] = []
    for number, rows in enumerate(record.frames):
        detector.boxes = [box_of(row) for row in rows]
        height_m = record.heights_m[number] if heights and record.heights_m else None
        seen = far.see(Frame(FRAME_S * number, picture, GimbalAttitude(*record.gimbal_rad), height_m))
        box = seen.ship_box if kind == "ship" else seen.bar_box
        told.append(None if box is None else row_of(box))
    return told


def cases() -> Sequence[Case]:
    """Sets of scenes."""
    return [{"set": name} for name in SETS]


def measure(case: Case, runs: int) -> list[Row]:
    """A second of each scene; rows of single frames, and of the packaged settings on all scenes, halves, no heights."""
    kind, seed, share = SETS[str(case["set"])]
    with tempfile.TemporaryDirectory() as folder:
        out, scenes = Path(folder), max(round(share * runs), 8)
        evaluate(
            EvaluateArguments(weights=kind, kind=kind, count=scenes, frames=FRAMES, seed=seed, keep_boxes=True, out=out)
        )
        lines = (out / "scenes.jsonl").read_text(encoding="utf-8").splitlines()
    records = [SceneRecord.from_json(line, str(case["set"])) for line in lines]
    block = EvaluateParameters().pictures_per_scene
    halves = [[record for record in records if record.number // block % 2 == side] for side in (0, 1)]
    rows = [single(records, confidence) for confidence in (0.5, 0.7)]
    rows += [
        {"what": "packaged", **replayed(records, kind)},
        {"what": "packaged, height not known", **replayed(records, kind, heights=False)},
    ]
    return rows + [
        {"what": f"packaged, {name}", **replayed(half, kind)}
        for name, half in zip(("one half", "the other"), halves, strict=True)
        if half
    ]


def replayed(records: Sequence[SceneRecord], kind: str, *, heights: bool = True) -> dict[str, Any]:
    """Scenes through the far vision, frame by frame; without `heights` as where no vehicle tells them."""
    camera, parameters = Camera.from_parameters(CameraParameters()), detector_parameters()
    counts, frames = np.zeros(9), 0
    for record in records:
        right, loose, false = [], 0, 0
        told = replayed_boxes(record, kind, camera, parameters, heights=heights)
        for row, (target, _) in zip(told, record.believed, strict=True):
            right.append(row is not None and hits(row, target, MIN_IOU))
            if row is not None and not right[-1]:
                beside = hits(row, target, _TOUCHING)
                loose, false = loose + beside, false + (not beside)
        there = [target is not None for target, _ in record.believed]
        found = [any(right[:3]), any(right[:5]), any(right), True] if record.target is not None else [False] * 4
        counts += [*found, sum(right[SETTLED:]), sum(there[SETTLED:]), loose, false, false > 0]
        frames += len(record.frames)
    soon, later, ever, targets, settled, frames_with, loose, false, false_scenes = map(int, counts)
    return {
        "soon": soon / max(targets, 1),
        "later": later / max(targets, 1),
        "ever": estimate(ever / max(targets, 1), share_interval(ever, targets, "wilson")),
        "settled": settled / max(frames_with, 1),
        "loose": loose / max(frames, 1),
        "false": false / max(frames, 1),
        "false_scenes": estimate(false_scenes / len(records), share_interval(false_scenes, len(records), "wilson")),
        "scenes": len(records),
    }


def single(records: Sequence[SceneRecord], confidence: float) -> dict[str, Any]:
    """Recall of single frames from the fifth on, and their boxes that hit nothing."""
    right = frames_with = false = frames = 0
    for record in records:
        for (target, _), rows in list(zip(record.believed, record.frames, strict=True))[SETTLED:]:
            verdicts = [hits(row, target, MIN_IOU) for row in rows if row[4] >= confidence]
            frames += 1
            frames_with += target is not None
            right += any(verdicts)
            false += len(verdicts) - sum(verdicts)
    shares = {"settled": right / max(frames_with, 1), "false": false / frames, "scenes": len(records)}
    return {"what": f"single frames, confidence {confidence:g}, false with loose", **shares}


STUDY = Study(
    question="How many ships are believed within a second, and what else is?",
    columns={
        "set": Column("scenes"),
        "what": Column("by"),
        "scenes": Column("number", "d"),
        "soon": Column("in 3 frames", ".3f"),
        "later": Column("in 5", ".3f"),
        "ever": Column("in 10 (95 % interval)", ".3f"),
        "settled": Column("frames from the 5th on", ".3f"),
        "loose": Column("loose, 1,000 frames", ".1f", 1e3),
        "false": Column("false, 1,000 frames", ".1f", 1e3),
        "false_scenes": Column("scenes with a false one [%] (95 % interval)", ".1f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=480,
    minutes=20,
)
