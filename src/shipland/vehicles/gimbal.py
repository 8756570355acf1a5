"""The camera's attitude at an exposure, from readings at other times."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shipland.frames import euler_from_rotation, rotation_from_euler
from shipland.messages import GimbalAttitude

History = Sequence[tuple[float, float, float]]
"""(time, roll, pitch), in order of time."""


def gimbal_at(
    t_s: float, attitudes: History, mounts: History, fixed_pitch_rad: float | None
) -> tuple[GimbalAttitude, float]:
    """The camera's attitude in `level` at a time, and how far from it the nearest reading is [s]; infinite without any.

    Args:
        t_s: of the exposure.
        attitudes: of the body.
        mounts: of a gimbal, against the horizon.
        fixed_pitch_rad: of a camera fixed to the body, upward positive; None for one on a gimbal.
    """
    readings = mounts if fixed_pitch_rad is None else attitudes
    age_s = min((abs(t_s - read_s) for read_s, _, _ in readings), default=math.inf)
    roll_rad, pitch_rad = attitude_at(readings, t_s) or (0.0, 0.0)
    if fixed_pitch_rad is None:
        return GimbalAttitude(roll_rad, pitch_rad), age_s
    turned = rotation_from_euler(roll_rad, pitch_rad, 0.0) @ rotation_from_euler(0.0, fixed_pitch_rad, 0.0)
    return GimbalAttitude(*euler_from_rotation(turned)), age_s


def attitude_at(history: History, t_s: float) -> tuple[float, float] | None:
    """Roll and pitch at a time, by line between the neighbours; the nearest at the ends; None without any.

    >>> attitude_at([(0.0, 0.0, 0.0), (2.0, 0.2, 0.4)], 1.0)
    (0.1, 0.2)
    """
    if not history:
        return None
    after = next((index for index, row in enumerate(history) if row[0] >= t_s), len(history))
    if after in (0, len(history)):
        _, roll_rad, pitch_rad = history[min(after, len(history) - 1)]
        return roll_rad, pitch_rad
    (t0_s, roll0, pitch0), (t1_s, roll1, pitch1) = history[after - 1], history[after]
    share = (t_s - t0_s) / (t1_s - t0_s)
    return roll0 + share * (roll1 - roll0), pitch0 + share * (pitch1 - pitch0)
