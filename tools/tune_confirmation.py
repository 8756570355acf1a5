"""The confirmation's settings over kept boxes: recall after confirmation and false boxes, nothing drawn again.

    shipland evaluate --weights ship --kind ship --scenes 480 --frames 10 --seed 5000000 --keep-boxes --out out/boxes
    python tools/tune_confirmation.py out/boxes/scenes.jsonl --kind ship             # the packaged settings
    python tools/tune_confirmation.py out/boxes/scenes.jsonl --kind ship --tune      # others: some minutes

Settings are chosen on one half of the scenes and judged on the other; scenes that share light and sea are on one side.
What is counted is scenes, for the frames of one scene show the same things.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shipland.camera import Camera, CameraParameters
from shipland.learning.metrics import wilson_interval
from shipland.learning.ranges import SceneRecord, SureBox, hits
from shipland.learning.synth import FRAME_S
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.vision.far.decode import PIXEL_CENTRE
from shipland.vision.far.detector import Detector, Picture
from shipland.vision.far.far import FarVision
from shipland.vision.far.parameters import Confirmation, DetectorParameters, detector_parameters


class KeptBoxes(Detector):
    """A detector that gives the boxes that were kept; a tile shows those whose middle lies in it."""

    def __init__(self) -> None:
        self.boxes: list[Box] = []

    def detect(self, picture: Picture, min_confidence: float, kind: int = 0) -> list[Box]:  # noqa: ARG002
        """See `Detector.detect`."""
        return [box for box in self.boxes if box.confidence >= min_confidence]

    def detect_in_tile(
        self,
        picture: Picture,
        centre_px: tuple[float, float],
        tile_px: int,
        reduction: int,
        min_confidence: float,
        kind: int = 0,  # noqa: ARG002
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


@dataclass(frozen=True)
class Replay:
    """What confirmation made of some scenes.

    Attributes:
        soon, later, ever: targets that a believed track gave in one of the first 3, the first 5, or any of the frames.
        targets: scenes with one.
        right: frames, from the fifth on, whose target it gave.
        frames_with: frames, from the fifth on, with a target.
        loose: frames in which it gave the target in a box that overlaps it, but too little.
        false: frames in which it gave something else.
        false_scenes: scenes with such a frame.
        frames, scenes: in all.
    """

    soon: int
    later: int
    ever: int
    targets: int
    right: int
    frames_with: int
    loose: int
    false: int
    false_scenes: int
    frames: int
    scenes: int

    @property
    def false_per_1000(self) -> float:
        """In 1,000 frames."""
        return 1000.0 * self.false / max(self.frames, 1)

    def cells(self) -> list[str]:
        """Of the table."""
        low, high = wilson_interval(self.ever, self.targets)
        few, many = wilson_interval(self.false_scenes, self.scenes)
        return [
            f"{self.soon / max(self.targets, 1):.3f}",
            f"{self.later / max(self.targets, 1):.3f}",
            f"{self.ever / max(self.targets, 1):.3f} ({low:.2f}–{high:.2f})",
            f"{self.right / max(self.frames_with, 1):.3f}",
            f"{1000.0 * self.loose / max(self.frames, 1):.1f}",
            f"{self.false_per_1000:.1f}",
            f"{self.false_scenes} of {self.scenes} ({100.0 * few:.1f}–{100.0 * many:.1f} %)",
        ]


COLUMNS = (
    "in 3 frames",
    "in 5",
    "in all",
    "frames from the 5th on",
    "loose, 1,000 frames",
    "false, 1,000 frames",
    "scenes with a false one",
)
SETTLED = 4
_TOUCHING = 1e-3
"""Overlap (IoU) of boxes that have anything in common."""


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


def replayed(
    records: Sequence[SceneRecord],
    kind: str,
    camera: Camera,
    parameters: DetectorParameters,
    min_iou: float,
    *,
    heights: bool = True,
) -> Replay:
    """Scenes through the far vision, frame by frame; without `heights` as where no vehicle tells them."""
    counts = np.zeros(9, int)
    frames = 0
    for record in records:
        right, loose, false = [], 0, 0
        told = replayed_boxes(record, kind, camera, parameters, heights=heights)
        for row, (target, _) in zip(told, record.believed, strict=True):
            right.append(row is not None and hits(row, target, min_iou))
            if row is not None and not right[-1]:
                beside = hits(row, target, _TOUCHING)
                loose, false = loose + beside, false + (not beside)
        there = [target is not None for target, _ in record.believed]
        found = [any(right[:3]), any(right[:5]), any(right), True] if record.target is not None else [False] * 4
        counts += [*found, sum(right[SETTLED:]), sum(there[SETTLED:]), loose, false, false > 0]
        frames += len(record.frames)
    return Replay(*counts.tolist(), frames, len(records))


def single(records: Sequence[SceneRecord], confidence: float, min_iou: float) -> tuple[float, float]:
    """Recall of single frames, and their false boxes in 1,000."""
    right = frames_with = false = frames = 0
    for record in records:
        for (target, _), rows in zip(record.believed, record.frames, strict=True):
            verdicts = [hits(row, target, min_iou) for row in rows if row[4] >= confidence]
            frames += 1
            frames_with += target is not None
            right += any(verdicts)
            false += len(verdicts) - sum(verdicts)
    return right / max(frames_with, 1), 1000.0 * false / max(frames, 1)


def settings(old: Confirmation) -> dict[str, Confirmation]:
    """What is tried, by name."""
    grid = itertools.product((0.2, 0.25, 0.3, 0.45), (0.0, 3.0), (3.0, 5.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0))
    return {
        f"neutral {neutral:g}, size {weight:g}, evidence {believe:g}": replace(
            old,
            neutral_confidence=neutral,
            size_weight=weight,
            believe_evidence=believe,
            most_evidence=max(old.most_evidence, believe + 3.0),
        )
        for neutral, weight, believe in grid
    }


def main() -> None:
    """Replay, and print tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--kind", choices=("ship", "bar"), default="ship")
    parser.add_argument("--iou", type=float, default=0.3)
    parser.add_argument("--farthest-m", type=float, default=np.inf, help="leave out targets beyond")
    parser.add_argument("--clearest-from-m", type=float, default=0.0, help="leave out air of a lower visibility")
    parser.add_argument("--tune", action="store_true", help="try other settings than the packaged")
    parser.add_argument("--most-false", type=float, nargs="+", default=[1.0, 5.0, 10.0], help="in 1,000 frames")
    parser.add_argument("--block", type=int, default=8, help="scenes that share light and sea")
    arguments = parser.parse_args()
    lines = arguments.scenes.read_text(encoding="utf-8").splitlines()
    records = [SceneRecord.from_json(line, str(arguments.scenes)) for line in lines]
    records = [
        record
        for record in records
        if record.frames
        and record.visibility_m >= arguments.clearest_from_m
        and (record.target is None or record.range_m <= arguments.farthest_m)
    ]
    camera = Camera.from_parameters(CameraParameters())
    shipped, kind = detector_parameters(), arguments.kind
    print(f"{len(records)} scenes, {sum(record.target is not None for record in records)} with the target\n")
    print("| single frames of confidence | recall | false, 1,000 frames |\n|---:|---:|---:|")
    for confidence in (0.3, 0.5, 0.7, 0.9):
        print("| {:g} | {:.3f} | {:.0f} |".format(confidence, *single(records, confidence, arguments.iou)))
    print(f"\n| confirmed | {' | '.join(COLUMNS)} |\n|---|{'---:|' * len(COLUMNS)}")
    halves = [[item for item in records if item.number // arguments.block % 2 == side] for side in (0, 1)]

    def line(name: str, scenes: Sequence[SceneRecord], used: DetectorParameters, *, heights: bool = True) -> None:
        cells = replayed(scenes, kind, camera, used, arguments.iou, heights=heights).cells()
        print(f"| {name} | {' | '.join(cells)} |", flush=True)

    line("as packaged", records, shipped)
    line("as packaged, height not known", records, shipped, heights=False)
    for name, half in zip(("one half", "the other"), halves, strict=True):
        line(f"as packaged, {name}", half, shipped)
    if not arguments.tune:
        return
    tried = {}
    for name, setting in settings(getattr(shipped, kind)).items():
        parameters = replace(shipped, **{kind: setting})
        tried[name] = parameters, [replayed(half, kind, camera, parameters, arguments.iou) for half in halves]
    for most, side in itertools.product(arguments.most_false, (0, 1)):
        fitting = [name for name, (_, seen) in tried.items() if seen[side].false_per_1000 <= most]
        if not fitting:
            continue
        best = max(fitting, key=lambda name: (tried[name][1][side].ever, tried[name][1][side].later))
        for which, half in (("chosen on", side), ("judged on", 1 - side)):
            print(f"| {best}: {which} half {half + 1}, at most {most:g} | {' | '.join(tried[best][1][half].cells())} |")


if __name__ == "__main__":
    main()
