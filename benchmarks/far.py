"""Time from picture to boxes of the far detectors: whole frames and tiles, per runtime, one thread; medians.

`python benchmarks/far.py` times the shipped width; `--full` adds width 1.0, the paper's network, in OpenVINO and in
OpenCV's own Darknet importer, with random weights: time does not depend on their values.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from shipland.errors import SystemLibraryError
from shipland.learning.darknet import write_cfg, write_weights
from shipland.learning.export import write_int8, write_onnx
from shipland.learning.yolov3 import PUBLISHED_ANCHORS_PX, random_weights, yolov3_layers
from shipland.vision.far.decode import Decoding, DetectorSpec
from shipland.vision.far.detector import Detector
from shipland.vision.far.runtime import Precision, Runtime, load_engine

SIZES = {"tile 224 × 224": (224, 224), "tile 416 × 416": (416, 416), "frame 1280 × 720": (720, 1280)}
RUNTIMES: tuple[tuple[str, Runtime, Precision], ...] = (
    ("OpenVINO bf16", "openvino", "bf16"),
    ("OpenVINO fp32", "openvino", "fp32"),
    ("OpenVINO int8", "openvino", "bf16"),
    ("ONNX Runtime fp32", "onnxruntime", "fp32"),
)
CONFIDENCE = 0.4
SHARE_S = 2.0
"""What one figure may cost."""


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
        try:
            found[name] = Detector(load_engine(files.get(name, half), runtime, precision, threads), 0.45)
        except SystemLibraryError as error:
            print(f"{name}: {error}")
    darknet_spec = DetectorSpec(("ship",), anchors, Decoding.DARKNET, width)
    write_cfg(folder / "net.cfg", layers, darknet_spec, 416, 416)
    write_weights(folder / "net.weights", weights)
    return found


def darknet_s(folder: Path, picture: np.ndarray, seconds: float) -> float:
    """Median of OpenCV's Darknet inference, picture to raw boxes."""
    network = cv2.dnn.readNetFromDarknet(str(folder / "net.cfg"), str(folder / "net.weights"))
    network.setPreferableBackend(cv2.dnn.DNN_BACKEND_OPENCV)
    names = network.getUnconnectedOutLayersNames()
    height, width = (32 * -(-side // 32) for side in picture.shape[:2])

    def once() -> None:
        network.setInput(cv2.dnn.blobFromImage(picture, 1.0 / 255.0, (width, height)))
        network.forward(names)

    once()
    return median_s([once], seconds)[0]


def median_s(calls: list, seconds: float) -> list[float]:
    """Median time of each call, taken in turns so that a busy moment meets all of them."""
    times: list[list[float]] = [[] for _ in calls]
    end = time.perf_counter() + seconds * len(calls)
    while time.perf_counter() < end or len(times[0]) < 3:
        for call, row in zip(calls, times, strict=True):
            started = time.perf_counter()
            call()
            row.append(time.perf_counter() - started)
    return [float(np.median(row)) for row in times]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="width 1.0 too (minutes, 1.5 GB of memory)")
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    rng = np.random.default_rng(2)
    print("| width | runtime | " + " | ".join(f"{name} [ms]" for name in SIZES) + " |")
    print("|---:|---|" + "---:|" * len(SIZES))
    for width in (0.25, 1.0) if arguments.full else (0.25,):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            found = detectors(folder, width, arguments.threads)
            rows: dict[str, list[float]] = {runtime: [] for runtime in found}
            rows["OpenCV's Darknet fp32"] = []
            for shape in SIZES.values():
                picture = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
                calls = [lambda d=item, p=picture: d.detect(p, CONFIDENCE) for item in found.values()]
                for call in calls:
                    call()  # compiles the network for this size
                for runtime, seconds in zip(found, median_s(calls, SHARE_S), strict=True):
                    rows[runtime].append(seconds)
                rows["OpenCV's Darknet fp32"].append(darknet_s(folder, picture, SHARE_S))
            for runtime, row in rows.items():
                print(f"| {width:g} | {runtime} | " + " | ".join(f"{1e3 * value:.1f}" for value in row) + " |")


if __name__ == "__main__":
    main()
