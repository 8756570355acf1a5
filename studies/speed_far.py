"""Time from picture to boxes of the far detectors: whole frames and tiles, by runtime; medians, in turns.

Width 0.25 is the shipped one, width 1.0 the paper's network; OpenCV's own Darknet importer goes to raw boxes only. The
weights are random: time does not depend on their values.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from shipland.learning.export import write_int8, write_onnx
from shipland.learning.yolov3 import PUBLISHED_ANCHORS_PX, yolov3_layers
from shipland.vision.far.decode import Decoding, DetectorSpec
from shipland.vision.far.detector import Detector
from shipland.vision.far.layouts import load_reader
from shipland.vision.parameters import Precision, Runtime
from studies.harness import Case, Column, Row, Study
from studies.networks import random_weights, write_cfg, write_weights

SIZES = {"tile 224 × 224": (224, 224), "tile 416 × 416": (416, 416), "frame 1280 × 720": (720, 1280)}
RUNTIMES: tuple[tuple[str, Runtime, Precision], ...] = (
    ("OpenVINO bf16", "openvino", "bf16"),
    ("OpenVINO fp32", "openvino", "fp32"),
    ("OpenVINO int8", "openvino", "bf16"),
    ("ONNX Runtime fp32", "onnxruntime", "fp32"),
)
DARKNET = "OpenCV's Darknet fp32"
CONFIDENCE = 0.4
THREADS = 1


def detectors(folder: Path, width: float, threads: int) -> dict[str, Detector]:
    """A detector a runtime, all of the same random weights, heads silenced so that no box is decoded."""
    rng = np.random.default_rng(1)
    layers, anchors = yolov3_layers(1, width), PUBLISHED_ANCHORS_PX
    weights = random_weights(layers, rng)
    for item in weights:
        if item.scale is None:
            item.bias.reshape(3, -1)[:, 4] = -20.0
            item.kernel[:] *= 0.01
    full, half, small = folder / "full.onnx", folder / "half.onnx", folder / "int8.onnx"
    spec = DetectorSpec(("ship",), anchors, Decoding.WIDE, width)
    write_onnx(full, layers, weights, spec, half=False)
    write_onnx(half, layers, weights, spec)
    pictures = [rng.integers(0, 256, (128, 128, 3), dtype=np.uint8) for _ in range(4)]
    write_int8(small, layers, weights, spec, lambda: iter(pictures))
    files = {"OpenVINO int8": small, "ONNX Runtime fp32": full}
    found = {}
    for name, runtime, precision in RUNTIMES:
        found[name] = Detector(load_reader(files.get(name, half), runtime, precision, threads), 0.45)
    darknet_spec = DetectorSpec(("ship",), anchors, Decoding.DARKNET, width)
    write_cfg(folder / "net.cfg", layers, darknet_spec, 416, 416)
    write_weights(folder / "net.weights", weights)
    return found


def darknet(folder: Path, picture: np.ndarray) -> Callable[[], object]:
    """OpenCV's Darknet inference, picture to raw boxes."""
    network = cv2.dnn.readNetFromDarknet(str(folder / "net.cfg"), str(folder / "net.weights"))
    network.setPreferableBackend(cv2.dnn.DNN_BACKEND_OPENCV)
    names = network.getUnconnectedOutLayersNames()
    height, width = (32 * -(-side // 32) for side in picture.shape[:2])

    def once() -> None:
        network.setInput(cv2.dnn.blobFromImage(picture, 1.0 / 255.0, (width, height)))
        network.forward(names)

    return once


def cases() -> Sequence[Case]:
    """Widths."""
    return [{"width": width} for width in (0.25, 1.0)]


def measure(case: Case, runs: int) -> list[Row]:
    """Median of `runs` looks, taken in turns so that a busy moment meets all runtimes."""
    cv2.setNumThreads(THREADS)
    rng, rows = np.random.default_rng(2), []
    with tempfile.TemporaryDirectory() as name:
        found = detectors(Path(name), float(case["width"]), THREADS)
        for size, shape in SIZES.items():
            picture = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
            looks = {key: lambda d=item, p=picture: d.detect(p, CONFIDENCE) for key, item in found.items()}
            looks[DARKNET] = darknet(Path(name), picture)
            spent_s: dict[str, list[float]] = {runtime: [] for runtime in looks}
            for _ in range(runs + 1):
                for runtime, once in looks.items():
                    started_s = time.perf_counter()
                    once()
                    spent_s[runtime].append(time.perf_counter() - started_s)
            for runtime, some in spent_s.items():  # the first look compiles the network for this size
                rows.append({"runtime": runtime, "size": f"{size} [ms]", "time_s": float(np.median(some[1:]))})
    return rows


STUDY = Study(
    question="What does a look of the far detectors cost?",
    columns={
        "width": Column("width", "g"),
        "runtime": Column("runtime"),
        "size": Column(""),
        "time_s": Column("time [ms]", ".1f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=9,
    minutes=4,
    alone=True,
)
