"""What the geometric camera needs to know of a detector: missed frames and errors of boxes over range.

    shipland evaluate --weights ship --kind ship --count 240 --frames 3 --keep-boxes --out out/boxes
    python tools/fit_boxes.py out/boxes/scenes.jsonl --kind ship

Prints the lists of `[geometric.ship]` or `[geometric.bar]` in geometric.py, and how many frames they rest on.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import tyro

from shipland.geometric import GeometricParameters
from shipland.learning.ranges import SceneRecord, hits
from shipland.vision.parameters import detector_parameters

MIN_IOU = 0.3


def half_spread(values: np.ndarray) -> float:
    """Half of what 68 % of the values lie within: a standard deviation that a few outliers do not move."""
    return float(0.5 * np.diff(np.percentile(values, [16, 84]))[0])


def main(scenes: tyro.conf.Positional[Path], kind: Literal["ship", "bar"] = "ship") -> None:
    """Count frames about each range of the packaged table; boxes as sure as in flight (acquire_confidence)."""
    least = detector_parameters().acquire_confidence
    records = [SceneRecord.from_json(line, str(scenes)) for line in scenes.read_text(encoding="utf-8").splitlines()]
    packaged = getattr(GeometricParameters(), kind)
    ranges_m = np.array(packaged.range_m)
    frames: list[int] = []
    rows: dict[str, list[float]] = {"miss_rate": [], "centre_px": [], "area": []}
    for number in range(len(ranges_m)):
        seen, off, ratio = 0, [], []
        for record in records:
            if int(np.abs(ranges_m - record.range_m).argmin()) != number:
                continue
            for (target, _), boxes in zip(record.believed, record.frames, strict=True):
                if target is None:
                    continue
                seen += 1
                found = [box for box in boxes if box[4] >= least and hits(box, target, MIN_IOU)]
                if found:
                    best = max(found, key=lambda box: box[4])
                    off.append((best[0] - target[0], best[1] - target[1]))
                    ratio.append(np.log(best[2] * best[3] / (target[2] * target[3])))
        if not off:
            raise SystemExit(f"no box about {ranges_m[number]:g} m: look at more scenes")
        errors_px = np.array(off)
        frames.append(seen)
        rows["miss_rate"].append(round(1.0 - len(off) / seen, 2))
        rows["centre_px"].append(round(np.mean([half_spread(errors_px[:, 0]), half_spread(errors_px[:, 1])]), 1))
        rows["area"].append(round(half_spread(np.array(ratio)), 2))
    print(f"# {len(records)} scenes; frames with the target about each range: {frames}")
    print(f"range_m = {list(map(float, ranges_m))}")
    for name, values in rows.items():
        print(f"{name} = {list(map(float, values))}")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
