"""`shipland detect`: a far detector on pictures and videos."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shipland.commands.options import refuse_written_over
from shipland.commands.pictures import PictureOptions, look


@dataclass(frozen=True)
class Detect(PictureOptions):
    """Look for the ship or the bar with a learned detector in pictures, videos or a flight log.

    With --json, a line a picture: file, t_s (time in its video), boxes: [{x, y, w, h, confidence}] in pixels, x and y
    the left and top edge.
    Any detector's file will do whose outputs are laid out as YOLOX's, RT-DETR's or YOLOv8's.
    What cannot be read is named on standard error and the rest is looked at; the exit code is then 1, and 2 when
    nothing could be read.

    Example: shipland detect harbour.jpg film.mp4 --kind ship --json --out out/drawn

    Example: shipland detect harbour.jpg --weights yolox_nano.onnx --classes boat
    """

    kind: Literal["ship", "bar"] = "ship"
    """What to look for, with the packaged weights."""
    weights: str = ""
    """Packaged weights (ship, bar, frigate) or an ONNX file: of `shipland train`, or YOLOX, RT-DETR, YOLOv8; those of
    --kind when left out."""
    classes: tuple[str, ...] = ()
    """Names or numbers of the classes to look for, as `--classes boat` for COCO's; default all of the detector's."""
    confidence: float | None = None
    """Least confidence of a box."""
    config: Path | None = None
    """TOML laid over the detector's settings."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.report.drawings import draw_boxes
        from shipland.vision.far.detector import Detector
        from shipland.vision.far.files import COLUMNS, detect_paths
        from shipland.vision.parameters import detector_parameters

        refuse_written_over([self.csv], [*self.paths, self.config])
        settings = detector_parameters(self.config)
        detector = Detector.load(self.weights or self.kind, settings, self.classes)
        confidence = settings.acquire_confidence if self.confidence is None else self.confidence
        return look(
            self, COLUMNS, lambda it: draw_boxes(it.picture.image, it.boxes),
            lambda broken: detect_paths(self.paths, detector, confidence, broken),
        )  # fmt: skip
