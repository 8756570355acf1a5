"""The motion base's limits: the deck is brought to rest smoothly before it reaches them, and that is recorded."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters
from shipland.frames import Array
from shipland.rig import Rig
from shipland.sim.ship.deck_motion import DOF_NAMES, DeckMotion, SixDof

logger = logging.getLogger(__name__)


@parameters
class LimitParameters:
    """Section `[ship.limits]`."""

    enabled: bool = key(True, "the deck stands on the rig's motion base; a ship at sea has no such limits")
    knee: float = key(
        0.75, "share of a limit that leaves motion as it is", "chosen: a sharper stop would jerk the deck", gt=0, lt=1
    )


@dataclass(frozen=True)
class LimitBite:
    """One degree of freedom that the limits have held back.

    Attributes:
        name: one of `DOF_NAMES`.
        t_s: the first time [s].
        limit: the limit [m or rad].
        largest_demand: the largest demanded motion so far [m or rad].
    """

    name: str
    t_s: float
    limit: float
    largest_demand: float

    def __str__(self) -> str:
        unit, scale = ("m", 1.0) if self.name in DOF_NAMES[:3] else ("°", 180.0 / np.pi)
        return (
            f"motion base: {self.name} held back since t = {self.t_s:.2f} s, "
            f"asked {self.largest_demand * scale:.2f} {unit} of at most {self.limit * scale:.2f} {unit}"
        )


class LimitedMotion:
    """A deck motion kept inside symmetric limits by y = L·g(x/L).

    g(u) = u for |u| ≤ k, else ±(k + (1 − k) tanh((|u| − k)/(1 − k))): twice continuously differentiable and below 1,
    so that velocity g'ẋ and acceleration g'ẍ + g''ẋ²/L are those of the limited motion.

    Args:
        motion: the demanded motion.
        limit: (6,) largest excursions either side [m, m, m, rad, rad, rad].
        knee: k.
    """

    def __init__(self, motion: DeckMotion, limit: Array, knee: float) -> None:
        self.motion = motion
        self._limit = np.asarray(limit, dtype=float)
        self._knee = knee
        self._free = knee * self._limit
        self._bites: dict[int, LimitBite] = {}

    @property
    def bites(self) -> tuple[LimitBite, ...]:
        """The degrees of freedom held back so far, in the order of `DOF_NAMES`."""
        return tuple(self._bites[index] for index in sorted(self._bites))

    def at(self, t_s: float) -> SixDof:
        """See `DeckMotion`."""
        asked = self.motion.at(t_s)
        if is_within(asked.values, self._free):
            return asked
        limited = SixDof(asked.values.copy())
        x, v, a = limited.displacement, limited.velocity, limited.acceleration
        for index in np.flatnonzero(np.abs(x) > self._free).tolist():
            self._note(index, t_s, abs(float(x[index])))
            limit, knee = self._limit[index], self._knee
            sign, beyond = np.sign(x[index]), (abs(x[index]) / limit - knee) / (1.0 - knee)
            tanh = np.tanh(beyond)
            slope = 1.0 - tanh**2
            bend = -2.0 * sign * tanh * slope / ((1.0 - knee) * limit)
            x[index] = sign * limit * (knee + (1.0 - knee) * tanh)
            a[index] = slope * a[index] + bend * v[index] ** 2
            v[index] *= slope
        return limited

    def _note(self, index: int, t_s: float, demand: float) -> None:
        before = self._bites.get(index)
        if before is not None and demand <= before.largest_demand:
            return
        first_s = t_s if before is None else before.t_s
        self._bites[index] = LimitBite(DOF_NAMES[index], first_s, float(self._limit[index]), demand)
        if before is None:
            logger.info("%s", self._bites[index])


@compiled
def is_within(values: Array, limit: Array) -> bool:
    """Whether the first of `values` lie within limits (6,) either side."""
    within = True
    for index in range(6):
        within = within and abs(values[index]) <= limit[index]
    return within


def rig_limits(rig: Rig) -> Array:
    """(6,) the motion base's limits [m, m, m, rad, rad, rad]."""
    lengths = (rig.surge_limit_m, rig.sway_limit_m, rig.heave_limit_m)
    return np.array([*lengths, *np.radians((rig.roll_limit_deg, rig.pitch_limit_deg, rig.yaw_limit_deg))])
