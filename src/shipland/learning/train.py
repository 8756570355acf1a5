"""`shipland train`: a detector from labelled pictures, on a CPU or a GPU; stops and goes on without losing anything.

Every random draw of step n comes from the generator seeded with (seed, n), so a run that was resumed equals one that
was not. The weights that are evaluated and shipped are the exponential moving average.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor

from shipland.errors import DataError
from shipland.learning.arguments import TrainArguments
from shipland.learning.augment import Loader, training_window, window
from shipland.learning.checkpoint import Progress as RunProgress
from shipland.learning.checkpoint import (
    load_checkpoint,
    optimizer_tensors,
    prefixed,
    restore_optimizer,
    save_checkpoint,
    with_prefix,
)
from shipland.learning.dataset import Dataset, Picture, Targets, read_dataset
from shipland.learning.loss import Anchors, detection_loss, fit_anchors
from shipland.learning.metrics import Tally
from shipland.learning.network import Network, load_weights
from shipland.learning.results import write_results
from shipland.learning.settings import TrainParameters, train_parameters
from shipland.learning.yolov3 import PUBLISHED_ANCHORS_PX, yolov3_layers
from shipland.vision.far.decode import Decoding, DetectorSpec, Float32, decode, suppress
from shipland.vision.far.detector import padded, weights_path

Floats = npt.NDArray[np.float64]
LAST, BEST = "last.safetensors", "best.safetensors"
LEAST_CONFIDENCE = 0.05
MAX_IOU = 0.45
ANCHOR_PICTURES = 3000
"""What anchors are fitted to, at most."""


@dataclass
class Run:
    """A training run in progress: what changes from step to step."""

    network: Network
    average: Network
    optimizer: torch.optim.Optimizer
    spec: DetectorSpec
    progress: RunProgress
    device: torch.device

    def save(self, path: Path) -> None:
        """Everything needed to go on."""
        tensors = {
            **prefixed("network", self.network.state_dict()),
            **prefixed("average", self.average.state_dict()),
            **prefixed("optimizer", optimizer_tensors(self.optimizer)),
        }
        save_checkpoint(path, tensors, self.spec, self.progress)


class TorchEngine:
    """A torch network behind the run-time interface, so that validation decodes as flight does."""

    def __init__(self, network: Network, spec: DetectorSpec, device: torch.device, bf16: bool) -> None:
        self.network, self.spec, self.device, self.bf16 = network, spec, device, bf16
        self.description = f"torch {device}"

    def maps(self, picture: Picture) -> list[Float32]:
        """Raw maps of one picture, finest scale first."""
        return self.maps_of([picture])[0]

    def maps_of(self, pictures: list[Picture]) -> list[list[Float32]]:
        """Raw maps of several pictures of one size."""
        with torch.no_grad(), autocast(self.device, self.bf16):
            maps = self.network(to_batch(pictures, self.device))
        return [[item[index].float().cpu().numpy() for item in maps] for index in range(len(pictures))]


def train(arguments: TrainArguments) -> Path:
    """Train, evaluate, export; the path of the detector's ONNX file.

    Raises:
        DataError: a data set, checkpoint or weights file is wrong.
        ConfigError: a setting is wrong.
    """
    if arguments.weights is not None and not arguments.weights.is_file():
        arguments = replace(arguments, weights=weights_path(str(arguments.weights), "fp32"))
    parameters = _parameters(arguments)
    torch.set_num_threads(max(1, arguments.threads))
    dataset = _datasets(arguments)
    fitting, held_out = dataset.split(parameters.held_out, arguments.seed)
    arguments.out.mkdir(parents=True, exist_ok=True)
    run = _start(arguments, parameters, fitting)
    with _progress() as bar:
        task = bar.add_task("training", total=parameters.steps, completed=run.progress.step, note="")
        for note in steps(run, parameters, fitting, held_out, arguments.out, arguments.seed):
            bar.update(task, completed=run.progress.step, note=note)
    best = arguments.out / BEST
    if not best.is_file():
        run.save(best)
    tensors, spec, progress = load_checkpoint(best)
    network = _network(spec)
    network.load_state_dict(with_prefix("average", tensors))
    return write_results(arguments, parameters, network, spec, progress, fitting, held_out)


def _parameters(arguments: TrainArguments) -> TrainParameters:
    parameters = train_parameters(arguments.profile, arguments.config)
    try:
        return replace(
            parameters,
            steps=parameters.steps if arguments.steps is None else arguments.steps,
            batch=parameters.batch if arguments.batch is None else arguments.batch,
            window_px=parameters.window_px if arguments.window_px is None else arguments.window_px,
            # A detector's file holds its normalisation folded into the kernels; there are no statistics to go on with.
            freeze_norm=parameters.freeze_norm
            or (arguments.weights is not None and arguments.weights.suffix == ".onnx"),
        )
    except ValueError as error:
        raise DataError(str(error)) from None


def _datasets(arguments: TrainArguments) -> Dataset:
    if not arguments.data:
        raise DataError("no data set given: name at least one folder with images/ and labels/")
    sets = [read_dataset(folder, arguments.classes) for folder in arguments.data]
    for item in sets[1:]:
        if item.classes != sets[0].classes:
            raise DataError(f"{item.folder} has classes {item.classes}, {sets[0].folder} has {sets[0].classes}")
    whole = Dataset(sets[0].folder, sets[0].classes, tuple(sample for item in sets for sample in item.samples))
    with _progress() as bar:
        task = bar.add_task("checking pictures", total=len(whole.samples), note="")
        for _ in whole.check_pictures():
            bar.advance(task)
    return whole


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        refresh_per_second=1,
    )


def _network(spec: DetectorSpec) -> Network:
    return Network(yolov3_layers(len(spec.classes), spec.width)).to(memory_format=torch.channels_last)  # type: ignore[no-any-return]


def _start(arguments: TrainArguments, parameters: TrainParameters, fitting: Dataset) -> Run:
    kind = arguments.device if arguments.device != "auto" else ("cuda" if torch.cuda.is_available() else "cpu")
    device = torch.device(kind)
    torch.manual_seed(arguments.seed)
    last = arguments.out / LAST
    if last.exists() and not arguments.resume:
        raise DataError(f"{last} is there already: give --resume to go on with it, or another folder")
    if arguments.resume:
        tensors, spec, progress = load_checkpoint(last)
    else:
        tensors, progress = {}, RunProgress()
        spec = _spec(arguments, parameters, fitting)
        if arguments.weights is not None:
            tensors = _initial(arguments.weights, spec)
    network, average = _network(spec).to(device), _network(spec).to(device)
    if "network" in {name.split(".")[0] for name in tensors}:
        network.load_state_dict(with_prefix("network", tensors))
    start = with_prefix("average", tensors)
    average.load_state_dict(start or network.state_dict())
    optimizer = torch.optim.AdamW(_groups(network, parameters.weight_decay), lr=parameters.learning_rate, fused=True)
    state = with_prefix("optimizer", tensors)
    if state:
        restore_optimizer(optimizer, state)
    return Run(network, average.eval(), optimizer, spec, progress, device)


def _spec(arguments: TrainArguments, parameters: TrainParameters, fitting: Dataset) -> DetectorSpec:
    anchors: Anchors = PUBLISHED_ANCHORS_PX
    if parameters.anchors == "fit":
        sizes = []
        order = np.random.default_rng(arguments.seed).permutation(len(fitting.samples))
        for sample in (fitting.samples[index] for index in order[:ANCHOR_PICTURES]):
            if len(sample.boxes) and parameters.augment.fit:
                sizes.append(sample.boxes[:, 3:5] * parameters.window_px)
            elif len(sample.boxes):
                sizes.append(sample.load()[1][:, 3:5])
        anchors = fit_anchors(np.concatenate(sizes) if sizes else np.zeros((0, 2)), arguments.seed)
    fit_px = parameters.window_px if parameters.augment.fit else 0
    return DetectorSpec(fitting.classes, anchors, parameters.decoding, arguments.width, fit_px=fit_px)


def _initial(path: Path, spec: DetectorSpec) -> dict[str, Tensor]:
    """Tensors to start from: another run's average, a detector's ONNX file, or Darknet's weights."""
    if path.suffix == ".weights":
        from shipland.learning.darknet import read_weights

        if spec.decoding is not Decoding.DARKNET:
            raise DataError(f"{path}: Darknet's weights need decoding = 'darknet' in [train]")
        network = _network(spec)
        load_weights(network, read_weights(path, network.layers))
        state = dict(network.state_dict())
    elif path.suffix == ".onnx":
        from shipland.learning.export import read_onnx

        network = _network(spec)
        load_weights(network, read_onnx(path, network.layers)[0])
        state = dict(network.state_dict())
    else:
        tensors, other, _ = load_checkpoint(path)
        if (other.width, len(other.classes)) != (spec.width, len(spec.classes)):
            raise DataError(f"checkpoint {path} has width {other.width:g} and {len(other.classes)} classes")
        state = with_prefix("average", tensors)
    return {**prefixed("network", state), **prefixed("average", state)}


