"""Operating envelopes, flown: a campaign over winds over deck whose next cells follow from the flights before."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipland import factories
from shipland.campaigns import fly_plan
from shipland.errors import ConfigError
from shipland.evaluation.campaign import CampaignPlan, CellResult
from shipland.evaluation.envelope import (
    SET_BY_THE_GRID,
    Envelope,
    EnvelopeGrid,
    border_kn,
    cell_at,
    deck_statistics,
    figures,
    next_counts,
    ship_mps,
    true_wind,
    under_way,
)
from shipland.evaluation.landing import Landing
from shipland.evaluation.progress import CampaignProgress
from shipland.evaluation.suite import Cell, Overrides, SuiteEntry, cells_of
from shipland.evaluation.tally import Tally

Place = tuple[float, float]
"""Wind over deck: speed [kn], direction that it comes from [deg off the bow]."""


@dataclass(frozen=True)
class Envelopes:
    """Several of one command.

    Attributes:
        envelopes: those of which every cell to begin with has a flight.
        cells: all that was flown, with its landings.
        left: flights of the last round that are missing.
    """

    envelopes: tuple[Envelope, ...]
    cells: tuple[CellResult, ...]
    left: int


def bases_of(entry: SuiteEntry, asked: Overrides, ship_kn: Sequence[float] = ()) -> list[Cell]:
    """What envelopes are flown of: every combination of scenarios, settings, ship's speeds and pilots.

    Raises:
        ConfigError: as `cells_of`; or a setting is the grid's, or a course is not steady.
    """
    for text in asked.changes:
        if (key := text.partition("=")[0].strip()) in SET_BY_THE_GRID:
            raise ConfigError(f"--set {key}: an envelope sets the wind itself, by the speed and direction over deck")
    cells = cells_of((entry,), asked)
    found = [under_way(cell, speed_kn) for cell in cells for speed_kn in ship_kn] if ship_kn else cells
    for cell in found:
        ship_mps(cell.scenario)
    return found


def fly_envelopes(
    bases: Sequence[Cell],
    grid: EnvelopeGrid,
    *,
    first_seed: int = 1,
    workers: int | None = None,
    cluster: str = "",
    out: Path | None = None,
    time_limit_s: float = 0.0,
    progress: bool | Callable[[CampaignProgress], None] = True,
    command: str = "",
) -> Envelopes:
    """Fly the grid, then, round after round, what its border wants; the other arguments are as of `campaign`.

    A round's cells follow from the landings of the rounds before, seed by seed: stopped and resumed, it flies the same.

    Raises:
        ConfigError, DataError: as of `campaign`.
    """
    begun_s, number = time.monotonic(), 0
    flown = {(base.name, place): cell_at(base, *place) for base in bases for place in _places(grid)}
    counts = dict.fromkeys(flown, grid.runs)
    while True:
        number += 1
        seeds = range(first_seed, first_seed + max(counts.values()))
        by_name = {flown[key].name: count for key, count in counts.items()}
        plan = CampaignPlan(list(flown.values()), seeds, out, command=command, counts=by_name)
        if progress is True and workers != 0:
            print(f"round {number}: {len(flown)} cells, {sum(counts.values())} flights", file=sys.stderr)
        left_s = max(1e-3, time_limit_s - (time.monotonic() - begun_s)) if time_limit_s else 0.0
        found = fly_plan(plan, workers, cluster, left_s, progress)
        results = {cell.name: cell for cell in found.cells}
        landings = {key: _first(results[cell.name], seeds[: counts[key]]) for key, cell in flown.items()}
        wanted = {} if found.left else _wanted(grid, landings)
        if not wanted:
            envelopes = [_envelope(base, grid, landings) for base in bases if _begun(base, landings)]
            return Envelopes(tuple(envelopes), found.cells, found.left)
        by_base = {base.name: base for base in bases}
        flown |= {(name, place): cell_at(by_base[name], *place) for name, place in wanted}
        counts |= wanted


def _places(grid: EnvelopeGrid) -> list[Place]:
    return [(wind_kn, float(direction)) for direction in grid.directions_deg for wind_kn in grid.winds_kn]


def _first(cell: CellResult, seeds: Sequence[int]) -> list[Landing]:
    """Without what a folder holds of later rounds."""
    return [landing for landing in cell.landings if landing.seed in seeds]


_Landings = Mapping[tuple[str, Place], Sequence[Landing]]


def _rays(name: str, landings: _Landings) -> dict[float, dict[float, Tally]]:
    """Of one envelope, by direction and speed; cells without a flight are left out."""
    rays: dict[float, dict[float, Tally]] = {}
    for (of, (wind_kn, direction)), flown in landings.items():
        if of == name and flown:
            rays.setdefault(direction, {})[wind_kn] = Tally.of(flown)
    return rays


def _wanted(grid: EnvelopeGrid, landings: _Landings) -> dict[tuple[str, Place], int]:
    return {
        (name, (wind_kn, direction)): count
        for name in dict.fromkeys(name for name, _ in landings)
        for direction, ray in _rays(name, landings).items()
        for wind_kn, count in next_counts(grid, ray).items()
    }


def _begun(base: Cell, landings: _Landings) -> bool:
    return all(flown for (name, _), flown in landings.items() if name == base.name)


def _envelope(base: Cell, grid: EnvelopeGrid, landings: _Landings) -> Envelope:
    under_way_mps, rows = ship_mps(base.scenario), []
    for (name, (wind_kn, direction)), flown in sorted(landings.items(), key=lambda item: item[0][1][::-1]):
        if name == base.name:
            speed_mps, from_deg = true_wind(wind_kn, direction, under_way_mps)
            place = {"off_bow_deg": direction, "wind_kn": wind_kn}
            place |= {"true_wind_mps": round(speed_mps, 2), "true_wind_off_bow_deg": round(from_deg, 1)}
            rows.append(place | figures(base.scenario, flown, grid.rate))
    borders = {direction: border_kn(grid.rate, ray) for direction, ray in _rays(base.name, landings).items()}
    pilot, deck = factories.name_of(base.pilot), deck_statistics(base.scenario)
    return Envelope(base.name, base.scenario, pilot, under_way_mps, grid.rate, tuple(rows), borders, deck)
