"""One landing of a campaign: what came of it, why, how the flight went, and the conditions that it met."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from shipland.evaluation.oracle import take_apart
from shipland.evaluation.recovery import recoveries
from shipland.frames import euler_from_rotation, wrap_angle
from shipland.messages import FlightRecord, Intent, Mode, TouchdownVerdict
from shipland.scenario.autonomy import drawn_ship, drawn_wind_of
from shipland.scenario.faults import Fault, faults_of
from shipland.scenario.fly import Flown
from shipland.scenario.scenario import Scenario
from shipland.sim.ship.ship import SAME_MOTION_SEED, Ship
from shipland.sim.touchdown import broken_limit

NAN = float("nan")
_DIGITS = 4
"""Decimals that a row keeps: a tenth of a millimetre or of a millisecond."""


@dataclass(frozen=True)
class Phases:
    """How a flight went before contact.

    Attributes:
        search_s, ship_s, bar_s, approach_s, land_s, blind_s, go_around_s: time in each mode.
        tries: landings broken off.
    """

    search_s: float
    ship_s: float
    bar_s: float
    approach_s: float
    land_s: float
    blind_s: float
    go_around_s: float
    tries: int


@dataclass(frozen=True)
class Conditions:
    """The conditions drawn for a flight.

    Attributes:
        wind_mps: mean wind speed, `wind.mean_mps`.
        wind_from_deg: compass direction that it comes from.
        wind_off_bow_deg: the same clockwise from the bow at the start, within ±180.
        surface: land or sea.
        start_distance_m: over ground from the deck's neutral centre, at the first frame.
        start_bearing_deg: off the axis straight astern then, positive to starboard.
        start_height_m: above the neutral deck then.
        start_heading_error_deg: of the nose off the deck's neutral centre then, clockwise positive.
        course: kind of the ship's course.
        ship_mps: speed of a ship under way; 0 of one that lies still.
        motion: what moves the deck.
        full_ship: superstructure and bar move with it.
        sea_state: of a ship in waves, else None.
        waves_from_deg: clockwise from the bow, of a ship in waves, else None.
        motion_seed: flights with the same number met the same record of motion.
        motion_start_s: how far into that record the flight began.
        video_s, uplink_s: latencies.
        processing: which processing times were flown.
        max_tilt_deg: at full stick.
        loop: kind of the aircraft's inner loop.
        telemetry: profile of the link.
        visibility_m: of the scene's air; met by pictures only.
        faults: kinds and times of what was made to fail, in words; empty where nothing was.
        wind_10m_mps: the wind's mean at 10 m over the surface, as meteorologists say it.
        wind_gust_mps: its strongest three seconds within ten minutes, at the height of the hover.
    """

    wind_mps: float
    wind_from_deg: float
    wind_off_bow_deg: float
    surface: str
    start_distance_m: float
    start_bearing_deg: float
    start_height_m: float
    start_heading_error_deg: float
    course: str
    ship_mps: float
    motion: str
    full_ship: bool
    sea_state: int | None
    waves_from_deg: float | None
    motion_seed: int
    motion_start_s: float
    video_s: float
    uplink_s: float
    processing: str
    max_tilt_deg: float
    loop: str
    telemetry: str
    visibility_m: float
    faults: str
    wind_10m_mps: float = NAN
    wind_gust_mps: float = NAN


@dataclass(frozen=True)
class Landing:
    """One landing of a campaign. Without contact with the deck every figure of the touchdown is NaN or None.

    Attributes:
        seed: of the flight.
        landed: came to rest on its feet on the deck, within every limit.
        in_square: the touchdown point lies in the landing square, or circle.
        success: both.
        cause: why it is no landing in the square, in a few words that count together; empty where it is one.
        time_s: first contact, from the start of the flight; the end of the flight where there was none.
        forward_m, starboard_m: touchdown point in `deck`.
        control_forward_m, control_starboard_m: the aircraft at contact from the bar-defined point, in `bar`.
        deck_forward_m, deck_starboard_m: the deck's centre at contact from the same point, in `bar`.
        oracle_forward_m, oracle_starboard_m: where an aircraft without control error would have touched, in `deck`.
        oracle_in_square: that lies in the landing square.
        sink_mps: vertical speed against the deck just before contact, down positive.
        slide_mps: horizontal speed against the deck just before contact.
        tilt_deg: largest tilt against the deck after contact.
        slip_m: distance slid over the deck between contact and rest.
        force_n: largest contact force.
        rest_forward_m, rest_starboard_m: where it came to rest, or ended, in `deck`.
        deck_roll_deg, deck_pitch_deg, deck_heave_m: the deck's motion at contact; heave down positive.
        deck_sink_mps: rate of its heave then, down positive.
        step_percent: largest step of a stick from one command to the next.
        over_slew_percent: the most that such a step was beyond the slew bound.
        recovery_s: longest time from the first clear sight of the bar after a fault until the pilot's place was true
            again; infinite where it never was; None where no fault can be judged so.
        landing_probability: by the pilot, as the final descent began; None from a pilot that does not tell it.
        error_m: distance of the touchdown point from the deck's centre.
        reason: the verdict in words.
        phases: how the flight went before.
        conditions: those drawn for it.
    """

    seed: int
    landed: bool
    in_square: bool
    success: bool = field(init=False)
    cause: str
    time_s: float
    phases: Phases
    conditions: Conditions
    reason: str
    forward_m: float = NAN
    starboard_m: float = NAN
    control_forward_m: float = NAN
    control_starboard_m: float = NAN
    deck_forward_m: float = NAN
    deck_starboard_m: float = NAN
    oracle_forward_m: float = NAN
    oracle_starboard_m: float = NAN
    oracle_in_square: bool | None = None
    sink_mps: float = NAN
    slide_mps: float = NAN
    tilt_deg: float = NAN
    slip_m: float = NAN
    force_n: float = NAN
    rest_forward_m: float = NAN
    rest_starboard_m: float = NAN
    deck_roll_deg: float = NAN
    deck_pitch_deg: float = NAN
    deck_heave_m: float = NAN
    deck_sink_mps: float = NAN
    step_percent: float = NAN
    over_slew_percent: float = NAN
    recovery_s: float | None = None
    landing_probability: float | None = None
    error_m: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "success", self.landed and self.in_square)
        object.__setattr__(self, "error_m", round(math.hypot(self.forward_m, self.starboard_m), _DIGITS))

    @property
    def touched(self) -> bool:
        """There was contact with the deck."""
        return math.isfinite(self.forward_m)

    @property
    def refused(self) -> bool:
        """It never touched the deck, and nothing else."""
        return self.reason.startswith("no touchdown")

    @property
    def bad(self) -> bool:
        """It struck something but the deck, or touched the deck beyond a limit."""
        return not self.landed and not self.refused

    @property
    def instant_s(self) -> float:
        """Time of contact on the time axis of the deck's motion."""
        return self.time_s + self.conditions.motion_start_s


