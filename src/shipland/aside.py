"""Work that must not keep a control loop: handed over, and done on a thread of its own."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import IO, Any, Generic, TypeVar

_log = logging.getLogger(__name__)

Thing = TypeVar("Thing")
_MOST_ENTRIES, _LOG_CLOSE_S = 10_000, 2.0
"""Entries of a log that wait for the disk, half a minute of a vehicle's messages; how long the end waits for it."""


class Aside(Generic[Thing]):
    """Does what it is given on a thread of its own, in order; whoever gives never waits and gets no error.

    Args:
        do: takes one thing; where it raises, nothing more is done, and `error` says why.
        most: so many things wait; what is given beyond them is lost, and counted.
        name: of the thread.
    """

    def __init__(self, do: Callable[[Thing], object], most: int, name: str) -> None:
        self._do, self._most = do, most
        self._changed = threading.Condition()
        self._things: deque[Thing] = deque()
        self._ending = False
        self.lost = 0
        """Things that were given and are not done."""
        self.error: Exception | None = None
        """What `do` raised."""
        # a daemon: work that never ends must not keep the process
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Items that wait."""
        return len(self._things)

    def give(self, thing: Thing) -> None:
        """Hand over."""
        with self._changed:
            if self._ending or self.error is not None or len(self._things) >= self._most:
                self.lost += 1
                return
            self._things.append(thing)
            self._changed.notify()

    def close(self, timeout_s: float | None = None) -> bool:
        """Take no more, and wait until all is done; False where it is not in time [s]. None waits as long as it takes.

        After a False the thread may still be at work on the thing that it began; those that wait are lost.
        """
        with self._changed:
            self._ending = True
            self._changed.notify()
        self._thread.join(timeout_s)
        with self._changed:
            self.lost += len(self._things)
            self._things.clear()
        return not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._things or self._ending)
                if not self._things:
                    return
                thing = self._things.popleft()
            try:
                self._do(thing)
            except Exception as error:  # whatever a stream or a disk does
                with self._changed:
                    self.error = error
                    self.lost += 1 + len(self._things)
                    self._things.clear()
                return


class LogAside(Aside[Thing]):
    """Writes and closes a log that must keep nobody, though the disk stalls or is full.

    Args:
        file: open for writing.
        name: of the thread.
    """

    def __init__(self, file: IO[Any], name: str) -> None:
        super().__init__(file.write, _MOST_ENTRIES, name)
        self._file = file

    def close(self, timeout_s: float | None = _LOG_CLOSE_S) -> bool:
        """See `Aside`; a file that is still written to stays open. What is missing of it is a warning."""
        done = super().close(timeout_s)
        if done:
            try:
                self._file.close()
            except OSError as error:
                self.error = self.error or error
        if self.lost or self.error is not None:
            words = getattr(self.error, "strerror", None) or self.error or f"{self.lost} entries left out"
            _log.warning("%s is not whole: %s", self._thread.name, words)
        return done
