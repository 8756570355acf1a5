"""Moves the ship's bodies in MuJoCo: joint positions, velocities and forces of the deck, poses of hull and board."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.frames import Array, Rows
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.contact.model import DECK_ARMATURE, Model
from shipland.sim.contact.touchdown import OnDeck
from shipland.sim.rotations import quaternion_of_euler, rows_of_euler, rows_of_quaternion
from shipland.sim.ship.ship import ShipState

if TYPE_CHECKING:
    import mujoco


class DeckState(NamedTuple):
    """The deck in `ned`.

    Attributes:
        origin_m, velocity_mps, acceleration_mps2: of the deck's centre.
        angles_rad, rates_rad_s, accelerations_rad_s2: roll, pitch, yaw (course and the deck's own) and derivatives.
        ned_from_deck: rotation, row by row.
        turn_rad_s: angular velocity vector.
    """

    origin_m: Vector
    velocity_mps: Vector
    acceleration_mps2: Vector
    angles_rad: Vector
    rates_rad_s: Vector
    accelerations_rad_s2: Vector
    ned_from_deck: Rows
    turn_rad_s: Vector

    @staticmethod
    def of(values: Array) -> DeckState:
        """From its (30,) values in their order."""
        (x, y, z, u, v, w, a, b, c, roll, pitch, yaw, p, q, r, d, e, f, *rows, i, j, k) = values.tolist()
        moving, turning = ((x, y, z), (u, v, w), (a, b, c)), ((roll, pitch, yaw), (p, q, r), (d, e, f))
        return DeckState(*moving, *turning, tuple(rows), (i, j, k))

    def point_in_deck(self, position_m: Vector, ned_from_body: Rows, place_in_body_m: Vector) -> Vector:
        """A point of a body at `position_m` in `ned`, in `deck`."""
        a, b, c = place_in_body_m
        r, m, origin = ned_from_body, self.ned_from_deck, self.origin_m
        x = position_m[0] + r[0] * a + r[1] * b + r[2] * c - origin[0]
        y = position_m[1] + r[3] * a + r[4] * b + r[5] * c - origin[1]
        z = position_m[2] + r[6] * a + r[7] * b + r[8] * c - origin[2]
        return m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z


def deck_values(ship: ShipState) -> Array:
    """(30,) the deck's motion in `ned`, in the order of `DeckState`."""
    values = np.empty(30)
    deck_in_ned(ship.course.values, ship.deck.values, ship.rig.deck_height_m, values)
    return values


@compiled
def deck_in_ned(course: Array, deck_in_ship: Array, deck_height_m: float, deck: Array) -> None:
    """Course translation and turn combined with the deck's six coordinates.

    With d the deck's centre in `ship`, R the turn by the course and ω, α the course's rates about down:
    p = P + R d, v = P' + R (d' + ω×d), a = P'' + R (d'' + α×d + 2 ω×d' + ω×(ω×d)).
    The course and the deck's yaw turn about the same axis, so their angles add.

    Args:
        course: (9,) of `CourseState.values`.
        deck_in_ship: (18,) of `SixDof.values`.
        deck_height_m: of its neutral point over the sea plane.
        deck: (30,) written to, in the order of `DeckState`.
    """
    north, east, v_north, v_east, a_north, a_east, angle, w, e = course
    dx, dy, dz, roll, pitch, yaw = deck_in_ship[:6]
    vx, vy, vz, roll_rate, pitch_rate, yaw_rate = deck_in_ship[6:12]
    ax, ay, az, roll_acc, pitch_acc, yaw_acc = deck_in_ship[12:]
    c, s = math.cos(angle), math.sin(angle)
    ux, uy = vx - w * dy, vy + w * dx
    bx = ax - e * dy - 2.0 * w * vy - w * w * dx
    by = ay + e * dx + 2.0 * w * vx - w * w * dy
    yaw, yaw_rate, yaw_acc = yaw + angle, yaw_rate + w, yaw_acc + e
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    deck[0], deck[1], deck[2] = north + c * dx - s * dy, east + s * dx + c * dy, dz - deck_height_m
    deck[3], deck[4], deck[5] = v_north + c * ux - s * uy, v_east + s * ux + c * uy, vz
    deck[6], deck[7], deck[8] = a_north + c * bx - s * by, a_east + s * bx + c * by, az
    deck[9], deck[10], deck[11] = roll, pitch, yaw
    deck[12], deck[13], deck[14] = roll_rate, pitch_rate, yaw_rate
    deck[15], deck[16], deck[17] = roll_acc, pitch_acc, yaw_acc
    rows = rows_of_euler(roll, pitch, yaw)
    for index in range(9):
        deck[18 + index] = rows[index]
    deck[27] = roll_rate * cy * cp - pitch_rate * sy
    deck[28] = roll_rate * sy * cp + pitch_rate * cy
    deck[29] = yaw_rate - roll_rate * sp


def against_deck(deck: Array, motion: Array) -> OnDeck:
    """A body against the deck.

    Args:
        deck: (30,) as in `DeckState`.
        motion: (13,) as in `RigidBodyState`.
    """
    return OnDeck(*_against_deck(deck, motion))


@compiled
def _against_deck(deck: Array, motion: Array) -> tuple[Vector, Vector, float]:
    x, y, z = motion[0] - deck[0], motion[1] - deck[1], motion[2] - deck[2]
    p, q, r = deck[27:]
    u = motion[7] - deck[3] - (q * z - r * y)
    v = motion[8] - deck[4] - (r * x - p * z)
    w = motion[9] - deck[5] - (p * y - q * x)
    m, rows = deck[18:27], rows_of_quaternion(motion[3], motion[4], motion[5], motion[6])
    upright = m[2] * rows[2] + m[5] * rows[5] + m[8] * rows[8]
    return (
        (m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z),
        (m[0] * u + m[3] * v + m[6] * w, m[1] * u + m[4] * v + m[7] * w, m[2] * u + m[5] * v + m[8] * w),
        math.acos(min(max(upright, -1.0), 1.0)),
    )


class DeckDriver:
    """Writes the ship into MuJoCo's data.

    MuJoCo's integrator is semi-implicit: its velocities belong half a step before its positions. The deck's velocity
    is set that way too, or what stands on a deck with acceleration a creeps at ½ a step_s (1 mm/s in a turn).
    """

    def __init__(self, model: Model, data: mujoco.MjData) -> None:
        self._half_step_s = 0.5 * model.mj.opt.timestep
        self._joints = data.qpos[7:13], data.qvel[6:12], data.qfrc_applied[6:12]
        self._ship = data.mocap_pos[model.ship_mocap], data.mocap_quat[model.ship_mocap]
        self._bar = data.mocap_pos[model.board_mocap], data.mocap_quat[model.board_mocap]

    def set_deck(self, deck: Array) -> None:
        """Joint coordinates of the deck, (30,) as in `DeckState`."""
        _set_deck(deck, self._half_step_s, self._joints)

    def set_hull(self, ship: ShipState, deck: Array) -> None:
        """Poses of the superstructure and of the board."""
        _set_hull(
            deck,
            ship.course.values,
            ship.rig.bar_in_ship_m,
            ship.rig.deck_height_m,
            ship.full_ship,
            self._ship,
            self._bar,
        )


@compiled
def _set_deck(deck: Array, half_step_s: float, joints: tuple[Array, Array, Array]) -> None:
    """Place, velocity, force: x y z yaw pitch roll in `mujoco`: east, down, yaw and pitch change sign."""
    for joint, (index, sign) in enumerate(_JOINTS):
        moved = deck[index + 3] - half_step_s * deck[index + 6]
        joints[0][joint] = sign * deck[index]
        joints[1][joint] = sign * moved
        joints[2][joint] = sign * DECK_ARMATURE * deck[index + 6]


_JOINTS = ((0, 1.0), (1, -1.0), (2, -1.0), (11, -1.0), (10, -1.0), (9, 1.0))
"""Of each joint of the deck: its coordinate in `DeckState`, three before its rate and six before its acceleration."""


@compiled
def _set_hull(
    deck: Array,
    course: Array,
    bar_in_ship_m: Array,
    deck_height_m: float,
    full_ship: bool,
    ship: tuple[Array, Array],
    bar: tuple[Array, Array],
) -> None:
    """Place and turn of the superstructure and of the board."""
    x, y, z = bar_in_ship_m
    if full_ship:
        north, east, down, roll, pitch, yaw = deck[0], deck[1], deck[2], deck[9], deck[10], deck[11]
        m = deck[18:27]
        arm = m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z
    else:
        north, east, down, roll, pitch, yaw = course[0], course[1], -deck_height_m, 0.0, 0.0, course[6]
        c, s = math.cos(yaw), math.sin(yaw)
        arm = c * x - s * y, s * x + c * y, z
    _set_pose(ship, (north, east, down), (roll, pitch, yaw))
    _set_pose(bar, (north + arm[0], east + arm[1], down + arm[2]), (0.0, 0.0, yaw))


@compiled
def _set_pose(pose: tuple[Array, Array], place_m: Vector, angles_rad: Vector) -> None:
    place, turn = pose
    place[0], place[1], place[2] = place_m[0], -place_m[1], -place_m[2]
    w, x, y, z = quaternion_of_euler(*angles_rad)
    turn[0], turn[1], turn[2], turn[3] = w, x, -y, -z
