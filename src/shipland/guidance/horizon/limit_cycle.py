"""Whether the sticks oscillate from stop to stop: no gust causes that, only a loop that has lost its margin.

At the stops the vehicle follows late, and by less than its model says. Gains by the model sustain such a limit cycle,
and the filters of gain and latency adapt to it.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.frames import Array

_MEMORY_S, _LIMIT_CYCLE = 2.0, 0.3


class LimitCycleDetector:
    """The variance of the input over the last seconds, as a share of the squared full input."""

    def __init__(self) -> None:
        self._mean: Array = np.zeros(2)
        self._variance = 0.0

    @property
    def oscillating(self) -> bool:
        """From stop to stop: there the variance is above a half; gusts of 9 m/s of wind make a tenth of it."""
        return self._variance > _LIMIT_CYCLE

    def take(self, share: Array, step_s: float) -> None:
        """The input (2,), as a share of the full one, has been so for a while."""
        kept = math.exp(-max(step_s, 0.0) / _MEMORY_S)  # a clock may leap back
        off = share - self._mean
        self._mean = self._mean + (1.0 - kept) * off
        self._variance = kept * self._variance + (1.0 - kept) * float(off @ off)
