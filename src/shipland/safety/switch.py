"""The switch: who flies, the pilot or the recovery, as one pure function of what the monitor finds.

The ladder of a recovery is a go-around, a wait until what was found has passed, and the way back; each step begins
where the one before did not help. A landing is handed back to the pilot for another try while there are tries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from shipland.safety.monitor import Action, Finding, Look, room_to_bar_m
from shipland.safety.recovery import Recovery, RecoveryParameters, Rung, is_clear

_CALM_S = 1.0
"""What was found has passed when it was not found for so long."""
_BRAKED = 3.0
"""Braked, it would stop so many times as far from the bar as it must."""


@dataclass(frozen=True)
class Switch:
    """Between cycles.

    Attributes:
        recovery: that is flown; None while the pilot flies.
        tries: landings broken off so far.
        found_s: when something was found last.
    """

    recovery: Recovery | None = None
    tries: int = 0
    found_s: float = -math.inf


def next_switch(before: Switch, look: Look, found: Sequence[Finding], parameters: RecoveryParameters) -> Switch:
    """The switch a cycle later.

    Args:
        before: of the last cycle.
        look: what the monitor looked at.
        found: its findings, the gravest first.
        parameters: of the recovery.
    """
    if found:
        before = replace(before, found_s=look.t_s)
    if before.recovery is not None:
        return _recovering(before, before.recovery, look, found, parameters)
    if not found or not look.telemetry.flying:
        return before
    gravest = found[0]
    committed = look.landing and look.over_deck_m is not None and look.over_deck_m < look.limits.commit_m
    if gravest.action is Action.REFUSE and not committed:
        return replace(before, recovery=_last(gravest.words, look.t_s, parameters))
    if gravest.action is Action.BRAKE:
        return replace(before, recovery=Recovery(Rung.BRAKE, look.t_s, gravest.words))
    breaks_off = gravest.action is Action.NO_GO and look.landing and not committed
    if breaks_off or gravest.action is Action.GO_AROUND:
        recovery = Recovery(parameters.ladder[0], look.t_s, gravest.words)
        return replace(before, recovery=recovery, tries=before.tries + 1)
    return before


def _recovering(
    before: Switch, recovery: Recovery, look: Look, found: Sequence[Finding], parameters: RecoveryParameters
) -> Switch:
    refused = next((finding for finding in found if finding.action is Action.REFUSE), None)
    if refused is not None and not recovery.final:
        return replace(before, recovery=_last(refused.words, look.t_s, parameters))
    lasted_s, calm = look.t_s - recovery.since_s, look.t_s - before.found_s >= _CALM_S
    if recovery.final:
        return before
    if recovery.rung is Rung.BRAKE:
        braked = room_to_bar_m(look) > _BRAKED * look.limits.least_to_bar_m
        return replace(before, recovery=None) if braked or lasted_s > parameters.most_s else before
    if recovery.rung is Rung.GO_AROUND:
        ended = is_clear(look.estimate, look.t_s, look.ship.deck_in_bar_m, parameters) or lasted_s > parameters.most_s
        if not ended:
            return before
        if calm and before.tries <= parameters.tries:
            return replace(before, recovery=None)
        return replace(before, recovery=_after(recovery, look.t_s, parameters))
    if recovery.rung is Rung.HOLD:
        if calm and before.tries <= parameters.tries:
            return replace(before, recovery=None)
        if lasted_s > parameters.hold_s or before.tries > parameters.tries:
            return replace(before, recovery=_after(recovery, look.t_s, parameters))
    return before


def _after(recovery: Recovery, now_s: float, parameters: RecoveryParameters) -> Recovery:
    """The next step of the ladder; the last one is for good."""
    ladder = parameters.ladder
    index = ladder.index(recovery.rung) + 1 if recovery.rung in ladder else len(ladder)
    if index >= len(ladder):
        return replace(recovery, final=True)
    return Recovery(ladder[index], now_s, recovery.words, final=index == len(ladder) - 1)


def _last(words: str, now_s: float, parameters: RecoveryParameters) -> Recovery:
    """The ladder's end, at once."""
    return Recovery(parameters.ladder[-1], now_s, words, final=True)
