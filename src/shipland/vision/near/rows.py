"""A rolling shutter: rows are exposed one after the other while the cue moves over the picture.

The picture's time is that of its middle row. A row that is exposed `late_s` after it shows the cue where it has moved
by then: by its motion in the picture since the last one, and by what that motion may have changed since. Without a last
picture nothing is known but how fast a cue moves at most times; rows that are stretched or leaned then look like a cue
that is turned, and the pose's covariance says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.vision.near.parameters import VisionParameters

_AXES = np.eye(2)


@dataclass(frozen=True)
class Followed:
    """Where the last picture showed the cue.

    Attributes:
        corners_px: (n,4,2) all of its corners, undistorted, as measured.
        since_s: from that picture to this.
    """

    corners_px: Array
    since_s: float


@dataclass(frozen=True)
class RowMotion:
    """What the rows' own times do to corners.

    Attributes:
        moved_px: (k,4,2) by how much corners have moved from where they were when the middle row was exposed.
        unsure_px: (2,k,4,2) what may be wrong with that, at one standard deviation of the cue's motion along columns,
            and along rows.
    """

    moved_px: Array
    unsure_px: Array


def row_motion(
    corners_px: Array, rows: Array, plane_m: Array, camera: Camera, parameters: VisionParameters, last: Followed | None
) -> RowMotion:
    """What the rows' own times do to the corners of a picture.

    Args:
        corners_px: (k,4,2) as measured, undistorted.
        rows: (k,4) of the picture in which they were seen.
        plane_m: (k,4,2) where they lie in the cue.
        camera: its `row_time_s`.
        parameters: how fast the cue moves.
        last: the same corners in the last picture; None when it is not known.
    """
    late_s = camera.row_time_s * (rows - 0.5 * (camera.height_px - 1))
    motion_px_s, spread_px_s = np.zeros(corners_px.shape), parameters.row_motion_px_s
    if last is not None:
        since_s = last.since_s + camera.row_time_s * (corners_px - last.corners_px)[..., 1:]
        measured_px_s = (corners_px - last.corners_px) / since_s
        # The motion of a plane that is small in the picture is linear in its coordinates: what corners err by averages.
        place = np.column_stack([np.ones(plane_m.size // 2), plane_m.reshape(-1, 2)])
        fit, *_ = np.linalg.lstsq(place, measured_px_s.reshape(-1, 2), rcond=None)
        motion_px_s, spread_px_s = (place @ fit).reshape(corners_px.shape), parameters.row_shake_px_s
    unsure_px = spread_px_s * late_s[..., None] * _AXES[:, None, None]
    return RowMotion(late_s[..., None] * motion_px_s, unsure_px)
