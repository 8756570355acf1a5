"""Whether the vehicle answers its sticks the way they ask: a driver with a wrong sign turns one round.

Stick and answer are shares of the full ones, compared at the time at which the answer was true. The share that a stick
asks for follows it as the vehicle's response says. A gust moves the aircraft against its sticks for a moment; an axis
that is reversed does so while both are large, and more and more as whoever flies asks for more. An aircraft that
lands and is low enough to touch is not judged: a deck carries and tilts it, whatever the sticks ask for.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from shipland.frames import wrap_angle
from shipland.guidance.response import Response
from shipland.messages import Intent, PilotCommand, Telemetry

STICKS = ("pitch", "roll", "heave", "yaw")
_MEMORY_S, _LEAST_KEPT = 0.7, 0.7
"""Of the products of stick and answer: they fade in time, but from one answer to the next by no more than this."""
_LEAST_S, _MOST_STEP_S = 0.45, 0.2
"""Of answers, before they are judged, each for no more than this: three at 5 Hz."""
_LEAST_ASKED, _LEAST_ANSWER = 0.2, 0.15
"""Root-mean-square shares below which nothing is judged."""
_MOST_ANSWER = 3.0
"""Share of the full answer beyond which it is a leap of the vehicle's estimate, as of a compass that is reset."""
_OPPOSITE = -0.8
"""Correlation of stick and answer that none but a reversed axis has."""
_TILTED = 0.5
"""Of the full tilt: a vehicle that tilts so far the way it is asked to go is blown, not reversed."""
_LONGEST_STEP_S = 1.0
"""After a longer one they begin anew."""
_LEAST_TURN_S = 0.1
"""Between headings whose difference is taken."""
_STILL, _HEAVE, _YAW = (0.0,) * len(STICKS), 2, 3
_KEPT = 90
"""Commands: three seconds at 30 Hz, as late as telemetry may come."""


class _Products(NamedTuple):
    """Of stick and answer, weighted by time, fading."""

    asked: float = 0.0
    both: float = 0.0
    answer: float = 0.0
    weight_s: float = 0.0

    def after(self, step_s: float, asked: float, answer: float) -> _Products:
        kept, step_s = max(math.exp(-step_s / _MEMORY_S), _LEAST_KEPT), min(step_s, _MOST_STEP_S)
        new = asked * asked, asked * answer, answer * answer, 1.0
        return _Products(*(kept * before + step_s * value for before, value in zip(self, new, strict=True)))

    @property
    def opposite(self) -> bool:
        if self.weight_s < _LEAST_S:
            return False
        large = self.asked > _LEAST_ASKED**2 * self.weight_s and self.answer > _LEAST_ANSWER**2 * self.weight_s
        return large and self.both < _OPPOSITE * math.sqrt(self.asked * self.answer)


class _Asked(NamedTuple):
    """Of every stick, from a command's effect on: the share that the vehicle has by then, and the one it goes to.

    `free`: no deck can carry it, for it does not land or is not low enough to touch.
    """

    from_s: float
    shares: tuple[float, ...]
    towards: tuple[float, ...]
    free: bool = True

    def at(self, t_s: float, lags_s: tuple[float, ...]) -> tuple[float, ...]:
        """The shares that the vehicle has at a later time."""
        past_s = t_s - self.from_s
        each = zip(self.shares, self.towards, lags_s, strict=True)
        return tuple(to + (share - to) * math.exp(-past_s / lag_s) for share, to, lag_s in each)


class Axes:
    """The axes of one flight.

    Args:
        response: of the vehicle.
    """

    def __init__(self, response: Response) -> None:
        self._response = response
        across_s = response.lag_s if response.kind == "attitude" else response.lag_s + 1.0 / response.servo_per_s
        self._lags_s = (across_s, across_s, response.climb_lag_s, response.turn_lag_s)
        self._dead_s = response.uplink_s + response.dead_time_s
        self._asked = deque([_Asked(-math.inf, _STILL, _STILL)], maxlen=_KEPT)
        self._products = [_Products()] * len(STICKS)
        self._told_s = [-math.inf] * len(STICKS)
        self._heading_rad = 0.0

    @property
    def reversed_stick(self) -> str:
        """The one that is answered the other way round; empty where none is."""
        return next((name for name, it in zip(STICKS, self._products, strict=True) if it.opposite), "")

    def take(self, sent: PilotCommand | None, telemetry: Telemetry) -> None:
        """The command of the cycle before, and what the vehicle tells since."""
        if sent is not None and sent.t_s + self._dead_s > self._asked[-1].from_s:
            from_s, before = sent.t_s + self._dead_s, self._asked[-1]
            holds, lands = sent.intent is Intent.HOLD, sent.intent is Intent.LAND
            shares = _STILL if holds else tuple(0.01 * stick for stick in sent.sticks_percent)
            free = not (lands and sent.at_contact_height)
            self._asked.append(_Asked(from_s, before.at(from_s, self._lags_s), shares, free))
        told = telemetry
        attitude_s, velocity_s = _or_receipt(told.attitude_t_s, told), _or_receipt(told.velocity_t_s, told)
        tilts: tuple[float | None, ...] = (None, None)
        if told.roll_rad is not None and told.pitch_rad is not None:
            tilts = -told.pitch_rad / self._response.max_tilt_rad, told.roll_rad / self._response.max_tilt_rad
        velocity_mps = None if told.velocity_in_level_mps is None else told.velocity_in_level_mps.tolist()
        if self._response.kind == "attitude":
            for index, tilt in enumerate(tilts):
                self._answered(index, attitude_s, tilt, told.flying)
        elif velocity_mps is not None:
            for index, tilt in enumerate(tilts):
                self._answered(index, velocity_s, velocity_mps[index] / self._response.max_speed_mps, told.flying, tilt)
        if velocity_mps is not None:
            self._answered(_HEAVE, velocity_s, -velocity_mps[2] / self._response.max_climb_mps, told.flying)
        self._turned(told)

    def _turned(self, told: Telemetry) -> None:
        t_s, heading_rad = _or_receipt(told.heading_t_s, told), told.heading_rad
        step_s = t_s - self._told_s[_YAW]
        if heading_rad is None or step_s < _LEAST_TURN_S:
            return
        turn_rad_s = wrap_angle(heading_rad - self._heading_rad) / step_s
        self._heading_rad = heading_rad
        self._answered(_YAW, t_s, turn_rad_s / self._response.max_turn_rad_s, told.flying, back_s=0.5 * step_s)

    def _answered(
        self, index: int, t_s: float, answer: float | None, flying: bool, tilt: float | None = None, back_s: float = 0.0
    ) -> None:
        """A stick's answer, as a share of the full one; it is that of `back_s` earlier."""
        step_s = t_s - self._told_s[index]
        if answer is None or not abs(answer) <= _MOST_ANSWER or step_s <= 0.0:
            return
        self._told_s[index] = t_s
        asked = next((it for it in reversed(self._asked) if it.from_s <= t_s - back_s), None)
        if asked is None or not (flying and asked.free) or step_s > _LONGEST_STEP_S:
            self._products[index] = _Products()
            return
        share = asked.at(t_s - back_s, self._lags_s)[index]
        if tilt is not None and tilt * math.copysign(1.0, share) > _TILTED:
            answer = 0.0
        self._products[index] = self._products[index].after(step_s, share, answer)


def _or_receipt(t_s: float | None, told: Telemetry) -> float:
    return told.t_s if t_s is None else t_s
