"""YOLOv3 as a list of layers: Darknet-53, three scales, a width factor. No torch here.

Source: J. Redmon, A. Farhadi, "YOLOv3: An Incremental Improvement", arXiv 1804.02767 (2018) [YOLOv3]. The one list
below is what the torch network, the Darknet `.cfg` and `.weights`, the ONNX graph and the counts are made from.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipland.errors import DataError
from shipland.vision.far.decode import STRIDES, Float32

Shape = tuple[int, int, int]
"""Channels, rows, columns."""

LEAKY_SLOPE = 0.1  # [YOLOv3]: Darknet's leaky rectifier
NORM_EPSILON = 1e-6  # Darknet's batch normalisation
PUBLISHED_ANCHORS_PX = (
    ((10.0, 13.0), (16.0, 30.0), (33.0, 23.0)),
    ((30.0, 61.0), (62.0, 45.0), (59.0, 119.0)),
    ((116.0, 90.0), (156.0, 198.0), (373.0, 326.0)),
)
"""[YOLOv3, §2.3]: the nine COCO clusters, three a scale, finest scale first."""


@dataclass(frozen=True)
class Conv:
    """Square convolution, padded to keep the size at stride 1; batch-normalised with a leaky rectifier, or plain."""

    filters: int
    size: int
    stride: int = 1
    normalised: bool = True


@dataclass(frozen=True)
class Shortcut:
    """Adds the output of the layer `back` places before to the layer's input."""

    back: int


@dataclass(frozen=True)
class Route:
    """Concatenates the outputs of the layers with these absolute indices."""

    sources: tuple[int, ...]


@dataclass(frozen=True)
class Upsample:
    """Nearest-neighbour doubling."""


@dataclass(frozen=True)
class Head:
    """One detection scale, 0 the finest: takes the layer before it as the raw map of `3·(4 + 1 + classes)` channels."""

    scale: int


Layer = Conv | Shortcut | Route | Upsample | Head


@dataclass(frozen=True)
class ConvWeights:
    """Numbers of one convolution, in the order of the layers.

    Attributes:
        kernel: (filters, entering channels, size, size).
        bias: (filters,): the plain convolution's bias, or batch normalisation's shift.
        scale, mean, variance: (filters,) of batch normalisation; None without it.
    """

    kernel: Float32
    bias: Float32
    scale: Float32 | None = None
    mean: Float32 | None = None
    variance: Float32 | None = None

    def folded(self) -> tuple[Float32, Float32]:
        """Kernel and bias of the one convolution that equals this one with its normalisation."""
        if self.scale is None or self.mean is None or self.variance is None:
            return self.kernel, self.bias
        factor = (self.scale / np.sqrt(self.variance.astype(np.float64) + NORM_EPSILON)).astype(np.float32)
        return self.kernel * factor[:, None, None, None], self.bias - self.mean * factor


