"""What a far detector takes for its target and what it misses, picture by picture, and how far the missed stand out.

    shipland evaluate --weights ship --kind ship --scenes 480 --frames 10 --seed 5000000 --keep-boxes --out out/boxes
    python tools/far_mistakes.py out/boxes              # every scene with its target is drawn again, with and without

A mistake is one of the far vision's, of a whole scene: boxes that it believed and that do not fit the target, and
targets that it never believed. How far a target stands out is the root mean square of what it changes in its box, in
grey levels, against the same picture without it. Scenes are replayed with the packaged settings. Writes mistakes.csv,
table.md and mistakes.png: above what was believed and does not fit, below what was missed.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import groupby, pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from studies.views import markdown
from rich.progress import track
from tune_confirmation import replayed_boxes

from shipland.camera import Camera
from shipland.learning.decoys import foot_box_px
from shipland.learning.evaluate import EvaluateParameters, fresh_scenes
from shipland.learning.metrics import wilson_interval
from shipland.learning.ranges import BoxRow, SceneRecord, SureBox, hits
from shipland.learning.ship_and_camera import ShipAndCamera
from shipland.learning.shot import Shot
from shipland.learning.shots import draw_scene, draw_shot
from shipland.learning.synth import FRAME_S, draw
from shipland.sim.scene.scene import Scene
from shipland.vision.far.parameters import detector_parameters

Picture = npt.NDArray[np.uint8]
LEVELS = (0.0, 4.0, 8.0, 16.0, 32.0, 256.0)
"""Edges of the table's bins [grey levels]."""
AWAY_M = 1e5
TOUCHING = 1e-3
TILE_PX = 152
TILES = 16
"""In each half of the sheet."""


@dataclass(frozen=True)
class Judged:
    """One scene, a row of mistakes.csv.

    Attributes:
        scene: its number.
        mistake: missed, false, loose, or nothing.
        like: what a false box lies on: a decoy's kind, or sea and sky.
        range_m, visibility_m: of the target as drawn, and of the air.
        width_px: of the target in the first frame.
        levels: how far the target stands out [grey levels]; NaN for an empty scene.
        seen: whether a single frame's box of confidence 0.5 hit it, in the first frame.
        frame: in which the mistake was made first.
        confidence: of that box.
    """

    scene: int
    mistake: str
    like: str
    range_m: float
    visibility_m: float
    width_px: float
    levels: float
    seen: bool
    frame: int
    confidence: float


