"""Motion responses (RAOs) of the packaged FFG-7-like frigate: the table and its interpolation.

The table is made by `tools/make_rao.py`; hull and method: `docs/explanation/ship-motion.md`. No measurement of an FFG-7
is behind it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import resources

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, RectBivariateSpline

from shipland.frames import Array

ComplexArray = npt.NDArray[np.complex128]

MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of surge, sway, heave, roll, pitch, yaw when the waves come from the other side."""


@dataclass(frozen=True, eq=False)
class ResponseTable:
    """Complex motion a metre of wave amplitude, time factor exp(+iωt), wave crest at the origin at t = 0.

    Motions are along and about the ship's forward, starboard, down [m/m, rad/m], at the origin: midships on the
    still waterline.

    Attributes:
        speed_kn: (S,) ship's speeds, ascending.
        heading_deg: (H,) directions 0…180 that the waves run to, against the bow; 0 following, 180 head seas; the
            waves come from starboard.
        omega_rad_s: (F,) wave frequencies in the still frame, ascending.
        rao: (S, H, F, 6) complex.
        natural_period_s: (3,) heave, roll, pitch (uncoupled, zero speed).
        particulars: length, beam, draught [m], displacement [m³], GM [m], centre of gravity forward, port, up [m].
    """

    speed_kn: Array
    heading_deg: Array
    omega_rad_s: Array
    rao: ComplexArray
    natural_period_s: Array
    particulars: Array

    def responses(self, speed_kn: float, heading_rad: Array, omega_rad_s: Array) -> ComplexArray:
        """(N, 6) responses, cubic in speed, heading and frequency.

        Args:
            speed_kn: within the table.
            heading_rad: (N,) direction that the waves run to, any angle; beyond 180° (waves from port) mirrored.
            omega_rad_s: (N,) within the table.
        """
        heading_deg = np.degrees(heading_rad) % 360.0
        from_port = heading_deg > 180.0
        heading_deg = np.where(from_port, 360.0 - heading_deg, heading_deg)
        found = np.empty((heading_deg.size, 6), dtype=complex)
        for index, (real, imaginary) in enumerate(_surfaces(self, speed_kn)):
            found.real[:, index] = real.ev(heading_deg, omega_rad_s)
            found.imag[:, index] = imaginary.ev(heading_deg, omega_rad_s)
        return found * np.where(from_port[:, None], MIRRORED, 1.0)


@lru_cache(maxsize=16)
def _surfaces(table: ResponseTable, speed_kn: float) -> list[tuple[RectBivariateSpline, RectBivariateSpline]]:
    """Real and imaginary part of each motion over heading and frequency at one speed."""
    at_speed = CubicSpline(table.speed_kn, table.rao)(speed_kn)
    grid = (table.heading_deg, table.omega_rad_s)
    return [
        (RectBivariateSpline(*grid, at_speed[..., index].real), RectBivariateSpline(*grid, at_speed[..., index].imag))
        for index in range(6)
    ]


def at_point(responses: ComplexArray, point_m: npt.ArrayLike) -> ComplexArray:
    """(N, 6) responses at a point (3,) forward, starboard, down of the origin [m]; linear in the angles."""
    moved = np.array(responses)
    moved[:, :3] += np.cross(responses[:, 3:], np.asarray(point_m, dtype=float))
    return moved


@cache
def frigate() -> ResponseTable:
    """The packaged table."""
    with (
        (resources.files("shipland.sim.ship") / "data" / "frigate_rao.npz").open("rb") as file,
        np.load(file) as stored,
    ):
        arrays = {name: stored[name] for name in stored.files}
    arrays["rao"] = arrays["rao"].astype(complex)
    for array in arrays.values():
        array.setflags(write=False)
    return ResponseTable(**arrays)
