"""The recovery: plain manoeuvres away from the ship, flown by the safety itself, and the switch that chooses who flies.

One law for all of them: a velocity against the bar is asked for, and held against the wind by the mean tilt of late.
The way out is known to be free, because the aircraft came along it: up, and astern of the deck. Without poses the
vehicle holds its place by itself, where its released sticks do that, and only climbs.

The switch is one pure function of what the monitor finds. The ladder of a recovery is a go-around, a wait until what
was found has passed, and the way back; each step begins where the one before did not help. A landing is handed back to
the pilot for another try while there are tries.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipland.config import key, parameters, require, scaled
from shipland.frames import Array, rotated, turned
from shipland.guidance.response import Response
from shipland.messages import Intent, PilotCommand
from shipland.safety.estimate import SafetyEstimate, Vector
from shipland.safety.monitor import Action, Finding, Look, room_to_bar_m


class Rung(enum.Enum):
    """One step of the ladder, in words of the configuration."""

    BRAKE = "brake"
    """Up and astern, until it can stop ahead of the superstructure again; no step of the ladder."""
    GO_AROUND = "go_around"
    """Up, and astern of the deck."""
    HOLD = "hold"
    """Where it is, until what was found has passed."""
    RETURN = "return"
    """Astern, the way that it came, and hold there."""
    RELEASE = "release"
    """Sticks released: the vehicle holds by itself; no step of the ladder."""
    LAND = "land"
    """Straight down where it is, when the battery is low: a ditching, for those who ask for it."""


@parameters
class RecoveryParameters:
    """`[safety.recovery]`."""

    ladder: tuple[Rung, ...] = key(
        (Rung.GO_AROUND, Rung.HOLD, Rung.RETURN),
        "steps while what was found lasts; the last one stays",
        '"land" ditches where it is',
    )
    tries: int = key(
        3, "landings that may be broken off before the second step", "as guidance.modes.max_tries", ge=1, le=100
    )
    climb_percent: float = key(80.0, "heave stick of a climb", ge=10, le=100)
    astern_mps: float = scaled(0.8, "speed against the bar, astern", ge=0.1, le=20)
    clear_height_m: float = scaled(
        2.2, "over the neutral deck, and with `clear_back_m` astern of its centre: a go-around ends", ge=0.5, le=100
    )
    clear_back_m: float = scaled(3.0, "see there", ge=0.5, le=500)
    most_s: float = scaled(12.0, "a go-around that is not clear by then ends all the same", ge=1, le=120)
    hold_s: float = key(10.0, "how long the ladder waits on `hold`", ge=1, le=600)
    return_m: float = scaled(20.0, "from the bar, where a return ends", ge=1, le=5000)
    velocity_per_s: float = key(1.0, "from an error of velocity to the acceleration that is asked for", ge=0.1, le=5)
    blind_s: float = key(
        4.0, "the velocity against the bar is carried on by the vehicle's own for so long without poses", ge=0.5, le=30
    )

    def __post_init__(self) -> None:
        require(len(self.ladder) > 0, "ladder must hold at least one step")
        for rung in (Rung.BRAKE, Rung.RELEASE):
            require(rung not in self.ladder, f"{rung.value} is no step of the ladder: it is for what was found")


@dataclass(frozen=True)
class Recovery:
    """A recovery that is flown.

    Attributes:
        rung: of the ladder.
        since_s: when it began.
        words: why.
        calm_s: the pilot may fly again when nothing was found for so long; infinite at the ladder's end.
    """

    rung: Rung
    since_s: float
    words: str
    calm_s: float = 1.0

    @property
    def refuses(self) -> bool:
        """Whether the pilot is kept off for longer than after one landing that was broken off."""
        return self.calm_s > Recovery.calm_s


def is_clear(estimate: SafetyEstimate, t_s: float, deck_in_bar_m: Array, parameters: RecoveryParameters) -> bool:
    """Whether a go-around has ended: high enough and astern of the deck, by poses or by what was known last."""
    over_m = estimate.over_deck_at(t_s, parameters.blind_s)
    place_m = estimate.place_at(t_s, parameters.blind_s)
    if over_m is None or over_m < parameters.clear_height_m:
        return False
    return place_m is None or place_m[0] <= float(deck_in_bar_m[0]) - parameters.clear_back_m


def sticks_of(
    rung: Rung,
    estimate: SafetyEstimate,
    t_s: float,
    gimbal_rad: float,
    response: Response,
    parameters: RecoveryParameters,
) -> PilotCommand:
    """The command of one cycle of a rung, at `t_s` [s]; `gimbal_rad` is the camera's pitch where nothing tells it."""
    if rung is Rung.RELEASE:
        return PilotCommand.hold(t_s, _gimbal_rad(estimate, gimbal_rad))
    over_m = estimate.over_deck_at(t_s, parameters.blind_s)
    low = over_m is None or over_m < parameters.clear_height_m
    climb_percent = parameters.climb_percent if rung in _AWAY and low else 0.0
    if rung is Rung.LAND:
        climb_percent = -parameters.climb_percent
    astern_mps = parameters.astern_mps if rung in _AWAY else 0.0
    if over_m is not None and over_m < _FEET_FREE_M:
        astern_mps = 0.0  # feet that still stand would tip it over
    told = estimate.velocity_mps is not None or estimate.velocity_at(t_s, parameters.blind_s) is not None
    if rung is Rung.RETURN and (estimate.bar_distance_m() >= parameters.return_m or not told):
        astern_mps = 0.0  # there, or without anything that tells the way made good: it would never end
    pitch_percent, roll_percent = _level_sticks(estimate, t_s, -astern_mps, response, parameters)
    still = climb_percent == pitch_percent == roll_percent == 0.0
    intent = Intent.LAND if rung is Rung.LAND else Intent.HOLD if still else Intent.GO_AROUND
    return PilotCommand(t_s, pitch_percent, roll_percent, climb_percent, 0.0, _gimbal_rad(estimate, gimbal_rad), intent)


