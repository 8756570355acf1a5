"""One landing of a campaign, and tables of many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Landing:
    """One landing of a campaign.

    Attributes:
        seed: of the flight.
        landed, in_square: the verdict.
        forward_m, starboard_m: touchdown point in `deck`.
        sink_mps: vertical speed against the deck just before contact, down positive.
        slide_mps: horizontal speed against the deck just before contact.
        tilt_deg: largest tilt against the deck after contact.
        slip_m: way over the deck until rest.
        force_n: largest contact force.
        time_s: first contact, from the start of the flight; the end of the flight where there was none.
        reason: the verdict in words.
    """

    seed: int
    landed: bool
    in_square: bool
    forward_m: float
    starboard_m: float
    sink_mps: float
    slide_mps: float
    tilt_deg: float
    slip_m: float
    force_n: float
    time_s: float
    reason: str

    @property
    def error_m(self) -> float:
        """Distance of the touchdown point from the deck's centre."""
        return float(np.hypot(self.forward_m, self.starboard_m))


def table_of(landings: list[Landing]) -> str:
    """Markdown table, a row a seed, with a last line that sums up."""
    lines = [
        "| seed | error [m] | forward [m] | starboard [m] | sink [m/s] | slide [m/s] | slip [m] | tilt [°] | time [s] "
        "| verdict |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for landing in sorted(landings, key=lambda landing: landing.seed):
        numbers = (
            landing.error_m,
            landing.forward_m,
            landing.starboard_m,
            landing.sink_mps,
            landing.slide_mps,
            landing.slip_m,
        )
        cells = " | ".join(f"{number:.3f}" for number in numbers)
        lines.append(f"| {landing.seed} | {cells} | {landing.tilt_deg:.1f} | {landing.time_s:.1f} | {landing.reason} |")
    return "\n".join([*lines, "", summary_of(landings)])


def summary_of(landings: list[Landing]) -> str:
    """How many landed in the square, with the 95 % Clopper–Pearson interval, and the medians."""
    from scipy.stats import beta

    n, k = len(landings), sum(landing.in_square and landing.landed for landing in landings)
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    touched = [landing for landing in landings if np.isfinite(landing.forward_m)]
    line = f"{k} of {n} landed in the square (95 % interval {100 * low:.1f}–{100 * high:.1f} %)"
    if not touched:
        return line + "."
    errors = [landing.error_m for landing in touched]
    sinks = [landing.sink_mps for landing in touched]
    times = [landing.time_s for landing in touched]
    return (
        f"{line}; touchdown error median {np.median(errors):.3f} m, largest {max(errors):.3f} m; sink speed median "
        f"{np.median(sinks):.2f} m/s, largest {max(sinks):.2f} m/s; time to land median {np.median(times):.1f} s."
    )