def _groups(network: Network, decay: float) -> list[dict[str, object]]:
    """Kernels decay; shifts and scales do not."""
    kernels = [item for item in network.parameters() if item.ndim > 1]
    others = [item for item in network.parameters() if item.ndim <= 1]
    return [{"params": kernels, "weight_decay": decay}, {"params": others, "weight_decay": 0.0}]


def learning_rate(step: int, parameters: TrainParameters) -> float:
    """Linear warm-up, then a cosine down to 2 % of the peak."""
    if step < parameters.warmup_steps:
        return parameters.learning_rate * (step + 1) / parameters.warmup_steps
    through = min((step - parameters.warmup_steps) / max(parameters.steps - parameters.warmup_steps, 1), 1.0)
    return parameters.learning_rate * (0.02 + 0.49 * (1.0 + math.cos(math.pi * through)))


def steps(
    run: Run, parameters: TrainParameters, fitting: Dataset, held_out: Dataset, out: Path, seed: int
) -> Iterator[str]:
    """Train to the end or until patience runs out; yields a note after every step."""
    recent: Floats | None = None
    while run.progress.step < parameters.steps:
        step = run.progress.step
        rng = np.random.default_rng([seed, step])
        pictures, targets = draw_batch(fitting, run.progress.hard, parameters, rng)
        parts = _step(run, parameters, pictures, targets)
        if not np.isfinite(parts).all():
            raise DataError(f"training diverged at step {step}: lower learning_rate; {out / LAST} is whole")
        recent = parts if recent is None else 0.98 * recent + 0.02 * parts
        run.progress.step += 1
        done = run.progress.step
        if parameters.mine_every and done % parameters.mine_every == 0 and done < parameters.steps:
            run.progress.hard = mine(run, parameters, fitting, np.random.default_rng([seed, done, 1]))
        if done % parameters.evaluate_every == 0 or done == parameters.steps:
            _evaluate(run, parameters, held_out, recent, out)
            if run.progress.since_best >= parameters.patience:
                yield "stopped early"
                return
        yield f"loss {recent.sum():.3f}  best {max(run.progress.best, 0.0):.3f}"


