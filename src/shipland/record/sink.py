"""A file for a writer that cannot report errors: the first error is kept, what follows it is dropped."""

from __future__ import annotations

import os
from pathlib import Path

from shipland.errors import DataError


class Sink:
    """A binary file that never raises while it is written to.

    Foxglove's writer prints a line for each message that it cannot write, goes on, and panics where positions do not
    add up. So it is given this file, which seems to take everything; `check` says what went wrong.
    """

    def __init__(self, path: Path) -> None:
        """Open `path`, writing over what was there; OSError when it cannot be opened."""
        self._path, self._error = path, ""
        self._file = path.open("wb")
        self._at = self._end = 0

    def write(self, data: bytes | bytearray) -> int:
        """Write; the length of `data`, whatever happens."""
        if not self._error:
            try:
                self._file.write(data)
            except OSError as error:
                self._fail(error)
        self._at += len(data)
        self._end = max(self._end, self._at)
        return len(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move; the new position, after an error the one that there would be without it."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._end}[whence]
        if not self._error:
            try:
                self._file.seek(self._at)
            except OSError as error:
                self._fail(error)
        return self._at

    def flush(self) -> None:
        """Pass on what is buffered."""
        if not self._error:
            try:
                self._file.flush()
            except OSError as error:
                self._fail(error)

    def check(self) -> None:
        """Raises DataError when something could not be written."""
        if self._error:
            raise DataError(f"{self._path} cannot be written: {self._error}")

    def close(self) -> None:
        """Close the file; a file of which nothing could be written is removed."""
        try:
            self._file.close()
        except OSError as error:
            self._fail(error)
        if self._error and self._path.is_file() and self._path.stat().st_size == 0:
            self._path.unlink()

    def _fail(self, error: OSError) -> None:
        self._error = self._error or error.strerror or str(error)