def landing_of(scenario: Scenario, seed: int, flown: Flown, records: Sequence[FlightRecord]) -> Landing:
    """The result of the flight of `seed`, from its end and its records (with truth)."""
    ship, verdict = drawn_ship(scenario, seed), flown.verdict
    time_s = flown.result.t_s if verdict is None else verdict.t_s
    phases, conditions = phases_of(records, time_s), conditions_of(scenario, seed, ship, records)
    recovery_s = _recovery_s(records, faults_of(scenario, seed))
    step_percent, over_percent = largest_steps(records, scenario.safety.slew_percent_per_s)
    flight = partial(
        Landing,
        seed=seed,
        time_s=time_s,
        phases=phases,
        conditions=conditions,
        step_percent=step_percent,
        over_slew_percent=over_percent,
        recovery_s=recovery_s,
    )
    if verdict is None or not verdict.touched:
        cause = _never_down(records) if verdict is None else flown.reason
        return rounded(flight(landed=False, in_square=False, cause=cause, reason=flown.reason))
    state = ship.at(verdict.t_s)
    parts = take_apart(state, scenario.aircraft.airframe, verdict.touchdown_in_deck_m)
    u, v, w = verdict.relative_velocity_in_deck_mps.tolist()
    return rounded(
        flight(
            landed=verdict.landed,
            in_square=verdict.in_square,
            cause=_cause(scenario, verdict, parts.oracle_in_square, parts.control_in_square),
            reason=verdict.reason,
            forward_m=float(verdict.touchdown_in_deck_m[0]),
            starboard_m=float(verdict.touchdown_in_deck_m[1]),
            control_forward_m=float(parts.control_error_in_bar_m[0]),
            control_starboard_m=float(parts.control_error_in_bar_m[1]),
            deck_forward_m=float(parts.deck_in_bar_m[0]),
            deck_starboard_m=float(parts.deck_in_bar_m[1]),
            oracle_forward_m=float(parts.oracle_in_deck_m[0]),
            oracle_starboard_m=float(parts.oracle_in_deck_m[1]),
            oracle_in_square=parts.oracle_in_square,
            sink_mps=w,
            slide_mps=math.hypot(u, v),
            tilt_deg=math.degrees(verdict.tilt_rad),
            slip_m=verdict.slip_m,
            force_n=verdict.peak_contact_force_n,
            rest_forward_m=float(verdict.rest_in_deck_m[0]),
            rest_starboard_m=float(verdict.rest_in_deck_m[1]),
            deck_roll_deg=math.degrees(float(state.deck.displacement[3])),
            deck_pitch_deg=math.degrees(float(state.deck.displacement[4])),
            deck_heave_m=float(state.deck.displacement[2]),
            deck_sink_mps=float(state.deck.velocity[2]),
            landing_probability=_landing_probability(records, time_s),
        )
    )


