"""An operating envelope: landing rates over the wind over deck, flights where its border is, and a rating of each cell.

Wind over deck: the air's motion against a ship on a steady course, at `wind.reference_height_m` over the surface; speed
in knots, direction that it comes from clockwise off the bow. On each direction the border lies between a speed at which
the wanted share lands and the next at which it does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from shipland.errors import ConfigError
from shipland.evaluation.landing import Landing
from shipland.evaluation.suite import Cell
from shipland.evaluation.tables import causes_in_words
from shipland.evaluation.tally import Tally
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.scenario.seeds import generators_of
from shipland.sim.ship.ship import build_ship
from shipland.sim.touchdown import VerdictParameters

KNOT_MPS = 0.514444
NATOPS_ROLL_DEG, NATOPS_PITCH_DEG = 8.0, 3.0
"""Of an FFG-7's deck for landing: NAVAIR, Helicopter operating procedures for air-capable ships NATOPS manual (2003),
as quoted by [Lee2022]."""
SET_BY_THE_GRID = ("wind.mean_mps", "wind.from_deg", "wind.mean_half_range_mps", "wind.from_half_range_deg")
RATINGS = {
    1: "all land, and nine touchdowns in ten use at most half of every limit",
    2: "as many land as wanted, none badly, and nine touchdowns in ten use at most three quarters of every limit",
    3: "as many land as wanted: the last that an envelope takes in",
    4: "fewer land than wanted; fewer than one flight in ten strikes something or breaks a limit",
    5: "one flight in ten or more strikes something or breaks a limit",
}
"""In the manner of DIPES, the Deck Interface Pilot Effort Scale, whose 1 to 3 are acceptable and 4 and 5 are not; of
measured margins, as nobody's effort is rated."""
_STATISTICS_S, _STEP_S = 1800.0, 0.2


@dataclass(frozen=True)
class EnvelopeGrid:
    """What is flown, and where more.

    Attributes:
        winds_kn, directions_deg: wind over deck to begin with, speeds increasing; it comes from there, off the bow.
        rate: share of flights that must land.
        runs, most: flights of a cell to begin with, and on the border.
        finest_kn: speeds on either side of the border are halved until they are this near.
    """

    winds_kn: tuple[float, ...] = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
    directions_deg: tuple[float, ...] = tuple(range(0, 360, 30))
    rate: float = 0.9
    runs: int = 10
    most: int = 40
    finest_kn: float = 2.5

    def __post_init__(self) -> None:
        turns = {round(direction % 360.0, 3) for direction in self.directions_deg}
        for good, words in (
            (self.winds_kn and all(a < b for a, b in pairwise((0.0, *self.winds_kn))),
             f"wind over deck speeds must be positive and increase, got {self.winds_kn}"),
            (0.0 < self.rate < 1.0, f"the rate must be between 0 and 1, got {self.rate:g}"),
            (1 <= self.runs <= self.most, f"expected runs of 1 or more, and most no fewer: {self.runs}, {self.most}"),
            (self.finest_kn > 0.0, f"the finest step must be positive, got {self.finest_kn:g} kn"),
            (turns and len(turns) == len(self.directions_deg), "directions must differ, and one there must be"),
        ):  # fmt: skip
            if not good:
                raise ConfigError(words)


@dataclass(frozen=True)
class Envelope:
    """One ship, aircraft and pilot.

    Attributes:
        name: scenario, settings and pilot in a word.
        scenario: what was flown, but for the wind.
        rate: share of flights that must land.
        rows: a row a cell: `wind_kn`, `off_bow_deg`, `true_wind_mps`, `true_wind_off_bow_deg`, and of `figures`.
        borders: of each direction [deg] the speed [kn], and `less than` or `more than`.
        deck: as `deck_statistics` gives them.
    """

    name: str
    scenario: Scenario
    pilot: str
    ship_mps: float
    rate: float
    rows: tuple[dict[str, Any], ...]
    borders: Mapping[float, tuple[float, str]]
    deck: Mapping[str, float]


