"""`shipland motion`: what the ship and the wind of a scenario do; no flight."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import ScenarioOptions
from shipland.extras import require


@dataclass(frozen=True)
class Motion(ScenarioOptions):
    """Show a scenario's motion of the deck and the wind over it: figure, CSV and a table of amplitudes and periods.

    The CSV can be flown again as a recorded motion: --set ship.motion=recorded --set ship.recorded.path=motion.csv.

    Example: shipland motion --set ship.motion=sea --set ship.sea.waves_from_deg=120 --out out/motion
    """

    out: Path = Path("out/motion")
    """Output folder; made when missing."""
    duration_s: float = 120.0
    """Length of the CSV and of the figure."""
    statistics_s: float = 1800.0
    """Length of the record behind the table."""
    step_s: float = 0.05
    """Time step of CSV and figure."""
    seed: int = 1
    """Seed of everything random."""
    headings: bool = False
    """Instead of the scenario's own case: its sea from 60° off the bow and 60° off the stern, at both time rules (the
    documentation's figure)."""

    def run(self) -> int:
        """Make them."""
        from rich.console import Console

        from shipland.api import checked_seed
        from shipland.report.motion import Sampling, report_case, report_headings

        require("plots", "`shipland motion`")
        sampling = Sampling(self.duration_s, self.statistics_s, self.step_s, checked_seed(self.seed))
        report = report_headings if self.headings else report_case
        report(self.load(), sampling, self.out, Console())
        return 0
