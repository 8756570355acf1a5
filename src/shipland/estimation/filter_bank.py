"""Filters that take the same pictures under different hypotheses, and the evidence for each: its innovations."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from shipland.estimation.delayed import DelayedFilter
from shipland.frames import Array

_MOST_SURPRISE = 25.0
"""Of one picture: normalised innovation squared; beyond it the picture is an outlier under every hypothesis."""
_BLIND_S = 1.0
"""After a gap this long the filters' positions no longer discriminate between the hypotheses."""


class FilterBank:
    """Copies of the filter in use that go on side by side.

    Args:
        prior: (n,) cost of each before anything is seen: minus twice the logarithm of its likelihood.
        every_s: pictures that follow closer are passed over.
        share: of a picture's evidence that counts: the innovations are not independent of each other.
        memory_s: over which evidence counts.
    """

    def __init__(self, prior: Array, every_s: float, share: float, memory_s: float) -> None:
        self._prior, self._every_s, self._share, self._memory_s = prior, every_s, share, memory_s
        self._evidence: Array = np.zeros(len(prior))
        self._seen_s = -math.inf
        self.filters: list[DelayedFilter] = []
        """Empty before the first picture."""

    def forget_place(self) -> None:
        """The place is lost: the filters restart with the next picture, the evidence stays."""
        self.filters = []

    def update_velocity(self, t_s: float, measured_mps: Array, over_ship: float) -> None:
        """As `DelayedFilter.velocity`."""
        for one in self.filters:
            one.update_velocity(t_s, measured_mps, over_ship)

    def judged(
        self, t_s: float, follows: DelayedFilter, take: Callable[[int, DelayedFilter], None]
    ) -> tuple[Array, float] | None:
        """After a picture: (n,) the cost of each, and the time since the picture before; None where it is passed over.

        Args:
            t_s: of the picture.
            follows: the filter in use, which all begin as.
            take: gives the picture to one of the filters, by its number.
        """
        passed_s = t_s - self._seen_s
        if follows.estimate is None or passed_s < self._every_s:
            return None
        self._seen_s = t_s
        if not self.filters or passed_s > _BLIND_S:
            self.filters = [follows.copy() for _ in self._prior]
            return None
        self._evidence *= math.exp(-passed_s / self._memory_s)
        for i, one in enumerate(self.filters):
            take(i, one)
            self._evidence[i] += self._share * min(one.normalised, _MOST_SURPRISE)
        return self._prior + self._evidence, passed_s
