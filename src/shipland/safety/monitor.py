"""The monitor: what is about to go wrong, one pure function a rule, asked in every cycle and of every pilot.

A rule looks ahead along the distance in which the aircraft can stop, never at the pilot's own estimate or mode. What
it finds is named in words and says what has to be done about it; doing it is the recovery's.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from shipland.config import key, parameters, scaled
from shipland.frames import GRAVITY_MPS2, Array, turned
from shipland.guidance.modes import WAVE_OFF_S
from shipland.guidance.response import Response
from shipland.messages import Intent, PilotCommand, Telemetry
from shipland.rig import Rig
from shipland.safety.estimate import POSED_S, Place, SafetyEstimate, Vector, tilt_of


class Action(enum.IntEnum):
    """What a finding asks for, the gravest last."""

    NO_GO = 1
    """No landing is begun; one that is not committed yet is broken off."""
    BRAKE = 2
    """Away from the superstructure, until it can stop in time."""
    GO_AROUND = 3
    """A landing is broken off at any height."""
    REFUSE = 4
    """Away from the ship, and another try only when this has not been found for `recovery.REFUSED_S`."""
    RELEASE = 5
    """The sticks are released, and the vehicle holds by itself; then as after `REFUSE`."""


@dataclass(frozen=True)
class Finding:
    """What a rule found.

    Attributes:
        action: what it asks for.
        words: for the log and for people.
    """

    action: Action
    words: str


@parameters
class MonitorParameters:
    """`[safety.monitor]`.

    Chosen on flights without faults, where no rule may fire up to 5 m/s of wind: docs/results/safety.md.
    """

    reaction_s: float = key(0.3, "from a command to the deceleration that it asks for", ge=0.05, le=2)
    brake_mps2: float = key(
        3.0, "largest deceleration that is counted on", "full tilt of 15° and some drag", ge=0.2, le=10
    )
    least_to_bar_m: float = scaled(0.4, "of the aircraft's centre to the bar's plane, where it can stop", ge=0.1, le=50)
    foot_m: float = key(
        0.0, "the aircraft's centre must be within the deck by this", "contact is foreseen to 30 cm only", ge=0, le=10
    )
    near_m: float = scaled(
        6.0, "nearer to the bar than this, poses that leap or are missing are not waited for", ge=1, le=200
    )
    blind_s: float = key(
        3.5, "longest without a pose there", "a little longer than guidance.modes.memory_s", ge=0.5, le=30
    )
    tilt_deg: float = key(
        36.0, "largest of the last second to land with", "pilots level out; the verdict bears 25°", ge=5, le=45
    )
    tilt_height_m: float = scaled(0.3, "over the neutral deck; lower, a go-around is tilted no less", ge=0, le=20)
    wind_share: float = key(0.9, "of full tilt, what holding against the wind may take", ge=0.1, le=1)
    wind_tilt_deg: float = key(
        27.0, "tilt that holding against the wind may take", "over 10 s 9 m/s take 17–25°, 12 m/s 27–33°", ge=5, le=45
    )
    wind_time_s: float = key(
        8.0, "the wind is measured for so long", "gusts at 9 m/s tilt it by 28° for seconds", ge=0.5, le=10
    )
    leap_mps: float = scaled(
        2.0, "allowed change of velocity against poses in seconds: the flow lies, or the ship manoeuvres", ge=0.2, le=20
    )
    height_leap_m: float = scaled(0.8, "the same of barometer and poses", ge=0.1, le=20)
    scale_off: float = key(
        0.19,
        "logarithm of the factor between distances by the cue and the way flown",
        "past a fifth, the deck's edge",
        gt=0,
        le=9,
    )
    telemetry_s: float = key(
        1.0, "oldest attitude, velocity and height to land with, of those that the vehicle gives", ge=0.1, le=5
    )
    commit_m: float = scaled(
        0.45, "lower over the deck, only GO_AROUND breaks a landing off: the deck is safer than a climb", ge=0, le=20
    )


@dataclass(frozen=True)
class Ship:
    """What must not be struck, in `bar`.

    Attributes:
        deck_in_bar_m: (3,) its neutral centre.
        half_deck_m: half the deck's side.
        half_house_m: half the superstructure's width.
        house_top_m: down coordinate of the superstructure's highest edge (negative: above the bar's centre).
    """

    deck_in_bar_m: Array
    half_deck_m: float
    half_house_m: float
    house_top_m: float

    @staticmethod
    def of(rig: Rig) -> Ship:
        """From the rig's dimensions; the board stands above a superstructure that is lower."""
        top_m = min(rig.bar_height_m - rig.superstructure_height_m, -0.5 * rig.board_size_m[1])
        return Ship(rig.deck_in_bar_m, 0.5 * rig.deck_size_m, 0.5 * rig.platform_width_m, top_m)


