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
        instant_s: the same on the time axis of the deck's motion.
        place_forward_m, place_starboard_m: the aircraft in `ship` at the last frame before contact.
        deck_forward_m, deck_starboard_m: the deck's centre in `ship` then.
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
    instant_s: float
    place_forward_m: float
    place_starboard_m: float
    deck_forward_m: float
    deck_starboard_m: float
    reason: str

    @property
    def error_m(self) -> float:
        """Distance of the touchdown point from the deck's centre."""
        return float(np.hypot(self.forward_m, self.starboard_m))

    @property
    def cause(self) -> str:
        """Why it is no landing in the square, in words; empty where it is one."""
        if self.landed and self.in_square:
            return ""
        if not np.isfinite(self.forward_m):
            return self.reason
        aircraft_m = max(abs(self.place_forward_m), abs(self.place_starboard_m))
        deck_m = max(abs(self.deck_forward_m), abs(self.deck_starboard_m))
        who = "the deck had moved from under it" if aircraft_m <= HALF_SQUARE_M else "the aircraft was off its place"
        return f"{self.reason}: {who} (aircraft {100 * aircraft_m:.0f} cm, deck {100 * deck_m:.0f} cm off neutral)"


def no_landing(seed: int, end_s: float, start_s: float, reason: str) -> Landing:
    """A flight that ended at `end_s` without touchdown; every figure of a touchdown is NaN."""
    nan = float("nan")
    return Landing(
        seed=seed,
        landed=False,
        in_square=False,
        forward_m=nan,
        starboard_m=nan,
        sink_mps=nan,
        slide_mps=nan,
        tilt_deg=nan,
        slip_m=nan,
        force_n=nan,
        time_s=end_s,
        instant_s=end_s + start_s,
        place_forward_m=nan,
        place_starboard_m=nan,
        deck_forward_m=nan,
        deck_starboard_m=nan,
        reason=reason,
    )


HALF_SQUARE_M = 0.175
"""Half the landing square's side [Lee2022, §Tracking Capability and Landing Accuracy]."""


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
        words = landing.cause or landing.reason
        lines.append(f"| {landing.seed} | {cells} | {landing.tilt_deg:.1f} | {landing.time_s:.1f} | {words} |")
    return "\n".join([*lines, "", summary_of(landings)])


def failures_table(landings: list[Landing]) -> str:
    """Markdown: every landing that is none, with its cause; empty where all are."""
    failed = [landing for landing in sorted(landings, key=lambda landing: landing.seed) if landing.cause]
    if not failed:
        return ""
    return "\n".join(["| seed | cause |", "|---:|---|", *(f"| {it.seed} | {it.cause} |" for it in failed)])


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