def draw_batch(
    dataset: Dataset, hard: list[int], parameters: TrainParameters, rng: np.random.Generator
) -> tuple[list[Picture], Targets]:
    """Windows of one step and their targets (m,6) rows (picture, class, centre, size) [px]."""

    def source(indices: list[int] | None) -> Loader:
        def draw(rng: np.random.Generator) -> tuple[Picture, Targets]:
            index = int(rng.integers(len(dataset.samples))) if indices is None else int(rng.choice(indices))
            return dataset.samples[index].load()

        return draw

    pictures, rows = [], []
    for number in range(parameters.batch):
        use_hard = bool(hard) and rng.random() < parameters.hard_fraction
        picture, targets = training_window(
            source(hard if use_hard else None), parameters.window_px, parameters.augment, rng
        )
        pictures.append(picture)
        rows.append(np.column_stack([np.full(len(targets), number, np.float32), targets]))
    return pictures, np.concatenate(rows).astype(np.float32)


def to_batch(pictures: list[Picture], device: torch.device) -> Tensor:
    """Pictures as the network takes them: (n,3,h,w), 0 … 1, channels last in memory."""
    batch = torch.from_numpy(np.stack(pictures)).to(device, non_blocking=True)
    return batch.permute(0, 3, 1, 2).float().div_(255.0)


def autocast(device: torch.device, bf16: bool) -> contextlib.AbstractContextManager[object]:
    """Arithmetic in bf16, or as it stands."""
    return torch.autocast(device.type, dtype=torch.bfloat16) if bf16 else contextlib.nullcontext()


