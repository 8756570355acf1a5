"""The effect of a full stick against the stated response: a bank of filters, each with its own gain.

A gain that the filter does not know looks like a wind that changes with the sticks, or like a motion of the bar. While
the sticks change, the filter with the right gain has the smallest innovations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipland.config import require
from shipland.estimation.delayed import DelayedFilter, Inputs
from shipland.estimation.filter_bank import FilterBank
from shipland.estimation.relative_state import Model
from shipland.frames import Array, all_finite


@dataclass(frozen=True)
class GainParameters:
    """`[guidance.horizon.gain]`.

    Attributes:
        deviation: standard deviation of the gain's natural logarithm; 0 keeps the stated response.
        candidates: of the gain, against the stated response; 1 is among them.
        every_s, share, memory_s: as `FilterBank`.
        lead: another gain is taken when it leads by this much.
    """

    deviation: float
    candidates: tuple[float, ...]
    every_s: float
    share: float
    memory_s: float
    lead: float

    def __post_init__(self) -> None:
        require(self.deviation >= 0.0, f"deviation must not be negative, got {self.deviation}")
        require(1.0 in self.candidates, f"1 must be among the candidates, got {self.candidates}")
        require(min(self.candidates) > 0.0, f"candidates must be positive, got {self.candidates}")
        require(self.memory_s > 0.0, f"memory_s must be positive, got {self.memory_s}")


class GainBank(FilterBank):
    """Finds by what factor the sticks do more, or less, than the response says.

    Args:
        parameters: of the bank.
    """

    def __init__(self, parameters: GainParameters) -> None:
        self._parameters = parameters
        prior = np.array([(math.log(gain) / max(parameters.deviation, 1e-6)) ** 2 for gain in parameters.candidates])
        super().__init__(prior, parameters.every_s, parameters.share, parameters.memory_s)
        self.gain = 1.0
        """In use."""

    def adopt(self, models: Sequence[Model]) -> None:
        """Go on with models of other waves, one for each candidate."""
        for model, one in zip(models, self.filters, strict=False):
            one.adopt(model)

    def update_pose(
        self,
        t_s: float,
        place_m: Array,
        covariance_m2: Array,
        inputs: Inputs,
        turn_rad_s: float,
        follows: DelayedFilter,
        models: Sequence[Model],
    ) -> DelayedFilter | None:
        """Judge by a picture's place (axes,) of its exposure; `follows` is the filter in use, `models` by candidate.

        Returns:
            The filter of another gain that leads by now, to be used from here on.
        """
        candidates = self._parameters.candidates
        if self._parameters.deviation <= 0.0:
            return None

        def take(i: int, one: DelayedFilter) -> None:
            one.model = models[i]
            one.update_pose(t_s, place_m, covariance_m2, inputs, turn_rad_s)

        judged = self.judged(t_s, follows, take)
        if judged is None or not all_finite(judged[0]):
            return None
        cost, best = judged[0], int(np.argmin(judged[0]))
        if cost[candidates.index(self.gain)] - cost[best] < self._parameters.lead:
            return None
        self.gain, better = candidates[best], self.filters[best].copy()
        self.forget_place()  # the others may have lost theirs, and would be surprised by every picture from here on
        return better