def next_counts(grid: EnvelopeGrid, ray: Mapping[float, Tally]) -> dict[float, int]:
    """Which speeds [kn] of one direction want how many flights in all, after what was flown; empty at the end.

    Two neighbours on either side of the border get a cell between them until they are near enough, then each of them
    whose interval holds the rate gets twice its flights.
    """
    wanted: dict[float, int] = {}
    for low_kn, high_kn in pairwise(sorted(ray)):
        if ray[low_kn].within(grid.rate) == ray[high_kn].within(grid.rate):
            continue
        if high_kn - low_kn > grid.finest_kn:
            wanted[round(0.5 * (low_kn + high_kn), 3)] = grid.runs
            continue
        for wind_kn in (low_kn, high_kn):
            if ray[wind_kn].undecided(grid.rate) and ray[wind_kn].flights < grid.most:
                wanted[wind_kn] = min(2 * ray[wind_kn].flights, grid.most)
    return wanted


def border_kn(rate: float, ray: Mapping[float, Tally]) -> tuple[float, str]:
    """Speed [kn] at which the share of landings first falls below the rate, and `less than` or `more than` it."""
    speeds = sorted(ray)
    if not ray[speeds[0]].within(rate):
        return speeds[0], "less than"
    for low_kn, high_kn in pairwise(speeds):
        if not ray[high_kn].within(rate):
            inside, outside = (ray[wind_kn].share for wind_kn in (low_kn, high_kn))
            return low_kn + (high_kn - low_kn) * (inside - rate) / (inside - outside), ""
    return speeds[-1], "more than"


def ship_mps(scenario: Scenario) -> float:
    """The ship's speed; ConfigError when its course is not steady."""
    course = scenario.ship.course
    if course.kind not in ("still", "straight"):
        raise ConfigError(f"ship.course.kind = {course.kind}: wind over deck wants a steady course, still or straight")
    return course.speed_mps if course.kind == "straight" else 0.0


def true_wind(wind_kn: float, off_bow_deg: float, under_way_mps: float) -> tuple[float, float]:
    """Speed [m/s] and direction that it comes from [deg, off the bow] of the wind that a ship under way meets as this.

    >>> [round(value, 2) for value in true_wind(20.0, 0.0, 5.0)]
    [5.29, 0.0]
    >>> [round(value, 2) for value in true_wind(10.0, 180.0, 5.0)]
    [10.14, 180.0]
    """
    over_mps, angle_rad = wind_kn * KNOT_MPS, math.radians(off_bow_deg)
    ahead_mps, starboard_mps = over_mps * math.cos(angle_rad) - under_way_mps, over_mps * math.sin(angle_rad)
    return math.hypot(ahead_mps, starboard_mps), math.degrees(math.atan2(starboard_mps, ahead_mps)) % 360.0


def cell_at(base: Cell, wind_kn: float, off_bow_deg: float) -> Cell:
    """A cell with this wind over deck, without what the scenario draws of speed and direction."""
    speed_mps, from_deg = true_wind(wind_kn, off_bow_deg, ship_mps(base.scenario))
    from_deg = (from_deg + base.scenario.ship.course.course_deg) % 360.0
    texts = {"wind.mean_mps": f"{speed_mps:.2f}", "wind.from_deg": f"{from_deg:.1f}"}
    values = dict.fromkeys(SET_BY_THE_GRID, 0.0) | {key: float(text) for key, text in texts.items()}
    scenario = load_scenario(base.scenario.table(), **values)
    return Cell(scenario, (*base.settings, *texts.items()), base.pilot, base.vision)


