"""Whether the sticks swing from stop to stop: no gust asks for that, only a loop that has lost its margin.

At the stops the vehicle follows late, and by less than its model says. Gains that go by the model keep such a swing up,
and the filters of gain and latency take it for another vehicle.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.frames import Array

_MEMORY_S, _SWINGING = 2.0, 0.3


class LimitCycleDetector:
    """The variance of the input over the last seconds, as a share of the squared full input."""

    def __init__(self) -> None:
        self._mean: Array = np.zeros(2)
        self._variance = 0.0

    @property
    def swinging(self) -> bool:
        """From stop to stop: there the variance is above a half; gusts of 9 m/s of wind make a tenth of it."""
        return self._variance > _SWINGING

    def take(self, share: Array, step_s: float) -> None:
        """The input (2,), as a share of the full one, has been so for a while."""
        kept = math.exp(-max(step_s, 0.0) / _MEMORY_S)  # a clock may leap back
        off = share - self._mean
        self._mean = self._mean + (1.0 - kept) * off
        self._variance = kept * self._variance + (1.0 - kept) * float(off @ off)
