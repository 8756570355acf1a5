"""A campaign's folder: rows of one code, configuration and set of weights, and of one process at a time."""

from __future__ import annotations

import csv
import fcntl
import hashlib
import importlib.util
import io
import os
import platform
import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib import metadata, resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from shipland import factories
from shipland.errors import ConfigError, DataError
from shipland.evaluation.landing import COLUMNS, Landing, as_text, landing_from, row_of
from shipland.factories import Factory
from shipland.files import json_bytes, json_of, read_text, remove_unfinished, write_atomically
from shipland.former import renamed
from shipland.guidance.horizon.learned import policy_path
from shipland.record.info import config_digest, file_digest
from shipland.scenario.scenario import Scenario
from shipland.scenario.visions import needs_pictures
from shipland.version import code_version

_SOURCES = {".py", ".toml", ".frag", ".vert", ".glsl", ".npz"}
_LIBRARIES = ("numpy", "scipy", "mujoco", "opencv-python-headless", "onnxruntime", "openvino")
_BOUND = {
    "source": "code (its files differ)",
    "configuration": "configuration",
    "pilot": "pilot",
    "vision": "vision",
    "own_code": "own code",
    "weights": "weights or recorded motion",
}
"""Keys that must be equal for all landings of a folder, with their names in words."""


@cache
def source_digest() -> str:
    """First 16 hex digits of the SHA-256 of the installed package's files, weights and the wheel's examples apart."""
    root = Path(str(resources.files("shipland")))
    digest = hashlib.sha256()
    for path in sorted(path for path in root.rglob("*") if path.suffix in _SOURCES):
        if path.is_relative_to(root / "examples"):
            continue
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def campaign_key(scenario: Scenario, pilot: str | Factory, vision: str | Factory) -> dict[str, Any]:
    """What landings of one table must have in common, with further facts for the reader.

    DataError or ConfigError where a file that flies is missing, or own code stands in no file.
    """
    table, aircraft = scenario.table(), scenario.aircraft
    flies = {"pilots": pilot, "visions": vision, "aircraft": aircraft.kind, "loops": aircraft.loop.kind}
    names, program = {group: factories.name_of(each) for group, each in flies.items()}, Path(sys.argv[0]).name
    return {
        "version": code_version(),
        "source": source_digest(),
        "configuration": config_digest(table),
        "pilot": names["pilots"],
        "vision": names["visions"],
        "own_code": {
            name: _own_code_digest(group, name) for group, name in names.items() if factories.is_own_code(name)
        },
        "weights": _weights(scenario, vision),
        "python": platform.python_version(),
        "libraries": {name: _version_of(name) for name in _LIBRARIES},
        "command": shlex.join(["shipland" if program == "__main__.py" else program, *sys.argv[1:]]),
        "scenario": table,
    }


def _weights(scenario: Scenario, vision: str | Factory) -> dict[str, str]:
    """Digests of what a flight may read beside code, by what it is: detectors, policies, a recorded motion."""
    files: dict[str, Path] = {}
    if needs_pictures(factories.resolve("visions", vision)):
        from shipland.vision.far.detector import weights_path

        detector = scenario.detector
        for kind, name in (("ship", detector.ship_weights), ("bar", detector.bar_weights)):
            files[kind] = weights_path(name, detector.precision)
    files |= {kind: policy_path(name) for kind, name in vars(scenario.guidance.learned).items()}
    if scenario.ship.motion == "recorded":
        files["motion"] = Path(scenario.ship.recorded.path)
    try:
        return {what: file_digest(path) for what, path in files.items()}
    except OSError as error:
        raise DataError(f"{error.filename} cannot be read: {error.strerror}") from None


def _own_code_digest(group: str, name: str) -> str:
    """Of the file that holds `module:factory`; empty for a module without one."""
    module, _, factory = name.partition(":")
    if module == "__main__":
        path = Path(getattr(sys.modules[module], "__file__", ""))
        if not path.is_file():
            raise ConfigError(
                f"{factory} is defined in a notebook or at a prompt, and all rows of a folder must be of one code; "
                f"write it into a file, own.py, and give 'own:{factory}', or give no folder"
            )
        return file_digest(path)
    factories.resolve(group, name)
    spec = importlib.util.find_spec(module)
    return file_digest(Path(spec.origin)) if spec is not None and spec.origin is not None else ""


def _version_of(name: str) -> str:
    with suppress(metadata.PackageNotFoundError):
        return metadata.version(name)
    return ""


