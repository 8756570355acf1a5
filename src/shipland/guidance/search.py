"""Search for the ship: hold and look forward and down, turn once around, climb, repeat."""

from __future__ import annotations

import math

from shipland.config import key, parameters, require
from shipland.guidance.near import SticksPercent


@parameters
class SearchParameters:
    """`[guidance.search]`."""

    look_s: float = key(
        3.0, "hold still for so long at each camera pitch", "six cycles of the paper's learned detector", ge=0
    )
    camera_pitch_deg: tuple[float, ...] = key(
        (0.0, -25.0), "up positive; each turn is flown with the next of them", "the lens sees 21 deg either side"
    )
    turn_percent: float = key(10.0, "yaw stick", "4 deg/s: a target moves by 33 px a cycle", ge=0)
    turn_s: float = key(90.0, "of a full turn with it", "a full turn", ge=0)
    climb_percent: float = key(60.0, "heave stick after each turn", ge=0)
    climb_s: float = key(5.0, "of the climb after each turn", ge=0)
    turns: int = key(4, "after this number of turns the vehicle holds", ge=0)

    def __post_init__(self) -> None:
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
