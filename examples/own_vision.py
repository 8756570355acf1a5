"""A detector of one's own: pictures in, an observation out.

This one looks for the brightest green in the picture and gives its box; the packaged near vision does the corners.

    shipland fly --vision own_vision:green_box --out out/green                       # in this folder
"""

from dataclasses import replace

import cv2
import numpy as np

from shipland.messages import Box, Frame, Observation
from shipland.scenario.visions import VisionSetup
from shipland.vision.near.pipeline import NearVision
from shipland.vision.vision import Vision

LEAST_PX = 30


class GreenBox:
    """Corners where the near vision finds them, else the box around everything green."""

    def __init__(self, near: Vision) -> None:
        self.near = near

    def see(self, frame: Frame) -> Observation:
        """One picture, `frame.image`, (H,W,3) BGR; None when the camera gave none."""
        seen = self.near.see(frame)
        if seen.bar_pose is not None or frame.image is None:
            return seen
        green = cv2.inRange(cv2.cvtColor(frame.image, cv2.COLOR_BGR2HSV), (35, 90, 90), (85, 255, 255))
        rows, columns = np.nonzero(green)
        if len(rows) < LEAST_PX:
            return replace(seen, reason=f"{seen.reason}; too little green for a box")
        low, high = (columns.min(), rows.min()), (columns.max(), rows.max())
        centre_px = (float(low[0] + high[0]) / 2.0, float(low[1] + high[1]) / 2.0)
        return replace(seen, bar_box=Box(centre_px, (float(high[0] - low[0] + 1), float(high[1] - low[1] + 1)), 0.9))


def green_box(setup: VisionSetup) -> Vision:
    """The factory: called once a flight."""
    return GreenBox(NearVision(setup.scenario.rig.cue, setup.camera, setup.scenario.vision))
