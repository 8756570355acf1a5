"""Tables of a campaign, as Markdown: a line a cell with interval and oracle rate, pairs of pilots, published rules."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import numpy as np

from shipland.config import build
from shipland.errors import ConfigError, ShiplandError
from shipland.evaluation.campaign import CellResult
from shipland.evaluation.landing import Landing
from shipland.evaluation.oracle import OracleRate, oracle_rate
from shipland.evaluation.tables import by_seed, causes_in_words, markdown, median, pair_up
from shipland.evaluation.tally import Tally
from shipland.files import json_bytes, json_of, read_text, write_atomically
from shipland.rig import Rig, area_of
from shipland.statistics import Pairing, quantile_interval


def rules(rig: Rig, area: str = "") -> dict[str, Callable[[Landing], bool]]:
    """By name, which calls the rig's landing area by its size unless as `area`.

    A comparison with NaN is false, so a flight without contact is no landing by any rule.
    """
    deck_m, area = rig.deck_size_m, area or f"{rig.landing_square_m:g} m {rig.landing_area}"

    def within(landing: Landing, side_m: float) -> bool:
        return max(abs(landing.forward_m), abs(landing.starboard_m)) <= 0.5 * side_m

    return {
        f"ours: at rest on its feet in the {area}, within every limit": lambda it: it.success,
        f"first contact in the {area}": lambda it: rig.in_landing_area(it.forward_m, it.starboard_m),
        "first contact within 0.2 m of the centre": lambda it: it.error_m <= 0.2,
        "first contact within 0.5 m of the centre": lambda it: it.error_m <= 0.5,
        "under 1 m horizontally, tilt under 10°, sink under 1.5 m/s": lambda it: (
            it.error_m < 1.0 and it.tilt_deg < 10.0 and it.sink_mps < 1.5
        ),
        "any first contact on the deck": lambda it: within(it, deck_m),
    }


def rules_table(landings: Sequence[Landing], rig: Rig) -> str:
    """Markdown: how many of the landings each rule counts."""
    counted = ((name, f"{sum(map(rule, landings))} of {len(landings)}") for name, rule in rules(rig).items())
    return markdown(("rule", "landings"), counted)


def swept_keys(cells: Sequence[CellResult]) -> list[str]:
    """Keys that do not have one value in all cells, in order of appearance."""
    keys = dict.fromkeys(key for cell in cells for key, _ in cell.settings)
    return [key for key in keys if len({dict(cell.settings).get(key) for cell in cells}) > 1]


def rests_in_area(landing: Landing, rig: Rig) -> bool:
    """Whether it came to rest on its feet with its centre in the landing area."""
    return landing.landed and rig.in_landing_area(landing.rest_forward_m, landing.rest_starboard_m)


def leaderboard(cells: Sequence[CellResult], oracle_rates: dict[str, OracleRate]) -> str:
    """Markdown, a line a cell; the oracle rates, by group, may lack some or all."""
    keys = swept_keys(cells)
    area, rng, rows = area_of(cell.rig for cell in cells), np.random.default_rng(1), []
    texts = ["scenario", *(key.split(".")[-1] for key in keys), "pilot", "wind, at 10 m, gust [m/s]"]
    numbers = [
        "flights", f"landed in the {area}", "95 % interval", "oracle rate", f"rest in the {area}", "landed",
        "oracle at its instants", "error median [cm]", "error 90 % [cm]", "control error median [cm]",
        "sink median [m/s]", "time median [s]",
    ]  # fmt: skip
    for cell in cells:
        landings, touched = cell.landings, [it for it in cell.landings if it.touched]
        if not landings:
            continue
        tally = Tally.of(landings)
        errors_cm = 100.0 * np.array([it.error_m for it in touched])
        own_cm = 100.0 * np.array([np.hypot(it.control_forward_m, it.control_starboard_m) for it in touched])
        rows.append(
            [
                cell.scenario,
                *(dict(cell.settings).get(key, "") for key in keys),
                cell.pilot,
                _wind(landings),
                tally.flights,
                tally.share_text(),
                tally.interval_text(),
                f"{100.0 * oracle_rates[cell.group].share:.1f} %" if cell.group in oracle_rates else "",
                sum(rests_in_area(it, cell.rig) for it in landings),
                sum(it.landed for it in landings),
                f"{sum(bool(it.oracle_in_square) for it in touched)} of {len(touched)}",
                _quantile(errors_cm, 0.5, rng),
                _quantile(errors_cm, 0.9, rng),
                _quantile(own_cm, 0.5, rng),
                median([it.sink_mps for it in touched], 2),
                median([it.time_s for it in touched], 0),
                causes_in_words(landings),
            ]
        )
    table = markdown([*texts, *numbers, "causes"], rows, left=[*texts, "causes"])
    fixed = {pair for cell in cells for pair in cell.settings if pair[0] not in keys}
    settings = ", ".join(f"`{key}={value}`" for key, value in sorted(fixed))
    everywhere = f"All cells: {settings}.\n\n" if fixed else ""
    return (
        f"{table}\n\n{everywhere}"
        "Wind: the mean that was set, the same wind's mean at 10 m over the surface, and its strongest three seconds "
        f"in ten minutes, medians. Landed: at rest on its feet, within every limit; landed in the {area}: and first "
        f"contact in the {area}; rest in the {area}: landed, and at rest in the {area}, wherever it touched. Interval: "
        "Clopper and Pearson; takes flights for independent, each with its own motion, wind and start. Oracle: an "
        "aircraft without control error; oracle rate: over all instants of other motions. Ranges behind medians and "
        "quantiles: 95 %, bootstrap."
    )


def _wind(landings: Sequence[Landing]) -> str:
    met = [it.conditions for it in landings]
    readings = zip(*((it.wind_mps, it.wind_10m_mps, it.wind_gust_mps) for it in met), strict=True)
    return ", ".join(
        f"{np.median(values):.1f}" for values in readings if np.isfinite(values).all()
    )  # older rows lack some


def _quantile(values: np.ndarray[tuple[int], np.dtype[np.float64]], share: float, rng: np.random.Generator) -> str:
    if not len(values):
        return "–"
    low, high = quantile_interval(values, share, rng)
    return f"{np.quantile(values, share):.1f} ({low:.1f}–{high:.1f})" if len(values) > 1 else f"{values[0]:.1f}"


Pairings = dict[tuple[str, ...], Pairing]
"""Paired tests by what stands before them in a table's row."""


