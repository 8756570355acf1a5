"""Networks of random weights, and Darknet's `.cfg` and `.weights` of them, which peers read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.errors import DataError
from shipland.files import write_atomically
from shipland.learning.yolov3 import Conv, ConvWeights, Head, Layer, Route, Shortcut, Upsample, input_channels
from shipland.vision.far.decode import Decoding, DetectorSpec


def random_weights(layers: Sequence[Layer], rng: np.random.Generator) -> list[ConvWeights]:
    """Random weights of a trained network's magnitude."""
    weights = []
    for layer, entering in zip(layers, input_channels(layers), strict=True):
        if not isinstance(layer, Conv):
            continue
        n, fan_in = layer.filters, entering * layer.size**2
        kernel = (rng.standard_normal((n, entering, layer.size, layer.size)) * np.sqrt(2.0 / fan_in)).astype(np.float32)
        bias = (0.1 * rng.standard_normal(n)).astype(np.float32)
        if not layer.normalised:
            weights.append(ConvWeights(kernel, bias))
            continue
        scale = rng.uniform(0.4, 0.8, n).astype(np.float32)
        mean = (0.1 * rng.standard_normal(n)).astype(np.float32)
        variance = rng.uniform(0.8, 1.4, n).astype(np.float32)
        weights.append(ConvWeights(kernel, bias, scale, mean, variance))
    return weights


def write_cfg(path: Path, layers: Sequence[Layer], spec: DetectorSpec, width_px: int, height_px: int) -> None:
    """Write a network as Darknet's `.cfg`; DataError if its decoding is not Darknet's."""
    if spec.decoding is not Decoding.DARKNET:
        raise DataError(f"{path}: Darknet cannot decode these weights ({spec.decoding.value} decoding)")
    lines = ["[net]", "batch=1", f"width={width_px}", f"height={height_px}", "channels=3", ""]
    anchors = ", ".join(f"{w:g},{h:g}" for scale in spec.anchors_px for w, h in scale)
    for index, layer in enumerate(layers):
        match layer:
            case Conv(filters, size, stride, normalised):
                lines += ["[convolutional]", *(["batch_normalize=1"] if normalised else [])]
                lines += [f"filters={filters}", f"size={size}", f"stride={stride}", "pad=1"]
                lines += [f"activation={'leaky' if normalised else 'linear'}"]
            case Shortcut(back):
                lines += ["[shortcut]", f"from={-back}", "activation=linear"]
            case Route(sources):
                lines += ["[route]", "layers=" + ", ".join(str(source - index) for source in sources)]
            case Upsample():
                lines += ["[upsample]", "stride=2"]
            case Head(scale):
                mask = ",".join(str(3 * scale + anchor) for anchor in range(3))
                lines += ["[yolo]", f"mask={mask}", f"anchors={anchors}", f"classes={len(spec.classes)}", "num=9"]
        lines.append("")
    write_atomically(path, "\n".join(lines).encode())


def write_weights(path: Path, weights: Sequence[ConvWeights], pictures_seen: int = 0) -> None:
    """Write Darknet's `.weights`, version 0.2."""
    parts = [np.array([0, 2, 0], "<i4").tobytes(), np.array([pictures_seen], "<u8").tobytes()]
    for item in weights:
        blocks = [item.bias]
        if item.scale is not None and item.mean is not None and item.variance is not None:
            blocks += [item.scale, item.mean, item.variance]
        parts += [np.ascontiguousarray(block, "<f4").tobytes() for block in (*blocks, item.kernel)]
    write_atomically(path, b"".join(parts))
