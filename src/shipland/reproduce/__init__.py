"""The paper's figures, and their names in the order in which they are made."""

from __future__ import annotations

from typing import Literal

FigureName = Literal[
    "near-chain", "distance-size", "yolo-grid", "detections", "roll-law", "far-steps", "far-readings",
    "derivative-gain", "near-false", "courses", "touchdowns",
]  # fmt: skip
