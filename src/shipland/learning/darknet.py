"""Darknet's `.weights` (32-bit floats), which a training may begin from.

Format: J. Redmon, Darknet (2013–2018), `parser.c`. A file is three 32-bit integers (major, minor,
revision), the number of pictures seen (64-bit from version 0.2 on), then for every convolution bias, scale, mean,
variance (the last three with batch normalisation only) and kernel, all in the order of the layers.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.errors import DataError
from shipland.learning.yolov3 import Conv, ConvWeights, Float32, Layer, input_channels


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
