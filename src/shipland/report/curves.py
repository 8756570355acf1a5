"""Motion of the deck between the slow cycles of a detector, for drawing."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from shipland.frames import Array

_STEP_S = 0.05
"""Cycles that are as close as this are drawn as they are."""


def smooth(t_s: Array, values: Array) -> tuple[Array, Array]:
    """Times and values (n,) of a motion with a cubic spline's between them; unchanged where a value is not known."""
    if len(t_s) < 3 or not np.isfinite(values).all() or np.diff(t_s).min() <= 0.0 or np.diff(t_s).max() <= _STEP_S:
        return t_s, values
    dense_s = np.union1d(t_s, np.arange(t_s[0], t_s[-1], _STEP_S))
    return dense_s, np.asarray(CubicSpline(t_s, values)(dense_s))
