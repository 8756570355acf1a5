"""Trains PPO or SAC of stable-baselines3 in `shipland/Landing-v0`, beside the pilot alone on the same seeds.

pip install 'shipland[learn]'
python examples/train_sb3.py --algorithm ppo --steps 20000 --environments 4 --out out/ppo
python examples/train_sb3.py --algorithm sac --steps 10000 --out out/sac

Says first what a zero action scores, which is the pilot alone; then how far the training is; then what was learned.
Leaves agent.zip, normalise.pkl, curve.csv and curve.png in the folder.
"""

import csv
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import torch
import tyro
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv, VecNormalize

import shipland.environments

GAMMA = 0.97
"""Discount of a step: rewards count for about ten seconds ahead."""
RECENT = 50
"""Flights that the progress line and the curve average."""


@dataclass(frozen=True)
class Arguments:
    """Train, then compare.

    Attributes:
        algorithm: of stable-baselines3.
        steps: of training, of all environments; a landing is about 50.
        environments: that fly at once, each in a process of its own when there are several.
        scenario: packaged name or TOML file.
        hold_s: how long an action is flown [s].
        action: a residual on `pilot`, or the sticks.
        pilot: of the residual, and of the baseline.
        bound: of the residual, as a share of the full stick.
        seed: of weights, exploration and flights.
        flights: that the comparison flies, seeds from 1.
        out: folder, made when missing.
    """

    algorithm: Literal["ppo", "sac"] = "ppo"
    steps: int = 20_000
    environments: int = 1
    scenario: str = "near"
    hold_s: float = 0.3
    action: Literal["residual", "sticks"] = "residual"
    pilot: str = "horizon"
    bound: float = 0.2
    seed: int = 1
    flights: int = 10
    out: Path = Path("out/sb3")


@dataclass(frozen=True)
class Score:
    """What came of the comparison's flights."""

    landed: int
    flights: int
    mean_return: float

    def __str__(self) -> str:
        return f"{self.landed} of {self.flights} landed in the square, mean return {self.mean_return:.1f}"


class Held(gymnasium.Wrapper):
    """Flies an action for a while: the aircraft filters out what changes 30 times a second, exploration too."""

    def __init__(self, env: gymnasium.Env, hold_s: float) -> None:
        super().__init__(env)
        self._hold_s = hold_s

    def reset(self, **options):
        """Begin a flight."""
        observation, info = self.env.reset(**options)
        self._now_s = info["t_s"]
        return observation, info

    def step(self, action):
        """Cycles until it was held, their rewards added."""
        until_s, total, over = self._now_s + self._hold_s, 0.0, False
        while not over:
            observation, reward, terminated, truncated, info = self.env.step(action)
            total, self._now_s = total + float(reward), info["t_s"]
            over = terminated or truncated or self._now_s >= until_s
        return observation, total, terminated, truncated, info


def make_env(arguments: Arguments) -> gymnasium.Env:
    """One environment; its processes call this."""
    env = gymnasium.make(
        shipland.environments.LANDING,
        scenario=arguments.scenario,
        action=arguments.action,
        pilot=arguments.pilot,
        bound=arguments.bound,
        observation="flat",
    )
    return Monitor(Held(env, arguments.hold_s), info_keywords=("is_success",))


def make_envs(arguments: Arguments) -> VecNormalize:
    """All of them, with observations and rewards normalised by running means."""
    thunks = [partial(make_env, arguments) for _ in range(arguments.environments)]
    envs: VecEnv = DummyVecEnv(thunks) if len(thunks) == 1 else SubprocVecEnv(thunks, start_method="forkserver")
    envs.seed(arguments.seed)
    return VecNormalize(envs, clip_obs=5.0, gamma=GAMMA)


