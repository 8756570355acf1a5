"""`shipland dataset`: a campaign as a data set with a card, ready to be uploaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Dataset:
    """Write a campaign as a data set with a Croissant card.

    A row a flight in CSV and Parquet, and the logs kept (MCAP). Parquet wants pyarrow (pip install pyarrow). Nothing
    is uploaded.

    Example: shipland campaign near --runs 50 --logs --out out/near

    Example: shipland dataset out/near --licence https://creativecommons.org/licenses/by/4.0/ --out out/dataset
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER", help_behavior_hint="")]
    """Folder of the campaign."""
    licence: str
    """Address of the licence that the data will have."""
    out: Path = Path("out/dataset")
    """Output folder; made when missing."""
    name: str = "shipland-landings"
    """Of the data set."""
    url: str = "https://example.org/shipland-landings"
    """Where it will lie."""

    def run(self) -> int:
        """Write it and name the files."""
        from shipland.report.dataset import Described, write_dataset

        files = write_dataset(self.folder, self.out, Described(self.name, self.licence, self.url))
        print(f"{self.out}: {', '.join(files)}")
        return 0