class Rows:
    """Rows of a cell: in memory, or in a folder that `folder_in` opened.

    Attributes:
        done: landings by seed; of a folder those found in it, so that memory does not grow with those on disk.
        seeds: of all rows.
    """

    def __init__(self, path: Path | None = None, done: Mapping[int, Landing] = MappingProxyType({})) -> None:
        self._path, self.done, self.seeds = path, dict(done), set(done)

    def append(self, landing: Landing) -> None:
        """Take one more row; DataError, and nothing of it in the file, when it cannot be written."""
        if self._path is None:
            self.done[landing.seed] = landing
        else:
            _append(self._path, landing)
        self.seeds.add(landing.seed)


def _append(path: Path, landing: Landing) -> None:
    try:
        size = path.stat().st_size
        try:
            with path.open("a", newline="", encoding="utf-8") as file:
                csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(as_text(row_of(landing)))
        except OSError:
            with suppress(OSError):
                os.truncate(path, size)
            raise
    except OSError as error:
        raise DataError(f"{path} cannot be written: {error.strerror}") from None


def folder_in(out: Path, key: dict[str, Any]) -> Rows:
    """The rows of a cell's folder, made when missing, within one that is `claimed`.

    DataError where it holds landings of another key or a broken table, or cannot be written.
    """
    path, beside = out / "landings.csv", out / "campaign.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        text = read_text(path) if path.exists() else ""
        whole = _whole_rows(text)
        if not whole.partition("\n")[2]:  # no row yet: what a campaign was to fly there before binds nobody
            whole = ",".join(COLUMNS) + "\n"
            write_atomically(beside, json_bytes(key))
        elif not beside.exists():
            raise DataError(f"{out} holds landings without campaign.json; give another folder")
        found = read_key(out)
        if differ := [words for name, words in _BOUND.items() if found.get(name) != key[name]]:
            raise DataError(f"{out} holds landings of another {', '.join(differ)}; give another folder")
        rows = Rows(path, _landings(path, whole))
        if whole != text:
            write_atomically(path, whole.encode())
        return rows
    except OSError as error:
        raise DataError(f"{out} cannot be used: {error.strerror}") from None


@contextmanager
def claimed(out: Path) -> Iterator[None]:
    """A folder, made when missing, for this process alone, without what one that was killed had begun to write.

    DataError when another has it or it cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = os.open(out / ".lock", os.O_CREAT | os.O_RDWR, 0o644)
    except OSError as error:
        raise DataError(f"{out} cannot be written: {error.strerror}") from None
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise DataError(f"{out}: another program flies in this folder; wait for it, or give another") from None
        remove_unfinished(out)
        yield
    finally:
        os.close(lock)


def read_key(folder: Path) -> dict[str, Any]:
    """campaign.json of a campaign's folder; DataError when there is none or it is broken."""
    path = folder / "campaign.json"
    try:
        key = json_of(read_text(path))
    except ValueError:
        key = None
    if not isinstance(key, dict):
        raise DataError(f"{path} is not readable; give another folder")
    return key


def read_campaign(folder: Path) -> list[Landing]:
    """The landings in a campaign's folder; DataError when there are none or the table is broken."""
    path = folder / "landings.csv"
    if not path.is_file():
        within = ", ".join(str(each.parent) for each in sorted(folder.glob("*/landings.csv")))
        hint = f"; give one of {within}" if within else ""
        raise DataError(f"{folder} holds no campaign: {path} does not exist{hint}")
    return list(_landings(path, _whole_rows(read_text(path))).values())


def _whole_rows(text: str) -> str:
    """Without a last row that was cut short, by a full disk for instance: it is flown again."""
    return text[: text.rfind("\n") + 1]


def rows_in(text: str) -> csv.DictReader[str]:
    """The rows of a landings.csv; lines end where its writer ends them, and not at other signs that a text may hold."""
    return csv.DictReader(io.StringIO(text))


def _landings(path: Path, text: str) -> dict[int, Landing]:
    """By seed; `path` is for messages."""
    done: dict[int, Landing] = {}
    rows = rows_in(text)
    while True:
        try:
            if (row := next(rows, None)) is None:
                return done
            if None in row or None in row.values():
                raise ValueError("more or fewer values than columns")
            done[int(row["seed"])] = landing_from(renamed(row))
        except (csv.Error, KeyError, TypeError, ValueError):
            line = max(rows.line_num, 1)
            raise DataError(f"{path}, line {line}: not a landing; remove the line to fly it again") from None