class Look(NamedTuple):
    """What the rules are asked of.

    Attributes:
        t_s: now.
        command: the pilot's.
        telemetry: now.
        estimate: the safety's own.
        place_m, velocity_mps: in `bar`, now; None where no pose of late tells.
        over_deck_m: of the aircraft's centre over the neutral deck; None where unknown.
        ship: what must not be struck.
        response: of the vehicle.
        limits: bounds.
        reversed_stick: one that the vehicle answers the other way round; empty where none is.
    """

    t_s: float
    command: PilotCommand
    telemetry: Telemetry
    estimate: SafetyEstimate
    place_m: Place | None
    velocity_mps: Place | None
    over_deck_m: float | None
    ship: Ship
    response: Response
    limits: MonitorParameters
    reversed_stick: str = ""

    @property
    def landing(self) -> bool:
        """A landing is commanded."""
        return self.command.intent is Intent.LAND

    @property
    def blind(self) -> bool:
        """No pose for so long that what the last ones contradicted is no longer news."""
        return self.t_s - self.estimate.pose_s > self.limits.blind_s


Rule = Callable[[Look], Finding | None]


def stopping_distance_m(speed_mps: float, acceleration_mps2: float, brake_mps2: float, reaction_s: float) -> float:
    """Way until a speed is braked: v·t + a·t²/2, then (v + a·t)²/(2·brake); 0 for what does not approach.

    Args:
        speed_mps: now.
        acceleration_mps2: until the brake takes effect.
        brake_mps2: deceleration from then on.
        reaction_s: until then.

    >>> stopping_distance_m(2.0, 0.0, 2.0, 0.5)
    2.0
    """
    gained_mps = max(acceleration_mps2, 0.0) * reaction_s
    later_mps = max(speed_mps + gained_mps, 0.0)
    return max(speed_mps + 0.5 * gained_mps, 0.0) * reaction_s + later_mps**2 / (2.0 * brake_mps2)


def brake_mps2(look: Look) -> float:
    """Deceleration that tilt can give against the bar's direction: what the wind does not take of it."""
    full_mps2 = GRAVITY_MPS2 * math.tan(look.response.max_tilt_rad)
    taken_mps2 = max(-_along_bar(look, look.estimate.held_mps2), 0.0)
    return min(look.limits.brake_mps2, max(_BRAKE_SHARE * (full_mps2 - taken_mps2), _LEAST_BRAKE_MPS2))


def _along_bar(look: Look, in_still: Vector | None) -> float:
    """The part towards the bar's plane of a vector of the axes that lie still; 0 where it is not known."""
    if in_still is None or look.estimate.bar_heading_rad is None:
        return 0.0
    return turned(*in_still, -look.estimate.bar_heading_rad)[0]


def room_to_bar_m(look: Look) -> float:
    """Where the aircraft would stop, ahead of the bar's plane; infinite where nothing stands in its way."""
    place_m, velocity_mps, limits, ship = look.place_m, look.velocity_mps, look.limits, look.ship
    if place_m is None or velocity_mps is None:
        return math.inf
    above = place_m[2] < ship.house_top_m - limits.least_to_bar_m
    if _passes_beside(place_m, velocity_mps, ship.half_house_m + limits.least_to_bar_m) or above:
        return math.inf
    # in the superstructure's lee less wind holds against it
    held_mps2 = _LEE * _along_bar(look, look.estimate.held_mps2)
    towards_mps2 = _along_bar(look, look.estimate.tilt_mps2) - held_mps2
    stop_m = stopping_distance_m(velocity_mps[0], towards_mps2, brake_mps2(look), limits.reaction_s)
    return -place_m[0] - stop_m


def _passes_beside(place_m: Place, velocity_mps: Place, half_m: float) -> bool:
    """Off the bar's axis by more than `half_m`, here and where the way crosses the bar's plane, on the same side."""
    ahead_m, towards_mps = -place_m[0], velocity_mps[0]
    there_m = place_m[1] + (velocity_mps[1] * ahead_m / towards_mps if min(ahead_m, towards_mps) > 0.0 else 0.0)
    return min(place_m[1], there_m) > half_m or max(place_m[1], there_m) < -half_m


