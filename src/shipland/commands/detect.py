"""`shipland detect`: a far detector on pictures and videos."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from shipland.errors import DataError


@dataclass(frozen=True)
class Detect:
    """Look for the ship or the bar with a learned detector in pictures and videos.

    One JSON line a picture: file, boxes: [{x, y, w, h, confidence}] in pixels, x and y the left and top edge. What
    cannot be read is named on standard error, the rest is looked at, and the exit code is 1.

    Example: shipland detect harbour.jpg film.mp4 --kind ship --json --out out/drawn
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Pictures, folders of pictures, videos."""
    kind: Literal["ship", "bar"] = "ship"
    """What to look for, with the packaged weights."""
    weights: Path | None = None
    """Another detector's ONNX file."""
    confidence: float | None = None
    """Least confidence of a box."""
    json: bool = False
    """JSON lines instead of lines for people."""
    out: Path | None = None
    """Folder for the pictures and videos with boxes drawn."""
    config: Path | None = None
    """TOML laid over the detector's settings."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.vision.far.detector import Detector, detector_parameters
        from shipland.vision.far.files import detect_paths

        settings = detector_parameters(self.config)
        detector = Detector.load(self.kind if self.weights is None else str(self.weights), settings)
        confidence = settings.acquire_confidence if self.confidence is None else self.confidence
        failed: list[Path] = []

        def broken(path: Path, error: DataError) -> None:
            failed.append(path)
            print(f"shipland: {error}", file=sys.stderr, flush=True)

        for result in detect_paths(self.paths, detector, confidence, self.out, broken):
            print(json.dumps(result.to_json()) if self.json else result.to_line(), flush=True)
        return 1 if failed else 0
