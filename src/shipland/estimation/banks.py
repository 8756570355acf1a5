"""Banks of filters that adapt two constants in flight: the offset of the pictures' time stamps, and the sticks' gain.

Each filter of a bank has its own value of the constant; that with the right one has the smallest innovations.

- A picture of a wrong time shows a place where the aircraft has not been yet, or no longer is. While the speed against
  the bar changes, no other error of the filter looks like it.
- A gain that the filter does not know looks like a wind that changes with the sticks, or like a motion of the bar:
  while the sticks change, only the right one explains the pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from shipland.config import key, parameters, require
from shipland.estimation.delayed import DelayedFilter, Inputs
from shipland.estimation.relative_state import Model
from shipland.frames import Array, all_finite

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