def _level_sticks(
    estimate: SafetyEstimate, t_s: float, forward_mps: float, response: Response, parameters: RecoveryParameters
) -> tuple[float, float]:
    """Pitch and roll for a speed along the bar's axis, and none across it: a = a_wind + k·(v_wanted − v)."""
    velocity_mps = estimate.velocity_at(t_s, parameters.blind_s)
    if velocity_mps is None:
        return _blind_sticks(estimate, forward_mps, response)
    axis_rad = estimate.bar_in_level_rad()
    error = np.array([forward_mps, 0.0]) - velocity_mps[:2]
    if response.kind == "velocity":
        own_mps = (0.0, 0.0) if estimate.velocity_mps is None else estimate.in_level(estimate.velocity_mps)
        asked = np.array(turned(*own_mps, -axis_rad)) + error
    else:
        asked = np.array(turned(*_held_in_level(estimate), -axis_rad)) + parameters.velocity_per_s * error
        towards_mps = velocity_mps[0] - _TOWARDS_MPS
        if towards_mps > 0.0:  # in the superstructure's lee no wind pushes it out
            asked[0] = min(asked[0], 0.0) - _TOWARDS * parameters.velocity_per_s * towards_mps
        if forward_mps < 0.0:  # a wind from ahead may blow it astern; in the superstructure's lee there is none
            asked[0] = min(asked[0], 0.0)
    asked = rotated(asked, axis_rad)
    return _stick(asked[0], response), _stick(asked[1], response)


def _blind_sticks(estimate: SafetyEstimate, forward_mps: float, response: Response) -> tuple[float, float]:
    """Without poses: back along the bar's axis, where a stick means a speed; else what holds the place."""
    if response.kind == "velocity":
        ahead, right = turned(forward_mps, 0.0, estimate.bar_in_level_rad())
        return _stick(ahead, response), _stick(right, response)
    if response.hold_below_percent > 0.0:
        return 0.0, 0.0  # released sticks hold
    held = _held_in_level(estimate)
    return _stick(held[0], response), _stick(held[1], response)


def _held_in_level(estimate: SafetyEstimate) -> Vector:
    return (0.0, 0.0) if estimate.held_mps2 is None else estimate.in_level(estimate.held_mps2)


def _stick(wanted: float, response: Response) -> float:
    return min(max(response.stick_of(float(wanted)), -100.0), 100.0)


def _gimbal_rad(estimate: SafetyEstimate, before_rad: float) -> float:
    """To the bar, where its place is known."""
    place_m = estimate.place_in_bar_m
    if place_m is None:
        return before_rad
    return math.atan2(place_m[2], max(math.hypot(place_m[0], place_m[1]), 0.3))


_AWAY = (Rung.BRAKE, Rung.GO_AROUND, Rung.RETURN)
_FEET_FREE_M = 0.3
"""Over the neutral deck, of the aircraft's centre: lower, a foot may still stand."""
_TOWARDS_MPS, _TOWARDS = 0.2, 4.0
"""A speed towards the bar beyond the first, as under a ship that backs up, is braked with so many times the gain."""


REFUSED_S = 20.0
"""After a refusal the pilot may try again when what it was for has not been found for so long."""
_BRAKED = 3.0
"""Braked, it would stop so many times as far from the bar as it must."""


@dataclass(frozen=True)
class Switch:
    """Between cycles.

    Attributes:
        recovery: that is flown; None while the pilot flies.
        tries: landings broken off so far.
        found_s: when something was found last.
        releases: so far; the second is for good, for every try with a reversed heave costs height.
    """

    recovery: Recovery | None = None
    tries: int = 0
    found_s: float = -math.inf
    releases: int = 0


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
    released = before.recovery is not None and before.recovery.rung is Rung.RELEASE
    if found and found[0].action is Action.RELEASE and not released:
        recovery = Recovery(Rung.RELEASE, look.t_s, found[0].words, math.inf if before.releases else REFUSED_S)
        return replace(before, recovery=recovery, releases=before.releases + 1)
    if before.recovery is not None:
        return _recovering(before, before.recovery, look, found, parameters)
    if not found or not look.telemetry.flying:
        return before
    gravest = found[0]
    committed = look.landing and look.over_deck_m is not None and look.over_deck_m < look.limits.commit_m
    if gravest.action is Action.REFUSE and not committed:
        return replace(before, recovery=_refusal(gravest.words, look.t_s, parameters))
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
    if refused is not None and not recovery.refuses:
        return replace(before, recovery=_refusal(refused.words, look.t_s, parameters))
    lasted_s, calm = look.t_s - recovery.since_s, look.t_s - before.found_s > recovery.calm_s
    if recovery.refuses:
        again = calm and before.tries <= parameters.tries
        return replace(before, recovery=None, tries=before.tries + 1) if again else before
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
        return replace(recovery, calm_s=math.inf)
    return Recovery(ladder[index], now_s, recovery.words, math.inf if index == len(ladder) - 1 else Recovery.calm_s)


def _refusal(words: str, now_s: float, parameters: RecoveryParameters) -> Recovery:
    """The ladder's last step at once, until what was found has passed; a ditching is for good."""
    rung = parameters.ladder[-1]
    return Recovery(rung, now_s, words, math.inf if rung is Rung.LAND else REFUSED_S)
