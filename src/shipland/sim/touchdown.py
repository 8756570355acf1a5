"""The touchdown, judged from contacts: where, how fast, how far it slipped, and what went wrong, in words."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.config import key, parameters, require
from shipland.frames import Array
from shipland.messages import TouchdownVerdict
from shipland.rig import in_area
from shipland.sim.aircraft.parameters import Vector


@parameters
class VerdictParameters:
    """What counts as a landing (`[verdict]`)."""

    max_descent_mps: float = key(1.5, "largest speed into the deck at first contact", "a drop from 11 cm", gt=0)
    max_drift_mps: float = key(1.0, "largest speed along the deck at first contact", gt=0)
    max_tilt_deg: float = key(25.0, "largest tilt against the deck's normal after contact", gt=0)
    max_slip_m: float = key(0.25, "farthest from the touchdown point before rest", gt=0)
    bounce_s: float = key(0.5, "off the deck for longer with motors running, the contact was none", gt=0)
    rest_s: float = key(1.5, "still on the deck for so long is rest", gt=0)
    rest_speed_mps: float = key(0.05, "still means slower than this against the deck", gt=0)
    patience_s: float = key(6.0, "without rest so long after the motors stopped, there is none", gt=0)

    def __post_init__(self) -> None:
        require(self.patience_s > self.rest_s, "patience_s must be longer than rest_s")


class OnDeck(NamedTuple):
    """The aircraft against the deck.

    Attributes:
        position_m: centre of mass in `deck`.
        velocity_mps: against the deck's point under it, in `deck`; down positive.
        tilt_rad: its vertical against the deck's normal.
    """

    position_m: Vector
    velocity_mps: Vector
    tilt_rad: float


class Contacts(NamedTuple):
    """Contacts at one instant.

    Attributes:
        feet: how many feet are on the deck.
        force_n: their summed normal force.
        fault: a contact that ends the flight, in words, or empty.
    """

    feet: int
    force_n: float
    fault: str


NO_TOUCH = Contacts(0, 0.0, "")


class BrokenLimit(NamedTuple):
    """A limit of a landing that was not kept: hard, drift, tilt or slip, and by how much, in words."""

    kind: str
    words: str


def broken_limit(
    limits: VerdictParameters, velocity_in_deck_mps: Array, tilt_rad: float, slip_m: float
) -> BrokenLimit | None:
    """The first limit that a touchdown did not keep.

    Args:
        limits: what counts as a landing.
        velocity_in_deck_mps: (3,) against the deck just before contact.
        tilt_rad: largest tilt against the deck after contact.
        slip_m: farthest from the touchdown point before rest.
    """
    u, v, down = velocity_in_deck_mps.tolist()
    drift, tilt_deg = math.hypot(u, v), math.degrees(tilt_rad)
    if down > limits.max_descent_mps:
        words = f"touched down too hard: {down:.2f} m/s into the deck, the limit is {limits.max_descent_mps:g} m/s"
        return BrokenLimit("hard", words)
    if drift > limits.max_drift_mps:
        words = f"touched down drifting {drift:.2f} m/s over the deck, the limit is {limits.max_drift_mps:g} m/s"
        return BrokenLimit("drift", words)
    if tilt_deg > limits.max_tilt_deg:
        return BrokenLimit("tilt", f"tilted {tilt_deg:.0f}° on the deck, the limit is {limits.max_tilt_deg:g}°")
    if slip_m > limits.max_slip_m:
        return BrokenLimit("slip", f"slipped {100 * slip_m:.0f} cm, the limit is {100 * limits.max_slip_m:.0f} cm")
    return None


class _Contact:
    """One touchdown from its first contact on."""

    def __init__(self, t_s: float, before: OnDeck) -> None:
        self.t_s = t_s
        self.last_s = t_s
        self.at = before
        self.tilt_rad = before.tilt_rad
        self.slip_m = 0.0
        self.force_n = 0.0

    def extend(self, t_s: float, now: OnDeck, touch: Contacts) -> None:
        if touch.feet:
            self.last_s = t_s
        self.tilt_rad = max(self.tilt_rad, now.tilt_rad)
        x, y, _ = self.at.position_m
        self.slip_m = max(self.slip_m, math.hypot(now.position_m[0] - x, now.position_m[1] - y))
        self.force_n = max(self.force_n, touch.force_n)


class Judge:
    """Follows the aircraft against the deck and gives the verdict once it stands still or has crashed.

    Args:
        parameters: limits.
        landing_square_m: side of the square, or diameter of the circle.
        landing_area: square or circle.
    """

    def __init__(self, parameters: VerdictParameters, landing_square_m: float, landing_area: str = "square") -> None:
        self._limits = parameters
        self._area, self._size_m = landing_area, landing_square_m
        self._contact: _Contact | None = None
        self._before: OnDeck | None = None
        self._still_since_s: float | None = None
        self._stopped_s: float | None = None
        self.verdict: TouchdownVerdict | None = None
        """The verdict, once there is one."""

    @property
    def touched(self) -> bool:
        """Whether there is a touchdown, not taken back by a bounce."""
        return self._contact is not None

    def follow(self, t_s: float, now: OnDeck, touch: Contacts, motors_run: bool) -> None:
        """Take in one instant; instants must follow each other in time."""
        if self.verdict is not None:
            return
        before, self._before = self._before or now, now
        if touch.feet and self._contact is None:
            self._contact = _Contact(t_s, before)
        if self._contact is not None:
            self._contact.extend(t_s, now, touch)
            if motors_run and t_s - self._contact.last_s > self._limits.bounce_s:
                self._contact = None
        if touch.fault:
            self.crash(t_s, now, touch.fault)
        elif not motors_run:
            self._settle(t_s, now, touch)

    def crash(self, t_s: float, now: OnDeck, fault: str) -> None:
        """End the flight with a fault in words."""
        if self.verdict is None:
            self.verdict = self._verdict(self._contact or _Contact(t_s, now), now, False, fault)

    def _settle(self, t_s: float, now: OnDeck, touch: Contacts) -> None:
        if self._stopped_s is None:
            self._stopped_s = t_s
        speed = math.sqrt(sum(value * value for value in now.velocity_mps))
        if touch.feet < 3 or speed > self._limits.rest_speed_mps or self._contact is None:
            self._still_since_s = None
            if t_s - self._stopped_s > self._limits.patience_s:
                self.crash(t_s, now, "did not come to rest on the deck")
            return
        if self._still_since_s is None:
            self._still_since_s = t_s
        if t_s - self._still_since_s >= self._limits.rest_s:
            at = self._contact
            broken = broken_limit(self._limits, np.array(at.at.velocity_mps), at.tilt_rad, at.slip_m)
            self.verdict = self._verdict(at, now, broken is None, broken.words if broken is not None else "")

    def _verdict(self, contact: _Contact, end: OnDeck, landed: bool, fault: str) -> TouchdownVerdict:
        touchdown_m, rest_m = np.array(contact.at.position_m[:2]), np.array(end.position_m[:2])
        velocity_mps = np.array(contact.at.velocity_mps)
        if self._contact is None:
            touchdown_m, rest_m, velocity_mps = np.full(2, np.nan), np.full(2, np.nan), np.full(3, np.nan)
        inside = in_area(self._area, self._size_m, *touchdown_m.tolist())
        reason = fault
        if landed:
            where = f"in the {self._area}" if inside else f"outside the {self._area}"
            reason = f"landed {where}, {100 * np.hypot(*touchdown_m):.0f} cm from its centre"
        return TouchdownVerdict(
            t_s=contact.t_s,
            landed=landed,
            in_square=inside,
            touchdown_in_deck_m=touchdown_m,
            rest_in_deck_m=rest_m,
            relative_velocity_in_deck_mps=velocity_mps,
            tilt_rad=contact.tilt_rad,
            slip_m=contact.slip_m,
            peak_contact_force_n=contact.force_n,
            reason=reason,
        )
