"""Tables of many landings, as Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from shipland.errors import ConfigError
from shipland.evaluation.landing import Landing
from shipland.evaluation.tally import Tally
from shipland.statistics import Pairing, compare

_PHASE_NAMES = {
    "search_s": "searching",
    "ship_s": "4 track ship",
    "bar_s": "3 track bar",
    "approach_s": "2 approach",
    "land_s": "1 land",
    "blind_s": "5 no vision",
    "go_around_s": "go-around",
}


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]], left: Collection[str] | None = None) -> str:
    """A table; the columns `left`, the first one unless they are named, stand to the left, the others to the right."""
    rules = ("---" if name in (head[:1] if left is None else left) else "---:" for name in head)
    first, *others = (f"| {' | '.join(map(str, cells))} |" for cells in (head, *rows))
    return "\n".join([first, f"|{'|'.join(rules)}|", *others])


def landings_table(landings: Sequence[Landing], area: str) -> str:
    """A row a seed, with a last paragraph that sums up; `area` as in `summary_of`."""
    head = ("seed", "error [m]", "forward [m]", "starboard [m]", "control error [m]", "deck off [m]", "oracle lands",
            "sink [m/s]", "slide [m/s]", "slip [m]", "tilt [°]", "time [s]", "verdict")  # fmt: skip
    rows = []
    for it in sorted(landings, key=lambda landing: landing.seed):
        own_m = np.hypot(it.control_forward_m, it.control_starboard_m)
        deck_m = np.hypot(it.deck_forward_m, it.deck_starboard_m)
        oracle = {True: "yes", False: "no", None: ""}[it.oracle_in_square]
        places = [f"{value:.3f}" for value in (it.error_m, it.forward_m, it.starboard_m, own_m, deck_m)]
        touch = [f"{value:.3f}" for value in (it.sink_mps, it.slide_mps, it.slip_m)]
        words = it.reason if it.cause in ("", it.reason) else f"{it.reason}; {it.cause}"
        rows.append([it.seed, *places, oracle, *touch, f"{it.tilt_deg:.1f}", f"{it.time_s:.1f}", words])
    table = markdown(head, rows, left=("oracle lands", "verdict"))
    return f"{table}\n\n{summary_of(landings, area)}".replace("nan", "")


def summary_of(landings: Sequence[Landing], area: str) -> str:
    """How many landed in the area, `square` or `circle`, how many an oracle would have, and the medians."""
    tally = Tally.of(landings)
    touched = [landing for landing in landings if landing.touched]
    interval = f"95 % interval {tally.interval_text()}, Clopper and Pearson; {assumption(landings)}"
    line = f"{tally.landed} of {tally.flights} landed in the {area} ({interval})"
    if not touched:
        return line + "."
    oracle = sum(bool(landing.oracle_in_square) for landing in touched)
    errors = [landing.error_m for landing in touched]
    own = [np.hypot(landing.control_forward_m, landing.control_starboard_m) for landing in touched]
    sinks = [landing.sink_mps for landing in touched]
    times = [landing.time_s for landing in touched]
    return (
        f"{line}; at {oracle} of the {len(touched)} instants of contact an oracle would have landed in it; "
        f"touchdown error median {np.median(errors):.3f} m, largest {max(errors):.3f} m, control error median "
        f"{np.median(own):.3f} m; sink speed median {np.median(sinks):.2f} m/s, largest {max(sinks):.2f} m/s; time to "
        f"land median {np.median(times):.1f} s."
    )


def assumption(landings: Sequence[Landing]) -> str:
    """The assumption behind the interval."""
    if len({landing.conditions.motion_seed for landing in landings}) == len(landings):
        return "flights independent: each with its own motion, wind and start"
    return "flights share one record of motion: the interval holds for that record only, another may differ by more"


def causes_table(landings: Sequence[Landing]) -> str:
    """Why flights did not land in the landing area, most frequent first; empty where all did."""
    causes = Counter(landing.cause for landing in landings if not landing.success)
    if not causes:
        return ""
    return markdown(("cause", "flights"), causes.most_common())


def causes_in_words(landings: Sequence[Landing]) -> str:
    """How often each cause was told, the most frequent first."""
    causes = Counter(landing.cause for landing in landings if landing.cause)
    return ", ".join(f"{count} {cause}" for cause, count in causes.most_common())


def modes_table(landings: Sequence[Landing]) -> str:
    """Time in each mode, its share of all flight time, and how many flights were ever in it."""
    total_s = sum(getattr(landing.phases, name) for landing in landings for name in _PHASE_NAMES)
    rows = []
    for name, words in _PHASE_NAMES.items():
        times_s = np.array([getattr(landing.phases, name) for landing in landings])
        share = times_s.sum() / total_s if total_s > 0.0 else 0.0
        longest, flights = f"{times_s.max():.1f}", int((times_s > 0.0).sum())
        rows.append((words, f"{np.median(times_s):.1f}", longest, f"{100.0 * share:.0f} %", flights))
    broken_off = sum(landing.phases.tries for landing in landings)
    flights = sum(landing.phases.tries > 0 for landing in landings)
    table = markdown(("mode", "median [s]", "longest [s]", "share of all time", "flights"), rows)
    return f"{table}\n\n{broken_off} landings were broken off, in {flights} of {len(landings)} flights."


def by_seed(landings: Sequence[Landing]) -> dict[int, Landing]:
    """One of each seed."""
    return {landing.seed: landing for landing in landings}


def pair_up(first: Mapping[Any, Landing], second: Mapping[Any, Landing], rng: np.random.Generator) -> Pairing:
    """Compare two pilots on the flights that both flew, of one seed or of one cell and seed."""
    pairs = [(first[key], second[key]) for key in sorted(first.keys() & second.keys())]
    ok = np.array([[it.success for it in pair] for pair in pairs], bool).reshape(-1, 2)
    errors_m = np.array([[it.error_m for it in pair] for pair in pairs], float).reshape(-1, 2)
    return compare(ok[:, 0], ok[:, 1], errors_m[:, 0], errors_m[:, 1], rng)


def median(values: Sequence[float], digits: int) -> str:
    """Of the finite values, as text; a dash without any."""
    return quantile(values, 0.5, digits)


def quantile(values: Sequence[float], share: float, digits: int) -> str:
    """Likewise, below which a share of them lies."""
    finite = [value for value in values if np.isfinite(value)]
    return f"{np.quantile(finite, share):.{digits}f}" if finite else "–"


def comparison(first: Sequence[Landing], second: Sequence[Landing], names: tuple[str, str]) -> str:
    """Two campaigns seed by seed, in words; the seeds that only one of them flew are left out.

    ConfigError where they have none in common.
    """
    one, two = by_seed(first), by_seed(second)
    common = one.keys() & two.keys()
    if not common:
        raise ConfigError(f"{names[0]} and {names[1]} have no seed in common; a paired comparison needs the same seeds")
    found = pair_up(one, two, np.random.default_rng(0))
    lines = [f"{found.flights} seeds flown by both:"]
    for name, landings in zip(names, (first, second), strict=True):
        mine = [landing for landing in landings if landing.seed in common]
        tally = Tally.of(mine)
        share = f"{tally.landed} landed in the landing area (95 % interval {tally.interval_text()})"
        lines.append(f"  {name}: {share}, median error {median([landing.error_m for landing in mine], 3)} m")
    lines.append(f"landed there by {names[0]} alone: {found.only_first}, by {names[1]} alone: {found.only_second}")
    lines.append(f"McNemar's exact test: p = {found.p_value:.3g}")
    if np.isfinite(found.error_difference_m):
        low, high = found.error_interval_m
        lines.append(
            f"median error of {names[0]} less that of {names[1]}: {found.error_difference_m:+.3f} m "
            f"(95 % interval {low:+.3f} to {high:+.3f} m, paired bootstrap)"
        )
    return "\n".join(lines)
