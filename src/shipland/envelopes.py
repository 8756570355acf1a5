"""Operating envelopes, flown: a campaign over winds over deck whose next cells follow from the flights before."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipland import factories
from shipland.api import checked_seed
from shipland.campaigns import CampaignProgress, fly_plan
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
    out: Path,
    *,
    first_seed: int = 1,
    workers: int | None = None,
    cluster: str = "",
    time_limit_s: float = 0.0,
    progress: bool | Callable[[CampaignProgress], None] = True,
    command: str = "",
) -> Envelopes:
    """Fly the grid, then, round after round, what its border wants; the other arguments are as of `campaign`.

    The folder keeps a round's flights for the next. A round's cells follow from the landings of the rounds before, seed
    by seed: stopped and resumed, it flies the same.

    Raises:
        ConfigError, DataError: as of `campaign`.
    """
    first_seed, begun_s, number = checked_seed(first_seed), time.monotonic(), 0
    places = [(wind_kn, float(direction)) for direction in grid.directions_deg for wind_kn in grid.winds_kn]
    cells = {base.name: {place: cell_at(base, *place) for place in places} for base in bases}
    planned = [cell for of_base in cells.values() for cell in of_base.values()]
    counts = {cell.name: grid.runs for cell in planned}
    while True:
        number += 1
        seeds = range(first_seed, first_seed + max(counts.values()))
        plan = CampaignPlan(planned, seeds, out, command=command, counts=counts)
        if progress is True and workers != 0:
            print(f"round {number}: {len(planned)} cells, {sum(counts.values())} flights", file=sys.stderr)
        left_s = max(1e-3, time_limit_s - (time.monotonic() - begun_s)) if time_limit_s else 0.0
        found = fly_plan(plan, workers, cluster, left_s, progress)
        # a folder may hold flights of later rounds
        counted = {
            it.name: [each for each in it.landings if each.seed in seeds[: counts[it.name]]] for it in found.cells
        }
        flown = {name: {place: counted[cell.name] for place, cell in cells[name].items()} for name in cells}
        wanted = [
            (base, (wind_kn, direction), count)
            for base in bases
            for direction, ray in _rays(flown[base.name]).items()
            for wind_kn, count in next_counts(grid, ray).items()
        ]
        if found.left or not wanted:
            begun = [base for base in bases if all(flown[base.name].values())]
            envelopes = tuple(_envelope(base, grid, flown[base.name]) for base in begun)
            return Envelopes(envelopes, found.cells, found.left)
        for base, place, count in wanted:
            if place not in cells[base.name]:
                cells[base.name][place] = cell_at(base, *place)
                planned.append(cells[base.name][place])
            counts[cells[base.name][place].name] = count


_Flown = Mapping[Place, Sequence[Landing]]
"""The landings of one envelope."""


def _rays(flown: _Flown) -> dict[float, dict[float, Tally]]:
    """By direction and speed; cells without a flight are left out."""
    rays: dict[float, dict[float, Tally]] = {}
    for (wind_kn, direction), landings in flown.items():
        if landings:
            rays.setdefault(direction, {})[wind_kn] = Tally.of(landings)
    return rays


def _envelope(base: Cell, grid: EnvelopeGrid, flown: _Flown) -> Envelope:
    under_way_mps, rows = ship_mps(base.scenario), []
    for (wind_kn, direction), landings in sorted(flown.items(), key=lambda item: item[0][::-1]):
        speed_mps, from_deg = true_wind(wind_kn, direction, under_way_mps)
        place = {"off_bow_deg": direction, "wind_kn": wind_kn}
        place |= {"true_wind_mps": round(speed_mps, 2), "true_wind_off_bow_deg": round(from_deg, 1)}
        rows.append(place | figures(base.scenario, landings, grid.rate))
    borders = {direction: border_kn(grid.rate, ray) for direction, ray in _rays(flown).items()}
    pilot, deck = factories.name_of(base.pilot), deck_statistics(base.scenario)
    return Envelope(base.name, base.scenario, pilot, under_way_mps, grid.rate, tuple(rows), borders, deck)
