"""`shipland again`: a logged flight flown anew, and the two side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.options import Changes, PathArgument, command_line, require_record, say, say_if_broken_off
from shipland.errors import ConfigError, DataError
from shipland.extras import installed

if TYPE_CHECKING:
    from shipland.evaluation.replays import PastFlight


@dataclass(frozen=True)
class Again:
    """Fly a logged flight anew, and show the two side by side.

    Configuration, seed, pilot and vision are those of the log, which is one of the simulator. Of a campaign, give the
    folder of a cell and --seed; where the campaign kept no log of that flight there is nothing to compare with. The
    same code flies the same flight, bit for bit; --set, --pilot and --vision change it. Says where the two part, and
    when the log was flown by another version. Leaves what `shipland fly` leaves, and side-by-side.png. Exit code: 0
    landed in the square, 1 not.

    Example: shipland again out/flight/flight.mcap

    Example: shipland again out/flight/flight.mcap --set wind.mean_mps=7 --out out/windier

    Example: shipland again out/near/near_horizon --seed 17 --video
    """

    log: PathArgument
    """Log (flight.mcap) of a simulated flight or its folder, or the folder of a campaign's cell."""
    seed: int | None = None
    """Which flight of a cell."""
    changes: Changes = ()
    """One value laid over what was flown, as `--set wind.mean_mps=5`; may be given again and again."""
    pilot: str = ""
    """Who flies; not given: who flew."""
    vision: str = ""
    """Who sees; not given: who saw."""
    vehicle_config: Path | None = None
    """As `shipland fly` took it, where it did."""
    out: Path | None = None
    """Output folder; made when missing. Not given: out/again; of a cell flights/SEED in its folder, whose film
    `shipland report` links."""
    video: bool = False
    """Write flight.mp4."""

    def run(self) -> int:
        """Fly, compare, draw; 0 when landed in the square, 1 when not."""
        from shipland.api import fly
        from shipland.evaluation.replays import flown_in_cell
        from shipland.record.reader import read_log
        from shipland.report.again import comparison, plot_pair, versions
        from shipland.report.outputs import LOG_NAME, log_in
        from shipland.scenario.autonomy import response_of
        from shipland.scenario.real_vehicle import identified

        log = log_in(self.log)
        if not log.is_dir():
            known = self._of_a_log(log)
        elif self.seed is None:
            raise ConfigError(f"{self.log} is a folder: say which of its flights, as --seed 7")
        else:
            known = flown_in_cell(self.log, self.seed, self.pilot, self.vision, self.changes)
        out = self.out or known.out
        if known.log is not None and out.resolve() == known.log.resolve().parent:
            raise ConfigError(f"--out {out} is where {known.log.name} lies, which would be written over")
        response = None
        if self.vehicle_config is not None:
            response = identified(self.vehicle_config, response_of(known.scenario))
        if words := versions(known.version):
            say(words)
        say(f"{known.scenario.name}, seed {known.seed}, pilot {known.pilot}, vision {known.vision}")
        flight = fly(
            known.scenario, pilot=known.pilot, vision=known.vision, seed=known.seed, out=out, video=self.video,
            command=command_line(), response=response,
        )  # fmt: skip
        require_record(flight)
        if known.log is None:
            print(f"as it was flown: {known.result}\nagain:           {flight.reason}")
        else:
            before, after = read_log(known.log), read_log(out / LOG_NAME)
            print(*comparison(before, after), sep="\n")
            say_if_broken_off(known.log, len(before.records), before.complete)
            if not installed("plots"):
                say("no side-by-side.png: pip install 'shipland[plots]'")
            elif before.records and after.records:
                plot_pair(out / "side-by-side.png", before, after)
        say(f"{out}: {', '.join(sorted(path.name for path in out.iterdir() if path.is_file()))}")
        return 0 if flight.success else 1

    def _of_a_log(self, log: Path) -> PastFlight:
        """A simulated flight's log; DataError for another's."""
        from shipland.evaluation.replays import PastFlight, flown_setup
        from shipland.record.reader import read_log

        if self.seed is not None:
            raise ConfigError(f"--seed {self.seed}: {log} holds one flight; a seed is for the folder of a cell")
        before = read_log(log)
        info = before.header.info
        if info.seed is None or not info.is_simulated:
            raise DataError(f"{log} is no flight of the simulator: only that can be flown again; see `replay`")
        if "--vehicle-config" in info.options() and self.vehicle_config is None:
            say("it was flown with --vehicle-config, which the log does not hold: give it again")
        scenario, pilot, vision = flown_setup(before, log, self.pilot, self.vision, self.changes)
        version = info.code_version or info.software_version
        return PastFlight(scenario, pilot, vision, info.seed, version, Path("out/again"), log)
