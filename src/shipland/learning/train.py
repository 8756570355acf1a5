"""`shipland train`: a detector from labelled pictures, on a CPU or a GPU; stopped and resumed without loss.

Every random draw of step n comes from the generator seeded with (seed, n), so a run that was resumed equals one that
was not, as long as no time limit sets its pace. The weights that are evaluated and shipped are the exponential moving
average.
"""

from __future__ import annotations

import hashlib
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from shipland.errors import DataError
from shipland.learning.arguments import TrainArguments
from shipland.learning.checkpoint import (
    Progress,
    check_begun,
    check_resumable,
    load_checkpoint,
    restore_optimizer,
    save_checkpoint,
)
from shipland.learning.dataset import Dataset, read_dataset
from shipland.learning.export import read_onnx
from shipland.learning.loss import Anchors, fit_anchors
from shipland.learning.network import Network, load_weights
from shipland.learning.results import plot_curves, write_results
from shipland.learning.run import BEST, LAST, Run, steps
from shipland.learning.settings import TrainParameters, train_parameters
from shipland.learning.split import Split, split
from shipland.learning.windows import ResidentWindows, Windows, decoded_bytes
from shipland.learning.yolov3 import PUBLISHED_ANCHORS_PX, read_weights, yolov3_layers
from shipland.progress import followed
from shipland.vision.far.decode import Decoding, DetectorSpec
from shipland.vision.far.detector import weights_path
from shipland.vision.pictures import read_picture

AVERAGE = "average.safetensors"
"""The weights alone, for `--weights`."""
ANCHOR_PICTURES = 3000
"""What anchors are fitted to, at most."""
MOST_OF_MEMORY = 0.6
"""How much of a GPU's free memory a set may take."""


def train(arguments: TrainArguments) -> Run:
    """Train, evaluate, export; `detector.onnx` is the best so far from the first evaluation on.

    The run's average and progress are at the end those of its best evaluation.

    DataError or ConfigError where a data set, checkpoint, weights file or setting is wrong.
    """
    if arguments.weights is not None and not arguments.weights.is_file():
        arguments = replace(arguments, weights=weights_path(str(arguments.weights), "fp32"))
    parameters = _parameters(arguments)
    torch.set_num_threads(max(1, arguments.threads))
    dataset = _datasets(arguments)
    arguments.out.mkdir(parents=True, exist_ok=True)
    parts = split(dataset, parameters.held_out, arguments.seed)
    held_out = len(parts.held_out.samples)
    print(f"{held_out} of {len(dataset.samples)} pictures held out: {parts.how}", file=sys.stderr)
    if parts.warning:
        print(f"WARNING: {parts.warning}. Trust `shipland evaluate --data` on another day's pictures.", file=sys.stderr)
    run = _start(arguments, parameters, parts)
    windows = _windows(run)
    if not isinstance(windows, ResidentWindows):
        for sample in followed(dataset.samples, "checking pictures", len(dataset.samples)):
            read_picture(sample.path)  # better now than in the middle of the run
    work = steps(run, windows)
    try:
        for _ in followed(work, "training step", parameters.steps, run.progress.step, lambda: run.done):
            pass
    finally:
        plot_curves(run)
        if run.detector.is_file():
            print(f"best so far: {run.detector}", file=sys.stderr)
    best = arguments.out / BEST
    if not best.is_file():
        run.save(best)
    tensors, _, run.progress = load_checkpoint(best)
    average = tensors["average"]
    run.average.load_state_dict(average)
    save_checkpoint(arguments.out / AVERAGE, {"average": average}, run.spec, Progress(run=run.progress.run))
    write_results(run)
    return run


def _parameters(arguments: TrainArguments) -> TrainParameters:
    parameters = train_parameters(arguments.profile, arguments.config)
    asked = {name: getattr(arguments, name) for name in ("steps", "batch", "window_px")}
    # A detector's file holds its normalisation folded into the kernels; there are no statistics to go on with.
    folded = arguments.weights is not None and arguments.weights.suffix == ".onnx"
    try:
        given = {name: value for name, value in asked.items() if value is not None}
        return replace(parameters, **given, freeze_norm=parameters.freeze_norm or folded)
    except ValueError as error:
        raise DataError(str(error)) from None


def _datasets(arguments: TrainArguments) -> Dataset:
    if not arguments.data:
        raise DataError("no data set given: name at least one folder with images/ and labels/")
    folders = [folder.resolve() for folder in arguments.data]
    if twice := next((folder for folder in folders if folders.count(folder) > 1), None):
        raise DataError(f"--data names {twice} twice: its pictures would be both trained on and held out")
    sets = [read_dataset(folder, arguments.classes) for folder in arguments.data]
    for item in sets[1:]:
        if item.classes != sets[0].classes:
            raise DataError(f"{item.folder} has classes {item.classes}, {sets[0].folder} has {sets[0].classes}")
    return Dataset(sets[0].folder, sets[0].classes, tuple(sample for item in sets for sample in item.samples))


