"""The configuration in words: every key with its value, unit, meaning and source, for a terminal and for a page."""

from __future__ import annotations

import dataclasses
import json
import textwrap
import tomllib
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import groupby
from pathlib import Path
from typing import Any

from shipland.config import Table, merge, packaged_text
from shipland.record.descriptions import descriptions, unit_of
from shipland.scenario.scenario import ConfigLayer, Scenario, default_layers, load_scenario, scenario_layers

_WIDTH = 110
"""Characters of a line of comment."""


@dataclass(frozen=True)
class Setting:
    """One key of a configuration.

    Attributes:
        section: the sections around it, with dots between them; empty above all sections.
        name: its own name.
        value: in plain TOML types; None where it is not set.
        meaning: what the docstring of its class says of it.
        source: the comment beside the value.
        file: whose value it is: a TOML file's name, or `--set`.
        default: the packaged value; equal to `value` where nothing changes it.
    """

    section: str
    name: str
    value: Any
    meaning: str
    source: str
    file: str = ""
    default: Any = None

    @property
    def differs(self) -> bool:
        """The value is not the packaged default."""
        return bool(self.value != self.default)

    @property
    def unit(self) -> str:
        """Empty for a ratio, a count, a switch or a name."""
        return unit_of(self.name)

    @property
    def key(self) -> str:
        """As `--set` takes it."""
        return _joined(self.section, self.name)


def scenario_settings(source: str | Path, config: Path | None = None, changes: Iterable[str] = ()) -> list[Setting]:
    """Every key of a scenario's merged configuration, those of a section together.

    Args:
        source: a packaged scenario's name, or the path of a TOML file.
        config: a file laid over it.
        changes: texts `section.key=value` laid over both.

    Raises:
        ConfigError: it names what is wrong.
    """
    layers = scenario_layers(source, config, changes)
    defaults = dict(_leaves(Scenario, _merged(default_layers())))
    comments = [{statement.key: statement.comment for statement in statements(layer.text)} for layer in layers]
    meaning = meanings(Scenario)
    found = []
    for key, value in _leaves(Scenario, _merged(layers)):
        index = max((index for index, layer in enumerate(layers) if _gives(layer.table, key)), default=0)
        section, _, name = key.rpartition(".")
        comment = _comment_of(key, comments[index])
        words = meaning.get(key, "")
        found.append(Setting(section, name, value, words, comment, layers[index].name, defaults.get(key)))
    sections = list(dict.fromkeys(["", *(setting.section for setting in found)]))
    return sorted(found, key=lambda setting: sections.index(setting.section))


def as_toml(settings: Iterable[Setting]) -> str:
    """Settings as TOML that `--scenario FILE.toml` takes, what is known of each in comments above it."""
    lines: list[str] = []
    for section, inside in groupby(settings, key=lambda setting: setting.section):
        lines += ["", f"[{section}]"] if section else []
        for setting in inside:
            lines += textwrap.wrap(_remark(setting), _WIDTH, initial_indent="# ", subsequent_indent="#   ")
            value = setting.value
            lines.append(f"# {setting.name}: not set" if value is None else f"{setting.name} = {toml_value(value)}")
    return "\n".join(lines).strip()


def _remark(setting: Setting) -> str:
    """Meaning, unit, default, file and source of a setting in one sentence."""
    meaning = setting.meaning.rstrip(".;") or setting.name.replace("_", " ")
    unit = f" [{setting.unit}]" if setting.unit else ""
    packaged = "not set" if setting.default is None else toml_value(setting.default)
    default = f"; default {packaged}" if setting.differs else ""
    source = f": {setting.source}" if setting.source else ""
    return f"{meaning}{unit}{default} ({setting.file}{source})"


def packaged_tables(file: str) -> str:
    """Markdown of a packaged file as `default.toml`: see `markdown_tables`."""
    stem = file.removesuffix(".toml")
    known = {
        _joined(section, name): meaning
        for section, cls in _classes(stem).items()
        for name, meaning in meanings(cls).items()
    }
    return markdown_tables(packaged_text(stem), known)


def markdown_tables(text: str, known: Mapping[str, str]) -> str:
    """Markdown: for each section of a TOML text a heading and a table of key, value, unit, meaning and source.

    Args:
        text: with a comment beside each value.
        known: meanings by whole key.
    """
    head = ["| key | value | unit | meaning | source |", "|---|---|---|---|---|"]
    lines: list[str] = []
    for statement in statements(text):
        if statement.header:
            comment = [statement.comment, ""] if statement.comment else []
            lines += ["", f"### `{statement.header}`", "", *comment, *head]
            continue
        if not lines:
            lines += ["### Above all sections", "", *head]
        meaning = known.get(statement.key, "").rstrip(".;")
        cells = (toml_value(statement.value), unit_of(statement.name), meaning, statement.comment)
        value, unit, *words = (cell.replace("|", "&#124;") for cell in cells)
        lines.append(f"| `{statement.name}` | `{value}` | {unit} | {' | '.join(words)} |")
    return "\n".join(lines)


