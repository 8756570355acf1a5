"""What a training run leaves: the detector in two files, curves, and a model card."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch

from shipland.figures import drawn
from shipland.files import write_atomically
from shipland.learning.export import write_int8
from shipland.learning.network import weights_of
from shipland.learning.run import Run
from shipland.learning.windows import Windows
from shipland.learning.yolov3 import flop_count, parameter_count
from shipland.vision.pictures import Picture


def write_results(run: Run) -> None:
    """Write `detector.onnx`, `detector-int8.onnx` and `model-card.md`, the last one last."""
    out, network = run.arguments.out, run.average
    run.write_detector()
    if run.parameters.calibration_pictures:
        weights = weights_of(network)
        write_int8(
            out / "detector-int8.onnx", network.layers, weights, run.noted_spec, lambda: calibration_windows(run)
        )
    write_atomically(out / "model-card.md", model_card(run).encode())


def calibration_windows(run: Run) -> Iterator[Picture]:
    """Training pictures at their own scale, cut to the window, uncoloured."""
    rng = np.random.default_rng([run.arguments.seed, 2])
    parameters, dataset = run.parameters, run.parts.fitting
    plain = replace(parameters, augment=replace(parameters.augment, scale_min=1.0, scale_max=1.0))
    windows = Windows(dataset, plain, torch.device("cpu"))
    count = min(parameters.calibration_pictures, len(dataset.samples))
    for index in rng.choice(len(dataset.samples), size=count, replace=False):
        yield windows.plain(int(index), rng)


def plot_curves(run: Run) -> None:
    """Losses and held-out scores over the steps, as the picture `curves.png`."""
    progress = run.progress
    with drawn(run.arguments.out / "curves.png", (9.0, 3.6), 110) as figure:
        left, right = figure.subplots(1, 2)
        step = [row[0] for row in progress.losses]
        for column, label in enumerate(("box", "objectness", "class"), 1):
            left.plot(step, [row[column] for row in progress.losses], ".-", label=label, markersize=3)
        left.set(xlabel="step", ylabel="loss (running mean)", yscale="log")
        evaluated = [row["step"] for row in progress.history]
        for name, label in (("average_precision", "average precision"), ("recall", "recall at confidence 0.5")):
            right.plot(evaluated, [row[name] for row in progress.history], "o-", label=label, markersize=4)
        right.set(xlabel="step", ylabel=f"held-out pictures, IoU {run.parameters.match_iou:g}", ylim=(0.0, 1.02))
        if not progress.history:
            right.text(0.5, 0.5, "not evaluated yet", ha="center", transform=right.transAxes)
        for axes in (left, right):
            axes.legend(frameon=False)


def model_card(run: Run) -> str:
    """Markdown: data, seed, command, figures, limits."""
    arguments, parameters, network, spec = run.arguments, run.parameters, run.average, run.spec
    progress, fitting, held_out = run.progress, run.parts.fitting, run.parts.held_out
    best = max(progress.history, key=lambda row: row["average_precision"], default=None)
    folders = " ".join(path.name for path in arguments.data)
    figures, files = "", ", `detector-int8.onnx` (8-bit, static, per channel)" * bool(parameters.calibration_pictures)
    if best is not None:
        figures = (
            f"- Held out: average precision {best['average_precision']:.3f} at IoU {parameters.match_iou:g}, "
            f"recall {best['recall']:.3f} at that IoU and confidence 0.5\n"
        )
    if run.parts.warning:
        figures += f"- WARNING: {run.parts.warning}\n"
    return (
        f"# Detector: {', '.join(spec.classes)}\n\n"
        f"- Network: YOLOv3, width ×{spec.width:g}, {parameter_count(network.layers) / 1e6:.2f} M parameters, "
        f"{flop_count(network.layers, 416, 416) / 1e9:.2f} GFLOP at 416 × 416; {spec.decoding.value} decoding\n"
        f"- Anchors [px]: {', '.join(f'{w:g} × {h:g}' for scale in spec.anchors_px for w, h in scale)}\n"
        f"- Data: {folders}: {len(fitting.samples)} pictures to train on, {len(held_out.samples)} held out "
        f"({run.parts.how})\n"
        f"- Training: profile {arguments.profile}, seed {arguments.seed}, batch {parameters.batch}, "
        f"window {parameters.window_px} px, best after {progress.step} of {parameters.steps} steps\n"
        f"{figures}- Files: `detector.onnx` (16-bit weights){files}\n"
        "- Limits: it knows what its data show; measure it on yours with `shipland evaluate`.\n"
    )
