"""What `see` and `detect` share: files in; lines, JSON, CSV and drawings out."""

from __future__ import annotations

import csv
import json
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipland.commands.options import Paths

if TYPE_CHECKING:
    from shipland.errors import DataError
    from shipland.vision.far.files import DetectResult
    from shipland.vision.near.files import SeeResult
    from shipland.vision.pictures import Picture

_PROGRESS_S = 5.0


@dataclass(frozen=True)
class PictureOptions:
    """Which pictures, and what becomes of the results."""

    paths: Paths
    """Pictures, folders of pictures, videos, flight logs (.mcap) that keep pictures."""
    json: bool = False
    """JSON lines instead of lines for people."""
    csv: Path | None = None
    """Table of the results, a row each; commas between, one line of column names."""
    out: Path | None = None
    """Folder for the pictures and videos with the results drawn on them."""


class Results:
    """Takes results one by one; a context manager.

    Standard error says at the end how much was found, and every few seconds how far it is where standard output is no
    terminal.
    """

    def __init__(self, options: PictureOptions, columns: Sequence[str], draw: Callable[[Any], Picture]) -> None:
        """`draw` makes the drawing of a result."""
        self._options, self._columns, self._draw = options, columns, draw
        self._stack = ExitStack()
        self._table: csv.DictWriter[str] | None = None
        self._drawings: Any = None
        self._said_s = time.monotonic()
        self._looked_at = self._found = self._failed = 0

    def __enter__(self) -> Results:
        return self

    def _open(self) -> None:
        """Make the files; those of before stay where nothing can be looked at."""
        from shipland.report.drawings import Drawings

        if self._options.csv is not None:
            with suppress(OSError):  # open says why not
                self._options.csv.parent.mkdir(parents=True, exist_ok=True)
            file = self._stack.enter_context(self._options.csv.open("w", newline="", encoding="utf-8"))
            self._table = csv.DictWriter(file, self._columns, lineterminator="\n")
            self._table.writeheader()
        if self._options.out is not None:
            self._drawings = self._stack.enter_context(Drawings(self._options.out))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._stack.close()
        if kind is None and self._looked_at > 1:
            written = [str(path) for path in (self._options.csv, self._options.out) if path is not None]
            files = f"; written: {', '.join(written)}" if written else ""
            print(f"found in {self._found} of {self._looked_at} pictures{files}", file=sys.stderr)

    def broken(self, path: Path, error: DataError) -> None:  # noqa: ARG002 - the error names it
        """Name what cannot be looked at."""
        self._failed += 1
        print(f"shipland: {error}", file=sys.stderr, flush=True)

    @property
    def exit_code(self) -> int:
        """0; 1 when something could not be looked at, 2 when nothing could."""
        return 0 if not self._failed else 1 if self._looked_at else 2

    def add(self, result: SeeResult | DetectResult) -> None:
        """Print, tabulate and draw one."""
        if not self._looked_at:
            self._open()
        self._looked_at += 1
        self._found += result.found
        print(json.dumps(result.to_json()) if self._options.json else result.to_line(), flush=True)
        if self._table is not None:
            self._table.writerows(result.to_rows())
        if self._drawings is not None:
            self._drawings.add(result.picture, self._draw(result))
        if not sys.stdout.isatty() and time.monotonic() - self._said_s > _PROGRESS_S:
            self._said_s = time.monotonic()
            print(f"{result.picture.name}: {result.picture.progress}", file=sys.stderr, flush=True)
