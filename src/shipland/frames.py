"""The frame table and the only axis conversions.

| frame    | origin                          | axes                                       | moves with                 |
|----------|---------------------------------|--------------------------------------------|----------------------------|
| `ned`    | chosen point on the sea surface | north, east, down                          | nothing                    |
| `ship`   | deck centre's neutral point     | forward, starboard, down                   | ship's position and course |
| `deck`   | deck centre, on its surface     | forward, starboard, down                   | ship and six deck motions  |
| `bar`    | centre of the horizon bar       | forward (into superstructure), right, down | ship; always level         |
| `body`   | aircraft's centre of mass       | forward, right, down                       | aircraft                   |
| `level`  | aircraft's centre of mass       | forward along heading, right, down         | aircraft, heading only     |
| `mount`  | camera's optical centre         | forward (optical axis), right, down        | gimbal                     |
| `camera` | camera's optical centre         | right, down, forward (OpenCV)              | gimbal                     |
| `mujoco` | as `ned`                        | north, west, up                            | nothing                    |

All frames are right-handed; lengths in metres, angles in radians. `a_from_b` maps coordinates in `b` to
coordinates in `a`. Euler angles are yaw-pitch-roll (z, then y, then x, about moving axes).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

GRAVITY_MPS2 = 9.81
"""Down in `ned`; everything that falls, swims or tilts takes it from here."""

Array = npt.NDArray[np.float64]

CAMERA_FROM_MOUNT: Array = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Forward-right-down to OpenCV's right-down-forward."""

MUJOCO_FROM_NED: Array = np.diag([1.0, -1.0, -1.0])
"""North-east-down to MuJoCo's z-up north-west-up; its own inverse."""

for _constant in (CAMERA_FROM_MOUNT, MUJOCO_FROM_NED):
    _constant.setflags(write=False)


def rotation_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Rotation parent_from_child (3,3) of a child yawed, then pitched, then rolled against its parent."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def euler_from_rotation(parent_from_child: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a rotation (3,3); at pitch ±90° roll is taken as zero."""
    r = parent_from_child
    cosine = np.hypot(r[0, 0], r[1, 0])
    pitch_rad = float(np.arctan2(-r[2, 0], cosine))  # arcsin would lose half the digits near ±90°
    if cosine < 1e-9:
        return 0.0, pitch_rad, float(np.arctan2(-r[0, 1], r[1, 1]))
    return float(np.arctan2(r[2, 1], r[2, 2])), pitch_rad, float(np.arctan2(r[1, 0], r[0, 0]))


def rotation_from_quaternion(quaternion_wxyz: Array) -> Array:
    """Rotation (3,3) of a unit quaternion (w, x, y, z), MuJoCo's order."""
    w, x, y, z = np.asarray(quaternion_wxyz, dtype=float) / np.linalg.norm(quaternion_wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def wrap_angle(angle_rad: float) -> float:
    """The same angle [rad] in [-pi, pi)."""
    wrapped = float((angle_rad + np.pi) % (2 * np.pi) - np.pi)
    return wrapped if wrapped < np.pi else -np.pi  # rounding can carry an angle just below -pi up to +pi


@dataclass(frozen=True)
class Pose:
    """Rigid transform parent_from_child.

    Attributes:
        rotation: (3,3), parent_from_child.
        translation_m: (3,), the child's origin in the parent frame [m].
    """

    rotation: Array
    translation_m: Array

    def __post_init__(self) -> None:
        if np.shape(self.rotation) != (3, 3) or np.shape(self.translation_m) != (3,):
            raise ValueError(
                f"Pose wants rotation (3, 3) and translation (3,), got {np.shape(self.rotation)} "
                f"and {np.shape(self.translation_m)}"
            )

    @staticmethod
    def identity() -> Pose:
        """The pose of a frame in itself."""
        return Pose(np.eye(3), np.zeros(3))

    @staticmethod
    def from_euler(position_m: npt.ArrayLike, roll_rad: float, pitch_rad: float, yaw_rad: float) -> Pose:
        """Pose of a child at `position_m` (3,) in its parent, turned by yaw, pitch, roll [rad]."""
        return Pose(rotation_from_euler(roll_rad, pitch_rad, yaw_rad), np.asarray(position_m, dtype=float))

    def inverse(self) -> Pose:
        """child_from_parent."""
        return Pose(self.rotation.T, -self.rotation.T @ self.translation_m)

    def __matmul__(self, other: Pose) -> Pose:
        """a_from_c = a_from_b @ b_from_c."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation_m + self.translation_m)

    def apply(self, points_in_child_m: Array) -> Array:
        """Points (…,3) in the child frame, given in the parent frame [m]."""
        return points_in_child_m @ self.rotation.T + self.translation_m

    def matrix(self) -> Array:
        """Homogeneous (4,4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation_m
        return matrix