def _windows(run: Run) -> Windows:
    """Windows from the device's memory where it is a GPU and has room, else from disk."""
    arguments, parameters, fitting, device = run.arguments, run.parameters, run.parts.fitting, run.device
    resident = arguments.memory == "device"
    if arguments.memory == "auto" and device.type == "cuda":
        free, _ = torch.cuda.mem_get_info(device)
        resident = decoded_bytes(fitting) < MOST_OF_MEMORY * free
    if not resident:
        return Windows(fitting, parameters, device)
    return ResidentWindows(fitting, parameters, device, max(arguments.threads, os.cpu_count() or 1))


def _network(spec: DetectorSpec) -> Network:
    return Network(yolov3_layers(len(spec.classes), spec.width)).to(memory_format=torch.channels_last)  # type: ignore[no-any-return]


def _start(arguments: TrainArguments, parameters: TrainParameters, parts: Split) -> Run:
    kind = arguments.device if arguments.device != "auto" else ("cuda" if torch.cuda.is_available() else "cpu")
    device = torch.device(kind)
    torch.manual_seed(arguments.seed)
    torch.backends.cudnn.benchmark = device.type == "cuda"  # windows have one size
    last = arguments.out / LAST
    check_begun(last, resume=arguments.resume)
    identity = _identity(arguments, parts.fitting)
    if arguments.resume:
        tensors, spec, progress = load_checkpoint(last)
        check_resumable(last, progress.run, identity)
    else:
        tensors, progress = {}, Progress(run=identity)
        spec = _spec(arguments, parameters, parts.fitting)
        if arguments.weights is not None:
            state, spec = _initial(arguments.weights, spec)
            tensors["network"] = state
    network, average = _network(spec).to(device), _network(spec).to(device)
    if tensors:
        network.load_state_dict(tensors["network"])
    average.load_state_dict(tensors.get("average") or network.state_dict())
    optimizer = torch.optim.AdamW(_groups(network, parameters.weight_decay), lr=parameters.learning_rate, fused=True)
    if "optimizer" in tensors:
        restore_optimizer(optimizer, tensors["optimizer"])
    return Run(arguments, parameters, parts, device, network, average.eval(), optimizer, spec, progress)


def _identity(arguments: TrainArguments, fitting: Dataset) -> dict[str, str]:
    """What must stay the same when a run is resumed: were other pictures held out, it would have seen them."""
    names = ", ".join(str(folder) for folder in arguments.data)
    listed = "\n".join(str(sample.path) for sample in fitting.samples).encode()
    pictures = f"{len(fitting.samples)} to train on ({hashlib.sha256(listed).hexdigest()[:8]})"
    same = {"profile": arguments.profile, "seed": str(arguments.seed), "data": names, "width": f"{arguments.width:g}"}
    same["weights"] = "none" if arguments.weights is None else str(arguments.weights)
    return same | {"classes": ", ".join(fitting.classes), "pictures": pictures}


def _spec(arguments: TrainArguments, parameters: TrainParameters, fitting: Dataset) -> DetectorSpec:
    anchors: Anchors = PUBLISHED_ANCHORS_PX
    if parameters.anchors == "fit":
        order = np.random.default_rng(arguments.seed).permutation(len(fitting.samples))[:ANCHOR_PICTURES]
        samples = (fitting.samples[index] for index in order)
        sizes = [sample.load(parameters.fit_px)[1][:, 3:5] for sample in samples if len(sample.boxes)]
        anchors = fit_anchors(np.concatenate(sizes) if sizes else np.zeros((0, 2)), arguments.seed)
    return DetectorSpec(fitting.classes, anchors, parameters.decoding, arguments.width, fit_px=parameters.fit_px)


def _initial(path: Path, spec: DetectorSpec) -> tuple[dict[str, Tensor], DetectorSpec]:
    """Tensors to start from: another run's average, a detector's ONNX file, or Darknet's weights.

    The heads of a detector of this project belong to its anchors and decoding: those are kept.
    """
    network, other = _network(spec), spec
    if path.suffix == ".weights":
        if spec.decoding is not Decoding.DARKNET:
            raise DataError(f"{path}: Darknet's weights need decoding = 'darknet' in [train]")
        load_weights(network, read_weights(path, network.layers))
    elif path.suffix == ".onnx":
        weights, other = read_onnx(path, network.layers)
        load_weights(network, weights)
    else:
        tensors, other, _ = load_checkpoint(path)
        if (other.width, len(other.classes)) != (spec.width, len(spec.classes)):
            raise DataError(f"checkpoint {path} has width {other.width:g} and {len(other.classes)} classes")
        network.load_state_dict(tensors["average"])
    return dict(network.state_dict()), replace(spec, anchors_px=other.anchors_px, decoding=other.decoding)


def _groups(network: Network, decay: float) -> list[dict[str, object]]:
    """Kernels decay; shifts and scales do not."""
    kernels = [item for item in network.parameters() if item.ndim > 1]
    others = [item for item in network.parameters() if item.ndim <= 1]
    return [{"params": kernels, "weight_decay": decay}, {"params": others, "weight_decay": 0.0}]
