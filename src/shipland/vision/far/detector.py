"""A learned detector over one picture: whole frames and tiles at native size, never shrunk to the network.

At 250 m the 1.8 m platform is 6.7 px wide in a 1280-px frame (erratum 9 of [Lee2022]); a detector that shrinks the
frame cannot see it. Only a tile around a target that is already large is reduced.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.config import build, layered, require, require_within
from shipland.errors import DataError
from shipland.messages import Box
from shipland.vision.far.decode import STRIDES, Float32, decode, suppress, to_boxes
from shipland.vision.far.runtime import Engine, Precision, Runtime, load_engine, native_bf16

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Confirmation:
    """When a candidate is believed (`[detector.ship]`, `[detector.bar]`).

    Attributes:
        start_confidence: least confidence that starts a candidate, on the whole frame.
        track_confidence: least confidence that continues one, or the target.
        confirm_hits, confirm_frames: a track is believed after so many hits in so many frames, and enough evidence.
        neutral_confidence: a box of this confidence, where the track expects it, speaks neither for nor against.
        believe_evidence: log-odds above neutral that a track must gather, its size's included.
        doubt_evidence: a target whose boxes have gathered less than minus this is given up.
        most_evidence: log-odds that it can gather at most.
        miss_evidence: log-odds that a frame without a box takes away.
        size_weight: what the log-odds of the box's size at its place count by, against those of single frames, which
            repeat one another.
    """

    start_confidence: float
    track_confidence: float
    confirm_hits: int
    confirm_frames: int
    neutral_confidence: float
    believe_evidence: float
    doubt_evidence: float
    most_evidence: float
    miss_evidence: float
    size_weight: float

    def __post_init__(self) -> None:
        for name in ("start_confidence", "track_confidence", "neutral_confidence"):
            require(0.0 < getattr(self, name) <= 1.0, f"{name} must lie in 0 … 1, got {getattr(self, name)}")
        require(1 <= self.confirm_hits <= self.confirm_frames, "confirm_hits must lie in 1 … confirm_frames")
        require(0.0 <= self.believe_evidence <= self.most_evidence, "believe_evidence must lie in 0 … most_evidence")
        for name in ("doubt_evidence", "miss_evidence", "size_weight"):
            require(getattr(self, name) >= 0.0, f"{name} must not be negative, got {getattr(self, name)}")


@dataclass(frozen=True)
class DetectorParameters:
    """How the far detectors run (`[detector]` in configs/learning.toml).

    Attributes:
        ship_weights, bar_weights: name of packaged weights (`ship`, `bar`) or path of an ONNX file.
        runtime: auto, openvino or onnxruntime.
        precision: auto, bf16 or fp32.
        threads: CPU threads; 0 leaves it to the runtime.
        acquire_confidence: least confidence of a box in a single picture, where nothing else is known.
        ship, bar: when a candidate is believed.
        max_iou: overlap above which the less confident of two boxes goes.
        tile_min_px, tile_max_px: side of the square tile around a track, multiples of 32.
        tile_per_target: the tile's side over the target's longer side, at least.
        gate_px, gate_px_s, gate_sizes: a track takes a box whose centre lies within gate_px + gate_px_s × the time
            since its last box + gate_sizes × its longer side.
        gate_growth: largest ratio of the sides of two boxes one frame apart that a track takes.
        most_candidates: candidates at a time.
        horizon_margin_deg: how far above the horizon the foot of a ship may seem to lie: the gimbal's error.
        ship_rise, bar_rise: how far above the horizon the box's middle may lie besides, in its own longer sides;
            negative for a box whose foot must lie below.
        height_sd_m, horizon_sd_deg: errors of the camera's height over the water and of the horizon.
        span_sd: spread of the target's apparent width, by its aspect and the box's error, as a share of it.
        other_sd: spread of the width of other things, likewise.
        lost_frames: a track ends after so many frames without a hit.
        stale_s: a track ends when no frame came for so long.
        sure_confidence: a target of at least this mean confidence, without a rival, is sure.
        recheck_frames: a whole frame is searched again every so many frames while the target is sure,
        doubt_frames: or every so many while it is not.
        recheck_margin: log-odds by which a rival's mean must be better to take over.
        sureness_gain: weight of a new box in the running mean of a track's confidence, 0 … 1.
        bar_search_ship_px: width of the ship's box from which on the bar is looked for inside it.
        velocity_gain: weight of a new box's displacement in a track's velocity, 0 … 1.
    """

    ship_weights: str
    bar_weights: str
    runtime: Runtime
    precision: Precision
    threads: int
    acquire_confidence: float
    ship: Confirmation
    bar: Confirmation
    max_iou: float
    tile_min_px: int
    tile_max_px: int
    tile_per_target: float
    gate_px: float
    gate_px_s: float
    gate_sizes: float
    gate_growth: float
    most_candidates: int
    horizon_margin_deg: float
    ship_rise: float
    bar_rise: float
    height_sd_m: float
    horizon_sd_deg: float
    span_sd: float
    other_sd: float
    lost_frames: int
    stale_s: float
    sure_confidence: float
    recheck_frames: int
    doubt_frames: int
    recheck_margin: float
    sureness_gain: float
    bar_search_ship_px: float
    velocity_gain: float

    def __post_init__(self) -> None:
        shares = "acquire_confidence sure_confidence max_iou velocity_gain"
        for name in (*shares.split(), "sureness_gain"):
            require(0.0 < getattr(self, name) <= 1.0, f"{name} must lie in 0 … 1, got {getattr(self, name)}")
        require(
            0 < self.tile_min_px <= self.tile_max_px and not (self.tile_min_px % 32 or self.tile_max_px % 32),
            "tile_min_px ≤ tile_max_px must be multiples of 32",
        )
        for name in ("height_sd_m", "horizon_sd_deg", "span_sd", "other_sd"):
            require(getattr(self, name) > 0.0, f"{name} must be positive, got {getattr(self, name)}")
        require(self.tile_per_target > 1.0, "tile_per_target must exceed 1")
        require(self.gate_growth > 1.0, "gate_growth must exceed 1")
        for name in ("recheck_frames", "doubt_frames"):
            require(getattr(self, name) >= 1, f"{name} must be positive")
        require_within(self, threads=(0, 256), stale_s=(0.1, 10.0), lost_frames=(1, 1000), most_candidates=(1, 100))


def detector_parameters(config: Path | None = None) -> DetectorParameters:
    """The packaged `[detector]` of configs/learning.toml, that of the file `config` laid over it."""
    return build(DetectorParameters, layered("learning", config)["detector"], "detector")


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
