"""`shipland calibrate`: a camera's intrinsics from pictures of a board."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import Paths, say


@dataclass(frozen=True)
class Calibrate:
    """Calibrate a camera from pictures of a chessboard or ChArUco board.

    Writes an OpenCV calibration file, as every option --calibration takes it, and beside it a picture of where the
    corners lay.

    Example: shipland calibrate board/ --board 9x6 --square-m 0.025 --out camera.yaml
    """

    paths: Paths
    """Pictures, or folders of pictures; a dozen or more, the board tilted and in every part of the picture."""
    board: str = "9x6"
    """Inner corners across x down."""
    square_m: float = 0.025
    """Side of a square; only the board's distance depends on it."""
    charuco: bool = False
    """The board carries ArUco markers."""
    marker_m: float | None = None
    """Side of a marker; three quarters of a square when left out."""
    dictionary: str = "DICT_4X4_50"
    """OpenCV's name of the markers' dictionary."""
    out: Path = Path("calibration.yaml")
    """Calibration file."""

    def run(self) -> int:
        """Calibrate and print the table."""
        from shipland.vision.calibration import Board, calibrate

        board = Board(self.board, self.square_m, self.charuco, self.marker_m, self.dictionary)
        print(calibrate(self.paths, board, self.out).to_text())
        say(f"{self.out}; where the corners lay: {self.out.with_suffix('.png')}")
        return 0
