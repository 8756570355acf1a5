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
| `enu`    | as `ned`                        | east, north, up (ROS, REP-103)             | nothing                    |
| `…_flu`  | as the frame it is named for    | forward, left, up (ROS, REP-103)           | that frame                 |

All frames are right-handed; lengths in metres, angles in radians. `a_from_b` maps coordinates in `b` to
coordinates in `a`. Euler angles are yaw-pitch-roll (z, then y, then x, about moving axes).

The conversions are written by hand in plain floats, not with SciPy's `Rotation`: the simulated physics calls them
several times in every 2-ms tick, where building an array or an object costs ten times the arithmetic. There they are
`@compiled` by their callers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

GRAVITY_MPS2 = 9.81
"""Standard gravity, down in `ned`, for the whole package."""

Array = np.ndarray[tuple[Any, ...], np.dtype[np.float64]]
"""Not `NDArray[np.float64]`: from NumPy 2.5 on that is an alias, no type that a value could be checked against."""

Rows = tuple[float, float, float, float, float, float, float, float, float]
"""A rotation (3,3), row by row."""

Quaternion = tuple[float, float, float, float]
"""Unit quaternion (w, x, y, z), MuJoCo's order."""

CAMERA_FROM_MOUNT: Array = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Forward-right-down to OpenCV's right-down-forward."""

MUJOCO_FROM_NED: Array = np.diag([1.0, -1.0, -1.0])
"""North-east-down to MuJoCo's z-up north-west-up; its own inverse."""

ENU_FROM_NED: Array = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""North-east-down to ROS's east-north-up; its own inverse."""

FLU_FROM_FRD: Array = np.diag([1.0, -1.0, -1.0])
"""Forward-right-down (`body`, `level`, `bar`, `deck`, `mount`) to ROS's forward-left-up; its own inverse."""

for _constant in (CAMERA_FROM_MOUNT, MUJOCO_FROM_NED, ENU_FROM_NED, FLU_FROM_FRD):
    _constant.setflags(write=False)


def rows_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Rows:
    """Rotation parent_from_child of a child yawed, then pitched, then rolled against its parent."""
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    cp, sp = math.cos(pitch_rad), math.sin(pitch_rad)
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    return (
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )


def rows_from_quaternion(w: float, x: float, y: float, z: float) -> Rows:
    """Rotation of a unit quaternion."""
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quaternion:
    """Unit quaternion parent_from_child of a child yawed, then pitched, then rolled against its parent."""
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_from_quaternion(quaternion: Quaternion) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a unit quaternion."""
    w, x, y, z = quaternion
    sine = min(max(2.0 * (w * y - z * x), -1.0), 1.0)
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sine),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def rotation_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """`rows_from_euler` as an array (3,3)."""
    return np.array(rows_from_euler(roll_rad, pitch_rad, yaw_rad)).reshape(3, 3)


def euler_from_rotation(parent_from_child: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw [rad] of a rotation (3,3); at pitch ±90° roll is taken as zero."""
    r = parent_from_child
    cosine = np.hypot(r[0, 0], r[1, 0])
    pitch_rad = float(np.arctan2(-r[2, 0], cosine))  # arcsin would lose half the digits near ±90°
    if cosine < 1e-9:
        return 0.0, pitch_rad, float(np.arctan2(-r[0, 1], r[1, 1]))
    return float(np.arctan2(r[2, 1], r[2, 2])), pitch_rad, float(np.arctan2(r[1, 0], r[0, 0]))


def rotation_from_quaternion(quaternion_wxyz: Array) -> Array:
    """Rotation (3,3) of a quaternion (w, x, y, z) of any length."""
    quaternion = np.asarray(quaternion_wxyz, dtype=float)
    w, x, y, z = (quaternion / math.sqrt(quaternion.dot(quaternion))).tolist()
    return np.array(rows_from_quaternion(w, x, y, z)).reshape(3, 3)


def quaternion_from_rotation(parent_from_child: Array) -> Quaternion:
    """Unit quaternion of a rotation (3,3)."""
    return quaternion_from_euler(*euler_from_rotation(parent_from_child))


def rotated(vector: Array, angle_rad: float) -> Array:
    """A horizontal vector (2,) of axes that are turned clockwise by `angle_rad`, in those that are not."""
    x, y = vector.tolist()
    return np.array(turned(x, y, angle_rad))


def turned(x: float, y: float, angle_rad: float) -> tuple[float, float]:
    """`rotated` of a vector's components."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return cosine * x - sine * y, sine * x + cosine * y


def all_finite(values: Array) -> bool:
    """Whether every number of an array is finite; for few of them far faster than NumPy's."""
    return all(map(math.isfinite, np.asarray(values).ravel().tolist()))


def shape_of(values: npt.ArrayLike) -> tuple[int, ...]:
    """`np.shape`, which is slow for what is an array already."""
    return values.shape if isinstance(values, np.ndarray) else np.shape(values)


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
        rotation, translation = shape_of(self.rotation), shape_of(self.translation_m)
        if rotation != (3, 3) or translation != (3,):
            raise ValueError(f"Pose wants rotation (3, 3) and translation (3,), got {rotation} and {translation}")

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
