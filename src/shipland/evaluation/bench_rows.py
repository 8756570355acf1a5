"""Rows of a bench as one Parquet file: a row a flight, with the conditions that it drew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shipland.evaluation.bench import CellResult
from shipland.evaluation.landing import row_of


def write_rows(path: Path, cells: Sequence[CellResult]) -> None:
    """Write `flights.parquet`; empty texts of numbers that a flight does not have become nulls."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    keys = list(dict.fromkeys(key for cell in cells for key, _ in cell.settings))
    rows: list[dict[str, Any]] = []
    for cell in cells:
        settings = dict(cell.settings)
        head: dict[str, Any] = {
            "suite": cell.suite,
            "cell": cell.name,
            "scenario": cell.scenario,
            "pilot": cell.pilot,
        }
        head |= {"vision": cell.vision} | {key: settings.get(key) for key in keys}
        rows += [head | {key: _null(value) for key, value in row_of(it).items()} for it in cell.landings]
    if rows:
        part = path.with_suffix(".part")
        pq.write_table(pa.Table.from_pylist(rows), part, compression="zstd")
        part.replace(path)


def _null(value: object) -> object:
    return None if isinstance(value, str) and value == "" else value
