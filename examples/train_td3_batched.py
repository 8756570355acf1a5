"""TD3 (Fujimoto et al. 2018) on many landings at once in `shipland/LastPhase-v0`; the agent is `train_td3.py`'s.

The method of the paper's follow-on (arXiv 2209.08381) as a baseline. It learns there from histories of place and
velocity; here an observation already has what a filter makes of them.

pip install 'shipland[rl,train]'
python examples/train_td3_batched.py --minutes 5 --out td3.onnx
shipland fly --pilot residual --set guidance.learned.residual=td3.onnx --scenario rig-natops --out out/td3
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import torch
import tyro
from torch import nn
from train_td3 import Agent

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


def main(arguments: Arguments) -> list[tuple[bool, float]]:
    """Train; of each flight that ended whether it landed in the square, and its offset from the bar's point [m]."""
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(arguments.seed)
    make = {"scenario": arguments.scenario, "action": arguments.action, "vectorization_mode": "vector_entry_point"}
    envs = gymnasium.make_vec(shipland.environments.LAST_PHASE, num_envs=arguments.flights, **make)
    observations, actions = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    agent = Agent(observations, actions, arguments, hidden=64)
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
