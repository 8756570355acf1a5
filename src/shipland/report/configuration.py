"""The configuration in words: every key with its value, unit, bounds, meaning and source, for a terminal and a page."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from shipland.config import bounds_of, defaults, fields_of, stated, toml_value
from shipland.descriptions import unit_of
from shipland.scenario.scenario import Scenario, load_scenario, scenario_layers, scenario_table

_WIDTH = 110
"""Characters of a line of comment."""


@dataclass(frozen=True)
class Setting:
    """One key of a configuration.

    Attributes:
        section, name: the sections around it with dots between them, empty above all, and its own name.
        about: what the docstring of the section's class says.
        value: in plain TOML types; None where it is not set.
        bounds: in words; empty where there are none.
        meaning, source: as the field states them; no source where another value than the field's stands.
        file: whose value it is: "default", a TOML file's name, or `--set`.
        default: the field's; equal to `value` where nothing changes it.
    """

    section: str
    about: str
    name: str
    value: Any
    bounds: str
    meaning: str
    source: str
    file: str = "default"
    default: Any = None

    @property
    def differs(self) -> bool:
        """The value is not the default."""
        return bool(self.value != self.default)

    @property
    def unit(self) -> str:
        """Empty for a ratio, a count, a switch or a name."""
        return unit_of(self.name)

    @property
    def key(self) -> str:
        """As `--set` takes it."""
        return f"{self.section}.{self.name}".lstrip(".")


def scenario_settings(source: str | Path, config: Path | None = None, changes: Sequence[str] = ()) -> list[Setting]:
    """Every key of a scenario's configuration under a file and changes, a section's together; ConfigError else."""
    layers = scenario_layers(source, config, changes)
    usual = {setting.key: setting.value for setting in settings_of(Scenario, defaults(Scenario))}
    found = []
    for setting in settings_of(Scenario, load_scenario(scenario_table(source, config, changes)).table()):
        file = next(layer.name for layer in reversed(layers) if _gives(layer.table, setting.key))
        own = setting.source if file == "default" else ""
        found.append(replace(setting, file=file, source=own, default=usual.get(setting.key)))
    return found


def settings_of(cls: type, table: Mapping[str, Any], section: str = "") -> list[Setting]:
    """Every key of a class of parameters, those of a section together; `table` holds the values."""
    found = list(_settings(cls, table, section, "chosen"))
    sections = list(dict.fromkeys([section, *(setting.section for setting in found)]))
    return sorted(found, key=lambda setting: sections.index(setting.section))


def _settings(cls: type, table: Mapping[str, Any], section: str, source: str) -> Iterator[Setting]:
    about = re.sub(r"^`\[[^`]*\]`[:.] ?", "", inspect.getdoc(cls) or "").replace("\n", " ")
    for name, field in fields_of(cls).items():
        value = table.get(name)
        own = stated(field).get("source", source)
        own = source if own == "chosen" else own
        if isinstance(field.annotation, type) and dataclasses.is_dataclass(field.annotation):
            yield from _settings(field.annotation, value or {}, f"{section}.{name}".lstrip("."), own)
        else:
            yield Setting(section, about, name, value, bounds_of(field), field.description or "", own, default=value)


def _gives(table: Any, key: str) -> bool:  # noqa: ANN401 - a table or a value in it
    """Whether a table gives a key, by itself or within the value of a section."""
    name, _, rest = key.partition(".")
    return not isinstance(table, dict) or (name in table and (not rest or _gives(table[name], rest)))


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
    """Meaning, unit, bounds, default, file and source of a setting in one sentence."""
    meaning = setting.meaning or setting.name.replace("_", " ")
    unit = f" [{setting.unit}]" if setting.unit else ""
    bounds = f", {setting.bounds}" if setting.bounds else ""
    packaged = "not set" if setting.default is None else toml_value(setting.default)
    default = f"; default {packaged}" if setting.differs else ""
    source = f": {setting.source}" if setting.source else ""
    return f"{meaning}{unit}{bounds}{default} ({setting.file}{source})"
