"""The agent that `shipland learn` trains: TD3 [Fujimoto2018], from an actor that flies as `horizon` alone."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from stable_baselines3 import TD3
from stable_baselines3.common.noise import OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor, nn

from shipland.errors import DataError
from shipland.files import json_of
from shipland.guidance.horizon.steering import ENTRIES
from shipland.learning.checkpoint import (
    check_resumable,
    optimizer_tensors,
    read_tensors,
    restore_optimizer,
    write_tensors,
)
from shipland.learning.policy.arguments import LearnArguments
from shipland.learning.policy.export import ACTIONS, Dense

FORMAT = "shipland-learn-3"
DISCOUNT, RETURN_STEPS, MEMORY = 0.99, 5, 500_000
"""Discount of rewards a step later; steps of a return before the critic takes over; transitions kept."""
NOISE, NOISE_PER_S, STEP_S = 0.2, 2.0, 1.0 / 30.0
"""Exploration: standard deviation of the noise on actions, its rate, and a step; faster noise is lost in the lags."""
BEGIN = 1_000
"""Steps of random actions before training begins."""
KEPT = 0.95
"""Share of the averaged actor that stays in a chunk of steps."""
_SAME = ("kind", "scenario", "changes", "environments", "bound", "hidden", "seed")
"""Arguments of a run that stay the same when it is resumed."""
_LINEAR = (0, 2, 4)
"""The linear layers of an actor, by their number."""
_MEMORY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")

Row = tuple[float, float, float]
"""Of a flight: its return, whether it was a success, and its error [m], NaN without contact."""


@dataclass
class Progress:
    """Where a run stands.

    Attributes:
        step, updates, seconds: of all environments, of the critics, and spent.
        best, best_step: highest mean return of an evaluation so far, and when; at step 0 `horizon` alone.
        history: one row a chunk.
        flights, flown: the last ones, and how many there were.
        run: what must stay the same when it is resumed.
    """

    step: int = 0
    updates: int = 0
    seconds: float = 0.0
    best: float = -math.inf
    best_step: int = 0
    history: list[dict[str, float]] = field(default_factory=list)
    flights: list[Row] = field(default_factory=list)
    flown: int = 0
    run: dict[str, str] = field(default_factory=dict)


class Run:
    """What changes from step to step."""

    def __init__(self, arguments: LearnArguments, envs: VecEnv) -> None:
        noise = OrnsteinUhlenbeckActionNoise(
            np.zeros(ACTIONS), np.full(ACTIONS, NOISE * math.sqrt(2.0 * NOISE_PER_S)), NOISE_PER_S, STEP_S
        )
        self.agent = TD3(
            "MlpPolicy",
            envs,
            learning_rate=arguments.rate,
            buffer_size=MEMORY,
            learning_starts=BEGIN,
            batch_size=arguments.batch,
            gamma=DISCOUNT,
            n_steps=RETURN_STEPS,
            train_freq=1,
            gradient_steps=1,
            action_noise=noise,
            policy_kwargs={"net_arch": {"pi": [arguments.hidden] * 2, "qf": [2 * arguments.hidden] * 2}},
            seed=arguments.seed,
            device="cpu",
        )
        _begin_as_horizon(self.agent.actor.mu, arguments)
        self.agent.actor_target.load_state_dict(self.agent.actor.state_dict())
        self.averaged = {name: value.clone() for name, value in self.agent.actor.mu.state_dict().items()}
        self.best = dict(self.averaged)
        self.progress = Progress(run={name: str(getattr(arguments, name)) for name in _SAME})

    def average(self) -> None:
        """Take the actor into the average that is exported."""
        for name, value in self.agent.actor.mu.state_dict().items():
            self.averaged[name] = KEPT * self.averaged[name] + (1.0 - KEPT) * value

    def save(self, path: Path) -> None:
        """Everything needed to go on, but for the flights that are on."""
        agent, memory = self.agent, self.agent.replay_buffer
        assert memory is not None
        filled = memory.buffer_size if memory.full else memory.pos
        tensors = {
            "policy": agent.policy.state_dict(),
            "actor_optimizer": optimizer_tensors(agent.actor.optimizer),
            "critic_optimizer": optimizer_tensors(agent.critic.optimizer),
            "averaged": self.averaged,
            "best": self.best,
            "memory": {name: torch.from_numpy(getattr(memory, name)[:filled]) for name in _MEMORY},
        }
        about = {"format": FORMAT, "progress": json.dumps(vars(self.progress)), "position": str(memory.pos)}
        write_tensors(path, tensors, about)

    def load(self, path: Path) -> None:
        """What `save` wrote; DataError when it is missing, truncated, another file, or of a run of other arguments."""
        tensors, about = read_tensors(path, FORMAT, "learn")
        agent, memory = self.agent, self.agent.replay_buffer
        assert memory is not None
        try:
            progress = Progress(**json_of(about["progress"]))
            check_resumable(path, progress.run, self.progress.run)
            memory.pos, filled = int(about["position"]), len(tensors["memory"]["rewards"])
            for name in _MEMORY:
                getattr(memory, name)[:filled] = tensors["memory"][name].numpy()
            memory.full = filled == memory.buffer_size
            agent.policy.load_state_dict(tensors["policy"])
            self.averaged, self.best = tensors["averaged"], tensors["best"]
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise DataError(f"checkpoint {path} is damaged: {error}") from None
        self.progress = progress
        progress.flights = [(row[0], row[1], row[2]) for row in progress.flights]
        for name, optimizer in (("actor", agent.actor.optimizer), ("critic", agent.critic.optimizer)):
            if f"{name}_optimizer" in tensors:
                restore_optimizer(optimizer, tensors[f"{name}_optimizer"])
        agent.num_timesteps, agent._n_updates = progress.step, progress.updates


def dense_of(layers: dict[str, Tensor]) -> list[Dense]:
    """An actor's layers, for a file."""
    return [
        Dense(layers[f"{index}.weight"].numpy(), layers[f"{index}.bias"].numpy(), "Relu" if index < 4 else "Tanh")
        for index in _LINEAR
    ]


def answer(layers: Sequence[Dense], seen: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(2,) the action of an actor."""
    for layer in layers:
        summed = layer.weight @ seen + layer.bias
        seen = np.tanh(summed) if layer.activation == "Tanh" else np.maximum(summed, 0.0)
    return seen


def _begin_as_horizon(actor: nn.Sequential, arguments: LearnArguments) -> None:
    """Zeros for a residual; a direct policy is fitted to what the pilot asks for, on drawn observations."""
    last = actor[_LINEAR[-1]]
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    if arguments.kind == "residual":
        return
    wanted = [ENTRIES.index(f"wanted_mps2.{axis}") for axis in ("forward", "starboard")]
    scale = 2.0 / arguments.bound  # of `wanted_mps2` in an observation
    optimizer = torch.optim.Adam(actor.parameters(), 3e-3)
    generator = torch.Generator().manual_seed(arguments.seed)
    for _ in range(1_000):
        seen = torch.randn(256, len(ENTRIES), generator=generator)
        loss = (actor(seen) - (scale * seen[:, wanted]).clamp(-0.99, 0.99)).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
