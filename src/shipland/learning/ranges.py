"""What a detector saw, scene by scene, and the table over range that follows from it."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from shipland.config import build
from shipland.errors import ConfigError, DataError
from shipland.files import json_of
from shipland.learning.metrics import Tally
from shipland.statistics import share_interval
from shipland.vision.far.decode import iou

BoxRow = tuple[float, float, float, float]
"""Centre column, centre row, width, height [px, edges at whole numbers]."""
SureBox = tuple[float, float, float, float, float]
"""A box and its confidence."""


@dataclass(frozen=True)
class SceneRecord:
    """One scene: what was there and what was said.

    Attributes:
        range_m: distance from the camera to the target's centre; as drawn, for an empty scene.
        decoys: number of things in sight that are not the target.
        target: the target's box in the first frame; None where it is not to be seen.
        boxes: all boxes of the first frame, down to a low confidence.
        believed: for each frame the target's box and the box that a believed track gave.
        gimbal_rad: roll and pitch of the camera.
        frames: all boxes of every frame, down to a low confidence, where they were kept.
        heights_m: the camera's height in every frame, as a barometer tells it.
    """

    number: int
    range_m: float
    visibility_m: float
    decoys: int
    target: BoxRow | None
    boxes: tuple[SureBox, ...]
    believed: tuple[tuple[BoxRow | None, SureBox | None], ...] = ()
    gimbal_rad: tuple[float, float] = (0.0, 0.0)
    frames: tuple[tuple[SureBox, ...], ...] = ()
    heights_m: tuple[float, ...] = ()

    def count(self, tally: Tally) -> None:
        """Take the first frame into a tally."""
        boxes = np.array(self.boxes, np.float32).reshape(-1, 5)
        targets = np.array([] if self.target is None else [(0.0, *self.target)], np.float32).reshape(-1, 5)
        tally.add(boxes[:, :4], boxes[:, 4], targets)

    def to_json(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(line: str, where: str) -> SceneRecord:
        """Read what `to_json` wrote; DataError names the place `where`."""
        try:
            return build(SceneRecord, json_of(line), where)
        except (ValueError, ConfigError) as error:
            raise DataError(f"{where}: no scene of `shipland evaluate`: {error}") from None


@dataclass(frozen=True)
class RangeBin:
    """Scenes whose target lies between two ranges.

    Attributes:
        low_m, high_m: the bin.
        scenes: with the target in sight.
        recall, recall_low, recall_high: of single frames, with Wilson's 95 % interval.
        precision: hits over boxes, single frames; NaN without boxes.
        confirmed: part of the scenes whose target a believed track gave in some frame; NaN when not measured.
        confirmed_low, confirmed_high: Wilson's 95 % interval.
        believed_precision: hits over boxes that a believed track gave, all frames; NaN without boxes.
        width_px: median width of the target.
        centre_px, centre_95_px: median and 95th percentile of the distance between box and target; NaN without hits.
        area_bias, area_std: median of the boxes' area over the target's, less one, and half the width of its
            central 68 %.
    """

    low_m: float
    high_m: float
    scenes: int
    recall: float
    recall_low: float
    recall_high: float
    precision: float
    confirmed: float
    confirmed_low: float
    confirmed_high: float
    believed_precision: float
    width_px: float
    centre_px: float
    centre_95_px: float
    area_bias: float
    area_std: float


@dataclass(frozen=True)
class RangeTable:
    """Bins over range and what holds over all of them.

    Attributes:
        bins: from near to far.
        scenes, empty: scenes in all, and those without a target in sight.
        false_per_frame: boxes that hit nothing, a single frame, over all scenes.
        false_believed_per_1000: believed boxes that hit nothing, in 1,000 frames; NaN when not measured.
        frames: frames that `false_believed_per_1000` was counted on.
        recall, confirmed: as in a bin, over all scenes with the target in sight.
        average_precision: over all single frames.
        range_99_m: upper edge of the farthest bin up to which all scenes together have a recall of 99 %.
        range_50_m: upper edge of the last bin before recall first falls below 50 %.
    """

    bins: tuple[RangeBin, ...]
    scenes: int
    empty: int
    false_per_frame: float
    false_believed_per_1000: float
    frames: int
    recall: float
    confirmed: float
    average_precision: float
    range_99_m: float
    range_50_m: float


def hits(box: Sequence[float], target: BoxRow | None, min_iou: float) -> bool:
    """Whether a box overlaps the target enough."""
    if target is None:
        return False
    return bool(iou(np.array([box[:4]], float), np.array([target], float))[0, 0] >= min_iou)


def range_table(
    records: Sequence[SceneRecord], edges_m: Sequence[float], confidence: float, min_iou: float
) -> RangeTable:
    """The bins between rising edges: a single frame's box counts from `confidence` on, as a hit from `min_iou` on."""
    tally = Tally(min_iou)
    for record in records:
        record.count(tally)
    believed = [(target, box) for record in records for target, box in record.believed]
    false_believed = sum(box is not None and not hits(box, target, min_iou) for target, box in believed)
    everything = _bin(edges_m[0], edges_m[-1], list(records), confidence, min_iou)
    bins = tuple(
        _bin(low_m, high_m, [item for item in records if low_m <= item.range_m < high_m], confidence, min_iou)
        for low_m, high_m in itertools.pairwise(edges_m)
    )
    return RangeTable(
        bins=bins,
        scenes=len(records),
        empty=sum(record.target is None for record in records),
        false_per_frame=tally.false_per_picture(confidence),
        false_believed_per_1000=1000.0 * false_believed / len(believed) if believed else float("nan"),
        frames=len(believed),
        recall=everything.recall,
        confirmed=everything.confirmed,
        average_precision=tally.average_precision(),
        range_99_m=_reach_together(bins, 0.99),
        range_50_m=_reach(bins, 0.5),
    )


