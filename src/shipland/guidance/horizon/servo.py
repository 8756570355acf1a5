"""What an autopilot that tracks a velocity makes of the sticks: a smoothed speed of its own, known without measuring.

With u the speed asked for, α the rate of approach and τ the smoothing: ṙ = q; q̇ = (α (u − r) − q) / τ.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.estimation.delayed import Inputs
from shipland.estimation.relative_state import AxisModel, shaping
from shipland.frames import Array

_STEP_S = 0.005


class ShapedSpeed:
    """The speed that the autopilot tracks, over two axes, propagated in short steps; enters the filter's inputs.

    Args:
        motion: of the vehicle.
    """

    def __init__(self, motion: AxisModel) -> None:
        a, b = shaping(motion)
        self._step = np.eye(2) + _STEP_S * (a + 0.5 * _STEP_S * a @ a)
        self._push = _STEP_S * (b + 0.5 * _STEP_S * a @ b)
        self._gain = motion.servo_per_s
        self._t_s = -math.inf
        self.asked_mps: Array = np.zeros(2)
        """(2,) by the sticks."""
        self.state: Array = np.zeros((2, 2))
        """Speed and its rate, by axes."""

    def ask(self, from_s: float, speed_mps: Array, inputs: Inputs) -> None:
        """From `from_s` on the sticks ask for `speed_mps` (2,)."""
        if not math.isfinite(self._t_s):
            self._t_s = from_s
        self.advance(from_s, inputs)
        self.asked_mps = speed_mps

    def advance(self, to_s: float, inputs: Inputs) -> None:
        """Propagate to a time, to the nearest step."""
        while self._t_s + 0.5 * _STEP_S < to_s and math.isfinite(self._t_s):
            after = self._step @ self.state + np.outer(self._push, self.asked_mps)
            speed, rate = 0.5 * (self.state + after)
            inputs.add(self._t_s, np.concatenate([speed + rate / self._gain, speed]))
            self.state, self._t_s = after, self._t_s + _STEP_S
