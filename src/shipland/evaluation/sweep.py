"""Every combination of several values, and two tables of landings seed by seed."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence

import numpy as np

from shipland.config import setting
from shipland.errors import ConfigError
from shipland.evaluation.landing import Landing
from shipland.evaluation.statistics import share_interval
from shipland.evaluation.tables import interval_text, pair_up


def combinations(changes: Sequence[str]) -> list[tuple[tuple[str, str], ...]]:
    """Every combination of the values in `changes`, as (key, value) pairs, the last key varying fastest.

    Raises:
        ConfigError: a text is no setting.
    """
    options = [[(key, text_of(value)) for value in values] for key, values in map(setting, changes)]
    return list(itertools.product(*options))


def text_of(value: object) -> str:
    """A TOML value as `--set` takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(json.dumps(item) if isinstance(item, str) else text_of(item) for item in value)}]"
    if isinstance(value, str) and setting(f"key={value}")[1] != [value]:
        return json.dumps(value)  # quotes that keep it one string
    return str(value)


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