def _classes(stem: str) -> dict[str, type]:
    """The class that reads a packaged file, or each of its sections."""
    from shipland.guidance.response import Response
    from shipland.learning.evaluate import EvaluateParameters
    from shipland.learning.settings import TrainParameters
    from shipland.learning.shots import SynthParameters
    from shipland.report.outputs import OutputParameters
    from shipland.vehicles.anafi.parameters import AnafiParameters
    from shipland.vehicles.camera_stream import StreamParameters
    from shipland.vehicles.checks import PreflightParameters
    from shipland.vehicles.mavlink.parameters import MavlinkParameters
    from shipland.vehicles.touchdown import TouchdownParameters
    from shipland.vision.far.parameters import DetectorParameters

    files: dict[str, dict[str, type]] = {
        "default": {"": Scenario},
        "outputs": {"": OutputParameters},
        "learning": {
            "detector": DetectorParameters,
            "train": TrainParameters,
            "train.far": TrainParameters,
            "train.photos": TrainParameters,
            "synth": SynthParameters,
            "evaluate": EvaluateParameters,
        },
        "vehicles": {
            "mavlink": MavlinkParameters,
            "anafi": AnafiParameters,
            "touchdown": TouchdownParameters,
            "camera": StreamParameters,
            "preflight": PreflightParameters,
            "response.attitude": Response,
            "response.velocity": Response,
        },
    }
    return files[stem]


def meanings(cls: type) -> dict[str, str]:
    """What the docstrings of a dataclass and of those in it say of their fields, by key with dots."""
    found = dict(descriptions(cls))
    for name, inner in _inner(cls).items():
        found |= {f"{name}.{key}": meaning for key, meaning in meanings(inner).items()}
    return found


def _inner(cls: type) -> dict[str, type]:
    """Fields of a dataclass that are dataclasses: its sections."""
    hints = typing.get_type_hints(cls).items()
    return {name: hint for name, hint in hints if isinstance(hint, type) and dataclasses.is_dataclass(hint)}


def _leaves(cls: type, table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Whole key and value of everything below a section that is no section itself."""
    inner = _inner(cls)
    for name, value in table.items():
        if name in inner:
            yield from ((f"{name}.{key}", leaf) for key, leaf in _leaves(inner[name], value))
        else:
            yield name, value


def _merged(layers: Iterable[ConfigLayer]) -> Table:
    """The table of all layers with what the classes add, checked."""
    table: Table = {}
    for layer in layers:
        table = merge(table, layer.table)
    return load_scenario(table).table()


def _gives(table: Table, key: str) -> bool:
    """Whether a table gives a key, by itself or within the value of a section."""
    value: Any = table
    for part in key.split("."):
        if not isinstance(value, dict):
            return True
        if part not in value:
            return False
        value = value[part]
    return True


def _comment_of(key: str, comments: Mapping[str, str]) -> str:
    """The comment beside a key, or beside the inline table that it stands in."""
    while key not in comments and "." in key:
        key = key.rpartition(".")[0]
    return comments.get(key, "")


@dataclass(frozen=True)
class Statement:
    """A line of TOML, or several of one list: a section's `header`, or a `name` of a `section` with its value."""

    header: str
    section: str
    name: str
    value: Any
    comment: str

    @property
    def key(self) -> str:
        """The whole name, with its sections."""
        return _joined(self.section, self.name)


def statements(text: str) -> Iterator[Statement]:
    """The statements of a TOML text, each with the comment behind it."""
    section = pending = ""
    for raw in text.splitlines():
        if raw.startswith("#") or not (pending or raw.strip()):
            continue
        pending = f"{pending}\n{raw}" if pending else raw
        parsed = _split(pending)
        if parsed is None:
            continue  # a value that goes on in the next line
        code, table, comment = parsed
        pending = ""
        if code.startswith("["):
            section = code.strip("[] ")
            yield Statement(code, section, "", None, comment)
        else:
            name = code.partition("=")[0].strip()
            yield Statement("", section, name, reduce(dict.__getitem__, name.split("."), table), comment)


def _split(statement: str) -> tuple[str, Table, str] | None:
    """Code, its table and the comment of one TOML statement, or None while it is not complete."""
    for end in [index for index, letter in enumerate(statement) if letter == "#"] + [len(statement)]:
        code = statement[:end].strip()
        try:
            return code, tomllib.loads(code), statement[end:].lstrip("# ").strip()
        except tomllib.TOMLDecodeError:
            continue
    return None


def toml_value(value: Any) -> str:  # noqa: ANN401 - of any TOML type
    """A value as TOML writes it, in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(item)}" for key, item in value.items()) + " }" if value else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else str(value)


def _joined(*parts: str) -> str:
    return ".".join(part for part in parts if part)
