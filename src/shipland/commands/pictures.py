"""What `see` and `detect` share: files in; lines, JSON, CSV and drawings out."""

from __future__ import annotations

import csv
import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipland.commands.options import Paths, say

if TYPE_CHECKING:
    from shipland.errors import DataError
    from shipland.report.drawings import Drawings
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


def look(
    options: PictureOptions,
    columns: Sequence[str],
    draw: Callable[[Any], Picture],
    results: Callable[[Callable[[Path, DataError], None]], Iterable[SeeResult | DetectResult]],
) -> int:
    """Print, tabulate and draw results one by one.

    Standard error says at the end how much was found, and every few seconds how far it is where standard output is no
    terminal.

    Args:
        options: of the command.
        columns: of the table.
        draw: makes the drawing of a result.
        results: the results, given what names a picture that cannot be looked at.

    Returns:
        The exit code: 0; 1 when something could not be looked at, 2 when nothing could.
    """
    said_s, looked_at, found, failed = time.monotonic(), 0, 0, 0

    def broken(_path: Path, error: DataError) -> None:
        nonlocal failed
        failed += 1
        say(f"shipland: {error}")

    with ExitStack() as stack:
        for result in results(broken):
            if not looked_at:  # files of before stay where nothing can be looked at
                table, drawings = _opened(options, columns, stack)
            looked_at, found = looked_at + 1, found + result.found
            print(json.dumps(result.to_json()) if options.json else result.to_line(), flush=True)
            if table is not None:
                table.writerows(result.to_rows())
            if drawings is not None:
                drawings.add(result.picture, draw(result))
            if not sys.stdout.isatty() and time.monotonic() - said_s > _PROGRESS_S:
                said_s = time.monotonic()
                say(f"{result.picture.name}: {result.picture.progress}")
    if looked_at > 1:
        written = [str(path) for path in (options.csv, options.out) if path is not None]
        files = f"; written: {', '.join(written)}" if written else ""
        say(f"found in {found} of {looked_at} pictures{files}")
    return 0 if not failed else 1 if looked_at else 2


def _opened(
    options: PictureOptions, columns: Sequence[str], stack: ExitStack
) -> tuple[csv.DictWriter[str] | None, Drawings | None]:
    from shipland.report.drawings import Drawings

    table = None
    if options.csv is not None:
        with suppress(OSError):  # open says why not
            options.csv.parent.mkdir(parents=True, exist_ok=True)
        # a file's name may hold bytes that are no UTF-8
        file = stack.enter_context(options.csv.open("w", newline="", encoding="utf-8", errors="surrogateescape"))
        table = csv.DictWriter(file, columns, lineterminator="\n")
        table.writeheader()
    return table, None if options.out is None else stack.enter_context(Drawings(options.out))