def bar_ahead(look: Look) -> Finding | None:
    """It cannot stop ahead of the bar's plane any more, where bar and superstructure stand in its way."""
    room_m = room_to_bar_m(look)
    if room_m >= look.limits.least_to_bar_m:
        return None
    return Finding(Action.BRAKE, f"it would stop {max(room_m, 0.0):.2f} m ahead of the bar")


def off_the_deck(look: Look) -> Finding | None:
    """A landing whose contact, at the present speeds, would not be on the deck with every foot."""
    place_m, velocity_mps, over_m, ship = look.place_m, look.velocity_mps, look.over_deck_m, look.ship
    if not look.landing or place_m is None or velocity_mps is None or over_m is None:
        return None
    sink_mps = max(velocity_mps[2], _SLOWEST_MPS)
    contact_s = max(over_m, 0.0) / sink_mps
    if not look.limits.reaction_s <= contact_s <= _CONTACT_NEAR_S:  # nearer, nothing changes it any more
        return None
    drift_s = min(contact_s, _DRIFT_S)
    aside_m = max(abs(place_m[i] + drift_s * velocity_mps[i] - float(ship.deck_in_bar_m[i])) for i in range(2))
    if aside_m <= ship.half_deck_m - look.limits.foot_m:
        return None
    return Finding(Action.GO_AROUND, f"contact foreseen {aside_m:.2f} m from the deck's centre")


def tilted(look: Look) -> Finding | None:
    """A landing with more tilt than the deck bears, while there is time to break it off."""
    over_m, tilt_deg = look.over_deck_m, math.degrees(look.estimate.largest_tilt_rad)
    if not look.landing or over_m is None or over_m < look.limits.tilt_height_m or tilt_deg <= look.limits.tilt_deg:
        return None
    return Finding(Action.GO_AROUND, f"tilted by {tilt_deg:.0f}° over the deck, at most {look.limits.tilt_deg:g}")


def poses_leap(look: Look) -> Finding | None:
    """Poses that no way leads to: the picture is older than it says, or it is not the bar."""
    leap_m, place_m = look.estimate.leap_m, look.place_m
    if look.blind or leap_m <= 0.0:
        return None
    near = place_m is not None and -place_m[0] < max(look.limits.near_m, _ROOM_PER_LEAP * leap_m)
    return Finding(Action.GO_AROUND if near else Action.NO_GO, f"poses leap by {leap_m:.1f} m")


def gimbal_contradicts(look: Look) -> Finding | None:
    """Bar and gimbal say different verticals, time and again: one of the two lies, or the pictures are late."""
    times = len(look.estimate.contradicted_s)
    if times < _CONTRADICTIONS:
        return None
    words = f"gimbal and horizon disagree, in {times} pictures of the last seconds"
    return Finding(Action.NO_GO if look.landing else Action.GO_AROUND, words)


def blind_near(look: Look) -> Finding | None:
    """Near the ship, not landing, and no pose for a while: boxes do not tell a deck from its edge."""
    distance_m, blind_s = look.estimate.bar_distance_m(), look.t_s - look.estimate.pose_s
    if look.command.intent is not Intent.FLY or not distance_m < look.limits.near_m:
        return None
    known = blind_s < POSED_S or look.t_s - look.estimate.bar_box_s < look.limits.blind_s
    if not (known and look.blind and blind_s < math.inf):
        return None
    return Finding(Action.GO_AROUND, f"no pose for {blind_s:.1f} s, {distance_m:.1f} m from the bar")


def wind_too_strong(look: Look) -> Finding | None:
    """Holding against the wind takes more tilt than leaves a reserve, or than a deck bears at contact."""
    wind_mps2, limits = look.estimate.wind_mps2, look.limits
    if wind_mps2 is None or look.estimate.wind_s < limits.wind_time_s:
        return None
    taken_rad = tilt_of(wind_mps2)
    most_rad = min(limits.wind_share * look.response.max_tilt_rad, math.radians(limits.wind_tilt_deg))
    if taken_rad <= most_rad:
        return None
    words = f"the wind takes {math.degrees(taken_rad):.0f}° of tilt, at most {math.degrees(most_rad):.0f}"
    return Finding(Action.REFUSE, words)


