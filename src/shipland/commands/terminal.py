"""What a flight shows: lines and one that is written over, on a thread of its own.

A terminal that stands still (Ctrl-S), a reader that has gone (`| head`) or a connection that broke costs what it would
have shown, and nothing else.
"""

from __future__ import annotations

import logging
import os
import time
from contextlib import suppress

from shipland.aside import Aside

_MOST = 1000
"""Lines that wait for a terminal that stands still."""
_DRAIN_S = 1.0
"""How long its end waits for one."""
_WIDTH = 120


class Terminal(logging.Handler):
    """Writes to a file descriptor, standard error unless another is given; a context manager. Nothing here raises."""

    def __init__(self, descriptor: int = 2) -> None:
        super().__init__(logging.WARNING)
        self._descriptor = descriptor
        self._status = ""
        self.is_live = os.isatty(descriptor)
        """Whether somebody looks at it, and the last line may be written over."""
        self._work: Aside[tuple[str, bool]] = Aside(self._write, _MOST, "terminal")

    @property
    def lost(self) -> int:
        """Lines that were not shown, because it stood still or has gone."""
        return self._work.lost

    def say(self, *lines: str) -> None:
        """Show lines."""
        for line in lines:
            self._work.give((_printable(line), False))

    def status(self, line: str) -> None:
        """Show a line until the next, where somebody looks; while others wait it is left out."""
        if self.is_live and self._work.waiting == 0:
            self._work.give((_printable(line), True))

    def emit(self, record: logging.LogRecord) -> None:
        """Show a record, a traceback line by line."""
        with suppress(Exception):  # whatever a foreign error's words do
            self.say(*self.format(record).splitlines())

    def __enter__(self) -> Terminal:
        """Warnings and errors of the program are shown here too: logging writes where it is called."""
        logging.getLogger("shipland").addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger("shipland").removeHandler(self)
        if self.is_live:
            self._work.give(("", True))
        self._work.close(_DRAIN_S)

    def _write(self, asked: tuple[str, bool]) -> None:
        """On the thread: the line, and the status below it again."""
        line, is_status = asked
        self._status = line[: self._width() - 1] if is_status else self._status
        text = "\r\x1b[K" if self.is_live else ""
        text += "" if is_status else f"{line}\n"
        data = (text + self._status).encode("utf-8", "replace")
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:  # another process has made our terminal so
                time.sleep(0.05)

    def _width(self) -> int:
        try:
            return max(2, os.get_terminal_size(self._descriptor).columns)
        except OSError:
            return _WIDTH


def _printable(line: str) -> str:
    """Without what moves a terminal's cursor: words come from pilots and vehicles."""
    return "".join(letter if letter.isprintable() else " " for letter in line)
