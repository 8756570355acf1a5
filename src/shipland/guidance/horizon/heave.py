"""Which wave motion the bar has, by its heave in the pictures."""

from __future__ import annotations

from shipland.estimation.delayed import Inputs
from shipland.estimation.waves import WaveBank, WaveEstimate, WaveMotion, WaveParameters


class HeaveTracker:
    """The hypotheses of the bar's wave motion, and the one in use.

    Args:
        parameters: of the hypotheses.
        climb_lag_s: of the vehicle's climb rate.
        velocity_std_mps: standard deviation of its vertical velocity.
        low_m: below the bar; lower than this, ground effect and contact disturb the height.
    """

    def __init__(self, parameters: WaveParameters, climb_lag_s: float, velocity_std_mps: float, low_m: float) -> None:
        self._parameters, self._bank = parameters, WaveBank(parameters)
        self._climb_lag_s, self._velocity_std_mps, self._low_m = climb_lag_s, velocity_std_mps, low_m
        self._estimate: WaveEstimate | None = None
        self._velocity: tuple[float, float] | None = None

    @property
    def wave(self) -> WaveMotion:
        """The wave motion in use."""
        chosen = self._parameters.first if self._estimate is None else self._estimate.chosen
        return self._parameters.believed[chosen]

    def update_velocity(self, t_s: float, down_mps: float, picture_s: float) -> None:
        """The vehicle's vertical velocity, true at `t_s`: the first one after each picture, exposed at `picture_s`."""
        if self._velocity is None or picture_s > self._velocity[0]:
            self._velocity = t_s, down_mps

    def update_pose(self, t_s: float, down_m: float, variance_m2: float, climbs: Inputs) -> None:
        """A picture's height below the bar; `climbs` downward, as they took effect."""
        before, lag_s = self._estimate, self._climb_lag_s
        if down_m > self._low_m:
            return
        if before is None:
            self._estimate = self._bank.start(t_s, down_m)
            return
        if self._velocity is not None and self._velocity[0] <= t_s:
            velocity_s, down_mps = self._velocity
            asked_mps = float(climbs.mean(velocity_s - lag_s, velocity_s - lag_s)[0])
            before = self._bank.update_velocity(before, down_mps - asked_mps, self._velocity_std_mps)
            self._velocity = None
        moved_m = float(climbs.mean(before.t_s - lag_s, t_s - lag_s)[0]) * max(t_s - before.t_s, 0.0)
        self._estimate = self._bank.update_pose(before, t_s, moved_m, down_m, variance_m2)
