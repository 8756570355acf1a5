"""The flights of a campaign's page: each with its outcome, its files, and the command that flies it again."""

from __future__ import annotations

import html
import json
import math
import os
import shlex
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from shipland.evaluation.campaign import CellResult
from shipland.evaluation.landing import Landing
from shipland.report.pages import page_file


class PageFlights:
    """All flights, numbered as the page's charts number them.

    Args:
        cells: with landings.
        folder: where the page will lie; links go from there.
    """

    def __init__(self, cells: Sequence[CellResult], folder: Path) -> None:
        self._cells, self._folder = cells, folder
        self.flights = [(cell, landing) for cell in cells for landing in cell.landings]
        failures = Counter(landing.cause for _, landing in self.flights if not landing.success)
        self._outcomes = ["", *(cause for cause, _ in failures.most_common())]
        self._count = failures | Counter({"": sum(landing.success for _, landing in self.flights)})

    def outcome(self, landing: Landing) -> int:
        """Number of a flight's outcome: 0 landed in the square, then causes, the most frequent first."""
        return 0 if landing.success else self._outcomes.index(landing.cause)

    def filters(self, area: str) -> str:
        """A box an outcome, for the script."""
        boxes = "".join(
            f'<label><input type="checkbox" checked value="{at}">'
            f"{html.escape(cause or f'landed in the {area}')} ({self._count[cause]})</label>"
            for at, cause in enumerate(self._outcomes)
            if self._count[cause]
        )
        return (
            f'<div id="outcomes" class="only-script">{boxes}<br><span class="dim">Point at a landing to see which it '
            "is; click it for its files and the command that flies it again.</span></div>"
        )

    def again(self, at: int) -> str:
        """Links to what there is of a flight, and the command that flies it again."""
        files = "".join(f'<a href="{html.escape(path, quote=True)}">{name}</a> ' for name, path in self._files(at))
        cell, landing = self.flights[at]
        command = f"{_again(cell)}{landing.seed}" if _again(cell) else ""
        return f"{files or 'no log '}<code>{html.escape(command)}</code>"

    def data_and_script(self) -> str:
        """What the script reads, and the script."""
        cells = [
            {"name": cell.name, "pilot": cell.pilot, "version": cell.version, "again": _again(cell)}
            for cell in self._cells
        ]
        index, rows = {id(cell): at for at, cell in enumerate(self._cells)}, []
        for at, (cell, landing) in enumerate(self.flights):
            figures = [landing.error_m, landing.sink_mps, landing.tilt_deg, landing.time_s]
            rows.append([
                index[id(cell)], landing.seed, self.outcome(landing),
                *(round(value, 3) if math.isfinite(value) else None for value in figures),
                "" if landing.success else landing.reason, self._files(at),
            ])  # fmt: skip
        data = json.dumps({"cells": cells, "outcomes": self._outcomes, "flights": rows}, separators=(",", ":"))
        quiet, script = data.replace("<", "\\u003c"), page_file("page.js")  # what ends a script must not stand in it
        return (
            '<div id="tip"></div><div id="flight"></div>'
            f'<script type="application/json" id="flights">{quiet}</script><script>{script}</script>'
        )

    def _files(self, at: int) -> list[tuple[str, str]]:
        """Name and path of the log and the film of a flight, where they lie."""
        cell, landing = self.flights[at]
        if cell.logs is None:
            return []
        film, made = cell.logs / str(landing.seed) / "flight.mp4", cell.logs / f"{landing.seed}.mcap"
        return [
            (name, Path(os.path.relpath(path, self._folder)).as_posix())
            for name, path in (("log", made), ("film", film))
            if path.is_file()
        ]


def _again(cell: CellResult) -> str:
    """What flies a seed of it again, before that number; empty where it lies in no folder."""
    return "" if cell.logs is None else f"shipland again {shlex.quote(cell.logs.parent.as_posix())} --video --seed "
