"""`shipland paper`: the paper's figures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Paper:
    """Make the figures of the paper's controllers, each with its table: "The paper, reproduced" in the documentation.

    Leaves a picture a figure and table.md in the output folder. With --flights, draws recorded flights instead:
    trajectories.png, commands.png (of the flight from farthest away) and landings.png.

    Example: shipland paper --only far-steps --out out/paper
    """

    out: Path = Path("out/paper")
    """Output folder; made when missing."""
    only: Literal["roll-law", "far-steps", "far-readings", "derivative-gain", "near-false"] | None = None
    """One figure instead of all."""
    flights: Path | None = None
    """Folder with logs of simulated flights, of `shipland fly` or `shipland campaign --logs`."""

    def run(self) -> int:
        """Make them."""
        from shipland.reproduce.paper import run_paper

        return run_paper(self.out, self.only, self.flights)
