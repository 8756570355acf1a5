"""How far something long has come: a bar in a terminal or a notebook, elsewhere a line every so often."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

T = TypeVar("T")
LINE_EVERY_S = 15.0


def followed(
    items: Iterable[T], description: str, total: int, done: int = 0, share: Callable[[], float] | None = None
) -> Iterator[T]:
    """The items, one by one, while what is done and the time left are shown on standard error.

    An item that is text is shown as a note.

    Args:
        items: what is worked through.
        description: of the work.
        total: number of items, with those already done.
        done: items done before.
        share: how much of the work is done by now, 0 … 1, where its end goes by something else than the items' number.
    """
    console = Console(stderr=True)
    begun_s = last_s = time.monotonic()
    first = share() if share is not None else done / max(total, 1)

    def left(number: int) -> str:
        now = share() if share is not None else number / max(total, 1)
        if now <= first:
            return "time left not yet known"
        seconds = (time.monotonic() - begun_s) * max(1.0 - now, 0.0) / (now - first)
        return f"{seconds:.0f} s left" if seconds < 90.0 else f"{seconds / 60.0:.0f} min left"

    if console.is_terminal or (console.is_jupyter and find_spec("ipywidgets") is not None):
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[note]}"),
        )
        with Progress(*columns, console=console, refresh_per_second=1) as bar:
            task = bar.add_task(description, total=total, completed=done, note="")
            for number, item in enumerate(items, done + 1):
                bar.update(task, advance=1, note=f"{left(number)}  {item if isinstance(item, str) else ''}")
                yield item
        return
    for number, item in enumerate(items, done + 1):
        now_s = time.monotonic()
        if now_s - last_s >= LINE_EVERY_S or number == total:
            last_s = now_s
            note = f"  {item}" if isinstance(item, str) else ""
            spent = f"{number} of {total} after {now_s - begun_s:.0f} s"
            print(f"{description}: {spent}, {left(number)}{note}", file=sys.stderr, flush=True)
        yield item
