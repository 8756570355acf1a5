"""Compilation of plain loops over floats and arrays with Numba; its machine code is kept on disk where that can be."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

_LOGGER = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., Any])
_SETTINGS: Any = numba.config
_END_OF_CODE = b"."
"""Last byte of every pickle, which Numba's files are."""


def compiled(function: F) -> F:
    """`function`, compiled at its first call; the same floating-point results as Python's in the same order.

    Division by zero gives infinity or NaN, as NumPy's does, not an exception. The machine code is kept beside the
    source, in the user's cache or where `NUMBA_CACHE_DIR` says; where none can be written, each process compiles.
    """
    folder = cache_folder(Path(__file__).parent)
    if folder is None:
        return cast(F, numba.njit(error_model="numpy")(function))
    before, _SETTINGS.CACHE_DIR = _SETTINGS.CACHE_DIR, str(folder)
    try:
        return cast(F, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        _SETTINGS.CACHE_DIR = before


@lru_cache(maxsize=8)
def cache_folder(package: Path) -> Path | None:
    """The folder of the machine code of a package, another one for other sources; None where none can be written.

    Numba looks for changes in the file of a function only, not in those of the functions that it calls: it would go on
    with the machine code of before. A file counts that holds the word `@compiled`; one whose functions are compiled by
    others says so.
    """
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"@compiled" in source:
            digest.update(source)
    for base in _bases(package):
        folder = base / f"compiled-{digest.hexdigest()[:16]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            _drop_cut_off_code(folder)
            return folder
    return None


def _drop_cut_off_code(folder: Path) -> None:
    """Throw away machine code that a loss of power has cut off, and say so.

    An aircraft's computer often loses its power right after a flight, with files that are named and still empty. Numba
    would fail with such a file in every flight from then on; without it, it compiles again.
    """
    damaged = [path for path in folder.rglob("*.nb[ic]") if not _is_whole(path)]
    for path in damaged:
        path.unlink(missing_ok=True)
    if damaged:
        _LOGGER.warning("machine code was cut off (%d files) and is compiled again", len(damaged))


def _is_whole(path: Path) -> bool:
    try:
        return path.read_bytes().endswith(_END_OF_CODE)
    except OSError:  # another process has thrown it away
        return True


def is_compiled() -> bool:
    """Whether machine code of these sources is on disk."""
    folder = cache_folder(Path(__file__).parent)
    return folder is not None and any(folder.rglob("*.nbi"))


def compiles_for_all() -> bool:
    """Whether the next process that calls compiled functions leaves its machine code to all that start after it."""
    return not (_SETTINGS.DISABLE_JIT or is_compiled()) and cache_folder(Path(__file__).parent) is not None


def say_that_it_compiles() -> None:
    """Warn, in a line, where no machine code is on disk yet: a first flight then looks as if it stood still."""
    if not (_SETTINGS.DISABLE_JIT or is_compiled()):
        often = "once" if compiles_for_all() else "each time: no cache folder can be written"
        _LOGGER.warning("compiling for this processor, %s; takes about a minute", often)


def _bases(package: Path) -> list[Path]:
    if _SETTINGS.CACHE_DIR:
        return [Path(_SETTINGS.CACHE_DIR)]
    bases = [package / "__pycache__"]
    with suppress(RuntimeError):  # a user without a home
        bases.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "shipland")
    return bases