@dataclass(frozen=True)
class Redrawn:
    """What draws a scene of an evaluation again."""

    kind: str
    seed: int
    drawn: ShipAndCamera
    camera: Camera

    def look(self, records: Sequence[SceneRecord], min_iou: float) -> list[tuple[Judged, Picture | None]]:
        """Judge scenes that share light and sea; with each mistake its place in the picture, enlarged."""
        parameters = EvaluateParameters()
        synth = fresh_scenes(parameters)
        light, waves = draw_scene(records[0].number // synth.pictures_per_scene, synth, self.seed)
        scene = Scene(self.drawn.rig, light, np.random.default_rng(waves))
        judged = []
        try:
            for record in records:
                shot = draw_shot(record.number, self.kind, light, self.camera, self.drawn.rig, synth, self.seed)  # type: ignore[arg-type]
                mistake, frame, box = mistake_of(record, self.kind, self.camera, min_iou)
                t_s = FRAME_S * frame
                picture, _ = draw(shot, t_s, scene, self.camera, self.drawn.rig, synth)
                levels = float("nan")
                if record.target is not None:
                    first = picture if frame == 0 else draw(shot, 0.0, scene, self.camera, self.drawn.rig, synth)[0]
                    away = replace(shot, ship_position_in_ned_m=shot.ship_position_in_ned_m - [AWAY_M, 0.0, 0.0])
                    without, _ = draw(away, 0.0, scene, self.camera, self.drawn.rig, synth)
                    levels = apart(first, without, record.target)
                like = self.like(shot, t_s, box) if mistake == "false" and box is not None else ""
                row = Judged(
                    record.number,
                    mistake,
                    like,
                    round(record.range_m, 1),
                    round(record.visibility_m),
                    float("nan") if record.target is None else round(record.target[2], 1),
                    round(levels, 2),
                    any(box[4] >= 0.5 and hits(box, record.target, min_iou) for box in record.boxes),
                    frame,
                    0.0 if box is None else box[4],
                )
                place = box if box is not None else record.target
                judged.append((row, enlarged(picture, place[:4]) if mistake and place is not None else None))
        finally:
            scene.close()
        return judged

    def like(self, shot: Shot, t_s: float, box: SureBox) -> str:
        """The kind of the decoy that a box lies on, its mirror image included; else sea and sky."""
        camera_from_ned = shot.at(t_s, self.drawn.rig).ned_from_camera.inverse()
        for decoy in shot.decoys:
            edges = foot_box_px(decoy, self.camera, camera_from_ned)
            if edges is None:
                continue
            left, top, right, bottom = edges
            mirror = 0.0 if decoy.kind == "bird" else bottom - top
            row = (0.5 * (left + right), 0.5 * (top + bottom + mirror), right - left, bottom + mirror - top)
            if hits(box, row, TOUCHING):
                return decoy.kind
        return "sea and sky"


def mistake_of(record: SceneRecord, kind: str, camera: Camera, min_iou: float) -> tuple[str, int, SureBox | None]:
    """What the far vision did wrong in a scene, in which frame, and the box; nothing, 0 and None where nothing."""
    told = replayed_boxes(record, kind, camera, detector_parameters())
    targets = [target for target, _ in record.believed]
    for name, touching in (("false", False), ("loose", True)):
        for frame, (box, target) in enumerate(zip(told, targets, strict=True)):
            if box is not None and not hits(box, target, min_iou) and hits(box, target, TOUCHING) is touching:
                return name, frame, box
    found = any(box is not None and hits(box, target, min_iou) for box, target in zip(told, targets, strict=True))
    return ("" if record.target is None or found else "missed"), 0, None


def apart(picture: Picture, without: Picture, target: BoxRow) -> float:
    """Root mean square of what the target changes in its box [grey levels]."""
    column, row, width, height = target
    part = np.s_[
        max(int(row - 0.5 * height), 0) : int(np.ceil(row + 0.5 * height)),
        max(int(column - 0.5 * width), 0) : int(np.ceil(column + 0.5 * width)),
    ]
    change = picture[part].astype(float) - without[part].astype(float)
    return float(np.sqrt(np.mean(change**2))) if change.size else float("nan")


def enlarged(picture: Picture, box: BoxRow) -> Picture:
    """A box and two and a half times as much around it, in a tile."""
    column, row, width, height = box
    half = max(1.25 * max(width, height), 12.0)
    margin = int(np.ceil(half)) + 1
    padded = cv2.copyMakeBorder(picture, margin, margin, margin, margin, cv2.BORDER_REFLECT)
    left, top = round(column - half) + margin, round(row - half) + margin
    side = round(2.0 * half)
    tile = cv2.resize(padded[top : top + side, left : left + side], (TILE_PX, TILE_PX), interpolation=cv2.INTER_NEAREST)
    scale, middle = TILE_PX / side, 0.5 * TILE_PX
    low = (round(middle - 0.5 * width * scale), round(middle - 0.5 * height * scale))
    high = (round(middle + 0.5 * width * scale), round(middle + 0.5 * height * scale))
    cv2.rectangle(tile, low, high, (40, 40, 230), 1)
    return np.asarray(tile, np.uint8)


def sheet(false: list[Picture], missed: list[Picture]) -> Picture:
    """Tiles, eight in a line: above the false and loose ones, below the missed."""
    rows = []
    for tiles in (false[:TILES], missed[:TILES]):
        full = [*tiles, *[np.full((TILE_PX, TILE_PX, 3), 255, np.uint8)] * (-len(tiles) % 8)]
        rows += [np.hstack(full[at : at + 8]) for at in range(0, len(full), 8)]
    return np.vstack(rows) if rows else np.full((TILE_PX, TILE_PX, 3), 255, np.uint8)


def text(judged: Sequence[Judged]) -> str:
    """Tables: recall by how far a target stands out, and mistakes by what they are."""
    there = [row for row in judged if np.isfinite(row.levels)]
    rows = []
    for low, high in pairwise(LEVELS):
        some = [row for row in there if low <= row.levels < high]
        if some:
            found = sum(row.mistake != "missed" for row in some)
            single = sum(row.seen for row in some)
            rows.append(
                [
                    f"{low:g}–{high:g}" if high < LEVELS[-1] else f"{low:g} and more",
                    str(len(some)),
                    *(f"{n / len(some):.3f} ({few:.2f}–{many:.2f})"
                      for n in (single, found) for few, many in [wilson_interval(n, len(some))]),
                    f"{np.median([row.width_px for row in some]):.0f}",
                ]
            )  # fmt: skip
    header = ["stands out by [grey levels]", "scenes", "single frame (95 %)", "within all frames (95 %)", "width [px]"]
    counts = Counter((row.mistake, row.like) for row in judged if row.mistake)
    kinds = [[mistake, like, str(n)] for (mistake, like), n in counts.most_common()]
    return markdown(header, rows) + "\n\n" + markdown(["mistake", "lies on", "scenes"], kinds)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of `shipland evaluate --keep-boxes`")
    parser.add_argument("--iou", type=float, default=0.3)
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    note = json.loads((folder / "evaluate.json").read_text(encoding="utf-8"))
    drawn = ShipAndCamera.packaged()
    redrawn = Redrawn(note["kind"], note["seed"], drawn, Camera.from_parameters(drawn.camera))
    lines = (folder / "scenes.jsonl").read_text(encoding="utf-8").splitlines()
    records = [SceneRecord.from_json(line, str(folder)) for line in lines]
    records = sorted((record for record in records if record.frames), key=lambda record: record.number)
    block = EvaluateParameters().pictures_per_scene
    blocks = [list(some) for _, some in groupby(records, lambda record: record.number // block)]
    looks = [look for some in track(blocks, "blocks of scenes") for look in redrawn.look(some, arguments.iou)]
    judged = [row for row, _ in looks]
    with (folder / "mistakes.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow([field.name for field in fields(Judged)])
        writer.writerows([getattr(row, field.name) for field in fields(Judged)] for row in judged if row.mistake)
    tiles = [(row, tile) for row, tile in looks if tile is not None]
    false = [tile for row, tile in tiles if row.mistake in ("false", "loose")]
    missed = [tile for row, tile in tiles if row.mistake == "missed"]
    cv2.imwrite(str(folder / "mistakes.png"), sheet(false, missed))
    told = text(judged)
    (folder / "table-mistakes.md").write_text(told + "\n", encoding="utf-8")
    print(told)


if __name__ == "__main__":
    main()
