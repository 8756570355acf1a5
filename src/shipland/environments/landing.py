"""`shipland/Landing-v0`: one landing, a cycle a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from shipland import factories
from shipland.environments.actions import STICKS, ActionPilot, ResidualPilot, StickPilot
from shipland.environments.flight_env import FlightEnv, one_of
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.flight import Cycle
from shipland.guidance.pilot import PilotSetup
from shipland.messages import PilotCommand
from shipland.record.observations import BOUNDS, Arrays, Observer
from shipland.scenario.scenario import Scenario

Seen = Arrays | npt.NDArray[np.float32]


class LandingEnv(FlightEnv[Seen]):
    """A whole landing by its sticks. Steps, reward, ends, info and seeds: see `FlightEnv`.

    **Actions**: (4,) in -1 … 1: pitch (forward positive), roll (right), heave (up), yaw (clockwise). `sticks`: of the
    full stick; camera and intent as in `StickPilot`. `residual`: times `bound`, added to the pilot's sticks as in
    `ResidualPilot`; zeros fly the pilot alone.

    **Observations**: see `Observer`; delayed, with ages, never the truth. `dict`, or `flat`: its entries one after
    the other by name, which `gymnasium.spaces.unflatten(env.unwrapped.entries, observation)` takes apart again.

    Args:
        scenario, overrides, vision, render_mode, **unknown: as in `FlightEnv`.
        action: `sticks` or `residual`.
        pilot: of the residual, as `factories.resolve` takes it.
        bound: of the residual, as a share of the full stick: one for all or four.
        observation: `dict` or `flat`.

    Raises:
        ShiplandError: one of them is wrong; it says which.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any] = "near",
        *,
        overrides: Mapping[str, Any] | None = None,
        vision: str | Factory = "geometric",
        action: str = "sticks",
        pilot: str | Factory = "horizon",
        bound: float | Sequence[float] = 0.2,
        observation: str = "dict",
        render_mode: str | None = None,
        **unknown: Any,  # noqa: ANN401 - refused
    ) -> None:
        one_of("action", action, ("sticks", "residual"))
        one_of("observation", observation, ("dict", "flat"))
        super().__init__(scenario, overrides, vision, render_mode, unknown)
        inner = factories.resolve("pilots", pilot)
        self._inner = inner if action == "residual" else None
        self._bound = _bound_of(bound)
        self.entries = observation_space()
        self.action_space = spaces.Box(-1.0, 1.0, (STICKS,), np.float32)
        self._flat = observation == "flat"
        self.observation_space = spaces.flatten_space(self.entries) if self._flat else self.entries  # type: ignore[assignment]

    def _pilot_of(self, setup: PilotSetup) -> ActionPilot:
        self._observer = Observer(setup.camera)
        if self._inner is None:
            return StickPilot(setup, self.scenario.safety.stale_s)
        return ResidualPilot(self._inner(setup), self._bound)

    def _look(self, cycle: Cycle, sent: PilotCommand | None) -> Seen:
        entries = self._observer.take(cycle.observation, cycle.telemetry, sent)
        if not self._flat:
            return entries
        flat: npt.NDArray[np.float32] = np.concatenate(list(entries.values()))
        return flat


def observation_space() -> spaces.Dict:
    """The space of `Observer.take`; flattened, its entries follow each other in the order of the alphabet."""
    return spaces.Dict({name: spaces.Box(low, high, dtype=np.float32) for name, (low, high) in BOUNDS.items()})


def _bound_of(bound: float | Sequence[float]) -> npt.NDArray[np.float64]:
    try:
        shares = np.asarray(bound, dtype=float)
    except (TypeError, ValueError):  # no numbers
        shares = np.array(np.nan)
    if shares.shape not in ((), (STICKS,)) or not np.all((shares >= 0.0) & (shares <= 1.0)):
        raise ConfigError(f"bound={bound!r}: expected a share of the full stick, 0 … 1, or four of them")
    return np.array(np.broadcast_to(shares, STICKS))
