"""Where a learned policy enters the pilot `horizon`: what it sees, and what it may do to the horizontal input.

Everything else stays the pilot's: estimate, modes, references, descent, heave, yaw and camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from shipland.config import require
from shipland.estimation.relative_state import ACTUATION, GUST, WAVE, WAVE_RATE, WIND
from shipland.frames import Array, rotated
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.regulator import LONGEST_CONTACT_S, Plan

Kind = Literal["residual", "direct"]

AXIS_ENTRIES: tuple[tuple[str, float], ...] = (
    ("offset_m", 0.3),
    ("speed_mps", 0.5),
    ("thrust_mps2", 2.0),
    ("gust_mps2", 0.5),
    ("wind_mps2", 2.0),
    ("wave_m", 0.2),
    ("wave_mps", 0.3),
    ("input_mps2", 2.0),
    ("wanted_mps2", 2.0),
)
"""What a policy sees of each axis, forward then starboard of the bar, and the scale that it is divided by."""
WHOLE_ENTRIES: tuple[tuple[str, float], ...] = (
    ("height_m", 1.0),
    ("sink_mps", 0.5),
    ("contact_s", 1.0),
    ("landing", 1.0),
    ("in_final_descent", 1.0),
)
"""What it sees beside them."""
ENTRIES = (
    *(f"{name}.{axis}" for name, _ in AXIS_ENTRIES for axis in ("forward", "starboard")),
    *(name for name, _ in WHOLE_ENTRIES),
)
"""The numbers of an observation, in order."""
LIMIT = 5.0
"""Scaled numbers are clipped at this."""
REACH_M = 1.5
"""Where policies steer, from the landing point."""


@dataclass(frozen=True)
class Action:
    """What a policy's action, two numbers in -1 … 1, means.

    Attributes:
        kind: `residual`: added to the pilot's own input; `direct`: the input itself.
        bound_mps2: input of an action of 1.
        reach_m: farther from the landing point than this the pilot flies alone.
    """

    kind: Kind
    bound_mps2: float
    reach_m: float

    def __post_init__(self) -> None:
        require(self.kind in ("residual", "direct"), f"kind must be 'residual' or 'direct', got {self.kind!r}")
        require(0.0 <= self.bound_mps2 <= 10.0, f"bound_mps2 must be in 0…10, got {self.bound_mps2}")
        require(self.reach_m >= 0.0, f"reach_m must not be negative, got {self.reach_m}")

    def applies(self, seen: Steered) -> bool:
        """Near enough to the landing point for a policy to steer."""
        return math.hypot(*seen.offset_m.tolist()) <= self.reach_m

    def input_mps2(self, seen: Steered, action: Array) -> Array:
        """(2,) the input that an action (2,) asks for, forward and starboard of the bar."""
        bounded = self.bound_mps2 * np.clip(action, -1.0, 1.0)
        return np.asarray(seen.wanted_mps2 + bounded if self.kind == "residual" else bounded)


@dataclass(frozen=True)
class Steered:
    """What a policy sees: the pilot's estimate at its command's effect; vectors (2,) forward, starboard of the bar.

    Attributes:
        offset_m, speed_mps: of the aircraft from the point that it follows, and its rate.
        thrust_mps2, gust_mps2, wind_mps2: accelerations by the sticks, by gusts and by the mean wind.
        wave_m, wave_mps: of the bar.
        input_mps2: asked for by the command before.
        wanted_mps2: asked for by the pilot's own gains now.
        height_m: over the deck.
        sink_mps: its rate, down positive.
        contact_s: to contact, if the descent went on at its last part's speed.
        landing: a landing has begun.
        in_final_descent: its last part has.
    """

    offset_m: Array
    speed_mps: Array
    thrust_mps2: Array
    gust_mps2: Array
    wind_mps2: Array
    wave_m: Array
    wave_mps: Array
    input_mps2: Array
    wanted_mps2: Array
    height_m: float
    sink_mps: float
    contact_s: float
    landing: bool
    in_final_descent: bool


def default_bound_mps2(kind: Kind) -> float:
    """Input of an action of 1, where none is given."""
    return 0.5 if kind == "residual" else 4.0


def observation_of(seen: Steered) -> Array:
    """(n,) what a policy sees, scaled: `ENTRIES`."""
    values = [getattr(seen, name) / scale for name, scale in AXIS_ENTRIES]
    whole = [getattr(seen, name) / scale for name, scale in WHOLE_ENTRIES]
    return np.asarray(np.clip(np.concatenate([*values, whole]), -LIMIT, LIMIT))


def steered(own: Array, estimate: Estimated, plan: Plan) -> Steered:
    """What a policy sees where the pilot's own gains ask for the input `own` (2,), in the axes of the flight."""
    across = estimate.across

    def in_bar(vector: Array) -> Array:
        return rotated(vector, -estimate.bar_rad)

    return Steered(
        offset_m=in_bar(estimate.offset_m),
        speed_mps=in_bar(estimate.followed_mps),
        thrust_mps2=in_bar(across.of(ACTUATION)),
        gust_mps2=in_bar(across.of(GUST)),
        wind_mps2=in_bar(across.of(WIND)),
        wave_m=in_bar(across.of(WAVE)),
        wave_mps=in_bar(across.of(WAVE_RATE)),
        input_mps2=in_bar(estimate.actuation.input_before),
        wanted_mps2=in_bar(own),
        height_m=estimate.height_m,
        sink_mps=estimate.sink_mps,
        contact_s=min(plan.contact_s, LONGEST_CONTACT_S),
        landing=plan.descent is not None,
        in_final_descent=plan.in_final_descent,
    )


class Steering(Protocol):
    """A policy in the pilot's loop; inherit from it."""

    note: str
    """What is wrong with it, in words; empty where nothing is."""

    def input_mps2(self, seen: Steered) -> Array:
        """(2,) the input to ask for, forward and starboard; never raises, and gives the pilot's own when it fails."""

    def instead_of(self, own: Array, estimate: Estimated, plan: Plan) -> Array:
        """(2,) the input, forward and starboard of the bar, instead of the pilot's `own` in the axes of the flight."""
        return self.input_mps2(steered(own, estimate, plan))
