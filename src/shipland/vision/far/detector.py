"""A learned detector over one picture: whole frames and tiles at native size, never shrunk to the network.

At 250 m the 1.8 m platform is 6.7 px wide in a 1280-px frame (erratum 9 of [Lee2022]); a detector that shrinks the
frame cannot see it. Only a tile around a target that is already large is reduced.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.messages import Box
from shipland.vision.far.decode import STRIDES, Float32, suppress, to_boxes
from shipland.vision.far.layouts import Reader, load_reader
from shipland.vision.far.runtime import native_bf16
from shipland.vision.parameters import DetectorParameters, Precision

Picture = npt.NDArray[np.uint8]
Candidates = tuple[Float32, Float32, Float32]
"""Boxes (n,4), confidences (n,), classes' numbers (n,)."""
_GREY = 114
"""Beside pictures that do not fill the network's, as the YOLO family is trained."""
_OVERLAP = 0.25
"""Share of a tile that lies over its neighbour: what is at most that long is whole in one of them."""
_EDGE_PX = 2.0
"""A box this near to a tile's edge is cut by it."""


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
    """One network with its decoding: pictures in, boxes out.

    Attributes:
        reader: the network, and how it is read.
        max_iou: of two boxes of a class that overlap more, the less confident goes.
        kinds: number of every class that is looked for, and its name.
        tile_px: side of the tiles in which a network of one picture size searches whole pictures as well.
    """

    def __init__(
        self, reader: Reader, max_iou: float, kinds: Mapping[int, str] | None = None, tile_px: int = 416
    ) -> None:
        self.reader, self.max_iou, self.tile_px = reader, max_iou, tile_px
        self.kinds = dict(enumerate(reader.classes)) if kinds is None else dict(kinds)

    @staticmethod
    def load(name: str, parameters: DetectorParameters, classes: Sequence[str] = ()) -> Detector:
        """The detector of packaged weights, or of an ONNX file.

        Args:
            name: of packaged weights, or a path.
            parameters: runtime, arithmetic, threads, overlap and tiles.
            classes: names or numbers of the classes that are looked for; none for all. A detector of one class looks
                for that, whatever it is called.

        Raises:
            DataError: it cannot be used, or has no such class.
        """
        path = weights_path(name, parameters.precision)
        reader = load_reader(path, parameters.runtime, parameters.precision, parameters.threads)
        kinds = {_kind(item, reader.classes, path): item for item in classes}
        return Detector(reader, parameters.max_iou, kinds or None, parameters.tile_max_px)

    @property
    def description(self) -> str:
        """Runtime, arithmetic and the weights' own note."""
        return f"{self.reader.network.description}, {self.reader.note or 'no note'}"

    def detect(self, picture: Picture, min_confidence: float) -> list[Box]:
        """Boxes of the classes looked for in a whole picture (h,w,3) BGR, most confident first."""
        return [box for box, _ in self.detect_named(picture, min_confidence)]

    def detect_named(self, picture: Picture, min_confidence: float) -> list[tuple[Box, str]]:
        """The same with their classes' names.

        The picture keeps its own size, unless the weights were trained on pictures scaled to one (`fit_px`). A network
        that takes one size sees it whole, shrunk, and where it is larger in overlapping tiles as well.
        """
        height, width = picture.shape[:2]
        size_px, fit_px = self.reader.size_px, self.reader.fit_px
        if size_px is not None:
            scale = max(height / size_px[0], width / size_px[1])
            seen = np.full((*size_px, 3), _GREY, np.uint8)
            shrunk = _resized(picture, scale)[: size_px[0], : size_px[1]]
            seen[: shrunk.shape[0], : shrunk.shape[1]] = shrunk
            looks = [_mapped(self.reader.candidates(seen, min_confidence), (0.0, 0.0), scale)]
            if scale > 1.0 and max(height, width) > self.tile_px:
                looks += [self._tile(picture, at, self.tile_px, min_confidence) for at in _tiles(picture, self.tile_px)]
        else:
            scale = max(height, width) / fit_px if fit_px else 1.0
            seen = padded(_resized(picture, scale) if fit_px else picture)
            looks = [_mapped(self.reader.candidates(seen, min_confidence), (0.0, 0.0), scale)]
        return self._boxes(looks, picture)

    def detect_in_tile(
        self, picture: Picture, centre_px: tuple[float, float], tile_px: int, reduction: int, min_confidence: float
    ) -> list[Box]:
        """Boxes of the classes looked for in a square tile, in the whole picture's pixels.

        Args:
            picture: (h,w,3) BGR.
            centre_px: (column, row) that the tile is laid around; it is moved to stay inside the picture.
            tile_px: side of what the network sees, a multiple of 32; a network of one picture size sees the tile scaled
                to that.
            reduction: whole number by which the tile is shrunk first; 1 keeps native pixels.
            min_confidence: least confidence.
        """
        if self.reader.size_px is not None:
            look = self._tile(picture, centre_px, tile_px * reduction, min_confidence, whole=True)
        else:
            tile, origin_px = cut_tile(picture, centre_px, tile_px * reduction)
            if reduction > 1:
                tile = np.asarray(cv2.resize(tile, (tile_px, tile_px), interpolation=cv2.INTER_AREA), np.uint8)
            look = _mapped(self.reader.candidates(tile, min_confidence), origin_px, float(reduction))
        return [box for box, _ in self._boxes([look], picture)]

    def _tile(
        self, picture: Picture, centre_px: tuple[float, float], side_px: int, min_confidence: float, whole: bool = False
    ) -> Candidates:
        """What a network of one size sees in a tile scaled to it.

        Without `whole`, what its edge cuts or is longer than the overlap is left out: a neighbour or the whole picture
        shows that.
        """
        assert self.reader.size_px is not None
        rows, columns = self.reader.size_px
        tile, (left, top) = cut_tile(picture, centre_px, side_px)
        boxes, scores, kinds = self.reader.candidates(
            np.asarray(cv2.resize(tile, (columns, rows), interpolation=cv2.INTER_LINEAR), np.uint8), min_confidence
        )
        boxes = boxes * np.array([side_px / columns, side_px / rows] * 2, np.float32)
        if not whole:
            low, high = boxes[:, :2] - 0.5 * boxes[:, 2:], boxes[:, :2] + 0.5 * boxes[:, 2:]
            inner = np.array([left > 0, top > 0]), np.array([left, top]) + side_px < picture.shape[1::-1]
            cut = (inner[0] & (low < _EDGE_PX)) | (inner[1] & (high > side_px - _EDGE_PX))
            kept = ~cut.any(axis=1) & (boxes[:, 2:].max(axis=1, initial=0.0) <= _OVERLAP * side_px)
            boxes, scores, kinds = boxes[kept], scores[kept], kinds[kept]
        return _mapped((boxes, scores, kinds), (left, top), 1.0)

    def _boxes(self, looks: Sequence[Candidates], picture: Picture) -> list[tuple[Box, str]]:
        """What is left of candidates in the picture's pixels [edges]; a centre in what continues the picture is out."""
        boxes, scores, kinds = (np.concatenate(parts) for parts in zip(*looks, strict=True))
        wanted = np.isin(kinds, list(self.kinds))
        boxes, scores, kinds = suppress(boxes[wanted], scores[wanted], kinds[wanted], self.max_iou, merge=True)
        inside = ((boxes[:, :2] >= 0.0) & (boxes[:, :2] <= picture.shape[1::-1])).all(axis=1)
        found = to_boxes(boxes[inside], scores[inside], (0.0, 0.0), 1.0)
        return [(box, self.kinds[int(kind)]) for box, kind in zip(found, kinds[inside], strict=True)]


