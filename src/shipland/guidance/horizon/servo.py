"""What an autopilot that tracks a velocity makes of the sticks: a smoothed speed of its own, known without measuring.

With u the speed asked for, α the rate of approach and τ the smoothing: ṙ = q; q̇ = (α (u − r) − q) / τ.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.compiled import compiled
from shipland.estimation.delayed import Inputs
from shipland.estimation.kernels import add_input
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
            state, model = self.state.copy(), (self._step, self._push, self._gain)
            inputs.count, self._t_s = _shape(
                state, self.asked_mps, model, inputs.history, inputs.count, self._t_s, to_s
            )
            self.state = state
            inputs.make_room()


@compiled
def _shape(
    state: Array,
    asked_mps: Array,
    model: tuple[Array, Array, float],
    history: Array,
    count: int,
    t_s: float,
    to_s: float,
) -> tuple[int, float]:
    """Propagate the state in place while the history has rows; how many are filled, and the time."""
    (step, push, gain), value = model, np.empty(4)
    while t_s + 0.5 * _STEP_S < to_s and count < len(history):
        for axis in range(2):
            speed, rate = state[0, axis], state[1, axis]
            state[0, axis] = step[0, 0] * speed + step[0, 1] * rate + push[0] * asked_mps[axis]
            state[1, axis] = step[1, 0] * speed + step[1, 1] * rate + push[1] * asked_mps[axis]
            value[2 + axis] = 0.5 * (speed + state[0, axis])
            value[axis] = value[2 + axis] + 0.5 * (rate + state[1, axis]) / gain
        add_input(history, count, t_s, value)
        count, t_s = count + 1, t_s + _STEP_S
    return count, t_s
