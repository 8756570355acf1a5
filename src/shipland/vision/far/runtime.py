"""Running an ONNX detector on the CPU: OpenVINO (an extra), else ONNX Runtime. Both are imported late."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.extras import installed, require
from shipland.files import check_digest
from shipland.vision.far.decode import Float32
from shipland.vision.parameters import Precision, Runtime

INPUT_NAME = "picture"
METADATA_KEY = "shipland_detector"
FIRST_BYTE = b"\x08"
"""ONNX files start with field 1 of their protobuf, the version."""
_MOST_SIZES = 8
"""Picture sizes for which a network stays compiled, those last met: a whole picture's takes 60 MB and more."""
_NUMBERS = {"tensor(float16)": np.float16, "tensor(int32)": np.int32, "tensor(int64)": np.int64}
"""Of ONNX Runtime's inputs; any other is given single precision."""
Picture = npt.NDArray[np.uint8]
Shape = tuple[int, ...]


class Network(Protocol):
    """A loaded network: a picture in, its outputs out, in the order of the file.

    Attributes:
        inputs, outputs: their shapes by name, in the file's order; −1 where a size is not fixed.
        description: runtime and arithmetic, in a few words.
    """

    inputs: dict[str, Shape]
    outputs: dict[str, Shape]
    description: str

    def metadata(self, name: str) -> str | None:
        """What the file says under this name."""

    def run(self, picture: Picture, divisor: float = 1.0) -> list[Float32]:
        """The outputs, without the axis of the batch, for a picture (h,w,3).

        The first input takes the picture, planes of 0 … 255 over `divisor`; a second one its width and height [px].
        """


def load_network(path: Path, runtime: Runtime = "auto", precision: Precision = "auto", threads: int = 0) -> Network:
    """Load an ONNX file.

    Args:
        path: the file.
        runtime: auto takes OpenVINO where it is installed.
        precision: arithmetic of layers that are not 8-bit; auto takes bf16 where the CPU has it. OpenVINO only.
        threads: 0 leaves the number to the runtime.

    Raises:
        DataError: the file is missing, damaged (`check_digest`) or no ONNX network.
        SystemLibraryError: the runtime asked for is not installed.
    """
    if not path.is_file():
        raise DataError(f"detector weights {path} do not exist")
    check_digest(path)
    with path.open("rb") as stream:
        if stream.read(1) != FIRST_BYTE:
            raise DataError(f"{path} is no ONNX network")
    if runtime == "openvino":
        require("openvino", "the runtime openvino")
    if runtime == "onnxruntime" or not installed("openvino"):
        return OnnxRuntimeNetwork(path, threads)
    return OpenVinoNetwork(path, precision, threads)


