"""Ctrl-C and SIGTERM as a request that loops look for, instead of an exception at any instruction.

Python raises the KeyboardInterrupt of a signal wherever the main thread happens to be, and drops it where that is a
finaliser or a weak reference's callback; code of C that calls Python makes another error of it. Work that must stop in
order therefore runs within `stop_requests` and calls `check_stop` between two steps.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_GRACE_S = 1.0
"""A second signal this soon is the same request: wrappers pass on what the terminal has sent to the group already."""


class _Request:
    """Whether this process was asked to stop, and whether that was answered; times on `time.monotonic` [s]."""

    asked_s: float | None = None
    answered = False


_request = _Request()


def check_stop() -> None:
    """Raise KeyboardInterrupt, once, where a stop was asked for."""
    if _request.asked_s is not None and not _request.answered:
        _request.answered = True
        raise KeyboardInterrupt


@contextmanager
def stop_requests() -> Iterator[None]:
    """SIGINT and SIGTERM are requests within the block, which `check_stop` or the block's end answers.

    A second signal, `_GRACE_S` after the first or later, raises KeyboardInterrupt where it falls. Outside the main
    thread signals are as they were.
    """

    def ask(_signal: int, _frame: FrameType | None) -> None:
        now_s = time.monotonic()
        if _request.asked_s is None:
            _request.asked_s = now_s
        elif now_s - _request.asked_s > _GRACE_S:
            raise KeyboardInterrupt

    with _handled((signal.SIGINT, signal.SIGTERM), ask):
        try:
            yield
            check_stop()
        finally:
            _request.asked_s, _request.answered = None, False


@contextmanager
def sigterm_interrupts() -> Iterator[None]:
    """SIGTERM interrupts as Ctrl-C does, within the block and in the main thread."""

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    with _handled((signal.SIGTERM,), interrupt):
        yield


@contextmanager
def _handled(signals: tuple[signal.Signals, ...], handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.signal(each, handler) for each in signals}
    try:
        yield
    finally:
        for each, earlier in before.items():
            signal.signal(each, signal.SIG_DFL if earlier is None else earlier)
