"""Darknet's own files: `.weights` (32-bit floats), which a training may begin from, and `.cfg` (text) for its peers.

Format: J. Redmon, Darknet (2013–2018), `parser.c`. A `.weights` file is three 32-bit integers (major, minor,
revision), the number of pictures seen (64-bit from version 0.2 on), then for every convolution bias, scale, mean,
variance (the last three with batch normalisation only) and kernel, all in the order of the layers.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.errors import DataError
from shipland.files import write_atomically
from shipland.learning.yolov3 import (
    Conv,
    ConvWeights,
    Float32,
    Head,
    Layer,
    Route,
    Shortcut,
    Upsample,
    input_channels,
)
from shipland.vision.far.decode import Decoding, DetectorSpec


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


def read_weights(path: Path, layers: Sequence[Layer]) -> list[ConvWeights]:
    """Weights of `layers` from Darknet's `.weights`.

    Raises:
        DataError: missing, truncated, too long for these layers, or holding numbers that are not finite.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read as Darknet weights: {error}") from None
    if len(data) < 20:
        raise DataError(f"{path}: {len(data)} bytes are no Darknet weights; the file is truncated or another kind")
    major, minor, _ = np.frombuffer(data, "<i4", 3)
    if not (0 <= major < 1000 and 0 <= minor < 1000):
        raise DataError(f"{path}: not Darknet weights: its version reads as {major}.{minor}")
    header = 20 if 10 * major + minor >= 2 else 16
    wanted = sum(
        layer.filters * (entering * layer.size**2 + (4 if layer.normalised else 1))
        for layer, entering in zip(layers, input_channels(layers), strict=True)
        if isinstance(layer, Conv)
    )
    have = (len(data) - header) / 4
    if have != wanted:
        state = "truncated" if have < wanted else "of another network"
        raise DataError(f"{path}: holds {have:g} numbers where these layers want {wanted}; it is {state}")
    numbers = np.frombuffer(data, "<f4", wanted, header)
    if not np.isfinite(numbers).all():
        raise DataError(f"{path}: holds numbers that are not finite; the file is damaged or no Darknet weights")
    weights: list[ConvWeights] = []
    at = 0

    def take(*shape: int) -> Float32:
        nonlocal at
        size = int(np.prod(shape))
        at += size
        return numbers[at - size : at].reshape(shape).copy()

    for layer, entering in zip(layers, input_channels(layers), strict=True):
        if not isinstance(layer, Conv):
            continue
        n = layer.filters
        bias = take(n)
        norm = (take(n), take(n), take(n)) if layer.normalised else (None, None, None)
        weights.append(ConvWeights(take(n, entering, layer.size, layer.size), bias, *norm))
    return weights