def under_way(base: Cell, speed_kn: float) -> Cell:
    """A cell with a ship that goes this fast, straight ahead; at full scale its motions are of that speed too."""
    changes = {"ship.course.speed_mps": f"{speed_kn * KNOT_MPS:.2f}"}
    if base.scenario.ship.motion == "sea" and base.scenario.ship.scale.length == 1.0:
        changes["ship.sea.speed_kn"] = f"{speed_kn:g}"
    values = {key: float(text) for key, text in changes.items()}
    scenario = load_scenario(base.scenario.table(), **{"ship.course.kind": "straight", **values})
    return Cell(scenario, (*base.settings, *changes.items()), base.pilot, base.vision)


def limit_use(landing: Landing, limits: VerdictParameters) -> float:
    """The largest share of a limit that a touchdown used: of sink, drift, tilt and slip."""
    return max(
        landing.sink_mps / limits.max_descent_mps,
        landing.slide_mps / limits.max_drift_mps,
        landing.tilt_deg / limits.max_tilt_deg,
        landing.slip_m / limits.max_slip_m,
    )


def rating_of(landings: Sequence[Landing], limits: VerdictParameters, rate: float) -> int:
    """1 to 5: see `RATINGS`; by the shares as measured, not by their intervals."""
    bad, tally = sum(it.bad for it in landings), Tally.of(landings)
    if 10 * bad >= len(landings):
        return 5
    if not tally.within(rate):
        return 4
    used = float(np.quantile([limit_use(it, limits) for it in landings if it.touched], 0.9))
    if tally.landed == tally.flights and used <= 0.5:
        return 1
    return 2 if not bad and used <= 0.75 else 3


def figures(scenario: Scenario, landings: Sequence[Landing], rate: float) -> dict[str, Any]:
    """A row of an envelope's table; medians and 90 % quantiles are of the flights that touched the deck."""
    tally, touched, limits = Tally.of(landings), [it for it in landings if it.touched], scenario.verdict
    low, high = tally.interval
    row: dict[str, Any] = {
        "flights": tally.flights,
        "success": {"value": tally.share, "low": low, "high": high},
        "rating": rating_of(landings, limits, rate),
        "landed": tally.landed,
        "outside": sum(it.landed and not it.in_square for it in landings),
        "bad": sum(it.bad for it in landings),
        "refused": sum(it.refused for it in landings),
        "wave_offs": sum(it.phases.tries for it in landings),
    }
    for name in ("sink_mps", "slide_mps", "tilt_deg"):
        values = [getattr(it, name) for it in touched]
        row |= {name: _quantile(values, 0.5), f"{name}_90": _quantile(values, 0.9)}
    turns = [(abs(it.deck_roll_deg), abs(it.deck_pitch_deg)) for it in touched]
    return row | {
        "limit_use_90": _quantile([limit_use(it, limits) for it in touched], 0.9),
        "deck_roll_deg": max((roll for roll, _ in turns), default=None),
        "deck_pitch_deg": max((pitch for _, pitch in turns), default=None),
        "beyond_natops": sum(roll > NATOPS_ROLL_DEG or pitch > NATOPS_PITCH_DEG for roll, pitch in turns),
        "causes": causes_in_words(landings),
    }


def _quantile(values: Sequence[float], share: float) -> float | None:
    return float(np.quantile(values, share)) if values else None


def deck_statistics(scenario: Scenario) -> dict[str, float]:
    """Significant single amplitudes of the deck's roll, pitch and vertical speed, over half an hour."""
    motion = build_ship(scenario.ship, scenario.rig, generators_of(1).ship).deck_motion
    states = [motion.at(float(t_s)) for t_s in np.arange(0.0, _STATISTICS_S, _STEP_S)]
    roll, pitch = (2.0 * math.degrees(np.std([it.displacement[axis] for it in states])) for axis in (3, 4))
    vertical_mps = 2.0 * float(np.std([it.velocity[2] for it in states]))
    return {"roll_deg": roll, "pitch_deg": pitch, "vertical_mps": vertical_mps}
