"""An autopilot's state as the loop's telemetry, and the camera's attitude at an exposure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shipland.frames import euler_from_rotation, rotation_from_euler
from shipland.messages import GimbalAttitude, Telemetry
from shipland.vehicles.mavlink.state import AutopilotState

History = Sequence[tuple[float, float, float]]
"""(time, roll, pitch), in order of time."""


def telemetry_of(state: AutopilotState, t_s: float) -> Telemetry:
    """The newest of everything, stamped with `t_s`; each part with its own time."""
    attitude, height = math.isfinite(state.attitude_t_s), math.isfinite(state.height_t_s)
    velocity = state.velocity_in_level_mps
    return Telemetry(
        t_s=t_s,
        roll_rad=state.roll_rad if attitude else None,
        pitch_rad=state.pitch_rad if attitude else None,
        heading_rad=state.heading_rad if attitude else None,
        height_m=state.height_m if height else None,
        velocity_in_level_mps=None if velocity is None else np.array(velocity),
        battery_percent=state.battery_percent,
        link_percent=state.link_percent,
        flying=state.armed,
        attitude_t_s=state.attitude_t_s if attitude else None,
        heading_t_s=state.attitude_t_s if attitude else None,
        height_t_s=state.height_t_s if height else None,
        velocity_t_s=None if velocity is None else state.velocity_t_s,
    )


def gimbal_at(t_s: float, attitudes: History, mounts: History, fixed_pitch_rad: float | None) -> GimbalAttitude:
    """The camera's attitude in `level` at a time.

    Args:
        t_s: of the exposure.
        attitudes: of the body.
        mounts: of a gimbal, against the horizon.
        fixed_pitch_rad: of a camera fixed to the body, upward positive; None for one on a gimbal.
    """
    if fixed_pitch_rad is None:
        return GimbalAttitude(*(attitude_at(mounts, t_s) or (0.0, 0.0)))
    roll_rad, pitch_rad = attitude_at(attitudes, t_s) or (0.0, 0.0)
    turned = rotation_from_euler(roll_rad, pitch_rad, 0.0) @ rotation_from_euler(0.0, fixed_pitch_rad, 0.0)
    return GimbalAttitude(*euler_from_rotation(turned))


def attitude_at(history: History, t_s: float) -> tuple[float, float] | None:
    """Roll and pitch at a time, by line between the neighbours; the nearest at the ends; None without any.

    >>> attitude_at([(0.0, 0.0, 0.0), (2.0, 0.2, 0.4)], 1.0)
    (0.1, 0.2)
    """
    rows = list(history)
    if not rows:
        return None
    after = next((index for index, row in enumerate(rows) if row[0] >= t_s), len(rows))
    if after in (0, len(rows)):
        _, roll_rad, pitch_rad = rows[min(after, len(rows) - 1)]
        return roll_rad, pitch_rad
    (t0_s, roll0, pitch0), (t1_s, roll1, pitch1) = rows[after - 1], rows[after]
    share = (t_s - t0_s) / (t1_s - t0_s)
    return roll0 + share * (roll1 - roll0), pitch0 + share * (pitch1 - pitch0)
