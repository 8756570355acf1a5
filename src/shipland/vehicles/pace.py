"""A thread that does one thing at a steady rate, and says how steady it was."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_KEPT = 100_000
"""Latenesses that are kept: over half an hour at 50 Hz."""


_SWITCH_S = 0.001
"""How long another thread of this process may keep the interpreter while this one is due."""
_NICE = -15
"""Of every thread of the process; at −20 whoever carries the link, such as a MAVLink router, would starve."""


def _go_first() -> bool:
    """Run before others, as far as the system lets us; False without the privilege: the thread is one of many.

    The whole process goes before others: this thread waits for the interpreter as long as whoever holds it, such as
    vision, waits for a core.
    """
    sys.setswitchinterval(min(sys.getswitchinterval(), _SWITCH_S))
    try:
        _set_niceness(_NICE)
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(1))
    except (OSError, AttributeError):
        return False
    return True


def _set_niceness(value: int) -> None:
    """Of every thread of the process; PermissionError without the privilege."""
    for thread in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, int(thread.name), value)


class Pace:
    """Calls `do(step_s)` every 1/`rate_hz` from a thread of its own; a turn that is missed is left out.

    Args:
        do: gets the time since its last call [s]; what it raises is counted and goes no further.
        rate_hz: calls a second.
        name: of the thread.
    """

    def __init__(self, do: Callable[[float], None], rate_hz: float, name: str) -> None:
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
        self.preferred = _go_first()
        try:
            self._take_turns()
        finally:
            with suppress(OSError, AttributeError):
                _set_niceness(niceness)

    def _take_turns(self) -> None:
        due_s = last_s = time.monotonic()
        while not self._stopping.is_set():
            now_s = time.monotonic()
            self.late_s.append(now_s - due_s)
            try:
                self._do(now_s - last_s)
            except Exception:  # the next turn must come
                self.failed += 1
            last_s = now_s
            due_s += self._period_s
            behind_s = time.monotonic() - due_s
            if behind_s > self._period_s:
                due_s += self._period_s * int(behind_s / self._period_s)
            self._stopping.wait(max(0.0, due_s - time.monotonic()))