OWN, DECK = "control error", "deck displaced"
EITHER, BOTH = "control error or deck, each alone", "control error and deck together"


def _cause(scenario: Scenario, verdict: TouchdownVerdict, oracle_in_square: bool, control_in_square: bool) -> str:
    """Of a flight with contact, by counterfactual: what if the aircraft had not erred; what if the deck had rested."""
    if verdict.success:
        return ""
    if not verdict.landed:
        limit = broken_limit(scenario.verdict, verdict.relative_velocity_in_deck_mps, verdict.tilt_rad, verdict.slip_m)
        return limit.kind if limit is not None and limit.words == verdict.reason else verdict.reason
    if oracle_in_square:
        return BOTH if control_in_square else OWN
    return DECK if control_in_square else EITHER


def _never_down(records: Sequence[FlightRecord]) -> str:
    """Of a flight that ended in the air: how far it got, by what was flown and seen; a pilot need not have modes."""
    half = 0.5 * len(records)
    if sum("pilot failed: " in record.decision.reason for record in records) > half:
        return "pilot failed"
    if sum("vision failed: " in record.observation.reason for record in records) > half:
        return "vision failed"
    intents = {record.decision.command.intent for record in records}
    if Intent.GO_AROUND in intents:
        return "landings broken off"
    if Intent.LAND in intents:
        return "not down in time"
    seen = [record.observation for record in records]
    if any(it.bar_pose is not None or it.deck is not None for it in seen):
        return "never steady over the deck"
    found = any(it.bar_box is not None or it.ship_box is not None for it in seen)
    return "never near the bar" if found else "never found the ship"


def phases_of(records: Sequence[FlightRecord], end_s: float) -> Phases:
    """From the flight's records up to the time of contact or of the end [s]."""
    spent_s: dict[Mode | None, float] = dict.fromkeys(Mode, 0.0) | {None: 0.0}
    tries = 0
    for record, following in pairwise(records):
        if record.telemetry.t_s >= end_s:
            break
        mode, after = record.decision.mode, following.decision.mode
        spent_s[mode] += min(following.telemetry.t_s, end_s) - record.telemetry.t_s
        tries += after is Mode.GO_AROUND and mode is not Mode.GO_AROUND
    return Phases(
        search_s=spent_s[Mode.SEARCH],
        ship_s=spent_s[Mode.TRACK_SHIP],
        bar_s=spent_s[Mode.TRACK_BAR],
        approach_s=spent_s[Mode.APPROACH],
        land_s=spent_s[Mode.LAND],
        blind_s=spent_s[Mode.NO_VISION],
        go_around_s=spent_s[Mode.GO_AROUND],
        tries=tries,
    )


