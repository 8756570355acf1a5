"""`shipland evaluate`: how good a detector is."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.learning.arguments import EvaluateArguments


@dataclass(frozen=True)
class Evaluate(EvaluateArguments):
    """Measure a detector on a labelled set, or on fresh scenes of the simulator over range.

    Example: shipland evaluate --weights ship --kind ship --scenes 2000 --out out/evaluate
    """

    def run(self) -> int:
        """Measure and print the tables."""
        from shipland.learning.evaluate import evaluate

        print(evaluate(self).text())
        return 0
