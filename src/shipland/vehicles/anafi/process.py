"""The process that speaks to the ANAFI: started, told, listened to, written down."""

from __future__ import annotations

import json
import logging
import subprocess
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from shipland.aside import LogAside
from shipland.errors import VehicleError
from shipland.soundness import is_new, words_of

_log = logging.getLogger(__name__)

_GOODBYE_S = 4.0
"""Time for the process to release the sticks and to disconnect."""
_LONGEST_LINE, _LARGEST_PICTURE = 1 << 20, 1 << 26
"""Bytes of a record's line and of its picture; 4K takes 12 million."""


class AnafiProcess:
    """Records to and from the far end, `end.py`.

    Args:
        command: starts it.
        on_record: gets every record and its picture's bytes, on a thread of its own; whatever it raises counts as
            refused.
        on_end: called once when the process has gone.
        log: JSON lines of both directions, pictures without their bytes, written aside; None: none.

    Raises:
        VehicleError: it cannot be started, or the log cannot be written.
    """

    def __init__(
        self,
        command: list[str],
        on_record: Callable[[Mapping[str, Any], bytes], None],
        on_end: Callable[[], None],
        log: Path | None,
    ) -> None:
        self._on_record, self._on_end = on_record, on_end
        self._log: LogAside[str] | None = None
        if log is not None:
            try:
                log.parent.mkdir(parents=True, exist_ok=True)
                self._log = LogAside(log.open("w", buffering=1, encoding="utf-8"), "anafi-log")
            except OSError as error:
                raise VehicleError(f"message log {log} cannot be written: {error.strerror}") from None
        self.refused = 0
        """Records that could not be used."""
        try:
            # a Ctrl-C of the terminal is ours to handle: it must not end the one who releases the sticks
            self._process = subprocess.Popen(  # noqa: S603 - the Python that the user named, and our own file
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            if self._log is not None:
                self._log.close()
            raise VehicleError(f"{command[0]!r} cannot be started: {error.strerror}") from None
        self._thread = threading.Thread(target=self._listen, name="anafi", daemon=True)
        self._thread.start()

    def say(self, record: Mapping[str, Any]) -> None:
        """Tell it; where it has gone, nothing happens."""
        self._note("to", record)
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # the listening thread notices
            self._process.stdin.write(json.dumps(record).encode() + b"\n")
            self._process.stdin.flush()

    def close(self) -> None:
        """End its input, whereupon it releases the sticks and goes; one that does not go is ended."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(_GOODBYE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join(1.0)
        if self._log is not None:
            self._log.close()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        known = set[type[BaseException]]()
        with suppress(OSError, ValueError), self._process.stdout as stream:
            while line := stream.readline(_LONGEST_LINE):
                try:
                    record = json.loads(line)
                    size = record.get("bytes", 0)
                    if not 0 <= size <= _LARGEST_PICTURE:
                        raise ValueError(f"a picture of {size} bytes")
                    data = stream.read(size)
                    self._note("from", record)
                    self._on_record(record, data)
                except Exception as error:  # a record may hold anything, and the next one must be heard
                    self.refused += 1
                    if is_new(error, known):
                        _log.warning("a record of the ANAFI's process was refused: %r: %s", line[:80], words_of(error))
        self._on_end()

    def _note(self, direction: str, record: Mapping[str, Any]) -> None:
        if self._log is not None:
            self._log.give(json.dumps({"at_s": round(time.monotonic(), 4), direction: record}) + "\n")
