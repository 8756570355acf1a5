"""One instant of a flight in a few floats, and the truth and the scene that are made from it when wanted."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.camera import CameraParameters, level_from_camera
from shipland.compiled import compiled
from shipland.frames import Array, Pose, Quaternion, euler_from_quaternion
from shipland.messages import GimbalAttitude, GroundTruth
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.rotations import euler_of_quaternion, rows_of_euler, rows_of_quaternion
from shipland.sim.ship.ship import ShipState
from shipland.sim.state import SceneState


class Snapshot(NamedTuple):
    """The aircraft, its gimbal and the wind at one instant; vectors in `ned`, rates in `body`.

    Attributes:
        gimbal_pitch_rad, gimbal_pitch_rate_rad_s: as the gimbal believes.
        gimbal_error_rad: residual motion (roll, pitch) on top of it.
    """

    t_s: float
    position_m: Vector
    quaternion: Quaternion
    velocity_mps: Vector
    body_rates_rad_s: Vector
    gimbal_pitch_rad: float
    gimbal_pitch_rate_rad_s: float
    gimbal_error_rad: tuple[float, float]
    wind_mps: Vector

    @property
    def reported_gimbal(self) -> GimbalAttitude:
        """What the vehicle reports: without the residual motion, which it does not know."""
        return GimbalAttitude(0.0, self.gimbal_pitch_rad)

    @property
    def true_gimbal(self) -> GimbalAttitude:
        """Where the camera really looks."""
        roll_rad, pitch_rad = self.gimbal_error_rad
        return GimbalAttitude(roll_rad, self.gimbal_pitch_rad + pitch_rad)

    def poses(self, camera: CameraParameters) -> tuple[Pose, Pose]:
        """The aircraft's pose, and the camera's true one."""
        rotations, places_m = np.empty((2, 3, 3)), np.empty((2, 3))
        roll_rad, pitch_rad = self.gimbal_error_rad
        gimbal_rad = roll_rad, self.gimbal_pitch_rad + pitch_rad
        _place_camera(self.position_m, self.quaternion, gimbal_rad, camera.position_in_body_m, rotations, places_m)
        body, optics = map(Pose, rotations, places_m)
        return body, optics


@compiled
def _place_camera(
    position_m: Vector,
    quaternion: Quaternion,
    gimbal_rad: tuple[float, float],
    camera_in_body_m: Vector,
    rotations: Array,
    places_m: Array,
) -> None:
    """Write poses in `ned` of body and camera (`camera_pose`), rotations (2,3,3) and translations (2,3)."""
    w, x, y, z = quaternion
    size = math.sqrt(w * w + x * x + y * y + z * z)
    body = rows_of_quaternion(w / size, x / size, y / size, z / size)
    mount = rows_of_euler(gimbal_rad[0], gimbal_rad[1], euler_of_quaternion(quaternion)[2])
    for row in range(3):
        places_m[0, row] = places_m[1, row] = position_m[row]
        for column in range(3):
            rotations[0, row, column] = body[3 * row + column]
            rotations[1, row, column] = mount[3 * row + (column + 1) % 3]  # right, down, forward
            places_m[1, row] += body[3 * row + column] * camera_in_body_m[column]


def truth_of(at: Snapshot, ship: ShipState, camera: CameraParameters) -> GroundTruth:
    """The ground truth of a snapshot; `ship` at its time."""
    ned_from_body, ned_from_camera = at.poses(camera)
    return GroundTruth(
        t_s=at.t_s,
        ned_from_body=ned_from_body,
        velocity_in_ned_mps=np.array(at.velocity_mps),
        ned_from_ship=ship.ned_from_ship,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_camera=ned_from_camera,
        wind_in_ned_mps=np.array(at.wind_mps),
    )


def scene_of(at: Snapshot, ship: ShipState, camera: CameraParameters) -> SceneState:
    """What the camera sees at a snapshot; `ship` at its time."""
    ned_from_body, ned_from_camera = at.poses(camera)
    arm_m = ned_from_camera.translation_m - ned_from_body.translation_m
    turn_in_ned = ned_from_body.rotation @ np.array(at.body_rates_rad_s)
    roll_rad, pitch_rad, _ = euler_from_quaternion(at.quaternion)
    _, q, r = at.body_rates_rad_s
    heading_rate_rad_s = (q * math.sin(roll_rad) + r * math.cos(roll_rad)) / max(math.cos(pitch_rad), 0.1)
    turn_in_level = np.array([0.0, at.gimbal_pitch_rate_rad_s, heading_rate_rad_s])
    return SceneState(
        t_s=at.t_s,
        ned_from_camera=ned_from_camera,
        ned_from_ship=ship.ned_from_hull,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_body=ned_from_body,
        camera_velocity_in_ned_mps=np.array(at.velocity_mps) + np.cross(turn_in_ned, arm_m),
        camera_rate_in_camera_rad_s=level_from_camera(at.true_gimbal).T @ turn_in_level,
    )
