"""`shipland evaluate`: how good a detector is."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import ship_and_camera_of
from shipland.extras import require
from shipland.learning.arguments import EvaluateArguments


@dataclass(frozen=True)
class Evaluate(EvaluateArguments):
    """Measure a detector on a labelled set, or on fresh scenes of the simulator over range.

    Example: shipland evaluate --weights ship --kind ship --count 2000 --out out/evaluate

    Example: shipland evaluate --scenario frigate-sea5 --config examples/frigate_pictures.toml --out out/frigate-eyes
    """

    scenario: str | None = None
    """Fresh scenes of this scenario's ship through its camera; default the packaged rig and the ANAFI's camera."""

    def run(self) -> int:
        """Measure and print the tables."""
        require("plots", "`shipland evaluate`")
        from shipland.learning.evaluate import evaluate

        print(evaluate(self, ship_and_camera_of(self.scenario)).text())
        return 0
