"""`shipland submit`: a campaign as a bundle that others can check."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import PathArgument
from shipland.learning.arguments import at_least


@dataclass(frozen=True)
class Submit:
    """Pack a campaign into a bundle for a benchmark.

    It holds rows, the code's digest, configurations, and logs of a few flights. Every cell wants the seeds 1, 2, 3 …
    as far as they were flown, or those of the salt; with a suite the rows are an entry of its leaderboard. A pilot or
    vision of one's own, given as OWN:factory, is taken along as its file OWN.py. `shipland verify` checks the bundle,
    and is run on it here once without flying.

    Example: shipland campaign near --pilot my_pilot:pilot --runs 200 --out out/mine

    Example: shipland submit out/mine --title "my pilot 1" --out mine.zip
    """

    folder: PathArgument
    """Folder of the campaign."""
    title: str
    """What the submission is called on the leaderboard."""
    out: Path = Path("bundle.zip")
    """The bundle."""
    logs: int = 1
    """Logs of each cell that are taken along, of those that the campaign kept."""
    salt: Path | None = None
    """File with the secret that `shipland campaign --salt` derived the seeds from."""

    def run(self) -> int:
        """Write the bundle and say what is in it."""
        from shipland.errors import DataError
        from shipland.evaluation.bundle import opened, write_bundle

        at_least(0, logs=self.logs)
        about = write_bundle(self.folder, self.out, self.title, self.logs, self.salt)
        try:
            with opened(self.out, self.salt) as bundle:
                rows, size_mb = len(bundle.flights), self.out.stat().st_size / 1e6
        except DataError:  # nobody could check it
            self.out.unlink()
            raise
        suite = about["suite"] or "no suite"
        code = f", code {', '.join(about['own_code'].values())}" if about["own_code"] else ""
        print(f"{self.out}: {suite}, {len(about['summary'])} cells, {rows} flights{code}, {size_mb:.1f} MB")
        return 0
