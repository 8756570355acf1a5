"""When a landing comes down: the phases of the descent, and the moment at which the final descent begins.

It sinks to just over the deck, and waits there for good `odds` of a landing.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace

from shipland.guidance.horizon.odds import Odds
from shipland.guidance.horizon.parameters import DescentParameters

NEWTON_STEPS, SLOWEST_FALL_MPS = 5, 1e-2
_SLOWEST_SINK_MPS = 0.1
"""Sink rate at the end of the sink."""


class Phase(enum.Enum):
    """Of a landing."""

    SINK = "sink"
    WAIT = "wait"
    FINAL_DESCENT = "final descent"


@dataclass(frozen=True)
class Descent:
    """The state of a landing.

    Attributes:
        phase: of it.
        since_s: when the phase began.
        height_m: height over the deck that is commanded now.
        rate_mps: its rate when a climb rate that is commanded now has come about.
        odds: of a final descent that begins now, with what they were; None at first.
    """

    phase: Phase
    since_s: float
    height_m: float
    rate_mps: float = 0.0
    odds: Odds | None = None


@dataclass(frozen=True)
class Outlook:
    """Input of `next_descent`.

    Attributes:
        now_s: when the command takes effect.
        step_s: since the cycle before.
        height_m: of the aircraft's centre over the deck.
        sink_mps: its rate, downward.
        offset_m: horizontal, from the landing point.
        odds: of a landing, if the final descent began now; while it sinks, from the height of the wait.
        climb_in_s: in which a climb that is asked for now has come about.
        hover_height_m: over the deck; it rises no higher.
    """

    now_s: float
    step_s: float
    height_m: float
    sink_mps: float
    offset_m: float
    odds: float
    climb_in_s: float
    hover_height_m: float

    def touches(self, parameters: DescentParameters) -> bool:
        """A foot would touch before a climb could come about."""
        over_contact_m = self.height_m - parameters.contact_height_m
        return over_contact_m < parameters.touch_m + max(self.sink_mps, 0.0) * self.climb_in_s


def next_descent(before: Descent | None, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """The descent a cycle later; `before` is None when a landing begins."""
    descent = before or Descent(Phase.SINK, outlook.now_s, outlook.height_m)
    if descent.phase is Phase.FINAL_DESCENT:
        return descent
    odds = Odds(outlook.odds).after(descent.odds, outlook.step_s)
    descent = replace(descent, odds=odds, rate_mps=0.0)
    if outlook.touches(parameters):
        # By mischance: it is as good a moment as any, or one to climb from.
        if odds.now >= odds.mean or odds.worth_taking(parameters.wait_cost):
            return Descent(Phase.FINAL_DESCENT, outlook.now_s, 0.0, odds=odds)
        height_m = max(descent.height_m, parameters.wait_height_m)
        return replace(descent, height_m=height_m, rate_mps=parameters.sink_mps)
    if descent.phase is Phase.SINK:
        descent = _sinking(descent, outlook, parameters)
    return descent if descent.phase is Phase.SINK else _waiting(descent, outlook, parameters)


def _sinking(before: Descent, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """Sink to the height of the wait, which begins there; rise while the offset is too large."""
    stop_m, height_m = parameters.wait_height_m, before.height_m
    if outlook.offset_m > parameters.rise_offset_m:
        rate_mps = parameters.sink_mps if height_m < outlook.hover_height_m else 0.0
        return replace(before, height_m=height_m + rate_mps * outlook.step_s, rate_mps=rate_mps)
    sink_mps = _sink_mps(height_m - stop_m, parameters)
    height_m = max(height_m - sink_mps * outlook.step_s, stop_m)
    if outlook.height_m > stop_m + parameters.wait_band_m or height_m > stop_m:
        rate_mps = -_sink_mps(height_m - sink_mps * outlook.climb_in_s - stop_m, parameters)
        return replace(before, height_m=height_m, rate_mps=rate_mps)
    return Descent(Phase.WAIT, outlook.now_s, stop_m, odds=before.odds)


def _sink_mps(above_m: float, parameters: DescentParameters) -> float:
    """Speed of the sink, so far above its end."""
    return min(parameters.sink_mps, _SLOWEST_SINK_MPS + parameters.slow_per_s * above_m) if above_m > 0.0 else 0.0


def _waiting(before: Descent, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """Wait for a good moment."""
    if outlook.offset_m > parameters.rise_offset_m:
        return replace(before, phase=Phase.SINK)
    if before.odds is not None and before.odds.worth_taking(parameters.wait_cost):
        return Descent(Phase.FINAL_DESCENT, outlook.now_s, 0.0, odds=before.odds)
    return before


@dataclass(frozen=True)
class Fall:
    """A final descent that is commanded now; times are from the command's effect on the tilt.

    Attributes:
        sink_mps: over the deck, now.
        final_mps: greater than zero; the sink rate that is approached.
        lag_s: of the vehicle's climb rate.
        after_s: when the climb rate begins to change; negative where it has by then.
    """

    sink_mps: float
    final_mps: float
    lag_s: float
    after_s: float = 0.0

    def after(self, time_s: float) -> tuple[float, float]:
        """Height lost after a time, and the sink rate then [m, m/s]."""
        falling_s = max(time_s - self.after_s, 0.0)
        slower_mps, kept = max(self.final_mps - self.sink_mps, 0.0), math.exp(-falling_s / self.lag_s)
        fallen_m = self.final_mps * falling_s - slower_mps * self.lag_s * (1.0 - kept)
        return self.sink_mps * min(time_s, self.after_s) + fallen_m, self.final_mps - slower_mps * kept

    def contact_in_s(self, over_contact_m: float) -> float:
        """Time until this height is lost."""
        left_m = max(over_contact_m, 0.0)
        slower_mps = max(self.final_mps - self.sink_mps, 0.0)
        time_s = max(self.after_s, 0.0) + (left_m + self.lag_s * slower_mps) / self.final_mps
        for _ in range(NEWTON_STEPS):  # the height lost is convex in time, and this begins beyond the solution
            fallen_m, speed_mps = self.after(time_s)
            time_s = max(time_s - (fallen_m - left_m) / max(speed_mps, SLOWEST_FALL_MPS), 0.0)
        return time_s
