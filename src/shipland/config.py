# ruff: noqa: ANN401 - values of any configured type come in
"""Frozen dataclasses of parameters, and how they are read from TOML.

A field states its default, meaning, source and bounds; the last part of its name is its unit. TOML holds what differs.
"""

from __future__ import annotations

import dataclasses
import difflib
import enum
import json
import re
import tomllib
import typing
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import pydantic
from pydantic.fields import FieldInfo

from shipland.errors import ConfigError
from shipland.files import MOST_LEVELS, refuse_deep

T = TypeVar("T")
Table = dict[str, Any]

LARGEST = 1e9
"""Largest magnitude of any configured number; protections have tighter bounds of their own."""

_STRICT = pydantic.ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@typing.dataclass_transform(frozen_default=True)
def parameters(cls: type[T]) -> type[T]:
    """Makes a class a frozen dataclass whose values are checked whenever one is made."""
    return pydantic.dataclasses.dataclass(frozen=True, config=_STRICT)(cls)  # type: ignore[return-value]


def key(default: Any, meaning: str = "", source: str = "chosen", **bounds: float) -> Any:
    """A field of a class of parameters.

    Args:
        default: `...` where a value must be given.
        meaning: for people who configure.
        source: of the default; "chosen": this project's choice, because no source gives it.
        **bounds: `gt`, `ge`, `lt`, `le`, as pydantic has them.
    """
    return pydantic.Field(default, description=meaning, json_schema_extra={"source": source}, **bounds)  # type: ignore[call-overload]


def scaled(default: Any, meaning: str, source: str = "chosen", power: float | None = None, **bounds: float) -> Any:
    """A `key` whose default is the rig's: see `at_scale`; `power` is of the scale, None what the name's end says."""
    field = key(default, meaning, source, **bounds)
    field.json_schema_extra["power"] = power
    return field


_POWERS = {"m": 1.0, "s": 0.5, "mps": 0.5, "mps2": 0.0, "rad_s": -0.5, "per_s": -0.5, "rad_s2": -1.0, "sqrt_s": -0.25}
"""Of the scale of lengths, by the end of a name: Froude's law, by which gravity scales ships and their waves."""


def at_scale(cls: type, scale: float, table: Mapping[str, Any] | None = None) -> Table:
    """Defaults of a class, or of a section that has `table`, for a ship so many times as large as the rig."""
    found: Table = {}
    for name, value in (defaults(cls) if table is None else table).items():
        field = fields_of(cls)[name]
        if isinstance(value, dict) and isinstance(field.annotation, type):
            found[name] = at_scale(field.annotation, scale, value)
        elif "power" in stated(field):
            unit = next((end for end in sorted(_POWERS, key=len, reverse=True) if name.endswith(f"_{end}")), "")
            factor = scale ** (stated(field)["power"] or _POWERS[unit])
            found[name] = _times(value, factor)
        else:
            found[name] = plain(value)
    return found


def _times(value: Any, factor: float) -> Any:
    return [_times(each, factor) for each in value] if isinstance(value, list) else float(f"{value * factor:.4g}")


def stated(field: FieldInfo) -> Mapping[str, Any]:
    """What `key` and `scaled` say of a field besides its meaning."""
    return field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}


def fields_of(cls: type) -> dict[str, FieldInfo]:
    """Default, meaning, source and bounds of the fields of a class of parameters."""
    return getattr(cls, "__pydantic_fields__", {})


def bounds_of(field: FieldInfo) -> str:
    """The bounds of a field in words; empty where it has none."""
    limits = ("gt", "ge", "lt", "le")
    found = {name: getattr(each, name) for each in field.metadata for name in limits if hasattr(each, name)}
    low, high = found.get("ge", found.get("gt")), found.get("le", found.get("lt"))
    if low is None or high is None:
        words = {"gt": "more than {:g}", "ge": "{:g} or more", "lt": "less than {:g}", "le": "{:g} or less"}
        return "".join(words[name].format(value) for name, value in found.items())
    return f"{'above ' * ('gt' in found)}{low:g} to {'below ' * ('lt' in found)}{high:g}"


def read_toml(path: Path) -> Table:
    """The table in a TOML file; ConfigError when it is missing or broken."""
    try:
        return _parsed(path.read_text(encoding="utf-8-sig"))  # -sig: some editors write a byte-order mark
    except FileNotFoundError:
        raise ConfigError(f"configuration file {path} does not exist") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"configuration file {path} cannot be read: {error}") from None
    except ValueError as error:
        raise ConfigError(f"configuration file {path} is not valid TOML: {error}") from None


def _parsed(text: str) -> Table:
    """The table of a TOML text; ValueError, whatever is wrong with it."""
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    refuse_deep(table)
    return table


def packaged_toml(name: str) -> Table:
    """The packaged table `configs/<name>.toml`, name as in `folder/name`; ConfigError names the ones there are."""
    folder, _, stem = name.rpartition("/")
    known = packaged_names(folder)
    if stem not in known:
        raise ConfigError(f"no packaged configuration {name!r}; there are: {', '.join(known)}")
    entry = (resources.files("shipland") / "configs").joinpath(folder, f"{stem}.toml")
    return tomllib.loads(entry.read_text(encoding="utf-8"))