def _kind(wanted: str, classes: tuple[str, ...], path: Path) -> int:
    """The number of a class given by name or number."""
    if wanted in classes:
        return classes.index(wanted)
    if wanted.isdecimal() and int(wanted) < len(classes):
        return int(wanted)
    if len(classes) == 1:
        return 0
    raise DataError(
        f"{path} has no class {wanted!r}: name one of {', '.join(classes)}, or give its number, 0 … {len(classes) - 1}"
    )


def _mapped(found: Candidates, origin_px: tuple[float, float], scale: float) -> Candidates:
    """Candidates of a part in the picture's pixels: its corner [px, edges], and picture pixels per part pixel."""
    boxes, scores, kinds = found
    return np.float32(scale) * boxes + np.array([*origin_px, 0.0, 0.0], np.float32), scores, kinds


def _resized(picture: Picture, scale: float) -> Picture:
    """The picture made smaller by `scale`."""
    size = [max(1, round(side / scale)) for side in picture.shape[1::-1]]
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), np.uint8)


def _tiles(picture: Picture, side_px: int) -> list[tuple[float, float]]:
    """(column, row) of the middles of tiles over the whole picture, each lying over its neighbour."""
    axes = []
    for length in picture.shape[:2]:
        count = 1 if length <= side_px else 1 + int(np.ceil((length - side_px) / ((1.0 - _OVERLAP) * side_px)))
        axes.append(np.linspace(0.5 * side_px, max(length - 0.5 * side_px, 0.5 * side_px), count).tolist())
    return [(column, row) for row in axes[0] for column in axes[1]]


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
