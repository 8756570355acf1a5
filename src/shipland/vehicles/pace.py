"""A thread that does one thing at a steady rate, and says how steady it was."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from shipland.soundness import log_failure
from shipland.vehicles.priority import First, ask_for_slices, go_first, set_niceness

_log = logging.getLogger(__name__)

_KEPT = 100_000
"""Latenesses that are kept: over half an hour at 50 Hz."""


def boot_s() -> float:
    """Time since the machine started [s]; `time.monotonic` stands still while it is suspended, and this does not."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)  # Linux has it
    return time.monotonic() if boot is None else time.clock_gettime(boot)


class Pace:
    """Calls `do(step_s)` every 1/`rate_hz` from a thread of its own; a turn that is missed is left out.

    Args:
        do: gets the time since its last call [s]; what it raises is counted and logged, and goes no further.
        rate_hz: calls a second.
        name: of the thread.
        first: what goes before other processes, where the system lets it.
    """

    def __init__(self, do: Callable[[float], None], rate_hz: float, name: str, first: First = "thread") -> None:
        self._first = first
        self._do, self._period_s = do, 1.0 / rate_hz
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self.late_s: deque[float] = deque(maxlen=_KEPT)
        """How late each call began [s]."""
        self.failed = 0
        """Calls that raised."""
        self.preferred = False
        """Whether the system lets the calls go before other processes; known once begun."""

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; no call runs after this."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def _run(self) -> None:
        niceness = os.getpriority(os.PRIO_PROCESS, 0) if hasattr(os, "getpriority") else 0
        self.preferred = go_first(self._first)
        try:
            self._take_turns()
        finally:
            ask_for_slices(0.0)
            if self._first == "process":
                with suppress(OSError, AttributeError):
                    set_niceness(niceness)

    def _take_turns(self) -> None:
        due_s, known = time.monotonic(), set[type[BaseException]]()
        last_s = boot_s()
        while not self._stopping.is_set():
            self.late_s.append(time.monotonic() - due_s)
            now_s = boot_s()
            try:
                self._do(now_s - last_s)
            except Exception as error:  # the next turn must come
                self.failed += 1
                log_failure(_log, f"a turn of {self._thread.name} failed", error, known)
            last_s = now_s
            due_s += self._period_s
            behind_s = time.monotonic() - due_s
            if behind_s > self._period_s:
                due_s += self._period_s * int(behind_s / self._period_s)
            self._stopping.wait(max(0.0, due_s - time.monotonic()))
