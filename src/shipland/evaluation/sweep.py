"""Campaigns side by side: every combination of the values and pilots asked for, with the same seeds."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipland.config import setting
from shipland.errors import ConfigError
from shipland.evaluation.landing import Landing
from shipland.evaluation.statistics import share_interval
from shipland.evaluation.tables import interval_text, pair_up


@dataclass(frozen=True)
class Cell:
    """One campaign of a sweep.

    Attributes:
        pilot: who flies.
        changes: `section.key=value`, each with one value, as `scenario_table` takes them.
        swept: those of them that have other values in other cells, key and value.
    """

    pilot: str
    changes: tuple[str, ...]
    swept: tuple[tuple[str, str], ...]

    @property
    def name(self) -> str:
        """The cell in words; also its folder's name."""
        words = "-".join([self.pilot, *(f"{key}={value}" for key, value in self.swept)])
        return re.sub(r"[^\w.=+-]+", "_", words)


def cells(changes: Sequence[str], pilots: Sequence[str]) -> list[Cell]:
    """Every combination of the several values in `changes` and the pilots, the last key varying fastest.

    Raises:
        ConfigError: a text is no setting, or a pilot comes twice.
    """
    if len(set(pilots)) < len(pilots) or not all(pilots):
        raise ConfigError(f"--pilot {','.join(pilots)}: expected different names, separated by commas")
    options = [[(key, text_of(value)) for value in values] for key, values in map(setting, changes)]
    swept = {choices[0][0] for choices in options if len(choices) > 1}
    return [
        Cell(pilot, tuple(f"{key}={value}" for key, value in chosen), tuple(it for it in chosen if it[0] in swept))
        for pilot in pilots
        for chosen in itertools.product(*options)
    ]


def text_of(value: object) -> str:
    """A TOML value as `--set` takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(json.dumps(item) if isinstance(item, str) else text_of(item) for item in value)}]"
    if isinstance(value, str) and setting(f"key={value}")[1] != [value]:
        return json.dumps(value)  # quotes that keep it one string
    return str(value)


def sweep_table(done: Sequence[tuple[Cell, Sequence[Landing]]], area: str) -> str:
    """Markdown: a row a cell; `area` in a word, as `rig.area_of` says it."""
    keys = [key for key, _ in done[0][0].swept]
    head = [
        "pilot",
        *keys,
        f"in the {area}",
        "95 % interval",
        "median error [m]",
        "median sink [m/s]",
        "median time [s]",
    ]
    lines = [f"| {' | '.join(head)} |", f"|{'|'.join(['---'] * (1 + len(keys)) + ['---:'] * 5)}|"]
    for cell, landings in done:
        good = sum(landing.good for landing in landings)
        low, high = share_interval(good, len(landings))
        figures = [
            median([landing.error_m for landing in landings], 3),
            median([landing.sink_mps for landing in landings], 2),
            median([landing.time_s for landing in landings], 1),
        ]
        share = [f"{good} of {len(landings)}", f"{100.0 * low:.1f}–{100.0 * high:.1f} %"]
        lines.append(f"| {' | '.join([cell.pilot, *(value for _, value in cell.swept), *share, *figures])} |")
    return "\n".join(lines)


def median(values: Sequence[float], digits: int) -> str:
    """Of the finite values, as text; a dash without any."""
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.median(finite):.{digits}f}" if finite else "–"


def comparison(first: Sequence[Landing], second: Sequence[Landing], names: tuple[str, str], seed: int = 0) -> str:
    """Two campaigns seed by seed, in words; the seeds that only one of them flew are left out.

    Raises:
        ConfigError: they have no seed in common.
    """
    common = {landing.seed for landing in first} & {landing.seed for landing in second}
    if not common:
        raise ConfigError(f"{names[0]} and {names[1]} have no seed in common; a paired comparison needs the same seeds")
    found = pair_up(first, second, np.random.default_rng(seed))
    lines = [f"{found.flights} seeds flown by both:"]
    for name, landings in zip(names, (first, second), strict=True):
        mine = [landing for landing in landings if landing.seed in common]
        good = sum(landing.good for landing in mine)
        share = f"{good} in the landing area ({interval_text(*share_interval(good, len(mine)))})"
        lines.append(f"  {name}: {share}, median error {median([landing.error_m for landing in mine], 3)} m")
    lines.append(f"only {names[0]} landed: {found.only_first}; only {names[1]}: {found.only_second}")
    lines.append(f"McNemar's exact test: p = {found.p_value:.3g}")
    if np.isfinite(found.error_difference_m):
        low, high = found.error_interval_m
        lines.append(
            f"median error of {names[0]} less that of {names[1]}: {found.error_difference_m:+.3f} m "
            f"(95 % interval {low:+.3f} to {high:+.3f} m, paired bootstrap)"
        )
    return "\n".join(lines)
