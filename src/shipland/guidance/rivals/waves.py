"""An observed motion as a straight line and a few waves, by the peaks of its spectrum and least squares."""

from __future__ import annotations

import numpy as np

from shipland.frames import Array
from shipland.guidance.parameters import SpectralMpcParameters

STEP_S = 0.1
"""Of the series that is decomposed."""
_ANCHOR_S = 0.5
"""Length of the motion whose mean the decomposition meets."""
_LINE_S = 1.0
"""Length of the motion that a straight line continues, before there is enough for a spectrum."""


class Waves:
    """Motion of one point as a straight line and a few waves.

    Args:
        parameters: of the decomposition.
        series_m: (n,k) its places, `STEP_S` apart.
        std_m: (n,) their standard deviations.
        end_s: time of the last.
    """

    def __init__(self, parameters: SpectralMpcParameters, series_m: Array, std_m: Array, end_s: float) -> None:
        count = len(series_m)
        self._end_s, self._rates_rad_s = end_s, np.zeros(0)
        if STEP_S * (count - 1) < parameters.least_s:
            series_m, std_m = series_m[-round(_LINE_S / STEP_S) :], std_m[-round(_LINE_S / STEP_S) :]
        else:
            self._rates_rad_s = _peaks_rad_s(series_m, 1.0 / std_m, parameters.waves)
        basis = self._basis(end_s + STEP_S * np.arange(1.0 - len(series_m), 1.0))
        self._factors = np.linalg.lstsq(basis / std_m[:, None], series_m / std_m[:, None], rcond=1e-3)[0]
        newest = slice(-round(_ANCHOR_S / STEP_S), None)  # what the line has not taken up of the travel's drift
        self._factors[0] += np.mean(series_m[newest] - basis[newest] @ self._factors, axis=0)

    def _basis(self, times_s: Array) -> Array:
        phase = np.outer(times_s - self._end_s, self._rates_rad_s)
        line = np.column_stack([np.ones_like(times_s), times_s - self._end_s])
        return np.hstack([line, np.cos(phase), np.sin(phase)])

    def at(self, times_s: Array) -> tuple[Array, Array]:
        """(n,k) places [m] and (n,k) speeds [m/s]."""
        ahead_s = 0.5 * STEP_S
        early, late = (self._basis(times_s + shift_s) @ self._factors for shift_s in (-ahead_s, ahead_s))
        return self._basis(times_s) @ self._factors, (late - early) / STEP_S


def _peaks_rad_s(series_m: Array, weights: Array, most: int) -> Array:
    """Rates of the largest peaks of the spectrum, summed over the axes; zero-padded fourfold, the line taken out."""
    count = len(series_m)
    line = np.column_stack([np.ones(count), np.arange(count)])
    weighted = weights[:, None] / weights.max()
    rest = weighted * (series_m - line @ np.linalg.lstsq(weighted * line, weighted * series_m, rcond=None)[0])
    power = np.sum(np.abs(np.fft.rfft(np.hanning(count)[:, None] * rest, 4 * count, axis=0)) ** 2, axis=1)
    top = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    rates_rad_s = 2.0 * np.pi * top / (4 * count * STEP_S)
    kept = rates_rad_s > 2.0 * np.pi / (count * STEP_S)  # slower ones are the line's
    top, rates_rad_s = top[kept], rates_rad_s[kept]
    return np.asarray(rates_rad_s[np.argsort(-power[top], kind="stable")[:most]])
