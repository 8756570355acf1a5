"""Frozen dataclasses from TOML: layers merged, unknown keys refused with the nearest known name.

The packaged TOML files in `shipland/configs` are the single home of every constant and of its source;
dataclasses carry types and checks, not values.
"""

from __future__ import annotations

import dataclasses
import difflib
import enum
import math
import re
import tomllib
import types
import typing
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from shipland.errors import ConfigError
from shipland.files import MOST_LEVELS, refuse_deep
from shipland.former import FORMER, GONE

T = TypeVar("T")
Table = dict[str, Any]

LARGEST = 1e9
"""Largest magnitude of any configured number; protections have tighter bounds of their own."""


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
    return tomllib.loads(packaged_text(name))


def packaged_text(name: str) -> str:
    """The text of a packaged table, with its comments; see `packaged_toml`."""
    folder, _, stem = name.rpartition("/")
    known = packaged_names(folder)
    if stem not in known:
        raise ConfigError(f"no packaged configuration {name!r}; there are: {', '.join(known)}")
    entry = (resources.files("shipland") / "configs").joinpath(folder, f"{stem}.toml")
    return entry.read_text(encoding="utf-8")


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


def layered(name: str, path: Path | None) -> Table:
    """The packaged TOML `name` with the user's file laid over it.

    Raises:
        ConfigError: the file is missing or broken, or holds a section that the packaged one lacks; names the nearest;
            or a value in place of a section.
    """
    base = packaged_toml(name)
    if path is None:
        return base
    user = read_toml(path)
    for section, table in user.items():
        if section not in base:
            near = difflib.get_close_matches(section, base, n=1, cutoff=0.0)[0]
            raise ConfigError(f"{path}: unknown section [{section}]; did you mean [{near}]?")
        if not isinstance(table, Mapping):
            raise ConfigError(f"{path}: expected a section [{section}], got {_shown(table)}")
    return merge(base, user)


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


def _toml_value(text: str) -> Any:  # noqa: ANN401 - any TOML type
    try:
        return _parsed(f"value = {text}")["value"]
    except ValueError:
        return _INVALID


def _toml_or_text(text: str) -> Any:  # noqa: ANN401 - any TOML type
    value = _toml_value(text)
    return text.strip() if value is _INVALID else value


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


def build(cls: type[T], table: Mapping[str, Any], where: str = "configuration") -> T:
    """An instance of the dataclass `cls` from a table, every value checked against its annotation.

    Args:
        cls: a dataclass; its fields may be bool, int, float, str, Path, an Enum, Literal, Optional,
            homogeneous or fixed tuples, or dataclasses again.
        table: the values; a missing key falls back to the field's default where it has one.
        where: the table's name, for messages.

    Raises:
        ConfigError: unknown key (with the nearest known name), missing key, wrong type, or a value that
            the dataclass itself refuses with ValueError.
    """
    if not isinstance(table, Mapping):
        raise ConfigError(f"{where}: expected a table, got {_shown(table)}")
    hints = typing.get_type_hints(cls)
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    for key in table:
        if key not in fields:
            if FORMER.get(key) in fields:
                raise ConfigError(f"{where}: {key!r} is called {FORMER[key]!r} now")
            if instead := GONE.get(f"{where.rpartition('.')[2]}.{key}"):
                raise ConfigError(f"{where}: {key!r} is no key any more; {instead}")
            near = difflib.get_close_matches(key, fields, n=1, cutoff=0.0)
            raise ConfigError(
                f"{where}: unknown key {key!r}; did you mean {near[0]!r}?"
                if near
                else f"{where}: unknown key {key!r}; it takes none"
            )
    values: Table = {}
    for name, field in fields.items():
        if name in table:
            values[name] = _convert(table[name], hints[name], f"{where}.{name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise ConfigError(f"{where}: missing key {name!r}")
    try:
        return cls(**values)
    except ValueError as error:
        raise ConfigError(f"{where}: {error}") from None


def _convert(value: Any, hint: Any, where: str) -> Any:  # noqa: ANN401 - values of any TOML type come in
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        if value not in arguments:
            raise ConfigError(f"{where}: {_shown(value)} is none of {', '.join(map(repr, arguments))}")
        return value
    if origin in (typing.Union, types.UnionType):
        choices = [argument for argument in arguments if argument is not type(None)]
        if value is None:
            return None
        failures: list[str] = []
        for choice in choices:
            try:
                return _convert(value, choice, where)
            except ConfigError as error:
                failures.append(str(error))
        raise ConfigError(failures[-1])
    if origin is tuple:
        return _convert_tuple(value, arguments, where)
    if dataclasses.is_dataclass(hint):
        return value if isinstance(value, typing.cast(type, hint)) else build(typing.cast(type, hint), value, where)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        names = {str(member.value): member for member in hint}
        name = value if isinstance(value, str) else _shown(value)
        if name not in names:
            raise ConfigError(f"{where}: {_shown(value)} is none of {', '.join(names)}")
        return names[name]
    return _convert_scalar(value, hint, where)


def _convert_tuple(value: Any, arguments: tuple[Any, ...], where: str) -> tuple[Any, ...]:  # noqa: ANN401
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where}: expected a list, got {_shown(value)}")
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        arguments = (arguments[0],) * len(value)
    if len(value) != len(arguments):
        raise ConfigError(f"{where}: expected {len(arguments)} values, got {len(value)}")
    return tuple(
        _convert(item, hint, f"{where}[{index}]")
        for index, (item, hint) in enumerate(zip(value, arguments, strict=True))
    )


def _convert_scalar(value: Any, hint: Any, where: str) -> Any:  # noqa: ANN401
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not abs(number) <= LARGEST:
            raise ConfigError(f"{where}: expected {-LARGEST:g} to {LARGEST:g}, got {_shown(value)}")
        return number
    if hint is Path and isinstance(value, str | Path) and "\0" not in str(value):
        return Path(value)
    if hint is int and isinstance(value, int) and not isinstance(value, bool):
        if abs(value) >= 2**63:
            raise ConfigError(f"{where}: expected a whole number of 64 bits, got {_shown(value)}")
        return value
    if hint in (bool, str) and isinstance(value, hint):
        return value
    raise ConfigError(f"{where}: expected {getattr(hint, '__name__', hint)}, got {_shown(value)}")


def _shown(value: object) -> str:
    """A value of the user's, for a message."""
    try:
        return _shortened(repr(value))
    except ValueError:  # Python does not write out an integer of thousands of digits
        return "a number of thousands of digits"


def _shortened(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:79]}…"


def require_within(value: object, **bounds: tuple[float, float]) -> None:
    """ValueError unless each attribute named lies within its bounds, both included; NaN does not."""
    for name, (low, high) in bounds.items():
        found = getattr(value, name)
        require(low <= found <= high, f"{name}: expected {low:g} to {high:g}, got {found:g}")


def require(condition: bool, message: str) -> None:
    """Raise ValueError(message) unless `condition`; for `__post_init__`; `build` makes it a ConfigError."""
    if not condition:
        raise ValueError(message)
