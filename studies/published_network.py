"""The detectors trained as published, beside the shipped ones: the same scenes, single frames.

The weights are what `tools/train_published.sh` leaves in out/train-published: YOLOv3 with the published anchors,
decoding and loss, on 2,000 and 1,000 whole pictures shrunk to 416 px. They look at pictures shrunk alike, as
published, and at the camera's own pixels, as ours do.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from shipland.errors import DataError
from shipland.files import write_with_digest
from shipland.learning.arguments import EvaluateArguments
from shipland.learning.evaluate import evaluate
from shipland.vision.far.decode import DetectorSpec
from shipland.vision.far.runtime import METADATA_KEY
from studies.far_vision import BINS, CONFIDENCE, SCENES, SEED, of_range, together
from studies.far_vision import STUDY as SHIPPED
from studies.harness import ROOT, Case, Column, Row, Study

WEIGHTS = ROOT / "out" / "train-published"
OURS, SHRUNK, OWN = "shipped", "as published, shrunk to 416 px", "as published, own pixels"


def cases() -> Sequence[Case]:
    """What is looked for, and who looks."""
    return [{"kind": kind, "network": network} for kind in SCENES for network in (OURS, SHRUNK, OWN)]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` scenes of the ship, half as many of the bar; rows of all ranges together, by air, and of each range.

    Raises:
        DataError: out/train-published has no weights.
    """
    network, kind = case["network"], case["kind"]
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "bins.toml"
        config.write_text(BINS, encoding="utf-8")
        trained = WEIGHTS / f"{kind}.onnx"
        if network == OWN:
            trained = at_own_pixels(trained, Path(folder) / trained.name)
        asked = EvaluateArguments(
            weights=kind if network == OURS else str(trained),
            kind=kind,
            count=max(round(SCENES[kind] * runs), 8),
            frames=1,
            confidence=CONFIDENCE,
            seed=SEED,
            config=config,
            out=Path(folder) / "out",
        )
        found = evaluate(asked)
    about = {"trained": found.detector.partition(", ")[2]}
    whole = [_kept({"group": "together", "air": air, **together(table)}) for air, table in found.tables.items()]
    bins = [_kept({"group": "ranges", "air": "all", **of_range(each)}) for each in found.tables["all"].bins]
    return [{**row, **about} for row in whole + [row for row in bins if row["scenes"]]]


def at_own_pixels(weights: Path, path: Path) -> Path:
    """A copy of a detector that looks at pictures as they are; its path."""
    import onnx

    if not weights.is_file():
        raise DataError(f"{weights} is missing: tools/train_published.sh {WEIGHTS.relative_to(ROOT)}")
    model = onnx.load(str(weights))
    (text,) = (item.value for item in model.metadata_props if item.key == METADATA_KEY)
    spec = replace(DetectorSpec.from_json(text, str(weights)), fit_px=0)
    onnx.helper.set_model_props(model, {METADATA_KEY: spec.to_json()})
    write_with_digest(path, bytes(model.SerializeToString()))
    return path


def _kept(row: dict[str, Any]) -> dict[str, Any]:
    """Without what is left out."""
    return {key: value for key, value in row.items() if not LEFT_OUT & {*key.split("_")}}


LEFT_OUT = {"confirmed", "believed", "area"}
"""In the names of columns of several frames, and of what few boxes tell."""
COLUMNS = {name: column for name, column in SHIPPED.columns.items() if not LEFT_OUT & {*name.split("_")}}
STUDY = Study(
    question="How far do the networks see ship and bar that are trained as the paper and YOLOv3 say?",
    columns={"kind": COLUMNS["kind"], "network": Column("network"), **COLUMNS, "trained": Column("weights")},
    cases=cases,
    measure=measure,
    runs=160,
    minutes=40,
)
