"""Recorded deck motion from a CSV file."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from shipland.errors import DataError
from shipland.frames import Array
from shipland.sim.ship.course import quintic_blend
from shipland.sim.ship.deck_motion import SixDof

HEADER = ("t_s", "surge_m", "sway_m", "heave_m", "roll_deg", "pitch_deg", "yaw_deg")
"""Columns of the file; axes and signs as in `deck_motion.DOF_NAMES`."""

_MOST = {"heave_m": 30.0, "roll_deg": 90.0, "pitch_deg": 90.0}
"""No ship moves more; surge, sway and yaw may drift."""
BLEND_S = 2.0
"""A record that ends fades into its own beginning over this time (or a quarter of it, where it is short)."""


class RecordedMotion:
    """A cubic spline through a record; after its end it starts again, faded over so that nothing jumps.

    Times (N,) ascend, the first one is played at t = 0; displacements are (N, 6) [m, m, m, rad, rad, rad].
    """

    def __init__(self, t_s: Array, displacement: Array) -> None:
        times = np.asarray(t_s, dtype=float) - float(t_s[0])
        self.duration_s = float(times[-1])
        self._spline = CubicSpline(times, displacement)
        self._rate = self._spline.derivative()
        self._rate_of_rate = self._rate.derivative()
        self._blend_s = min(BLEND_S, 0.25 * self.duration_s)
        self._period_s = self.duration_s - self._blend_s

    def at(self, t_s: float) -> SixDof:
        """See `DeckMotion`; before t = 0 the record counts as repeated too."""
        turn = math.floor(t_s / self._period_s)
        s = t_s - turn * self._period_s
        x, v, a = self._spline(s), self._rate(s), self._rate_of_rate(s)
        if turn == 0 or s >= self._blend_s:
            return SixDof(np.concatenate([x, v, a]))
        w, dw, ddw = quintic_blend(s / self._blend_s)
        dw, ddw = dw / self._blend_s, ddw / self._blend_s**2
        tail = s + self._period_s
        x0, v0, a0 = self._spline(tail), self._rate(tail), self._rate_of_rate(tail)
        place, velocity = x0 + w * (x - x0), v0 + w * (v - v0) + dw * (x - x0)
        return SixDof(np.concatenate([place, velocity, a0 + w * (a - a0) + 2.0 * dw * (v - v0) + ddw * (x - x0)]))


def read_motion(path: Path, length_scale: float = 1.0, time_scale: float = 1.0) -> RecordedMotion:
    """The motion in a CSV file with the columns of `HEADER`, its lengths and times divided by the scales.

    Raises:
        DataError: the file is missing or a line is wrong; names line and column.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file))
    except FileNotFoundError:
        raise DataError(f"recorded motion {path} does not exist") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"recorded motion {path} cannot be read: {error}") from None
    wanted = ",".join(HEADER)
    if not rows or tuple(cell.strip() for cell in rows[0]) != HEADER:
        found = ",".join(rows[0]) if rows else "nothing"
        raise DataError(f"{path}, line 1: expected the header {wanted}, found {found}")
    table = [_numbers(path, line, row) for line, row in enumerate(rows[1:], start=2) if row]
    if len(table) < 4:
        raise DataError(f"{path}: a recorded motion needs at least 4 lines under the header, found {len(table)}")
    values = np.array(table)
    steps = np.diff(values[:, 0])
    if not np.all(steps > 0.0):
        line = [line for line, row in enumerate(rows[1:], start=2) if row][int(np.argmax(steps <= 0.0)) + 1]
        raise DataError(f"{path}, line {line}, column t_s: times must increase from line to line")
    for name, most in _MOST.items():
        if (largest := float(np.abs(values[:, HEADER.index(name)]).max())) > most:
            raise DataError(f"{path}: {name} reaches {largest:g}, expected {most:g} at most; is the unit another?")
    values[:, 1:4] /= length_scale
    values[:, 4:] = np.radians(values[:, 4:])
    return RecordedMotion(values[:, 0] / time_scale, values[:, 1:])


def _numbers(path: Path, line: int, row: list[str]) -> list[float]:
    if len(row) != len(HEADER):
        raise DataError(f"{path}, line {line}: expected {len(HEADER)} columns ({','.join(HEADER)}), found {len(row)}")
    numbers = []
    for name, cell in zip(HEADER, row, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise DataError(f"{path}, line {line}, column {name}: {cell.strip()!r} is not a finite number")
        numbers.append(number)
    return numbers
