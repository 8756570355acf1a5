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

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders of campaigns; a flight that two of them hold counts once."""
    out: Path | None = None
    """The page; report.html in the first folder when not given."""
    ceiling_motions: int = 60
    """Motions drawn for each ceiling; 0: no ceilings."""

    def run(self) -> int:
        """Write the page and say where."""
        from shipland.errors import ConfigError, DataError
        from shipland.evaluation.bench import read_about, read_bench
        from shipland.evaluation.bench_tables import ceilings_of
        from shipland.report.bench_page import bench_page

        if not self.folders:
            raise ConfigError("give the folder of a campaign")
        cells = read_bench(self.folders)
        if not any(cell.landings for cell in cells):
            raise DataError(f"{self.folders[0]} holds no flights yet")
        path = self.out or self.folders[0] / "report.html"
        ceilings = {}
        if self.ceiling_motions:
            ceilings = ceilings_of(cells, self.ceiling_motions, self.folders[0] / "ceilings.json")
        try:
            path.write_text(bench_page(cells, read_about(self.folders[0]), ceilings, path.parent), encoding="utf-8")
        except OSError as error:
            raise DataError(f"{path} cannot be written: {error.strerror}") from None
        print(path)
        return 0