def packaged_names(folder: str) -> list[str]:
    """Names of the packaged TOML files in `configs/<folder>`, sorted; ConfigError when there is no such folder."""
    directory = (resources.files("shipland") / "configs").joinpath(folder)
    if not directory.is_dir():
        raise ConfigError(f"no folder {folder!r} of packaged configurations")
    return sorted(item.name.removesuffix(".toml") for item in directory.iterdir() if item.name.endswith(".toml"))


def merge(base: Mapping[str, Any], overlay: Mapping[str, Any]) -> Table:
    """`base` with `overlay` laid over it; tables merge key by key, everything else is replaced."""
    merged: Table = dict(base)
    for key, value in overlay.items():
        below = merged.get(key)
        merged[key] = merge(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged


def setting(text: str) -> tuple[str, list[Any]]:
    """Key and values of `section.key=value`, as `--set` takes it.

    The value is TOML; what is not valid TOML is a string, so that `ship.motion=sea` needs no quotes. Values with
    commas between them, outside brackets and quotes, are several: `wind.mean_mps=0,3,6`.

    Raises:
        ConfigError: there is no `=`, or the key is no TOML key.
    """
    key, equals, rest = text.partition("=")
    key = key.strip()
    if not equals or not re.fullmatch(r"[\w-]+(\.[\w-]+)*", key) or key.count(".") >= MOST_LEVELS:
        raise ConfigError(f"--set {_shortened(text)}: expected section.key=value, as wind.mean_mps=5")
    values = _toml_value(f"[{rest}]")
    if values is _INVALID:
        several = [] if re.search(r"[\[\]{}\"']", rest) else rest.split(",")
        values = [_toml_or_text(part) for part in several] or [_toml_or_text(rest)]
    if not values:
        raise ConfigError(f"--set {_shortened(text)}: a value is missing")
    return key, values


_INVALID = object()


def _toml_value(text: str) -> Any:
    try:
        return _parsed(f"value = {text}")["value"]
    except ValueError:
        return _INVALID


def _toml_or_text(text: str) -> Any:
    value = _toml_value(text)
    return text.strip() if value is _INVALID else value


def toml_value(value: Any) -> str:
    """A value as TOML writes it, in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(item)}" for key, item in value.items()) + " }" if value else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else str(value)


def settings(texts: Iterable[str]) -> Table:
    """The table that several `section.key=value` make, later ones over earlier ones.

    Raises:
        ConfigError: as `setting`; or a key with several values.
    """
    table: Table = {}
    for text in texts:
        key, values = setting(text)
        if len(values) > 1:
            raise ConfigError(f"--set {_shortened(text)}: one value is wanted here; a list is written in brackets")
        table = merge(table, nested({key: values[0]}))
    return table


def nested(table: Mapping[str, Any]) -> Table:
    """A table with its dotted keys (`"wind.mean_mps"`) made into tables."""
    result: Table = {}
    for key, value in table.items():
        inner = nested(value) if isinstance(value, Mapping) else value
        for part in reversed(key.split(".")):
            inner = {part: inner}
        result = merge(result, inner)
    return result


def sections(path: Path | None, known: Iterable[str]) -> Table:
    """The user's file of some sections; empty without one.

    Raises:
        ConfigError: the file is missing or broken, or holds a section that is not known; names the nearest;
            or a value in place of a section.
    """
    user = {} if path is None else read_toml(path)
    for section, table in user.items():
        if section not in known:
            near = difflib.get_close_matches(section, known, n=1, cutoff=0.0)[0]
            raise ConfigError(f"{path}: unknown section [{section}]; did you mean [{near}]?")
        if not isinstance(table, Mapping):
            raise ConfigError(f"{path}: expected a section [{section}], got {_shown(table)}")
    return user


_PLAIN = {bool, int, float, str, type(None)}


def plain(value: Any) -> Any:
    """A value, or a dataclass with all that is in it, in plain TOML and JSON types."""
    if type(value) in _PLAIN:
        return value
    if dataclasses.is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, enum.Enum):
        return value.value
    if hasattr(value, "tolist"):  # NumPy's numbers and arrays
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


@cache
def defaults(cls: type) -> Table:
    """The defaults of a class of parameters as a table; to be merged, never changed."""
    return {name: plain(field.default) for name, field in fields_of(cls).items() if not field.is_required()}


def build(cls: type[T], table: Mapping[str, Any], where: str = "configuration") -> T:
    """An instance of a class of parameters from a table laid over its defaults.

    Args:
        cls: a dataclass; its fields may be bool, int, float, str, Path, an Enum, Literal, Optional,
            homogeneous or fixed tuples, or dataclasses again.
        table: the values; a missing key has the field's default.
        where: the table's name, for messages.

    Raises:
        ConfigError: unknown key (with the nearest known name), missing key, wrong type, or a value that
            a field's bounds or the dataclass itself refuse.
    """
    if not isinstance(table, Mapping):
        raise ConfigError(f"{where}: expected a table, got {_shown(table)}")
    kind: type = cls
    whole = plain(merge(defaults(kind), table))
    _refuse_large(whole, where)
    try:
        return typing.cast(T, _reader(kind)(json.dumps(whole, default=str)))
    except pydantic.ValidationError as error:
        raise ConfigError(_told(cls, error, where)) from None


@cache
def _reader(cls: type) -> Callable[[str], Any]:
    """Reads JSON, in which a list may be a tuple, a text a member of an Enum, and nothing else is converted."""
    if not hasattr(cls, "__pydantic_config__"):
        cls.__pydantic_config__ = _STRICT  # type: ignore[attr-defined]
    return pydantic.TypeAdapter(cls).validate_json


def _refuse_large(value: Any, where: str) -> None:
    """Of a table in plain types."""
    if isinstance(value, dict):
        for name, item in value.items():
            _refuse_large(item, f"{where}.{name}")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _refuse_large(item, f"{where}[{index}]")
    elif isinstance(value, float) and not abs(value) <= LARGEST:
        raise ConfigError(f"{where}: expected {-LARGEST:g} to {LARGEST:g}, got {_shown(value)}")
    elif isinstance(value, int) and abs(value) >= 2**63:
        raise ConfigError(f"{where}: expected a number of 64 bits, got {_shown(value)}")


def _told(cls: type, error: pydantic.ValidationError, where: str) -> str:
    """What is wrong in one line; a misspelled key goes before the one that it leaves missing."""
    first = min(error.errors(include_url=False), key=lambda each: each["type"] != "unexpected_keyword_argument")
    kind, value, context, steps = first["type"], first["input"], first.get("ctx", {}), first["loc"]
    holder, hint = _at(cls, steps)
    places = [f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps]
    place, around = where + "".join(places), where + "".join(places[:-1])
    if kind == "unexpected_keyword_argument":
        return unknown_key(str(steps[-1]), typing.get_type_hints(holder), around)
    if kind == "missing" and isinstance(steps[-1], int):
        kind, place, hint = "too_short", around, _at(cls, steps[:-1])[1]
    if kind in ("too_short", "too_long"):
        return f"{place}: expected {len(typing.get_args(hint))} values, got {len(value)}"
    if kind == "missing":
        return f"{around}: missing key {str(steps[-1])!r}"
    if kind == "value_error":
        return f"{place}: {context['error']}"
    if kind in ("literal_error", "enum"):
        return f"{place}: {_shown(value)} is none of {context['expected'].replace(' or ', ', ')}"
    field = fields_of(holder).get(str(steps[-1])) if steps else None
    if kind in _BEYOND and field is not None:
        return f"{place}: expected {bounds_of(field)}, got {_shown(value)}"
    wanted = _EXPECTED.get(kind.rpartition("_")[0], "")
    return (
        f"{place}: expected {wanted}, got {_shown(value)}"
        if wanted
        else f"{place}: {first['msg']}, got {_shown(value)}"
    )


_BEYOND = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")
_EXPECTED = {
    "bool": "bool", "float": "float", "int": "int", "int_from": "int", "string": "str", "path": "Path",
    "dataclass": "a table", "tuple": "a list",
}  # fmt: skip
"""What was expected, by the first part of an error's type."""


def unknown_key(name: str, known: Iterable[str], where: str) -> str:
    """What to say of a key that is not known: its name of today, what is there instead, or the nearest."""
    from shipland.former import FORMER, GONE

    known = list(known)
    if FORMER.get(name) in known:
        return f"{where}: {name!r} is called {FORMER[name]!r} now"
    if instead := GONE.get(f"{where}.{name}".partition(".")[2]):
        return f"{where}: {name!r} is no key any more; {instead}"
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    return f"{where}: unknown key {name!r}; " + (f"did you mean {near[0]!r}?" if near else "it takes none")


def _at(cls: type, steps: Iterable[int | str]) -> tuple[type, Any]:
    """The innermost dataclass that a place is in, and what is expected there."""
    holder, hint = cls, typing.cast(Any, cls)
    for step in steps:
        choices = hint, *typing.get_args(hint)
        if isinstance(step, str):
            holder = typing.cast(type, next((each for each in choices if dataclasses.is_dataclass(each)), holder))
            hint = typing.get_type_hints(holder).get(step)
        else:
            listed = next((each for each in choices if typing.get_origin(each) is tuple), hint)
            inside = typing.get_args(listed)
            hint = inside[0] if Ellipsis in inside else listed if len(inside) <= step else inside[step]
    return holder, hint


def _shown(value: object) -> str:
    """A value of the user's, for a message."""
    try:
        return _shortened(repr(value))
    except ValueError:  # Python does not write out an integer of thousands of digits
        return "a number of thousands of digits"


def _shortened(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:79]}…"


def require(condition: bool, message: str) -> None:
    """Raise ValueError(message) unless `condition`; for `__post_init__`; `build` makes it a ConfigError."""
    if not condition:
        raise ValueError(message)
