"""The camera's attitude at an exposure, from readings at other times."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shipland.frames import euler_from_rotation, rotation_from_euler
from shipland.messages import GimbalAttitude

Reading = tuple[float, float, float, float]
"""(time [s], roll [rad], pitch [rad], yaw against the nose [rad])."""


def gimbal_at(
    t_s: float, attitudes: Sequence[Reading], mounts: Sequence[Reading], fixed_pitch_rad: float | None
) -> tuple[GimbalAttitude, float]:
    """The camera's attitude in `level` at a time, and how far from it the nearest reading is [s]; infinite without any.

    >>> gimbal_at(0.1, [], [(0.0, 0.0, 0.0, 0.0), (0.2, 0.2, 0.4, -0.2)], None)
    (GimbalAttitude(roll_rad=0.1, pitch_rad=0.2, yaw_rad=-0.1), 0.1)

    Args:
        t_s: of the exposure.
        attitudes: of the body, in order of time.
        mounts: of a gimbal, roll and pitch against the horizon, likewise.
        fixed_pitch_rad: of a camera fixed to the body, upward positive; None for one on a gimbal.
    """
    readings = mounts if fixed_pitch_rad is None else attitudes
    found, age_s = GimbalAttitude(0.0, 0.0), math.inf
    if readings:
        times_s, *angles = zip(*readings, strict=True)
        found = GimbalAttitude(*(float(np.interp(t_s, times_s, np.unwrap(each))) for each in angles))
        age_s = min(abs(t_s - read_s) for read_s in times_s)
    if fixed_pitch_rad is None:
        return found, age_s
    body = rotation_from_euler(found.roll_rad, found.pitch_rad, found.yaw_rad)
    turned = body @ rotation_from_euler(0.0, fixed_pitch_rad, 0.0)
    return GimbalAttitude(*euler_from_rotation(turned)), age_s
