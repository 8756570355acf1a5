"""`shipland train`: a detector from labelled pictures."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.errors import DataError
from shipland.learning.arguments import TrainArguments


@dataclass(frozen=True)
class Train(TrainArguments):
    """Train a detector on labelled pictures in YOLO's layout (needs the extra `train`).

    Example: shipland train --data out/ship --out out/run
    """

    def run(self) -> int:
        """Train, evaluate, export."""
        try:
            from shipland.learning.train import train
        except ModuleNotFoundError as error:
            raise DataError(f"training needs {error.name}; install it with: pip install 'shipland[train]'") from None
        print(train(self))
        return 0
