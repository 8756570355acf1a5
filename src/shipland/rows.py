"""Dataclasses to flat rows of JSON values and back, without loss, by their annotations.

A nested field's name is its path joined by underscores: `telemetry.roll_rad` becomes `telemetry_roll_rad`. A part
that is None leaves all its columns null, so every row of one type has the same columns. Arrays are flat lists, row by
row. Numbers that JSON lacks (NaN, ±inf) become null and come back as NaN. A tuple of dataclasses is JSON text.

The schema keeps to what the parsers of Foxglove and Lichtblick take: one type a column, no arrays in arrays, no "null".
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import json
import math
import types
import typing
from typing import Any, TypeVar

import numpy as np

from shipland.config import build
from shipland.descriptions import descriptions
from shipland.errors import DataError
from shipland.files import json_of
from shipland.former import todays

T = TypeVar("T")
Row = dict[str, Any]

_WIDTHS = {"rotation": 3, "covariance": 4, "corners_px": 2, "matrix": 3}
"""Columns of the fields that are two-dimensional arrays."""

_JSON_TYPES: dict[type, str] = {float: "number", int: "integer", bool: "boolean", str: "string"}


@dataclasses.dataclass(frozen=True)
class _Part:
    """One field: a dataclass of more parts, or a leaf.

    Attributes:
        kind: its annotation, without None.
        item: the dataclass that it is a tuple of, if it is.
        columns: of the leaves in it; a picture has none.
    """

    field: str
    kind: Any
    optional: bool
    meaning: str
    has_default: bool
    parts: tuple[_Part, ...]
    item: Any
    columns: tuple[str, ...]


def to_row(value: object) -> Row:
    """The flat row of a dataclass instance; pictures (uint8 arrays) are left out."""
    row: Row = {}
    for part in _parts(type(value), ""):
        _write(row, part, getattr(value, part.field))
    return row


def from_row(cls: type[T], row: Row) -> T:
    """The instance of dataclass `cls` that `to_row` flattened.

    Columns that it does not know are passed over, and fields with a default need none: a log from before the field
    was added is read all the same.

    Raises:
        DataError: another column is missing, or one holds the wrong type.
    """
    try:
        return cls(**_values(row, _parts(cls, "")))
    except KeyError as error:
        raise DataError(
            f"a row of {cls.__name__} lacks the column {error}; was it written by another version?"
        ) from None
    except (AttributeError, OverflowError, TypeError, ValueError) as error:
        raise DataError(f"a row of {cls.__name__} cannot be read: {error}") from None


def json_schema(cls: type, title: str) -> Row:
    """JSON Schema of the rows of dataclass `cls`; a column's description is what the docstrings say of the field."""
    properties: Row = {}
    for part in _parts(cls, ""):
        _describe(properties, part, "")
    return {"title": title, "type": "object", "properties": properties}


def _parts(cls: Any, prefix: str) -> tuple[_Part, ...]:  # noqa: ANN401 - mypy holds no class for hashable
    return _cached_parts(cls, prefix)


@functools.cache
def _cached_parts(cls: Any, prefix: str) -> tuple[_Part, ...]:  # noqa: ANN401
    hints, meanings, missing = typing.get_type_hints(cls), descriptions(cls), dataclasses.MISSING
    parts = []
    for field in dataclasses.fields(cls):
        hint, optional = hints[field.name], False
        if typing.get_origin(hint) in (typing.Union, types.UnionType):
            choices = [choice for choice in typing.get_args(hint) if choice is not type(None)]
            hint, optional = choices[0], True
        if typing.get_origin(hint) is typing.Literal:  # a choice of words is a text
            hint = str
        column = f"{prefix}{field.name}"
        children = _parts(hint, f"{column}_") if dataclasses.is_dataclass(hint) else ()
        columns = tuple(name for child in children for name in child.columns) if children else (column,)
        item = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else None
        has_default = (field.default, field.default_factory) != (missing, missing)
        parts.append(
            _Part(
                field.name, hint, optional, meanings.get(field.name, ""), has_default, children,
                item if dataclasses.is_dataclass(item) else None, () if _is_picture(hint) else columns,
            )
        )  # fmt: skip
    return tuple(parts)


def _is_picture(hint: Any) -> bool:  # noqa: ANN401 - annotations of any form
    return typing.get_origin(hint) is np.ndarray and np.uint8 in typing.get_args(typing.get_args(hint)[1])


def _write(row: Row, part: _Part, value: Any) -> None:  # noqa: ANN401
    if part.parts:
        for child in part.parts:
            _write(row, child, None if value is None else getattr(value, child.field))
    elif part.item is not None:
        row[part.columns[0]] = json.dumps([dataclasses.asdict(item) for item in value])
    elif part.columns:
        if isinstance(value, np.ndarray) and value.ndim == 2:
            if value.shape[1] != _WIDTHS[part.field]:
                raise ValueError(f"{part.columns[0]} wants {_WIDTHS[part.field]} columns, got {value.shape[1]}")
            value = value.ravel()
        row[part.columns[0]] = _plain(value)


def _plain(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist() if np.isfinite(value).all() else _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _values(row: Row, parts: tuple[_Part, ...]) -> Row:
    """By field; without those that have a default and no column."""
    return {part.field: _read(row, part) for part in parts if not (part.has_default and _absent(row, part))}


def _absent(row: Row, part: _Part) -> bool:
    return not any(column in row for column in part.columns)


def _read(row: Row, part: _Part) -> Any:  # noqa: ANN401
    if part.parts:
        if part.optional and not _absent(row, part) and all(row.get(column) is None for column in part.columns):
            return None
        return part.kind(**_values(row, part.parts))
    if not part.columns:
        return None
    column, origin = part.columns[0], typing.get_origin(part.kind)
    value = row[column]
    if value is None and part.optional:
        return None
    if (members := getattr(part.kind, "__members__", None)) is not None:
        if (name := todays(value)) not in members:
            raise ValueError(f"{column} is {value!r}, expected one of {', '.join(members)}")
        return members[name]
    if part.item is not None:
        return tuple(build(part.item, each, column) for each in json_of(value))
    if origin is np.ndarray:
        array = np.array(value, dtype=float)  # None becomes NaN
        return array.reshape(-1, _WIDTHS[part.field]) if part.field in _WIDTHS else array
    if origin is tuple:
        return tuple(value)
    if part.kind is float:
        return math.nan if value is None else float(value)
    if not isinstance(value, part.kind):
        raise TypeError(f"{column} is {value!r}, expected {part.kind.__name__}")
    return value


def _describe(properties: Row, part: _Part, owner: str) -> None:
    meaning = ": ".join(text.rstrip(".") for text in (owner, part.meaning) if text)
    for child in part.parts:
        _describe(properties, child, meaning)
    if part.parts or not part.columns:
        return
    if hasattr(part.kind, "__members__") or part.item is not None:
        schema: Row = {"type": "string"}
    elif typing.get_origin(part.kind) in (np.ndarray, tuple):
        schema = {"type": "array", "items": {"type": "number"}}
    else:
        schema = {"type": _JSON_TYPES[part.kind]}
    properties[part.columns[0]] = schema | ({"description": meaning} if meaning else {})
