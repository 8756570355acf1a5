"""`shipland/LastPhase-v0`: the last metres of a landing, as the pilots `residual` and `learned` fly them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from shipland.environments.actions import ActionPilot, SteeredPilot
from shipland.environments.flight_env import FlightEnv, one_of
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.flight import Cycle
from shipland.guidance.horizon.steering import ENTRIES, LIMIT, REACH_M, Action, Kind, default_bound_mps2, observation_of
from shipland.guidance.pilot import PilotSetup
from shipland.messages import PilotCommand
from shipland.scenario.scenario import Scenario, scenario_table

Seen = npt.NDArray[np.float32]

START = {"start.distance_m": 2.5, "start.distance_half_range_m": 1.0}
"""Where flights begin: near enough to be short, far enough for the estimate to know the wave motion."""


def last_phases(
    scenarios: Sequence[str], changes: Sequence[str], action: Kind, bound_mps2: float, count: int
) -> list[Callable[[], LastPhaseEnv]]:
    """Functions that make `count` environments, which take the scenarios in turn; arguments as in `scenario_table`.

    ShiplandError where one of them is wrong; it says which.
    """
    made = [
        partial(LastPhaseEnv, scenario_table(scenario, changes=changes), action=action, bound_mps2=bound_mps2)
        for scenario in scenarios
    ]
    for make in made:
        make()
    return [made[index % len(made)] for index in range(count)]


class LastPhaseEnv(FlightEnv[Seen]):
    """The horizontal input of the pilot `horizon` near the landing point. Steps, reward, ends: see `FlightEnv`.

    The flight begins some metres astern of the deck. Wherever a policy of the pilots `residual` and `learned` would
    not be asked (search, approach, go-around, farther than `reach_m` from the landing point) `horizon` flies alone, and
    no step is counted.

    **Actions** (2,) in -1 … 1 change what `horizon` asks for horizontally, forward and starboard of the bar:
    `residual` adds the action times `bound_mps2`, `direct` puts it in its place. Heave, yaw and the landing's phases
    are the pilot's. Zeros of a residual fly the pilot alone.

    **Observations** (23,): what a policy of `shipland learn` sees, scaled and clipped, by name in `entries`: the
    pilot's estimate at its command's effect, never the truth.

    Args:
        scenario, overrides, vision, render_mode, **unknown: as in `FlightEnv`; sticks must mean a tilt, and the
            overrides are laid over `START` too.
        action: `residual` or `direct`.
        bound_mps2: input of an action of 1; default 0.5 residual, 4 direct.
        reach_m: farther from the landing point than this the pilot flies alone.

    Raises:
        ShiplandError: one of them is wrong; it says which.
    """

    usual = START

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any] = "rig-natops",
        *,
        overrides: Mapping[str, Any] | None = None,
        vision: str | Factory = "geometric",
        action: Kind = "residual",
        bound_mps2: float | None = None,
        reach_m: float = REACH_M,
        render_mode: str | None = None,
        **unknown: Any,  # noqa: ANN401 - refused
    ) -> None:
        one_of("action", action, get_args(Kind))
        super().__init__(scenario, overrides, vision, render_mode, unknown)
        try:
            self.action = Action(action, default_bound_mps2(action) if bound_mps2 is None else bound_mps2, reach_m)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"bound_mps2={bound_mps2!r}, reach_m={reach_m!r}: {error}") from None
        kind = self.scenario.aircraft.loop.kind
        if kind != "attitude":
            raise ConfigError(f"policies steer sticks of the kind 'attitude', not {kind!r} (aircraft.loop.kind)")
        self.entries = ENTRIES
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = spaces.Box(-LIMIT, LIMIT, (len(ENTRIES),), np.float32)

    def _pilot_of(self, setup: PilotSetup) -> ActionPilot:
        self._steered = SteeredPilot(setup, self.action)
        return self._steered

    def _look(self, cycle: Cycle, sent: PilotCommand | None) -> Seen | None:
        seen = self._steered.look(cycle.observation, cycle.telemetry, sent)
        return None if seen is None else observation_of(seen).astype(np.float32)
