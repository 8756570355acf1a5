"""`shipland learn`: trains the agent in `shipland/LastPhase-v0`; stopped and resumed with all it has learned."""

from __future__ import annotations

import json
import math
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
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

from shipland.errors import ConfigError
from shipland.figures import drawn
from shipland.files import write_atomically, write_csv
from shipland.guidance.horizon.steering import REACH_M, Action
from shipland.learning.checkpoint import check_begun
from shipland.learning.policy.agent import Progress, Run, answer, dense_of
from shipland.learning.policy.arguments import LearnArguments
from shipland.learning.policy.export import write_policy
from shipland.progress import followed
from shipland.stopping import uninterrupted

History = Sequence[Mapping[str, float]]


def plot_curves(path: Path, history: History) -> None:
    """Return and success over the steps, as a picture."""
    with drawn(path, (9.0, 3.6), 110) as figure:
        left, right = figure.subplots(1, 2)
        step = [row["step"] for row in history]
        left.plot(step, [row["return"] for row in history], label="last training flights")
        evaluated = [(row["step"], row["evaluated"]) for row in history if math.isfinite(row["evaluated"])]
        left.plot([at for at, _ in evaluated], [value for _, value in evaluated], "o", label="evaluations")
        left.set(xlabel="step", ylabel="mean return")
        left.legend(frameon=False)
        right.plot(step, [100.0 * row["success"] for row in history])
        right.set(xlabel="step", ylabel="success [%]", ylim=(0.0, 100.0))


def _card(arguments: LearnArguments, action: Action, progress: Progress) -> str:
    settings = {name: value for name, value in asdict(arguments).items() if name not in ("out", "resume")}
    meaning = "added to the pilot's own input" if action.kind == "residual" else "the input itself"
    return (
        f"# Policy: {action.kind}\n\n"
        f"- Action: two accelerations of at most {action.bound_mps2:g} m/s², {meaning}; within "
        f"{action.reach_m:g} m of the landing point, on vehicles whose sticks mean a tilt\n"
        f"- Training: TD3 in the simulator, {progress.step} steps, {progress.flown} flights, "
        f"{progress.updates} updates in {progress.seconds / 60.0:.1f} minutes; these weights are of step "
        f"{progress.best_step}\n"
        f"- Settings: `{json.dumps(settings)}`\n"
        f"- Evaluation: mean return {progress.best:.2f} of {arguments.flights} flights; a campaign flies others\n"
    )


EnvMaker = Callable[[], gymnasium.Env[Any, Any]]

LAST = "last.safetensors"
CHUNK = 1_000
"""Steps between two looks at the run."""
FROZEN = 20_000
"""Steps until the actor learns too: a critic that knows nothing would only spoil it."""
EVALUATED = 50_000
"""Steps between evaluations."""
WINDOW = 200
"""Training flights whose means are shown."""
_FIRST_SEED, _EVALUATION_SEED = 1_000_000, 500_000
"""Training flies seeds from the first on, evaluations from the second on, campaigns from 1 on."""


def learn(arguments: LearnArguments, makers: Sequence[EnvMaker]) -> Path:
    """Train in `shipland/LastPhase-v0` until steps or time are used up or Ctrl-C comes; the policy's ONNX file.

    DataError where a checkpoint is wrong, or one is there that would be written over.
    """
    torch.set_num_threads(1)
    arguments.out.mkdir(parents=True, exist_ok=True)
    envs = vector_of(makers, parallel=arguments.parallel)
    try:
        run = _start(arguments, envs)
        if arguments.steps:
            total, done = math.ceil(arguments.steps / CHUNK), math.ceil(run.progress.step / CHUNK)
        else:
            total, done = math.ceil(60.0 * arguments.minutes), int(run.progress.seconds)
        try:
            for _ in followed(_chunks(run, arguments, makers), "training", total, done):
                pass
        except KeyboardInterrupt:
            print("stopped: the best policy so far is exported, --resume goes on")
        return _keep(run, arguments)
    finally:
        envs.close()