def _step(run: Run, parameters: TrainParameters, pictures: list[Picture], targets: Targets) -> Floats:
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(run.progress.step, parameters)
    run.network.train(not parameters.freeze_norm)  # nothing but the normalisation tells the two apart
    with autocast(run.device, parameters.bf16):
        maps = run.network(to_batch(pictures, run.device))
    total, parts = detection_loss(maps, torch.from_numpy(targets).to(run.device), run.spec, parameters.loss)
    run.optimizer.zero_grad(set_to_none=True)
    total.backward()
    torch.nn.utils.clip_grad_norm_(run.network.parameters(), parameters.clip_norm)
    run.optimizer.step()
    # Short memory at first, or the average would hold on to the random start.
    decay = min(parameters.average_decay, (1.0 + run.progress.step) / (10.0 + run.progress.step))
    with torch.no_grad():
        for mine, theirs in zip(run.average.state_dict().values(), run.network.state_dict().values(), strict=True):
            if mine.dtype.is_floating_point:
                mine.lerp_(theirs, 1.0 - decay)
            else:
                mine.copy_(theirs)
    return np.asarray(parts.cpu().numpy(), np.float64)


def mine(run: Run, parameters: TrainParameters, dataset: Dataset, rng: np.random.Generator) -> list[int]:
    """Indices of the pictures that fool the detector most: sure boxes where there is nothing, or missed targets."""
    engine = TorchEngine(run.average, run.spec, run.device, parameters.bf16)
    plain = replace(parameters.augment, scale_min=1.0, scale_max=1.0)
    count = min(parameters.mine_pictures, len(dataset.samples))
    chosen = rng.choice(len(dataset.samples), size=count, replace=False)
    scores = np.zeros(count)
    side = parameters.window_px
    for start in range(0, count, parameters.batch):
        part = chosen[start : start + parameters.batch]
        loaded = [dataset.samples[index].load() for index in part]
        cut = [window(picture, targets, (side, side), plain, rng) for picture, targets in loaded]
        for offset, maps in enumerate(engine.maps_of([picture for picture, _ in cut])):
            tally = Tally(parameters.match_iou)
            found, confidence, _ = suppress(*decode(maps, run.spec, LEAST_CONFIDENCE), MAX_IOU, merge=True)
            tally.add(found, confidence, cut[offset][1])
            missed = 1.0 - tally.surest_hit() if tally.targets else 0.0
            scores[start + offset] = max(tally.surest_false(), missed)
    worst = np.argsort(-scores, kind="stable")[: parameters.mine_keep]
    return [int(chosen[index]) for index in worst if scores[index] > LEAST_CONFIDENCE]


def _evaluate(
    run: Run,
    parameters: TrainParameters,
    held_out: Dataset,
    recent: Floats,
    out: Path,
) -> None:
    tally = validate(TorchEngine(run.average, run.spec, run.device, parameters.bf16), parameters, held_out)
    score = tally.average_precision()
    progress = run.progress
    progress.history.append(
        {
            "step": float(progress.step),
            "box_loss": float(recent[0]),
            "objectness_loss": float(recent[1]),
            "class_loss": float(recent[2]),
            "average_precision": score,
            "recall": tally.recall(0.5),
            "learning_rate": learning_rate(progress.step - 1, parameters),
            "hard_pictures": float(len(progress.hard)),
        }
    )
    better = score > progress.best
    progress.best, progress.since_best = (score, 0) if better else (progress.best, progress.since_best + 1)
    run.save(out / LAST)
    if better:
        run.save(out / BEST)


def validate(engine: TorchEngine, parameters: TrainParameters, held_out: Dataset) -> Tally:
    """Tally over held-out pictures at their own size (or fitted to the window, as in training)."""
    tally = Tally(parameters.match_iou)
    rng = np.random.default_rng(0)
    whole = replace(parameters.augment, scale_min=1.0, scale_max=1.0, on_target=0.0)
    side = (parameters.window_px, parameters.window_px)
    for sample in held_out.samples[: parameters.validation_pictures]:
        picture, targets = sample.load()
        if parameters.augment.fit:
            picture, targets = window(picture, targets, side, whole, rng)
        maps = engine.maps(padded(picture))
        boxes, scores, _ = suppress(*decode(maps, engine.spec, LEAST_CONFIDENCE), MAX_IOU, merge=True)
        tally.add(boxes, scores, targets)
    return tally
