"""When a landing comes down: the phases of the descent, and the moment at which the final descent begins.

`next_descent` decides; `outlook_of` gathers what it decides on. It waits just over the deck for good `odds` of a
landing; with the option `guidance.horizon.moment` for the deck's centre too. A watched deck is predicted
for a time so far ahead that the camera can look up at the bar before the final descent.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace

from shipland.frames import Array
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.odds import Odds
from shipland.guidance.horizon.parameters import DescentParameters, HorizonParameters
from shipland.guidance.parameters import GuidanceParameters
from shipland.guidance.response import Response

LOOK_DOWN_RAD = -1.48
"""Pitch of the camera that looks down at the deck."""
NEWTON_STEPS, SLOWEST_FALL_MPS = 5, 1e-2
_SLOWEST_SINK_MPS = 0.1
"""Sink rate at the end of the sink."""
_DECK_MEMORY_S = 2.0
"""A deck that was seen longer ago than this is not predicted."""


class Phase(enum.Enum):
    """Of a landing."""

    SINK = "sink"
    DECK_WATCH = "deck watch"
    REACQUIRE = "reacquire"
    WAIT = "wait"
    FINAL_DESCENT = "final descent"


@dataclass(frozen=True)
class Descent:
    """The state of a landing.

    Attributes:
        phase: of it.
        since_s: when the phase began.
        height_m: height over the neutral deck that is commanded now.
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
        height_m: of the aircraft's centre over the neutral deck.
        sink_mps: its rate, downward.
        offset_m: horizontal, from the landing point.
        odds: of a landing, if the final descent began now; while it sinks, from the height of the wait.
        climb_lag_s: of the vehicle.
        hover_height_m: over the neutral deck; it rises no higher.
        from_deck_m: from the deck's centre at contact, predicted for a final descent that begins now, or, during the
            deck watch, in `reacquire_s`; infinite while the deck is not known well enough, None without a deck watch.
    """

    now_s: float
    step_s: float
    height_m: float
    sink_mps: float
    offset_m: float
    odds: float
    climb_lag_s: float
    hover_height_m: float
    from_deck_m: float | None = None

    def over_contact_m(self, parameters: DescentParameters) -> float:
        """Height over that of a contact."""
        return self.height_m - parameters.contact_height_m

    def touches(self, parameters: DescentParameters) -> bool:
        """A foot would touch before a climb could come about."""
        return self.over_contact_m(parameters) < parameters.touch_m + max(self.sink_mps, 0.0) * self.climb_lag_s


def next_descent(before: Descent | None, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """The descent a cycle later; `before` is None when a landing begins."""
    descent = before or Descent(Phase.SINK, outlook.now_s, outlook.height_m)
    if descent.phase is Phase.FINAL_DESCENT:
        return descent
    odds = Odds(outlook.odds).after(descent.odds, outlook.step_s)
    descent = replace(descent, odds=odds, rate_mps=0.0)
    final_descent = Descent(Phase.FINAL_DESCENT, outlook.now_s, 0.0, odds=odds)
    if outlook.over_contact_m(parameters) < parameters.touch_m:
        return final_descent
    if outlook.touches(parameters):
        # By mischance: it is as good a moment as any, or one to climb from.
        if descent.phase is Phase.WAIT and odds.now >= odds.mean:
            return final_descent
        height_m = max(descent.height_m, _stop_m(outlook, parameters))
        return replace(descent, height_m=height_m, rate_mps=parameters.sink_mps)
    if descent.phase is Phase.SINK:
        descent = _sinking(descent, outlook, parameters)
    if descent.phase is Phase.SINK:
        return descent
    if descent.phase is Phase.REACQUIRE:
        return _reacquiring(descent, outlook, parameters)
    return _waiting(descent, outlook, parameters)


def _sinking(before: Descent, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """Sink to the height of the wait or of the deck watch, which begins there; rise while the offset is too large."""
    stop_m, height_m = _stop_m(outlook, parameters), before.height_m
    if outlook.offset_m > parameters.rise_offset_m:
        rate_mps = parameters.sink_mps if height_m < outlook.hover_height_m else 0.0
        return replace(before, height_m=height_m + rate_mps * outlook.step_s, rate_mps=rate_mps)
    sink_mps = _sink_mps(height_m - stop_m, parameters)
    height_m = max(height_m - sink_mps * outlook.step_s, stop_m)
    if outlook.height_m > stop_m + parameters.wait_band_m or height_m > stop_m:
        rate_mps = -_sink_mps(height_m - sink_mps * outlook.climb_lag_s - stop_m, parameters)
        return replace(before, height_m=height_m, rate_mps=rate_mps)
    phase = Phase.WAIT if outlook.from_deck_m is None else Phase.DECK_WATCH
    return Descent(phase, outlook.now_s, stop_m, odds=before.odds)


def _sink_mps(above_m: float, parameters: DescentParameters) -> float:
    """Speed of the sink, so far above its end."""
    return min(parameters.sink_mps, _SLOWEST_SINK_MPS + parameters.slow_per_s * above_m) if above_m > 0.0 else 0.0


def _reacquiring(before: Descent, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """Sink further while the camera looks up, then begin the final descent, or watch the deck again."""
    passed_s = outlook.now_s - before.since_s
    deck_below = outlook.from_deck_m is not None and outlook.from_deck_m <= parameters.reacquire_offset_m
    if passed_s >= parameters.reacquire_s and deck_below:
        return Descent(Phase.FINAL_DESCENT, outlook.now_s, 0.0, odds=before.odds)
    if passed_s > parameters.reacquire_max_s:
        return Descent(Phase.DECK_WATCH, outlook.now_s, _stop_m(outlook, parameters), odds=before.odds)
    height_m = reacquire_at_m(before.height_m, outlook.step_s, parameters)
    rate_mps = (height_m - before.height_m) / outlook.step_s if outlook.step_s > 0.0 else 0.0
    return replace(before, height_m=height_m, rate_mps=rate_mps)


def _waiting(before: Descent, outlook: Outlook, parameters: DescentParameters) -> Descent:
    """Wait for a good moment, or for the watched deck's centre below."""
    watching = before.phase is Phase.DECK_WATCH and outlook.now_s - before.since_s <= parameters.deck_watch_max_s
    if watching and outlook.from_deck_m is not None:
        below = outlook.from_deck_m <= parameters.deck_watch_offset_m
        stop_m = _stop_m(outlook, parameters)
        return Descent(Phase.REACQUIRE, outlook.now_s, stop_m, odds=before.odds) if below else before
    if outlook.offset_m > parameters.rise_offset_m:
        return replace(before, phase=Phase.SINK)
    if before.odds is not None and before.odds.worth_taking(parameters.wait_cost):
        return Descent(Phase.FINAL_DESCENT, outlook.now_s, 0.0, odds=before.odds)
    return before


