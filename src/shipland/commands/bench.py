"""`shipland bench`: suites of scenarios, flown, reported and compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from shipland.commands.bench_compare import BenchCompare
from shipland.commands.bench_list import BenchList
from shipland.commands.bench_report import BenchReport
from shipland.commands.bench_run import BenchRun

_Part = (
    Annotated[BenchList, tyro.conf.subcommand("list")]
    | Annotated[BenchRun, tyro.conf.subcommand("run")]
    | Annotated[BenchReport, tyro.conf.subcommand("report")]
    | Annotated[BenchCompare, tyro.conf.subcommand("compare")]
)


@dataclass(frozen=True)
class Bench:
    """Fly whole suites of scenarios with one command, and judge them: shares with intervals beside the ceiling.

    `list` shows suites and their cells, `run` flies, `report` makes one HTML page, `compare` sets two folders side by
    side, seed by seed.

    Example: shipland bench run near --pilot paper horizon --runs 100 --workers 2 --out out/near
    """

    part: tyro.conf.OmitSubcommandPrefixes[_Part]

    def run(self) -> int:
        """Do the part."""
        return self.part.run()
