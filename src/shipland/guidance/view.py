"""Where the camera looks: directions and ranges of what the picture shows, the camera's pitch, and the search."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.camera import Camera
from shipland.guidance.parameters import SearchParameters
from shipland.guidance.response import SticksPercent
from shipland.messages import Box, Mode, Observation


@dataclass(frozen=True)
class View:
    """The properties of the camera that guidance needs.

    Attributes:
        focal_px: mean focal length.
        middle_px: principal point, (column, row).
        half_view_rad: from the picture's middle to its left and right edges.
    """

    focal_px: float
    middle_px: tuple[float, float]
    half_view_rad: float

    @staticmethod
    def of(camera: Camera) -> View:
        """Of a camera's intrinsics."""
        middle_px = (float(camera.matrix[0, 2]), float(camera.matrix[1, 2]))
        return View(camera.focal_px, middle_px, math.atan2(0.5 * camera.width_px, camera.focal_px))

    def bearing_rad(self, column_px: float, camera_yaw_rad: float) -> float:
        """Of a column of the picture, clockwise from the nose, off which the camera is turned by its yaw."""
        return math.atan2(column_px - self.middle_px[0], self.focal_px) + camera_yaw_rad

    def range_m(self, area_px2: float, side_m: float) -> float:
        """Of a box by its area, whose object has the area of a square with side `side_m`, seen frontally."""
        return self.focal_px * side_m / math.sqrt(area_px2)

    def depression_rad(self, row_px: float) -> float:
        """Of a row of the picture, below its middle."""
        return math.atan2(row_px - self.middle_px[1], self.focal_px)


def target_column_px(observation: Observation) -> float | None:
    """Column of the picture in which the target is seen: the cue's, else its box's; None where nothing is seen."""
    box = observation.bar_box or observation.ship_box
    if observation.bar_pose is not None:
        columns_px = observation.bar_pose.corners_px[:, 0]
        return float(columns_px.sum()) / max(len(columns_px), 1)
    return None if box is None else box.centre_px[0]


def box_elevation_rad(box: Box, observation: Observation, view: View) -> float:
    """Of a box's centre above the horizon, by the camera's pitch at exposure."""
    return observation.gimbal.pitch_rad - view.depression_rad(box.centre_px[1])


def flown_box_elevation_rad(mode: Mode, observation: Observation, view: View) -> float | None:
    """Above the horizon, of the box that a far mode flies on; None in another mode or without the box."""
    box = {Mode.TRACK_BAR: observation.bar_box, Mode.TRACK_SHIP: observation.ship_box}.get(mode)
    return None if box is None else box_elevation_rad(box, observation, view)


def smoothed_rad(pitch_rad: float, wanted_rad: float | None, step_s: float, time_constant_s: float) -> float:
    """The camera pitch after `step_s`: a first-order lag towards the desired pitch; unchanged where that is None."""
    if wanted_rad is None:
        return pitch_rad
    share = 1.0 - math.exp(-step_s / time_constant_s) if step_s > 0.0 else 1.0
    return pitch_rad + share * (wanted_rad - pitch_rad)


def search(searching_s: float, parameters: SearchParameters, side: float = 1.0) -> tuple[SticksPercent, float]:
    """The sticks and the camera pitch [rad] after `searching_s` of search; a negative `side` turns to the left."""
    hold = SticksPercent(0.0, 0.0, 0.0, 0.0)
    pitches_rad = [math.radians(pitch_deg) for pitch_deg in parameters.camera_pitch_deg]
    turning_s = searching_s - parameters.look_s * len(pitches_rad)
    if turning_s < 0.0:
        return hold, pitches_rad[min(int(searching_s / parameters.look_s), len(pitches_rad) - 1)]
    turn, into_s = divmod(turning_s, parameters.turn_s + parameters.climb_s)
    pitch_rad = pitches_rad[int(turn) % len(pitches_rad)]
    if turn >= parameters.turns:
        return hold, pitch_rad
    if into_s < parameters.turn_s:
        return hold._replace(yaw=math.copysign(parameters.turn_percent, side)), pitch_rad
    return hold._replace(heave=parameters.climb_percent), pitch_rad