class OpenVinoNetwork:
    """OpenVINO on the CPU; one compiled network for each of the last picture sizes, made when it is first met."""

    def __init__(self, path: Path, precision: Precision, threads: int) -> None:
        import openvino

        self._openvino, self._path = openvino, path
        self._core = openvino.Core()
        try:
            self._model = self._core.read_model(path)
        except RuntimeError as error:
            raise DataError(f"{path} is no ONNX network: {_last_line(error)}") from None
        self.inputs, self.outputs = (_ports(ports) for ports in (self._model.inputs, self._model.outputs))
        capable = "BF16" in self._core.get_property("CPU", "OPTIMIZATION_CAPABILITIES")
        self._precision = {"auto": "bf16" if capable else "f32", "bf16": "bf16", "fp32": "f32"}[precision]
        self._threads = threads
        self._requests: dict[tuple[object, ...], Any] = {}
        self.description = f"OpenVINO {self._precision}"

    def metadata(self, name: str) -> str | None:
        """See `Network.metadata`."""
        try:
            return str(self._model.get_rt_info(["framework", name]).astype(str))
        except RuntimeError:
            return None

    def run(self, picture: Picture, divisor: float = 1.0) -> list[Float32]:
        """See `Network.run`."""
        key = (*picture.shape, divisor)
        feeds = {0: picture[None]} | ({1: _width_and_height(picture)} if len(self.inputs) > 1 else {})
        try:
            request = self._requests.pop(key, None) or self._compile(picture.shape, divisor)
            for old in list(self._requests)[: 1 - _MOST_SIZES]:
                del self._requests[old]
            self._requests[key] = request
            results = request.infer(feeds, share_inputs=True)
        except RuntimeError as error:
            raise DataError(f"{self._path} cannot be run: {_last_line(error)}") from None
        return [np.atleast_1d(results[index])[0] for index in range(len(self.outputs))]

    def _compile(self, shape: tuple[int, ...], divisor: float) -> Any:  # noqa: ANN401 - OpenVINO's request
        openvino = self._openvino
        steps = openvino.preprocess.PrePostProcessor(self._model.clone())
        steps.input(0).tensor().set_element_type(openvino.Type.u8).set_layout(openvino.Layout("NHWC"))
        steps.input(0).model().set_layout(openvino.Layout("NCHW"))
        if divisor != 1.0:
            steps.input(0).preprocess().convert_element_type(openvino.Type.f32).scale(divisor)
        model = steps.build()
        model.reshape({0: [1, *shape]} | ({1: [1, 2]} if len(self.inputs) > 1 else {}))
        settings: dict[str, Any] = {
            "NUM_STREAMS": 1,
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": self._precision,
        }
        if self._threads > 0:
            settings["INFERENCE_NUM_THREADS"] = self._threads
        return self._core.compile_model(model, "CPU", settings).create_infer_request()


class OnnxRuntimeNetwork:
    """ONNX Runtime on the CPU; as fast as OpenVINO in float32."""

    def __init__(self, path: Path, threads: int) -> None:
        import onnxruntime
        from onnxruntime.capi import onnxruntime_pybind11_state as state

        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3
        if threads > 0:
            options.intra_op_num_threads = threads
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except (state.Fail, state.InvalidGraph, state.InvalidProtobuf, state.NotImplemented) as error:
            raise DataError(f"{path} is no ONNX network: {_last_line(error)}") from None
        self._path, self._failures = path, (state.Fail, state.InvalidArgument, state.RuntimeException)
        self.inputs, self.outputs = (
            {port.name: tuple(size if isinstance(size, int) else -1 for size in port.shape) for port in ports}
            for ports in (self._session.get_inputs(), self._session.get_outputs())
        )
        self._numbers = [_NUMBERS.get(port.type, np.float32) for port in self._session.get_inputs()]
        self.description = "ONNX Runtime"

    def metadata(self, name: str) -> str | None:
        """See `Network.metadata`."""
        found: str | None = self._session.get_modelmeta().custom_metadata_map.get(name)
        return found

    def run(self, picture: Picture, divisor: float = 1.0) -> list[Float32]:
        """See `Network.run`."""
        planes = np.ascontiguousarray(picture.transpose(2, 0, 1)[None], dtype=np.float32)
        given = (planes / np.float32(divisor), _width_and_height(picture))
        feeds = {
            name: np.asarray(value, numbers)
            for name, value, numbers in zip(self.inputs, given, self._numbers, strict=False)
        }
        try:
            return [np.atleast_1d(item)[0] for item in self._session.run(None, feeds)]
        except self._failures as error:
            raise DataError(f"{self._path} cannot be run: {_last_line(error)}") from None


def _ports(ports: Sequence[Any]) -> dict[str, Shape]:
    """Shapes of OpenVINO's ports, by name."""
    return {
        port.get_any_name(): tuple(size.get_length() if size.is_static else -1 for size in port.get_partial_shape())
        for port in ports
    }


def _width_and_height(picture: Picture) -> npt.NDArray[np.int64]:
    return np.array([picture.shape[1::-1]], dtype=np.int64)


def _last_line(error: Exception) -> str:
    return str(error).strip().splitlines()[-1]


def native_bf16() -> bool:
    """Whether OpenVINO is here and computes in bf16 on this CPU."""
    if not installed("openvino"):
        return False
    import openvino

    return "BF16" in openvino.Core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
