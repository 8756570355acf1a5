"""Machine code that is on disk, before the first flight of a process."""

from __future__ import annotations

import logging
from pathlib import Path

from shipland import compiled

_LOGGER = logging.getLogger(__name__)
_END = b"."
"""Last byte of every pickle, which Numba's files are."""


def prepare_machine_code() -> None:
    """Throw away what a loss of power has cut off, and warn, in a line, where code is to be compiled.

    An aircraft's computer often loses its power right after a flight, with files that are named and still empty. Numba
    would fail with such a file in every flight from then on; without it, it compiles again.
    """
    folder = compiled.cache_folder(Path(compiled.__file__).parent)
    if folder is not None:
        damaged = [path for path in folder.rglob("*.nb[ic]") if not _is_whole(path)]
        for path in damaged:
            path.unlink(missing_ok=True)
        if damaged:
            _LOGGER.warning("machine code was cut off (%d files) and is compiled again", len(damaged))
    compiled.say_that_it_compiles()


def _is_whole(path: Path) -> bool:
    try:
        return path.read_bytes().endswith(_END)
    except OSError:
        return True
