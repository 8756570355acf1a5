"""`shipland evaluate`: how good a detector is."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import ship_and_camera_of
from shipland.extras import require
from shipland.files import write_atomically
from shipland.learning.arguments import EvaluateArguments


@dataclass(frozen=True)
class Evaluate(EvaluateArguments):
    """Measure a detector on a labelled set, or on fresh scenes of the simulator over range.

    Without --data it draws 120 scenes of the ship, six frames each, and looks at them with the weights that fly: two
    minutes on a free core. The same command with more --count goes on from there.

    Example: shipland evaluate --kind bar --count 2000 --workers 2 --out out/bar

    Example: shipland evaluate --weights out/mine/detector.onnx --data another-day --out out/another-day

    Example: shipland evaluate --weights yolox_nano.onnx --data another-day --classes boat --out out/coco

    Example: shipland evaluate --scenario frigate-sea5 --config frigate_pictures.toml --out out/frigate-eyes
    """

    scenario: str | None = None
    """Fresh scenes of this scenario's ship through its camera; default the packaged rig and the ANAFI's camera."""

    def run(self) -> int:
        """Measure and print the tables."""
        require("plots", "`shipland evaluate`")
        from shipland.learning.evaluate import evaluate

        found = evaluate(self, ship_and_camera_of(self.scenario))
        print(found.text())
        if found.looks:
            from shipland.report.looks_page import looks_page

            title = f"{found.pictures} pictures of {self.data}"
            page = looks_page(found.looks, found.confidence, title, found.text().splitlines()[0])
            write_atomically(self.out / "looks.html", page.encode())
            print(self.out / "looks.html")
        return 0
