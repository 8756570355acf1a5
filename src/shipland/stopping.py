"""Ctrl-C and its like as a request that loops look for, instead of an exception at any instruction.

Python raises the KeyboardInterrupt of a signal wherever the main thread happens to be, and drops it where that is a
finaliser or a weak reference's callback; code of C that calls Python makes another error of it. Work that must stop in
order therefore runs within `stop_requests` and calls `check_stop` between two steps; what must not be cut short, such
as leaving a vehicle in a hold, runs within `uninterrupted`.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
"""Ctrl-C, `kill`, a terminal or SSH connection that has gone, Ctrl-\\."""
_GRACE_S = 1.0
"""A signal this soon after the last, or after its answer, is the same request: wrappers pass on what the terminal has
sent to the group already, and who presses twice means to stop, not to cut the stopping short."""
_LOOK_S = 0.02
"""How often a wait looks for a request."""


class _Request:
    """Whether this process was asked to stop, and whether that was answered; times on `time.monotonic` [s]."""

    asked = False
    answered = False
    last_s = 0.0
    """Time of the last signal or answer [s]."""
    uninterrupted = 0
    """How many blocks run that must come to their end."""


_request = _Request()


def check_stop() -> None:
    """Raise KeyboardInterrupt, once and in the main thread, where a stop was requested."""
    if not _request.asked or _request.answered or _request.uninterrupted or not _in_main_thread():
        return
    _request.answered, _request.last_s = True, time.monotonic()
    raise KeyboardInterrupt


def sleep_or_stop(duration_s: float) -> None:
    """Sleep [s]; KeyboardInterrupt within a fraction of a second where a stop is requested."""
    end_s = time.monotonic() + duration_s
    check_stop()
    while (left_s := end_s - time.monotonic()) > 0.0:
        time.sleep(min(left_s, _LOOK_S))
        check_stop()


@contextmanager
def stop_requests() -> Iterator[None]:
    """The signals of `ENDING` are requests within the block, which `check_stop` or the block's end answers.

    A second signal, `_GRACE_S` after the first or later, raises KeyboardInterrupt where it falls, unless that is
    `uninterrupted`. Outside the main thread signals are as they were.
    """

    def ask(_signal: int, _frame: FrameType | None) -> None:
        now_s = time.monotonic()
        if not _request.asked:
            _request.asked, _request.last_s = True, now_s
        elif not _request.uninterrupted and now_s - _request.last_s > _GRACE_S:
            _request.answered, _request.last_s = True, now_s
            raise KeyboardInterrupt

    if not _in_main_thread():  # a request is the main thread's: another one's end does not answer it
        yield
        return
    with _handled(ENDING, ask):
        try:
            yield
            check_stop()
        finally:
            _request.asked = _request.answered = False


@contextmanager
def uninterrupted() -> Iterator[None]:
    """What is done within comes to its end, however often a signal says stop; it must be bounded in time.

    A first signal is answered afterwards: where `stop_requests` is in force as its own, elsewhere by KeyboardInterrupt
    at the end of the block. Outside the main thread signals are as they were.
    """
    if not _in_main_thread():
        yield
        return
    came = False

    def note(_signal: int, _frame: FrameType | None) -> None:
        nonlocal came
        came = True

    plain = tuple(each for each in ENDING if signal.getsignal(each) in (signal.default_int_handler, _interrupt))
    _request.uninterrupted += 1
    try:
        with _handled(plain, note):
            yield
    finally:
        _request.uninterrupted -= 1
    if came:
        raise KeyboardInterrupt


@contextmanager
def signals_interrupt() -> Iterator[None]:
    """The signals of `ENDING` interrupt as Ctrl-C does, within the block and in the main thread."""
    with _handled(tuple(each for each in ENDING if each is not signal.SIGINT), _interrupt):
        yield


@contextmanager
def ignored(signals: tuple[signal.Signals, ...]) -> Iterator[None]:
    """The signals do nothing within the block."""
    with _handled(signals, signal.SIG_IGN):
        yield


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def _handled(
    signals: tuple[signal.Signals, ...], handler: Callable[[int, FrameType | None], None] | signal.Handlers
) -> Iterator[None]:
    if not _in_main_thread():
        yield
        return
    before = {
        each: signal.signal(each, handler)
        for each in signals
        if each is not signal.SIGHUP or signal.getsignal(each) is not signal.SIG_IGN  # `nohup` wants to outlive it
    }
    try:
        yield
    finally:
        for each, earlier in before.items():
            signal.signal(each, signal.SIG_DFL if earlier is None else earlier)
