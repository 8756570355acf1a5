"""TD3 (Fujimoto et al. 2018) on many landings at once in `shipland/LastPhase-v0`, in one file.

The method of the paper's follow-on (arXiv 2209.08381) as a baseline. It learns there from histories of place and
velocity; here an observation already has what a filter makes of them.

pip install 'shipland[rl,train]'
python examples/train_td3_batched.py --minutes 5 --out td3.onnx
shipland fly --pilot residual --set guidance.learned.residual=td3.onnx --scenario rig-natops --out out/td3
"""

import copy
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import torch
import tyro
from torch import Tensor, nn

import shipland.environments
from shipland.learning.policy.export import Dense, write_policy


@dataclass(frozen=True)
class Arguments:
    """Train.

    Attributes:
        minutes: of training.
        steps: of the batch of environments, at most.
        scenario: packaged name or TOML file.
        action: `residual` on the pilot `horizon`, or `direct` in its place.
        flights: at once.
        seed: of weights, exploration and flights.
        begin: steps of random actions before training begins.
        updates: of the critics for a step of the environments.
        batch: transitions an update.
        memory: transitions kept.
        discount: of rewards a step later.
        rate: of learning.
        exploration: standard deviation of the noise on actions.
        target_noise, target_clip: of the noise on the target's actions.
        delay: critic's updates for one of the actor's.
        share: by which the targets follow in an update.
        out: the policy as ONNX, for the pilots `residual` and `learned`; nothing is kept by default.
    """

    minutes: float = 5.0
    steps: int = 1_000_000
    scenario: str = "rig-natops"
    action: Literal["residual", "direct"] = "residual"
    flights: int = 64
    seed: int = 1
    begin: int = 100
    updates: int = 2
    batch: int = 512
    memory: int = 400_000
    discount: float = 0.99
    rate: float = 3e-4
    exploration: float = 0.1
    target_noise: float = 0.2
    target_clip: float = 0.5
    delay: int = 2
    share: float = 0.005
    out: Path | None = None


def network(inputs: int, outputs: int, *end: nn.Module) -> nn.Sequential:
    """Two hidden layers."""
    return nn.Sequential(nn.Linear(inputs, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, outputs), *end)


class Agent:
    """Actor, two critics, and their targets."""

    def __init__(self, observations: int, actions: int, arguments: Arguments) -> None:
        self.arguments, self.updates = arguments, 0
        self.actor = network(observations, actions, nn.Tanh())
        self.critics = nn.ModuleList(network(observations + actions, 1) for _ in range(2))
        self.actor_target, self.critics_target = copy.deepcopy(self.actor), copy.deepcopy(self.critics)
        self.actor_steps = torch.optim.Adam(self.actor.parameters(), lr=arguments.rate)
        self.critic_steps = torch.optim.Adam(self.critics.parameters(), lr=arguments.rate)

    def act(self, seen: np.ndarray) -> np.ndarray:
        """Without exploration."""
        with torch.no_grad():
            return self.actor(torch.from_numpy(seen)).numpy()

    def update(self, seen: Tensor, action: Tensor, reward: Tensor, after: Tensor, goes_on: Tensor) -> None:
        """One update of both critics and, every `delay`th time, of the actor and the targets."""
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


def main(arguments: Arguments) -> list[tuple[bool, float]]:
    """Train; of each flight that ended whether it landed in the square, and its offset from the bar's point [m]."""
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(arguments.seed)
    make = {"scenario": arguments.scenario, "action": arguments.action, "vectorization_mode": "vector_entry_point"}
    envs = gymnasium.make_vec(shipland.environments.LAST_PHASE, num_envs=arguments.flights, **make)
    observations, actions = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    agent = Agent(observations, actions, arguments)
    size = arguments.memory // arguments.flights * arguments.flights
    widths = (observations, actions, 1, observations, 1)  # observation, action, reward, the next one, goes on
    memory = [np.zeros((size, width), np.float32) for width in widths]
    ended: list[tuple[bool, float]] = []
    seen, _ = envs.reset(seed=arguments.seed)
    began = said = time.monotonic()
    for step in range(arguments.steps):
        if time.monotonic() - began > 60.0 * arguments.minutes:
            break
        if step < arguments.begin:
            action = rng.uniform(-1.0, 1.0, (arguments.flights, actions)).astype(np.float32)
        else:
            noise = arguments.exploration * rng.standard_normal((arguments.flights, actions))
            action = np.clip(agent.act(seen) + noise, -1.0, 1.0).astype(np.float32)
        after, reward, terminated, truncated, info = envs.step(action)
        # Of a flight that ended, `after` is the next one's first observation; its own last one is in `info`.
        last = np.where((terminated | truncated)[:, None], info.get("final_obs", after), after)
        first = step * arguments.flights % size
        row = (seen, action, reward[:, None], last, ~terminated[:, None])
        for column, value in zip(memory, row, strict=True):
            column[first : first + arguments.flights] = value
        seen = after
        if info:
            final, over = info["final_info"], np.flatnonzero(terminated | truncated)
            ended += [(bool(final["in_square"][i]), float(np.hypot(*final["own_m"][i]))) for i in over]
        if step >= arguments.begin:
            for _ in range(arguments.updates):
                rows = rng.integers(min(first + arguments.flights, size), size=arguments.batch)
                agent.update(*(torch.from_numpy(column[rows]) for column in memory))
        if time.monotonic() - said > 15.0 and ended:
            said, recent = time.monotonic(), np.array(ended[-500:], dtype=float)
            print(f"step {step + 1}, flights {len(ended)}: {100 * recent[:, 0].mean():.0f} % in the square", flush=True)
    envs.close()
    if arguments.out is not None:
        rows = [layer for layer in agent.actor if isinstance(layer, nn.Linear)]
        names = ("Relu", "Relu", "Tanh")
        dense = [Dense(r.weight.detach().numpy(), r.bias.detach().numpy(), n) for r, n in zip(rows, names, strict=True)]
        write_policy(arguments.out, dense, envs.unwrapped.action, "TD3, examples/train_td3_batched.py")
    return ended


if __name__ == "__main__":
    main(tyro.cli(Arguments))
