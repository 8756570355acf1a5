"""A training run in progress: one step after the other, rounds of what fools the detector, validation, checkpoints."""

from __future__ import annotations

import contextlib
import itertools
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from shipland.errors import DataError
from shipland.learning.checkpoint import Progress, optimizer_tensors, save_checkpoint
from shipland.learning.dataset import Dataset, Targets
from shipland.learning.looks import LEAST_CONFIDENCE
from shipland.learning.loss import detection_loss
from shipland.learning.metrics import Tally
from shipland.learning.network import Network
from shipland.learning.results import write_detector
from shipland.learning.settings import TrainParameters
from shipland.learning.windows import HardPoint, Windows, to_batch
from shipland.vision.far.decode import DetectorSpec, Float32, decode, suppress
from shipland.vision.far.detector import padded
from shipland.vision.pictures import Picture

Floats = npt.NDArray[np.float64]
LAST, BEST = "last.safetensors", "best.safetensors"
LOSS_EVERY = 10
"""Steps between points of the loss's curve."""
MAX_IOU = 0.45
LOOK_PIXELS = 8 * 1280 * 736
"""How many pixels are looked at in one batch."""


@dataclass
class Run:
    """What changes from step to step."""

    network: Network
    average: Network
    optimizer: torch.optim.Optimizer
    spec: DetectorSpec
    progress: Progress
    device: torch.device

    def save(self, path: Path) -> None:
        """Everything needed to go on."""
        tensors = {"network": self.network.state_dict(), "average": self.average.state_dict()}
        tensors["optimizer"] = optimizer_tensors(self.optimizer)
        save_checkpoint(path, tensors, self.spec, self.progress)

    def maps_of(self, pictures: list[Picture], bf16: bool) -> list[list[Float32]]:
        """Raw maps, finest scale first, that the average makes of pictures of one size."""
        with torch.no_grad(), autocast(self.device, bf16):
            maps = [item.float().cpu().numpy() for item in self.average(to_batch(pictures, self.device))]
        return [[item[index] for item in maps] for index in range(len(pictures))]


def autocast(device: torch.device, bf16: bool) -> contextlib.AbstractContextManager[object]:
    """Arithmetic in bf16, or as it stands."""
    return torch.autocast(device.type, dtype=torch.bfloat16) if bf16 else contextlib.nullcontext()


def through(progress: Progress, parameters: TrainParameters, minutes: float | None) -> float:
    """How much of the run is done, 0 … 1: by steps, or by time where that is scarcer."""
    spent = progress.seconds / (60.0 * minutes) if minutes else 0.0
    return min(max(progress.step / parameters.steps, spent), 1.0)


def learning_rate(step: int, done: float, parameters: TrainParameters) -> float:
    """Linear warm-up in steps, and a cosine down to 2 % of the peak over `done`, 0 … 1."""
    warm = min((step + 1) / max(parameters.warmup_steps, 1), 1.0)
    return parameters.learning_rate * warm * (0.02 + 0.49 * (1.0 + math.cos(math.pi * done)))


def steps(
    run: Run,
    parameters: TrainParameters,
    windows: Windows,
    sets: tuple[Dataset, Dataset],
    out: Path,
    seed: int,
    minutes: float | None = None,
) -> Iterator[str]:
    """Train to the end, until the time is up, or until patience runs out; yields a note after every step.

    `sets` are the pictures to train on and those held out; every draw is of `seed` and the step's number.
    """
    fitting, held_out = sets
    recent: Floats | None = None
    progress, part = run.progress, partial(through, run.progress, parameters, minutes)
    # Hard rounds are spread evenly over the run.
    rounds = int(part() * (parameters.hard_rounds + 1))
    while (done := part()) < 1.0:
        began = time.monotonic()
        rng = np.random.default_rng([seed, progress.step])
        parts = step(run, parameters, *windows.draw(progress.hard, rng), done)
        if not np.isfinite(parts).all():
            raise DataError(f"training diverged at step {progress.step}: lower learning_rate; {out / LAST} is whole")
        recent = parts if recent is None else 0.98 * recent + 0.02 * parts
        progress.step += 1
        if progress.step % LOSS_EVERY == 0 or part() >= 1.0:
            progress.losses.append((float(progress.step), *recent.tolist()))
        progress.seconds += time.monotonic() - began
        if rounds < int(part() * (parameters.hard_rounds + 1)) <= parameters.hard_rounds:
            began, rounds = time.monotonic(), int(part() * (parameters.hard_rounds + 1))
            number = np.random.default_rng([seed, progress.step, 1])
            progress.hard = mine(run, parameters, windows, len(fitting.samples), number)
            progress.seconds += time.monotonic() - began
        if progress.step % parameters.evaluate_every == 0 or part() >= 1.0:
            began = time.monotonic()
            if _evaluate(run, parameters, held_out, recent, done, out):
                write_detector(out, run.average, run.spec, progress.step, len(fitting.samples))
            if progress.since_best >= parameters.patience:
                yield "stopped early"
                return
            progress.seconds += time.monotonic() - began
        yield f"loss {recent.sum():.3f}, best average precision at IoU {parameters.match_iou:g} " + (
            f"{progress.best:.3f}" if progress.best >= 0.0 else "not yet known"
        )


