"""`shipland campaign`: many landings of one scenario, of every combination of values and pilots, or of a suite."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shipland.commands.options import CampaignOptions, NameArgument, command_line, names_of, picture, say
from shipland.errors import ConfigError

if TYPE_CHECKING:
    from shipland import campaigns


@dataclass(frozen=True)
class Campaign(CampaignOptions):
    """Fly the cells of a suite, or every combination of the scenarios and values given here.

    A cell is one scenario with one value of every setting and one pilot; all cells share the workers and fly the same
    seeds. Leaves cells.json, tables.md, flights.csv, and in a folder a cell landings.csv, table.md, landings.png and
    the logs of flights that did not land in the square. Ctrl-C, SIGTERM and --minutes stop in order; run
    the command again to resume. Results of other code, configuration or weights are refused. Exit code: 0 everything
    is flown, however it landed, 1 not, 2 bad input, 130 stopped by a person.

    Example: shipland campaign --scenario near --runs 20 --out out/near20

    Example: shipland campaign near --pilot paper,horizon --runs 100 --out out/near

    Example: shipland campaign --scenario rig-natops,ship-sea6 --set wind.mean_mps=0,5,9
        --set aircraft.loop.kind=attitude,velocity --runs 200 --minutes 9 --out out/tables
    """

    suite: NameArgument = ""
    """Name of a suite (see `shipland suites`), or the path of its TOML file; none with --scenario."""
    out: Path = Path("out/campaign")
    """Output folder; made when missing."""
    scenario: str = ""
    """As in `shipland fly`, instead of a suite; several with commas between."""
    vision: str = "geometric"
    """Who sees, as in `shipland fly`; a suite says it itself."""
    only: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PATTERN …")] = ()
    """Shell patterns of cells to fly, as `--only 'rig-*mean_mps=5*'`."""
    runs: int = 20
    """Flights a cell."""
    salt: Path | None = None
    """File with a secret that the seeds are derived from, in the place of 1, 2, 3 …: a sealed run of a benchmark."""
    oracle_motions: int = 60
    """Motions drawn for each oracle rate; 0: none are drawn."""
    logs: bool = False
    """Keep the log of every flight, without pictures, in CELL/flights: `shipland paper --flights` draws from them."""

    def run(self) -> int:
        """Fly and print; 0 when everything asked for is flown, 1 when not."""
        if self.suite and self.scenario:
            raise ConfigError("give either a suite (`shipland suites` names them) or --scenario")
        found, stopped = self.flown(self._campaign, self.out)
        print((self.out / "tables.md").read_text(encoding="utf-8"), end="")
        logs = [folder / f"{seed}.mcap" for cell in found.cells for seed, folder in cell.logs.items()]
        if self.logs and (without := sum(not log.is_file() for log in logs)):
            say(f"{without} flights were flown before without --logs, and keep no log; another --out flies them again")
        of_a_cell = f"landings.csv, table.md, {picture('landings.png')} and logs"
        files = f"tables.md, flights.csv, and for each cell a folder with {of_a_cell}"
        page = f"one page of all: shipland report {shlex.quote(str(self.out))}"
        say(f"{self.out}: {files}; {page}")
        return 130 if stopped else int(found.left > 0)

    def _campaign(self, workers: int) -> campaigns.Campaign:
        from shipland.campaigns import campaign, load_suite

        return campaign(
            load_suite(self.suite) if self.suite else names_of("scenario", self.scenario or "near"),
            pilot=names_of("pilot", self.pilot),
            vision=self.vision,
            runs=self.runs,
            first_seed=self.first_seed,
            salt=self.salt,
            settings=self.changes,
            config=self.config,
            only=self.only,
            workers=workers,
            cluster=self.cluster,
            out=self.out,
            logs=self.logs,
            time_limit_s=self.time_limit_s,
            oracle_motions=self.oracle_motions,
            command=command_line(),
        )
