"""Our own touchdown detection: an autopilot's waits for a surface that stands still, which a deck does not.

In the air an aircraft gains the downward speed that its throttle leaves it: gravity's, less the rotors' share. What it
does not gain, something else carries: the speed it lacks over a short while is the measure of contact. A touch asks for
one lack, for which the descent goes on; standing, for which motors may be stopped, asks for a low throttle as well and
for a lack that lasts, so that neither a jolt nor a leap of the velocity's estimate is enough.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

from shipland.config import key, parameters
from shipland.frames import GRAVITY_MPS2

MOTORS_STOPPED = "the motors have stopped"
_LEAST_HOVER = 0.4
"""Least measured hover throttle, as a share of the stated one: lower values were measured on the ground."""
_HOVER_S = 5.0
"""Time constant of the hover throttle measured in flight."""


def motors_stopped(landing: bool) -> str:
    """The end of a flight whose motors have stopped, in words."""
    return f"landed: {MOTORS_STOPPED}" if landing else MOTORS_STOPPED


@parameters
class TouchdownParameters:
    """`[touchdown]`.

    In 129 flights of two autopilots the lack over 0.2 s was at most 0.28 m/s in the air, above 1 on a deck.
    """

    window_s: float = key(0.2, "over which the lack of downward speed is taken", ge=0.05, le=1)
    touch_mps: float = key(0.45, "lack that is a touch, as of one foot that a falling deck leaves again", ge=0.05, le=5)
    support_share: float = key(0.3, "of gravity, which must be lacking all the while where it stands", ge=0.05, le=0.95)
    low_share: float = key(0.6, "of the hover throttle, below which the throttle is low", ge=0.05, le=0.8)
    confirm_s: float = key(
        0.2, "how long every window must be supported, at a low throttle, for it to stand", ge=0.05, le=5
    )
    release_s: float = key(
        0.4, "so long without another such lack, and a touch was none, or has been bounced off", ge=0.05, le=5
    )
    insist_s: float = key(
        1.0, "a touch outlives the pilot's landing and the sight of the contact height by so much", ge=0.05, le=5
    )
    press_mps: float = key(1.5, "commanded descent after a touch, within the vehicle's own limit", ge=0.05, le=3)
    stale_s: float = key(0.2, "older telemetry tells nothing", ge=0.05, le=1)
    range_m: float = key(0.5, "where a downward rangefinder says more than this, there is no touchdown", ge=0.05, le=5)


class GroundContact(enum.Enum):
    """What is known of the ground under the aircraft."""

    NONE = "none"
    TOUCHED = "touched"
    STANDS = "stands"


@dataclass(frozen=True)
class ContactSignals:
    """What is known at one instant; NaN is unknown.

    Attributes:
        t_s: now.
        landing: landing is commanded, by the pilot and now.
        at_contact_height: a fresh sight shows the aircraft low enough to touch.
        throttle: 0 … 1 of full.
        throttle_t_s: when.
        down_mps: downward speed.
        down_t_s: when.
        range_m: of a downward rangefinder, or None.
    """

    t_s: float
    landing: bool
    at_contact_height: bool
    throttle: float
    throttle_t_s: float
    down_mps: float
    down_t_s: float
    range_m: float | None


class _Sample(NamedTuple):
    t_s: float
    down_mps: float
    free_mps: float
    """Downward speed that the throttle would have left it, since the beginning."""
    share: float
    """Throttle as a share of the hover throttle."""


class TouchdownWatch:
    """Follows throttle and downward speed through a flight, from before the landing on.

    The hover throttle is the smaller of what the vehicle states and what it was flown with before the landing: one
    that is stated too high would make hovering look carried.
    """

    def __init__(self, parameters: TouchdownParameters, hover_throttle: float) -> None:
        self._limits, self._stated = parameters, hover_throttle
        self._flown = math.nan
        self._samples: deque[_Sample] = deque()
        self._touched_s = self._renewed_s = self._low_since_s = math.nan
        self._sighted_s = -math.inf

    def see(self, now: ContactSignals) -> GroundContact:
        """Take in what is known now; what cannot be known counts as in the air.

        An updraft carries an aircraft as a deck does: there is no touch but at contact height.
        """
        limits = self._limits
        if now.at_contact_height:
            self._sighted_s = now.t_s
        elif now.t_s - self._sighted_s > limits.insist_s:
            self._release()
        known = math.isfinite(now.throttle) and math.isfinite(now.down_mps)
        known = known and now.t_s - min(now.throttle_t_s, now.down_t_s) <= limits.stale_s
        over = now.range_m is not None and now.range_m > limits.range_m
        if not known or over:
            self._samples.clear()
            self._release()
            return GroundContact.NONE
        if not self._samples or now.down_t_s > self._samples[-1].t_s:
            self._take(now)
            self._judge(now)
        if math.isnan(self._touched_s):
            return GroundContact.NONE
        stands = self._samples[-1].t_s - self._low_since_s >= limits.confirm_s
        return GroundContact.STANDS if stands else GroundContact.TOUCHED

    def _take(self, now: ContactSignals) -> None:
        """One sample more, and none that is older than the window's beginning."""
        samples, limits = self._samples, self._limits
        if samples and now.down_t_s - samples[-1].t_s > limits.stale_s:
            samples.clear()
        step_s = now.down_t_s - samples[-1].t_s if samples else 0.0
        if not now.landing and math.isnan(self._touched_s):
            known = now.throttle if math.isnan(self._flown) else self._flown
            self._flown = known + min(step_s / _HOVER_S, 1.0) * (now.throttle - known)
        hover = self._stated
        if math.isfinite(self._flown):
            hover = min(hover, max(self._flown, _LEAST_HOVER * hover))
        share = now.throttle / hover
        free_mps = GRAVITY_MPS2 * (1.0 - share) * step_s + (samples[-1].free_mps if samples else 0.0)
        samples.append(_Sample(now.down_t_s, now.down_mps, free_mps, share))
        while len(samples) > 1 and samples[1].t_s <= now.down_t_s - limits.window_s:
            samples.popleft()

    def _judge(self, now: ContactSignals) -> None:
        limits, first, last = self._limits, self._samples[0], self._samples[-1]
        whole = last.t_s - first.t_s >= 0.9 * limits.window_s
        lack_mps = (last.free_mps - first.free_mps) - (last.down_mps - first.down_mps)
        touches = whole and lack_mps > limits.touch_mps
        if math.isnan(self._touched_s):
            if not (now.landing and now.at_contact_height and touches):
                return
            self._touched_s = last.t_s
        if touches:
            self._renewed_s = last.t_s
        left = not now.landing and last.t_s - self._touched_s > limits.insist_s
        if left or last.t_s - self._renewed_s > limits.release_s:
            self._release()
            return
        carried = whole and lack_mps > limits.support_share * GRAVITY_MPS2 * limits.window_s
        low = max(sample.share for sample in self._samples) < limits.low_share
        if not (carried and low):
            self._low_since_s = math.nan
        elif math.isnan(self._low_since_s):
            self._low_since_s = last.t_s

    def _release(self) -> None:
        self._touched_s = self._renewed_s = self._low_since_s = math.nan
