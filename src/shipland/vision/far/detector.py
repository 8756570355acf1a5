"""A learned detector over one picture: whole frames and tiles at native size, never shrunk to the network.

At 250 m the 1.8 m platform is 6.7 px wide in a 1280-px frame (erratum 9 of [Lee2022]); a detector that shrinks the
frame cannot see it. Only a tile around a target that is already large is reduced.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.messages import Box
from shipland.vision.far.decode import STRIDES, Float32, decode, suppress, to_boxes
from shipland.vision.far.parameters import DetectorParameters, Precision
from shipland.vision.far.runtime import Engine, load_engine, native_bf16

Picture = npt.NDArray[np.uint8]


def weights_path(name: str, precision: Precision = "auto") -> Path:
    """The file of packaged weights, or `name` as a path.

    Packaged detectors come twice: `NAME.onnx` (16-bit weights) and `NAME-int8.onnx`. On a CPU without bf16 the 8-bit
    file is the faster one and is taken, unless `precision` asks for something else.

    Raises:
        DataError: neither packaged weights nor a file.
    """
    folder = Path(str(resources.files("shipland"))) / "weights"
    packaged = folder / f"{name}.onnx"
    if packaged.is_file():
        small = folder / f"{name}-int8.onnx"
        return small if precision == "auto" and small.is_file() and not native_bf16() else packaged
    path = Path(name)
    if path.is_file():
        return path
    known = sorted(item.stem for item in folder.glob("*.onnx")) if folder.is_dir() else []
    raise DataError(f"no detector weights {name!r}: give a file, or one of the packaged: {', '.join(known) or 'none'}")


class Detector:
    """One network with its decoding: pictures in, boxes out."""

    def __init__(self, engine: Engine, max_iou: float) -> None:
        self.engine = engine
        self.max_iou = max_iou

    @staticmethod
    def load(name: str, parameters: DetectorParameters) -> Detector:
        """The detector of packaged weights, or of an ONNX file; DataError when it cannot be used."""
        path = weights_path(name, parameters.precision)
        engine = load_engine(path, parameters.runtime, parameters.precision, parameters.threads)
        return Detector(engine, parameters.max_iou)

    def detect(self, picture: Picture, min_confidence: float, kind: int = 0) -> list[Box]:
        """Boxes of class `kind` in a whole picture (h,w,3) BGR, most confident first.

        The picture keeps its own size, unless the weights were trained on pictures scaled to one (`fit_px`).
        """
        seen, scale = picture, 1.0
        if fit_px := self.engine.spec.fit_px:
            scale = max(picture.shape[:2]) / fit_px
            size = [max(1, round(side / scale)) for side in picture.shape[1::-1]]
            seen = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), np.uint8)
        boxes, scores = self._boxes(padded(seen), min_confidence, kind)
        return _inside(to_boxes(boxes, scores, (0.0, 0.0), scale), picture)

    def detect_in_tile(
        self,
        picture: Picture,
        centre_px: tuple[float, float],
        tile_px: int,
        reduction: int,
        min_confidence: float,
        kind: int = 0,
    ) -> list[Box]:
        """Boxes in a square tile, in the whole picture's pixels.

        Args:
            picture: (h,w,3) BGR.
            centre_px: (column, row) that the tile is laid around; it is moved to stay inside the picture.
            tile_px: side of what the network sees, a multiple of 32.
            reduction: whole number by which the tile is shrunk first; 1 keeps native pixels.
            min_confidence: least confidence.
            kind: class.
        """
        tile, origin_px = cut_tile(picture, centre_px, tile_px * reduction)
        if reduction > 1:
            tile = np.asarray(cv2.resize(tile, (tile_px, tile_px), interpolation=cv2.INTER_AREA), np.uint8)
        boxes, scores = self._boxes(tile, min_confidence, kind)
        return _inside(to_boxes(boxes, scores, origin_px, float(reduction)), picture)

    def _boxes(self, picture: Picture, min_confidence: float, kind: int) -> tuple[Float32, Float32]:
        spec = self.engine.spec
        candidates = decode(self.engine.maps(picture), spec, min_confidence)
        boxes, scores, kinds = suppress(*candidates, max_iou=self.max_iou, merge=True)
        return boxes[kinds == kind], scores[kinds == kind]


def _inside(boxes: list[Box], picture: Picture) -> list[Box]:
    """Those boxes whose centre lies in the picture, not in what it was continued by."""
    height, width = picture.shape[:2]
    return [box for box in boxes if 0.0 <= box.centre_px[0] + 0.5 <= width and 0.0 <= box.centre_px[1] + 0.5 <= height]


def padded(picture: Picture) -> Picture:
    """The picture continued to the right and downward to multiples of 32, mirrored at its last pixel.

    Repeating the last pixel instead draws stripes, which a detector takes for ships (measured).
    """
    height, width = picture.shape[:2]
    down, right = -height % STRIDES[-1], -width % STRIDES[-1]
    if not (down or right):
        return np.ascontiguousarray(picture)
    return np.asarray(cv2.copyMakeBorder(picture, 0, down, 0, right, cv2.BORDER_REFLECT_101), np.uint8)


def cut_tile(picture: Picture, centre_px: tuple[float, float], side_px: int) -> tuple[Picture, tuple[float, float]]:
    """A square of the picture and the (column, row) of its corner [px].

    The square is moved inside the picture where it fits; where the picture is smaller, it is continued mirrored.
    """
    height, width = picture.shape[:2]
    left = round(min(max(centre_px[0] - 0.5 * side_px, 0.0), max(width - side_px, 0)))
    top = round(min(max(centre_px[1] - 0.5 * side_px, 0.0), max(height - side_px, 0)))
    tile = picture[top : top + side_px, left : left + side_px]
    down, right = side_px - tile.shape[0], side_px - tile.shape[1]
    if down or right:
        tile = np.asarray(cv2.copyMakeBorder(tile, 0, down, 0, right, cv2.BORDER_REFLECT_101), np.uint8)
    return np.ascontiguousarray(tile), (float(left), float(top))
