"""Our own touchdown detection: an autopilot's waits for a surface that stands still, which a deck does not.

In the air, low throttle means falling: with less than half of the hover throttle an aircraft gains at least g/2 of
downward speed. On a surface it does not. So: landing is commanded, the throttle has been low for a while, and
meanwhile the downward speed has gained far less than a falling aircraft would have.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.config import require
from shipland.frames import GRAVITY_MPS2


@dataclass(frozen=True)
class TouchdownParameters:
    """`[touchdown]` of vehicles.toml.

    Attributes:
        low_share: of the hover throttle, below which the throttle is low.
        confirm_s: how long all of it must hold.
        fall_share: of what a falling aircraft would gain in speed; above it the aircraft falls.
        stale_s: older telemetry tells nothing.
        range_m: where a downward rangefinder says more than this, there is no touchdown.
    """

    low_share: float
    confirm_s: float
    fall_share: float
    stale_s: float
    range_m: float

    def __post_init__(self) -> None:
        require(0.0 < self.low_share < 0.8, f"low_share must be in (0, 0.8), got {self.low_share}")
        require(0.0 < self.fall_share < 1.0, f"fall_share must be in (0, 1), got {self.fall_share}")
        require(min(self.confirm_s, self.stale_s, self.range_m) > 0.0, "times and ranges must be positive")


@dataclass(frozen=True)
class Touch:
    """What is known at one instant.

    Attributes:
        t_s: now.
        landing: landing is commanded, by the pilot and now.
        throttle: 0 … 1 of full; NaN where unknown.
        down_mps: downward speed; NaN where unknown.
        known_s: time of the older of the two.
        range_m: of a downward rangefinder, or None.
    """

    t_s: float
    landing: bool
    throttle: float
    down_mps: float
    known_s: float
    range_m: float | None


class TouchdownWatch:
    """Follows throttle and downward speed.

    Args:
        parameters: see there.
        hover_throttle: 0 … 1, of this vehicle.
    """

    def __init__(self, parameters: TouchdownParameters, hover_throttle: float) -> None:
        self._limits, self._hover = parameters, hover_throttle
        self._since_s = math.nan
        self._down_mps = self._deficit_mps = 0.0
        self._last_s = math.nan

    def stands(self, now: Touch) -> bool:
        """Whether the aircraft stands on something; what cannot be known counts as in the air."""
        limits = self._limits
        low = now.throttle < limits.low_share * self._hover
        fresh = now.t_s - now.known_s <= limits.stale_s
        over = now.range_m is not None and now.range_m > limits.range_m
        if not (now.landing and low and fresh and math.isfinite(now.down_mps)) or over:
            self._since_s = self._last_s = math.nan
            return False
        if math.isnan(self._since_s):
            self._since_s = self._last_s = now.t_s
            self._down_mps, self._deficit_mps = now.down_mps, 0.0
            return False
        self._deficit_mps += GRAVITY_MPS2 * (1.0 - now.throttle / self._hover) * (now.t_s - self._last_s)
        self._last_s = now.t_s
        gained_mps = now.down_mps - self._down_mps
        if gained_mps > limits.fall_share * self._deficit_mps + 0.1:
            self._since_s = math.nan
            return False
        return now.t_s - self._since_s >= limits.confirm_s
