"""Spoils messages field by field: NaN, infinities, out of range, old, missing."""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
_NUMBERS = (float("nan"), float("inf"), float("-inf"), 1e12, -1e12, 1e6, -1e6)
_OLD_SHARE = 0.1
"""Share of spoiled messages that are replaced by an earlier one as a whole."""


class FaultInjector:
    """Spoils messages of any type, and remembers the last good one of each."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._good: dict[type, Any] = {}

    def spoiled(self, value: T, share: float) -> T:
        """The message with that share of its fields spoiled; as it is for a share of 0."""
        if share == 0.0:
            self._good[type(value)] = value
            return value
        if self._rng.random() < _OLD_SHARE * share and type(value) in self._good:
            return typing.cast(T, self._good[type(value)])
        return typing.cast(T, _spoil(value, share, self._rng))


_NOT_SPOILED = {"stamp_s", "gimbal_age_s", "alerts"}
"""Skipped without a draw, so that a flight's spoiled values stay what they were."""


def _spoil(value: Any, share: float, rng: np.random.Generator) -> Any:  # noqa: ANN401 - messages of any type
    """A message with some of its fields spoiled, its arrays keeping their shape."""
    hints = typing.get_type_hints(type(value))
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(value):
        if field.name in _NOT_SPOILED:
            continue
        before = getattr(value, field.name)
        optional = type(None) in typing.get_args(hints[field.name])
        if dataclasses.is_dataclass(before):
            changes[field.name] = _spoil(before, share, rng)
        if rng.random() >= share:
            continue
        number = float(rng.choice(_NUMBERS))
        if before is not None and optional and rng.random() < 0.3:
            changes[field.name] = None
        elif isinstance(before, float):
            changes[field.name] = number
        elif isinstance(before, tuple) and before:
            index = int(rng.integers(len(before)))
            changes[field.name] = (*before[:index], number, *before[index + 1 :])
        elif isinstance(before, np.ndarray) and before.dtype == float and before.size:
            spoiled = before.copy()
            spoiled.flat[int(rng.integers(before.size))] = number
            changes[field.name] = spoiled
    return replace(value, **changes) if changes else value
