"""What a training run leaves: the detector in two files, curves, and a model card."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from shipland.figures import drawn
from shipland.files import write_atomically
from shipland.learning.arguments import TrainArguments
from shipland.learning.checkpoint import Progress
from shipland.learning.dataset import Dataset
from shipland.learning.export import write_int8, write_onnx
from shipland.learning.network import Network, weights_of
from shipland.learning.settings import TrainParameters
from shipland.learning.split import Split
from shipland.learning.windows import Windows
from shipland.learning.yolov3 import flop_count, parameter_count
from shipland.vision.far.decode import DetectorSpec
from shipland.vision.pictures import Picture


@dataclass(frozen=True)
class Trained:
    """A training run at its end; the network has the best weights."""

    arguments: TrainArguments
    parameters: TrainParameters
    network: Network
    spec: DetectorSpec
    progress: Progress
    parts: Split

    @property
    def detector(self) -> Path:
        """The detector's file."""
        return self.arguments.out / DETECTOR


DETECTOR, CURVES, CARD = "detector.onnx", "curves.png", "model-card.md"


def write_detector(out: Path, network: Network, spec: DetectorSpec, step: int, pictures: int) -> DetectorSpec:
    """Write `detector.onnx` of a network trained for so many steps on so many pictures; its spec, which notes that."""
    noted = replace(spec, note=f"shipland train, step {step}, {pictures} pictures")
    write_onnx(out / DETECTOR, network.layers, weights_of(network), noted, half=True)
    return noted


def write_results(trained: Trained) -> None:
    """Write `detector.onnx`, `detector-int8.onnx` and `model-card.md`, the last one last."""
    arguments, parameters, network = trained.arguments, trained.parameters, trained.network
    fitting, out = trained.parts.fitting, arguments.out
    noted = write_detector(out, network, trained.spec, trained.progress.step, len(fitting.samples))
    if parameters.calibration_pictures:
        write_int8(
            out / "detector-int8.onnx",
            network.layers,
            weights_of(network),
            noted,
            lambda: calibration_windows(fitting, parameters, arguments.seed),
        )
    write_atomically(out / CARD, model_card(trained).encode())


def calibration_windows(dataset: Dataset, parameters: TrainParameters, seed: int) -> Iterator[Picture]:
    """Training pictures at their own scale, cut to the window, uncoloured."""
    rng = np.random.default_rng([seed, 2])
    plain = replace(parameters, augment=replace(parameters.augment, scale_min=1.0, scale_max=1.0))
    windows = Windows(dataset, plain, torch.device("cpu"))
    count = min(parameters.calibration_pictures, len(dataset.samples))
    for index in rng.choice(len(dataset.samples), size=count, replace=False):
        yield windows.plain(int(index), rng)


def plot_curves(path: Path, progress: Progress, match_iou: float) -> None:
    """Losses and held-out scores over the steps, as a picture."""
    with drawn(path, (9.0, 3.6), 110) as figure:
        left, right = figure.subplots(1, 2)
        step = [row[0] for row in progress.losses]
        for column, label in enumerate(("box", "objectness", "class"), 1):
            left.plot(step, [row[column] for row in progress.losses], ".-", label=label, markersize=3)
        left.set(xlabel="step", ylabel="loss (running mean)", yscale="log")
        evaluated = [row["step"] for row in progress.history]
        for name, label in (("average_precision", "average precision"), ("recall", "recall at confidence 0.5")):
            right.plot(evaluated, [row[name] for row in progress.history], "o-", label=label, markersize=4)
        right.set(xlabel="step", ylabel=f"held-out pictures, IoU {match_iou:g}", ylim=(0.0, 1.02))
        if not progress.history:
            right.text(0.5, 0.5, "not evaluated yet", ha="center", transform=right.transAxes)
        for axes in (left, right):
            axes.legend(frameon=False)


def model_card(trained: Trained) -> str:
    """Markdown: data, seed, command, figures, limits."""
    arguments, parameters, network, spec = trained.arguments, trained.parameters, trained.network, trained.spec
    progress, fitting, held_out = trained.progress, trained.parts.fitting, trained.parts.held_out
    best = max(progress.history, key=lambda row: row["average_precision"], default=None)
    folders = " ".join(path.name for path in arguments.data)
    figures, files = "", ", `detector-int8.onnx` (8-bit, static, per channel)" * bool(parameters.calibration_pictures)
    if best is not None:
        figures = (
            f"- Held out: average precision {best['average_precision']:.3f} at IoU {parameters.match_iou:g}, "
            f"recall {best['recall']:.3f} at that IoU and confidence 0.5\n"
        )
    if trained.parts.warning:
        figures += f"- WARNING: {trained.parts.warning}\n"
    return (
        f"# Detector: {', '.join(spec.classes)}\n\n"
        f"- Network: YOLOv3, width ×{spec.width:g}, {parameter_count(network.layers) / 1e6:.2f} M parameters, "
        f"{flop_count(network.layers, 416, 416) / 1e9:.2f} GFLOP at 416 × 416; {spec.decoding.value} decoding\n"
        f"- Anchors [px]: {', '.join(f'{w:g} × {h:g}' for scale in spec.anchors_px for w, h in scale)}\n"
        f"- Data: {folders}: {len(fitting.samples)} pictures to train on, {len(held_out.samples)} held out "
        f"({trained.parts.how})\n"
        f"- Training: profile {arguments.profile}, seed {arguments.seed}, batch {parameters.batch}, "
        f"window {parameters.window_px} px, best after {progress.step} of {parameters.steps} steps\n"
        f"{figures}- Files: `detector.onnx` (16-bit weights){files}\n"
        "- Limits: it knows what its data show; measure it on yours with `shipland evaluate`.\n"
    )
