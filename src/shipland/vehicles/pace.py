"""A thread that does one thing at a steady rate, and says how steady it was."""

from __future__ import annotations

import ctypes
import logging
import os
import platform
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal

from shipland.soundness import is_new

_log = logging.getLogger(__name__)

First = Literal["thread", "process"]
"""What has priority over other processes: the thread at the steady rate, or all of its process."""

_KEPT = 100_000
"""Latenesses that are kept: over half an hour at 50 Hz."""


_SWITCH_S = 0.001
"""How long another thread of this process may keep the interpreter while this one is due."""
_OWN_SLICE_S, _OTHER_SLICE_S = 1e-4, 1e-3
"""Time slices of this thread and of the process's others, until `Pace` ends."""
_NICE = -15
"""Niceness of every thread of a process with priority; at −20 the process that carries the link would starve."""
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
"""The system call, by machine."""


class _Attributes(ctypes.Structure):
    """Linux's `sched_attr`."""

    _fields_ = (
        ("size", ctypes.c_uint32), ("policy", ctypes.c_uint32), ("flags", ctypes.c_uint64), ("nice", ctypes.c_int32),
        ("priority", ctypes.c_uint32), ("runtime_ns", ctypes.c_uint64), ("deadline_ns", ctypes.c_uint64),
        ("period_ns", ctypes.c_uint64),
    )  # fmt: skip


def go_first(first: First) -> bool:
    """Run before others, as far as the system lets us; False without the privilege: the thread is one of many.

    This thread waits for the interpreter as long as whoever holds it, such as vision, waits for a core: the process's
    other threads ask for short time slices, which Linux from 6.12 on gives sooner, for no more time in all. With
    `process` they go before other processes as well.
    """
    sys.setswitchinterval(min(sys.getswitchinterval(), _SWITCH_S))
    _ask_for_slices(_OTHER_SLICE_S)
    _ask_for_slice(threading.get_native_id(), _OWN_SLICE_S)
    try:
        if first == "process":
            _set_niceness(_NICE)
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(1))
    except (OSError, AttributeError):
        return False
    return True


def _set_niceness(value: int) -> None:
    """Set the niceness of every thread of the process; PermissionError without the privilege."""
    for thread in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, int(thread.name), value)


def _ask_for_slices(slice_s: float) -> None:
    """For every thread of the process; 0 for the system's own length."""
    with suppress(OSError):  # no /proc
        for thread in Path("/proc/self/task").iterdir():
            _ask_for_slice(int(thread.name), slice_s)


def _ask_for_slice(thread: int, slice_s: float) -> None:
    """A length of the time slices, which needs no privilege; where the system knows none, nothing happens."""
    number = _SCHED_SETATTR.get(platform.machine())
    with suppress(OSError, AttributeError):
        if number is None or os.sched_getscheduler(thread) != os.SCHED_OTHER:
            return
        attributes = _Attributes(nice=os.getpriority(os.PRIO_PROCESS, thread), runtime_ns=round(1e9 * slice_s))
        attributes.size = ctypes.sizeof(attributes)
        ctypes.CDLL(None).syscall(number, thread, ctypes.byref(attributes), 0)


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
            _ask_for_slices(0.0)
            if self._first == "process":
                with suppress(OSError, AttributeError):
                    _set_niceness(niceness)

    def _take_turns(self) -> None:
        due_s, known = time.monotonic(), set[type[Exception]]()
        last_s = due_s
        while not self._stopping.is_set():
            now_s = time.monotonic()
            self.late_s.append(now_s - due_s)
            try:
                self._do(now_s - last_s)
            except Exception as error:  # the next turn must come
                self.failed += 1
                if is_new(error, known):
                    _log.exception("a turn of %s failed", self._thread.name)
            last_s = now_s
            due_s += self._period_s
            behind_s = time.monotonic() - due_s
            if behind_s > self._period_s:
                due_s += self._period_s * int(behind_s / self._period_s)
            self._stopping.wait(max(0.0, due_s - time.monotonic()))
