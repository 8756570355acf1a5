"""Wind: the air's velocity in `ned` at a place and time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shipland.config import require
from shipland.frames import Array, Pose
from shipland.rig import Rig


class Wind(Protocol):
    """Air in motion."""

    def velocity_at(self, t_s: float, position_in_ned_m: Array, ned_from_ship: Pose) -> Array:
        """Velocity (3,) of the air in `ned` [m/s] at a point (3,) of `ned`; `t_s` never decreases between calls."""


class SteadyWind:
    """The same wind everywhere and always.

    Args:
        velocity_in_ned_mps: (3,) of the air.
    """

    def __init__(self, velocity_in_ned_mps: Array) -> None:
        self._velocity = np.asarray(velocity_in_ned_mps, dtype=float)

    def velocity_at(self, t_s: float, position_in_ned_m: Array, ned_from_ship: Pose) -> Array:  # noqa: ARG002
        """See `Wind`."""
        return self._velocity


@dataclass(frozen=True)
class WindParameters:
    """What the configuration says of the wind in section `[wind]`.

    Attributes:
        mean_mps: mean wind speed.
        from_deg: compass direction that the wind comes from.
    """

    mean_mps: float
    from_deg: float

    def __post_init__(self) -> None:
        require(0.0 <= self.mean_mps <= 30.0, f"mean_mps must be in 0…30 m/s, got {self.mean_mps}")


def build_wind(parameters: WindParameters, rig: Rig, rng: np.random.Generator) -> Wind:  # noqa: ARG001
    """The wind that `parameters` describe; `rng` draws its turbulence."""
    towards_rad = np.radians(parameters.from_deg) + np.pi
    return SteadyWind(parameters.mean_mps * np.array([np.cos(towards_rad), np.sin(towards_rad), 0.0]))