def yolov3_layers(classes: int, width: float = 1.0) -> list[Layer]:
    """The 107 layers of [YOLOv3] in Darknet's order, so that a layer's index is Darknet's.

    `width` is a factor on every hidden layer's filters, which come in whole eights; 1.0 is the published network.
    """
    if classes < 1 or width <= 0.0:
        raise ValueError(f"yolov3_layers wants classes ≥ 1 and width > 0, got {classes} and {width}")

    layers: list[Layer] = []

    def conv(filters: int, size: int, stride: int = 1) -> None:
        layers.append(Conv(max(8, 8 * round(filters * width / 8)), size, stride))

    conv(32, 3)
    for filters, blocks in ((64, 1), (128, 2), (256, 8), (512, 8), (1024, 4)):
        conv(filters, 3, 2)
        for _ in range(blocks):
            conv(filters // 2, 1)
            conv(filters, 3)
            layers.append(Shortcut(3))
    # The last outputs of Darknet-53 at strides 8 and 16, taken up again by the finer scales.
    taps = {0: 36, 1: 61}
    for scale, filters in ((2, 512), (1, 256), (0, 128)):
        if scale < 2:
            layers.append(Route((len(layers) - 4,)))
            conv(filters, 1)
            layers.append(Upsample())
            layers.append(Route((len(layers) - 1, taps[scale])))
        for _ in range(3):
            conv(filters, 1)
            conv(2 * filters, 3)
        layers.append(Conv(3 * (4 + 1 + classes), 1, normalised=False))
        layers.append(Head(scale))
    return layers


def layer_shapes(layers: Sequence[Layer], height_px: int, width_px: int) -> list[Shape]:
    """Output shape of every layer for a picture of `height_px` × `width_px`, both multiples of 32."""
    if height_px % STRIDES[-1] or width_px % STRIDES[-1]:
        raise ValueError(f"the picture's sides must be multiples of {STRIDES[-1]}, got {height_px} × {width_px}")
    shapes: list[Shape] = []
    c, h, w = 3, height_px, width_px
    for layer in layers:
        if isinstance(layer, Conv):
            c, h, w = layer.filters, h // layer.stride, w // layer.stride
        elif isinstance(layer, Upsample):
            h, w = 2 * h, 2 * w
        elif isinstance(layer, Route):
            _, h, w = shapes[layer.sources[0]]
            c = sum(shapes[source][0] for source in layer.sources)
        shapes.append((c, h, w))
    return shapes


def input_channels(layers: Sequence[Layer]) -> list[int]:
    """Channels that enter every layer."""
    return [3, *(channels for channels, _, _ in layer_shapes(layers, STRIDES[-1], STRIDES[-1])[:-1])]


def convolutions(layers: Sequence[Layer]) -> dict[int, tuple[Conv, int]]:
    """By index, each convolution and the channels that enter it."""
    entering = input_channels(layers)
    return {index: (layer, entering[index]) for index, layer in enumerate(layers) if isinstance(layer, Conv)}


def parameter_count(layers: Sequence[Layer], normalisation: int = 2) -> int:
    """Numbers of the convolutions: kernels, biases, and of batch normalisation the trained shift and scale."""
    return sum(
        conv.filters * (entering * conv.size**2 + (normalisation if conv.normalised else 1))
        for conv, entering in convolutions(layers).values()
    )


def flop_count(layers: Sequence[Layer], height_px: int, width_px: int) -> int:
    """Floating-point operations of the convolutions, a multiply-add as two: Darknet's own count."""
    shapes = layer_shapes(layers, height_px, width_px)
    return sum(
        2 * conv.filters * entering * conv.size**2 * shapes[index][1] * shapes[index][2]
        for index, (conv, entering) in convolutions(layers).items()
    )


def read_weights(path: Path, layers: Sequence[Layer]) -> list[ConvWeights]:
    """Weights of `layers` from Darknet's `.weights` (32-bit floats), which a training may begin from.

    Format: J. Redmon, Darknet (2013–2018), `parser.c`. A file is three 32-bit integers (major, minor, revision), the
    number of pictures seen (64-bit from version 0.2 on), then for every convolution bias, scale, mean, variance (the
    last three with batch normalisation only) and kernel, all in the order of the layers.

    DataError where it is missing, truncated, too long for these layers, or holds numbers that are not finite.
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
    wanted = parameter_count(layers, normalisation=4)
    have = (len(data) - header) / 4
    if have != wanted:
        state = "truncated" if have < wanted else "of another network"
        raise DataError(f"{path}: holds {have:g} numbers where these layers want {wanted}; it is {state}")
    numbers = np.frombuffer(data, "<f4", wanted, header)
    if not np.isfinite(numbers).all():
        raise DataError(f"{path}: holds numbers that are not finite; the file is damaged or no Darknet weights")
    weights: list[ConvWeights] = []

    def take(*shape: int) -> Float32:
        nonlocal numbers
        taken, numbers = np.split(numbers, [math.prod(shape)])
        return taken.reshape(shape).copy()

    for conv, entering in convolutions(layers).values():
        n = conv.filters
        bias = take(n)
        norm = (take(n), take(n), take(n)) if conv.normalised else (None, None, None)
        weights.append(ConvWeights(take(n, entering, conv.size, conv.size), bias, *norm))
    return weights
