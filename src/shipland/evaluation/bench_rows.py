"""Rows of a campaign as one table: a row a flight, with its cell's settings and the conditions that it drew."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from shipland.evaluation.bench import CellResult
from shipland.evaluation.landing import COLUMNS, row_of


def write_rows(path: Path, cells: Sequence[CellResult]) -> None:
    """Write `flights.csv`; numbers that a flight does not have are empty."""
    keys = list(dict.fromkeys(key for cell in cells for key, _ in cell.settings))
    part = path.with_suffix(".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        head = ["suite", "cell", "scenario", "pilot", "vision"]
        rows = csv.DictWriter(file, [*head, *keys, *COLUMNS], restval="", lineterminator="\n")
        rows.writeheader()
        for cell in cells:
            beside = {"suite": cell.suite, "cell": cell.name, "scenario": cell.scenario, "pilot": cell.pilot}
            beside |= {"vision": cell.vision} | dict(cell.settings)
            rows.writerows(beside | row_of(landing) for landing in cell.landings)
    part.replace(path)
