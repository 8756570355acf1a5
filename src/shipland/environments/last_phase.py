"""`shipland/LastPhase-v0`: many landings' last phase at once, in one batched model (extra `train`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv

from shipland.config import require
from shipland.errors import ConfigError, SystemLibraryError
from shipland.guidance.horizon.steering import ENTRIES, LIMIT, Action, Kind
from shipland.learning.policy.setup import Randomisation
from shipland.scenario.last_phase import last_phase_of
from shipland.scenario.scenario import Scenario, load_scenario

try:
    import torch
    from torch import Tensor
except ImportError:
    raise SystemLibraryError(
        "shipland/LastPhase-v0 wants torch, which is not installed; pip install 'shipland[train]'"
    ) from None

from shipland.learning.policy.motion import MotionBank
from shipland.learning.policy.phase import Batch, Flights, LastPhase

IN_SQUARE, LANDED, FAILED = 10.0, 2.0, -10.0
"""Reward at contact: in the square, on the deck beside it, beside the deck; and for a flight that is lost."""
PER_METRE, PER_SECOND = 1.0, -0.05
LOST_M = 15.0
"""From the landing point, or this far below it in tenths: the flight is given up."""

Arrays = npt.NDArray[Any]
T = TypeVar("T")


class LastPhaseEnv(VectorEnv[Arrays, Arrays, Arrays]):
    """The last phase of `num_envs` landings: at most 12 m from the landing point to the first contact.

    **A step** is a picture's cycle, 1/30 s. **Actions** (n, 2) in -1 … 1 change what the pilot `horizon` asks for
    horizontally, forward and starboard of the bar, within `reach_m` of the landing point: `residual` adds the action
    times `bound_mps2`, `direct` puts it in its place. Heave, yaw and the landing's phases are the pilot's. Zeros of a
    residual fly the pilot alone.

    **Observations** (n, 23): what a policy of `shipland learn` sees, scaled and clipped, by name in `entries`: the
    pilot's estimate at its command's effect, never the truth.

    **Reward**: as in `shipland/Landing-v0`: metres nearer to the deck's centre, less 0.05 a second; at contact +10 in
    the square, +2 beside it on the deck, -10 beside the deck or for a flight that is lost.

    **Ends**: terminated at contact or when lost, truncated after `time_limit_s`; a flight that has ended is reset in
    the same step (`AutoresetMode.SAME_STEP`): its last observation and info are `info["final_obs"]` and
    `info["final_info"]`, with masks `_final_obs` and `_final_info`. The final info has `in_square`, `touched`, `own_m`
    (2), `deck_m` (2) and `t_s`.

    **Seeds**: `reset(seed=7)` seeds all flights of the batch, those that begin later included.

    Args:
        num_envs: flights at once.
        scenario: packaged name, TOML file, merged table or `Scenario`; sticks must mean a tilt.
        overrides: sections or dotted keys laid over it.
        action: `residual` or `direct`.
        bound_mps2: input of an action of 1; default 0.5 residual, 4 direct.
        reach_m: farther from the landing point than this the pilot flies alone.
        random: what differs from flight to flight.
        time_limit_s: of a flight.
        motions: of the ship that are drawn at the begin.

    Raises:
        ConfigError: one of them is wrong, or the model does not cover the scenario.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 256,
        scenario: Scenario | str | Path | Mapping[str, Any] = "rig-natops",
        *,
        overrides: Mapping[str, Any] | None = None,
        action: Kind = "residual",
        bound_mps2: float | None = None,
        reach_m: float = 1.5,
        random: Randomisation | None = None,
        time_limit_s: float = 20.0,
        motions: int = 32,
    ) -> None:
        source = scenario.table() if isinstance(scenario, Scenario) else scenario
        setup = last_phase_of(load_scenario(source, **(overrides or {})))
        try:
            require(num_envs >= 1, f"num_envs must be at least 1, got {num_envs}")
            require(time_limit_s > 0.0, f"time_limit_s must be positive, got {time_limit_s}")
            default = 0.5 if action == "residual" else 4.0
            self.action = Action(action, default if bound_mps2 is None else bound_mps2, reach_m)
        except ValueError as error:
            raise ConfigError(str(error)) from None
        self.num_envs = num_envs
        self.phase = LastPhase(setup, random, motions=motions)
        self.entries = ENTRIES
        self.single_observation_space = spaces.Box(-LIMIT, LIMIT, (len(ENTRIES),), np.float32)
        self.single_action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self._limit = round(time_limit_s / setup.cycle_s)
        self._flights: Flights | None = None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, Any]]:
        """Begin every flight again; of a list of seeds the first counts."""
        if isinstance(seed, list):
            seed = seed[0]
        super().reset(seed=seed, options=options)
        self._batch = self._draw()
        with torch.no_grad():
            self._flights = flights = self.phase.start(self._batch)
            self._begun = torch.zeros(self.num_envs, dtype=torch.long)
            self._distance_m = self._distances(flights)
            return self._seen(flights), {}

    def step(self, actions: Arrays) -> tuple[Arrays, Arrays, Arrays, Arrays, dict[str, Any]]:
        """Fly one cycle; see the class.

        Raises:
            gymnasium.error.ResetNeeded: no flight is on.
        """
        flights = self._flights
        if flights is None:
            raise gymnasium.error.ResetNeeded("no flight is on; call reset() first")
        with torch.no_grad():
            asked = torch.as_tensor(np.asarray(actions), dtype=torch.float32)
            flights = self.phase.step(self._batch, flights, asked, self.action)
            rewards, terminated, truncated = self._judged(flights)
            seen, info = self._seen(flights), dict[str, Any]()
            over = terminated | truncated
            if bool(over.any()):
                info = {"final_obs": seen.copy(), "final_info": self._final(flights, over)}
                info |= {"_final_obs": over.numpy(), "_final_info": over.numpy()}
                flights = self._begin_anew(flights, over)
                seen = self._seen(flights)
            self._flights = flights
        return seen, rewards.numpy().astype(np.float64), terminated.numpy(), truncated.numpy(), info

    def _draw(self) -> Batch:
        return self.phase.draw(self.num_envs, int(self.np_random.integers(2**31)))

    def _seen(self, flights: Flights) -> Arrays:
        observation: Arrays = self.phase.observation(flights).numpy()
        return observation

    def _distances(self, flights: Flights) -> Tensor:
        deck = self._batch.drawn.at(self.phase.bank.deck_m, flights.cycle)
        return (flights.aircraft.position_m - deck).norm(dim=1)

    def _judged(self, flights: Flights) -> tuple[Tensor, Tensor, Tensor]:
        """Rewards, ended, out of time."""
        rig, touch, before_m = self.phase.setup.rig, flights.touch, self._distance_m
        self._distance_m = distance_m = self._distances(flights)
        lost = ~(distance_m < LOST_M) & ~touch.touched
        sunk = (flights.over_deck_m < -0.1 * LOST_M) & ~touch.touched
        terminated = touch.touched | lost | sunk
        truncated = ~terminated & (flights.cycle - self._begun >= self._limit)
        gained_m = torch.nan_to_num(before_m - distance_m)
        off = torch.nan_to_num(touch.deck_m, nan=LOST_M).abs().amax(1)
        end = torch.where(off <= 0.5 * rig.landing_square_m, IN_SQUARE, torch.full_like(off, LANDED))
        end = torch.where(off <= 0.5 * rig.deck_size_m, end, torch.full_like(off, FAILED))
        rewards = PER_METRE * gained_m + PER_SECOND * self.phase.setup.cycle_s + terminated.to(off.dtype) * end
        return rewards, terminated, truncated

    def _final(self, flights: Flights, over: Tensor) -> dict[str, Any]:
        touch = flights.touch
        inside = touch.deck_m.abs().amax(1) <= 0.5 * self.phase.setup.rig.landing_square_m
        t_s = (flights.cycle - self._begun) * self.phase.setup.cycle_s
        values = {
            "in_square": touch.touched & inside,
            "touched": touch.touched,
            "own_m": touch.own_m,
            "deck_m": touch.deck_m,
            "t_s": t_s,
        }
        info: dict[str, Any] = {name: value.numpy().copy() for name, value in values.items()}
        return info | {f"_{name}": over.numpy() for name in values}

    def _begin_anew(self, flights: Flights, over: Tensor) -> Flights:
        batch = self._draw()
        begun = replace(self.phase.start(batch), cycle=flights.cycle)
        # All flights count their cycles together.
        batch = replace(batch, drawn=replace(batch.drawn, first=batch.drawn.first - flights.cycle))
        self._batch = replace(_merged(over, batch, self._batch), generator=batch.generator)
        self._begun = torch.where(over, torch.full_like(self._begun, flights.cycle), self._begun)
        flights = _merged(over, begun, flights)
        self._distance_m = self._distances(flights)
        return flights


_SECOND = frozenset(
    ("mean", "inputs", "place_m", "speed_mps", "rate_mps2", "state", "offset_m", "wanted_mps2", "places", "velocities")
)
"""Tensors whose second axis, not the first, is the batch's."""


def _merged(mask: Tensor, new: T, old: T) -> T:
    """Where the mask (B,) holds the new flights', elsewhere the old ones'; through dataclasses of tensors."""
    assert is_dataclass(old)
    changed: dict[str, Any] = {}
    for item in fields(old):
        before, after = getattr(old, item.name), getattr(new, item.name)
        if isinstance(before, Tensor):
            axis = 1 if item.name in _SECOND else 0
            shape = [1] * before.ndim
            shape[axis] = len(mask)
            changed[item.name] = torch.where(mask.reshape(shape), after, before)
        elif is_dataclass(before) and not isinstance(before, MotionBank):
            changed[item.name] = _merged(mask, after, before)
    return replace(old, **changed)  # type: ignore[type-var]
