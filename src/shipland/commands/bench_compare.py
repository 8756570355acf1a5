"""`shipland bench compare`: two folders of a bench, seed by seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class BenchCompare:
    """Compare the cells that two folders have in common, seed by seed: two versions of the code, or of a pilot.

    Example: shipland bench compare out/before out/after
    """

    first: Annotated[Path, tyro.conf.Positional]
    """Folder of a bench."""
    second: Annotated[Path, tyro.conf.Positional]
    """Folder of another."""

    def run(self) -> int:
        """Print the comparison."""
        from shipland.evaluation.bench import read_bench
        from shipland.evaluation.bench_tables import paired

        print("\n".join(paired(read_bench([self.first]), read_bench([self.second]))))
        return 0
