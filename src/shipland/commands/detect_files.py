"""A far detector over pictures, folders and videos: what `shipland detect` does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import cv2
import numpy as np

from shipland.commands.see_files import PICTURE_SUFFIXES, VIDEO_SUFFIXES, read_picture, read_video
from shipland.errors import DataError
from shipland.messages import Box
from shipland.vision.far.decode import PIXEL_CENTRE
from shipland.vision.far.detector import Detector, Picture, detector_parameters
from shipland.vision.far.runtime import Precision, Runtime

_GREEN_BGR, _DARK_BGR = (80, 230, 40), (20, 20, 20)


@dataclass(frozen=True)
class DetectRequest:
    """What to look at.

    Attributes:
        paths: pictures, folders of pictures, videos.
        kind: what to look for, with the packaged weights.
        weights: another detector's ONNX file.
        confidence: least confidence of a box; None for `acquire_confidence` of [detector].
        out: folder for the pictures and videos with boxes drawn; None for none.
        runtime, precision, threads: how the network runs.
        config: TOML laid over the packaged settings.
    """

    paths: tuple[Path, ...]
    kind: Literal["ship", "bar"] = "ship"
    weights: Path | None = None
    confidence: float | None = None
    out: Path | None = None
    runtime: Runtime = "auto"
    precision: Precision = "auto"
    threads: int = 0
    config: Path | None = None


@dataclass(frozen=True)
class DetectResult:
    """What was found in one picture, most confident first.

    Attributes:
        file: its path as given; of a video's picture, with `#` and its number from 000000.
        boxes: boxes with their class's name.
    """

    file: str
    boxes: tuple[tuple[Box, str], ...]

    def to_json(self) -> dict[str, object]:
        """For a JSON line: x and y are a box's left and top edge, w and h its size [px], edges at whole numbers."""
        rows = []
        for box, name in self.boxes:
            (column, row), (width, height) = box.centre_px, box.size_px
            rows.append(
                {
                    "x": round(column + PIXEL_CENTRE - 0.5 * width, 2),
                    "y": round(row + PIXEL_CENTRE - 0.5 * height, 2),
                    "w": round(width, 2),
                    "h": round(height, 2),
                    "confidence": round(box.confidence, 4),
                    "class": name,
                }
            )
        return {"file": self.file, "boxes": rows}

    def to_line(self) -> str:
        """For people."""
        if not self.boxes:
            return f"{self.file}: nothing found"
        found = (
            f"{name} {100.0 * box.confidence:.0f} % at ({box.centre_px[0]:.1f}, {box.centre_px[1]:.1f}) px, "
            f"{box.size_px[0]:.1f} × {box.size_px[1]:.1f} px"
            for box, name in self.boxes
        )
        return f"{self.file}: " + "; ".join(found)


def detect_paths(request: DetectRequest) -> Iterator[DetectResult]:
    """One result a picture, in the order given; a folder's pictures by name, a video's in time.

    Raises:
        DataError: weights, a picture or a video are missing or broken, or two files would be drawn to one place.
        ConfigError: a setting is wrong.
    """
    if not request.paths:
        raise DataError("nothing to look at; give at least one picture, folder of pictures or video")
    settings = replace(
        detector_parameters(request.config),
        runtime=request.runtime,
        precision=request.precision,
        threads=request.threads,
    )
    weights = request.kind if request.weights is None else str(request.weights)
    confidence = settings.acquire_confidence if request.confidence is None else request.confidence
    if not 0.0 < confidence < 1.0:
        raise DataError(f"the least confidence must lie between 0 and 1, got {confidence:g}")
    look = _Look(Detector.load(weights, settings), confidence, request.out)
    for path in request.paths:
        yield from _detect_path(path, look)


