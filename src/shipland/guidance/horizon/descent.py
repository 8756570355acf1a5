"""The way down as one pure function: sink to just over the deck, wait for a small error at contact, descend to contact.

No speed gate: what counts is where the aircraft will be at contact, and that is predicted. A deck that is watched is
foreseen for an instant so far ahead that the camera has time to look up to the bar before the drop.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace

from shipland.config import require, require_within

_SLOWEST_MPS = 0.1
"""Of the way down, at its end."""
NEWTON_STEPS, SLOWEST_FALL_MPS = 5, 1e-2


class Phase(enum.Enum):
    """Of a landing."""

    SINK = "sink"
    DECK_WATCH = "deck watch"
    REACQUIRE = "reacquire"
    WAIT = "wait"
    FINAL_DESCENT = "final descent"


@dataclass(frozen=True)
class DescentParameters:
    """`[guidance.horizon.descent]`.

    Attributes:
        sink_mps: speed of the way down to `wait_height_m`.
        wait_height_m: over the neutral deck, of the aircraft's centre; 0 goes down without waiting.
        wait_band_m: this much above it the way down has ended.
        slow_per_s: the way down slows by this rate towards it, so that the aircraft does not sink through.
        pause_m: with a larger offset the way down waits.
        final_descent_mps: speed of the last part.
        final_descent_offset_m: predicted offset at contact at which it begins.
        relax_after_s, relax_per_s: waiting longer, the offset allowed grows by this share a second.
        contact_height_m: of the aircraft's centre when its lowest foot touches the neutral deck.
        deck_watch_height_m: over the neutral deck that a deck is watched from.
        deck_watch_offset_m: of a watched deck: predicted offset from its centre at contact at which the drop begins.
        deck_watch_max_s: watching no longer than this; then the landing goes on as at any time.
        reacquire_s: from the last look down to the drop: the camera looks up, and the place is found anew.
        reacquire_max_s: the drop begins by then, or the deck is watched again.
        reacquire_offset_m: offset from the deck's centre at contact, predicted, with which it begins.
    """

    sink_mps: float
    wait_height_m: float
    wait_band_m: float
    slow_per_s: float
    pause_m: float
    final_descent_mps: float
    final_descent_offset_m: float
    relax_after_s: float
    relax_per_s: float
    contact_height_m: float
    deck_watch_height_m: float
    deck_watch_offset_m: float
    deck_watch_max_s: float
    reacquire_s: float
    reacquire_max_s: float
    reacquire_offset_m: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require(value >= 0.0, f"{name} must not be negative, got {value}")
        require_within(self, sink_mps=(0.01, 5.0), final_descent_mps=(0.01, 5.0))


@dataclass(frozen=True)
class Descent:
    """Where a landing is.

    Attributes:
        phase: of it.
        since_s: when the phase began.
        height_m: over the neutral deck that is flown to at this moment.
    """

    phase: Phase
    since_s: float
    height_m: float


@dataclass(frozen=True)
class Over:
    """What the descent is decided on.

    Attributes:
        now_s: when the command takes effect.
        step_s: since the cycle before.
        height_m: of the aircraft's centre over the neutral deck.
        offset_m: horizontal, from the landing point.
        offset_at_contact_m: the same, predicted for contact, if the drop began now.
        lull: the moment is one to land in.
        contact_imminent: a contact is near that would find the aircraft tilted too much: see `levelling`.
        from_deck_m: from the deck's centre at contact, predicted for a final descent that begins now, or, while it is
            watched, in `reacquire_s`; infinite while the deck is not known well enough, None where it is not watched.
        final_descent_height_m: over the neutral deck from which the drop leaves time to level out: the aircraft waits
            there, where that is higher than `wait_height_m`.
    """

    now_s: float
    step_s: float
    height_m: float
    offset_m: float
    offset_at_contact_m: float
    lull: bool
    contact_imminent: bool = False
    from_deck_m: float | None = None
    final_descent_height_m: float = 0.0


def contact_in_s(height_m: float, sink_mps: float, lag_s: float, parameters: DescentParameters) -> float:
    """Time to contact from a height over the neutral deck, dropping [s].

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
    """Height lost by a drop after a time, and its speed then [m, m/s]; arguments as of `contact_in_s`."""
    final_descent_mps = parameters.final_descent_mps
    slower_mps, kept = max(final_descent_mps - sink_mps, 0.0), math.exp(-time_s / lag_s)
    return final_descent_mps * time_s - slower_mps * lag_s * (1.0 - kept), final_descent_mps - slower_mps * kept


def reacquire_at_m(height_m: float, passed_s: float, parameters: DescentParameters) -> float:
    """Height over the neutral deck after a part of the way down to where the drop begins."""
    return max(height_m - parameters.sink_mps * passed_s, parameters.wait_height_m)


def next_descent(before: Descent | None, over: Over, parameters: DescentParameters) -> Descent:
    """The descent a cycle later; `before` is None when a landing begins."""
    if before is None:
        before = Descent(Phase.SINK, over.now_s, over.height_m)
    if before.phase is Phase.FINAL_DESCENT:
        return before
    if over.contact_imminent:
        return Descent(Phase.FINAL_DESCENT, over.now_s, 0.0)
    wait_m = max(parameters.wait_height_m, over.final_descent_height_m)
    stop_m = wait_m if over.from_deck_m is None else parameters.deck_watch_height_m
    if before.phase is Phase.SINK:
        lower_m = before.height_m
        if over.offset_m <= parameters.pause_m:
            above_m = lower_m - stop_m
            sink_mps = min(parameters.sink_mps, _SLOWEST_MPS + parameters.slow_per_s * above_m)
            lower_m = max(lower_m - sink_mps * over.step_s, stop_m)
        low = over.height_m <= stop_m + parameters.wait_band_m
        if not low or lower_m > stop_m:
            return replace(before, height_m=lower_m)
        before = Descent(Phase.WAIT if over.from_deck_m is None else Phase.DECK_WATCH, over.now_s, stop_m)
    waited_s = over.now_s - before.since_s
    if before.phase is Phase.REACQUIRE:
        fits = over.from_deck_m is not None and over.from_deck_m <= parameters.reacquire_offset_m
        if waited_s >= parameters.reacquire_s and fits:
            return Descent(Phase.FINAL_DESCENT, over.now_s, 0.0)
        if waited_s > parameters.reacquire_max_s:
            return Descent(Phase.DECK_WATCH, over.now_s, stop_m)
        return replace(before, height_m=reacquire_at_m(before.height_m, over.step_s, parameters))
    watches = (
        before.phase is Phase.DECK_WATCH and over.from_deck_m is not None and waited_s <= parameters.deck_watch_max_s
    )
    offset_m, least_m = over.offset_at_contact_m, parameters.final_descent_offset_m
    if watches and over.from_deck_m is not None:
        offset_m, least_m = over.from_deck_m, parameters.deck_watch_offset_m
    allowed_m = least_m * (1.0 + parameters.relax_per_s) ** max(waited_s - parameters.relax_after_s, 0.0)
    if over.lull and offset_m <= allowed_m:
        return Descent(Phase.REACQUIRE if watches else Phase.FINAL_DESCENT, over.now_s, 0.0 if not watches else stop_m)
    return before
