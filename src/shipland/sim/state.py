"""What the physics hands to the picture: the poses of everything at one instant, and where ship and bar lie in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Rig


@dataclass(frozen=True)
class SceneState:
    """Poses of what can be seen, in `ned`.

    Attributes:
        t_s: time [s]; moves the sea.
        ned_from_camera: the camera that looks (OpenCV axes).
        ned_from_ship: platform and superstructure.
        ned_from_deck: the deck with all its motions.
        ned_from_bar: the bar, level.
        ned_from_body: the aircraft (drawn in the chase view only).
        camera_velocity_in_ned_mps: (3,) for motion blur.
        camera_rate_in_camera_rad_s: (3,) for motion blur.
    """

    t_s: float
    ned_from_camera: Pose
    ned_from_ship: Pose
    ned_from_deck: Pose
    ned_from_bar: Pose
    ned_from_body: Pose
    camera_velocity_in_ned_mps: Array
    camera_rate_in_camera_rad_s: Array


NearestBox = tuple[float, float, float, float]
_LEAST_DEPTH_M = 0.3


def platform_corners_in_ship_m(rig: Rig) -> Array:
    """(12,3) corners of what can be seen of the platform: its plan at the water, its superstructure's roof and foot."""
    stern, half, ground = -rig.deck_ahead_of_stern_m, 0.5 * rig.platform_width_m, rig.deck_height_m
    bow, face = stern + rig.platform_length_m, stern + rig.bar_ahead_of_stern_m
    roof = ground - rig.superstructure_height_m
    fore = bow if rig.house_length_m is None else min(bow, face + rig.house_length_m)
    return np.array(
        [
            (forward, side, down)
            for ends, down in (((stern, bow), ground), ((face, fore), roof), ((face, fore), ground))
            for forward in ends
            for side in (-half, half)
        ]
    )


def board_corners_in_bar_m(rig: Rig) -> Array:
    """(4,3) corners of the bar's board."""
    w, h = (0.5 * side_m for side_m in rig.board_size_m)
    return np.array([(0.0, -w, -h), (0.0, w, -h), (0.0, w, h), (0.0, -w, h)])


def target_box(
    kind: str, state: SceneState, camera: Camera, rig: Rig, least_visible: float, least_facing: float
) -> NearestBox | None:
    """The target's upright box (left, top, right, bottom) [px, edges at whole numbers], cut to the picture.

    Args:
        kind: ship or bar.
        state: poses.
        camera: intrinsics.
        rig: dimensions.
        least_visible: a target of which a smaller part of the box lies in the picture counts as absent.
        least_facing: the bar counts as absent when seen at a flatter angle than this sine, or from ahead.

    Returns:
        None when the target is not to be seen.
    """
    camera_from_ned = state.ned_from_camera.inverse()
    if kind == "bar":
        eye = (state.ned_from_bar.inverse() @ state.ned_from_camera).translation_m
        if -eye[0] < least_facing * float(np.linalg.norm(eye)):
            return None
        points = (camera_from_ned @ state.ned_from_bar).apply(board_corners_in_bar_m(rig))
    else:
        points = (camera_from_ned @ state.ned_from_ship).apply(platform_corners_in_ship_m(rig))
    if points[:, 2].min() < _LEAST_DEPTH_M:
        return None
    pixels = camera.project(points) + 0.5
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    size = np.array([camera.width_px, camera.height_px], dtype=float)
    inner_low, inner_high = np.clip(low, 0.0, size), np.clip(high, 0.0, size)
    if np.prod(inner_high - inner_low) < least_visible * np.prod(high - low):
        return None
    return float(inner_low[0]), float(inner_low[1]), float(inner_high[0]), float(inner_high[1])