def _stop_m(outlook: Outlook, parameters: DescentParameters) -> float:
    """Height over the neutral deck at which the sink ends."""
    return parameters.wait_height_m if outlook.from_deck_m is None else parameters.deck_watch_height_m


def outlook_of(
    before: Descent | None,
    estimate: Estimated,
    foreseen: tuple[Array, float],
    times_s: tuple[float, float],
    guidance: GuidanceParameters,
    response: Response,
) -> Outlook:
    """What `next_descent` decides on.

    Args:
        before: the descent of the cycle before.
        estimate: at the command's effect.
        foreseen: of a final descent that begins now: (2,) offset from the landing point at contact, in the axes of the
            flight, and the odds of a landing.
        times_s: of the decision, and since the cycle before.
        guidance: parameters.
        response: of the vehicle.
    """
    parameters, (offsets_m, odds), (now_s, step_s) = guidance.horizon, foreseen, times_s
    from_deck_m = None
    if parameters.moment == "deck":
        from_deck_m = _from_deck_m(before, estimate, offsets_m, now_s, parameters, response)
    return Outlook(
        now_s=estimate.t_s,
        step_s=step_s,
        height_m=estimate.height_m,
        sink_mps=estimate.down_mps,
        offset_m=math.hypot(*estimate.offset_m.tolist()),
        odds=odds,
        climb_lag_s=response.climb_lag_s,
        hover_height_m=guidance.approach.hover_height_m,
        from_deck_m=from_deck_m,
    )


