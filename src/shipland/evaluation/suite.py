"""Suites: named, versioned sets of scenarios, and the cells that they and a command's options make."""

from __future__ import annotations

import fnmatch
import hashlib
import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shipland import factories
from shipland.config import build, packaged_names, packaged_toml, read_toml, require, setting, toml_value
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.former import as_before
from shipland.record.info import config_digest
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table


@dataclass(frozen=True)
class SuiteEntry:
    """Scenarios with settings laid over each of them (`[[cells]]`).

    Attributes:
        scenarios: packaged names, paths of TOML files, or scenarios.
        set: texts `section.key=value`; several values with commas between make a cell each.
        vision: who sees.
    """

    scenarios: tuple[str | Scenario, ...]
    set: tuple[str, ...] = ()
    vision: str | Factory = "geometric"


@dataclass(frozen=True)
class Suite:
    """What a TOML file in `configs/suites` holds. Name, version, cell and seed fix what a flight meets.

    Attributes:
        name: the file's.
        version: counts up when `task_digest` changes.
        description: one line for people.
        cells: what is flown.
    """

    name: str
    version: int
    description: str
    cells: tuple[SuiteEntry, ...]

    def __post_init__(self) -> None:
        require(self.version >= 1, f"version must be 1 or more, got {self.version}")


@dataclass(frozen=True)
class Cell:
    """One scenario with one value of every setting, flown by one pilot; both names as `factories.resolve` takes them.

    Attributes:
        settings: (key, value) pairs laid over the packaged scenario.
        group: scenario and settings in a word: cells of one group differ in the pilot and fly the same seeds.
        name: group and pilot; also the cell's folder.
    """

    scenario: Scenario
    settings: tuple[tuple[str, str], ...]
    pilot: str | Factory
    vision: str | Factory
    group: str = field(init=False)
    name: str = field(init=False)

    def __post_init__(self) -> None:
        words = [self.scenario.name, *(f"{key.split('.')[-1]}={value}" for key, value in self.settings)]
        if self.vision != "geometric":
            words.append(factories.name_of(self.vision))
        pilot = factories.name_of(self.pilot)
        object.__setattr__(self, "group", re.sub(r"[^\w.=,+-]", "_", re.sub(r"[\[\]\"' ]", "", "_".join(words))))
        object.__setattr__(self, "name", f"{self.group}_{re.sub(r'[^0-9A-Za-z_.-]', '.', pilot)}")


def load_suite(source: str | Path) -> Suite:
    """The packaged suite of that name, or the one in a TOML file; ConfigError names what is wrong."""
    source = str(source)
    if source.endswith(".toml"):
        table = read_toml(Path(source))
    elif source in packaged_names("suites"):
        table = packaged_toml(f"suites/{source}")
    else:
        known, scenario = ", ".join(packaged_names("suites")), source in packaged_names("scenarios")
        hint = f"; it is a scenario: --scenario {source}" if scenario else ""
        raise ConfigError(f"no suite {source!r}; there are: {known}, or give a path that ends in .toml{hint}")
    return build(Suite, {"name": Path(source).stem} | table, "suite")


OF_THE_FLIER = ("description", "vision", "detector", "selector", "guidance", "safety")
"""Sections of a scenario that say how it is seen and flown: what a suite compares, not what it sets."""


_ADDED: dict[str, tuple[tuple[str, Any], ...]] = {
    "rig": (("landing_area", "square"), ("hull", "platform"), ("house_length_m", None), ("status_light_m", 0.0)),
    "ship": (("waves_off_s", []),),
    "scene": (("wake", 0.0),),
    "fault_draw": (("size", None), ("direction_in_level", None)),
}
"""Keys younger than the digests on record, with the values that leave a flight as it was."""


def sealed_seeds(salt: Path, first: int, count: int) -> list[int]:
    """Seeds that nobody knows without the salt: of each number from `first` on, 48 bits of its SHA-256 with the salt.

    ConfigError where the file cannot be read, or holds fewer than 16 bytes.
    """
    secret = _secret(salt)
    digests = (hashlib.sha256(b"shipland seed %d " % index + secret) for index in range(first, first + count))
    return [int.from_bytes(digest.digest()[:6]) for digest in digests]


