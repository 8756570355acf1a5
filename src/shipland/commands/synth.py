"""`shipland synth`: labelled pictures from the simulator."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.learning.arguments import SynthArguments


@dataclass(frozen=True)
class Synth(SynthArguments):
    """Make labelled pictures from the simulator's scene, in YOLO's layout; goes on where it was cut off.

    Example: shipland synth --out out/ship --kind ship --count 5000 --crop-px 352
    """

    def run(self) -> int:
        """Make them."""
        from shipland.learning.synth import synth

        print(synth(self))
        return 0
