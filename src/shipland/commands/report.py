"""`shipland report`: one HTML page of campaigns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Report:
    """Make one HTML page of what was flown; it needs nothing beside it. Several folders are merged.

    Example: shipland report out/near
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PATH …", help_behavior_hint="")]
    """Folders of campaigns; a flight that two of them hold counts once."""
    out: Path | None = None
    """The page; report.html in the first folder when not given."""
    oracle_motions: int = 60
    """Motions drawn for each oracle rate; 0: none are drawn."""

    def run(self) -> int:
        """Write the page and say where."""
        from shipland.errors import ConfigError, DataError
        from shipland.evaluation.campaign import read_about, read_cells
        from shipland.evaluation.leaderboard import oracle_rates_of
        from shipland.report.campaign_page import campaign_page

        if not self.folders:
            raise ConfigError("give the folder of a campaign")
        cells = read_cells(self.folders)
        if not any(cell.landings for cell in cells):
            raise DataError(f"{self.folders[0]} holds no flights yet")
        path = self.out or self.folders[0] / "report.html"
        oracle_rates = {}
        if self.oracle_motions:
            oracle_rates = oracle_rates_of(cells, self.oracle_motions, self.folders[0] / "oracle_rates.json")
        try:
            path.write_text(
                campaign_page(cells, read_about(self.folders[0]), oracle_rates, path.parent), encoding="utf-8"
            )
        except OSError as error:
            raise DataError(f"{path} cannot be written: {error.strerror}") from None
        print(path)
        return 0
