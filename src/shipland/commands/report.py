"""`shipland report`: one HTML page of campaigns."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import Paths
from shipland.errors import ConfigError, DataError


@dataclass(frozen=True)
class Report:
    """Make one HTML page of what was flown; it needs nothing beside it. Several folders are merged.

    Bundles of `shipland submit` make a leaderboard: an entry each, its rates with intervals, in pairs with the first.

    Example: shipland report out/near

    Example: shipland report ours.zip theirs.zip --out leaderboard.html
    """

    folders: Paths
    """Folders of campaigns; a flight that two of them hold counts once. Or bundles."""
    out: Path | None = None
    """The page; when not given, report.html in the folder or beside the bundle, of several out/report/report.html."""
    oracle_motions: int = 60
    """Motions drawn for each oracle rate; 0: none are drawn."""

    def run(self) -> int:
        """Write the page and say where."""
        from shipland.files import write_atomically, writing

        if not self.folders:
            raise ConfigError("give the folder of a campaign, or bundles")
        if self.oracle_motions == 1 or self.oracle_motions < 0:
            raise ConfigError(f"--oracle-motions must be 0, or 2 and more, got {self.oracle_motions}")
        bundles = [path.suffix == ".zip" for path in self.folders]
        if any(bundles) and not all(bundles):
            raise ConfigError("give either folders or bundles")
        beside = [path.parent if any(bundles) else path for path in self.folders]
        path = self.out or (beside[0] if len(beside) == 1 else Path("out/report")) / "report.html"
        page = self._leaderboard(path.parent) if any(bundles) else self._page(path.parent)
        with writing(path):
            write_atomically(path, page.encode(errors="replace"))  # a folder's name may hold bytes that are no UTF-8
        print(path)
        return 0

    def _page(self, beside: Path) -> str:
        from shipland.evaluation.campaign import read_about, read_cells
        from shipland.evaluation.leaderboard import oracle_rates_of
        from shipland.report.campaign_page import campaign_page

        cells, first = read_cells(self.folders), self.folders[0]
        if not any(cell.landings for cell in cells):
            raise DataError(f"{first} holds no flights yet")
        oracle_rates = oracle_rates_of(cells, self.oracle_motions, first / "oracle_rates.json")
        return campaign_page(cells, read_about(first), oracle_rates, beside)

    def _leaderboard(self, beside: Path) -> str:
        from shipland.evaluation.bundle import opened
        from shipland.evaluation.leaderboard import oracle_rates_of
        from shipland.report.benchmark_page import benchmark_page, entries_of

        with ExitStack() as stack:
            bundles = [stack.enter_context(opened(path)) for path in self.folders]
            cells = entries_of(bundles)
            return benchmark_page(bundles, cells, oracle_rates_of(cells, self.oracle_motions), beside)