def _from_deck_m(
    before: Descent | None,
    estimate: Estimated,
    offsets_at_contact_m: Array,
    now_s: float,
    parameters: HorizonParameters,
    response: Response,
) -> float:
    """`Outlook.from_deck_m` of a deck watch."""
    descent, lag_s = parameters.descent, response.climb_lag_s
    watching = before is not None and before.phase is Phase.DECK_WATCH
    contact_s = contact_in_s(estimate.height_m, estimate.down_mps, lag_s, descent)
    if watching:
        height_m = reacquire_at_m(estimate.height_m, descent.reacquire_s, descent)
        contact_s = descent.reacquire_s + contact_in_s(height_m, descent.sink_mps, lag_s, descent)
    std_m = estimate.deck_std_later_m(contact_s)
    known = now_s - estimate.deck_s <= _DECK_MEMORY_S and std_m <= parameters.deck_std_max_m
    if not known or estimate.deck_rises_mps(contact_s) > parameters.deck_rise_max_mps:
        return math.inf
    if watching:  # the present offset is flown out until then
        return math.hypot(*estimate.deck_later(contact_s).tolist())
    return math.hypot(*offsets_at_contact_m.tolist())


def contact_in_s(height_m: float, sink_mps: float, lag_s: float, parameters: DescentParameters) -> float:
    """Time to contact from a height over the neutral deck, in a final descent [s].

    Args:
        height_m: of the aircraft's centre.
        sink_mps: now; it approaches `final_descent_mps` with the time constant `lag_s`.
        lag_s: of the vehicle's climb rate.
        parameters: of the descent.
    """
    left_m, final_descent_mps = max(height_m - parameters.contact_height_m, 0.0), parameters.final_descent_mps
    time_s = left_m / final_descent_mps + lag_s * max(final_descent_mps - sink_mps, 0.0) / final_descent_mps
    for _ in range(NEWTON_STEPS):  # the height lost is convex in time, and this begins beyond the solution
        fallen_m, speed_mps = dropped(time_s, sink_mps, lag_s, parameters)
        time_s = max(time_s - (fallen_m - left_m) / max(speed_mps, SLOWEST_FALL_MPS), 0.0)
    return time_s


def dropped(time_s: float, sink_mps: float, lag_s: float, parameters: DescentParameters) -> tuple[float, float]:
    """Height lost in a final descent after a time, and its speed then [m, m/s]; arguments as of `contact_in_s`."""
    final_descent_mps = parameters.final_descent_mps
    slower_mps, kept = max(final_descent_mps - sink_mps, 0.0), math.exp(-time_s / lag_s)
    return final_descent_mps * time_s - slower_mps * lag_s * (1.0 - kept), final_descent_mps - slower_mps * kept


def reacquire_at_m(height_m: float, passed_s: float, parameters: DescentParameters) -> float:
    """Height over the neutral deck after `passed_s` of the reacquire phase."""
    return max(height_m - parameters.sink_mps * passed_s, parameters.wait_height_m)


@dataclass(frozen=True)
class GimbalLookDown:
    """Where the camera looks during the deck watch.

    Attributes:
        down: at the deck; else up at the bar.
        since_s: when that was commanded.
    """

    down: bool
    since_s: float


def next_look_down(
    before: GimbalLookDown | None, now_s: float, posed_s: float, down_max_s: float, up_s: float
) -> GimbalLookDown:
    """The look-down a cycle later; `before` is None when the deck watch begins.

    Args:
        before: the look-down.
        now_s: time of decision.
        posed_s: exposure of the newest picture that gave a pose.
        down_max_s: the camera looks down for at most this long.
        up_s: then it looks up until poses have come for this long.
    """
    if before is None:
        return GimbalLookDown(True, now_s)
    due = now_s - before.since_s > down_max_s if before.down else posed_s - before.since_s > up_s
    return GimbalLookDown(not before.down, now_s) if due else before
