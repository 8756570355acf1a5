"""Darknet's own files: `.cfg` (text) and `.weights` (32-bit floats), read and written.

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

Section = dict[str, str]


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


def read_cfg(path: Path) -> tuple[list[Layer], tuple[tuple[tuple[float, float], ...], ...], int]:
    """Layers, anchors (three scales of three [px], finest first) and number of classes of a YOLOv3-like `.cfg`.

    Raises:
        DataError: missing, broken, or with a layer or an option that this network family does not have.
    """
    sections = _sections(path)
    if not sections or sections[0][0] not in ("net", "network"):
        raise DataError(f"{path}: a Darknet .cfg starts with [net]; is this one?")
    layers: list[Layer] = []
    anchors_px: dict[int, tuple[tuple[float, float], ...]] = {}
    classes = 0
    for name, options in sections[1:]:
        try:
            if name == "yolo":
                scale, anchors = _yolo(options, path)
                anchors_px[scale] = anchors
                classes = int(options["classes"])
                layers.append(Head(scale))
            else:
                layers.append(_layer(name, options, len(layers), path))
        except (KeyError, ValueError) as error:
            raise DataError(f"{path}: section {len(layers)} [{name}] cannot be read: {error}") from None
    if sorted(anchors_px) != [0, 1, 2]:
        raise DataError(f"{path}: expected three [yolo] sections with masks 0–2, 3–5, 6–8, got {len(anchors_px)}")
    return layers, tuple(anchors_px[scale] for scale in range(3)), classes


def _sections(path: Path) -> list[tuple[str, Section]]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read as a Darknet .cfg: {error}") from None
    sections: list[tuple[str, Section]] = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split("#")[0].split(";")[0].strip()
        if not line:
            continue
        if line.startswith("[") and line.endswith("]"):
            sections.append((line[1:-1].strip().lower(), {}))
        elif "=" in line and sections:
            key, value = line.split("=", 1)
            sections[-1][1][key.strip()] = value.strip()
        else:
            raise DataError(f"{path}, line {number}: expected [section] or key=value, got {line!r}")
    return sections


def _layer(name: str, options: Section, index: int, path: Path) -> Layer:
    if name == "convolutional":
        size, stride = int(options["size"]), int(options.get("stride", "1"))
        normalised = options.get("batch_normalize", "0") == "1"
        wanted = "leaky" if normalised else "linear"
        if options.get("activation", "logistic") != wanted:
            raise DataError(f"{path}: layer {index} has activation {options.get('activation')!r}, expected {wanted!r}")
        if (size > 1 and options.get("pad", "0") != "1") or options.get("groups", "1") != "1":
            raise DataError(f"{path}: layer {index}: convolutions must have pad=1 and groups=1")
        return Conv(int(options["filters"]), size, stride, normalised)
    if name == "shortcut":
        return Shortcut(-int(options["from"]))
    if name == "route":
        sources = [int(item) for item in options["layers"].split(",")]
        return Route(tuple(source if source >= 0 else index + source for source in sources))
    if name == "upsample" and options.get("stride", "2") == "2":
        return Upsample()
    raise DataError(f"{path}: layer {index} [{name}] is none of YOLOv3's; expected convolutional, shortcut, route, …")


def _yolo(options: Section, path: Path) -> tuple[int, tuple[tuple[float, float], ...]]:
    numbers = [float(item) for item in options["anchors"].split(",")]
    mask = [int(item) for item in options["mask"].split(",")]
    if len(numbers) != 18 or mask not in ([0, 1, 2], [3, 4, 5], [6, 7, 8]):
        raise DataError(f"{path}: [yolo] wants nine anchors and a mask of 0–2, 3–5 or 6–8, got mask {mask}")
    return mask[0] // 3, tuple((numbers[2 * item], numbers[2 * item + 1]) for item in mask)


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