def pilot_pairings(cells: Sequence[CellResult]) -> Pairings:
    """Every two pilots of one group on the same seeds."""
    return {
        (first.group, f"{first.pilot}, {second.pilot}"): _paired(first, second)
        for first, second in itertools.combinations(cells, 2)
        if first.group == second.group
    }


def campaign_pairings(first: Sequence[CellResult], second: Sequence[CellResult]) -> Pairings:
    """The cells of both campaigns seed by seed, of one pilot each whoever that is; ConfigError where there are none."""
    one_pilot_each = all(len({cell.pilot for cell in cells}) == 1 for cells in (first, second))
    ours, theirs = ({cell.group if one_pilot_each else cell.name: cell for cell in cells} for cells in (first, second))
    common = [name for name in ours if name in theirs]
    if not common:
        raise ConfigError("the two campaigns have no cell in common")
    found: Pairings = {}
    for name in common:
        one, two = ours[name], theirs[name]
        label = one.name if one.name == two.name else f"{one.group}: {one.pilot}, {two.pilot}"
        found[(label,)] = _paired(one, two)
    return found


def _paired(first: CellResult, second: CellResult) -> Pairing:
    return pair_up(by_seed(first.landings), by_seed(second.landings), np.random.default_rng(1))


def pairings_table(found: Pairings) -> str:
    """Markdown, a line a pairing."""
    names = ("cell",) if found and len(next(iter(found))) == 1 else ("scenario and settings", "pilots")
    counts = ("seeds", "only the first", "only the second", "McNemar p")
    rows = []
    for labels, it in found.items():
        difference = "–"
        if np.isfinite(it.error_difference_m):
            low, high = (100.0 * value for value in it.error_interval_m)
            difference = f"{100.0 * it.error_difference_m:.1f} ({low:.1f} … {high:.1f})".replace("nan", "–")
        rows.append([*labels, it.flights, it.only_first, it.only_second, f"{it.p_value:.2g}", difference])
    return markdown([*names, *counts, "error median, first less second [cm]"], rows, left=names)


def rivals(cells: Sequence[CellResult]) -> str:
    """Markdown: how many of each cell's flights every published rule counts."""
    texts, rows = ("scenario and settings", "pilot"), []
    area = "" if len({(cell.rig.landing_square_m, cell.rig.landing_area) for cell in cells}) == 1 else "landing area"
    for cell in cells:
        counts = [sum(map(rule, cell.landings)) for rule in rules(cell.rig).values()]
        rows.append([cell.group, cell.pilot, len(cell.landings), *counts])
    return markdown([*texts, "flights", *rules(cells[0].rig, area)], rows, left=texts)


def oracle_rates_of(cells: Sequence[CellResult], motions: int, cache: Path | None = None) -> dict[str, OracleRate]:
    """The oracle rate of each group over so many motions, of 0 none; kept in a JSON file where one is named."""
    kept = _kept(cache) if motions and cache is not None else {}
    found: dict[str, OracleRate] = {}
    for cell in cells if motions else ():
        ship, rig, airframe = cell.ship, cell.rig, cell.airframe
        key = hashlib.sha256(repr((ship, rig, airframe, motions)).encode()).hexdigest()[:16]
        if key not in kept:
            kept[key] = oracle_rate(ship, rig, airframe, motions, np.random.default_rng(1))
            if cache is not None:
                write_atomically(cache, json_bytes({key: asdict(rate) for key, rate in kept.items()}))
        found[cell.group] = kept[key]
    return found


def _kept(cache: Path) -> dict[str, OracleRate]:
    """Those of a cache; none of one that is missing or damaged."""
    with suppress(ShiplandError, ValueError, AttributeError):
        return {key: build(OracleRate, row, key) for key, row in json_of(read_text(cache)).items()}
    return {}