def _keep(run: Run, arguments: LearnArguments) -> Path:
    """Write checkpoint, policy, curves and card, whatever signals come; the path of the policy's ONNX file."""
    out, progress, action = arguments.out, run.progress, Action(arguments.kind, arguments.bound, REACH_M)
    note, policy = f"shipland learn, {arguments.kind}, step {progress.best_step}", out / "policy.onnx"
    with uninterrupted():
        run.save(out / LAST)
        write_policy(policy, dense_of(run.best), action, note)
        write_csv(out / "curves.csv", list(progress.history[0]) if progress.history else (), progress.history)
        plot_curves(out / "curves.png", progress.history)
        write_atomically(out / "model-card.md", _card(arguments, action, progress).encode())
    return policy


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
    check_begun(last, resume=arguments.resume)
    run = Run(arguments, envs)
    if arguments.resume:
        run.load(last)
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


def _chunks(run: Run, arguments: LearnArguments, makers: Sequence[EnvMaker]) -> Iterator[str]:
    """Train; yields a note a second, or a chunk where the steps are given."""
    progress, agent = run.progress, run.agent
    said_s = int(progress.seconds)
    while progress.seconds < 60.0 * arguments.minutes and progress.step < (arguments.steps or math.inf):
        began_s = time.monotonic()
        if math.isinf(progress.best):
            progress.best = _mean_return(run, makers, arguments.flights)
        left = CHUNK if arguments.steps is None else min(CHUNK, arguments.steps - progress.step)
        agent.actor.requires_grad_(agent.num_timesteps >= FROZEN)
        agent.learn(left, _Flights(progress), reset_num_timesteps=False)
        run.average()
        evaluated = progress.step // EVALUATED
        progress.step, progress.updates = agent.num_timesteps, agent._n_updates
        found = math.nan
        if progress.step // EVALUATED > evaluated:
            found = _evaluated(run, makers, arguments.flights)
            _keep(run, arguments)
        progress.seconds += time.monotonic() - began_s
        note = _noted(progress, found)
        seconds = 1 if arguments.steps else int(progress.seconds) - said_s
        said_s += seconds
        for _ in range(seconds):
            yield note
    if progress.history and math.isnan(progress.history[-1]["evaluated"]):  # what was learned since the last one
        progress.history[-1]["evaluated"] = _evaluated(run, makers, arguments.flights)


def _evaluated(run: Run, makers: Sequence[EnvMaker], flights: int) -> float:
    """Mean return of the averaged actor, which is kept where it is the best so far."""
    found, progress = _mean_return(run, makers, flights), run.progress
    if found > progress.best:
        progress.best, progress.best_step = found, progress.step
        run.best = dict(run.averaged)
    return found


def _mean_return(run: Run, makers: Sequence[EnvMaker], flights: int) -> float:
    """Of the averaged actor, which does not explore, always on the same flights."""
    layers, returns, envs = dense_of(run.averaged), list[float](), [maker() for maker in makers]
    for index in range(flights):
        env = envs[index % len(envs)]
        try:
            seen, _ = env.reset(seed=_EVALUATION_SEED + index)
        except ConfigError:
            continue  # over before an action is due, whoever acts
        over, total = False, 0.0
        while not over:
            seen, reward, terminated, truncated, _ = env.step(answer(layers, seen))
            over, total = terminated or truncated, total + float(reward)
        returns.append(total)
    return float(np.mean(returns)) if returns else math.nan


def _noted(progress: Progress, evaluated: float) -> str:
    """Keep the chunk's row; a note."""
    flights = np.array(progress.flights).reshape(-1, 3)
    mean = [float(np.mean(known)) if len(known := column[np.isfinite(column)]) else math.nan for column in flights.T]
    row = {"step": float(progress.step), "flights": float(progress.flown), "return": mean[0], "success": mean[1]}
    progress.history.append(row | {"error_m": mean[2], "evaluated": evaluated})
    share = f"{100.0 * mean[1]:.0f} % success in the last {len(flights)}, return {mean[0]:.2f}"
    kept = f"kept: step {progress.best_step}, return {progress.best:.2f} without exploration"
    return f"step {progress.step}, {progress.flown} flights; {share}; {kept}"