def _bin(low_m: float, high_m: float, records: list[SceneRecord], confidence: float, min_iou: float) -> RangeBin:
    seen = [record for record in records if record.target is not None]
    found: list[tuple[BoxRow, SureBox]] = []
    false = 0
    for record in records:
        sure = [box for box in record.boxes if box[4] >= confidence]
        good = [box for box in sure if hits(box, record.target, min_iou)]
        if good and record.target is not None:
            found.append((record.target, max(good, key=lambda box: box[4])))
        false += len(sure) - (1 if good else 0)
    tracked = [record for record in seen if record.believed]
    confirmed = sum(
        any(box is not None and hits(box, target, min_iou) for target, box in record.believed) for record in tracked
    )
    believed = [(target, box) for record in records for target, box in record.believed if box is not None]
    right = sum(hits(box, target, min_iou) for target, box in believed)
    off = np.array([np.hypot(box[0] - target[0], box[1] - target[1]) for target, box in found])
    ratio = np.array([box[2] * box[3] / (target[2] * target[3]) - 1.0 for target, box in found])
    nan = float("nan")
    return RangeBin(
        low_m,
        high_m,
        len(seen),
        _share(len(found), len(seen)),
        *share_interval(len(found), len(seen), "wilson"),
        _share(len(found), len(found) + false),
        _share(confirmed, len(tracked)),
        *share_interval(confirmed, len(tracked), "wilson"),
        _share(right, len(believed)),
        width_px=float(np.median([record.target[2] for record in seen if record.target])) if seen else nan,
        centre_px=float(np.median(off)) if len(off) else nan,
        centre_95_px=float(np.percentile(off, 95)) if len(off) else nan,
        area_bias=float(np.median(ratio)) if len(ratio) else nan,
        area_std=float(0.5 * np.diff(np.percentile(ratio, [16, 84]))[0]) if len(ratio) else nan,
    )


def _share(count: int, of: int) -> float:
    return count / of if of else float("nan")


def _reach(bins: Sequence[RangeBin], recall: float) -> float:
    """Upper edge of the last bin before recall first falls below; 0 where the nearest bin does. Empty bins pass."""
    reach_m = 0.0
    for item in bins:
        if item.scenes and item.recall < recall:
            break
        if item.scenes:
            reach_m = item.high_m
    return reach_m


def _reach_together(bins: Sequence[RangeBin], recall: float) -> float:
    """Upper edge of the farthest bin up to which all scenes together have this recall; 0 where there is none.

    A bin alone holds too few scenes for 99 %: one miss in ninety breaks it.
    """
    reach_m, scenes, found = 0.0, 0, 0.0
    for item in bins:
        if item.scenes:
            scenes += item.scenes
            found += item.scenes * item.recall
            reach_m = item.high_m if found >= recall * scenes - 1e-9 else reach_m
    return reach_m


def summary(tables: Mapping[str, RangeTable]) -> str:
    """What holds over all ranges, a line a condition, GitHub's Markdown."""
    lines = [
        "| | scenes (empty) | average precision | recall | confirmed | false boxes, 1,000 single frames | "
        "1,000 frames after confirmation | 99 % to [m] | 50 % to [m] |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, table in tables.items():
        lines.append(
            f"| {name} | {table.scenes} ({table.empty}) | {table.average_precision:.3f} | "
            f"{_number(table.recall, '.3f')} | {_number(table.confirmed, '.3f')} | "
            f"{1000.0 * table.false_per_frame:.0f} | {_number(table.false_believed_per_1000, '.1f')} | "
            f"{table.range_99_m:g} | {table.range_50_m:g} |"
        )
    return "\n".join(lines)


def markdown(table: RangeTable) -> str:
    """The table for people, GitHub's Markdown."""
    lines = [
        "| range [m] | scenes | width [px] | recall (95 %) | precision | confirmed (95 %) | its precision | "
        "centre, median / 95 % [px] | area |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for item in table.bins:
        if not item.scenes:
            continue
        interval = "" if np.isnan(item.confirmed) else f" ({item.confirmed_low:.2f}–{item.confirmed_high:.2f})"
        confirmed = f"{_number(item.confirmed, '.3f')}{interval}"
        lines.append(
            f"| {item.low_m:g}–{item.high_m:g} | {item.scenes} | {item.width_px:.0f} | "
            f"{item.recall:.3f} ({item.recall_low:.2f}–{item.recall_high:.2f}) | {_number(item.precision, '.3f')} | "
            f"{confirmed} | {_number(item.believed_precision, '.3f')} | "
            f"{_number(item.centre_px, '.2f')} / {_number(item.centre_95_px, '.2f')} | "
            f"{_number(100.0 * item.area_bias, '+.0f')} ± {_number(100.0 * item.area_std, '.0f')} % |"
        )
    return "\n".join(lines)


def _number(value: float, form: str) -> str:
    return "–" if np.isnan(value) else format(value, form)
