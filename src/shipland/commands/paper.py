"""`shipland paper`: the paper's figures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.reproduce import FigureName


@dataclass(frozen=True)
class Paper:
    """Make the figures of the paper, each with its table: "The paper, reproduced" in the documentation.

    Leaves a picture a figure and table.md in the output folder, and says where each lies. The figure `touchdowns` flies
    landings, a second or two each: --runs says how many on each deck motion; without it, it is left out.

    With --flights, draws recorded flights instead: trajectories.png, commands.png (of the flight from farthest away)
    and landings.png.

    Example: shipland paper --only far-steps --out out/paper
    """

    out: Path = Path("out/paper")
    """Output folder; made when missing."""
    only: FigureName | None = None
    """One figure instead of all."""
    runs: int = 0
    """Landings of `touchdowns` on each of the paper's two deck motions; it flew 50."""
    flights: Path | None = None
    """Folder with logs of simulated flights, of `shipland fly` or `shipland campaign --logs`."""

    def run(self) -> int:
        """Make them."""
        from shipland.reproduce.paper import run_paper

        return run_paper(self.out, self.only, self.flights, self.runs)
