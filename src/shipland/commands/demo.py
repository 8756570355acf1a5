"""`shipland demo`: the flight to begin with."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

from shipland.commands.fly import Fly
from shipland.commands.options import say


@dataclass(frozen=True)
class Demo:
    """Fly from 250 m to a ship in sea state 6, camera in the loop; leaves film, plots and log.

    The same as `shipland fly --scenario demo`. Two minutes on two cores, and one more the first time. Exit code: 0
    landed in the square, 1 not.

    Example: shipland demo
    """

    seed: int = 1
    """Seed of everything random."""
    out: Path = Path("out/demo")
    """Output folder; made when missing."""

    def run(self) -> int:
        """Fly it, and say what to look at and what to do next."""
        code = Fly(scenario="demo", seed=self.seed, out=self.out).run()
        film, log = (shlex.quote(str(self.out / name)) for name in ("flight.mp4", "flight.mcap"))
        say(f"look at {film}; open {log} in Foxglove")
        say("next: shipland campaign --scenario near --runs 20 --out out/near20")
        return code
