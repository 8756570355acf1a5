"""How much later pictures were taken than they say: a bank of filters, each with its own answer, and their evidence.

A picture of a wrong time shows a place where the aircraft has not been yet, or no longer is. While the speed against
the bar changes, no other error of the filter looks like it: the filter with the right time has the smallest
innovations.
"""

from __future__ import annotations

import numpy as np

from shipland.config import key, parameters, require
from shipland.estimation.delayed import DelayedFilter, FilterBank, Inputs
from shipland.estimation.relative_state import Model
from shipland.frames import Array, all_finite


@parameters
class LatencyParameters:
    """`[guidance.horizon.latency]`."""

    deviation_s: float = key(
        0.05, "standard deviation of what the time stamps of a flight's pictures are off by; 0 believes them", ge=0
    )
    candidates_s: tuple[float, ...] = key(
        (-0.12, -0.06, 0.0, 0.06, 0.12), "ascending, equally far apart: what each filter of the bank adds to the stamps"
    )
    every_s: float = key(0.05, "see `FilterBank`")
    share: float = key(0.25, "see `FilterBank`")
    memory_s: float = key(20.0, "see `FilterBank`", gt=0)
    most_per_s: float = key(0.05, "the correction in use changes no faster")

    def __post_init__(self) -> None:
        require(len(self.candidates_s) >= 3, "candidates_s must hold at least three")
        steps = np.diff(self.candidates_s)
        require(
            bool(np.all(steps > 0.0)) and bool(np.allclose(steps, steps[0])), "candidates_s must rise in equal steps"
        )


class LatencyBank(FilterBank):
    """Finds what to add to the pictures' times.

    Args:
        parameters: of the bank.
    """

    def __init__(self, parameters: LatencyParameters) -> None:
        self._parameters = parameters
        self._candidates_s = np.array(parameters.candidates_s)
        prior = (self._candidates_s / max(parameters.deviation_s, 1e-6)) ** 2
        super().__init__(prior, parameters.every_s, parameters.share, parameters.memory_s)
        self.correction_s = 0.0
        """To be added to a picture's time stamp."""

    def adopt(self, model: Model) -> None:
        """Go on with a model of other waves."""
        for one in self.filters:
            one.adopt(model)

    def update_pose(
        self,
        stamp_s: float,
        place_m: Array,
        covariance_m2: Array,
        inputs: Inputs,
        turn_rad_s: float,
        follows: DelayedFilter,
    ) -> None:
        """Judge by a picture's place (axes,) with the time as it was stamped; `follows` is the filter in use."""
        if self._parameters.deviation_s <= 0.0:
            return

        def take(i: int, one: DelayedFilter) -> None:
            one.model = follows.model
            one.update_pose(stamp_s + self._candidates_s[i], place_m, covariance_m2, inputs, turn_rad_s)

        judged = self.judged(stamp_s, follows, take)
        if judged is None:
            return
        cost, passed_s = judged
        most_s = self._parameters.most_per_s * passed_s
        self.correction_s += min(max(self._best_s(cost) - self.correction_s, -most_s), most_s)

    def _best_s(self, cost: Array) -> float:
        """The lowest point of the parabola through the least cost and its neighbours."""
        if not all_finite(cost):
            return 0.0
        middle = min(max(int(np.argmin(cost)), 1), len(cost) - 2)
        before, at, after = cost[middle - 1 : middle + 2].tolist()
        step_s = float(self._candidates_s[1] - self._candidates_s[0])
        bend = before - 2.0 * at + after
        off = 0.5 * (before - after) / bend if bend > 1e-9 else 0.0
        return float(self._candidates_s[middle]) + step_s * min(max(off, -1.0), 1.0)
