"""`shipland compare`: two campaigns seed by seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Compare:
    """Compare two campaigns that flew the same seeds: who landed where the other did not, and the touchdown errors.

    Prints McNemar's exact test and a paired bootstrap of the difference of the median errors.

    Example: shipland compare out/campaign/paper out/campaign/horizon
    """

    first: Annotated[Path, tyro.conf.Positional]
    """Folder of a campaign."""
    second: Annotated[Path, tyro.conf.Positional]
    """Folder of another."""

    def run(self) -> int:
        """Print the comparison."""
        from shipland.evaluation.folder import read_campaign
        from shipland.evaluation.sweep import comparison

        first, second = read_campaign(self.first), read_campaign(self.second)
        print(comparison(first, second, (str(self.first), str(self.second))))
        return 0