def velocity_contradicts(look: Look) -> Finding | None:
    """The vehicle's own velocity and the poses part: a flow that lies, or pictures that are late."""
    leap_mps = look.estimate.velocity_bias_leap_mps()
    if look.blind or leap_mps <= look.limits.leap_mps:
        return None
    return Finding(Action.NO_GO, f"the vehicle's velocity and the poses differ by {leap_mps:.1f} m/s more than of late")


def height_contradicts(look: Look) -> Finding | None:
    """Barometer and poses part: a pose that lies in height, or a barometer that does."""
    leap_m = look.estimate.deck_leap_m
    if look.blind or abs(leap_m) <= look.limits.height_leap_m:
        return None
    return Finding(Action.NO_GO, f"barometer and poses differ by {abs(leap_m):.1f} m more than of late")


def scale_contradicts(look: Look) -> Finding | None:
    """Poses are longer or shorter than the vehicle's own way by a share that no wave explains."""
    scale, sigma = look.estimate.scale, look.estimate.scale_sigma
    if look.blind or abs(math.log(max(scale, _LEAST_SCALE))) - _SCALE_SIGMAS * sigma <= look.limits.scale_off:
        return None
    words = f"distances by the cue are {scale:.2f} of the vehicle's own way: is the cue as large, the camera as stated?"
    return Finding(Action.NO_GO, words)


def telemetry_old(look: Look) -> Finding | None:
    """Of what the vehicle gives, something is older than a landing may be flown with."""
    told = look.telemetry
    times_s = (
        ("attitude", told.attitude_t_s),
        ("velocity", told.velocity_t_s),
        ("height", told.height_t_s),
    )
    for name, t_s in times_s:  # a value that is too old to be used is None by now, its time is not
        if t_s is not None and look.t_s - t_s > look.limits.telemetry_s:
            return Finding(Action.NO_GO, f"{name} {look.t_s - t_s:.1f} s old")
    return None


def waved_off(look: Look) -> Finding | None:
    """The ship's status light is red: a landing is broken off at any height."""
    if not look.landing or look.t_s - look.estimate.waved_off_s > WAVE_OFF_S:
        return None
    return Finding(Action.GO_AROUND, "waved off by the ship's red light")


def vehicle_complains(look: Look) -> Finding | None:
    """The vehicle itself says that it is not well."""
    return Finding(Action.NO_GO, f"the vehicle says: {look.telemetry.alerts}") if look.telemetry.alerts else None


def answers_reversed(look: Look) -> Finding | None:
    """The vehicle answers a stick the other way round: whatever is flown with it is flown the wrong way."""
    if not look.reversed_stick:
        return None
    return Finding(Action.RELEASE, f"the vehicle answers the {look.reversed_stick} stick the other way round")


RULES: tuple[Rule, ...] = (
    bar_ahead,
    off_the_deck,
    tilted,
    poses_leap,
    gimbal_contradicts,
    blind_near,
    wind_too_strong,
    velocity_contradicts,
    height_contradicts,
    scale_contradicts,
    telemetry_old,
    waved_off,
    vehicle_complains,
    answers_reversed,
)
"""All of them; order says nothing."""


def findings(look: Look) -> list[Finding]:
    """What the rules find now, the gravest first."""
    found = [finding for rule in RULES if (finding := rule(look)) is not None]
    return sorted(found, key=lambda finding: -finding.action)


_ROOM_PER_LEAP = 4.0
"""Of room to the bar; nearer, poses that leap are not waited for: whichever of the two places is the true one."""
_CONTRADICTIONS = 3
"""Of bar and gimbal, within the seconds that the estimate remembers them; without a fault there is none."""
_LEE = 0.5
"""Of the wind, what still blows close behind the superstructure."""
_BRAKE_SHARE, _LEAST_BRAKE_MPS2 = 0.8, 0.3
"""Of the tilt that is left, what is counted on; and never nothing."""
_SCALE_SIGMAS, _LEAST_SCALE = 1.0, 0.01
"""How surely the scale must be off; the waves' share in it is stated widely."""
_SLOWEST_MPS = 0.3
"""Slower than this the time to contact says nothing."""
_CONTACT_NEAR_S, _DRIFT_S = 0.6, 0.3
"""A contact that is so near is looked at; for so long the aircraft goes on as it does, which is known to 1 m/s.
Farther ahead a straight line says nothing of where contact will be."""
