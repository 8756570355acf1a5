"""`shipland learn`: gradients through whole flights; stopped and resumed without loss.

Every draw of step n comes from seeds made of (seed, n), so a run that was resumed equals one that was not, as long as
no time limit sets its pace.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import onnx  # noqa: F401 - for the end: better missed before training than after
import safetensors  # noqa: F401 - likewise
import torch

from shipland.errors import DataError
from shipland.files import json_of
from shipland.guidance.horizon.steering import Action
from shipland.learning.checkpoint import (
    optimizer_tensors,
    prefixed,
    read_tensors,
    restore_optimizer,
    with_prefix,
    write_tensors,
)
from shipland.learning.policy.arguments import LearnArguments
from shipland.learning.policy.network import PolicyNetwork, seeded_network
from shipland.learning.policy.objective import Score, loss_of, score_of
from shipland.learning.policy.phase import NOTHING, LastPhase
from shipland.learning.policy.results import write_results
from shipland.learning.policy.setup import PhaseSetup, Randomisation
from shipland.learning.progress import followed

LAST, BEST = "last.safetensors", "best.safetensors"
FORMAT = "shipland-learn-1"
WINDOW_S = 3.5
"""That gradients go back over: about a descent."""
REACH_M = 1.5
"""Where policies steer."""
_START_M = (0.0, 1.5)
_SHIP_START_M = (0.5, 3.0)
"""At sea the estimate needs some seconds to know the wave motion."""
_EVALUATED, _TRAINED = 7, 11
"""Streams of seeds."""


@dataclass
class Progress:
    """Where a run stands.

    Attributes:
        step: optimiser steps done.
        seconds: time spent.
        best: least ratio of rms to the pilot's alone so far.
        history: one row an evaluation.
        run: what must stay the same when it is resumed.
    """

    step: int = 0
    seconds: float = 0.0
    best: float = math.inf
    history: list[dict[str, float]] = field(default_factory=list)
    run: dict[str, str] = field(default_factory=dict)


@dataclass
class Run:
    """What changes from step to step."""

    network: PolicyNetwork
    optimizer: torch.optim.Optimizer
    progress: Progress

    def save(self, path: Path) -> None:
        """Everything needed to go on."""
        tensors = {
            **prefixed("network", self.network.state_dict()),
            **prefixed("optimizer", optimizer_tensors(self.optimizer)),
        }
        write_tensors(path, tensors, {"format": FORMAT, "progress": json.dumps(vars(self.progress))})

    def load(self, path: Path) -> None:
        """What `save` wrote.

        Raises:
            DataError: it is missing, truncated or another file.
        """
        tensors, metadata = read_tensors(path, FORMAT, "learn")
        try:
            self.progress = Progress(**json_of(metadata["progress"]))
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"checkpoint {path} is damaged: its progress cannot be read: {error}") from None
        self.network.load_state_dict(with_prefix("network", tensors))
        state = with_prefix("optimizer", tensors)
        if state:
            restore_optimizer(self.optimizer, state)


def learn(arguments: LearnArguments, setups: Sequence[PhaseSetup]) -> Path:
    """Train, evaluate, export; the path of the policy's ONNX file.

    Args:
        arguments: of the command.
        setups: of its scenarios, in their order.

    Raises:
        DataError: a checkpoint is wrong, or one is there that would be written over.
    """
    torch.set_num_threads(1)
    arguments.out.mkdir(parents=True, exist_ok=True)
    run, action = _start(arguments), Action(arguments.kind, arguments.bound, REACH_M)
    phases = [_phase(arguments, setup, index) for index, setup in enumerate(setups)]
    try:
        work = _steps(run, arguments, phases, action)
        for _ in followed(work, "batch of flights", _most(arguments), run.progress.step):
            pass
    finally:
        run.save(arguments.out / LAST)
    best = arguments.out / BEST
    if not best.is_file():
        run.save(best)
    history, steps, seconds = run.progress.history, run.progress.step, run.progress.seconds
    run.load(best)
    return write_results(arguments, run.network, action, history, (run.progress.step, steps, seconds))


def _most(arguments: LearnArguments) -> int:
    return arguments.steps or 10_000


def _through(progress: Progress, arguments: LearnArguments) -> float:
    """How much of the run is done: by steps, or by time where that is scarcer."""
    return max(progress.step / _most(arguments), progress.seconds / (60.0 * arguments.minutes))


def _start(arguments: LearnArguments) -> Run:
    network = seeded_network(arguments.hidden, arguments.seed)
    optimizer = torch.optim.Adam(network.parameters(), lr=arguments.rate)
    last = arguments.out / LAST
    if last.exists() and not arguments.resume:
        raise DataError(f"{last} is there already: give --resume to go on with it, or another folder")
    identity = {
        "kind": arguments.kind,
        "scenario": ", ".join(arguments.scenario),
        "hidden": str(arguments.hidden),
        "seed": str(arguments.seed),
        "bound_mps2": f"{arguments.bound:g}",
    }
    run = Run(network, optimizer, Progress(run=identity))
    if arguments.resume:
        run.load(last)
        for name, value in identity.items():
            begun = run.progress.run.get(name, value)
            if begun != value:
                raise DataError(f"{last} was begun with {name} {begun}, not {value}: resume with the same")
    return run


def _phase(arguments: LearnArguments, setup: PhaseSetup, index: int) -> LastPhase:
    start_m = _SHIP_START_M if setup.ship.full_ship else _START_M
    random = Randomisation(arguments.airframe, arguments.latency_s, arguments.wind_mps, start_m, arguments.wake)
    return LastPhase(setup, random, seed=_seed(arguments.seed, 0, index))


def _seed(*numbers: int) -> int:
    return int(np.random.default_rng(numbers).integers(2**31))


def _steps(run: Run, arguments: LearnArguments, phases: Sequence[LastPhase], action: Action) -> Iterator[str]:
    """Train until the steps or the time are used up; yields a note after every step."""
    progress = run.progress
    cycles = [round(arguments.seconds / phase.setup.cycle_s) for phase in phases]
    alone = [
        score_of(phase, phase.draw(arguments.flights, _seed(arguments.seed, _EVALUATED, i)), None, NOTHING, cycles[i])
        for i, phase in enumerate(phases)
    ]
    note, losses = "not evaluated yet", list[float]()
    while (done := _through(progress, arguments)) < 1.0:
        began = time.monotonic()
        which = progress.step % len(phases)
        phase = phases[which]
        rng = np.random.default_rng((arguments.seed, _TRAINED, progress.step))
        window = round(WINDOW_S / phase.setup.cycle_s)
        begin = int(rng.integers(max(cycles[which] - window, 1)))
        batch = phase.draw(arguments.batch, int(rng.integers(2**31)))
        for group in run.optimizer.param_groups:
            group["lr"] = arguments.rate * (0.02 + 0.49 * (1.0 + math.cos(math.pi * done)))
        run.optimizer.zero_grad()
        loss, contacts = loss_of(phase, batch, run.network, action, begin, window)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(run.network.parameters(), 0.1)
        if contacts and bool(torch.isfinite(norm)):
            run.optimizer.step()
            losses.append(float(loss.detach()))
        progress.step += 1
        progress.seconds += time.monotonic() - began
        if progress.step % arguments.evaluate_every == 0 or _through(progress, arguments) >= 1.0:
            began = time.monotonic()
            note = _evaluate(run, arguments, phases, action, cycles, alone, losses)
            losses.clear()
            progress.seconds += time.monotonic() - began
        yield f"{100.0 * min(done, 1.0):.0f} % done; {note}"


def _evaluate(
    run: Run,
    arguments: LearnArguments,
    phases: Sequence[LastPhase],
    action: Action,
    cycles: Sequence[int],
    alone: Sequence[Score],
    losses: Sequence[float],
) -> str:
    """Fly the same flights with the policy as without; keep the run, and the best of it."""
    progress = run.progress
    row = {"step": float(progress.step), "loss": float(np.mean(losses)) if losses else math.nan}
    ratios = []
    for i, phase in enumerate(phases):
        batch = phase.draw(arguments.flights, _seed(arguments.seed, _EVALUATED, i))
        score = score_of(phase, batch, run.network, action, cycles[i])
        name = arguments.scenario[i]
        row |= {f"{name} rms": score.rms_all_m, f"{name} alone": alone[i].rms_all_m, f"{name} down": score.touched}
        ratios.append(score.rms_all_m / alone[i].rms_all_m)
    ratio = float(np.mean(ratios))
    progress.history.append(row)
    if ratio < progress.best:
        progress.best = ratio
        run.save(arguments.out / BEST)
    run.save(arguments.out / LAST)
    return f"rms {ratio:.3f} of the pilot's alone, best {progress.best:.3f}"
