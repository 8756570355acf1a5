"""Files of every kind: read with errors of one line, written whole or not at all, damaged ones recognised by a digest.

A folder's digests stand in its `SHA256SUMS`, a line a file, as `sha256sum` writes and checks them. A file that is
listed is refused when it differs; one that is not listed is taken as it is.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

from shipland.errors import DataError

DIGESTS = "SHA256SUMS"
"""Name of the file that lists the digests of a folder."""

MOST_LEVELS = 32
"""Deepest nesting of tables that is read; the configuration's own has eight levels."""


def read_text(path: Path) -> str:
    """The text of a file in UTF-8; DataError when it cannot be read or is in another encoding."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path} is not text in UTF-8 (byte {error.start} is {error.object[error.start]:#04x}): "
            "save it again in that encoding"
        ) from None
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}") from None


def refuse_deep(value: object) -> None:
    """ValueError when dicts and lists are nested deeper than `MOST_LEVELS`: what follows walks them by recursion."""
    level: list[object] = [value]
    for _ in range(MOST_LEVELS):
        nodes = [node.values() if isinstance(node, dict) else node for node in level if isinstance(node, dict | list)]
        level = [each for node in nodes for each in node]
    if level:
        raise ValueError("nested too deeply")


def json_of(text: str | bytes) -> Any:  # noqa: ANN401 - any JSON
    """The value of a JSON text; ValueError, whatever is wrong with it."""
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    refuse_deep(value)
    return value


@contextmanager
def writing(path: Path, what: str = "") -> Iterator[None]:
    """Makes the file's folder; a DataError names the file, after `what` it is, where the block cannot write it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise DataError(f"{what} {path} cannot be written: {error.strerror or error}".lstrip()) from None


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file or a new folder beside `path` to write; then it takes its place: readers see the old or the new, whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield beside
        beside.replace(path)
    finally:
        _remove(beside)


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all in it, if there is one."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def remove_unfinished(folder: Path) -> None:
    """Remove what others that were killed had begun to write in a folder (`replacing`); none of them may write now."""
    for beside in [*folder.rglob(".*.[0-9]*.part")]:
        if not beside.name.endswith(f".{os.getpid()}.part"):
            _remove(beside)


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` whole or not at all, and have it on the disk."""
    with replacing(path) as beside, beside.open("wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Mapping[str, object]]) -> None:
    """Write a table whole or not at all: a line of the columns' names, then a line a row."""
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, columns, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def json_bytes(value: object) -> bytes:
    """JSON as files of ours hold it: a line an entry, letters as they are."""
    return (json.dumps(value, indent=1, ensure_ascii=False) + "\n").encode()


def claim(note: Path, wanted: Mapping[str, object], what: str) -> None:
    """Write down what a folder is made with; DataError where it holds `what`, a set for instance, made with another."""
    if note.is_file():
        try:
            there = json_of(read_text(note))
        except ValueError:
            raise DataError(f"{note} is broken: choose another folder") from None
        if there != wanted:
            raise DataError(f"{note.parent} holds {what} made with {there}, not {wanted}: choose another folder")
    write_atomically(note, json.dumps(wanted).encode())


def write_with_digest(path: Path, data: bytes) -> None:
    """Write a file whole, and its digest into its folder's list; DataError when that list is none."""
    digests = _digests(path.parent / DIGESTS) | {path.name: hashlib.sha256(data).hexdigest()}
    write_atomically(path, data)
    lines = (f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    write_atomically(path.parent / DIGESTS, "".join(lines).encode())


def check_digest(path: Path) -> None:
    """Nothing where the file is the one that its folder's list means, or is not listed.

    Raises:
        DataError: the file is damaged or another one, or cannot be read; or the list is none.
    """
    listed = path.parent / DIGESTS
    wanted = _digests(listed).get(path.name)
    if wanted is None:
        return
    try:
        status = path.stat()
        found = _digest(path, status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}") from None
    if found != wanted:
        raise DataError(
            f"{path} is damaged: its SHA-256 is {found[:16]}…, {listed} says {wanted[:16]}…; copy it again, or take "
            f"its line out of {DIGESTS} if you changed it"
        )


def _digests(listed: Path) -> dict[str, str]:
    """By file name; empty without a list."""
    if not listed.is_file():
        return {}
    digests = {}
    for number, line in enumerate(read_text(listed).splitlines(), 1):
        match = re.fullmatch(r"([0-9a-f]{64}) [ *](.+)", line)
        if match is None:
            raise DataError(f"{listed}, line {number}: expected a SHA-256 and a file name, as sha256sum writes them")
        digests[match[2]] = match[1]
    return digests


@lru_cache
def _digest(path: Path, _modified_ns: int, _size: int) -> str:
    """Digest of a file, computed again only after it was written."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
