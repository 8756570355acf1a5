"""`shipland dataset`: a campaign or flights as a data set with a card, ready to be uploaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import PathArgument


@dataclass(frozen=True)
class Dataset:
    """Write a campaign or flights as a data set with a card.

    Of a campaign the rows, in CSV and Parquet; the logs kept (MCAP); a Croissant card of all. In LeRobot's layout,
    version 3.0, a flight is an episode: what the pilot was told, the sticks that were sent, and a film where every log
    keeps pictures. Logs of `shipland fly` keep ten a second where the vision looks at pictures; those of campaigns
    none. Parquet and LeRobot's layout want the extra `dataset`, films `film`. Nothing is uploaded.

    Example: shipland campaign near --runs 50 --logs --out out/near

    Example: shipland dataset out/near --licence CC-BY-4.0 --out out/dataset

    Example: for n in 1 2 3; do shipland fly --seed $n --no-video --out out/flights/$n; done

    Example: shipland dataset out/flights --lerobot --pictures --licence CC-BY-4.0
    """

    folder: PathArgument
    """Folder of a campaign, or with the logs of flights in it (flight.mcap)."""
    licence: str
    """Licence that the data will have: SPDX's name of one for data, or the address of another."""
    out: Path = Path("out/dataset")
    """Output folder; made when missing."""
    name: str = "shipland-landings"
    """Of the data set."""
    url: str = "https://example.org/shipland-landings"
    """Where it will lie."""
    lerobot: bool = False
    """Write folder lerobot too, which must not be there yet: `LeRobotDataset` of lerobot 0.6 reads it."""
    pictures: bool = False
    """Write pictures.zip and pictures.csv too: camera, attitude, gimbal and the cue's corners of each."""

    def run(self) -> int:
        """Write it and name the files."""
        from shipland.report.dataset import Described, licence_address, write_dataset

        described = Described(self.name, licence_address(self.licence), self.url)
        files = write_dataset(self.folder, self.out, described, lerobot=self.lerobot, pictures=self.pictures)
        print(f"{self.out}: {', '.join(files)}")
        return 0