def make_agent(arguments: Arguments, envs: VecNormalize) -> BaseAlgorithm:
    """The algorithm; PPO explores a residual less than sticks."""
    if arguments.algorithm == "sac":
        return SAC("MlpPolicy", envs, gamma=GAMMA, learning_starts=300, seed=arguments.seed, device="cpu")
    policy = {"log_std_init": -1.0 if arguments.action == "residual" else -0.5}
    steps = 64 * max(1, min(256, arguments.steps // 4) // (64 * arguments.environments))  # whole batches
    return PPO(
        "MlpPolicy", envs, 1e-3, n_steps=steps, gamma=GAMMA, policy_kwargs=policy, seed=arguments.seed, device="cpu"
    )


def score(arguments: Arguments, act: Callable[[np.ndarray], np.ndarray]) -> Score:
    """Of a policy on the flights that training never sees: theirs are drawn from `seed`."""
    env = make_env(arguments)
    landed, returns = 0, []
    for seed in range(1, arguments.flights + 1):
        observation, info = env.reset(seed=seed)
        over, total = False, 0.0
        while not over:
            observation, reward, terminated, truncated, info = env.step(act(observation))
            over, total = terminated or truncated, total + float(reward)
        landed, returns = landed + bool(info["is_success"]), [*returns, total]
    env.close()
    return Score(landed, arguments.flights, float(np.mean(returns)))


class Progress(BaseCallback):
    """A line every ten seconds, and a row of the curve."""

    def __init__(self, steps: int) -> None:
        super().__init__()
        self._steps, self._begun_s = steps, time.monotonic()
        self._said_s = self._begun_s
        self._ended: list[tuple[float, bool]] = []
        self.curve: list[tuple[int, float, float]] = []

    def _on_step(self) -> bool:
        flights = [info["episode"] for info in self.locals["infos"] if "episode" in info]
        self._ended += [(flight["r"], bool(flight["is_success"])) for flight in flights]
        if time.monotonic() - self._said_s >= 10.0:
            self._say()
        return True

    def _on_training_end(self) -> None:
        self._say()

    def _say(self) -> None:
        self._said_s = time.monotonic()
        spent_s = self._said_s - self._begun_s
        rate = self.num_timesteps / spent_s
        left_min = max(0.0, self._steps - self.num_timesteps) / rate / 60.0
        words = f"{self.num_timesteps} of {self._steps} steps, {rate:.0f} a second, {left_min:.0f} min left"
        if self._ended:
            returns, landed = np.mean(self._ended[-RECENT:], axis=0)
            self.curve.append((self.num_timesteps, float(returns), float(landed)))
            words += f"; last {len(self._ended[-RECENT:])} flights: return {returns:.1f}, success {100 * landed:.0f} %"
        print(words, file=sys.stderr, flush=True)


def write_curve(curve: list[tuple[int, float, float]], baseline: Score, out: Path) -> None:
    """Numbers and picture: the return while exploring, beside the baseline's."""
    import matplotlib.pyplot as plt

    with (out / "curve.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("steps", "mean_return", "share_landed"), *curve])
    figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
    axes.plot(*list(zip(*curve, strict=True))[:2] if curve else ([], []), label="while training")
    axes.axhline(baseline.mean_return, color="black", ls=":", label="zero action, on the comparison's seeds")
    axes.set(xlabel="steps", ylabel=f"mean return of the last {RECENT} flights")
    axes.legend()
    figure.savefig(out / "curve.png", dpi=120)
    plt.close(figure)


def main(arguments: Arguments) -> dict[str, Score]:
    """What a zero action and the agent score."""
    torch.set_num_threads(1)
    arguments.out.mkdir(parents=True, exist_ok=True)
    probe = make_env(arguments)
    nothing = np.zeros(probe.action_space.shape, np.float32)
    probe.close()
    baseline = score(arguments, lambda _: nothing)
    print(f"zero action: {baseline}", flush=True)
    envs = make_envs(arguments)
    agent, progress = make_agent(arguments, envs), Progress(arguments.steps)
    agent.learn(arguments.steps, callback=progress)
    agent.save(arguments.out / "agent.zip")
    envs.save(str(arguments.out / "normalise.pkl"))
    write_curve(progress.curve, baseline, arguments.out)

    def act(observation: np.ndarray) -> np.ndarray:
        return agent.predict(envs.normalize_obs(observation[None]), deterministic=True)[0][0]

    learned = score(arguments, act)
    envs.close()
    print(f"{arguments.algorithm} after {agent.num_timesteps} steps: {learned}\nwritten: {arguments.out}")
    return {"zero action": baseline, "agent": learned}


if __name__ == "__main__":
    main(tyro.cli(Arguments))
