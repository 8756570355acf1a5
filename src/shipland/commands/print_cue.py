"""`shipland print-cue`: a cue, or a chessboard, as a PDF in true size."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from shipland.commands.options import refuse_written_over, say
from shipland.extras import require


@dataclass(frozen=True)
class PrintCue:
    """Make a PDF of a cue in true size, or of a chessboard for `shipland calibrate`.

    What is larger than the paper comes on several sheets, which overlap by 15 mm: lay the crosses on one another. Print
    it at 100 % ("actual size") and measure the line of 100 mm at the foot. A cue stands on black: the near vision looks
    for what is lighter than around it.

    Example: shipland print-cue bar.toml --paper A3 --out bar.pdf

    Example: shipland print-cue --board 9x6 --square-m 0.025 --out board.pdf
    """

    cue: Annotated[Path | None, tyro.conf.Positional] = None
    """TOML file of a cue, as `shipland see --cue` takes it; the rig's bar when left out."""
    board: str = ""
    """Print a chessboard instead, with so many inner corners across x down."""
    square_m: float = 0.025
    """Side of the chessboard's squares."""
    paper: str = "A4"
    """A4, A3, A2, A1, A0, Letter or Tabloid."""
    out: Path = Path("cue.pdf")
    """The file; written over."""

    def run(self) -> int:
        """Write it and say how to print it."""
        require("plots", "`shipland print-cue`")
        from shipland.cue import Cue
        from shipland.errors import ConfigError
        from shipland.report.print_sheets import chessboard_drawing, cue_drawing, print_sheets, words_of
        from shipland.scenario.scenario import load_scenario

        refuse_written_over([self.out], [self.cue])
        if self.board and self.cue is not None:
            raise ConfigError("give either a cue or --board")
        if self.board:
            drawing, title = chessboard_drawing(self.board, self.square_m), f"chessboard {self.board}"
        else:
            rig = load_scenario({})
            cue = rig.rig.cue if self.cue is None else Cue.from_file(self.cue)
            drawing = cue_drawing(cue, rig.vision.hue)
            say(f"cue: {cue.size_words}")
            title = "the rig's bar" if self.cue is None else self.cue.name
        sheets = print_sheets(self.out, drawing, self.paper, title)
        print(f"{self.out}: {title}, {words_of(drawing, sheets, self.paper)}")
        say("print at 100 % (actual size), then measure the line of 100 mm at the foot")
        return 0
