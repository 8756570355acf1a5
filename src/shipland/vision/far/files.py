"""A far detector over pictures, folders and videos."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from shipland.errors import DataError
from shipland.messages import Box
from shipland.vision.far.decode import PIXEL_CENTRE
from shipland.vision.far.detector import Detector
from shipland.vision.pictures import FilePicture, Picture, is_video, pictures_of

_GREEN_BGR, _DARK_BGR = (80, 230, 40), (20, 20, 20)


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


def detect_paths(
    paths: Sequence[Path],
    detector: Detector,
    confidence: float,
    out: Path | None,
    broken: Callable[[Path, DataError], None] | None = None,
) -> Iterator[DetectResult]:
    """One result a picture, in the order of `pictures_of`.

    Args:
        paths: pictures, folders of pictures, videos.
        detector: what looks at them.
        confidence: least confidence of a box.
        out: folder for the pictures and videos with boxes drawn; None for none.
        broken: is told of a picture or video that is missing or broken, and the rest follows; None raises.

    Raises:
        DataError: without `broken`, a picture or video is missing or broken; two files would be drawn to one place.
    """
    if not 0.0 < confidence < 1.0:
        raise DataError(f"the least confidence must lie between 0 and 1, got {confidence:g}")
    with _Drawings(out) as drawings:
        for picture in pictures_of(paths, broken):
            found = [
                (box, name)
                for kind, name in enumerate(detector.engine.spec.classes)
                for box in detector.detect(picture.image, confidence, kind)
            ]
            boxes = tuple(sorted(found, key=lambda item: -item[0].confidence))
            drawings.add(picture, boxes)
            yield DetectResult(picture.name, boxes)


class _Drawings:
    """The folder that pictures and videos with boxes drawn go to; nothing without one."""

    def __init__(self, out: Path | None) -> None:
        self._out = out
        self._taken: set[Path] = set()
        self._video = _VideoOut(None)

    def __enter__(self) -> _Drawings:
        return self

    def __exit__(self, *_: object) -> None:
        self._video.close()

    def add(self, picture: FilePicture, boxes: tuple[tuple[Box, str], ...]) -> None:
        """Draw one picture; DataError when another file's drawing has its place."""
        if self._out is None:
            return
        if is_video(picture.source):
            if not picture.follows:
                self._video.close()
                self._video = _VideoOut(self._place(self._out, picture.source, ".mp4"))
            self._video.write(draw_boxes(picture.image, boxes), picture.t_s)
        else:
            place = self._place(self._out, picture.source, ".jpg")
            drawn = draw_boxes(picture.image, boxes)
            place.write_bytes(cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())

    def _place(self, out: Path, source: Path, suffix: str) -> Path:
        out.mkdir(parents=True, exist_ok=True)
        place = out / f"{source.stem}{suffix}"
        if place in self._taken or (place.exists() and place.samefile(source)):
            raise DataError(f"{source} would be drawn over {place}: give files of one name in separate runs")
        self._taken.add(place)
        return place


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

    def close(self) -> None:
        """Write what is left."""
        if self._container is not None:
            for packet in self._stream.encode():
                self._container.mux(packet)
            self._container.close()
            self._container = None

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