def step(run: Run, parameters: TrainParameters, pictures: Tensor, targets: Tensor, done: float) -> Floats:
    """One step of the optimiser and of the average; the loss's parts."""
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(run.progress.step, done, parameters)
    run.network.train(not parameters.freeze_norm)  # nothing but the normalisation tells the two apart
    with autocast(run.device, parameters.bf16):
        maps = run.network(pictures)
    total, parts = detection_loss(maps, targets, run.spec, parameters.loss)
    run.optimizer.zero_grad(set_to_none=True)
    total.backward()
    torch.nn.utils.clip_grad_norm_(run.network.parameters(), parameters.clip_norm)
    run.optimizer.step()
    # Short memory at first, or the average would hold on to the random start.
    decay = min(parameters.average_decay, (1.0 + run.progress.step) / (10.0 + run.progress.step))
    with torch.no_grad():
        pairs = list(zip(run.average.state_dict().values(), run.network.state_dict().values(), strict=True))
        averages, trained = zip(*(pair for pair in pairs if pair[0].dtype.is_floating_point), strict=True)
        torch._foreach_lerp_(list(averages), list(trained), 1.0 - decay)
        for averaged, counted in pairs:
            if not averaged.dtype.is_floating_point:
                averaged.copy_(counted)
    return np.asarray(parts.cpu().numpy(), np.float64)


def look(
    run: Run, parameters: TrainParameters, pictures: Iterable[tuple[Picture, Targets]]
) -> Iterator[tuple[Float32, Float32, Targets]]:
    """Boxes (n,4), their confidences (n,) and the targets of pictures, in order; those of one size go in batches."""
    for (height, width, _), same in itertools.groupby(pictures, lambda pair: pair[0].shape):
        while batch := list(itertools.islice(same, max(LOOK_PIXELS // (height * width), 1))):
            found = run.maps_of([padded(picture) for picture, _ in batch], parameters.bf16)
            for maps, (_, targets) in zip(found, batch, strict=True):
                boxes, scores, _ = suppress(*decode(maps, run.spec, LEAST_CONFIDENCE), MAX_IOU, merge=True)
                yield boxes, scores, targets


def mine(
    run: Run, parameters: TrainParameters, windows: Windows, count: int, rng: np.random.Generator
) -> list[HardPoint]:
    """Places that fool the detector most: sure boxes where there is nothing, and targets that it misses."""
    # In the set's order: pictures of one size lie together.
    chosen = np.sort(rng.choice(count, size=min(parameters.mine_pictures, count), replace=False)).tolist()
    found: list[tuple[float, HardPoint]] = []
    looked = look(run, parameters, map(windows.load, chosen))
    for index, (boxes, scores, targets) in zip(chosen, looked, strict=True):
        tally = Tally(parameters.match_iou)
        verdict = tally.add(boxes, scores, targets)
        for box, score in zip(boxes[verdict == -1], scores[verdict == -1], strict=True):
            found.append((float(score), (index, float(box[0]), float(box[1]))))
        for number, target in enumerate(targets):
            if target[0] >= 0.0 and target[3:5].max() >= parameters.augment.min_side_px:
                sure = float(scores[verdict == number].max(initial=0.0))
                found.append((1.0 - sure, (index, float(target[1]), float(target[2]))))
    worst = sorted(found, key=lambda item: -item[0])[: parameters.mine_keep]
    return [point for score, point in worst if score > 0.1]


def validate(run: Run, parameters: TrainParameters, held_out: Dataset) -> Tally:
    """Tally over held-out pictures at their own size (or fitted to the window, as in training)."""
    tally = Tally(parameters.match_iou)
    samples = held_out.samples[:: -(-len(held_out.samples) // parameters.validation_pictures)]
    for boxes, scores, targets in look(run, parameters, (sample.load(parameters.fit_px) for sample in samples)):
        tally.add(boxes, scores, targets)
    return tally


def _evaluate(run: Run, parameters: TrainParameters, held_out: Dataset, recent: Floats, done: float, out: Path) -> bool:
    """Validate and save; whether this is the best so far."""
    tally = validate(run, parameters, held_out)
    score = tally.average_precision()
    progress, rate = run.progress, learning_rate(run.progress.step - 1, done, parameters)
    losses = dict(zip(("box_loss", "objectness_loss", "class_loss"), recent.tolist(), strict=True))
    scores = {"average_precision": score, "recall": tally.recall(0.5), "learning_rate": rate}
    row = {"step": float(progress.step)} | losses | scores | {"hard_places": float(len(progress.hard))}
    progress.history.append(row)
    better = score > progress.best
    progress.best, progress.since_best = (score, 0) if better else (progress.best, progress.since_best + 1)
    if better:
        run.save(out / BEST)
    run.save(out / LAST)  # after the best, or a run stopped in between would believe that it has it
    return better
