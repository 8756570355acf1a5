"""A go-around without an estimate: straight up, held by the vehicle itself, then backwards for a view of the ship."""

from __future__ import annotations

from shipland.frames import Array
from shipland.guidance.laws import clamp
from shipland.guidance.near import SticksPercent
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.response import Response


def open_loop_go_around(
    since_s: float, approach: ApproachParameters, response: Response, tilt_mps2: Array | None
) -> SticksPercent:
    """The sticks.

    Args:
        since_s: the go-around's begin.
        approach: its height, time and sticks.
        response: of the vehicle.
        tilt_mps2: (2,) forward and right in `level`, by the mean tilt of late: where a stick means a tilt, who backs
            off level is taken by the wind. None where it means a speed.
    """
    climb_s = approach.go_around_height_m / (0.01 * approach.go_around_percent * response.max_climb_mps)
    if since_s <= climb_s:
        return SticksPercent(0.0, 0.0, approach.go_around_percent, 0.0)
    if since_s > climb_s + approach.go_around_s:
        return SticksPercent(0.0, 0.0, 0.0, 0.0)
    forward, right = (0.0, 0.0) if tilt_mps2 is None else map(response.stick_of, tilt_mps2.tolist())
    return SticksPercent(clamp(forward - approach.back_off_percent, 100.0), clamp(right, 100.0), 0.0, 0.0)
