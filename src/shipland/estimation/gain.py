"""The effect of a full stick against the stated response: a bank of filters, each with its own gain.

A gain that the filter does not know looks like a wind that changes with the sticks, or like a motion of the bar. While
the sticks change, the filter with the right gain has the smallest innovations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shipland.config import key, parameters, require
from shipland.estimation.delayed import DelayedFilter, FilterBank, Inputs
from shipland.estimation.relative_state import Model
from shipland.frames import Array, all_finite


@parameters
class GainParameters:
    """`[guidance.horizon.gain]`."""

    deviation: float = key(
        0.15, "standard deviation of the gain's natural logarithm; 0 keeps the stated response", ge=0
    )
    candidates: tuple[float, ...] = key((0.8, 1.0, 1.25), "of the gain, against the stated response; 1 is among them")
    every_s: float = key(0.05, "see `FilterBank`")
    share: float = key(0.25, "see `FilterBank`")
    memory_s: float = key(20.0, "see `FilterBank`", gt=0)
    lead: float = key(4.0, "another gain is taken when it leads by this much")

    def __post_init__(self) -> None:
        require(1.0 in self.candidates, f"1 must be among the candidates, got {self.candidates}")
        require(min(self.candidates) > 0.0, f"candidates must be positive, got {self.candidates}")


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
