"""A far detector over pictures, folders and videos."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipland.errors import DataError
from shipland.messages import Box
from shipland.vision.far.decode import PIXEL_CENTRE
from shipland.vision.far.detector import Detector
from shipland.vision.pictures import FilePicture, pictures_of

COLUMNS = ("file", "t_s", "x", "y", "w", "h", "confidence", "class")
"""Of the table."""


@dataclass(frozen=True)
class DetectResult:
    """What was found in one picture: boxes with their class's name, most confident first."""

    picture: FilePicture
    boxes: tuple[tuple[Box, str], ...]

    @property
    def found(self) -> bool:
        """Whether there is a box."""
        return bool(self.boxes)

    def to_json(self) -> dict[str, object]:
        """For a JSON line: x and y are a box's left and top edge, w and h its size [px], edges at whole numbers."""
        return {"file": self.picture.name, "t_s": self.picture.stamp_s, "boxes": self._boxes()}

    def _boxes(self) -> list[dict[str, object]]:
        rows: list[dict[str, object]] = []
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
        return rows

    def to_rows(self) -> list[dict[str, object]]:
        """For a table: a row a box; one without a box where nothing was found."""
        picture: dict[str, object] = {"file": self.picture.name, "t_s": self.picture.stamp_s}
        return [picture | box for box in self._boxes()] or [picture]

    def to_line(self) -> str:
        """For people."""
        if not self.boxes:
            return f"{self.picture.name}: nothing found"
        found = (
            f"{name} {100.0 * box.confidence:.0f} % at ({box.centre_px[0]:.1f}, {box.centre_px[1]:.1f}) px, "
            f"{box.size_px[0]:.1f} × {box.size_px[1]:.1f} px"
            for box, name in self.boxes
        )
        return f"{self.picture.name}: " + "; ".join(found)


def detect_paths(
    paths: Sequence[Path],
    detector: Detector,
    confidence: float,
    broken: Callable[[Path, DataError], None] | None = None,
) -> Iterator[DetectResult]:
    """One result a picture, of boxes with a least confidence; paths, `broken` and DataError as of `pictures_of`."""
    if not 0.0 < confidence < 1.0:
        raise DataError(f"the least confidence must lie between 0 and 1, got {confidence:g}")
    for picture in pictures_of(paths, broken):
        yield DetectResult(picture, tuple(detector.detect_named(picture.image, confidence)))