def _landing_probability(records: Sequence[FlightRecord], contact_s: float) -> float | None:
    """What the pilot said last before contact: it keeps to it once the final descent has begun."""
    before = (record for record in reversed(records) if record.telemetry.t_s < contact_s)
    return next((record.decision.landing_probability for record in before), None)


def _fault_words(fault: Fault) -> str:
    return f"{fault.kind.value} {fault.start_s:.2f}+{fault.duration_s:.2f} s {fault.amount:.3g}"


def _recovery_s(records: Sequence[FlightRecord], faults: Sequence[Fault]) -> float | None:
    if not faults or all(record.decision.estimate is None for record in records):
        return None
    return max(recoveries(records, faults), default=None)


def largest_steps(records: Sequence[FlightRecord], slew_percent_per_s: float) -> tuple[float, float]:
    """Of any stick between two commands [percent]: the largest step, and the most beyond the bound on its rate."""
    if len(records) < 2:
        return 0.0, 0.0
    commands = [record.decision.command for record in records]
    sticks = np.array([[it.pitch_percent, it.roll_percent, it.heave_percent, it.yaw_percent] for it in commands])
    steps = np.max(np.abs(np.diff(sticks, axis=0)), axis=1)
    allowed = slew_percent_per_s * np.diff([command.t_s for command in commands])
    return float(np.max(steps)), max(0.0, float(np.max(steps - allowed)))


def conditions_of(scenario: Scenario, seed: int, ship: Ship, records: Sequence[FlightRecord]) -> Conditions:
    """The conditions drawn for the flight of `seed`; its start is taken from its first record."""
    wind, in_waves = drawn_wind_of(scenario, seed), scenario.ship.motion == "sea"
    start = ship.at(0.0).course
    readings = wind.readings_at(scenario.rig.deck_height_m + scenario.guidance.approach.hover_height_m)
    distance_m = bearing_deg = height_m = error_deg = NAN
    if records and (truth := records[0].truth) is not None:
        ship_from_body = truth.ned_from_ship.inverse() @ truth.ned_from_body
        x, y, z = ship_from_body.translation_m.tolist()
        yaw_rad = euler_from_rotation(ship_from_body.rotation)[2]
        distance_m, height_m = math.hypot(x, y), -z
        bearing_deg = math.degrees(math.atan2(y, -x))
        error_deg = math.degrees(wrap_angle(yaw_rad - math.atan2(-y, -x)))
    return Conditions(
        wind_mps=wind.mean_mps,
        wind_10m_mps=readings.mean_10m_mps,
        wind_gust_mps=readings.gust_mps,
        wind_from_deg=wind.from_deg % 360.0,
        wind_off_bow_deg=math.degrees(wrap_angle(math.radians(wind.from_deg) - start.course_rad)),
        surface=wind.surface,
        start_distance_m=distance_m,
        start_bearing_deg=bearing_deg,
        start_height_m=height_m,
        start_heading_error_deg=error_deg,
        course=scenario.ship.course.kind,
        ship_mps=float(np.hypot(*start.velocity_in_ned_mps)),
        motion=scenario.ship.motion,
        full_ship=scenario.ship.full_ship,
        sea_state=scenario.ship.sea.sea_state if in_waves else None,
        waves_from_deg=scenario.ship.sea.waves_from_deg if in_waves else None,
        motion_seed=SAME_MOTION_SEED if scenario.ship.same_motion else seed,
        motion_start_s=ship.start_s,
        video_s=scenario.delays.video_s,
        uplink_s=scenario.delays.uplink_s,
        processing=scenario.delays.processing,
        max_tilt_deg=scenario.aircraft.settings.max_tilt_deg,
        loop=scenario.aircraft.loop.kind,
        telemetry=scenario.delays.telemetry.profile,
        visibility_m=scenario.scene.visibility_m,
        faults="; ".join(_fault_words(fault) for fault in faults_of(scenario, seed)),
    )


