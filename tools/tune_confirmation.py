"""The confirmation's settings over kept boxes: recall after confirmation and false boxes, nothing drawn again.

shipland evaluate --weights ship --kind ship --scenes 2000 --frames 5 --seed 1000000 --keep-boxes --out out/boxes
python tools/tune_confirmation.py out/boxes/scenes.jsonl --kind ship
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipland.camera import Camera, CameraParameters
from shipland.config import build
from shipland.learning.ranges import SceneRecord, SureBox, hits
from shipland.learning.synth import FRAME_S
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.rig import packaged_table
from shipland.vision.far.decode import PIXEL_CENTRE
from shipland.vision.far.detector import Detector, DetectorParameters, Picture, detector_parameters
from shipland.vision.far.far import FarVision


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


def replayed(
    records: Sequence[SceneRecord], kind: str, camera: Camera, parameters: DetectorParameters, min_iou: float
) -> tuple[float, float]:
    """Share of the targets that a believed track gave in some frame, and false boxes in 1,000 frames."""
    picture = np.zeros((camera.height_px, camera.width_px, 3), np.uint8)
    detector = KeptBoxes()
    far = FarVision(detector if kind == "ship" else None, detector if kind == "bar" else None, camera, parameters)
    found = false = targets = frames = 0
    for record in records:
        far.reset()
        confirmed = False
        for number, rows in enumerate(record.frames):
            detector.boxes = [box_of(row) for row in rows]
            seen = far.see(Frame(FRAME_S * number, picture, GimbalAttitude(*record.gimbal_rad)))
            box = seen.ship_box if kind == "ship" else seen.bar_box
            frames += 1
            if box is None:
                continue
            row = (box.centre_px[0] + PIXEL_CENTRE, box.centre_px[1] + PIXEL_CENTRE, *box.size_px)
            right = hits(row, record.believed[number][0], min_iou)
            confirmed |= right
            false += not right
        targets += record.target is not None
        found += confirmed and record.target is not None
    return found / max(targets, 1), 1000.0 * false / max(frames, 1)


def main() -> None:
    """Replay, and print the best settings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--kind", choices=("ship", "bar"), default="ship")
    parser.add_argument("--iou", type=float, default=0.3)
    parser.add_argument("--farthest-m", type=float, default=np.inf, help="leave out targets beyond")
    parser.add_argument("--clearest-from-m", type=float, default=0.0, help="leave out air of a lower visibility")
    parser.add_argument("--most-false", type=float, default=1.0, help="in 1,000 frames; the table is sorted by recall")
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
    camera = Camera.from_parameters(build(CameraParameters, packaged_table("camera"), "camera"))
    shipped = detector_parameters()
    seen = [record for record in records if record.target is not None]
    single = {
        confidence: np.mean(
            [any(row[4] >= confidence and hits(row, r.target, arguments.iou) for row in r.boxes) for r in seen]
        )
        for confidence in (0.3, 0.4, 0.5)
    }
    print(
        f"{len(records)} scenes, {len(seen)} with the target; recall of the first frame alone at IoU {arguments.iou:g}:"
    )
    print(", ".join(f"{recall:.3f} at confidence {confidence:g}" for confidence, recall in single.items()), "\n")
    rows = []
    grid = itertools.product((2, 3), (0.15, 0.3), (0.2, 0.35, 0.45, 0.55, 0.65), (1.5, 2.0, 3.0, 4.0, 5.0), (0.5, 1.0))
    for count, start, neutral, believe, miss in grid:
        old = getattr(shipped, arguments.kind)
        new = replace(
            old,
            confirm_hits=count,
            confirm_frames=max(count + 1, old.confirm_frames),
            start_confidence=start,
            track_confidence=min(start, 0.15),
            neutral_confidence=neutral,
            believe_evidence=believe,
            miss_evidence=miss,
        )
        parameters = replace(shipped, **{arguments.kind: new})
        rows.append(
            (
                *replayed(records, arguments.kind, camera, parameters, arguments.iou),
                count,
                start,
                neutral,
                believe,
                miss,
            )
        )
    rows.sort(key=lambda row: (row[1] > arguments.most_false, -row[0], row[1]))
    recall, false = replayed(records, arguments.kind, camera, shipped, arguments.iou)
    print("| recall | false, 1,000 frames | hits | start | neutral | evidence | miss |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    print(f"| {recall:.3f} | {false:.1f} | as packaged | | | | |")
    for row in rows[:15]:
        print("| {:.3f} | {:.1f} | {} | {:g} | {:g} | {:g} | {:g} |".format(*row))


if __name__ == "__main__":
    main()
