"""One landing of a campaign, and tables of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shipland.messages import FlightRecord, Mode


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
        start_m: distance over ground from the deck's centre at the first frame.
        search_s, ship_s, bar_s, approach_s, land_s, blind_s, climb_out_s: time in each mode before contact.
        tries: landings broken off.
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
    start_m: float
    search_s: float
    ship_s: float
    bar_s: float
    approach_s: float
    land_s: float
    blind_s: float
    climb_out_s: float
    tries: int
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


@dataclass(frozen=True)
class Way:
    """How a flight went before contact: fields of `Landing` of the same names."""

    start_m: float
    search_s: float
    ship_s: float
    bar_s: float
    approach_s: float
    land_s: float
    blind_s: float
    climb_out_s: float
    tries: int


def way_of(records: Sequence[FlightRecord], end_s: float) -> Way:
    """From the flight's records (with truth) up to the time of contact or of the end [s]."""
    spent_s: dict[Mode | None, float] = dict.fromkeys((*Mode, None), 0.0)
    tries, start_m = 0, float("nan")
    for record, following in pairwise(records):
        if record.telemetry.t_s >= end_s:
            break
        mode, after = record.decision.mode, following.decision.mode
        spent_s[mode] += min(following.telemetry.t_s, end_s) - record.telemetry.t_s
        tries += after is Mode.CLIMB_OUT and mode is not Mode.CLIMB_OUT
    if records and (truth := records[0].truth) is not None:
        start_m = float(np.hypot(*truth.aircraft_in_deck_m[:2]))
    return Way(
        start_m=start_m,
        search_s=spent_s[Mode.SEARCH],
        ship_s=spent_s[Mode.TRACK_SHIP],
        bar_s=spent_s[Mode.TRACK_BAR],
        approach_s=spent_s[Mode.APPROACH],
        land_s=spent_s[Mode.LAND],
        blind_s=spent_s[Mode.NO_VISION],
        climb_out_s=spent_s[Mode.CLIMB_OUT],
        tries=tries,
    )


def no_landing(seed: int, end_s: float, start_s: float, way: Way, reason: str) -> Landing:
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
        **vars(way),
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


_WAY_NAMES = {
    "search_s": "searching",
    "ship_s": "4 track ship",
    "bar_s": "3 track bar",
    "approach_s": "2 approach",
    "land_s": "1 land",
    "blind_s": "5 no vision",
    "climb_out_s": "climb-out",
}


def modes_table(landings: list[Landing]) -> str:
    """Markdown: time in each mode, its share of all flight time, and how many flights were ever in it."""
    total_s = sum(getattr(landing, name) for landing in landings for name in _WAY_NAMES)
    lines = ["| mode | median [s] | longest [s] | share of all time | flights |", "|---|---:|---:|---:|---:|"]
    for name, words in _WAY_NAMES.items():
        times_s = np.array([getattr(landing, name) for landing in landings])
        share = times_s.sum() / total_s if total_s > 0.0 else 0.0
        lines.append(
            f"| {words} | {np.median(times_s):.1f} | {times_s.max():.1f} | {100.0 * share:.0f} % | "
            f"{int((times_s > 0.0).sum())} |"
        )
    broken_off = sum(landing.tries for landing in landings)
    flights = sum(landing.tries > 0 for landing in landings)
    return "\n".join([*lines, "", f"{broken_off} landings were broken off, in {flights} of {len(landings)} flights."])
