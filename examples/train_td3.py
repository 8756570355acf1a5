"""TD3 (Fujimoto et al. 2018) in `shipland/Landing-v0`, in one file.

pip install 'shipland[rl,train]'
python examples/train_td3.py --steps 20000 --action residual
"""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import torch
import tyro
from gymnasium.wrappers import NormalizeObservation
from torch import Tensor, nn

import shipland.environments


@dataclass(frozen=True)
class Arguments:
    """Train.

    Attributes:
        steps: of the environment; a landing is about 500.
        scenario: packaged name or TOML file.
        action: the sticks, or a residual on the pilot `horizon`.
        seed: of weights, exploration and flights.
        begin: steps of random actions before training begins.
        batch: transitions a training step.
        discount: of rewards a step later.
        rate: of learning.
        exploration: standard deviation of the noise on actions.
        target_noise, target_clip: of the noise on the target's actions.
        delay: critic's steps for one of the actor's.
        share: by which the targets follow in a step.
        out: file for the actor's weights; nothing is kept by default.
    """

    steps: int = 20_000
    scenario: str = "near"
    action: Literal["sticks", "residual"] = "residual"
    seed: int = 1
    begin: int = 1_000
    batch: int = 256
    discount: float = 0.99
    rate: float = 3e-4
    exploration: float = 0.1
    target_noise: float = 0.2
    target_clip: float = 0.5
    delay: int = 2
    share: float = 0.005
    out: Path | None = None


def network(inputs: int, hidden: int, outputs: int, *end: nn.Module) -> nn.Sequential:
    """Two hidden layers."""
    first, second = nn.Linear(inputs, hidden), nn.Linear(hidden, hidden)
    return nn.Sequential(first, nn.ReLU(), second, nn.ReLU(), nn.Linear(hidden, outputs), *end)


class Agent:
    """Actor, two critics, and their targets."""

    def __init__(self, observations: int, actions: int, arguments: Arguments, hidden: int = 256) -> None:
        self.arguments, self.updates = arguments, 0
        self.actor = network(observations, hidden, actions, nn.Tanh())
        self.critics = nn.ModuleList(network(observations + actions, hidden, 1) for _ in range(2))
        self.actor_target, self.critics_target = copy.deepcopy(self.actor), copy.deepcopy(self.critics)
        self.actor_steps = torch.optim.Adam(self.actor.parameters(), lr=arguments.rate)
        self.critic_steps = torch.optim.Adam(self.critics.parameters(), lr=arguments.rate)

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Without exploration."""
        with torch.no_grad():
            return self.actor(torch.as_tensor(observation, dtype=torch.float32)).numpy()

    def update(self, seen: Tensor, action: Tensor, reward: Tensor, after: Tensor, goes_on: Tensor) -> None:
        """One step of both critics and, every `delay`th time, of the actor and the targets."""
        it = self.arguments
        with torch.no_grad():
            noise = (it.target_noise * torch.randn_like(action)).clamp(-it.target_clip, it.target_clip)
            following = torch.cat((after, (self.actor_target(after) + noise).clamp(-1.0, 1.0)), 1)
            least = torch.min(*(critic(following) for critic in self.critics_target))
            target = reward + it.discount * goes_on * least
        both = torch.cat((seen, action), 1)
        loss = sum(nn.functional.mse_loss(critic(both), target) for critic in self.critics)
        self.critic_steps.zero_grad()
        loss.backward()
        self.critic_steps.step()
        self.updates += 1
        if self.updates % it.delay:
            return
        self.actor_steps.zero_grad()
        (-self.critics[0](torch.cat((seen, self.actor(seen)), 1)).mean()).backward()
        self.actor_steps.step()
        for follows, leads in ((self.actor_target, self.actor), (self.critics_target, self.critics)):
            for slow, fast in zip(follows.parameters(), leads.parameters(), strict=True):
                slow.data.lerp_(fast.data, it.share)


def main(arguments: Arguments) -> list[dict]:
    """Train; the last `info` of each flight."""
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(arguments.seed)
    make = {"scenario": arguments.scenario, "action": arguments.action, "observation": "flat"}
    env = NormalizeObservation(gymnasium.make(shipland.environments.LANDING, **make))
    observations, actions = env.observation_space.shape[0], env.action_space.shape[0]
    agent = Agent(observations, actions, arguments)
    widths = (observations, actions, 1, observations, 1)  # observation, action, reward, the next one, goes on
    memory = [np.zeros((arguments.steps, width), np.float32) for width in widths]
    flights, gained = [], 0.0
    seen, _ = env.reset(seed=arguments.seed)
    for step in range(arguments.steps):
        if step < arguments.begin:
            action = rng.uniform(-1.0, 1.0, actions)
        else:
            action = np.clip(agent.act(seen) + arguments.exploration * rng.standard_normal(actions), -1.0, 1.0)
        after, reward, terminated, truncated, info = env.step(action.astype(np.float32))
        for column, value in zip(memory, (seen, action, reward, after, not terminated), strict=True):
            column[step] = value
        seen, gained = after, gained + reward
        if terminated or truncated:
            flights.append(info)
            print(f"step {step + 1}, flight {len(flights)}: {gained:+.1f}; {info['reason']}", flush=True)
            seen, gained = env.reset()[0], 0.0
        if step >= arguments.begin:
            rows = rng.integers(step + 1, size=arguments.batch)
            agent.update(*(torch.from_numpy(column[rows]) for column in memory))
    env.close()
    if arguments.out is not None:
        torch.save({"actor": agent.actor.state_dict(), "mean": env.obs_rms.mean, "var": env.obs_rms.var}, arguments.out)
    return flights


if __name__ == "__main__":
    main(tyro.cli(Arguments))
