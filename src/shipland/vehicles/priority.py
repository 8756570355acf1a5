"""The priority of a thread and of its process over others.

The process that carries a link imports this and starts at once: nothing here needs NumPy.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Literal

First = Literal["thread", "process"]
"""What has priority over other processes: the thread at the steady rate, or all of its process."""

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
    ask_for_slices(_OTHER_SLICE_S)
    _ask_for_slice(threading.get_native_id(), _OWN_SLICE_S)
    try:
        if first == "process":
            set_niceness(_NICE)
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(1))
    except (OSError, AttributeError):
        return False
    return True


def set_niceness(value: int) -> None:
    """Set the niceness of every thread of the process; PermissionError without the privilege."""
    for thread in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, int(thread.name), value)


def ask_for_slices(slice_s: float) -> None:
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
