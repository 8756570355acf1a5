"""What a pilot or a vision has given is of the types that it promised, made of plain numbers; else an error says why.

Users bring pilots and visions, and Python checks no types: a result goes on only through here. Whether its numbers are
finite and plausible is the input gate's and the safety's question. What is promised is what the classes of `messages`
annotate; in nearly every cycle all of it is kept, and then the very object that was given goes on.
"""

from __future__ import annotations

import dataclasses
import itertools
import logging
import math
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import UnionType
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np

from shipland.frames import Array
from shipland.messages import BarPose, Box, Decision, DeckSight, Estimate, GimbalAttitude, Observation, PilotCommand

Sound = TypeVar("Sound")
Raised = TypeVar("Raised", bound=BaseException)
_MOST_PERCENT, _MOST_RAD = 1e6, 2.0 * math.pi
"""Largest magnitudes of a stick and of a camera's pitch; products of larger ones might overflow."""
_MOST_WORDS = 1000
"""Characters of a reason that are kept."""
_MOST_KINDS = 5
"""Kinds of errors that are logged in one flight, a traceback each: logging takes time."""
ENDS_THE_PROCESS = (KeyboardInterrupt, SystemExit, GeneratorExit)
"""What is raised to end more than a cycle; whatever else a pilot or a vision raises costs its cycle."""
_FLOAT = np.dtype(float)
"""Of plain arrays."""


def sound_decision(given: object) -> Decision:
    """A pilot's decision of plain values.

    Raises:
        TypeError: something is not of its type.
        ValueError: a stick or the camera's pitch is beyond any.
        OverflowError: a number is beyond what a float can hold.
    """
    decision = _sound(given, "a decision", Decision)
    command, probability = decision.command, decision.landing_probability
    for stick in command.sticks_percent:  # what is not finite is the safety's to say
        if _MOST_PERCENT < abs(stick) < math.inf:
            raise ValueError(f"a stick at {stick:g} %")
    if _MOST_RAD < abs(command.gimbal_pitch_rad) < math.inf:
        raise ValueError(f"the camera's pitch at {command.gimbal_pitch_rad:g} rad")
    if probability is not None and not 0.0 <= probability <= 1.0:
        raise ValueError(f"a landing_probability of {probability:g}")
    if command.at_contact_height:  # is the safety's to say
        decision = dataclasses.replace(decision, command=dataclasses.replace(command, at_contact_height=False))
    return decision


def sound_observation(given: object) -> Observation:
    """A vision's observation of plain values; raises as `sound_decision` does, ValueError also of a wrong shape."""
    return _sound(given, "an observation", Observation)


def words_of(error: BaseException) -> str:
    """An error in one line, whatever its own words do."""
    text = type(error).__name__
    with suppress(Exception):  # its attributes may be anything
        text = "".join(traceback.format_exception_only(error))
    return " ".join(text.split())[:_MOST_WORDS]


def log_failure(
    log: logging.Logger, words: str, error: BaseException, known: set[type[BaseException]] | None = None
) -> None:
    """Log the traceback of a failure in code that users bring, where it is new; never raises, whatever the error does.

    Args:
        log: the module's.
        words: what failed, and when.
        error: what was raised.
        known: see `is_new`.
    """
    with suppress(Exception):
        if is_new(error, known):
            log.error(words, exc_info=error)


def is_new(error: Raised, known: set[type[Raised]] | None) -> bool:
    """Whether an error is of a kind that was not logged yet, which it then is; of many kinds the first few count."""
    if known is None:
        return True
    if type(error) in known or len(known) >= _MOST_KINDS:
        return False
    known.add(type(error))
    return True


def _sound(given: Any, name: str, cls: Callable[..., Sound]) -> Sound:  # noqa: ANN401 - whatever a user gave
    value = _of(given, cls, name)
    if type(value) is cls and _is_plain(value):
        return cast(Sound, value)
    return cls(*(_part(getattr(value, field), field, kinds) for field, kinds in _FIELDS[cls].items()))


def _part(value: Any, name: str, kinds: tuple[type, ...]) -> Any:  # noqa: ANN401 - a value of any of its kinds
    """The sound value of a field that may be of any of these types."""
    if value is None and type(None) in kinds:
        return None
    convert = _CONVERTED.get(kinds[0])
    if convert is not None:
        return convert(value, name)
    return _sound(value, name, kinds[0]) if kinds[0] in _FIELDS else _of(value, kinds[0], name)


def _is_plain(value: object) -> bool:
    """Whether the fields of a value of one of our classes are of exactly their types: it needs no conversion."""
    parts = vars(value).values()
    if tuple(map(type, parts)) not in _TYPES[type(value)]:
        return False
    for part in parts:
        check = _CHECKED.get(type(part))
        if check is not None and not check(part):
            return False
    return True


def _of(value: object, cls: Any, name: str) -> Any:  # noqa: ANN401 - the caller's class
    if not isinstance(value, cls):
        wanted = cls[0] if isinstance(cls, tuple) else cls
        raise TypeError(f"{name} is a {type(value).__name__}, expected a {wanted.__name__}")
    return value


def _number(value: Any, name: str) -> float:  # noqa: ANN401 - whatever a user gave
    if isinstance(value, str | bytes | bytearray):
        raise TypeError(f"{name} is a {type(value).__name__}, expected a number")
    return float(value)


def _pair(value: Sequence[float], name: str) -> tuple[float, float]:
    first, second = value
    return _number(first, name), _number(second, name)


def _array(value: object, name: str) -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} holds {array.dtype.name}, expected numbers")
    return array.astype(float, copy=False)


def _words(value: str, name: str) -> str:
    """A text as a log can take it."""
    text: str = _of(value, str, name)
    return text[:_MOST_WORDS].encode("utf-8", "replace").decode("utf-8")


def _flag(value: object, name: str) -> bool:
    return bool(_of(value, (bool, np.bool_), name))


def _kinds(hint: Any) -> tuple[type, ...]:  # noqa: ANN401 - an annotation
    """The types that an annotation allows, without what they hold."""
    alternatives = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return tuple(get_origin(each) or each for each in alternatives)


_CONVERTED: dict[type, Callable[[Any, str], object]] = {
    float: _number,
    tuple: _pair,
    np.ndarray: _array,
    str: _words,
    bool: _flag,
}
_FIELDS: dict[object, dict[str, tuple[type, ...]]] = {
    cls: {name: _kinds(hint) for name, hint in get_type_hints(cls).items()}
    for cls in (GimbalAttitude, BarPose, Box, DeckSight, Observation, PilotCommand, Estimate, Decision)
}
"""The types that each field may have, by class."""
_TYPES = {cls: set(itertools.product(*fields.values())) for cls, fields in _FIELDS.items()}
"""Those that all fields together may have."""
_CHECKED: dict[object, Callable[[Any], bool]] = {
    **dict.fromkeys(_FIELDS, _is_plain),
    np.ndarray: lambda array: array.dtype == _FLOAT,
    tuple: lambda pair: tuple(map(type, pair)) == (float, float),
    str: lambda text: text.isascii() and len(text) <= _MOST_WORDS,
}
"""Of what has its type, whether it is plain inside too."""
