"""A climb-out without an estimate: straight up, held by the vehicle itself, then backwards for a view of the ship."""

from __future__ import annotations

from shipland.frames import Array
from shipland.guidance.laws import clamp
from shipland.guidance.near import Sticks
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.response import Response


def blind_climb_out(
    since_s: float, approach: ApproachParameters, response: Response, lean_mps2: Array | None
) -> Sticks:
    """The sticks.

    Args:
        since_s: the climb-out's begin.
        approach: its height, time and sticks.
        response: of the vehicle.
        lean_mps2: (2,) forward and right in `level`, by the mean lean of late: where a stick means a tilt, who backs
            off level is taken by the wind. None where it means a speed.
    """
    climb_s = approach.climb_out_height_m / (0.01 * approach.climb_out_percent * response.max_climb_mps)
    if since_s <= climb_s:
        return Sticks(0.0, 0.0, approach.climb_out_percent, 0.0)
    if since_s > climb_s + approach.climb_out_s:
        return Sticks(0.0, 0.0, 0.0, 0.0)
    forward, right = (0.0, 0.0) if lean_mps2 is None else map(response.stick_of, lean_mps2.tolist())
    return Sticks(clamp(forward - approach.back_off_percent, 100.0), clamp(right, 100.0), 0.0, 0.0)
