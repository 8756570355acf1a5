"""`shipland train`: a detector from labelled pictures."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.errors import DataError
from shipland.files import write_atomically
from shipland.learning.arguments import TrainArguments


@dataclass(frozen=True)
class Train(TrainArguments):
    """Train a detector on labelled pictures in YOLO's layout (needs the extra `train`).

    Example: shipland train --data out/ship --out out/run
    """

    def run(self) -> int:
        """Train, evaluate, export, and draw what the detector makes of the held-out pictures."""
        try:
            from shipland.learning.train import train
        except ModuleNotFoundError as error:
            raise DataError(f"training needs {error.name}; install it with: pip install 'shipland[train]'") from None
        from shipland.learning.looks import looks_at
        from shipland.learning.metrics import Tally
        from shipland.report.looks_page import looks_page
        from shipland.vision.far.detector import Detector
        from shipland.vision.parameters import detector_parameters

        trained = train(self)
        settings, parts = detector_parameters(self.config), trained.parts
        tally = Tally(trained.parameters.match_iou)
        looks = list(looks_at(Detector.load(str(trained.detector), settings), trained.validation, [tally]))
        least = settings.acquire_confidence
        summary = (
            f"{len(looks)} of the pictures held out ({parts.how}): average precision {tally.average_precision():.3f}, "
            f"recall {tally.recall(least):.3f} and precision {tally.precision(least):.3f} at IoU {tally.min_iou:g} and "
            f"confidence {least:g}. {parts.warning and 'WARNING: '}{parts.warning}"
        )
        page = looks_page(looks, least, f"{', '.join(trained.spec.classes)}: held-out pictures", summary)
        write_atomically(self.out / "looks.html", page.encode())
        print(f"{trained.detector}\n{self.out / 'looks.html'}")
        return 0
