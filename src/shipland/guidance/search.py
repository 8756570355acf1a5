"""Search for the ship: hold and look forward and down, turn once around, climb, repeat."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.config import require
from shipland.guidance.near import SticksPercent


@dataclass(frozen=True)
class SearchParameters:
    """`[guidance.search]`.

    Attributes:
        look_s: hold still first, for this long at each camera pitch, so that a target already in view is believed.
        camera_pitch_deg: camera pitches, up positive; each turn is flown with the next of them.
        turn_percent, turn_s: yaw stick, and how long a full turn takes with it.
        climb_percent, climb_s: heave stick and time of the climb after each turn.
        turns: after this number of turns the vehicle holds.
    """

    look_s: float
    camera_pitch_deg: tuple[float, ...]
    turn_percent: float
    turn_s: float
    climb_percent: float
    climb_s: float
    turns: int

    def __post_init__(self) -> None:
        for name in ("look_s", "turn_percent", "turn_s", "climb_percent", "climb_s", "turns"):
            require(getattr(self, name) >= 0, f"{name} must not be negative, got {getattr(self, name)}")
        require(len(self.camera_pitch_deg) > 0, "camera_pitch_deg must hold at least one pitch")
        require(self.turn_s + self.climb_s > 0.0, "turn_s + climb_s must be positive")


def search(searching_s: float, parameters: SearchParameters, side: float = 1.0) -> tuple[SticksPercent, float]:
    """The sticks and the camera pitch [rad] after `searching_s` of search; a negative `side` turns to the left."""
    hold = SticksPercent(0.0, 0.0, 0.0, 0.0)
    pitches_rad = [math.radians(pitch_deg) for pitch_deg in parameters.camera_pitch_deg]
    turning_s = searching_s - parameters.look_s * len(pitches_rad)
    if turning_s < 0.0:
        return hold, pitches_rad[min(int(searching_s / parameters.look_s), len(pitches_rad) - 1)]
    turn, into_s = divmod(turning_s, parameters.turn_s + parameters.climb_s)
    pitch_rad = pitches_rad[int(turn) % len(pitches_rad)]
    if turn >= parameters.turns:
        return hold, pitch_rad
    if into_s < parameters.turn_s:
        return hold._replace(yaw=math.copysign(parameters.turn_percent, side)), pitch_rad
    return hold._replace(heave=parameters.climb_percent), pitch_rad
