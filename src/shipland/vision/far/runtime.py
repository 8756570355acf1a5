"""Running an ONNX detector on the CPU: OpenVINO (an extra), else ONNX Runtime. Both are imported late."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.extras import installed, require
from shipland.files import check_digest
from shipland.vision.far.decode import STRIDES, DetectorSpec, Float32
from shipland.vision.far.parameters import Precision, Runtime

INPUT_NAME = "picture"
METADATA_KEY = "shipland_detector"
FIRST_BYTE = b"\x08"
"""ONNX files start with field 1 of their protobuf, the version."""
Picture = npt.NDArray[np.uint8]


class Engine(Protocol):
    """A loaded network."""

    @property
    def spec(self) -> DetectorSpec:
        """What the weights file says of itself."""

    @property
    def description(self) -> str:
        """Runtime and arithmetic, in a few words."""

    def maps(self, picture: Picture) -> list[Float32]:
        """Raw maps, finest scale first, of a picture (h,w,3) BGR whose sides are multiples of 32."""


def load_engine(path: Path, runtime: Runtime = "auto", precision: Precision = "auto", threads: int = 0) -> Engine:
    """Load a detector's ONNX file.

    Args:
        path: the file, as `shipland train` writes it.
        runtime: auto takes OpenVINO where it is installed.
        precision: arithmetic of layers that are not 8-bit; auto takes bf16 where the CPU has it. OpenVINO only.
        threads: 0 leaves the number to the runtime.

    Raises:
        DataError: the file is missing, damaged (`check_digest`), broken or no detector of this project.
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
        return OnnxRuntimeEngine(path, threads)
    return OpenVinoEngine(path, precision, threads)


def _check_picture(picture: Picture) -> None:
    if picture.ndim != 3 or picture.shape[2] != 3 or any(side % STRIDES[-1] for side in picture.shape[:2]):
        raise ValueError(f"a detector wants (h, w, 3) with sides in multiples of {STRIDES[-1]}, got {picture.shape}")


class OpenVinoEngine:
    """OpenVINO on the CPU; one compiled network for each picture size, made when it is first met."""

    def __init__(self, path: Path, precision: Precision, threads: int) -> None:
        import openvino

        self._openvino = openvino
        self._core = openvino.Core()
        try:
            self._model = self._core.read_model(path)
        except RuntimeError as error:
            raise DataError(f"{path} is no ONNX network: {str(error).strip().splitlines()[-1]}") from None
        try:
            text = self._model.get_rt_info(["framework", METADATA_KEY]).astype(str)
        except RuntimeError:
            raise DataError(f"{path} is no shipland detector: it lacks the metadata {METADATA_KEY!r}") from None
        self.spec = DetectorSpec.from_json(text, str(path))
        capable = "BF16" in self._core.get_property("CPU", "OPTIMIZATION_CAPABILITIES")
        self._precision = {"auto": "bf16" if capable else "f32", "bf16": "bf16", "fp32": "f32"}[precision]
        self._threads = threads
        self._requests: dict[tuple[int, ...], Any] = {}
        self.description = f"OpenVINO {self._precision}"

    def maps(self, picture: Picture) -> list[Float32]:
        """See `Engine.maps`."""
        _check_picture(picture)
        request = self._requests.get(picture.shape)
        if request is None:
            request = self._requests[picture.shape] = self._compile(picture.shape)
        results = request.infer({0: picture[None]}, share_inputs=True)
        return [results[index][0] for index in range(len(STRIDES))]

    def _compile(self, shape: tuple[int, ...]) -> Any:  # noqa: ANN401 - OpenVINO's request
        openvino = self._openvino
        steps = openvino.preprocess.PrePostProcessor(self._model.clone())
        steps.input().tensor().set_element_type(openvino.Type.u8).set_layout(openvino.Layout("NHWC"))
        steps.input().model().set_layout(openvino.Layout("NCHW"))
        model = steps.build()
        model.reshape([1, *shape])
        settings: dict[str, Any] = {
            "NUM_STREAMS": 1,
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": self._precision,
        }
        if self._threads > 0:
            settings["INFERENCE_NUM_THREADS"] = self._threads
        return self._core.compile_model(model, "CPU", settings).create_infer_request()


class OnnxRuntimeEngine:
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
            raise DataError(f"{path} is no ONNX network: {str(error).strip().splitlines()[-1]}") from None
        text = self._session.get_modelmeta().custom_metadata_map.get(METADATA_KEY)
        if text is None:
            raise DataError(f"{path} is no shipland detector: it lacks the metadata {METADATA_KEY!r}")
        self.spec = DetectorSpec.from_json(text, str(path))
        self.description = "ONNX Runtime"

    def maps(self, picture: Picture) -> list[Float32]:
        """See `Engine.maps`."""
        _check_picture(picture)
        planes = np.ascontiguousarray(picture.transpose(2, 0, 1)[None], dtype=np.float32)
        return [item[0] for item in self._session.run(None, {INPUT_NAME: planes})]


def native_bf16() -> bool:
    """Whether OpenVINO is here and computes in bf16 on this CPU."""
    if not installed("openvino"):
        return False
    import openvino

    return "BF16" in openvino.Core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
