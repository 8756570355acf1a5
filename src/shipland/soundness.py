"""What a pilot or a vision has given is of the types that it promised, made of plain numbers; else an error says why.

Users bring pilots and visions, and Python checks no types: a result goes on only through here. Whether its numbers are
finite and plausible is the input gate's and the safety's question.
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Sequence
from typing import Any

import numpy as np

from shipland.frames import Array
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    DeckSight,
    Estimate,
    GimbalAttitude,
    Intent,
    Mode,
    Observation,
    PilotCommand,
)

_MOST_PERCENT, _MOST_RAD = 1e6, 2.0 * math.pi
"""Largest magnitudes of a stick and of a camera's pitch; products of larger ones might overflow."""
_SCALARS = {"t_s", "yaw_rad", "reprojection_px"}
"""Scalar fields of a pose and of an estimate."""
_POSE_SHAPES = ((3,), (4, 4), (2,))
"""Shapes of a pose's position, covariance and each corner."""
_MOST_WORDS = 1000
"""Characters of a reason that are kept."""
_MOST_KINDS = 5
"""Kinds of errors that are logged in one flight, a traceback each: logging takes time."""


def sound_decision(given: object) -> Decision:
    """A pilot's decision of plain values.

    Raises:
        TypeError: something is not of its type.
        ValueError: a stick or the camera's pitch is beyond any.
        OverflowError: a number is beyond what a float can hold.
    """
    decision = _of(given, Decision, "a decision")
    command = _of(decision.command, PilotCommand, "its command")
    pitch, roll = _number(command.pitch_percent, "pitch_percent"), _number(command.roll_percent, "roll_percent")
    heave, yaw = _number(command.heave_percent, "heave_percent"), _number(command.yaw_percent, "yaw_percent")
    gimbal_rad = _number(command.gimbal_pitch_rad, "gimbal_pitch_rad")
    for stick in (pitch, roll, heave, yaw):  # what is not finite is the safety's to say
        if _MOST_PERCENT < abs(stick) < math.inf:
            raise ValueError(f"a stick at {stick:g} %")
    if _MOST_RAD < abs(gimbal_rad) < math.inf:
        raise ValueError(f"the camera's pitch at {gimbal_rad:g} rad")
    intent = _of(command.intent, Intent, "its intent")
    sound = PilotCommand(_number(command.t_s, "t_s"), pitch, roll, heave, yaw, gimbal_rad, intent)
    mode = decision.mode if decision.mode is None else _of(decision.mode, Mode, "its mode")
    probability = decision.landing_probability
    if probability is not None and not 0.0 <= _number(probability, "landing_probability") <= 1.0:
        raise ValueError(f"a landing_probability of {probability:g}")
    return Decision(sound, mode, _words(decision.reason), _estimate(decision.estimate), probability)


def sound_observation(given: object) -> Observation:
    """A vision's observation of plain values; raises as `sound_decision` does, ValueError also of a wrong shape."""
    seen = _of(given, Observation, "an observation")
    gimbal = _of(seen.gimbal, GimbalAttitude, "its gimbal")
    return Observation(
        _number(seen.t_s, "t_s"),
        GimbalAttitude(
            _number(gimbal.roll_rad, "roll_rad"),
            _number(gimbal.pitch_rad, "pitch_rad"),
            _number(gimbal.yaw_rad, "yaw_rad"),
        ),
        _pose(seen.bar_pose),
        _box(seen.bar_box, "bar_box"),
        _box(seen.ship_box, "ship_box"),
        _words(seen.reason),
        bool(_of(seen.learned, (bool, np.bool_), "learned")),
        _deck(seen.deck),
        _number(seen.gimbal_off_rad, "gimbal_off_rad"),
        bool(_of(seen.waves_off, (bool, np.bool_), "waves_off")),
    )


def words_of(error: BaseException) -> str:
    """An error in one line, whatever its own words do."""
    text = "".join(traceback.format_exception_only(error))
    return " ".join(text.split())[:_MOST_WORDS]


def is_new(error: Exception, known: set[type[Exception]] | None) -> bool:
    """Whether an error is of a kind that was not logged yet, which it then is; of many kinds the first few count."""
    if known is None:
        return True
    if type(error) in known or len(known) >= _MOST_KINDS:
        return False
    known.add(type(error))
    return True


def _estimate(given: Estimate | None) -> Estimate | None:
    if given is None or (_is_plain(given, Estimate) and given.aircraft_in_bar_m.shape == (3,)):
        return given
    estimate = _of(given, Estimate, "its estimate")
    velocity, covariance = estimate.velocity_in_bar_mps, estimate.covariance
    return Estimate(
        _number(estimate.t_s, "t_s"),
        _array(estimate.aircraft_in_bar_m, "aircraft_in_bar_m"),
        _number(estimate.yaw_rad, "yaw_rad"),
        None if velocity is None else _array(velocity, "velocity_in_bar_mps"),
        None if covariance is None else _array(covariance, "covariance"),
    )


def _pose(given: BarPose | None) -> BarPose | None:
    if given is None or (_is_plain(given, BarPose) and _pose_shapes(given) == _POSE_SHAPES):
        return given
    pose = _of(given, BarPose, "bar_pose")
    return BarPose(
        _array(pose.position_in_bar_m, "position_in_bar_m"),
        _number(pose.yaw_rad, "yaw_rad"),
        _array(pose.covariance, "covariance"),
        _number(pose.reprojection_px, "reprojection_px"),
        _array(pose.corners_px, "corners_px"),
    )


def _pose_shapes(pose: BarPose) -> tuple[object, ...]:
    return pose.position_in_bar_m.shape, pose.covariance.shape, pose.corners_px.shape[1:]


def _box(given: Box | None, name: str) -> Box | None:
    if given is None:
        return None
    box = _of(given, Box, name)
    return Box(_pair(box.centre_px, "centre_px"), _pair(box.size_px, "size_px"), _number(box.confidence, "confidence"))


def _deck(given: DeckSight | None) -> DeckSight | None:
    if given is None:
        return None
    deck = _of(given, DeckSight, "deck")
    normal = deck.normal_in_level
    return DeckSight(
        _array(deck.centre_in_level_m, "centre_in_level_m"),
        _array(deck.deviation_m, "deviation_m"),
        None if normal is None else _array(normal, "normal_in_level"),
    )


def _is_plain(value: object, cls: type) -> bool:
    """Whether a value has exactly this class, with floats and arrays of floats only: it needs no further check."""
    return type(value) is cls and all(
        type(part) is float or (type(part) is np.ndarray and part.dtype == np.float64 and name not in _SCALARS)
        for name, part in vars(value).items()
    )


def _of(value: object, cls: Any, name: str) -> Any:  # noqa: ANN401 - the caller's class
    if not isinstance(value, cls):
        wanted = cls[0] if isinstance(cls, tuple) else cls
        raise TypeError(f"{name} is a {type(value).__name__}, expected a {wanted.__name__}")
    return value


def _number(value: Any, name: str) -> float:  # noqa: ANN401 - whatever a user gave
    if type(value) is float:
        return value
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


def _words(value: object) -> str:
    """A text as a log can take it."""
    if not isinstance(value, str):
        raise TypeError(f"reason is a {type(value).__name__}, expected a str")
    return value[:_MOST_WORDS].encode("utf-8", "replace").decode("utf-8")
