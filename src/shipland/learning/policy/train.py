"""`shipland learn`: trains the agent in `shipland/LastPhase-v0`; stopped and resumed with all it has learned."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import onnx  # noqa: F401 - for the end: better missed before training than after
import safetensors  # noqa: F401 - likewise
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

from shipland.errors import DataError
from shipland.guidance.horizon.steering import REACH_M, Action
from shipland.learning.policy.agent import Progress, Run, dense_of
from shipland.learning.policy.arguments import LearnArguments
from shipland.learning.policy.results import write_results
from shipland.learning.progress import followed

EnvMaker = Callable[[], gymnasium.Env[Any, Any]]

LAST = "last.safetensors"
CHUNK = 1_000
"""Steps between two looks at the run."""
FROZEN = 20_000
"""Steps until the actor learns too: a critic that knows nothing would only spoil it."""
WINDOW = 200
"""Flights whose mean return judges a policy."""
_FIRST_SEED = 1_000_000
"""Seeds below are for evaluation."""


def learn(arguments: LearnArguments, makers: Sequence[EnvMaker]) -> Path:
    """Train until the steps or the time are used up or Ctrl-C comes, export; the path of the policy's ONNX file.

    Args:
        arguments: of the command.
        makers: of the environments, `shipland/LastPhase-v0`.

    Raises:
        DataError: a checkpoint is wrong, or one is there that would be written over.
    """
    torch.set_num_threads(1)
    arguments.out.mkdir(parents=True, exist_ok=True)
    envs = vector_of(makers, parallel=arguments.parallel)
    try:
        run = _start(arguments, envs)
        total = math.ceil((arguments.steps or arguments.minutes * 60.0) / (CHUNK if arguments.steps else 1.0))
        try:
            for _ in followed(_chunks(run, arguments), "training", total):
                pass
        except KeyboardInterrupt:
            print("stopped: the best policy so far is exported, --resume goes on")
        finally:
            run.save(arguments.out / LAST)
    finally:
        envs.close()
    progress = run.progress
    return write_results(
        arguments, dense_of(run.best), Action(arguments.kind, arguments.bound, REACH_M), vars(progress)
    )


def vector_of(makers: Sequence[EnvMaker], *, parallel: bool = False) -> VecEnv:
    """The environments as one, in this process or each in its own."""
    monitored = [partial(_monitored, maker, ignore_interrupt=parallel) for maker in makers]
    return SubprocVecEnv(monitored, "spawn") if parallel else DummyVecEnv(monitored)


def _monitored(maker: EnvMaker, *, ignore_interrupt: bool) -> gymnasium.Env[Any, Any]:
    if ignore_interrupt:  # Ctrl-C is the parent's to answer
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    env: gymnasium.Env[Any, Any] = Monitor(maker(), info_keywords=("is_success", "error_m"))
    return env


def _start(arguments: LearnArguments, envs: VecEnv) -> Run:
    last = arguments.out / LAST
    if last.exists() and not arguments.resume:
        raise DataError(f"{last} is there already: give --resume to go on with it, or another folder")
    names = ("kind", "scenario", "changes", "environments", "bound", "hidden", "seed")
    identity = {name: str(getattr(arguments, name)) for name in names}
    run = Run(arguments, envs)
    run.progress.run = identity
    if arguments.resume:
        run.load(last)
        for name, value in identity.items():
            begun = run.progress.run.get(name, value)
            if begun != value:
                raise DataError(f"{last} was begun with {name} {begun}, not {value}: resume with the same")
    seeds = np.random.default_rng((arguments.seed, run.progress.step))
    envs.seed(_FIRST_SEED + int(seeds.integers(2**30)))
    return run


class _Flights(BaseCallback):
    """Notes every flight that ends."""

    def __init__(self, progress: Progress) -> None:
        super().__init__()
        self._progress = progress

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                end = info["episode"]
                self._progress.flights.append((float(end["r"]), float(end["is_success"]), float(end["error_m"])))
                self._progress.flown += 1
        del self._progress.flights[:-WINDOW]
        return True


def _chunks(run: Run, arguments: LearnArguments) -> Iterator[str]:
    """Train; yields a note a second, or a chunk where the steps are given."""
    progress, agent = run.progress, run.agent
    said_s = 0
    while progress.seconds < 60.0 * arguments.minutes and progress.step < (arguments.steps or math.inf):
        began_s = time.monotonic()
        left = CHUNK if arguments.steps is None else min(CHUNK, arguments.steps - progress.step)
        agent.actor.requires_grad_(agent.num_timesteps >= FROZEN)
        agent.learn(left, _Flights(progress), reset_num_timesteps=False)
        run.average()
        progress.step, progress.updates = agent.num_timesteps, agent._n_updates
        progress.seconds += time.monotonic() - began_s
        note = _noted(run)
        seconds = 1 if arguments.steps else int(progress.seconds) - said_s
        said_s += seconds
        for _ in range(seconds):
            yield note


def _noted(run: Run) -> str:
    """Keep the chunk's row, and the actor where it is the best; a note."""
    progress = run.progress
    flights = np.array(progress.flights).reshape(-1, 3)
    mean = [float(np.mean(known)) if len(known := column[np.isfinite(column)]) else math.nan for column in flights.T]
    row = {"step": float(progress.step), "flights": float(progress.flown), "return": mean[0], "success": mean[1]}
    progress.history.append(row | {"error_m": mean[2]})
    if len(flights) == WINDOW and mean[0] > progress.best:
        progress.best, progress.best_step = mean[0], progress.step
        run.best = {name: value.clone() for name, value in run.averaged.items()}
    if progress.best_step == 0:
        run.best = {name: value.clone() for name, value in run.averaged.items()}
    share = f"{100.0 * mean[1]:.0f} % success in the last {len(flights)}, return {mean[0]:.2f}"
    return f"step {progress.step}, {progress.flown} flights; {share}, best {progress.best:.2f}"
