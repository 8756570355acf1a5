"""What autopilots and other programs are told of a pose."""

from __future__ import annotations

import numpy as np

from shipland.frames import Array

LEAST_STD_M, LEAST_STD_RAD = 0.02, 0.01
"""Least standard deviations that are sent: an outlier that is believed costs more than a wait."""
LEVEL_STD_RAD = 0.02
"""Standard deviation of roll and pitch, which are the autopilot's or the gimbal's own."""
_UNKNOWN = 1e6
"""Variance [m², rad²] that no filter takes for knowledge."""


def told_covariance(covariance: Array) -> Array:
    """A covariance (n,n) with finite entries: what is not finite is uncorrelated, with a variance beyond any."""
    return np.where(np.isfinite(covariance), covariance, _UNKNOWN * np.eye(len(covariance)))
