"""The flight modes as one pure function: (situation, memory) → mode with a reason [Lee2022, §Nonlinear Control System].

Evidence ranks corners above bar above ship. A mode lasts at least `dwell_s`, so no two modes can flicker within a
second; only the wave-off of a landing and the end of the flight need not wait for that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from shipland.guidance.parameters import ApproachParameters, ModeParameters
from shipland.messages import Intent, Mode, Observation, PilotCommand

WAVE_OFF_S = 1.5
"""After a red status light, which flashes twice a second, no landing begins or goes on for so long."""


class Situation(NamedTuple):
    """Input of the mode function, besides its memory.

    Attributes:
        now_s: time of decision [s].
        observation: of the newest frame.
        landing_condition: why landing must not begin yet; empty when it may.
        committed: the aircraft is below the height at which a wave-off is riskier than the deck.
        abort_reason: the reason to break off the landing; empty when there is none.
        near_ship: the last known distance to the bar is inside the go-around radius.
        clear: after a go-around, height and distance allow another try.
        flying: the vehicle's own word.
        overruled: the safety, or a person, flies away from the ship or holds instead of what the pilot commanded.
        at_once: a landing begins with its condition, and the pilot does not break it off: the published rule.
    """

    now_s: float
    observation: Observation
    landing_condition: str
    committed: bool
    abort_reason: str
    near_ship: bool
    clear: bool
    flying: bool
    overruled: bool = False
    at_once: bool = False


class Evidence(NamedTuple):
    """One source's history: since when it has been seen without a gap, and when it was seen last [s]."""

    since_s: float = -math.inf
    last_s: float = -math.inf

    def update(self, seen: bool, now_s: float, lost_s: float) -> Evidence:
        """After a frame in which the source was `seen` or not."""
        if not seen:
            return self
        return Evidence(now_s if now_s - self.last_s > lost_s else self.since_s, now_s)


class ModeMemory(NamedTuple):
    """Memory of the mode function."""

    mode: Mode = Mode.SEARCH
    since_s: float = -math.inf
    reason: str = "nothing seen yet"
    corners: Evidence = Evidence()
    bar: Evidence = Evidence()
    ship: Evidence = Evidence()
    condition_since_s: float | None = None
    tries: int = 0
    waved_off_s: float = -math.inf


_SOURCES = ((Mode.APPROACH, "corners"), (Mode.TRACK_BAR, "bar"), (Mode.TRACK_SHIP, "ship"))
_NAMES = {"corners": "the bar's corners", "bar": "the bar", "ship": "the ship"}
_RANK = {Mode.APPROACH: 3, Mode.TRACK_BAR: 2, Mode.TRACK_SHIP: 1}


def next_mode(situation: Situation, memory: ModeMemory, parameters: ModeParameters) -> ModeMemory:
    """The mode for this cycle, with the reason for the last change in words."""
    now_s, seen = situation.now_s, situation.observation
    waved_off_s = now_s if seen.waves_off else memory.waved_off_s
    held = situation.landing_condition == "" and now_s - waved_off_s > WAVE_OFF_S
    since_s = memory.condition_since_s if memory.condition_since_s is not None else now_s
    memory = memory._replace(
        corners=memory.corners.update(seen.bar_pose is not None or seen.deck is not None, now_s, parameters.lost_s),
        bar=memory.bar.update(seen.bar_box is not None, now_s, parameters.lost_box_s),
        ship=memory.ship.update(seen.ship_box is not None, now_s, parameters.lost_box_s),
        condition_since_s=since_s if held else None,
        waved_off_s=waved_off_s,
    )
    wanted, reason = _wanted(situation, memory, parameters)
    urgent = (
        wanted is Mode.DONE
        or (wanted is Mode.GO_AROUND and memory.mode is Mode.LAND)
        or (wanted is Mode.LAND and situation.at_once)
    )
    if wanted is memory.mode or (now_s - memory.since_s < parameters.dwell_s and not urgent):
        return memory
    tries = memory.tries + (wanted is Mode.GO_AROUND)
    if wanted is Mode.GO_AROUND and tries > parameters.max_tries:
        reason += f"; {tries} landings broken off: holds clear of the ship"
    return memory._replace(mode=wanted, since_s=now_s, reason=reason, tries=tries, condition_since_s=None)


