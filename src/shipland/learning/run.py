"""A training run in progress: one step after the other, rounds of what fools the detector, validation, checkpoints."""

from __future__ import annotations

import contextlib
import itertools
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from shipland.errors import DataError
from shipland.learning.arguments import TrainArguments
from shipland.learning.checkpoint import Progress, optimizer_tensors, save_checkpoint
from shipland.learning.dataset import Dataset, Targets
from shipland.learning.export import write_onnx
from shipland.learning.looks import LEAST_CONFIDENCE
from shipland.learning.loss import detection_loss
from shipland.learning.metrics import Tally, match
from shipland.learning.network import Network, weights_of
from shipland.learning.settings import TrainParameters
from shipland.learning.split import Split
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
    """A training run; `average`, the moving average of the network's weights, is evaluated and shipped."""

    arguments: TrainArguments
    parameters: TrainParameters
    parts: Split
    device: torch.device
    network: Network
    average: Network
    optimizer: torch.optim.Optimizer
    spec: DetectorSpec
    progress: Progress

    @property
    def done(self) -> float:
        """How much of the run is done, 0 … 1: by steps, or by time where that is scarcer."""
        minutes = self.arguments.minutes
        spent = self.progress.seconds / (60.0 * minutes) if minutes else 0.0
        return min(max(self.progress.step / self.parameters.steps, spent), 1.0)

    @property
    def validation(self) -> Dataset:
        """The held-out pictures that an evaluation looks at."""
        samples = self.parts.held_out.samples
        return replace(self.parts.held_out, samples=samples[:: -(-len(samples) // self.parameters.validation_pictures)])

    @property
    def detector(self) -> Path:
        """The detector's file."""
        return self.arguments.out / "detector.onnx"

    def save(self, path: Path) -> None:
        """Everything needed to go on."""
        tensors = {"network": self.network.state_dict(), "average": self.average.state_dict()}
        tensors["optimizer"] = optimizer_tensors(self.optimizer)
        save_checkpoint(path, tensors, self.spec, self.progress)

    def write_detector(self) -> None:
        """Write the average as the detector; its spec notes steps and pictures."""
        write_onnx(self.detector, self.average.layers, weights_of(self.average), self.noted_spec)

    @property
    def noted_spec(self) -> DetectorSpec:
        """The spec with a note of how many steps and pictures the detector was trained on."""
        pictures = len(self.parts.fitting.samples)
        return replace(self.spec, note=f"shipland train, step {self.progress.step}, {pictures} pictures")

    def maps_of(self, pictures: list[Picture]) -> list[list[Float32]]:
        """Raw maps, finest scale first, that the average makes of pictures of one size."""
        with torch.no_grad(), self.autocast():
            maps = [item.float().cpu().numpy() for item in self.average(to_batch(pictures, self.device))]
        return [[item[index] for item in maps] for index in range(len(pictures))]

    def autocast(self) -> contextlib.AbstractContextManager[object]:
        """Arithmetic in bf16, or as it stands."""
        bf16 = self.parameters.bf16
        return torch.autocast(self.device.type, dtype=torch.bfloat16) if bf16 else contextlib.nullcontext()


def learning_rate(step: int, done: float, parameters: TrainParameters) -> float:
    """Linear warm-up in steps, and a cosine down to 2 % of the peak over `done`, 0 … 1."""
    warm = min((step + 1) / max(parameters.warmup_steps, 1), 1.0)
    return parameters.learning_rate * warm * (0.02 + 0.49 * (1.0 + math.cos(math.pi * done)))


def steps(run: Run, windows: Windows) -> Iterator[str]:
    """Train to the end, until the time is up, or until patience runs out; yields a note after every step.

    Every draw is of the run's seed and the step's number.
    """
    progress, parameters, seed = run.progress, run.parameters, run.arguments.seed
    recent: Floats | None = None
    # Hard rounds are spread evenly over the run.
    rounds = int(run.done * (parameters.hard_rounds + 1))
    while (done := run.done) < 1.0:
        began = time.monotonic()
        rng = np.random.default_rng([seed, progress.step])
        parts = step(run, *windows.draw(progress.hard, rng), done)
        if not np.isfinite(parts).all():
            last = run.arguments.out / LAST
            raise DataError(f"training diverged at step {progress.step}: lower learning_rate; {last} is whole")
        recent = parts if recent is None else 0.98 * recent + 0.02 * parts
        progress.step += 1
        if progress.step % LOSS_EVERY == 0 or run.done >= 1.0:
            progress.losses.append((float(progress.step), *recent.tolist()))
        progress.seconds += time.monotonic() - began
        if rounds < int(run.done * (parameters.hard_rounds + 1)) <= parameters.hard_rounds:
            began, rounds = time.monotonic(), int(run.done * (parameters.hard_rounds + 1))
            progress.hard = mine(run, windows, np.random.default_rng([seed, progress.step, 1]))
            progress.seconds += time.monotonic() - began
        if progress.step % parameters.evaluate_every == 0 or run.done >= 1.0:
            began = time.monotonic()
            _evaluate(run, recent, done)
            if progress.since_best >= parameters.patience:
                yield "stopped early"
                return
            progress.seconds += time.monotonic() - began
        yield f"loss {recent.sum():.3f}, best average precision at IoU {parameters.match_iou:g} " + (
            f"{progress.best:.3f}" if progress.best >= 0.0 else "not yet known"
        )


def step(run: Run, pictures: Tensor, targets: Tensor, done: float) -> Floats:
    """One step of the optimiser and of the average; the loss's parts."""
    parameters = run.parameters
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(run.progress.step, done, parameters)
    run.network.train(not parameters.freeze_norm)  # nothing but the normalisation tells the two apart
    with run.autocast():
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


def look(run: Run, pictures: Iterable[tuple[Picture, Targets]]) -> Iterator[tuple[Float32, Float32, Targets]]:
    """Boxes (n,4), their confidences (n,) and the targets of pictures, in order; those of one size go in batches."""
    for (height, width, _), same in itertools.groupby(pictures, lambda pair: pair[0].shape):
        while batch := list(itertools.islice(same, max(LOOK_PIXELS // (height * width), 1))):
            found = run.maps_of([padded(picture) for picture, _ in batch])
            for maps, (_, targets) in zip(found, batch, strict=True):
                boxes, scores, _ = suppress(*decode(maps, run.spec, LEAST_CONFIDENCE), MAX_IOU, merge=True)
                yield boxes, scores, targets


def mine(run: Run, windows: Windows, rng: np.random.Generator) -> list[HardPoint]:
    """Places that fool the detector most: sure boxes where there is nothing, and targets that it misses."""
    parameters, count = run.parameters, len(windows.dataset.samples)
    # In the set's order: pictures of one size lie together.
    chosen = np.sort(rng.choice(count, size=min(parameters.mine_pictures, count), replace=False)).tolist()
    found: list[tuple[float, HardPoint]] = []
    looked = look(run, map(windows.load, chosen))
    for index, (boxes, scores, targets) in zip(chosen, looked, strict=True):
        verdict = match(boxes, scores, targets, parameters.match_iou)
        for box, score in zip(boxes[verdict == -1], scores[verdict == -1], strict=True):
            found.append((float(score), (index, float(box[0]), float(box[1]))))
        for number, target in enumerate(targets):
            if target[0] >= 0.0 and target[3:5].max() >= parameters.augment.min_side_px:
                sure = float(scores[verdict == number].max(initial=0.0))
                found.append((1.0 - sure, (index, float(target[1]), float(target[2]))))
    worst = sorted(found, key=lambda item: -item[0])[: parameters.mine_keep]
    return [point for score, point in worst if score > 0.1]


def validate(run: Run) -> Tally:
    """Tally over held-out pictures at their own size (or fitted to the window, as in training)."""
    tally = Tally(run.parameters.match_iou)
    for looked in look(run, (sample.load(run.parameters.fit_px) for sample in run.validation.samples)):
        tally.add(*looked)
    return tally


def _evaluate(run: Run, recent: Floats, done: float) -> None:
    """Validate and save; the best so far is written as the detector too."""
    tally = validate(run)
    score = tally.average_precision()
    progress, rate = run.progress, learning_rate(run.progress.step - 1, done, run.parameters)
    losses = dict(zip(("box_loss", "objectness_loss", "class_loss"), recent.tolist(), strict=True))
    scores = {"average_precision": score, "recall": tally.recall(0.5), "learning_rate": rate}
    row = {"step": float(progress.step)} | losses | scores | {"hard_places": float(len(progress.hard))}
    progress.history.append(row)
    better = score > progress.best
    progress.best, progress.since_best = (score, 0) if better else (progress.best, progress.since_best + 1)
    if better:
        run.save(run.arguments.out / BEST)
    run.save(run.arguments.out / LAST)  # after the best, or a run stopped in between would believe that it has it
    if better:
        run.write_detector()
