"""The flight log as MCAP in Foxglove's schemas, readable by that ecosystem's viewers and by `record.reader`.

What it holds: `channels`.

Each second of flight what was written goes to the disk: a process that is killed leaves all but its last second.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

import foxglove
from foxglove import Context
from foxglove.mcap import MCAPWriteOptions

from shipland.camera import Camera
from shipland.files import writing
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.record.channels import FlightChannels, LogParameters
from shipland.record.info import FlightInfo
from shipland.record.sink import Sink
from shipland.rig import Rig

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
