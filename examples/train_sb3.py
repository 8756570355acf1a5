"""Trains an agent of stable-baselines3 in `shipland/Landing-v0`, and flies it and a zero action on the same seeds.

pip install 'shipland[learn]'
python examples/train_sb3.py --steps 20000 --algorithm sac --action residual
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import tyro
from gymnasium.wrappers import NormalizeObservation
from stable_baselines3 import SAC, TD3
from stable_baselines3.common.monitor import Monitor

import shipland.environments


@dataclass(frozen=True)
class Arguments:
    """Train, then compare.

    Attributes:
        steps: of training; a landing is about 500.
        algorithm: of stable-baselines3.
        scenario: packaged name or TOML file.
        action: the sticks, or a residual on `pilot`.
        pilot: of the residual.
        bound: of the residual, as a share of the full stick.
        seed: of weights and exploration.
        flights: that the comparison flies, seeds from 1.
        out: where the policy is kept; nowhere by default.
    """

    steps: int = 20_000
    algorithm: Literal["sac", "td3"] = "sac"
    scenario: str = "near"
    action: Literal["sticks", "residual"] = "residual"
    pilot: str = "horizon"
    bound: float = 0.2
    seed: int = 1
    flights: int = 10
    out: Path | None = None


def successes(env: gymnasium.Env, act: Callable[[np.ndarray], np.ndarray], flights: int) -> int:
    """How many flights land in the square."""
    count = 0
    for seed in range(1, flights + 1):
        observation, info = env.reset(seed=seed)
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(act(observation))
            over = terminated or truncated
        count += info["is_success"]
    return count


def main(arguments: Arguments) -> dict[str, int]:
    """Landings in the square, by who flew."""
    env = gymnasium.make(
        shipland.environments.LANDING,
        scenario=arguments.scenario,
        action=arguments.action,
        pilot=arguments.pilot,
        bound=arguments.bound,
        observation="flat",
    )
    normalised = NormalizeObservation(env)
    kind = {"sac": SAC, "td3": TD3}[arguments.algorithm]
    agent = kind("MlpPolicy", Monitor(normalised), seed=arguments.seed, device="cpu", verbose=1)
    agent.learn(arguments.steps)
    if arguments.out is not None:
        agent.save(arguments.out)
    normalised.update_running_mean = False
    nothing = np.zeros(env.action_space.shape, np.float32)
    found = {
        "agent": successes(normalised, lambda seen: agent.predict(seen, deterministic=True)[0], arguments.flights),
        "zero action": successes(normalised, lambda _: nothing, arguments.flights),
    }
    env.close()
    for who, count in found.items():
        print(f"{who}: {count} of {arguments.flights} in the square")
    return found


if __name__ == "__main__":
    main(tyro.cli(Arguments))
