"""The camera's attitude at the pictures that a flight log keeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.messages import GimbalAttitude
from shipland.vision.attitude import AttitudeTrack

_SAME_S = 0.02
"""Nearer than this a picture and a reading are of one cycle; the log has no picture before its time 0."""


@dataclass(frozen=True)
class PictureAttitude(AttitudeTrack):
    """A log's own attitude: its pictures were taken at readings, however long none came before or after."""

    def at(self, t_s: float) -> GimbalAttitude:
        """The reading of a picture's own cycle; else as of `AttitudeTrack`."""
        nearest = int(np.argmin(np.abs(self.t_s - t_s)))
        if abs(self.t_s[nearest] - t_s) > _SAME_S:
            return super().at(t_s)
        return GimbalAttitude(float(self.roll_rad[nearest]), float(self.pitch_rad[nearest]))
