"""Sticks in percent in a vehicle's own measures: tilts or speeds, climb and turn."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.frames import wrap_angle
from shipland.guidance.response import Response
from shipland.messages import Intent, PilotCommand

_HEADING_LEAD_RAD = 0.3
"""Largest lead of the heading set-point over the aircraft's heading, so that a blocked turn does not wind up."""


@dataclass(frozen=True)
class Wanted:
    """A command in the vehicle's own measures.

    Attributes:
        forward, right: tilts [rad] or speeds [m/s], as the vehicle's sticks mean.
        climb_mps: upward.
        turn_rad_s: clockwise.
        hold: brake and keep the place, whatever else stands here.
    """

    forward: float
    right: float
    climb_mps: float
    turn_rad_s: float
    hold: bool = False


HOLD = Wanted(0.0, 0.0, 0.0, 0.0, hold=True)


def wanted_of(command: PilotCommand, response: Response) -> Wanted:
    """A command on this vehicle; clipped to full sticks, and a hold where a stick is no number."""
    percents = command.sticks_percent
    if command.intent is Intent.HOLD or not all(map(math.isfinite, percents)):
        return HOLD
    pitch, roll, heave, yaw = (0.01 * min(max(percent, -100.0), 100.0) for percent in percents)
    full = response.max_tilt_rad if response.kind == "attitude" else response.max_speed_mps
    return Wanted(full * pitch, full * roll, heave * response.max_climb_mps, yaw * response.max_turn_rad_s)


def percents_of(wanted: Wanted, response: Response) -> tuple[float, float, float, float]:
    """Pitch, roll, heave and yaw sticks [percent] that ask this vehicle for it; the inverse of `wanted_of`."""
    full = response.max_tilt_rad if response.kind == "attitude" else response.max_speed_mps
    return (
        100.0 * wanted.forward / full,
        100.0 * wanted.right / full,
        100.0 * wanted.climb_mps / response.max_climb_mps,
        100.0 * wanted.turn_rad_s / response.max_turn_rad_s,
    )


def pressed(response: Response, velocity_in_level_mps: tuple[float, float, float] | None, down_mps: float) -> Wanted:
    """What presses an aircraft on the deck it has touched: down, level, no turn, and carried along with the deck.

    Args:
        response: of this vehicle.
        velocity_in_level_mps: its own; a vehicle that flies speeds is commanded this one, so that it does not tilt.
        down_mps: descent.
    """
    forward, right = 0.0, 0.0
    if response.kind == "velocity" and velocity_in_level_mps is not None:
        forward, right, _ = velocity_in_level_mps
    return Wanted(forward, right, -down_mps, 0.0)


def thrust_of(climb_mps: float, up_mps: float, down_mps: float) -> float:
    """The thrust of an attitude set-point that asks for a vertical speed: 0.5 holds, 1 and 0 are the largest rates.

    >>> thrust_of(-0.75, 2.5, 1.5)
    0.25
    """
    full_mps = up_mps if climb_mps > 0.0 else down_mps
    return 0.5 + 0.5 * min(max(climb_mps / full_mps, -1.0), 1.0)


class HeadingSetPoint:
    """A turn rate integrated to the heading that an attitude set-point carries; one for a flight."""

    def __init__(self) -> None:
        self._heading_rad = math.nan

    def rest(self) -> None:
        """Another kind of set-point: the next heading begins at the aircraft's."""
        self._heading_rad = math.nan

    def next_rad(self, turn_rad_s: float, heading_rad: float, step_s: float) -> float:
        """The heading to ask for [rad]."""
        if math.isnan(self._heading_rad):
            self._heading_rad = heading_rad
        ahead = wrap_angle(self._heading_rad + turn_rad_s * step_s - heading_rad)
        ahead = min(max(ahead, -_HEADING_LEAD_RAD), _HEADING_LEAD_RAD)
        self._heading_rad = wrap_angle(heading_rad + ahead)
        return self._heading_rad
