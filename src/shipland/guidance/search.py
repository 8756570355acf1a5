"""Looking for the ship: hold and look, turn once around, climb, and again."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.config import require
from shipland.guidance.near import Sticks


@dataclass(frozen=True)
class SearchParameters:
    """`[guidance.search]`.

    Attributes:
        look_s: hold still first, so that a target already in view is found and believed.
        turn_percent, turn_s: yaw stick, and how long a full turn takes with it.
        climb_percent, climb_s: heave stick and time of the climb after each turn.
        turns: after so many turns the vehicle holds.
    """

    look_s: float
    turn_percent: float
    turn_s: float
    climb_percent: float
    climb_s: float
    turns: int

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require(value >= 0, f"{name} must not be negative, got {value}")
        require(self.turn_s + self.climb_s > 0.0, "turn_s + climb_s must be positive")


def search_sticks(searching_s: float, parameters: SearchParameters) -> Sticks:
    """The sticks after `searching_s` of search."""
    hold = Sticks(0.0, 0.0, 0.0, 0.0)
    turning_s = searching_s - parameters.look_s
    if turning_s < 0.0:
        return hold
    turn, into_s = divmod(turning_s, parameters.turn_s + parameters.climb_s)
    if turn >= parameters.turns:
        return hold
    if into_s < parameters.turn_s:
        return hold._replace(yaw=parameters.turn_percent)
    return hold._replace(heave=parameters.climb_percent)
