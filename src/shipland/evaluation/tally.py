"""How many of so many flights landed: the share, its interval, and both in words."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from shipland.evaluation.landing import Landing
from shipland.statistics import Interval, share_interval


class Tally(NamedTuple):
    """Flights, and those of them that landed in the landing area."""

    flights: int
    landed: int

    @classmethod
    def of(cls, landings: Collection[Landing]) -> Tally:
        """Count them."""
        return cls(len(landings), sum(landing.success for landing in landings))

    @property
    def share(self) -> float:
        """Of those that landed; 0 without flights."""
        return self.landed / max(self.flights, 1)

    @property
    def interval(self) -> Interval:
        """95 % interval of the share, by Clopper and Pearson, for independent flights."""
        return share_interval(self.landed, self.flights)

    def share_text(self) -> str:
        """As `46 (92.0 %)`."""
        return f"{self.landed} ({100.0 * self.share:.1f} %)"

    def interval_text(self, digits: int = 1) -> str:
        """As `80.8–97.8 %`."""
        low, high = self.interval
        return f"{100.0 * low:.{digits}f}–{100.0 * high:.{digits}f} %"

    def within(self, rate: float) -> bool:
        """As many landed as wanted."""
        return self.share >= rate

    def undecided(self, rate: float) -> bool:
        """The interval of the share holds the rate."""
        low, high = self.interval
        return low < rate <= high
