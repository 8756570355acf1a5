"""How far a campaign is, and what shows it."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from shipland.evaluation.campaign import LostFlight
from shipland.evaluation.statistics import share_interval

_SAY_EVERY_S = 15.0
_MOST_LOST = 10
"""Lost flights that are named."""


@dataclass(frozen=True)
class CampaignProgress:
    """How far a campaign is; comes before the first flight and after each.

    Attributes:
        cells: lines of its table.
        flights: all of them, with those flown earlier.
        to_fly: flights that were missing at the start.
        flown: of these.
        landed: of those flown, in the landing area.
        lost: flights without a landing, and why.
        area: what the landing area is called.
    """

    cells: int
    flights: int
    to_fly: int
    flown: int
    landed: int
    lost: Sequence[LostFlight]
    area: str


class ProgressBar:
    """Shows it on standard error: a bar in a terminal or a notebook, elsewhere a line now and then.

    A context manager; at its end it says how many were flown and names flights that were lost.
    """

    def __init__(self, resumes: bool) -> None:
        self._console = Console(stderr=True, highlight=False)
        in_notebook = self._console.is_jupyter and find_spec("ipywidgets") is not None
        self._live = self._console.is_terminal or in_notebook
        columns = ("[progress.description]{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=self._console, disable=not self._live)
        self._task = self._bar.add_task("flights")
        self._resumes = resumes
        self._begun_s = self._said_s = time.monotonic()
        self._first_s = 0.0
        self._last: CampaignProgress | None = None

    def __enter__(self) -> ProgressBar:
        self._bar.start()
        return self

    def __call__(self, now: CampaignProgress) -> None:
        """Show it."""
        if self._last is None:
            cells = f"{now.cells} cell{'s' * (now.cells > 1)}"
            self._console.print(f"{cells}, {now.to_fly} of {now.flights} flights to fly")
            self._bar.update(self._task, total=now.to_fly)
        self._last = now
        if not now.flown:
            return
        low, high = share_interval(now.landed, now.flown)
        words = f"{now.landed} of {now.flown} landed in the {now.area} ({100.0 * low:.0f}–{100.0 * high:.0f} %)"
        self._bar.update(self._task, completed=now.flown, description=words)
        now_s, left = time.monotonic(), now.to_fly - now.flown
        self._first_s = self._first_s or now_s
        if not self._live and now.flown > 1 and now_s - self._said_s > _SAY_EVERY_S:
            self._said_s = now_s
            # the first flight is not counted: it may have compiled
            minutes = left * (now_s - self._first_s) / max(1, now.flown - 1) / 60.0
            print(f"{words}, {left} to fly, {minutes:.1f} min to go", file=sys.stderr, flush=True)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        last, spent_s = self._last, time.monotonic() - self._begun_s
        if last is None:
            return
        if kind is KeyboardInterrupt:
            self._console.print("stopped")
        again = "; run it again to resume" if self._resumes and last.flown < last.to_fly else ""
        rate = f"{60.0 * last.flown / spent_s:.0f} a minute"
        self._console.print(f"{last.flown} of {last.to_fly} flown in {spent_s:.0f} s ({rate}){again}")
        for cell, seed, reason in last.lost[:_MOST_LOST]:
            self._console.print(f"lost: {cell}, seed {seed}: {reason}", markup=False)
        if len(last.lost) > _MOST_LOST:
            self._console.print(f"lost: {len(last.lost) - _MOST_LOST} more")
