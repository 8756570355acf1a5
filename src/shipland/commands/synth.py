"""`shipland synth`: labelled pictures from the simulator."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import ship_and_camera_of
from shipland.learning.arguments import SynthArguments


@dataclass(frozen=True)
class Synth(SynthArguments):
    """Make labelled pictures from the simulator's scene, in YOLO's layout; the same command resumes an interrupted run.

    Example: shipland synth --out out/ship --kind ship --count 5000 --crop-px 352

    Example: shipland synth --out out/frigate --scenario frigate-sea5 --config frigate_pictures.toml
    """

    scenario: str | None = None
    """Draw this scenario's ship through its camera; default the packaged rig and the ANAFI's camera."""

    def run(self) -> int:
        """Make them."""
        from shipland.learning.synth import synth

        print(synth(self, ship_and_camera_of(self.scenario)))
        return 0
