"""The outside view of a flight: a camera that follows astern of the aircraft and looks past it at the deck."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.messages import GroundTruth
from shipland.report.overlay import STRIP_WIDTH_PX, TRACES_WIDTH_PX
from shipland.report.video import Chase
from shipland.sim.state import SceneState

if TYPE_CHECKING:
    from shipland.sim.scene.scene import Scene

_BEHIND_RIGHT_UP_M = np.array([-2.1, 1.3, 0.75])
_LOOK_AHEAD_M = 1.4
_LOWEST_M = 0.5
_HORIZONTAL_FOV_DEG = 52.0


def chase_camera(camera: Camera) -> Camera:
    """Intrinsics of the outside view that stands beside the pictures of `camera` in the video."""
    height_px = 2 * round(0.5 * STRIP_WIDTH_PX * camera.height_px / camera.width_px)
    return Camera.from_fov(TRACES_WIDTH_PX, height_px, _HORIZONTAL_FOV_DEG)


def chase_state(truth: GroundTruth, scale: float = 1.0, full_ship: bool = False) -> SceneState:
    """The scene as seen from astern, to the right and above the aircraft, at least half a metre above the sea.

    The view stands as many times farther away as the aircraft is larger, `scale`; on a `full_ship` the hull moves with
    the deck. It keeps the ship's heading and is aimed between the aircraft and the deck, so it is steady by itself.
    """
    level = truth.ned_from_ship.rotation  # the ship frame turns with the course only
    aircraft_m = truth.ned_from_body.translation_m
    eye_m = aircraft_m + level @ (scale * _BEHIND_RIGHT_UP_M * [1.0, 1.0, -1.0])
    eye_m[2] = min(eye_m[2], -_LOWEST_M)
    to_ship_m = truth.ned_from_ship.translation_m - aircraft_m
    aim_m = aircraft_m + to_ship_m * min(0.5, scale * _LOOK_AHEAD_M / max(float(np.linalg.norm(to_ship_m)), 1e-9))
    return SceneState(
        t_s=truth.t_s,
        ned_from_camera=look_at(eye_m, aim_m),
        ned_from_ship=truth.ned_from_deck if full_ship else truth.ned_from_ship,
        ned_from_deck=truth.ned_from_deck,
        ned_from_bar=truth.ned_from_bar,
        ned_from_body=truth.ned_from_body,
        camera_velocity_in_ned_mps=np.zeros(3),
        camera_rate_in_camera_rad_s=np.zeros(3),
        waves_off=truth.waves_off,
    )


def look_at(eye_in_ned_m: Array, aim_in_ned_m: Array) -> Pose:
    """ned_from_camera of an upright camera at one point (3,), looking at another; not straight up or down."""
    forward = aim_in_ned_m - eye_in_ned_m
    forward = forward / np.linalg.norm(forward)
    right = np.cross([0.0, 0.0, 1.0], forward)
    right = right / np.linalg.norm(right)
    return Pose(np.column_stack([right, np.cross(forward, right), forward]), eye_in_ned_m)


def chase_view(scene: Scene, camera: Camera, scale: float = 1.0, full_ship: bool = False) -> Chase:
    """Renders the outside view with `scene`, sized to stand beside the pictures of `camera`; see `chase_state`."""
    outside = chase_camera(camera)
    return lambda truth: scene.render(chase_state(truth, scale, full_ship), outside, draw_aircraft=True)
