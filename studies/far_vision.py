"""How far single frames show ship and bar, and what three frames believe: fresh scenes of the simulator, haze included.

`shipland evaluate` with the shipped weights, three consecutive frames a scene at 10 Hz; a hit is an overlap (IoU) of
0.3 or more. Few scenes: the intervals are wide.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shipland.learning.arguments import EvaluateArguments
from shipland.learning.evaluate import evaluate
from shipland.learning.ranges import RangeBin, RangeTable
from studies.harness import Case, Column, Row, Study

SCENES = {"ship": 1.0, "bar": 0.5}
"""Share of the scenes, by what is looked for."""
BINS = "[evaluate]\nship_bin_m = 50.0\nbar_bin_m = 25.0\n"
FRAMES, CONFIDENCE, SEED = 3, 0.5, 2000000


def cases() -> Sequence[Case]:
    """What is looked for."""
    return [{"kind": kind} for kind in SCENES]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` scenes of the ship, half as many of the bar; rows of all ranges together and of each, by air."""
    kind = str(case["kind"])
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "bins.toml"
        config.write_text(BINS, encoding="utf-8")
        scenes, out = max(round(SCENES[kind] * runs), 8), Path(folder) / "out"
        asked = EvaluateArguments(
            weights=kind,
            kind=kind,
            count=scenes,
            frames=FRAMES,
            confidence=CONFIDENCE,
            seed=SEED,
            config=config,
            out=out,
        )  # type: ignore[arg-type]
        tables = evaluate(asked).tables
    whole: list[Row] = [{"group": "together", "air": air, **together(table)} for air, table in tables.items()]
    return whole + [{"group": "ranges", "air": "all", **of_range(each)} for each in tables["all"].bins if each.scenes]


def together(table: RangeTable) -> dict[str, Any]:
    """Of all ranges."""
    return {
        "scenes": table.scenes,
        "empty": table.empty,
        "average_precision": table.average_precision,
        "recall": _none(table.recall),
        "confirmed": _none(table.confirmed),
        "false": table.false_per_frame,
        "false_believed": _none(1e-3 * table.false_believed_per_1000),
        "range_99_m": table.range_99_m,
        "range_50_m": table.range_50_m,
    }


def of_range(found: RangeBin) -> dict[str, Any]:
    """Of one bin; recall and confirmed with their intervals."""
    return {
        "range": f"{found.low_m:g}–{found.high_m:g}",
        "scenes": found.scenes,
        "width_px": _none(found.width_px),
        "recall": {"value": found.recall, "low": found.recall_low, "high": found.recall_high},
        "precision": _none(found.precision),
        "confirmed": {"value": found.confirmed, "low": found.confirmed_low, "high": found.confirmed_high},
        "believed_precision": _none(found.believed_precision),
        "centre_px": _none(found.centre_px),
        "centre_95_px": _none(found.centre_95_px),
        "area": f"{found.area_bias:+.0%} ± {found.area_std:.0%}",
    }


def _none(value: float) -> float | None:
    return None if math.isnan(value) else value


STUDY = Study(
    question="How far do the far detectors see the ship and the bar?",
    columns={
        "kind": Column("of"),
        "air": Column("air"),
        "range": Column("range [m]"),
        "scenes": Column("scenes", "d"),
        "empty": Column("of them empty", "d"),
        "width_px": Column("width [px]", ".0f"),
        "average_precision": Column("average precision", ".3f"),
        "recall": Column("recall (95 % interval)", ".3f"),
        "precision": Column("precision", ".3f"),
        "confirmed": Column("confirmed (95 % interval)", ".3f"),
        "believed_precision": Column("its precision", ".3f"),
        "centre_px": Column("centre, median [px]", ".2f"),
        "centre_95_px": Column("95 % [px]", ".2f"),
        "area": Column("area"),
        "false": Column("false boxes, 1,000 single frames", ".0f", 1e3),
        "false_believed": Column("1,000 frames after confirmation", ".1f", 1e3),
        "range_99_m": Column("99 % to [m]", "g"),
        "range_50_m": Column("50 % to [m]", "g"),
    },
    cases=cases,
    measure=measure,
    runs=240,
    minutes=6,
)