class _Look:
    """A detector and the places that drawings go to."""

    def __init__(self, detector: Detector, confidence: float, out: Path | None) -> None:
        self.detector, self.confidence, self.out = detector, confidence, out
        self._taken: set[Path] = set()

    def boxes(self, picture: Picture) -> tuple[tuple[Box, str], ...]:
        """Boxes of all classes, most confident first."""
        found = [
            (box, name)
            for kind, name in enumerate(self.detector.engine.spec.classes)
            for box in self.detector.detect(picture, self.confidence, kind)
        ]
        return tuple(sorted(found, key=lambda item: -item[0].confidence))

    def place(self, source: Path, suffix: str) -> Path | None:
        """Where the drawing of `source` goes; DataError when another file's went there."""
        if self.out is None:
            return None
        self.out.mkdir(parents=True, exist_ok=True)
        place = self.out / f"{source.stem}{suffix}"
        if place in self._taken or (place.exists() and place.samefile(source)):
            raise DataError(f"{source} would be drawn over {place}: give files of one name in separate runs")
        self._taken.add(place)
        return place


def _detect_path(path: Path, look: _Look) -> Iterator[DetectResult]:
    if path.is_dir():
        names = sorted(item for item in path.iterdir() if item.suffix.lower() in PICTURE_SUFFIXES and item.is_file())
        if not names:
            raise DataError(f"folder {path} holds no pictures; expected {', '.join(sorted(PICTURE_SUFFIXES))}")
        for name in names:
            yield _detect_picture(name, look)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        place = look.place(path, ".mp4")
        with _VideoOut(place) as drawn:
            for index, (t_s, picture) in enumerate(read_video(path)):
                boxes = look.boxes(picture)
                if place is not None:
                    drawn.write(draw_boxes(picture, boxes), t_s)
                yield DetectResult(f"{path}#{index:06d}", boxes)
    else:
        yield _detect_picture(path, look)


def _detect_picture(path: Path, look: _Look) -> DetectResult:
    picture = read_picture(path)
    boxes = look.boxes(picture)
    place = look.place(path, ".jpg")
    if place is not None:
        data = cv2.imencode(".jpg", draw_boxes(picture, boxes), [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
        place.write_bytes(data.tobytes())
    return DetectResult(str(path), boxes)


def draw_boxes(picture: Picture, boxes: tuple[tuple[Box, str], ...]) -> Picture:
    """A copy of a picture (h,w,3) BGR with frames just outside the boxes, each with its class and confidence."""
    drawn = picture.copy()
    scale = max(1, round(picture.shape[1] / 1280))
    for box, name in boxes:
        centre, half = np.array(box.centre_px), 0.5 * np.array(box.size_px) + 2.0 * scale
        left, top, right, bottom = (int(value) for value in np.round([*(centre - half), *(centre + half)]))
        text = f"{name} {100.0 * box.confidence:.0f} %"
        above = top - 6 * scale if top > 24 * scale else bottom + 18 * scale
        for colour, thick in ((_DARK_BGR, 3 * scale), (_GREEN_BGR, scale)):
            cv2.rectangle(drawn, (left, top), (right, bottom), colour, thick)
            cv2.putText(drawn, text, (left, above), cv2.FONT_HERSHEY_SIMPLEX, 0.5 * scale, colour, thick, cv2.LINE_AA)
    return drawn


class _VideoOut:
    """An H.264 file that opens with its first picture; nothing without a path."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._container: Any = None
        self._stream: Any = None

    def __enter__(self) -> _VideoOut:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._container is not None:
            for packet in self._stream.encode():
                self._container.mux(packet)
            self._container.close()

    def write(self, picture: Picture, t_s: float) -> None:
        """Add a picture at its time; sides are cut to even numbers."""
        import av

        height, width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
        if self._container is None:
            self._container = av.open(str(self._path), "w")
            self._stream = self._container.add_stream("libx264", rate=30)
            self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
            self._stream.time_base = self._stream.codec_context.time_base = Fraction(1, 90000)
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="bgr24")
        frame.pts, frame.time_base = round(90000 * t_s), Fraction(1, 90000)
        for packet in self._stream.encode(frame):
            self._container.mux(packet)
