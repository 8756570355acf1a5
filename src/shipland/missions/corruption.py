"""Spoils what vehicle and vision give, field by field, in bursts: NaN, infinities, out of range, stale, missing.

A vehicle that is truthful inside and a liar outside: the flight's physics goes on undisturbed, so that what a burst did
to the sticks and how soon control is back can be measured.
"""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from shipland.messages import Frame, Observation, PilotCommand, Telemetry
from shipland.vehicles.vehicle import Vehicle
from shipland.vision.vision import Vision

T = TypeVar("T")
_NUMBERS = (float("nan"), float("inf"), float("-inf"), 1e12, -1e12, 1e6, -1e6)


@dataclass(frozen=True)
class Burst:
    """From when to when values are spoiled [s], and the share of values that are."""

    from_s: float
    to_s: float
    share: float

    def covers(self, t_s: float) -> bool:
        """Whether a time lies in it."""
        return self.from_s <= t_s < self.to_s


def draw_bursts(rng: np.random.Generator, end_s: float, count: int) -> tuple[Burst, ...]:
    """Bursts of 0.05 to 3 s at any moment before `end_s`, from a value now and then to every one."""
    starts_s = np.sort(rng.uniform(0.0, end_s, count))
    return tuple(Burst(float(t), float(t + rng.uniform(0.05, 3.0)), float(rng.uniform(0.02, 1.0))) for t in starts_s)


class Corruptor:
    """Spoils values while a burst lasts, by the vehicle's true time.

    Args:
        vehicle: flown; it is told the truth about time, what it is sent goes through.
        vision: looks at frames.
        bursts: when.
        rng: which fields, and how.
    """

    def __init__(self, vehicle: Vehicle, vision: Vision, bursts: tuple[Burst, ...], rng: np.random.Generator) -> None:
        self._vehicle, self._vision, self._bursts, self._rng = vehicle, vision, bursts, rng
        self._true_s = 0.0
        self._stale: dict[type, Any] = {}

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the vehicle has
        return getattr(self._vehicle, name)

    @property
    def true_s(self) -> float:
        """The vehicle's time, not spoiled."""
        return self._true_s

    def read(self) -> tuple[Frame, Telemetry] | None:
        """A pair of the vehicle, perhaps spoiled."""
        pair = self._vehicle.read()
        if pair is None:
            return None
        self._true_s = pair[1].t_s
        return self._spoiled(pair[0]), self._spoiled(pair[1])

    def telemetry_at(self, t_s: float) -> Telemetry:
        """Telemetry of the vehicle, perhaps spoiled."""
        telemetry = self._vehicle.telemetry_at(t_s)
        self._true_s = telemetry.t_s
        return self._spoiled(telemetry)

    def send(self, command: PilotCommand) -> None:
        """To the vehicle as it is."""
        self._vehicle.send(command)

    def see(self, frame: Frame) -> Observation:
        """What the vision sees, perhaps spoiled."""
        return self._spoiled(self._vision.see(frame))

    def _spoiled(self, value: T) -> T:
        burst = next((burst for burst in self._bursts if burst.covers(self._true_s)), None)
        if burst is None:
            self._stale[type(value)] = value
            return value
        if self._rng.random() < 0.1 * burst.share and type(value) in self._stale:
            return typing.cast(T, self._stale[type(value)])  # the whole of it as before the burst
        return typing.cast(T, _spoil(value, burst.share, self._rng))


def _spoil(value: Any, share: float, rng: np.random.Generator) -> Any:  # noqa: ANN401 - messages of any type
    """A message with some of its fields spoiled, its arrays keeping their shape."""
    hints = typing.get_type_hints(type(value))
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(value):
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
