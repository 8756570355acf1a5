"""Names of the paper's figures, in the order in which they are made; light to import, for the command line."""

from __future__ import annotations

from typing import Literal

FigureName = Literal[
    "near-chain", "distance-size", "yolo-grid", "detections", "roll-law", "far-steps", "far-readings",
    "derivative-gain", "near-false", "courses", "touchdowns",
]  # fmt: skip
