"""What autopilots and other programs are told of a pose."""

from __future__ import annotations

import numpy as np

from shipland.frames import Array

_UNKNOWN = 1e6
"""Variance [m², rad²] that no filter takes for knowledge."""


def told_covariance(covariance: Array) -> Array:
    """A covariance (n,n) with finite entries: what is not finite is uncorrelated, with a variance beyond any."""
    return np.where(np.isfinite(covariance), covariance, _UNKNOWN * np.eye(len(covariance)))
