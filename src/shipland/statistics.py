"""Intervals and paired comparisons of landings. Every interval is 95 %.

SciPy's statistics are imported late: they take a second, which a worker that only flies need not wait for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

CONFIDENCE = 0.95
_RESAMPLES = 2000
"""Of a bootstrap."""
_MOST_DRAWN = 1 << 20
"""Values that a bootstrap draws at a time."""


class Interval(NamedTuple):
    """A confidence interval."""

    low: float
    high: float


class Pairing(NamedTuple):
    """Two pilots on the same seeds.

    Attributes:
        flights: seeds that both flew.
        only_first, only_second: seeds on which one succeeded and the other did not.
        p_value: of McNemar's exact test: how likely so uneven a split is if both are equally good.
        error_difference_m: median error of the first less that of the second, over seeds on which both touched down.
        error_interval_m: of that difference, from a paired bootstrap; NaN with fewer than two such seeds.
    """

    flights: int
    only_first: int
    only_second: int
    p_value: float
    error_difference_m: float
    error_interval_m: Interval


def share_interval(count: int, of: int, method: Literal["exact", "wilson"] = "exact") -> Interval:
    """Interval of a share, for independent flights: Clopper and Pearson's (`exact`) or Wilson's."""
    from scipy.stats import binomtest

    if of == 0:
        return Interval(0.0, 1.0)
    found = binomtest(count, of).proportion_ci(CONFIDENCE, method)
    return Interval(float(found.low), float(found.high))


def mean_interval(values: Sequence[float]) -> Interval:
    """Student's interval of a mean of independent values within 0…1; no wider than 0…1."""
    from scipy.stats import sem, t

    mean, error = float(np.mean(values)), float(sem(values))
    half = error * float(t.ppf(0.5 + 0.5 * CONFIDENCE, len(values) - 1))
    return Interval(max(mean - half, 0.0), min(mean + half, 1.0))


def quantile_interval(values: npt.NDArray[np.float64], share: float, rng: np.random.Generator) -> Interval:
    """Interval of a quantile of independent values, from a bootstrap; NaN with fewer than two of them."""
    if len(values) < 2:
        return Interval(float("nan"), float("nan"))
    return _middle(np.concatenate([np.quantile(values[drawn], share, axis=1) for drawn in _drawn(len(values), rng)]))


def _drawn(count: int, rng: np.random.Generator) -> Iterator[npt.NDArray[np.int64]]:
    """Numbers of a bootstrap's values, a row a resample; a few rows at a time, as many as memory is well spent on."""
    rows = max(1, _MOST_DRAWN // count)
    for first in range(0, _RESAMPLES, rows):
        yield rng.integers(0, count, (min(rows, _RESAMPLES - first), count))


def _middle(found: npt.NDArray[np.float64]) -> Interval:
    """What the middle 95 % of a bootstrap's results lie in."""
    low, high = np.quantile(found, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return Interval(float(low), float(high))


def compare(
    first_ok: npt.NDArray[np.bool_],
    second_ok: npt.NDArray[np.bool_],
    first_error_m: npt.NDArray[np.float64],
    second_error_m: npt.NDArray[np.float64],
    rng: np.random.Generator,
) -> Pairing:
    """Compare two pilots seed by seed.

    Args:
        first_ok: (n,) which seeds the first landed in the square.
        second_ok: the same of the second.
        first_error_m: (n,) the first's distances from the deck's centre; NaN without touchdown.
        second_error_m: the same of the second.
        rng: draws the bootstrap.
    """
    from scipy.stats import binomtest

    only_first = int(np.sum(first_ok & ~second_ok))
    only_second = int(np.sum(second_ok & ~first_ok))
    split = only_first + only_second
    p_value = float(binomtest(only_first, split).pvalue) if split else 1.0
    both = np.isfinite(first_error_m) & np.isfinite(second_error_m)
    one, two = first_error_m[both], second_error_m[both]
    difference_m, interval_m = float("nan"), Interval(float("nan"), float("nan"))
    if len(one) > 0:
        difference_m = float(np.median(one) - np.median(two))
    if len(one) > 1:
        rows = _drawn(len(one), rng)
        differences_m = [np.median(one[drawn], axis=1) - np.median(two[drawn], axis=1) for drawn in rows]
        interval_m = _middle(np.concatenate(differences_m))
    return Pairing(len(first_ok), only_first, only_second, p_value, difference_m, interval_m)
