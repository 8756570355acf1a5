"""How far something long has come: a bar on a terminal, elsewhere a line every so often."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

T = TypeVar("T")
LINE_EVERY_S = 15.0


def followed(items: Iterable[T], description: str, total: int, done: int = 0) -> Iterator[T]:
    """The items, one by one, while what is done is shown on standard error; an item that is text is shown as a note.

    Args:
        items: what is worked through.
        description: of the work.
        total: number of items, with those already done.
        done: items done before.
    """
    console = Console(stderr=True)
    if console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, TextColumn("{task.fields[note]}"), console=console, refresh_per_second=1) as bar:
            task = bar.add_task(description, total=total, completed=done, note="")
            for item in items:
                bar.update(task, advance=1, note=item if isinstance(item, str) else "")
                yield item
        return
    began = last = time.monotonic()
    for number, item in enumerate(items, done + 1):
        now = time.monotonic()
        if now - last >= LINE_EVERY_S or number == total:
            last = now
            note = f"  {item}" if isinstance(item, str) else ""
            print(f"{description}: {number} of {total} after {now - began:.0f} s{note}", file=sys.stderr, flush=True)
        yield item
