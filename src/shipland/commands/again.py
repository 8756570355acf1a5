"""`shipland again`: a logged flight flown anew, and the two side by side."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shipland.commands.options import Changes, command_line

if TYPE_CHECKING:
    from shipland.record.reader import FlightLog


@dataclass(frozen=True)
class Again:
    """Fly a logged flight of the simulator again, with its configuration and seed, and show the two side by side.

    The same code flies the same flight, bit for bit; --set, --pilot and --vision change it. Says where the two part,
    and when the log was flown by another version. Leaves what `shipland fly` leaves, and side-by-side.png. Exit code:
    0 landed in the square, 1 not.

    Example: shipland again out/flight/flight.mcap

    Example: shipland again out/flight/flight.mcap --set wind.mean_mps=7 --out out/windier
    """

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]
    """flight.mcap of a simulated flight."""
    changes: Changes = ()
    """One value laid over what was flown, as `--set wind.mean_mps=5`; may be given again and again."""
    pilot: str = ""
    """Who flies; not given: who flew."""
    vision: str = ""
    """Who sees; not given: who saw."""
    vehicle_config: Path | None = None
    """As `shipland fly` took it, where it did."""
    out: Path = Path("out/again")
    """Output folder; made when missing."""
    video: bool = False
    """Write flight.mp4."""

    def run(self) -> int:
        """Fly, compare, draw; 0 when landed in the square, 1 when not."""
        from shipland.api import fly
        from shipland.errors import ConfigError
        from shipland.evaluation.replays import flown_setup
        from shipland.record.reader import read_log
        from shipland.report.again import comparison, plot_pair, versions
        from shipland.report.outputs import LOG_NAME
        from shipland.scenario.autonomy import response_of
        from shipland.scenario.real_vehicle import identified

        if self.out.resolve() == self.log.resolve().parent:
            raise ConfigError(f"--out {self.out} is where {self.log.name} lies, which would be written over")
        before = read_log(self.log)
        seed = self._seed(before)
        scenario, pilot, vision = flown_setup(before, self.log, self.pilot, self.vision, self.changes)
        response = None
        if self.vehicle_config is not None:
            response = identified(self.vehicle_config, response_of(scenario))
        if words := versions(before):
            print(words, file=sys.stderr)
        print(f"{scenario.name}, seed {seed}, pilot {pilot}, vision {vision}", file=sys.stderr, flush=True)
        flight = fly(
            scenario, pilot=pilot, vision=vision, seed=seed, out=self.out, video=self.video, command=command_line(),
            response=response,
        )  # fmt: skip
        after = read_log(self.out / LOG_NAME)
        for line in comparison(before, after):
            print(line)
        if before.records and after.records:
            plot_pair(self.out / "side-by-side.png", before, after)
            print(f"{self.out / 'side-by-side.png'}", file=sys.stderr)
        return 0 if flight.success else 1

    def _seed(self, before: FlightLog) -> int:
        """The seed of a simulated flight; DataError for another."""
        from shipland.errors import DataError

        info = before.header.info
        words = [word.partition("=")[0] for word in shlex.split(info.command)]
        if info.seed is None or "--vehicle" in words:
            raise DataError(f"{self.log} is no flight of the simulator: only that can be flown again; see `replay`")
        if "--vehicle-config" in words and self.vehicle_config is None:
            print("it was flown with --vehicle-config, which the log does not hold: give it again", file=sys.stderr)
        return info.seed