def salt_digest(salt: Path) -> str:
    """What the referee may publish beforehand to be held to the salt; errors as of `sealed_seeds`."""
    return hashlib.sha256(b"shipland salt " + _secret(salt)).hexdigest()[:16]


def _secret(salt: Path) -> bytes:
    try:
        secret = salt.read_bytes().strip()
    except OSError as error:
        raise ConfigError(f"{salt} cannot be read: {error.strerror}") from None
    if len(secret) < 16:
        raise ConfigError(f"{salt} holds {len(secret)} bytes, too few for a secret; expected 16 or more")
    return secret


def task_digest(cells: Sequence[Cell]) -> str:
    """Digest of what every flight of some cells meets: their configurations without those who see and fly."""
    tasks = []
    for cell in cells:
        task = {key: value for key, value in cell.scenario.table().items() if key not in OF_THE_FLIER}
        for section, added in _ADDED.items():
            task[section] = {key: value for key, value in task[section].items() if (key, value) not in added}
        tasks.append(config_digest(as_before(task) | {"by": factories.name_of(cell.vision)}))
    return config_digest({"tasks": sorted(tasks)})


@dataclass(frozen=True)
class Overrides:
    """What a command lays over the entries of a suite: who flies every cell, and a TOML file over every scenario.

    Attributes:
        changes: texts `section.key=value`, as in `SuiteEntry.set`.
        only: shell patterns; cells whose group matches none are left out. Empty: all.
    """

    pilots: tuple[str | Factory, ...]
    changes: tuple[str, ...] = ()
    config: Path | None = None
    only: tuple[str, ...] = ()


def cells_of(entries: Sequence[SuiteEntry], asked: Overrides) -> list[Cell]:
    """The cells in order, pilots innermost.

    ConfigError where scenario, pilot or vision is not known, a setting is wrong or there twice, or nothing is left to
    fly.
    """
    for key, count in Counter(setting(text)[0] for text in asked.changes).items():
        if count > 1:
            raise ConfigError(f"{key} is set {count} times; its values stand in one text, as {key}=A,B")
    for pilot in asked.pilots:
        factories.resolve("pilots", pilot)
    found: dict[str, Cell] = {}
    for entry in entries:
        factories.resolve("visions", entry.vision)
        changes = (*entry.set, *asked.changes)
        for name in entry.scenarios:
            for settings in combinations(changes):
                laid_over = [f"{key}={value}" for key, value in settings]
                scenario = load_scenario(scenario_table(name, asked.config, laid_over))
                for pilot in asked.pilots:
                    cell = Cell(scenario, settings, pilot, entry.vision)
                    other = found.setdefault(cell.name, cell)
                    if (other.scenario, other.pilot) != (cell.scenario, cell.pilot):
                        raise ConfigError(f"two cells are called {cell.name} and differ; rename scenario or pilot")
    patterns = asked.only or ("*",)
    chosen = [it for it in found.values() if any(fnmatch.fnmatchcase(it.group, each) for each in patterns)]
    if not chosen:
        raise ConfigError(f"no cell is called {' or '.join(asked.only)}; see `shipland suites SUITE`")
    return chosen


def combinations(changes: Sequence[str]) -> list[tuple[tuple[str, str], ...]]:
    """Every combination of the values in `changes`, as (key, value) pairs, the last key varying fastest.

    Equal values (1 and 1.0) are one. ConfigError where a text is no setting, or lacks a value between its commas.
    """
    options = []
    for text in changes:
        key, values = setting(text)
        if "" in values and not re.search("[\"']", text):
            raise ConfigError(f"--set {text}: a value is missing between the commas")
        different = (value for at, value in enumerate(values) if value not in values[:at])
        options.append([(key, text_of(value)) for value in different])
    return list(itertools.product(*options))


def text_of(value: object) -> str:
    """A TOML value as `--set` takes it; quotes only where they keep it one string."""
    bare = isinstance(value, str) and value != "" and setting(f"key={value}")[1] == [value]
    return str(value) if bare else toml_value(value)
