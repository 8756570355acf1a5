"""`shipland suites`: the suites, or the cells of one."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import NameArgument


@dataclass(frozen=True)
class Suites:
    """List the suites, or the cells of one, each with the digest of its configuration.

    Example: shipland suites near
    """

    suite: NameArgument = ""
    """Name of a suite, or the path of its TOML file; none lists the packaged ones."""

    def run(self) -> int:
        """Print a line each."""
        from shipland.config import packaged_names
        from shipland.evaluation.suite import Overrides, cells_of, load_suite, task_digest
        from shipland.record.info import config_digest

        if self.suite:
            suite = load_suite(self.suite)
            cells = cells_of(suite.cells, Overrides(("paper",)))
            print(f"{suite.name} {suite.version} ({task_digest(cells)}): {suite.description}; {len(cells)} cells")
            for cell in cells:
                print(f"{config_digest(cell.scenario.table())}  {cell.group}")
            return 0
        for name in packaged_names("suites"):
            suite = load_suite(name)
            print(f"{name} {suite.version}: {suite.description}")
        return 0
