"""A trained network as ONNX: 32-bit, with 16-bit weights, or 8-bit (static, per channel, quantise-dequantise pairs).

The graph takes pictures as they come, (n,3,h,w) BGR 0 … 255: the scale to 0 … 1 is folded into the first kernel, as is
normalisation into every kernel. The detector's spec travels in the file's metadata, so one file is one detector.
Quantisation follows ONNX Runtime's static QDQ scheme; it was measured to keep average precision where NNCF's defaults
lost 5 points (DESIGN, Vision, far).
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.extras import require
from shipland.files import check_digest, write_with_digest
from shipland.learning.yolov3 import (
    LEAKY_SLOPE,
    NORM_EPSILON,
    Conv,
    ConvWeights,
    Head,
    Layer,
    Route,
    Shortcut,
    Upsample,
    convolutions,
)
from shipland.vision.far.decode import DetectorSpec
from shipland.vision.far.runtime import INPUT_NAME, METADATA_KEY

OPSET = 17
IR_VERSION = 9


def onnx_bytes(layers: Sequence[Layer], weights: Sequence[ConvWeights], spec: DetectorSpec, *, half: bool) -> bytes:
    """The network as an ONNX file's bytes; `half` keeps 16-bit weights, arithmetic is the runtime's choice."""
    onnx = _onnx()
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    nodes: list[Any] = []
    constants: list[Any] = []
    outputs: dict[int, str] = {}
    names: list[str] = []
    value, remaining = INPUT_NAME, iter(weights)

    def constant(name: str, numbers: npt.NDArray[np.float32]) -> str:
        if not half:
            constants.append(numpy_helper.from_array(np.ascontiguousarray(numbers, np.float32), name))
            return name
        constants.append(numpy_helper.from_array(numbers.astype(np.float16), f"{name}_half"))
        nodes.append(helper.make_node("Cast", [f"{name}_half"], [name], to=onnx.TensorProto.FLOAT))
        return name

    constants.append(numpy_helper.from_array(np.array([1, 1, 2, 2], np.float32), "doubling"))
    for index, layer in enumerate(layers):
        name = f"l{index}"
        match layer:
            case Conv(_, size, stride, normalised):
                kernel, bias = next(remaining).folded()
                if index == 0:
                    kernel = kernel * np.float32(1.0 / 255.0)
                pair = [constant(f"{name}_kernel", kernel), constant(f"{name}_bias", bias)]
                raw = f"{name}_raw" if normalised else name
                shape = {"kernel_shape": [size, size], "pads": [size // 2] * 4, "strides": [stride] * 2}
                nodes.append(helper.make_node("Conv", [value, *pair], [raw], raw, **shape))
                if normalised:
                    nodes.append(helper.make_node("LeakyRelu", [raw], [name], name, alpha=LEAKY_SLOPE))
            case Shortcut(back):
                nodes.append(helper.make_node("Add", [value, names[index - back]], [name], name))
            case Route(sources):
                inputs = [names[source] for source in sources]
                operation, options = ("Concat", {"axis": 1}) if len(inputs) > 1 else ("Identity", {})
                nodes.append(helper.make_node(operation, inputs, [name], name, **options))
            case Upsample():
                nearest = {"mode": "nearest", "nearest_mode": "floor", "coordinate_transformation_mode": "asymmetric"}
                nodes.append(helper.make_node("Resize", [value, "", "doubling"], [name], name, **nearest))
            case Head(scale):
                outputs[scale] = f"scale{scale}"
                nodes.append(helper.make_node("Identity", [value], [outputs[scale]]))
        names.append(value if isinstance(layer, Head) else name)
        value = names[-1]
    channels = 3 * (5 + len(spec.classes))
    entering = {INPUT_NAME: [1, 3, "height", "width"]}
    leaving = {outputs[scale]: [1, channels, f"rows{scale}", f"columns{scale}"] for scale in sorted(outputs)}
    return model_bytes("yolov3", nodes, entering, leaving, constants, {METADATA_KEY: spec.to_json()})


def model_bytes(
    name: str,
    nodes: Sequence[Any],
    entering: Mapping[str, Sequence[object]],
    leaving: Mapping[str, Sequence[object]],
    constants: Sequence[Any],
    about: Mapping[str, str],
) -> bytes:
    """A checked ONNX file of a graph: shapes of what enters and leaves it, by name, and its metadata."""
    onnx = _onnx()
    helper = onnx.helper
    ends = (
        [helper.make_tensor_value_info(end, onnx.TensorProto.FLOAT, shape) for end, shape in shapes.items()]
        for shapes in (entering, leaving)
    )
    graph = helper.make_graph(nodes, name, *ends, constants)
    opset = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(graph, opset_imports=opset, ir_version=IR_VERSION, producer_name="shipland")
    helper.set_model_props(model, about)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def write_onnx(
    path: Path, layers: Sequence[Layer], weights: Sequence[ConvWeights], spec: DetectorSpec, *, half: bool = True
) -> None:
    """Write the network as ONNX, whole or not at all, with its digest."""
    write_with_digest(path, onnx_bytes(layers, weights, spec, half=half))


def read_onnx(path: Path, layers: Sequence[Layer]) -> tuple[list[ConvWeights], DetectorSpec]:
    """The numbers of a file that `write_onnx` wrote, and its spec; normalisation stays folded into the kernels.

    DataError where it is damaged (`check_digest`), no ONNX file of this project, or a network of another shape.
    """
    check_digest(path)
    onnx = _onnx()
    from google.protobuf.message import DecodeError  # type: ignore[import-untyped]

    try:
        model = onnx.load(str(path))
    except DecodeError as error:
        raise DataError(f"{path} is no ONNX network: {str(error).strip().splitlines()[-1]}") from None
    text = {item.key: item.value for item in model.metadata_props}.get(METADATA_KEY)
    if text is None:
        raise DataError(f"{path} is no shipland detector: it lacks the metadata {METADATA_KEY!r}")
    numbers = {item.name.removesuffix("_half"): onnx.numpy_helper.to_array(item) for item in model.graph.initializer}
    weights: list[ConvWeights] = []
    for index, (conv, entering) in convolutions(layers).items():
        kernel, bias = (numbers.get(f"l{index}_{part}") for part in ("kernel", "bias"))
        wanted = (conv.filters, entering, conv.size, conv.size)
        if kernel is None or bias is None or kernel.shape != wanted:
            why = "is it of another width, of more or fewer classes, or 8-bit?"
            raise DataError(f"{path}: layer {index} is no convolution of {wanted}; {why}")
        kernel, bias = kernel.astype(np.float32), bias.astype(np.float32)
        if not weights:
            kernel = kernel * np.float32(255.0)
        ones = np.ones(conv.filters, np.float32)
        norm = (ones, 0.0 * ones, ones - np.float32(NORM_EPSILON)) if conv.normalised else (None, None, None)
        weights.append(ConvWeights(kernel, bias, *norm))
    return weights, DetectorSpec.from_json(text, str(path))


def write_int8(
    path: Path,
    layers: Sequence[Layer],
    weights: Sequence[ConvWeights],
    spec: DetectorSpec,
    calibration: Callable[[], Iterator[npt.NDArray[np.uint8]]],
) -> None:
    """Write the network with 8-bit weights and activations, whole or not at all, with its digest.

    `calibration` gives real pictures (h,w,3) BGR, sides multiples of 32, that the activations' ranges are taken from; a
    few hundred, of the kind the detector will see. DataError where there is none.
    """
    from onnxruntime import quantization

    if next(calibration(), None) is None:
        raise DataError(f"{path}: 8-bit weights need calibration pictures, got none")

    class Reader(quantization.CalibrationDataReader):
        def __init__(self) -> None:
            self.pictures = calibration()

        def get_next(self) -> dict[str, npt.NDArray[np.float32]] | None:
            picture = next(self.pictures, None)
            if picture is None:
                return None
            return {INPUT_NAME: np.ascontiguousarray(picture.transpose(2, 0, 1)[None], dtype=np.float32)}

    with tempfile.TemporaryDirectory() as folder:
        full, small = Path(folder) / "full.onnx", Path(folder) / "int8.onnx"
        full.write_bytes(onnx_bytes(layers, weights, spec, half=False))
        root_level = logging.getLogger().level
        logging.getLogger().setLevel(logging.ERROR)
        try:
            quantization.quantize_static(
                full,
                small,
                Reader(),
                quant_format=quantization.QuantFormat.QDQ,
                op_types_to_quantize=["Conv", "Add", "Concat", "Resize"],
                per_channel=True,
                activation_type=quantization.QuantType.QUInt8,
                weight_type=quantization.QuantType.QInt8,
                calibrate_method=quantization.CalibrationMethod.MinMax,
                extra_options={"CalibMovingAverage": True},
            )
        finally:
            logging.getLogger().setLevel(root_level)
        onnx = _onnx()
        model = onnx.load(str(small))
        onnx.helper.set_model_props(model, {METADATA_KEY: spec.to_json()})
        write_with_digest(path, bytes(model.SerializeToString()))


def _onnx() -> Any:  # noqa: ANN401 - the module
    require("train", "exporting", module="onnx")
    import onnx

    return onnx
