"""How far a campaign is, and its words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from shipland.evaluation.campaign import LostFlight
from shipland.evaluation.tally import Tally

_MOST_LOST = 10
"""Lost flights that are named."""


@dataclass(frozen=True)
class CampaignProgress:
    """How far a campaign is; comes before the first flight and after each.

    Attributes:
        cells: lines of its table.
        flights: all of them, with those flown earlier.
        to_fly: flights that were missing at the start.
        flown: of these.
        success: of those flown, landed in the landing area.
        lost: flights without a landing, and why.
        area: what the landing area is called.
    """

    cells: int
    flights: int
    to_fly: int
    flown: int
    success: int
    lost: Sequence[LostFlight]
    area: str


def begun(now: CampaignProgress) -> str:
    """What there is to fly."""
    return f"{now.cells} cell{'s' * (now.cells > 1)}, {now.to_fly} of {now.flights} flights to fly"


def underway(now: CampaignProgress) -> str:
    """How many landed so far."""
    interval = Tally(now.flown, now.success).interval_text(0)
    return f"{now.success} of {now.flown} landed in the {now.area} ({interval})"


def ended(now: CampaignProgress, spent_s: float, resumes: bool) -> Iterator[str]:
    """How many were flown, and the flights that were lost, a line each."""
    again = "; run it again to resume" if resumes and now.flown < now.to_fly else ""
    rate = f"{60.0 * now.flown / spent_s:.0f} a minute"
    yield f"{now.flown} of {now.to_fly} flown in {spent_s:.0f} s ({rate}){again}"
    for cell, seed, reason in now.lost[:_MOST_LOST]:
        yield f"lost: {cell}, seed {seed}: {reason}"
    if len(now.lost) > _MOST_LOST:
        yield f"lost: {len(now.lost) - _MOST_LOST} more"