def _wanted(situation: Situation, memory: ModeMemory, parameters: ModeParameters) -> tuple[Mode, str]:
    mode, now_s = memory.mode, situation.now_s
    if mode is Mode.DONE or (mode is Mode.LAND and not situation.flying):
        return Mode.DONE, "the vehicle reports landed"
    if mode is Mode.GO_AROUND and (not situation.clear or memory.tries > parameters.max_tries):
        return Mode.GO_AROUND, memory.reason
    if mode is Mode.LAND and not situation.committed and now_s - memory.waved_off_s <= WAVE_OFF_S:
        return Mode.GO_AROUND, "waved off by the ship's red light"
    if mode is Mode.LAND and situation.overruled:
        return Mode.GO_AROUND, "the landing was overruled"
    if mode is Mode.LAND and situation.abort_reason and not situation.committed:
        return Mode.GO_AROUND, situation.abort_reason
    if mode is Mode.LAND:
        return _wanted_landing(situation, memory, parameters)
    if mode is Mode.APPROACH and memory.condition_since_s is not None:
        held_s = now_s - memory.condition_since_s
        if situation.at_once:
            return Mode.LAND, "inside the landing square"
        if held_s >= parameters.settle_s:
            return Mode.LAND, f"landing condition held for {held_s:.1f} s"
    return _wanted_source(situation, memory, parameters)


def _wanted_landing(situation: Situation, memory: ModeMemory, parameters: ModeParameters) -> tuple[Mode, str]:
    blind_s = situation.now_s - memory.corners.last_s
    if blind_s <= parameters.lost_s or situation.at_once:
        return Mode.LAND, memory.reason
    if not situation.committed:
        return Mode.GO_AROUND, f"corners lost for {blind_s:.1f} s above commit height"
    if blind_s <= parameters.blind_landing_s:
        return Mode.LAND, memory.reason
    return Mode.GO_AROUND, f"corners lost for {blind_s:.1f} s while landing"


def _wanted_source(situation: Situation, memory: ModeMemory, parameters: ModeParameters) -> tuple[Mode, str]:
    now_s = situation.now_s
    for mode, source in _SOURCES:
        evidence: Evidence = getattr(memory, source)
        if now_s - evidence.last_s > parameters.lost_after_s(source):
            continue
        confirmed = now_s - evidence.since_s >= parameters.confirm_s
        if mode is memory.mode:
            return mode, memory.reason
        if confirmed or _RANK[mode] < _RANK.get(memory.mode, 0):
            return mode, f"{_NAMES[source]} seen for {now_s - evidence.since_s:.1f} s"
    if memory.mode in _RANK:
        return Mode.NO_VISION, situation.observation.reason or "nothing seen"
    if memory.mode is Mode.NO_VISION and now_s - memory.since_s > parameters.memory_s:
        if situation.near_ship:
            return Mode.GO_AROUND, "lost near the ship"
        return Mode.SEARCH, "lost; searching"
    if memory.mode is Mode.GO_AROUND:
        return Mode.SEARCH, "clear of the ship; searching"
    return memory.mode, memory.reason


def overruled(sent: PilotCommand | None, mode: Mode) -> bool:
    """Whether what left the safety flies away from the ship, or holds, by a person's key too, and the mode does not.

    A hold ends a landing: what it was begun on, a final descent above all, is not so any more when the hold is lifted.
    """
    return sent is not None and sent.intent in (Intent.GO_AROUND, Intent.HOLD) and mode is not Mode.GO_AROUND


def may_retry(climbing_s: float, clear: bool, approach: ApproachParameters) -> bool:
    """Whether a go-around of this length ends: at its end point, or where it takes too long to reach that."""
    return climbing_s >= approach.go_around_s and (clear or climbing_s >= 4.0 * approach.go_around_s)


INTENTS = {
    Mode.LAND: Intent.LAND,
    Mode.APPROACH: Intent.FLY,
    Mode.TRACK_BAR: Intent.FLY,
    Mode.TRACK_SHIP: Intent.FLY,
    Mode.NO_VISION: Intent.FLY,
    Mode.SEARCH: Intent.SEARCH,
    Mode.GO_AROUND: Intent.GO_AROUND,
    Mode.DONE: Intent.HOLD,
}
"""The intent of each mode."""
