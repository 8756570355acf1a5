"""The flight log as MCAP in Foxglove's schemas, readable by that ecosystem's viewers and by `record.reader`.

Each second of flight what was written goes to the disk: a process that is killed leaves all but its last second.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import foxglove
from foxglove import Context
from foxglove.mcap import MCAPWriteOptions

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.files import writing
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.record.channels import FlightChannels, LogParameters
from shipland.record.info import FlightInfo
from shipland.rig import Rig


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
        self._try(lambda: self._file.write(data))
        self._at += len(data)
        self._end = max(self._end, self._at)
        return len(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move; the new position, after an error the one that there would be without it."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._end}[whence]
        self._try(lambda: self._file.seek(self._at))
        return self._at

    def flush(self) -> None:
        """Pass on what is buffered."""
        self._try(self._file.flush)

    def check(self) -> None:
        """Raises DataError when something could not be written."""
        if self._error:
            raise DataError(f"{self._path} cannot be written: {self._error}")

    def close(self) -> None:
        """Close the file; a file of which nothing could be written is removed."""
        self._try(self._file.close, again=True)
        if self._error and self._path.is_file() and self._path.stat().st_size == 0:
            self._path.unlink()

    def _try(self, act: Callable[[], object], *, again: bool = False) -> None:
        """Do it and keep the first error; nothing after an error, unless `again`."""
        if not self._error or again:
            try:
                act()
            except OSError as error:
                self._error = self._error or error.strerror or str(error)


_FLUSH_S = 1.0
"""Flight time between two flushes of the log."""


class LogWriter(AbstractContextManager["LogWriter"]):
    """Writes one flight; a context manager, so that an interrupted flight leaves a closed, readable file too."""

    def __init__(self, path: Path, info: FlightInfo, rig: Rig, camera: Camera, parameters: LogParameters) -> None:
        """Open `path`, writing over what was there; DataError when it cannot be written."""
        context = Context()
        with writing(path, "flight log"):
            self._sink = Sink(path)
        self._writer = foxglove.open_mcap(
            self._sink, context=context, writer_options=MCAPWriteOptions(compression_threads=0)
        )
        self._channels = FlightChannels(context, info, rig, camera, parameters)
        self._flushed_s: float | None = None
        self._closed = False

    def append(self, record: FlightRecord) -> None:
        """Write one cycle; DataError when the file can no longer be written."""
        self._sink.check()
        self._channels.append(record)
        if self._flushed_s is None or not 0.0 <= record.frame.t_s - self._flushed_s < _FLUSH_S:
            self._flushed_s = record.frame.t_s
            self._writer.flush()

    def finish(self, verdict: TouchdownVerdict | None, end: str = "") -> None:
        """Write why the flight ended, and the verdict, and close; DataError when something could not be written."""
        if not self._closed:
            self._channels.finish(verdict, end)
        self.close()

    def close(self) -> None:
        """Close the file; once is enough, more do no harm."""
        if not self._closed:
            self._closed = True
            self._writer.close()
            self._sink.close()
            self._sink.check()

    def __exit__(self, *_: object) -> None:
        self.close()