Part = TypeVar("Part", Landing, Phases, Conditions)


def rounded(landing: Landing) -> Landing:
    """With every float at the digits that a row keeps, so that a landing read back is the landing written."""
    phases, conditions = _rounded(landing.phases), _rounded(landing.conditions)
    return dataclasses.replace(_rounded(landing), phases=phases, conditions=conditions)


def _rounded(values: Part) -> Part:
    names = [each.name for each in dataclasses.fields(values) if each.init]
    floats = {name: value for name in names if isinstance(value := getattr(values, name), float)}
    changes: dict[str, Any] = {name: round(value, _DIGITS) for name, value in floats.items()}
    return dataclasses.replace(values, **changes)


_PARSERS: dict[str, Callable[[str], Any]] = {
    "bool": {"True": True, "False": False}.__getitem__,
    "int": int,
    "float": lambda text: float(text or NAN),
    "str": str,
}


def row_of(landing: Landing) -> dict[str, Any]:
    """One flat row: the landing, its phases and its conditions; None is an empty text."""
    row: dict[str, Any] = {}
    for each in dataclasses.fields(landing):
        value = getattr(landing, each.name)
        row |= vars(value) if dataclasses.is_dataclass(value) else {each.name: value}
    return {name: "" if value is None else value for name, value in row.items()}


def as_text(row: dict[str, Any]) -> dict[str, Any]:
    """A row as a table in a file has it: a number that there is not is empty, as every reader of CSV takes it."""
    return {name: "" if value != value else value for name, value in row.items()}


def column_of(name: str, values: Sequence[Any]) -> npt.NDArray[Any]:
    """Values (n,) of one column of rows, with the column's type; one of no landing, a setting's, by its values.

    Args:
        name: of the column.
        values: of rows; an empty text is none.
    """
    kind = _KINDS.get(name) or _kind_of(values)
    if kind not in ("int", "float", "bool"):
        return np.array(values)
    missing = "" in values
    if kind == "bool":
        return np.array([None if value == "" else value for value in values], dtype=object if missing else bool)
    if kind == "int" and not missing:
        whole = [value if isinstance(value, int) else int(float(value)) for value in values]
        return np.array(whole, dtype=None if whole else int)  # a seed may be larger than 64 bits hold
    return np.array([NAN if value == "" else float(value) for value in values])


def _kind_of(values: Sequence[Any]) -> str:
    try:
        numbers = [float(value) for value in values if value != ""]
    except ValueError:
        return "str"
    return "str" if not numbers else "int" if all(number.is_integer() for number in numbers) else "float"


def landing_from(row: dict[str, str]) -> Landing:
    """A landing from the texts of a row, which may lack columns that have a default.

    Raises:
        KeyError, TypeError, ValueError: it is none.
    """
    phases, conditions = Phases(**_parsed(Phases, row)), Conditions(**_parsed(Conditions, row))
    return Landing(**_parsed(Landing, row), phases=phases, conditions=conditions)


def _parsed(cls: type, row: dict[str, str]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for each in dataclasses.fields(cls):
        kind, _, optional = str(each.type).partition(" | ")
        if each.init and kind in _PARSERS and (each.name in row or each.default is dataclasses.MISSING):
            text = row[each.name]
            values[each.name] = None if optional and text == "" else _PARSERS[kind](text)
    return values


_KINDS = {
    one.name: str(one.type).partition(" | ")[0]
    for part in (Landing, Phases, Conditions)
    for one in dataclasses.fields(part)
}
"""Type of each column of a landing."""
COLUMNS = [
    name
    for each in dataclasses.fields(Landing)
    for name in {
        "phases": [one.name for one in dataclasses.fields(Phases)],
        "conditions": [one.name for one in dataclasses.fields(Conditions)],
    }.get(each.name, [each.name])
]
"""Of a row, in order."""
